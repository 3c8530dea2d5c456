"""Curves: values of any sort through keys, as functions of time.

A sort of values says how they are interpolated: `number` (a number, or lists of numbers at any depth), `factor` (a
scale, in which no number is 0) and `vector` (three numbers that are not all 0), which are interpolated as numbers,
`direction` (three numbers of which only the direction counts), `date` (dates as texts, or numbers), `step` (a step of a
transform) or `steps` (a list of these).
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from visray.animation import interpolation, rotations
from visray.data import dates
from visray.transforms import STEPS, Rotate

Sort = Literal["number", "factor", "vector", "direction", "date", "step", "steps"]
Interpolation = Literal["linear", "smooth", "step"]


@dataclass(frozen=True)
class Keyed:
    """Times of keys, and how values are interpolated between them."""

    times: np.ndarray
    smooth: bool

    def numbers(self, values: np.ndarray) -> Callable[[float], np.ndarray]:
        """Function of time that interpolates arrays of numbers. Shape: (K, ...)."""
        if not self.smooth:
            return lambda t: interpolation.linear(self.times, values, t)
        slopes = interpolation.slopes(self.times, values)
        return lambda t: interpolation.cubic(self.times, values, slopes, t)

    def arcs(self, units: np.ndarray) -> Callable[[float], np.ndarray]:
        """Function of time that goes from one unit vector to the next on great circles. A smooth one changes its speed
        without jumps: the length of the way is a monotone cubic. Shape: (K, N)."""
        lengths = [rotations.arc(a, b) for a, b in pairwise(units)]
        way = np.concatenate([[0.0], np.cumsum(lengths)])
        done = self.numbers(way)

        def at(t: float) -> np.ndarray:
            i, share = interpolation.segment(self.times, t)
            if share == 0 or lengths[i] == 0:
                return units[i]
            return rotations.slerp(units[i], units[i + 1], float(done(t) - way[i]) / lengths[i])

        return at


def curve(sort: Sort, interpolated: Interpolation, times: tuple[float, ...], values: tuple) -> Callable[[float], Any]:
    """Function of time through keys. Its values are plain: numbers, tuples and dicts.

    Domain: the values are all of this sort and of one shape.
    """
    moments = np.array(times, float)
    if interpolated == "step":
        return lambda t: values[interpolation.segment(moments, t)[0]]
    between = _CURVES[sort](Keyed(moments, interpolated == "smooth"), values)

    def at(t: float) -> Any:
        i, share = interpolation.segment(moments, t)
        return values[i] if share == 0 else between(t)

    return at


def _numbers(keyed: Keyed, values: tuple) -> Callable[[float], Any]:
    """Curve of numbers, or of lists of numbers at any depth."""
    at = keyed.numbers(np.array(values, float))
    return lambda t: _plain(at(t))


def _directions(keyed: Keyed, values: tuple) -> Callable[[float], Any]:
    """Curve of directions: these go the short way, and their lengths are interpolated as numbers."""
    vectors = np.array(values, float)
    directions = keyed.arcs(np.array([rotations.unit(v) for v in vectors]))
    lengths = keyed.numbers(np.linalg.norm(vectors, axis=1))
    return lambda t: _plain(lengths(t) * directions(t))


def _dates(keyed: Keyed, values: tuple) -> Callable[[float], Any]:
    """Curve of dates: as many days pass in each second between two keys."""
    if not isinstance(values[0], str):
        return _numbers(keyed, values)
    at = keyed.numbers(np.array([dates.parse(x) for x in values]))
    return lambda t: dates.text(float(at(t)), "microsecond")


def _step_list(keyed: Keyed, values: tuple) -> Callable[[float], Any]:
    """Curve of lists of steps: each step moves on its own."""
    curves = [_step(keyed, column) for column in zip(*values)]
    return lambda t: tuple(at(t) for at in curves)


def _step(keyed: Keyed, values: tuple) -> Callable[[float], Any]:
    """Curve of steps of one kind."""
    return _STEP_CURVES[step_key(values[0])](keyed, values)


def step_key(step: Any) -> str | None:
    """The key that tells the kind of a step, such as `rotate`; None if the value is no step."""
    return next((key for key in STEPS if key in step), None) if isinstance(step, dict) else None


def _translations(keyed: Keyed, values: tuple) -> Callable[[float], Any]:
    at = _numbers(keyed, tuple(x["translate"] for x in values))
    return lambda t: {"translate": at(t)}


def _scales(keyed: Keyed, values: tuple) -> Callable[[float], Any]:
    factors = [x["scale"] for x in values]
    if any(isinstance(x, tuple) for x in factors):
        factors = [x if isinstance(x, tuple) else (x, x, x) for x in factors]
    at = _numbers(keyed, tuple(factors))
    return lambda t: {"scale": at(t)}


def _rotations(keyed: Keyed, values: tuple) -> Callable[[float], Any]:
    """Curve of rotations: from each to the next by the smallest rotation that there is."""
    axes = np.array([axis_of(x) for x in values], float)
    at = keyed.arcs(_chained([rotations.quaternion(x["rotate"], axis) for x, axis in zip(values, axes)]))

    def step_at(t: float) -> dict[str, Any]:
        degrees, axis = rotations.angle_and_axis(at(t), axes[0])
        return {"rotate": degrees, "axis": _plain(axis)}

    return step_at


def axis_of(step: dict[str, Any]) -> tuple:
    """Axis of a rotation."""
    return step.get("axis", Rotate.axis)


def _matrices(keyed: Keyed, values: tuple) -> Callable[[float], Any]:
    """Curve of affine maps: their rotations go the short way, their stretches and shifts are interpolated as
    numbers."""
    maps = np.array([x["matrix"] for x in values], float)
    parts = [rotations.polar(m[:, :3]) for m in maps]
    turns = keyed.arcs(_chained([rotations.of_matrix(r) for r, _ in parts]))
    stretches, shifts = keyed.numbers(np.array([s for _, s in parts])), keyed.numbers(maps[:, :, 3])

    def step_at(t: float) -> dict[str, Any]:
        linear = rotations.matrix(turns(t)) @ stretches(t)
        return {"matrix": _plain(np.column_stack([linear, shifts(t)]))}

    return step_at


def _chained(quaternions: list[np.ndarray]) -> np.ndarray:
    """The same rotations, each with the sign that is nearer to the one before."""
    found = quaternions[:1]
    for q in quaternions[1:]:
        found.append(rotations.nearer(q, found[-1]))
    return np.array(found)


def _plain(values: np.ndarray) -> Any:
    """An array as a number, or as tuples of numbers at any depth."""
    return float(values) if values.ndim == 0 else tuple(map(_plain, values))


_CURVES = {
    "number": _numbers,
    "factor": _numbers,
    "vector": _numbers,
    "direction": _directions,
    "date": _dates,
    "step": _step,
    "steps": _step_list,
}
_STEP_CURVES = {"translate": _translations, "scale": _scales, "rotate": _rotations, "matrix": _matrices}
