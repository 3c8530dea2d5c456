"""Lists of rows for rays that share an origin, as kernels read them.

A row is one object, or one triangle of a mesh, in the kernel's tables. The directions from the origin are cut into
cells (cells.py). Each cell lists the rows that a ray through it can meet, the nearest first. A ray reads the list of
its cell until the next row begins farther away than the hit that it has. So the result is that of a test of all rows,
bit for bit (tests/test_lists.py).

Source: the item buffer of Weghorst, Hooper and Greenberg 1984; the light buffer of Haines and Greenberg 1986.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray.accel.cell_views import CellView, camera_view, point_views
from visray.accel.cells import CellLists, ball_lists, triangle_lists
from visray.accel.culling import BallGuard, TriangleGuard, ball_guard, triangle_guard
from visray.batches import Batch
from visray.camera import Camera
from visray.pytree import evaluated
from visray.quantities import Arrays

# Greatest number of bytes of the lists of one batch for one origin. If they need more, their cells are made larger.
BUDGET = 2**27


@dataclass(frozen=True)
class Sheet:
    """A sheet of cells as kernels read it, in single precision.

    right, up, forward: unit vectors of the sheet; None for the faces of a cube, whose axes are those of the world, and
        for parallel rays
    low: corner of the sheet, along right and along up
    scale: number of cells per unit, along right and along up
    columns, rows: number of cells in each direction, as numbers of type U
    most_x, most_y: greatest number of a column and of a row of cells
    """

    right: Any
    up: Any
    forward: Any
    low: tuple[Any, Any]
    scale: tuple[Any, Any]
    columns: Any
    rows: Any
    most_x: Any
    most_y: Any
    faces: int

    @staticmethod
    def of(a: Arrays, lists: CellLists) -> "Sheet":
        """The sheet of a set of lists. All faces of a cube have the same."""
        view: CellView = lists.views[0]
        columns, rows = lists.columns, lists.rows_of_cells
        number = lambda x: dr.opaque(a.F32, float(x))  # noqa: E731 - one line for each use
        axes = [None] * 3
        if len(lists.views) == 1:
            axes = [a.put(a.V32, np.asarray(v)[:, None]) for v in (view.right, view.up, view.forward)]
        extent = view.high - view.low
        return Sheet(
            *axes,
            (number(view.low[0]), number(view.low[1])),
            (number(columns / extent[0]), number(rows / extent[1])),
            dr.opaque(a.U, columns),
            dr.opaque(a.U, rows),
            number(columns - 1),
            number(rows - 1),
            len(lists.views),
        )

    def cell(self, a: Arrays, d: Any) -> tuple[Any, Any]:
        """(number of the cell of each ray, mask of the rays that pass the sheet).

        d: directions, in single; for parallel rays (x, y, 1) with their coordinates on the sheet
        """
        face = None
        if self.right is None and self.faces == 1:
            x, y, z, inside = d.x, d.y, d.z, a.B(True)
        elif self.right is not None:
            x, y, z = dr.dot(d, self.right), dr.dot(d, self.up), dr.dot(d, self.forward)
            inside = z > 0
        else:
            on_x = (dr.abs(d.x) >= dr.abs(d.y)) & (dr.abs(d.x) >= dr.abs(d.z))
            on_y = ~on_x & (dr.abs(d.y) >= dr.abs(d.z))
            x, y, z = (
                dr.select(on_x, p, dr.select(on_y, q, r))
                for p, q, r in ((d.y, d.z, d.x), (d.z, d.x, d.y), (d.x, d.y, d.z))
            )
            face = dr.select(on_x, a.U(0), dr.select(on_y, a.U(2), 4)) + dr.select(z < 0, a.U(1), 0)
            z, inside = dr.abs(z), a.B(True)
        inverse = 1 if self.right is None and self.faces == 1 else dr.rcp(z)
        column, row = ((c * inverse - low) * scale for c, low, scale in zip((x, y), self.low, self.scale))
        if face is None:
            # The sheet is wider than all rows by the error of these numbers, so a ray beyond its border meets no row.
            inside &= (column >= 0) & (row >= 0) & (column < self.most_x + 1) & (row < self.most_y + 1)
        column, row = (dr.minimum(dr.maximum(c, 0), most) for c, most in ((column, self.most_x), (row, self.most_y)))
        cell = a.U(row) * self.columns + a.U(column)
        return cell if face is None else cell + face * (self.columns * self.rows), inside


@dataclass(frozen=True)
class RowLists:
    """The lists of one batch for rays from one origin.

    sheet: the sheet of cells
    offsets: for each cell, the place of its first entry; and the number of all entries. Shape: (cells + 1)
    entries: numbers of rows in the batch. In each cell the nearest row is first. Shape: (entries)
    near: lower bound of the distance between the origin and the row of each entry. Shape: (entries)
    packets: numbers of each row's guard, four at a time. Shape: (4 x rows) each
    triangular: whether the guards are those of triangles; else they are those of balls
    screens: whether the guards know where a row is hit (screening.py), because rows are triangles or balls themselves
    """

    sheet: Sheet
    offsets: Any
    entries: Any
    near: Any
    packets: tuple[Any, ...]
    triangular: bool
    screens: bool

    @staticmethod
    def of(a: Arrays, batch: Batch, o: Any, views: tuple[CellView, ...]) -> "RowLists":
        """The lists of a batch for rays from o, in the arrays of a backend.

        views: sheets that contain all rays
        """
        triangular = batch.kind.triangular
        if triangular:
            corners = batch.kind.corners(batch.placed)
            packets = triangle_guard(a, corners, o).packets(a)
            lists = triangle_lists(views, *(points(x) for x in corners), BUDGET)
        else:
            guard = ball_guard(a, batch.centre, batch.radius, o)
            packets = (dr.ravel(a.Q32(*guard.to_centre, guard.least)),)
            lists = ball_lists(views, *balls(batch), BUDGET)
        arrays = entry_arrays(a, lists)
        return evaluated(RowLists(Sheet.of(a, lists), *arrays, packets, triangular, triangular or batch.is_ball))

    def guard(self, a: Arrays, row: Any) -> BallGuard | TriangleGuard:
        """The guard of a row of the batch, for each lane."""
        p = [dr.gather(a.Q32, packet, row) for packet in self.packets]
        return TriangleGuard.unpacked(a, *p) if self.triangular else BallGuard(a.V32(p[0].x, p[0].y, p[0].z), p[0].w)

    def span(self, a: Arrays, d: Any, active: Any) -> tuple[Any, Any]:
        """(place of the first entry of each ray's cell, place behind its last entry); equal in inactive lanes.

        d: directions, in single.
        """
        cell, inside = self.sheet.cell(a, d)
        inside &= active
        return dr.gather(a.U, self.offsets, cell, inside), dr.gather(a.U, self.offsets, cell + 1, inside)


def row_lists(
    a: Arrays, batches: tuple[Batch, ...], listed: tuple[int, ...], o: Any, views: tuple[CellView, ...] | None
) -> tuple[RowLists | None, ...]:
    """For each batch, the lists of its rows for rays from o; None for batches that are not in lists.

    listed: numbers of the batches in lists
    views: sheets that contain all rays; None for all directions
    """
    if not listed:
        return (None,) * len(batches)
    if views is None:
        views = point_views(points(o)[0], *listed_balls(batches, listed))
    return tuple(RowLists.of(a, b, o, views) if i in listed else None for i, b in enumerate(batches))


def camera_sheet(camera: Camera, size: tuple[int, int], reach: float) -> CellView:
    """The sheet of the rays of a pinhole camera.

    camera: its numbers, as arrays of width 1
    size: width and height of the picture in pixels
    reach: how far rays go beyond the edges of the picture, in pixels
    """
    right, up, forward, _ = camera.axes()
    most_up = np.tan(np.radians(np.array(camera.fov, float)[0]) / 2)
    most = np.array([most_up * size[0] / size[1], most_up])
    if reach:
        most += 2 * most_up / size[1] * reach
    return camera_view(*(points(v)[0] for v in (camera.origin, right, up, forward)), -most, most)


def entry_arrays(a: Arrays, lists: CellLists) -> tuple[Any, Any, Any]:
    """(offsets, entries, near) of RowLists. Lists without entries get one that no cell has, as no array is empty."""
    entries = lists.entries if len(lists.entries) else np.zeros(1, np.uint32)
    near = lists.near[entries] if len(lists.entries) else np.zeros(1, np.float32)
    return a.put(a.U, lists.offsets), a.put(a.U, entries), a.put(a.F32, near)


def points(p: Any) -> np.ndarray:
    """Points or vectors as a NumPy array. Shape: (n, 3)."""
    return np.ascontiguousarray(np.array(p, float).T)


def balls(batch: Batch) -> tuple[np.ndarray, np.ndarray]:
    """(centres, radii) of the bounding balls of a batch's rows. Shapes: (n, 3), (n)."""
    centre = points(batch.centre)
    return centre, np.broadcast_to(np.array(batch.radius, float), len(centre))


def listed_balls(batches: tuple[Batch, ...], listed: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """(centres, radii) of the bounding balls of all rows in lists. Shapes: (n, 3), (n)."""
    centre, radius = (np.concatenate(x) for x in zip(*(balls(batches[i]) for i in listed)))
    return centre, radius
