"""What a study of costs finds, as plain records.

An error is relative everywhere: the root mean square over pixels and channels of the difference from the reference, in
linear light, divided by the mean luminance of the reference.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Band:
    """A measured number, and between which two it lies with a chance of 95 %."""

    middle: float
    low: float
    high: float


@dataclass(frozen=True)
class Geometry:
    """First hits and the rays that leave them, against those of the reference.

    Of `rays` from the camera: lost, added (it hits, where nothing is), other (another object). ulps: the largest
    difference of distances, in units in the last place of double; angle: the largest between normals, radians.
    Of `leaving` rays from what is seen, over the hemisphere above it: self_shadows, blocked where the reference is not.
    """

    rays: int
    lost: int
    added: int
    other: int
    ulps: float
    angle: float
    leaving: int
    self_shadows: int


@dataclass(frozen=True)
class Error:
    """How far pictures of many seeds are off: rmse^2 = bias^2 + deviation^2. mrse: mean of (x - r)^2 / (r + 0.01)^2;
    flip: mean FLIP of the pictures as displayed (sRGB), 67 pixels per degree."""

    rmse: Band
    bias: Band
    deviation: Band
    mrse: float
    flip: float


@dataclass(frozen=True)
class Point:
    """What one choice of all knobs costs, and how far off its pictures are.

    knob: which one was turned for it, or "default", or "joint" where several were; value: to what. settings: by
    address, as vr.replaced takes them. seconds: of one picture, compiled; times: of each. squares: of each seed, the
    squared relative error. picture: of the first seed, linear; wrong: root mean square over seeds and channels.
    Shapes: times (R), squares (S), picture (H, W, 3), wrong (H, W).
    """

    knob: str
    value: Any
    settings: dict[str, Any]
    seconds: Band
    compile_seconds: float
    operations: int
    error: Error
    times: np.ndarray = field(repr=False)
    squares: np.ndarray = field(repr=False)
    picture: np.ndarray = field(repr=False)
    wrong: np.ndarray = field(repr=False)
    geometry: Geometry | None = None

    def same_choice(self, other: "Point") -> bool:
        """Whether both have all knobs alike: whichever of them was turned, and even where both were measured by
        themselves."""
        return self.settings == other.settings


@dataclass(frozen=True)
class Slope:
    """The exponent k of error ~ x^-k, with its interval of 95 %; over how many points."""

    k: float
    low: float
    high: float
    points: int


@dataclass(frozen=True)
class Curve:
    """One knob turned, all others as in the scene.

    kind: "sampling" (more of it is less noise), "bias" (more of it is less left out) or "step" (a choice). points: in
    the order of value. by_time, by_count: slopes of the error over seconds and over the value; None where there are too
    few points, or no noise.
    """

    knob: str
    kind: str
    points: tuple[Point, ...]
    by_time: Slope | None = None
    by_count: Slope | None = None


@dataclass(frozen=True)
class Halving:
    """What half of the default's error costs by one knob. factor: so many times the default's seconds, inf where the
    error was not reached by what was measured, nor close beyond it; least: the least error measured with the knob, as a
    share of the default's; value: of the knob at half of the error, None where factor is inf. rank: 1 is the cheapest;
    knobs that measurement cannot tell apart share one. beyond: value is further than any that was measured."""

    knob: str
    factor: Band
    least: float
    value: Any
    rank: int
    beyond: bool = False


@dataclass(frozen=True)
class Reference:
    """What counts as truth: its settings by address, its picture, its own standard error (relative, root mean square),
    and the seconds it took. Shapes: picture (H, W, 3), variance of it (H, W, 3)."""

    settings: dict[str, Any]
    error: float
    luminance: float
    seconds: float
    picture: np.ndarray = field(repr=False)
    variance: np.ndarray = field(repr=False)


@dataclass(frozen=True)
class Report:
    """What accuracy costs for a scene.

    default: the scene as it is. joint: points where several knobs were turned. frontier: no other point is both faster
    and more accurate; in the order of seconds. floors: errors by name that more samples do not get below ("8-bit
    output", "single precision", "depth 6"). noiseless: all seeds give the same picture. machine: date, processor,
    threads, versions. notes: what a reader must know, a sentence each.
    """

    scene: str
    scene_hash: str
    width: int
    height: int
    seeds: int
    quick: bool
    default: Point
    curves: tuple[Curve, ...]
    joint: tuple[Point, ...]
    frontier: tuple[Point, ...]
    halvings: tuple[Halving, ...]
    floors: dict[str, float]
    reference: Reference
    noiseless: bool
    stopped: bool
    seconds: float
    machine: dict[str, Any]
    notes: tuple[str, ...] = ()
