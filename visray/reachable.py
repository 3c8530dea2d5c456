"""Errors that no number of samples gets below: refused, with what would be right."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from visray.errors import UserError
from visray.geometry import gamma as rounded
from visray.halves import Estimate, Halves
from visray.output.image import Gamma
from visray.rounding import rounding
from visray.truncation import Truncation, truncation

# No scene is deeper.
DEEPEST = 1000
# Of the seconds that are left, for what depth leaves out.
SHARE = 0.05
LARGER = "ask for a larger error"
# So many roundings a sample's colour has at least, which is the same for all samples of a flat place: light times
# material, twice, and their sum.
ROUNDINGS = 4


@dataclass(frozen=True)
class Files:
    """Where a picture goes: the paths, and the display curve of PNG files."""

    paths: Sequence[str | Path] = ()
    gamma: Gamma = "srgb"
    exposure: float = 0.0


def unavoidable(
    halves: Halves, found: Estimate, error: float | None, files: Files, seconds: float = np.inf
) -> Truncation:
    """What the scene's depth leaves out; raises UserError if that, the precision or the rounding of all files may be
    above the error that is asked for. `halves`: a pilot, of which `found` is the error; seconds: that are left."""
    scene = halves.made.scene
    settings, on = scene.settings, halves.made.features
    asked = np.inf if error is None else float(error) * found.luminance
    finest = rounded(ROUNDINGS, settings.precision)
    if error is not None and error < finest:
        right = f"{LARGER}, or use double" if settings.precision == "single" else LARGER
        raise UserError(f"error = {error:g}: {settings.precision} precision is off by {finest:.1g}; {right}")
    if error is not None and found.luminance > 0 and files.paths:
        _check_files(halves, error, found.luminance, files)
    depth = settings.depth
    if not (on["reflection"] or on["refraction"]):
        return Truncation(depth, 0.0, 0.0, 0.0)
    deep = min(8 * depth + 8, 2 * DEEPEST)
    (here,) = truncation(halves, (depth,), deep, SHARE * seconds)
    if here.low <= asked**2 / 2 < here.high and seconds == np.inf:
        # Some of the pixels do not tell.
        (here,) = truncation(halves, (depth,), deep, pixels=halves.n)
    if here.high > asked**2:
        deeper = sorted({min(n, DEEPEST) for n in (2 * depth + 2, 4 * depth + 4)})
        good = [t.depth for t in truncation(halves, tuple(deeper), deep) if t.high <= asked**2 / 4]
        left = np.sqrt(max(here.square, 0)) / found.luminance
        right = f"settings.depth = {good[0]} would do" if good else "raise settings.depth"
        raise UserError(
            f"error = {error:g}: settings.depth = {depth} alone leaves out {left:.2g}; {right}, or {LARGER}"
        )
    return here


def _check_files(halves: Halves, error: float, luminance: float, files: Files) -> None:
    """Refuses an error that the rounding of every file is above."""
    a, b = halves.means()
    # Their own curve is that of the lanes; a file's error does not depend on the order of pixels.
    picture = ((a + b) / 2).T[None]
    off = {Path(p).suffix.lower(): rounding(picture, p, files.gamma, files.exposure) / luminance for p in files.paths}
    kind, least = min(off.items(), key=lambda pair: pair[1])
    if error < least:
        what, right = {
            ".png": ("8-bit output as PNG", f"write an .exr file, or {LARGER}"),
            ".exr": ("half precision of EXR", LARGER),
        }[kind]
        raise UserError(f"error = {error:g}: {what} alone is off by {least:.2g}; {right}")
