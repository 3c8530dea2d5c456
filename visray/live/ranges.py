"""Ranges of sliders: from where to where a number may be moved, and in which steps."""

import math
from typing import NamedTuple

from visray.live.fields import Limits
from visray.quantities import FARTHEST

# The most that a field with this name is usually moved through. The field may contain other numbers, too.
USUAL = {
    "ior": (1.0, 2.5),
    "fov": (5.0, 120.0),
    "angle": (0.0, 90.0),
    "rotate": (-180.0, 180.0),
    "rotation": (-180.0, 180.0),
    "color.exponent": (0.1, 3.0),
}
# The largest number of the slider of a field with this name that contains 0.
FROM_ZERO = {"shininess": 100.0, "exponent": 10.0, "intensity": 2.0}
# A limit that is farther than this from the other one is no end of a slider.
WIDEST = 360.0
# Numbers this large stand for "without a limit", as materials' dmax does. No slider reaches them.
ENDLESS = 1e8


class Range(NamedTuple):
    """The numbers that a slider reaches, and its steps. has_slider: whether there is one; else the number is typed."""

    low: float
    high: float
    step: float
    has_slider: bool = True

    def containing(self, *values: float) -> "Range":
        """The range, made longer so that it contains some values."""
        return self._replace(low=min(self.low, *values), high=max(self.high, *values))


def nice(x: float) -> float:
    """The smallest of 1, 2 and 5, times a power of ten, that is not below x. Domain: x > 0."""
    unit = 10.0 ** math.floor(math.log10(x))
    return next((float(f"{m * unit:.6g}") for m in (1, 2, 5) if m * unit >= x * (1 - 1e-9)), float(f"{10 * unit:.6g}"))


def step_of(width: float) -> float:
    """The steps of a slider of some width: a power of ten, between a 200th and a 2000th of it. Domain: width > 0."""
    return 10.0 ** math.floor(math.log10(width / 200))


def range_of(name: str, values: tuple[float, ...], limits: Limits, extent: float) -> Range:
    """The range of a slider that contains some numbers, which are those of a field now.

    name: name of the field, without numbers; where that says too little, with its owner, such as color.exponent.
    limits: what the field may contain.
    extent: size of the scene, in world units; of data, in their units.
    """
    lowest, highest = min(values), max(values)
    if max(abs(lowest), abs(highest)) >= ENDLESS:
        step = step_of(extent)
        return Range(*_allowed(limits.least, limits.most, step, limits), step, has_slider=False)
    low, high = _ends(name, lowest, highest, limits, extent)
    step = step_of(high - low)
    low, high = _allowed(low, high, step, limits)
    return Range(low, high, step).containing(*values)


def range_around(ends: tuple[float, float], is_positive: bool) -> Range:
    """The range of a slider for two numbers that rise, with room on both sides. is_positive: whether both must stay
    above 0."""
    low, high = ends
    room = 0.25 * (high - low) or max(abs(high), 1.0)
    low, high = (0.5 * low if is_positive else low - room), high + room
    return Range(low, high, step_of(high - low))


def _ends(name: str, lowest: float, highest: float, limits: Limits, extent: float) -> tuple[float, float]:
    """The ends of a range, which may be beyond the limits."""
    if name in USUAL:
        return USUAL[name]
    if limits.most - limits.least <= WIDEST:
        return limits.least, limits.most
    zero = 2 * extent if name == "focus" else FROM_ZERO.get(name, _default(limits, extent))
    largest = max(abs(lowest), abs(highest))
    # What is below all lengths is as good as 0.
    reach = nice(2 * largest) if largest > 1 / FARTHEST else nice(zero)
    if limits.unit.startswith("world units") and limits.least < 0:
        # Places: a slider that moves a small thing through the whole scene.
        reach = max(reach, nice(extent / 2))
    return (0.0 if limits.least >= 0 else -reach), reach


def _default(limits: Limits, extent: float) -> float:
    """Reach of the slider of a number that is 0."""
    if not limits.unit.startswith("world units"):
        return 1.0
    return extent / 2 if limits.least < 0 else extent / 10


def _allowed(low: float, high: float, step: float, limits: Limits) -> tuple[float, float]:
    """The ends of a range, moved by less than one step to what the limits allow."""
    if low < limits.least or (low == limits.least and limits.open_least):
        low = step * math.ceil(limits.least / step) if abs(limits.least) < ENDLESS else limits.least
        low = low + step if low < limits.least or (low == limits.least and limits.open_least) else low
    if high > limits.most or (high == limits.most and limits.open_most):
        high = limits.most - step if limits.open_most else limits.most
    return float(f"{low:.12g}"), float(f"{high:.12g}")
