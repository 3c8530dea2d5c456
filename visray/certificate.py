"""The certificate of polynomial surfaces and tori: how precisely the points are known where rays cross such surfaces.

The layers `unresolved` and `residual` contain the certificate of each pixel (integrator.certificate). This module
computes facts for the metadata from them, and warns.
"""

import warnings
from typing import Any

import numpy as np

from visray.setup import Prepared

# Residuals are distances of points from their surface, in units in the last place (ulp). Rounding errors, and the lower
# accuracy near singular points, do not give residuals above this limit.
LARGEST_RESIDUAL = 1e9
# At the edges of surfaces there are always a few rays for which rounding hides whether they hit. There is a warning if
# their number is a larger share of the pixels.
LARGEST_UNRESOLVED = 1e-3
ADVICE = "a tighter clip helps, or f written in products and powers"


class RootWarning(UserWarning):
    """Warning that double precision does not suffice to find where some rays hit a surface."""


def certificate_facts(layers: dict[str, np.ndarray]) -> dict[str, Any]:
    """Dict of facts for the metadata: the number of unresolved parts of rays, and the largest residual in ulps.

    layers: layers of the picture by name.
    """
    facts = {}
    if "unresolved" in layers:
        facts["unresolved"] = int(layers["unresolved"].sum())
    if "residual" in layers:
        # JSON has no infinity.
        facts["residual_ulps"] = min(float(layers["residual"].max()), float(np.finfo(np.float32).max))
    return facts


def warn_of_roots(facts: dict[str, Any], prepared: Prepared) -> None:
    """Warns if many parts of rays are unresolved, or if a residual is large.

    facts: facts of certificate_facts.

    The warning shows the line of code that called vr.render.
    """
    pixels = len(prepared.order)
    if facts.get("unresolved", 0) > LARGEST_UNRESOLVED * pixels:
        text = f"{facts['unresolved']} parts of rays could not be told from rounding; {ADVICE}"
        warnings.warn(text, RootWarning, stacklevel=4)
    if facts.get("residual_ulps", 0) <= LARGEST_RESIDUAL:
        return
    # If an object has a `tolerance`, the user has chosen to be less exact.
    if not any(getattr(shape, "tolerance", 0) for _, shape in prepared.scene.shapes()):
        text = f"what is seen is up to {facts['residual_ulps']:.2g} ulp off its surface; {ADVICE}"
        warnings.warn(text, RootWarning, stacklevel=4)
