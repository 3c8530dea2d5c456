"""Footprints: the part of a sheet of cells that the rays to a row can pass, and the footprints of balls.

A footprint contains the exact footprint of the row, grown by the rounding bound of the row's own exact test. Here the
coordinates of a sheet are scaled so that it is the square from 0 to 1. The footprints of triangles are in
triangle_footprints.py.
"""

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from visray.accel.cell_views import CellView
from visray.accel.sheet_arithmetic import along, chunks, relative, taken, tangent_slopes
from visray.geometry import gamma


@dataclass(frozen=True)
class Boxes:
    """Boxes around the footprints of the rows that a sheet sees.

    row: numbers of the rows. Shape: (m).
    low, high: corners of the boxes, in single, rounded outwards; within -1 and 2. Shape: (2, m).
    outlined: mask of the rows whose footprint is known better than by its box. Shape: (m).
    outline: the numbers that the outlines of these rows are computed from. Shape: (k, m).
    """

    row: np.ndarray
    low: np.ndarray
    high: np.ndarray
    outlined: np.ndarray
    outline: np.ndarray

    @staticmethod
    def of(row: np.ndarray, low: np.ndarray, high: np.ndarray, outlined: np.ndarray, outline: np.ndarray) -> "Boxes":
        """The boxes that overlap the square from -1 to 2."""
        seen = (low[0] < 2) & (low[1] < 2) & (high[0] > -1) & (high[1] > -1)
        outwards = 4 * gamma(1, "single")  # for the conversion of numbers up to 2
        low, high = np.maximum(low, -1) - outwards, np.minimum(high, 2) + outwards
        boxes = Boxes(row, low.astype(np.float32), high.astype(np.float32), outlined, outline)
        return boxes if seen.all() else boxes.at(np.flatnonzero(seen))

    def at(self, index: np.ndarray) -> "Boxes":
        """The boxes at some positions of the arrays."""
        return Boxes(*(taken(getattr(self, f.name), index) for f in fields(self)))

    @staticmethod
    def joined(boxes: list["Boxes"]) -> "Boxes":
        """The boxes of one or more records as one."""
        return Boxes(*(np.concatenate([getattr(b, f.name) for b in boxes], axis=-1) for f in fields(Boxes)))


class Outline:
    """The outlines of rows, in cells. Fields that are arrays have one entry per row."""

    def at(self, index: Any) -> Self:
        """The outlines at some positions of the arrays."""
        values = (getattr(self, f.name) for f in fields(self))
        return type(self)(*(v[index] if isinstance(v, np.ndarray) else v for v in values))

    def across(self, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest x of the part of each outline that lies between two values of y.

        Shapes: (m), or (k, m) for k such parts of each row.
        Domain: there is such a part; otherwise the result is any part of the row's box.
        """
        raise TypeError(f"{type(self).__name__} has no parts across")


def facing(view: CellView, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Mask of the boxes in space that may overlap the pyramid of a cube's face; its sides are taken twice as steep, so
    that the slack of the cells is within it.

    low, high: corners of the boxes, relative to the cube's middle. Shape: (3, m).
    """
    axis = int(np.argmax(np.abs(view.forward)))
    depth = high[axis] if view.forward[axis] > 0 else -low[axis]
    aside = [np.maximum(low[k], -high[k]) for k in range(3) if k != axis]
    return (depth >= 0) & (2 * depth >= aside[0]) & (2 * depth >= aside[1])


class Balls:
    """Balls as rows. Shapes: centre (n, 3), radius (n)."""

    fill = 0.8  # share of its box that a footprint fills, about pi / 4
    smallest = 3  # a box of less than so many columns or rows of cells is not cut to the row's outline

    def __init__(self, centre: np.ndarray, radius: np.ndarray):
        self.centre, self.radius = np.asarray(centre, float), np.asarray(radius, float)

    def __len__(self) -> int:
        return len(self.radius)

    def seen(self, views: tuple[CellView, ...]) -> tuple[np.ndarray, np.ndarray, list[Boxes]]:
        """(least, greatest distance of each row from the origin, boxes of the rows that each view sees). For parallel
        rays the distances are depths. Shapes: (n), (n)."""
        low, high = np.empty(len(self)), np.empty(len(self))
        boxes = [[ball_boxes(v, np.zeros(0, np.uint32), np.zeros((3, 0)), np.zeros(0))] for v in views]
        for at in chunks(len(self)):
            p, radius = relative(self.centre[at], views[0].origin), self.grown(views[0], at)
            middle = along(p, views[0].forward) if views[0].parallel else np.sqrt((p * p).sum(axis=0))
            low[at], high[at] = middle - radius, middle + radius
            row = np.arange(at.start, at.stop, dtype=np.uint32)
            for view, parts in zip(views, boxes):
                near = np.arange(len(row)) if len(views) == 1 else np.flatnonzero(facing(view, p - radius, p + radius))
                parts.append(ball_boxes(view, row[near], taken(p, near), radius[near]))
        return low, high, [Boxes.joined(parts) for parts in boxes]

    def grown(self, view: CellView, at: slice) -> np.ndarray:
        """The radii, grown by the rounding bound of centres and radii (gamma(32) of their sizes) and of all that is
        computed from them here. Shape: (m)."""
        x, y, z = np.abs(self.centre[at]).T
        radius = self.radius[at]
        return radius + gamma(64) * (x + y + z + radius + np.abs(view.origin).sum())

    def outline(self, view: CellView, numbers: np.ndarray, grid: tuple[int, int]) -> "BallOutline":
        """The outlines of rows. numbers: as in Boxes.outline; grid: numbers of columns and of rows of cells."""
        x, y, z, radius = numbers
        if view.parallel:
            box, ends = [x - radius, x + radius, y - radius, y + radius], [y, y]
        else:
            box = [*tangent_slopes(x, z, radius), *tangent_slopes(y, z, radius)]
            # The plane x = s z, a tangent plane, touches the ball at its centre -+ radius (1, 0, -s) / sqrt(1 + s^2).
            ends = [y / (z + radius * side * s / np.sqrt(1 + s * s)) for side, s in ((1, box[0]), (-1, box[1]))]
        return BallOutline(x, y, z, radius, *box, *ends, view, grid)


def ball_boxes(view: CellView, row: np.ndarray, p: np.ndarray, radius: np.ndarray) -> Boxes:
    """The boxes around the footprints of balls.

    p: centres relative to the view's origin. Shape: (3, m).
    """
    x, y, z = (along(p, axis) for axis in (view.right, view.up, view.forward))
    low, high = np.empty((2, len(row))), np.empty((2, len(row)))
    for k, v in enumerate((x, y)):
        ends = (v - radius, v + radius) if view.parallel else tangent_slopes(v, z, radius)
        low[k], high[k] = ((e - view.low[k]) / view.extent[k] for e in ends)
    if not view.parallel:
        low[0][z + radius <= 0] = np.inf  # behind the plane
    outlined = np.ones(len(row), bool) if view.parallel else z > radius
    return Boxes.of(row, low, high, outlined, np.array([x, y, z, radius]))


@dataclass(frozen=True)
class BallOutline(Outline):
    """Outlines of balls whose footprints are ellipses, or discs for parallel rays.

    x, y, z, radius: centre of the ball along right, up and forward, and its radius.
    left, right, bottom, top: box of the footprint, in coordinates of the sheet.
    left_y, right_y: y of its leftmost and of its rightmost point.
    view: the sheet.
    grid: numbers of columns and of rows of cells.
    """

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    radius: np.ndarray
    left: np.ndarray
    right: np.ndarray
    bottom: np.ndarray
    top: np.ndarray
    left_y: np.ndarray
    right_y: np.ndarray
    view: CellView
    grid: tuple[int, int]

    def across(self, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As in Outline. The greatest x of an ellipse rises with y up to its rightmost point, and then falls; so the
        greatest x of a part is that at the y of the part that is nearest to the rightmost point's."""
        width, height = self.view.extent / self.grid
        below, above = (np.clip(v * height + self.view.low[1], self.bottom, self.top) for v in (lower, upper))
        result = []
        for k, (y, x) in enumerate(((self.left_y, self.left), (self.right_y, self.right))):
            nearest = np.clip(y, below, above)
            result.append((np.where(nearest == y, x, self._ends(nearest)[k]) - self.view.low[0]) / width)
        return result[0], result[1]

    def _ends(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest x of the outlines at y.

        The rays with one y lie in a plane, which cuts the ball in a disc. Its tangents are those of tangent_slopes, but
        the plane's own axis is longer than `forward` by the factor sqrt(1 + y^2).
        """
        stretch = 1.0 if self.view.parallel else np.sqrt(1 + y * y)
        aside = self.y - y if self.view.parallel else (self.y - y * self.z) / stretch
        size = np.abs(self.y) + np.abs(y) + np.abs(self.z) + self.radius
        squared = self.radius * self.radius - aside * aside + gamma(32) * size * self.radius
        radius = np.sqrt(np.maximum(squared, 0))
        if self.view.parallel:
            return self.x - radius, self.x + radius
        low, high = tangent_slopes(self.x, (y * self.y + self.z) / stretch, radius)
        return low * stretch, high * stretch
