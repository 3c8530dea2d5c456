"""How a picture of a surface looks: two colours, two lights, and a plain background."""

import numpy as np

from visray.fitting import PAPER, Rig
from visray.materials import Material

# Linear colours of the side of the surface that is seen more, and of the other.
WARM, COOL = (0.8, 0.22, 0.04), (0.03, 0.22, 0.48)
# Light from everywhere, which is less in hollows. A surface shows its colour times it.
AMBIENT_LIGHT = (0.25, 0.25, 0.25)
SHINE, SHININESS = 0.3, 80.0
BACKGROUND = PAPER
# The key light is higher than over a map, so that the shapes of hollows are seen.
RIG = Rig(key=(-0.6, 0.4, 0.7), key_light=0.9, fill_light=0.32)
# Names of the two materials: outside is the side that is seen more.
OUTSIDE, INSIDE = "outside", "inside"


def side(front: np.ndarray) -> str:
    """Name of the material of the front, where f > 0. front: whether the front is seen at each of many points."""
    return OUTSIDE if 2 * np.count_nonzero(front) >= len(front) else INSIDE


def materials(front: np.ndarray, outside: tuple | None, inside: tuple | None) -> dict[str, Material]:
    """The materials of both sides. outside, inside: their colours; None for the usual ones. front: as in `side`."""
    colors = {OUTSIDE: outside or WARM, INSIDE: inside or COOL}
    first = side(front)
    second = INSIDE if first == OUTSIDE else OUTSIDE
    return {first: _material(colors[first], second), second: _material(colors[second], None)}


def _material(color: tuple, back: str | None) -> Material:
    """A material with a colour, a soft highlight, and the material of its other side."""
    return Material(kd=tuple(map(float, color)), ks=(SHINE,) * 3, shininess=SHININESS, back=back)
