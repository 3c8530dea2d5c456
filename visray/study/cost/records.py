"""Records of a study of costs.

Errors are relative: the root of the mean square over pixels and channels of the difference from the reference, in
linear light, divided by the mean luminance of the reference.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

Settings = dict[str, Any]  # values by address, as vr.replaced takes them


@dataclass(frozen=True)
class Band:
    """A measured number and its interval of 95 %.

    middle: the estimate
    low, high: the ends of the interval
    """

    middle: float
    low: float
    high: float


@dataclass(frozen=True)
class Geometry:
    """First hits, and the rays that leave them, compared with those of the reference.

    Fields up to `other`, and the last two, are numbers of rays.

    rays: rays from the camera
    lost: rays that hit nothing, where the reference hits
    added: rays that hit, where the reference hits nothing
    other: rays that hit another object
    ulps: largest difference of distances, in units in the last place of double
    angle: largest angle between normals, radians
    leaving: random rays into the hemisphere above hits on the same object as the reference's
    self_shadows: leaving rays that are occluded where the reference's are not
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
    """Error of the pictures of many seeds; rmse^2 = bias^2 + deviation^2.

    rmse: root mean square error, relative
    bias: the part that all seeds share
    deviation: the part that differs from seed to seed, which is noise
    mrse: mean of (x - r)^2 / (r + 0.01)^2
    flip: mean FLIP of the pictures as displayed (sRGB), 67 pixels per degree
    """

    rmse: Band
    bias: Band
    deviation: Band
    mrse: float
    flip: float


@dataclass(frozen=True)
class Record:
    """One measured choice.

    setting: name of the setting that was changed; "scene" for the scene as it is, "together" where several were changed
    value: the value of that setting
    settings: values of all settings, by address
    seconds: kernel time of one picture, without compilation
    compile_seconds: time that compilation took
    operations: operations of the kernel, as Dr.Jit counts them
    error: the error of its pictures
    times: the measured seconds, shape (R)
    squares: squared relative error of each seed, shape (S)
    picture: picture of the first seed, linear, shape (H, W, 3)
    error_map: root mean square error over seeds and channels, shape (H, W)
    geometry: comparison of hits; None where the setting cannot change them
    """

    setting: str
    value: Any
    settings: Settings
    seconds: Band
    compile_seconds: float
    operations: int
    error: Error
    times: np.ndarray = field(repr=False)
    squares: np.ndarray = field(repr=False)
    picture: np.ndarray = field(repr=False)
    error_map: np.ndarray = field(repr=False)
    geometry: Geometry | None = None

    def same_choice(self, other: "Record") -> bool:
        """Whether all settings have the same values, even where both were measured separately."""
        return self.settings == other.settings


@dataclass(frozen=True)
class Slope:
    """The exponent k of error ~ x^-k.

    k: the estimate
    low, high: its interval of 95 %
    points: number of points of the fit
    """

    k: float
    low: float
    high: float
    points: int


@dataclass(frozen=True)
class Curve:
    """Records of one setting, all others as in the scene.

    setting: its name
    kind: "sampling" (more of it is less noise), "bias" (more of it leaves less out) or "step" (a choice)
    points: the records, in the order of value
    by_time, by_count: slopes of the error over seconds and over the value; None where there are too few points, or no
        noise
    """

    setting: str
    kind: str
    points: tuple[Record, ...]
    by_time: Slope | None = None
    by_count: Slope | None = None


@dataclass(frozen=True)
class Price:
    """Time in which one setting brings the error down to a share of the scene's.

    setting: its name
    share: the error, as a share of the scene's
    factor: the time, as a multiple of the scene's; inf where the error was not reached
    least: least error measured with the setting, as a share of the scene's
    value: the setting's value at that error; None where it was not reached
    beyond: whether the value lies beyond the measured ones, and follows from the measured slope
    """

    setting: str
    share: float
    factor: Band
    least: float
    value: Any
    beyond: bool = False


@dataclass(frozen=True)
class Reference:
    """The picture that counts as truth.

    settings: its settings by address
    error: its own standard error, relative root mean square
    luminance: its mean luminance
    seconds: time that it took
    picture: its pixels, shape (H, W, 3)
    variance: variance of the picture, shape (H, W, 3)
    """

    settings: Settings
    error: float
    luminance: float
    seconds: float
    picture: np.ndarray = field(repr=False)
    variance: np.ndarray = field(repr=False)


@dataclass(frozen=True)
class Report:
    """The cost of accuracy for a scene.

    scene, scene_hash: name and hash of the scene
    width, height: size of the pictures that were measured
    seeds: number of pictures of each choice
    quick: whether it is the quick study
    default: record of the scene as it is
    curves: one for each setting
    joint: records with the best values of several settings together
    frontier: records of which no other is both faster and more accurate, in the order of seconds
    savings: measured choices that are surely faster or more accurate, and in no respect worse; the best one first
    halvings: what half of the scene's error costs by each setting, cheapest first
    floors: errors that more samples do not reduce, by name ("8-bit output", "single precision", "depth 6")
    reference: the reference
    noiseless: whether all seeds give the same picture
    stopped: whether Ctrl-C ended the study
    seconds: time that the study took
    machine: date, processor, threads, versions
    notes: what a reader must know, a sentence each
    """

    scene: str
    scene_hash: str
    width: int
    height: int
    seeds: int
    quick: bool
    default: Record
    curves: tuple[Curve, ...]
    joint: tuple[Record, ...]
    frontier: tuple[Record, ...]
    savings: tuple[Price, ...]
    halvings: tuple[Price, ...]
    floors: dict[str, float]
    reference: Reference
    noiseless: bool
    stopped: bool
    seconds: float
    machine: dict[str, Any]
    notes: tuple[str, ...] = ()

    @property
    def records(self) -> tuple[Record, ...]:
        """All records, the scene as it is first, each choice once."""
        rest = [p for c in self.curves for p in c.points if not p.same_choice(self.default)]
        return (self.default, *rest, *self.joint)
