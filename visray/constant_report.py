"""Notes about constants of polynomials that are rounded, for `visray explain`."""

from visray.primitives.polynomial import Polynomial
from visray.scene.scene import Scene

# Number of constants of one polynomial whose texts are shown.
SHOWN = 4


def constant_notes(scene: Scene) -> list[str]:
    """List of sentences about the polynomials with constants, such as sin(1), that have no exact form here."""
    notes = []
    for address, shape in scene.shapes():
        if isinstance(shape, Polynomial) and (texts := shape.rounded_constants()):
            listed = ", ".join(texts[:SHOWN]) + (", ..." if len(texts) > SHOWN else "")
            verb = "is" if len(texts) == 1 else "are"
            notes.append(f"{address}: {listed} {verb} rounded to 53 bits, the nearest double")
    return notes
