"""Cell lists: no row that a ray meets is missing from the list of its cell, and no row is nearer than its bound. The
truth are tests of every row against every ray in extended precision."""

from dataclasses import dataclass

import numpy as np
import pytest

from visray.accel.cells import (
    CellLists,
    CellView,
    ball_lists,
    camera_view,
    parallel_view,
    point_views,
    triangle_lists,
)
from visray.geometry import UNIT_ROUNDOFF, gamma

BUDGET = 1 << 24
X = np.longdouble
F = np.float32


# The cell of a ray, as kernels compute it.


def dot(v: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Scalar products in single; v has one row per ray."""
    w = w.astype(F)
    return v[:, 0] * w[0] + v[:, 1] * w[1] + v[:, 2] * w[2]


def cell_of(lists: CellLists, q: np.ndarray, wide: bool = True) -> np.ndarray:
    """The number of the cell of each ray, -1 if no view contains it.

    wide: whether a view also contains rays that are up to the slack beyond its border.
    q: unit directions in single; for parallel rays their positions, relative to the view's origin. Shape: (m, 3).
    """
    number = np.full(len(q), -1)
    largest = np.argmax(np.abs(q), axis=1)
    for v, view in enumerate(lists.views):
        z = dot(q, view.forward)
        inside = np.full(len(q), True) if view.parallel else z > 0
        if len(lists.views) == 6:
            inside &= largest == v // 2
        places = []
        for axis, count, slack, low, extent in zip(
            (view.right, view.up), (lists.columns, lists.rows_of_cells), lists.slack, view.low, view.extent
        ):
            with np.errstate(all="ignore"):
                x = dot(q, axis) if view.parallel else dot(q, axis) * (F(1) / z)
                place = (x - F(low)) * F(count / extent)
            beyond = slack if wide else 0
            inside &= (place >= F(-beyond)) & (place <= F(count + beyond))
            places.append(np.clip(np.floor(np.where(inside, place, 0)), 0, count - 1).astype(int))
        cell = (v * lists.rows_of_cells + places[1]) * lists.columns + places[0]
        number = np.where(inside & (number < 0), cell, number)
    return number


# Rows and the truth about them.


@dataclass(frozen=True)
class Balls:
    """Shapes: centre (n, 3), radius (n)."""

    centre: np.ndarray
    radius: np.ndarray

    def lists(self, views: tuple, budget: int = BUDGET) -> CellLists | None:
        return ball_lists(views, self.centre, self.radius, budget)

    def balls(self) -> tuple[np.ndarray, np.ndarray]:
        return self.centre, self.radius

    def hits(self, o: np.ndarray, d: np.ndarray, endless: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The pairs that meet: (numbers of rays, numbers of rows, least distance).

        o: origins of the rays. Shape: (1, 3) or (m, 3).
        endless: whether the rays are lines, which begin nowhere.
        """
        o, d = o.astype(X), d.astype(X)
        d = d / np.sqrt((d * d).sum(axis=1, keepdims=True))
        to_centre = [self.centre.astype(X)[None, :, k] - o[:, None, k] for k in range(3)]
        middle = sum(to_centre[k] * d[:, None, k] for k in range(3))
        aside = sum((to_centre[k] - middle * d[:, None, k]) ** 2 for k in range(3))
        squared = self.radius.astype(X) ** 2 - aside
        half = np.sqrt(np.maximum(squared, 0))
        met = (squared >= 0) if endless else (squared >= 0) & (middle + half >= 0)
        ray, row = np.nonzero(met)
        first = (middle - half)[ray, row]
        return ray, row, first if endless else np.maximum(first, 0)

    def targets(self, o: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """Points on the rows, and points where tangents from o touch them."""
        side = random.normal(size=self.centre.shape)
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        to = self.centre - o
        across = np.cross(to, side)
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
        square, r = (to * to).sum(axis=1, keepdims=True), self.radius[:, None]
        touching = np.sqrt(np.maximum(square - r * r, 0)) / np.maximum(square, 1e-300)
        tangent = to * (1 - r * r / np.maximum(square, 1e-300)) + across * r * touching * np.sqrt(square)
        return np.concatenate([self.centre + side * r, o + tangent])


@dataclass(frozen=True)
class Triangles:
    """Shapes: (n, 3) each."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray

    def lists(self, views: tuple, budget: int = BUDGET) -> CellLists | None:
        return triangle_lists(views, self.a, self.b, self.c, budget)

    def balls(self) -> tuple[np.ndarray, np.ndarray]:
        corners = [self.a, self.b, self.c]
        middle = sum(corners) / 3
        return middle, np.max([np.linalg.norm(v - middle, axis=1) for v in corners], axis=0)

    def hits(self, o: np.ndarray, d: np.ndarray, endless: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As Balls.hits. Edges and corners belong to the triangle."""
        o, d = o.astype(X), d.astype(X)
        d = d / np.sqrt((d * d).sum(axis=1, keepdims=True))
        corners = [[v.astype(X)[None, :, k] - o[:, None, k] for k in range(3)] for v in (self.a, self.b, self.c)]
        volumes, sizes = [], []
        for k in range(3):
            (px, py, pz), (qx, qy, qz) = corners[k], corners[(k + 1) % 3]
            products = [
                (d[:, None, 0], py * qz, pz * qy),
                (d[:, None, 1], pz * qx, px * qz),
                (d[:, None, 2], px * qy, py * qx),
            ]
            volumes.append(sum(x * (y - z) for x, y, z in products))
            sizes.append(sum(np.abs(x) * (np.abs(y) + np.abs(z)) for x, y, z in products))
        zero = [16 * np.finfo(X).eps * s for s in sizes]
        inside = np.all([v >= -e for v, e in zip(volumes, zero)], axis=0)
        inside |= np.all([v <= e for v, e in zip(volumes, zero)], axis=0)
        total = sum(volumes)
        # Rays in the plane of a triangle are left out: their distance has no meaning. It is exact to 2^-26 for others.
        inside &= np.abs(total) > 2**26 * sum(zero)
        ray, row = np.nonzero(inside)
        weights = [v[ray, row] / total[ray, row] for v in volumes]  # of the corners c, a, b
        along = [sum(p[k][ray % len(p[k]), row] * d[ray, k] for k in range(3)) for p in corners]
        t = weights[1] * along[0] + weights[2] * along[1] + weights[0] * along[2]
        ahead = np.full(len(t), True) if endless else t >= 0
        return ray[ahead], row[ahead], t[ahead]

    def targets(self, o: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """The corners, points on edges, and points inside."""
        w = random.uniform(size=(1, len(self.a), 1))
        edge = self.a * w[0] + self.b * (1 - w[0])
        inside = (edge + self.c) / 2
        return np.concatenate([self.a, self.b, self.c, edge, inside])


def random_balls(random: np.random.Generator, n: int) -> Balls:
    """Balls of all sizes, near and far; some around the middle, some touch it, some are points."""
    distance = 10.0 ** random.uniform(-2, 3, n)
    direction = random.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    radius = distance * 10.0 ** random.uniform(-6, -0.3, n)
    radius[: n // 16] = distance[: n // 16] * random.uniform(0.9, 1.1, n // 16)
    radius[n // 16 : n // 8] = 0
    return Balls(direction * distance[:, None], radius)


def random_triangles(random: np.random.Generator, n: int) -> Triangles:
    """Triangles of all sizes, near and far: slivers, points, some seen edge-on, some that surround the middle."""
    middle = random_balls(random, n)
    size = np.maximum(middle.radius, 1e-4)[:, None]
    a, b, c = (middle.centre + size * random.normal(size=(n, 3)) for _ in range(3))
    k = n // 8
    c[:k] = a[:k] + random.uniform(size=(k, 1)) * (b[:k] - a[:k]) + 1e-9 * size[:k] * random.normal(size=(k, 3))
    c[k : 2 * k] = a[k : 2 * k] * random.uniform(0.5, 2, (k, 1))
    b[2 * k : 3 * k] = c[2 * k : 3 * k] = a[2 * k : 3 * k]
    a[3 * k : 4 * k], b[3 * k : 4 * k] = (random.normal(size=(k, 3)) * 20 for _ in range(2))
    return Triangles(a, b, c)


def wide_balls(random: np.random.Generator, n: int) -> Balls:
    """Balls that each cover many cells."""
    centre = 5 * random.normal(size=(n, 3))
    return Balls(centre, np.linalg.norm(centre, axis=1) * random.uniform(0.1, 0.5, n))


def wide_triangles(random: np.random.Generator, n: int) -> Triangles:
    """Triangles that each cover many cells."""
    middle = wide_balls(random, n)
    return Triangles(*(middle.centre + middle.radius[:, None] * random.normal(size=(n, 3)) for _ in range(3)))


KINDS = {
    "balls": random_balls,
    "triangles": random_triangles,
    "wide balls": wide_balls,
    "wide triangles": wide_triangles,
}


def ahead(rows: Balls | Triangles, far: float) -> Balls | Triangles:
    """The rows, moved by `far` along x and z, so that most of them are on one side of the origin."""
    return type(rows)(*(v + np.array([0.7, 0.2, 1]) * far if v.ndim == 2 else v for v in vars(rows).values()))


# Views of all types.


def views_of(name: str, o: np.ndarray, rows: Balls | Triangles, random: np.random.Generator) -> tuple:
    if name == "point":
        return point_views(o, *rows.balls())
    if name == "parallel":
        return (parallel_view(random.normal(size=3), *rows.balls()),)
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0].T
    low, high = -random.uniform(0.1, 1.2, 2), random.uniform(0.1, 1.2, 2)
    if name == "narrow":
        low, high = low * 1e-4, high * 1e-4
    return (camera_view(o, *axes, low, high),)


VIEWS = ["point", "parallel", "camera", "narrow"]


def rays(
    lists: CellLists, o: np.ndarray, rows: Balls | Triangles, random: np.random.Generator, n: int
) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions of rays in double: random ones, at borders of cells, and towards targets."""
    view = lists.views[random.integers(len(lists.views))]
    aims = rows.targets(view.origin, random)
    aims = aims[random.permutation(len(aims))[:n]]
    grid = np.array([lists.columns, lists.rows_of_cells])
    place = random.uniform(0, 1, (2 * n, 2)) * grid
    border = random.integers(2, size=n)
    place[np.arange(n), border] = np.round(place[np.arange(n), border])
    x, y = (view.low + place * (view.extent / grid)).T[..., None]
    if view.parallel:
        depth = random.normal(size=(2 * n, 1)) * view.reach / 256
        start = np.concatenate([view.origin + x * view.right + y * view.up + depth * view.forward, aims])
        return start, np.broadcast_to(view.forward, start.shape)
    d = np.concatenate([view.forward + x * view.right + y * view.up, aims - view.origin])
    length = np.linalg.norm(d, axis=1, keepdims=True)
    return view.origin[None], (d / np.where(length > 0, length, 1))[length[:, 0] > 0]


def missing(
    lists: CellLists, rows: Balls | Triangles, o: np.ndarray, d: np.ndarray, covers: bool, random: np.random.Generator
) -> tuple[int, int, int]:
    """(hits that are not in the list of the ray's cell, hits that are nearer than `near`, number of hits).

    covers: whether rays in no view meet no row.
    """
    view = lists.views[0]
    if view.parallel:
        rounded = (o - view.origin).astype(F)
    else:
        rounded = d.astype(F)
        rounded *= (1 + UNIT_ROUNDOFF["single"] * random.uniform(-5, 5, d.shape)).astype(F)
    cell = cell_of(lists, rounded)
    ray, row, t = rows.hits(o, d, view.parallel)
    if view.parallel:
        t = t + (o[ray].astype(X) - view.origin.astype(X)) @ view.forward.astype(X)
    present = cell[ray] >= 0
    lost = np.count_nonzero(cell_of(lists, rounded, wide=False)[ray] < 0) if covers else 0
    ray, row, t = ray[present], row[present], t[present]
    n = len(lists.near)
    listed = np.repeat(np.arange(len(lists.offsets) - 1), np.diff(lists.offsets.astype(np.int64))) * n + lists.entries
    lost += np.count_nonzero(~np.isin(cell[ray] * n + row, listed))
    early = np.count_nonzero(lists.near[row] > t)
    if lists.far is not None:
        early += np.count_nonzero(lists.far[row] < t)
    return lost, early, len(ray)


def check(kind: str, view: str, origin: float, seed: int, n: int, m: int) -> int:
    """Asserts the promise for one random scene; returns the number of pairs of a ray and a row."""
    random = np.random.default_rng(seed)
    rows = KINDS[kind](random, n)
    if view in ("point", "camera") and seed % 2:
        rows = ahead(rows, 20 if kind.startswith("wide") else 2000)
    o = np.array([origin, -origin / 3, origin / 7]) + random.normal(size=3)
    scale = (1, 1e-6, 1e5)[seed % 3]
    rows = type(rows)(*(v * scale + o if v.ndim == 2 else v * scale for v in vars(rows).values()))
    views = views_of(view, o, rows, random)
    lists = rows.lists(views)
    start, d = rays(lists, o, rows, random, m)
    lost, early, hits = missing(lists, rows, start, d, view in ("point", "parallel"), random)
    assert (lost, early) == (0, 0), (kind, view, origin, seed, hits)
    return max(len(start), len(d)) * n


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("kind", KINDS)
def test_no_row_is_missing(kind: str, view: str) -> None:
    """A few scenes: the middle among the rows and outside of them, and far from the world's origin."""
    for origin, seed in ((0, 0), (0, 1), (1e6, 2)):
        check(kind, view, origin, seed, 96, 400)


@pytest.mark.slow
@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("kind", KINDS)
def test_no_row_is_missing_in_ten_million_pairs(kind: str, view: str) -> None:
    pairs, seed = 0, 100
    while pairs < 0.8e6:
        pairs += check(kind, view, (0, 30, 1e6)[seed % 3], seed, (30, 250)[seed % 2], 1000)
        seed += 1


def test_lists_are_sorted_and_the_same_again() -> None:
    random = np.random.default_rng(7)
    rows = random_balls(random, 500)
    rows.centre[100:200] = rows.centre[0]  # equal distances: the row numbers decide
    rows.radius[100:200] = rows.radius[0]
    views = point_views(np.zeros(3), *rows.balls())
    lists, again = (rows.lists(views) for _ in range(2))
    assert len(lists.offsets) == 6 * lists.columns * lists.rows_of_cells + 1
    assert np.array_equal(lists.offsets, again.offsets) and np.array_equal(lists.entries, again.entries)
    cell = np.repeat(np.arange(len(lists.offsets) - 1), np.diff(lists.offsets.astype(int)))
    order = np.lexsort((lists.entries, lists.near[lists.entries], cell))
    assert np.array_equal(order, np.arange(len(order)))
    assert lists.offsets.dtype == lists.entries.dtype == np.uint32 and lists.near.dtype == np.float32


@pytest.mark.parametrize("kind", KINDS)
def test_a_smaller_budget_gives_coarser_cells(kind: str) -> None:
    random = np.random.default_rng(8)
    rows = KINDS[kind](random, 300)
    views = point_views(np.zeros(3), *rows.balls())
    rich = rows.lists(views)
    for budget in (rich.bytes // 2, rich.bytes // 10, 2000 * 4):
        lists = rows.lists(views, budget)
        assert lists.bytes <= budget
        assert lists.columns < rich.columns
    assert rows.lists(views, 1000) is None


def test_no_rows_and_one_row() -> None:
    nothing = Balls(np.zeros((0, 3)), np.zeros(0))
    lists = nothing.lists(point_views(np.zeros(3), *nothing.balls()))
    assert not len(lists.entries) and not lists.offsets.any()
    one = Balls(np.array([[0.0, 0, 5]]), np.array([1.0]))
    views = point_views(np.zeros(3), *one.balls())
    assert len(views) == 1
    lists = one.lists(views)
    middle = cell_of(lists, np.array([[0, 0, 1]], F))[0]
    assert lists.entries[lists.offsets[middle]] == 0
    assert 4 * (1 - 32 * UNIT_ROUNDOFF["single"]) < lists.near[0] <= 4


def test_a_row_around_the_origin_is_in_every_cell() -> None:
    rows = Balls(np.array([[0.0, 0, 0], [0, 0, 5]]), np.array([3.0, 0.1]))
    lists = rows.lists(point_views(np.zeros(3), *rows.balls()))
    assert len(lists.views) == 6 and lists.near[0] == 0
    assert np.all(lists.entries[lists.offsets[:-1]] == 0)


def test_balls_within_55_degrees_share_one_pyramid() -> None:
    for degrees, count in ((50, 1), (60, 6)):
        angle = np.radians(degrees)
        centre = 9 * np.array([[np.sin(angle), 0, np.cos(angle)], [-np.sin(angle), 0, np.cos(angle)]])
        assert len(point_views(np.zeros(3), centre, np.full(2, 0.01))) == count


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("kind", ["balls", "triangles"])
def test_a_point_on_the_border_of_cells_is_in_the_list_of_each_ray_to_it(kind: str, view: str) -> None:
    """Rounding in single decides the cell of such a ray. For points, the number of cells hardly depends on where they
    are, so a first build tells where the borders are. Far from the world's origin, the points are so near that their
    own rounding is seen: the rows are moved by half of the bound that they are known to."""
    for origin, seed in ((0, 1), (1e6, 2)):
        random = np.random.default_rng(seed)
        rows = ahead(random_balls(random, 500), 2000)
        views = views_of(view, np.array([origin, -origin / 3, origin / 7]), rows, random)
        nearness = 1e-4 if origin and view != "narrow" else 1
        grid, lists = (16, 16), None
        while lists is None or grid != (lists.columns, lists.rows_of_cells):
            grid = (lists.columns, lists.rows_of_cells) if lists else grid
            at, d = on_borders(views[0], *grid, nearness, random)
            shift = random.uniform(-0.5, 0.5, at.shape) * gamma(32) * np.abs(at).sum(axis=1, keepdims=True)
            lists = points(kind, at + shift, d).lists(views)
        if lists.views[0].parallel:
            cell = cell_of(lists, (at - views[0].origin).astype(F))
        else:
            rounded = d.astype(F) * (1 + UNIT_ROUNDOFF["single"] * random.uniform(-5, 5, d.shape)).astype(F)
            cell = cell_of(lists, rounded)
        assert np.all(cell >= 0)
        for row, c in enumerate(cell):
            assert row in lists.entries[lists.offsets[c] : lists.offsets[c + 1]]


def on_borders(
    view: CellView, columns: int, rows_of_cells: int, nearness: float, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """(points on the borders of cells, unit vectors from the view's origin to them). Shape: (n, 3) each."""
    grid = np.array([columns, rows_of_cells])
    place = random.uniform(0, 1, (1000, 2)) * grid
    border = random.integers(2, size=1000)
    place[np.arange(1000), border] = np.round(place[np.arange(1000), border])
    x, y = (view.low + place * (view.extent / grid)).T[..., None]
    depth = random.uniform(1, 9, (1000, 1)) * nearness
    if view.parallel:
        to_point = view.right * x + view.up * y + depth * view.forward
    else:
        to_point = (view.right * x + view.up * y + view.forward) * depth
    return view.origin + to_point, to_point / np.linalg.norm(to_point, axis=1, keepdims=True)


def points(kind: str, at: np.ndarray, d: np.ndarray) -> Balls | Triangles:
    """Rows that are points; triangles whose other corners lie on the same ray, or next to it."""
    if kind.endswith("balls"):
        return Balls(at, np.zeros(len(at)))
    longer = 1e-7 * np.linalg.norm(at - at.mean(axis=0), axis=1, keepdims=True) * d
    return Triangles(at, at + longer, at - longer)
