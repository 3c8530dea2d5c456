"""Footprints of objects on the film, in NumPy: where rows of a scene are in the picture, and how much of it they cover.

A row is one object as an entry of the kernel's tables, or one triangle of a mesh. Film coordinates are in pixels from
the top left corner of the picture. Shapes: R rows.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
from drjit.scalar import Array3f64

from visray.batches import Batch
from visray.camera import ParallelView
from visray.filters import SQUARE
from visray.geometry import Frame, SimilarityInverse, gamma
from visray.kernel_scene import KernelScene
from visray.primitives.polynomial import Polynomial
from visray.pytree import rows
from visray.scene.film import Film

# Share of the outline of a row's box that the row itself covers, at least: a ball seen along the diagonal of its box,
# half a rectangle, and a guess for shapes that only their box is known of.
SOLID, HALF, UNKNOWN = 0.45, 0.5, 0.25


@dataclass(frozen=True)
class Blocks:
    """Boxes of any orientation that contain rows. Shapes: centre (R, 3), axes (R, 3, 3), ball (R), share (R).

    centre: centre of each box.
    axes: half its sides, as three vectors.
    ball: radius of a ball about the centre that contains the row; inf if none is known.
    share: least share of the outline of the box that the row covers.
    """

    centre: np.ndarray
    axes: np.ndarray
    ball: np.ndarray
    share: np.ndarray

    def __getitem__(self, index: np.ndarray) -> "Blocks":
        return Blocks(self.centre[index], self.axes[index], self.ball[index], self.share[index])

    def cut(self, pieces: np.ndarray) -> "tuple[Blocks, np.ndarray]":
        """The boxes cut into pieces along their first axis, and the number of each piece's row.

        pieces: number of pieces of each box. Shape: (R).
        """
        row = np.repeat(np.arange(len(pieces)), pieces)
        k = pieces[row].astype(float)
        i = np.arange(len(row)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        axes = self.axes[row]
        centre = self.centre[row] + axes[:, 0] * ((2 * i + 1 - k) / k)[:, None]
        axes[:, 0] /= k[:, None]
        return Blocks(centre, axes, np.where(k > 1, np.inf, self.ball[row]), self.share[row]), row


def triangles(batch: Batch, index: np.ndarray) -> Blocks:
    """Boxes of the rows of a batch with these numbers. Domain: triangular kinds. Shape: index (R)."""
    u = type(batch.object)
    placed = rows(batch.placed, u(index.astype(np.uint32)))
    return _of_triangles(*(_points(c, len(index)) for c in batch.kind.corners(placed)))


def blocks(batch: Batch) -> Blocks:
    """Boxes of the rows of a batch. Domain: bounded kinds."""
    kind, n = batch.kind, len(batch)
    if kind.triangular:
        return triangles(batch, np.arange(n))
    centre, radius = _points(batch.centre, n), np.broadcast_to(np.array(batch.radius, float), n)
    share = np.full(n, UNKNOWN if issubclass(kind, Polynomial) else SOLID)
    inverse = getattr(batch.placed, "inverse", None)
    if isinstance(inverse, SimilarityInverse):
        half = 0.5 * (_points(batch.high, n) - _points(batch.low, n))
        return Blocks(centre, np.eye(3) * half[:, None], radius, share)
    try:
        # Scalars, unless the kind has parameters, because they compile no kernel.
        vector = type(inverse.o) if batch.placed.shape else Array3f64
        unit = [vector(*(float(i == k) for i in range(3))) for k in range(3)]
        half = _points(kind.extents(Frame(*unit, 0 * unit[0]), batch.placed.shape)[1], n)
        frames = np.linalg.inv(np.stack([_points(v, n) for v in (inverse.x, inverse.y, inverse.z)], 1))
    except (AttributeError, TypeError, np.linalg.LinAlgError):
        # Kinds without a frame, such as meshes: only their box is known.
        low, high = _points(batch.low, n), _points(batch.high, n)
        axes = np.eye(3) * (0.5 * (high - low))[:, None]
        return Blocks(0.5 * (low + high), axes, np.full(n, np.inf), np.full(n, UNKNOWN))
    axes = np.swapaxes(frames, 1, 2) * half[:, :, None]
    longest = np.argsort(-np.square(axes).sum(2), axis=1)
    return Blocks(_points(inverse.o, n), np.take_along_axis(axes, longest[:, :, None], 1), radius, share)


def _points(v: Any, n: int) -> np.ndarray:
    """A Dr.Jit vector as an array. Shape: (n, 3)."""
    return np.broadcast_to(np.array(v, float).T, (n, 3))


def _of_triangles(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> Blocks:
    """Rectangles around triangles, on their longest sides. Shapes: (R, 3) each."""
    corners = np.stack([a, b, c], 1)
    sides = np.roll(corners, -1, 1) - corners
    longest = np.argmax(np.square(sides).sum(2), 1)
    row = np.arange(len(a))
    start, base, apex = corners[row, longest], sides[row, longest], corners[row, longest - 1]
    along = ((apex - start) * base).sum(1) / np.maximum(np.square(base).sum(1), 1e-300)
    height = apex - start - along[:, None] * base
    axes = np.stack([base / 2, height / 2, np.zeros_like(base)], 1)
    return Blocks(start + (base + height) / 2, axes, np.full(len(a), np.inf), np.full(len(a), HALF))


class FilmMap:
    """The map from the world to the film.

    rows: three vectors. For a perspective camera, the film coordinates of a point are the first two products of these
        with (point - origin), divided by the third one. For an orthographic camera they are the first two products.
    filter: filter of the pixels.
    low, high: corners of the part of the film that samples lie in.
    """

    def __init__(self, s: KernelScene, film: Film):
        view, self.parallel = s.view, isinstance(s.view, ParallelView)
        self.filter = SQUARE if s.filter is None else film.filter
        reach = self.filter.reach
        self.low = np.array(film.corner) - reach
        self.high = np.array(film.corner) + film.raster + reach
        one = lambda v: np.array(v, float).ravel()  # noqa: E731 - a vector of the view
        third = one(view.forward) if self.parallel else one(view.corner)
        self.rows = np.linalg.inv(np.stack([one(view.pixel_right), one(view.pixel_down), third], 1))
        self.origin = one(view.o) + (one(view.corner) if self.parallel else 0)
        self.forward = one(view.forward)
        pixel = np.linalg.norm(one(view.pixel_right))
        # Rounding of directions, in pixels.
        far = np.linalg.norm(one(view.corner)) + pixel * (sum(film.size) + 4 * reach)
        self.rounding = gamma(16, s.a.precision) * far / pixel
        has_lens = s.features["defocus"]
        self.lens = np.linalg.norm(one(view.lens_right)) / pixel if has_lens else 0.0
        self.inverse_focus = float(one(view.inverse_focus)[0]) if has_lens else 0.0

    def local(self, p: np.ndarray) -> np.ndarray:
        """The three products of points. Shapes: (..., 3)."""
        return (p - self.origin) @ self.rows.T

    def in_front(self, boxes: Blocks) -> np.ndarray:
        """Mask of boxes that are in front of the camera with all their corners. Shape: (R)."""
        reach = np.abs(boxes.axes @ self.rows[2]).sum(1)
        return self.local(boxes.centre)[:, 2] > 1.001 * reach

    def areas(self, boxes: Blocks) -> np.ndarray:
        """Areas that rows cover on the film, to first order about their centres, in pixels. Shape: (R)."""
        q, v = self.local(boxes.centre), boxes.axes @ self.rows.T
        if not self.parallel:
            v = (v - (q / q[:, 2:])[:, None] * v[:, :, 2:]) / q[:, None, 2:]
        v = v[:, :, :2]
        crosses = [np.abs(v[:, i, 0] * v[:, j, 1] - v[:, i, 1] * v[:, j, 0]) for i, j in ((0, 1), (1, 2), (2, 0))]
        return boxes.share * 4 * sum(crosses)

    def lengths(self, boxes: Blocks) -> np.ndarray:
        """Lengths of the boxes on the film along their first axes, in pixels. Shape: (R)."""
        ends = [self.local(boxes.centre + k * boxes.axes[:, 0]) for k in (-1, 1)]
        a, b = (q[:, :2] if self.parallel else q[:, :2] / q[:, 2:] for q in ends)
        return np.linalg.norm(b - a, axis=1)

    def rectangles(self, boxes: Blocks) -> np.ndarray:
        """Rectangles of the film (left, top, right, bottom) that contain the rows, grown by the blur of the lens and by
        rounding; not yet cut at the film's edges. Shape: (R, 4). Domain: in_front."""
        signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, 8).T
        q = self.local(boxes.centre[:, None] + signs @ boxes.axes)
        xy = q[..., :2] if self.parallel else q[..., :2] / q[..., 2:]
        low, high = xy.min(1), xy.max(1)
        ball = np.isfinite(boxes.ball)
        if ball.any():
            low_ball, high_ball = self._of_balls(boxes.centre[ball], boxes.ball[ball])
            low[ball], high[ball] = np.fmax(low[ball], low_ball), np.fmin(high[ball], high_ball)
        depth = (boxes.centre - self.origin) @ self.forward
        reach = np.abs(boxes.axes @ self.forward).sum(1)
        grown = self.rounding + 0 * depth
        if self.lens:
            ends = [np.abs(1 / np.maximum(depth + k * reach, 1e-300) - self.inverse_focus) for k in (-1, 1)]
            grown = grown + self.lens * np.maximum(*ends)
        return np.hstack([low - grown[:, None], high + grown[:, None]])

    def _of_balls(self, centre: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Corners (low, high) of the rectangles around the outlines of balls. A plane through the origin that touches
        the ball has the distance `radius` from the centre. Shapes: (R, 2) each; NaN if the origin is in the ball."""
        q, products, r2 = self.local(centre), self.rows @ self.rows.T, np.square(radius)[:, None]
        if self.parallel:
            half = radius[:, None] * np.sqrt(np.diag(products)[:2])
            return q[:, :2] - half, q[:, :2] + half
        a = np.square(q[:, 2:]) - r2 * products[2, 2]
        b = q[:, :2] * q[:, 2:] - r2 * products[2, :2]
        c = np.square(q[:, :2]) - r2 * np.diag(products)[:2]
        with np.errstate(invalid="ignore", divide="ignore"):
            root = np.sqrt(np.where(a > 0, np.square(b) - a * c, np.nan))
            return (b - root) / a, (b + root) / a


def row_objects(batch: Batch) -> np.ndarray:
    """Number of each row's object in the scene. Shape: (R)."""
    objects = np.broadcast_to(np.array(batch.object), max(dr.width(batch.object), 1))
    if batch.object_of is None:
        return objects.astype(np.int64)
    return objects[np.minimum(np.array(batch.object_of), len(objects) - 1)].astype(np.int64)
