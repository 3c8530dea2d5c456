"""Black and empty pictures say why: a note names the cause, with its address.

A picture is looked at after its first pass. Only if it is black, shows nothing, or may show no light of a light, a few
rays look for the cause. So other pictures cost nothing.
"""

import warnings
from typing import Any

import numpy as np

from visray.dark.evidence import NEARLY_BLACK, is_lit, may_be_unlit, shows_only_background
from visray.dark.lighting import unlit_notes
from visray.dark.view import PictureRays, empty_notes
from visray.modes import BY_NAME
from visray.progress import Interrupts
from visray.setup import Prepared

__all__ = ["DarkWarning", "dark_notes", "warn_of_dark"]


class DarkWarning(UserWarning):
    """Warning that a picture is black, or shows nothing, or only ambient light, and why."""


def warn_of_dark(notes: list[str], stacklevel: int) -> None:
    """Shows the notes of `dark_notes`. stacklevel: as in warnings.warn, for the function that calls this one."""
    for text in notes:
        warnings.warn(text, DarkWarning, stacklevel=stacklevel + 1)


def dark_notes(
    prepared: Prepared,
    rgb: Any,
    coverage: np.ndarray,
    interrupts: Interrupts | None = None,
    may_look: bool = True,
) -> list[str]:
    """List of sentences that say why a picture is black, shows nothing, or shows no light of a light.

    rgb: colours of the pixels. coverage: their coverage (alpha).
    interrupts: ends a look when Ctrl-C is pressed
    may_look: whether a picture that is not black may be rendered once more, with one sample for each pixel and without
        ambient light and background, to see whether light of a light is in it. Of a prepared scene this is done once.
    Shapes: rgb (3, N), coverage (N), in the order of lanes.
    """
    rgb = np.array(rgb)
    on, lit_mode = prepared.features, BY_NAME[prepared.scene.settings.shading].lit
    black, lights_shine = bool(rgb.max() <= NEARLY_BLACK), on["diffuse"] or on["specular"]
    shines = on["emission"] or on["visible lights"]
    # Nothing shines on any surface; or the colours of the picture leave it open whether a light does.
    unlit = lit_mode and not (lights_shine or on["ambient"] or on["scatter"] or on["unlit"] or shines)
    open_question = lit_mode and lights_shine and not black and may_look and not prepared.looked
    open_question = open_question and may_be_unlit(prepared, rgb)
    only_background = shows_only_background(prepared, rgb, coverage)
    if not (black or unlit or open_question or only_background):
        return []
    prepared.looked.add("light")
    rays = PictureRays.of(prepared)
    if not rays.hit.any():
        return empty_notes(prepared) if only_background else []
    if lit_mode and (black or unlit or (open_question and not is_lit(prepared, interrupts))):
        return unlit_notes(prepared, rays, black)
    return []
