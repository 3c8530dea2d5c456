"""Errors that samples do not take away: they are part of a picture's error, and one that is asked for below them is
refused, with what would be right."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from visray.adaptive.depth_bias import PIXELS, SAMPLES, DepthBias, truncation
from visray.adaptive.dual_buffer import DualBuffer, Estimate
from visray.errors import UserError
from visray.geometry import gamma as rounded
from visray.output.curves import Gamma
from visray.output.rounding import rounding

# No scene is deeper.
DEEPEST = 1000
# Of the seconds that are left, for what depth leaves out.
SHARE = 0.05
# Times as many pixels tell more of that, where it is doubtful.
MORE = 8
LARGER = "ask for a larger error"
FILES = {
    ".png": ("8-bit output as PNG", f"write an .exr file, or {LARGER}"),
    ".exr": ("half precision of EXR", LARGER),
}
# So many roundings a sample's colour has at least, which is the same for all samples of a flat place: light times
# material, twice, and their sum.
ROUNDINGS = 4


@dataclass(frozen=True)
class Files:
    """Where a picture goes: the paths, and the display curve of PNG files."""

    paths: Sequence[str | Path] = ()
    gamma: Gamma = "srgb"
    exposure: float = 0.0


@dataclass(frozen=True)
class Floor:
    """Mean squares over pixels and channels of what samples do not take away. depth: what is left out; rounding: of the
    file that is best."""

    depth: DepthBias
    rounding: float = 0.0

    @property
    def square(self) -> float:
        return max(self.depth.square, 0.0) + self.rounding

    @property
    def low(self) -> float:
        return max(self.depth.low, 0.0) + self.rounding

    @property
    def high(self) -> float:
        return max(self.depth.high, 0.0) + self.rounding


def rounded_off(halves: DualBuffer, files: Files) -> tuple[float, str]:
    """The mean square by which the best of the files is off, as it rounds, and its kind; 0 where there are none."""
    if not files.paths:
        return 0.0, ""
    # Their own curve is that of the lanes; a file's error does not depend on the order of pixels.
    picture = halves.mean().T[None]
    off = {Path(p).suffix.lower(): rounding(picture, p, files.gamma, files.exposure) for p in files.paths}
    kind, least = min(off.items(), key=lambda pair: pair[1])
    return least**2, kind


def unavoidable(
    halves: DualBuffer, found: Estimate, error: float | None, files: Files, seconds: float = np.inf
) -> Floor:
    """What samples do not take away; raises UserError if what the depth leaves out, the precision or the rounding of
    all files may be above the error that is asked for. `halves`: a pilot, of which `found` is the error; seconds: that
    are left."""
    scene = halves.prepared.scene
    settings, on = scene.settings, halves.prepared.features
    # Its square must be a number too.
    asked = np.inf if error is None else min(float(error), 1e100) * found.luminance
    if error is not None:
        check_precision(error, settings.precision)
    off, kind = rounded_off(halves, files)
    if off > asked**2 and found.luminance > 0:
        least = np.sqrt(off) / found.luminance
        what, right = FILES[kind]
        raise UserError(f"error = {error:g}: {what} alone is off by {least:.2g}; {right}")
    depth = settings.depth
    # A depth of 0 switches them off: that is what the scene is, not what is left out.
    if not (on["reflection"] or on["refraction"]):
        return Floor(DepthBias(depth, 0.0, 0.0, 0.0), off)
    deep = min(8 * depth + 8, 2 * DEEPEST)
    (here,) = truncation(halves, (depth,), deep, SHARE * seconds)
    if here.low <= asked**2 / 2 < here.high and seconds == np.inf:
        # Some samples of some of the pixels do not tell.
        (here,) = truncation(halves, (depth,), deep, pixels=MORE * PIXELS, count=SAMPLES)
    if here.high > asked**2:
        deeper = sorted({min(n, DEEPEST) for n in (2 * depth + 2, 4 * depth + 4)})
        good = [t.depth for t in truncation(halves, tuple(deeper), deep) if t.high <= asked**2 / 4]
        left = " to ".join(f"{np.sqrt(max(x, 0)) / found.luminance:.2g}" for x in (here.low, here.high))
        right = f"settings.depth = {good[0]} would do" if good else "raise settings.depth"
        raise UserError(
            f"error = {error:g}: settings.depth = {depth} alone leaves out {left} (95 %); {right}, or {LARGER}"
        )
    return Floor(here, off)


def check_precision(error: float, precision: str) -> None:
    """Refuses an error that a precision of shading does not hold."""
    finest = rounded(ROUNDINGS, precision)
    if error < finest:
        right = f"{LARGER}, or use double" if precision == "single" else LARGER
        raise UserError(f"error = {error:g}: {precision} precision is off by {finest:.1g}; {right}")
