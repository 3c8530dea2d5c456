"""Error floor: the part of a picture's error that more samples do not reduce.

It has two causes: paths end at settings.depth, and files round colours. If a user asks for an error below the floor,
visray refuses, with a message that says what would be right.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from visray.adaptive.depth_bias import PIXELS, SAMPLES, DepthBias, deeper_than, depth_biases, depth_without_bias
from visray.adaptive.dual_buffer import DualBuffer
from visray.adaptive.estimate import Estimate
from visray.errors import DepthWarning, UserError
from visray.geometry import gamma as rounded
from visray.output.curves import Gamma
from visray.output.rounding import rounding
from visray.scene.scene import DEEPEST
from visray.warn import warn

# Share of the remaining time that the estimate of the depth bias may take.
DEPTH_SHARE = 0.05
# Factor by which the number of test pixels grows if the first estimate of the depth bias is too uncertain.
MORE_PIXELS = 8
# A depth leaves room for noise if its squared bias is at most this share of the squared error.
ROOM = 1 / 4
LARGER = "ask for a larger error"
FILES = {
    ".png": ("8-bit output as PNG", f"write an .exr file, or {LARGER}"),
    ".exr": ("half precision of EXR", f"write float colours (--float), or {LARGER}"),
}
# Least number of roundings in the colour of a sample that are the same for all samples of a flat surface: those of two
# products of light and material, and of their sum.
ROUNDINGS = 4


@dataclass(frozen=True)
class Files:
    """Files that a picture will be written to.

    paths: paths of the files.
    gamma, exposure: display curve and exposure in stops of PNG files.
    float32: whether the colours of EXR files are float, not half.
    """

    paths: Sequence[str | Path] = ()
    gamma: Gamma = "srgb"
    exposure: float = 0.0
    float32: bool = False


@dataclass(frozen=True)
class Floor:
    """Error floor, as mean squares over pixels and channels.

    depth: the depth bias.
    rounding: mean square of the rounding error of a file, the one with the smallest such error.
    """

    depth: DepthBias
    rounding: float = 0.0

    @property
    def square(self) -> float:
        """Estimated mean square of the floor."""
        return max(self.depth.square, 0.0) + self.rounding

    @property
    def low(self) -> float:
        """Lower end of the 95 % interval of the mean square."""
        return max(self.depth.low, 0.0) + self.rounding

    @property
    def high(self) -> float:
        """Upper end of the 95 % interval of the mean square."""
        return max(self.depth.high, 0.0) + self.rounding


def file_rounding(buffer: DualBuffer, files: Files) -> tuple[float, str]:
    """Mean square of the rounding error of the file that rounds least, and the suffix of this file. If there are no
    files, 0 and ""."""
    if not files.paths:
        return 0.0, ""
    # The pixels may stay in the order of lanes, because the error of a file does not depend on their order.
    picture = buffer.mean().T[None]
    options = files.gamma, files.exposure, files.float32
    errors = {Path(p).suffix.lower(): rounding(picture, p, *options) for p in files.paths}
    suffix, least = min(errors.items(), key=lambda pair: pair[1])
    return least**2, suffix


def checked_floor(
    buffer: DualBuffer, estimate: Estimate, error: float | None, files: Files, seconds: float = np.inf
) -> Floor:
    """Error floor of a picture. Raises UserError if the depth bias, the rounding of shading, or the rounding of every
    file may exceed the error that is asked for.

    buffer: dual buffer with a pilot of the picture.
    estimate: estimated error of the pilot.
    error: the error that is asked for, or None.
    files: files that the picture will be written to.
    seconds: time left for the whole picture.
    """
    scene = buffer.prepared.scene
    settings, on = scene.settings, buffer.prepared.features
    # The error is clamped so that its square does not overflow.
    absolute = np.inf if error is None else min(float(error), 1e100) * estimate.luminance
    if error is not None:
        check_precision(error, settings.precision)
    file_square, suffix = file_rounding(buffer, files)
    if file_square > absolute**2 and estimate.luminance > 0:
        least = np.sqrt(file_square) / estimate.luminance
        format_name, remedy = FILES[suffix]
        raise UserError(f"error = {error:g}: {format_name} alone is off by {least:.2g}; {remedy}")
    depth = settings.depth
    # If the scene has no reflection and no refraction, there is no bias. A depth of 0 switches both off.
    if not (on["reflection"] or on["refraction"]):
        return Floor(DepthBias(depth, 0.0, 0.0, 0.0), file_square)
    reference_depth = depth_without_bias(depth)
    (bias,) = depth_biases(buffer, (depth,), reference_depth, DEPTH_SHARE * seconds)
    if bias.low <= absolute**2 / 2 < bias.high and seconds == np.inf:
        # The interval is too wide to decide whether the error can be reached.
        (bias,) = depth_biases(buffer, (depth,), reference_depth, pixels=MORE_PIXELS * PIXELS, count=SAMPLES)
    if bias.high > absolute**2:
        good = _deep_enough(buffer, absolute)
        interval = " to ".join(f"{np.sqrt(max(x, 0)) / estimate.luminance:.2g}" for x in (bias.low, bias.high))
        remedy = f"settings.depth = {good} would do, or {LARGER}" if good else LARGER
        raise UserError(f"error = {error:g}: settings.depth = {depth} alone leaves out {interval} (95 %); {remedy}")
    if bias.high > absolute**2 / 2 and seconds == np.inf and (good := _deep_enough(buffer, absolute)):
        # What is left for noise is so little that at least twice as many samples are needed.
        alone = 100 * np.sqrt(bias.high) / estimate.luminance
        text = f"alone makes up to {alone:.2g} % of the error {100 * error:.2g} %; with {good} fewer samples are enough"
        warn(f"settings.depth = {depth}: {text}", DepthWarning)
    return Floor(bias, file_square)


def _deep_enough(buffer: DualBuffer, absolute: float) -> int | None:
    """A larger depth whose bias is small beside an error; None if settings.depth is the largest one.

    absolute: root mean square of the error
    """
    depth = buffer.prepared.scene.settings.depth
    reference_depth, deeper = depth_without_bias(depth), deeper_than(depth)
    biases = depth_biases(buffer, deeper, reference_depth) if deeper else []
    # The reference depth counts as free of bias.
    last = min(reference_depth, DEEPEST)
    return next((b.depth for b in biases if b.high <= ROOM * absolute**2), last if last > depth else None)


def check_precision(error: float, precision: str) -> None:
    """Raises a UserError if the error that is asked for is below the rounding error of shading.

    precision: precision of shading, "single" or "double".
    """
    finest = rounded(ROUNDINGS, precision)
    if error < finest:
        remedy = f"{LARGER}, or use double" if precision == "single" else LARGER
        raise UserError(f"error = {error:g}: {precision} precision is off by {finest:.1g}; {remedy}")
