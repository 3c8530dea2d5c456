"""The certificate of polynomial surfaces and tori: sums over a picture for its metadata, and warnings."""

import warnings
from typing import Any

import numpy as np

from visray.setup import Prepared

# A residual above this many units in the last place is neither rounding nor the blur of a singular point.
LARGEST_RESIDUAL = 1e9
# At edges a few rays are always within rounding of a crossing; a larger share of the pixels gets a warning.
LARGEST_UNRESOLVED = 1e-3
ADVICE = "a tighter clip helps, or f written in products and powers"


class RootWarning(UserWarning):
    """Double precision does not tell where some rays meet a surface."""


def certificate_facts(layers: dict[str, np.ndarray]) -> dict[str, Any]:
    """Facts for the metadata: how many parts of rays are unresolved, and the largest residual in ulps."""
    facts = {}
    if "unresolved" in layers:
        facts["unresolved"] = int(layers["unresolved"].sum())
    if "residual" in layers:
        # JSON has no infinity.
        facts["residual_ulps"] = min(float(layers["residual"].max()), float(np.finfo(np.float32).max))
    return facts


def warn_of_roots(facts: dict[str, Any], prepared: Prepared) -> None:
    """Warns where crossings with a surface are not known to rounding. The warning names the caller of the caller."""
    pixels = len(prepared.order)
    if facts.get("unresolved", 0) > LARGEST_UNRESOLVED * pixels:
        text = f"{facts['unresolved']} parts of rays could not be told from rounding; {ADVICE}"
        warnings.warn(text, RootWarning, stacklevel=3)
    if facts.get("residual_ulps", 0) <= LARGEST_RESIDUAL:
        return
    # With a `tolerance` the user has chosen to be less exact.
    if not any(getattr(shape, "tolerance", 0) for shape in prepared.scene.objects.values()):
        text = f"what is seen is up to {facts['residual_ulps']:.2g} ulp off its surface; {ADVICE}"
        warnings.warn(text, RootWarning, stacklevel=3)
