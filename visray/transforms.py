"""Transforms of an object: a list of steps, applied in order.

Each step has two methods. `affines` returns the 3 x 4 matrices of several steps of its kind. `bounds` returns a lower
and an upper bound on the factor by which it changes lengths, and a bound on the distance by which it moves the origin;
it uses plain numbers, no arrays.
"""

import math
from dataclasses import dataclass, field
from typing import Annotated, Any, Union

import numpy as np
from pydantic import AfterValidator, ConfigDict, Discriminator, Tag

from visray.quantities import Direction, Point, Real, Triple
from visray.records import record_kind


def _scale_triple(s: float | Triple) -> float | Triple:
    """The scale unchanged; raises ValueError if a factor is 0."""
    if 0.0 in (s if isinstance(s, tuple) else (s,)):
        raise ValueError("a scale must not be 0")
    return s


Row = tuple[Real, Real, Real, Real]


def _sizes(rows: tuple[Row, Row, Row]) -> tuple[float, float]:
    """Volume (absolute determinant) and Frobenius norm of the linear part of a matrix. rows: the rows of its 3 x 4
    matrix."""
    (a, b, c, _), (d, e, f, _), (g, h, i, _) = rows
    squared_norm = a * a + b * b + c * c + d * d + e * e + f * f + g * g + h * h + i * i
    return abs(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)), math.sqrt(squared_norm)


def _clearly_invertible(rows: tuple[Row, Row, Row]) -> bool:
    """Whether a quick test proves that the matrix is invertible.

    The matrix changes no length by a factor below volume / norm^2. The test passes if this bound is above 1e-10 norm.
    Error: rounding changes the volume by at most 1e-15 norm^3.
    """
    volume, norm = _sizes(rows)
    cube = norm * norm * norm
    return 1e-200 < cube < 1e200 and volume > 1e-10 * cube


def _invertible(rows: tuple[Row, Row, Row]) -> tuple[Row, Row, Row]:
    """The matrix unchanged; raises ValueError if it is singular."""
    if _clearly_invertible(rows):
        return rows
    linear = np.array(rows, float)[:, :3]
    # A matrix whose inverse would lose every digit of a double counts as singular.
    if not np.linalg.cond(linear) < 1 / np.finfo(float).eps:
        raise ValueError("a transform must be invertible; this matrix is singular")
    return rows


def _affines(linear: np.ndarray, shift: Any = (0.0, 0.0, 0.0)) -> np.ndarray:
    """3 x 4 matrices from their linear parts and their shifts."""
    shift = np.array(shift, float)
    count = max(len(shift) if shift.ndim == 2 else 1, len(linear) if linear.ndim == 3 else 1)
    matrices = np.empty((count, 3, 4))
    matrices[:, :, :3], matrices[:, :, 3] = linear, shift
    return matrices


@record_kind
@dataclass(frozen=True, kw_only=True)
class Translate:
    """Moves by a vector."""

    __pydantic_config__ = ConfigDict(extra="forbid")
    translate: Point = field(kw_only=False)

    @staticmethod
    def affines(steps: list["Translate"]) -> np.ndarray:
        return _affines(np.eye(3), [s.translate for s in steps])

    def bounds(self) -> tuple[float, float, float]:
        return 1.0, 1.0, sum(map(abs, self.translate))


@record_kind
@dataclass(frozen=True, kw_only=True)
class Scale:
    """Scales about the origin, by one factor or by one for each axis. A negative factor mirrors."""

    __pydantic_config__ = ConfigDict(extra="forbid")
    scale: Annotated[Union[Real, Triple], AfterValidator(_scale_triple)] = field(kw_only=False)

    @staticmethod
    def affines(steps: list["Scale"]) -> np.ndarray:
        factors = np.array([s.scale if isinstance(s.scale, tuple) else (s.scale,) * 3 for s in steps], float)
        return _affines(factors[:, :, None] * np.eye(3))

    def bounds(self) -> tuple[float, float, float]:
        factors = [abs(s) for s in (self.scale if isinstance(self.scale, tuple) else (self.scale,))]
        return min(factors), max(factors), 0.0


@record_kind
@dataclass(frozen=True, kw_only=True)
class Rotate:
    """Turns by `rotate` degrees about `axis` through the origin; counter-clockwise when the axis points at the
    viewer.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")
    rotate: Real = field(kw_only=False)
    axis: Direction = field(default=(0.0, 1.0, 0.0), kw_only=False)

    @staticmethod
    def affines(steps: list["Rotate"]) -> np.ndarray:
        axis = np.array([s.axis for s in steps], float)
        x, y, z = (axis / np.linalg.norm(axis, axis=1, keepdims=True)).T
        zero = np.zeros(len(steps))
        cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
        angle = np.radians([s.rotate for s in steps])[:, None, None]
        return _affines(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)

    def bounds(self) -> tuple[float, float, float]:
        return 1.0, 1.0, 0.0


@record_kind
@dataclass(frozen=True, kw_only=True)
class Matrix:
    """Any affine map, as the upper three rows of its 4 x 4 matrix, which multiplies column vectors."""

    __pydantic_config__ = ConfigDict(extra="forbid")
    matrix: Annotated[tuple[Row, Row, Row], AfterValidator(_invertible)] = field(kw_only=False)

    @staticmethod
    def affines(steps: list["Matrix"]) -> np.ndarray:
        return np.array([s.matrix for s in steps], float)

    def bounds(self) -> tuple[float, float, float]:
        if not _clearly_invertible(self.matrix):
            return 0.0, math.inf, math.inf
        volume, norm = _sizes(self.matrix)
        return volume / (norm * norm), norm, sum(abs(row[3]) for row in self.matrix)


STEPS = {"translate": Translate, "scale": Scale, "rotate": Rotate, "matrix": Matrix}


def _kind(step: Any) -> str | None:
    """Name of the class of a step; None if it is unknown. In a scene file, the first key of the step that belongs to a
    class decides. Pydantic then reports only errors of this class."""
    if isinstance(step, dict):
        return next((STEPS[key].__name__ for key in step if key in STEPS), None)
    return type(step).__name__ if type(step) in STEPS.values() else None


Transform = Annotated[
    Union[
        Annotated[Translate, Tag("Translate")],
        Annotated[Scale, Tag("Scale")],
        Annotated[Rotate, Tag("Rotate")],
        Annotated[Matrix, Tag("Matrix")],
    ],
    Discriminator(_kind),
]


def compose(steps: tuple[Transform, ...]) -> np.ndarray | None:
    """The 3 x 4 matrix of all steps in order, or None if there are none."""
    return composed([steps])[0] if steps else None


def composed(lists: list[tuple[Transform, ...]]) -> np.ndarray:
    """The matrices of several lists of steps. Shape: (lists, 3, 4)."""
    matrices = np.zeros((len(lists), 4, 4))
    matrices[:] = np.eye(4)
    for place in range(max(map(len, lists), default=0)):
        kinds: dict[type, list[int]] = {}
        for i, steps in enumerate(lists):
            if place < len(steps):
                kinds.setdefault(type(steps[place]), []).append(i)
        for kind, at in kinds.items():
            affine = np.zeros((len(at), 4, 4))
            affine[:, :3], affine[:, 3, 3] = kind.affines([lists[i][place] for i in at]), 1
            matrices[at] = affine @ matrices[at]
    return matrices[:, :3]


def product(outer: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """The matrices of affine maps: `inner`, followed by `outer`. Shapes: outer (N, 3, 4), inner (N, 3, 4) or (3, 4)."""
    linear = outer[:, :, :3]
    return np.concatenate([linear @ inner[..., :3], linear @ inner[..., 3:] + outer[:, :, 3:]], axis=2)


def bounds(steps: tuple[Transform, ...]) -> tuple[float, float, float]:
    """The bounds of all steps together: lower and upper bound on the factor by which lengths change, and bound on the
    distance by which the origin moves."""
    limits = 1.0, 1.0, 0.0
    for step in steps:
        limits = joined(limits, step.bounds())
    return limits


def joined(inner: tuple[float, float, float], outer: tuple[float, float, float]) -> tuple[float, float, float]:
    """The bounds of a transform followed by another one. inner, outer: their bounds."""
    (least, greatest, shift), (low, high, moved) = inner, outer
    # A matrix that may be singular has no upper bound, and 0 times infinity is not a number.
    return least * low, greatest * high, (shift * high if shift else 0.0) + moved
