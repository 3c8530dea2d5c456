"""Scenes, rays, and a search through the tree of the imported visray, which is one of two versions.

Only the tree and its traversal come from visray. The tests of rows are written here, so that both versions are compared
with the same tests. A row is one object in the kernel's tables, a batch is the rows of one kind, and a lane is one ray.
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import visray  # isort: skip - first, because it chooses the LLVM that Dr.Jit loads
import drjit as dr
import numpy as np

from visray.quantities import Arrays

SHAPES = ("spheres", "boxes", "slivers", "mixed")
SIDE = 256  # rays along a side of the camera's picture
EYE, TARGET, LAMP, FOV = (0.0, 5.0, 9.0), (0.0, 1.0, 0.0), (4.0, 8.0, 5.0), 40.0
NO_ROW = 0xFFFFFFFF


def world(shape: str, n: int) -> list[tuple[str, np.ndarray]]:
    """The batches of a random scene: pairs (kind, rows).

    shape: one of SHAPES; n: number of rows over all batches
    A row has 9 numbers: centre and half sides of a sphere or a box, then zeros; or the three corners of a sliver.
    Shapes: (9, rows) each.
    """
    rng = np.random.default_rng(n)
    middle = rng.uniform((-4, 0.1, -4), (4, 3, 4), (n, 3))
    size = (rng.uniform(0.3, 0.9, n) * 2.2 / n ** (1 / 3))[:, None]
    along, across = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in rng.normal(size=(2, n, 3)))
    across = np.cross(along, across)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    unused = np.zeros((n, 3))
    rows = {
        "spheres": np.hstack([middle, size * np.ones(3), unused]),
        "boxes": np.hstack([middle, size * rng.uniform(0.4, 1, (n, 3)), unused]),
        "slivers": middle[:, [0, 1, 2] * 3] + 4 * size * np.hstack([-along, along, along + 2e-3 * across]),
    }
    if shape != "mixed":
        return [(shape, rows[shape].T)]
    return [(kind, rows[kind][k::3].T) for k, kind in enumerate(rows)]


def bounds(kind: str, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Bounding box and bounding sphere of each row: (low, high, centre, radius). Shapes: (n, 3) each, radius (n)."""
    a, b, c = rows.T.reshape(-1, 3, 3).transpose(1, 0, 2)
    if kind == "slivers":
        corners, middle = np.array([a, b, c]), (a + b + c) / 3
        return corners.min(axis=0), corners.max(axis=0), middle, np.linalg.norm(corners - middle, axis=2).max(axis=0)
    return a - b, a + b, a, b[:, 0] if kind == "spheres" else np.linalg.norm(b, axis=1)


def rays(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Origins and unit directions of rays. Shapes: (3, N) each; origins are (3, 1) if all rays share one.

    kind: "random", or "camera"; camera rays are ordered in tiles of 4 x 4 pixels
    """
    n, rng = SIDE * SIDE, np.random.default_rng(3)
    if kind == "random":
        o, d = rng.uniform((-4, 0.1, -4), (4, 3, 4), (n, 3)).T, rng.normal(size=(3, n))
        return o, d / np.linalg.norm(d, axis=0)
    y, x = ((v.reshape(SIDE // 4, 4, SIDE // 4, 4).swapaxes(1, 2).ravel() + 0.5) / SIDE for v in np.mgrid[:SIDE, :SIDE])
    forward = np.array(TARGET) - EYE
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0, 1, 0))
    right /= np.linalg.norm(right)
    slope = np.tan(np.radians(FOV / 2))
    d = forward[:, None] + slope * ((2 * x - 1) * right[:, None] + (1 - 2 * y) * np.cross(right, forward)[:, None])
    return np.array(EYE)[:, None], d / np.linalg.norm(d, axis=0)


class Search:
    """A scene, and searches through its tree.

    batches: pairs (kind, rows), see `world`
    counted: whether the tests of boxes and rows are counted
    build: seconds to build the tree
    """

    def __init__(self, a: Arrays, batches: list[tuple[str, np.ndarray]], counted: bool = False):
        self.a, self.counted, self.kinds = a, counted, [kind for kind, _ in batches]
        self.base = np.cumsum([0] + [rows.shape[1] for _, rows in batches])
        self.tables = [[a.put(a.W, rows[3 * k : 3 * k + 3]) for k in range(3)] for _, rows in batches]
        limits = [bounds(*batch) for batch in batches]
        self.spheres = [(a.put(a.W, middle.T), a.put(a.D, radius)) for _, _, middle, radius in limits]
        dr.eval(self.tables, self.spheres)
        dr.sync_thread()
        start = time.process_time()
        self.walk = new_walk(self, limits) if has_tree_over_boxes() else old_walk(self, limits)
        self.build = time.process_time() - start

    def test_row(self, batch: int, state: tuple, row: Any, present: Any, o: Any, d: Any, change: Callable) -> tuple:
        """The new state of the search after the test of one row: change(state, t, row) in lanes where the ray hits the
        row's bounding sphere, and otherwise the old state.

        batch: index of the batch; row: number of the row in the batch; present: mask of the lanes that test a row
        """
        a = self.a
        middle, radius = (dr.gather(type(x), x, row, present) for x in self.spheres[batch])
        to_centre = middle - o
        squared = dr.squared_norm(to_centre)
        margin = a.F32(squared - dr.square(radius) - 2.0**-20 * squared)
        along = dr.dot(a.V32(to_centre), a.V32(d))
        may_hit = present & (along * along >= margin) & ((along > 0) | (margin < 0))

        def exact(*state: Any) -> tuple:
            table = [dr.gather(a.W, x, row) for x in self.tables[batch]]
            return change(state, TESTS[self.kinds[batch]](table, o, d), row + int(self.base[batch]))

        return dr.if_stmt(state, may_hit, exact, lambda *state: state, label="exact")

    def closest(self, o: Any, d: Any) -> tuple:
        """The first hits, and the numbers of tests: ((t, row), tests of boxes, tests of rows)."""
        a, n = self.a, dr.width(d)

        def change(state: tuple, t: Any, row: Any) -> tuple:
            nearer = (t < state[0]) | ((t == state[0]) & (row < state[1]) & (t < dr.inf))
            return dr.select(nearer, t, state[0]), dr.select(nearer, row, state[1])

        start = dr.full(a.D, dr.inf, n), dr.full(a.U, NO_ROW, n)
        return self.walk(o, d, start, change, lambda state: state[0], lambda _: a.B(False))

    def any(self, o: Any, d: Any, length: Any) -> tuple:
        """Whether rays of this length are occluded, and the numbers of tests: ((occluded,), boxes, rows)."""

        def change(state: tuple, t: Any, row: Any) -> tuple:
            return (state[0] | (t < length),)

        start = (dr.full(self.a.B, False, dr.width(d)),)
        return self.walk(o, d, start, change, lambda _: length, lambda state: state[0])


def has_tree_over_boxes() -> bool:
    """Whether the imported visray has the tree over bounding boxes.

    This is decided by the tree's file. A trial import could find the module of another visray that is installed.
    """
    return (Path(visray.__file__).parent / "accel" / "bvh.py").exists()


def new_walk(search: Search, limits: list) -> Callable:
    """A function that traverses the tree over boxes and returns (state, tests of boxes, tests of rows) of each lane.

    limits: for each batch, the result of `bounds`
    """
    from visray.accel.bvh import build
    from visray.accel.bvh_walk import Walk
    from visray.accel.sah import WIDTH

    low, high = (np.concatenate([x[k] for x in limits]) for k in range(2))
    batch = np.repeat(np.arange(len(limits)), np.diff(search.base))
    tree = build(search.a, low, high, batch, np.arange(len(low)))
    dr.eval(tree)
    dr.sync_thread()

    def walk(o: Any, d: Any, state: tuple, change: Callable, reach: Callable, done: Callable) -> tuple:
        def visit(batch: int, state: tuple, row: Any, present: Any) -> tuple:
            return search.test_row(batch, state, row - int(search.base[batch]), present, o, d, change)

        walk_of_rays = Walk.along(search.a, tree, o, d)
        if not search.counted:
            return walk_of_rays.traverse(state, visit, reach, done), None, None
        *state, nodes, rows = walk_of_rays.traverse(state, visit, reach, done, counted=True)
        return tuple(state), WIDTH * nodes, rows

    return walk


def old_walk(search: Search, limits: list) -> Callable:
    """A function that traverses the trees over spheres, one batch after the other.

    The function returns (state, tests of boxes, tests of rows) of each lane. limits: see `new_walk`.
    """
    from visray import bvh

    a, trees = search.a, [bvh.build(search.a, middle, radius) for _, _, middle, radius in limits]
    dr.eval(trees)
    dr.sync_thread()
    rounds: list[Any] = []
    if search.counted:
        bvh.dr = CountingDrJit(a, rounds)

    def walk(o: Any, d: Any, state: tuple, change: Callable, reach: Callable, done: Callable) -> tuple:
        d32, n = a.V32(d), dr.width(d)
        boxes, tested = dr.zeros(a.U, n), dr.zeros(a.U, n)
        for batch, tree in enumerate(trees):

            def visit(state: tuple, row: Any, present: Any, batch: int = batch) -> tuple:
                state, counts = (state[:-1], state[-1:]) if search.counted else (state, ())
                counts = tuple(c + dr.select(present, a.U(1), a.U(0)) for c in counts)
                return *search.test_row(batch, state, row, present, o, d, change), *counts

            packets = bvh.packets(a, tree, o) if dr.width(o) == 1 else None
            dr.eval(packets)
            walk_of_rays = bvh.Walk.along(a, tree, packets, o, d32)
            counts = (dr.zeros(a.U, n),) if search.counted else ()
            result = walk_of_rays.through((*state, *counts), visit, lambda s: a.F32(reach(s)), done)
            state = tuple(result[: len(state)])
            if search.counted:
                tested += result[-1]
                # Each iteration visits either an inner node, which has two boxes, or a leaf. Most leaves are full, so
                # the number of leaves follows from the number of tested rows.
                leaves = a.U(dr.ceil(a.F32(result[-1]) / bvh.LEAF))
                boxes += 2 * (rounds.pop() - leaves)
        return state, boxes, tested

    return walk


class CountingDrJit:
    """Stands in for the module drjit. Its loops count their iterations, and append the counts to `rounds`."""

    def __init__(self, a: Arrays, rounds: list):
        self.a, self.rounds = a, rounds

    def __getattr__(self, name: str) -> Any:
        return getattr(dr, name)

    def while_loop(self, start: tuple, condition: Callable, body: Callable, label: str) -> tuple:
        count = dr.zeros(self.a.U, dr.width(start))
        first, *rest = dr.while_loop(
            (count, *start), lambda _, *s: condition(*s), lambda k, *s: (k + 1, *body(*s)), label=label
        )
        self.rounds.append(first)
        return tuple(rest)


def sphere(table: list, o: Any, d: Any) -> Any:
    """Distance of the first hit with a sphere, inf without a hit. table: the row as three vectors, see `world`."""
    to, radius = table[0] - o, table[1].x
    along = dr.dot(to, d)
    square = dr.square(radius) - dr.squared_norm(to - along * d)
    half = dr.sqrt(square)
    t = dr.select(along > half, along - half, along + half)
    return dr.select((square >= 0) & (t > 0), t, dr.inf)


def box(table: list, o: Any, d: Any) -> Any:
    """Distance of the first hit with a box, inf without a hit. table: the row as three vectors, see `world`."""
    begin, end = type(o.x)(-dr.inf), type(o.x)(dr.inf)
    for axis in range(3):
        inverse, to = dr.rcp(d[axis]), table[0][axis] - o[axis]
        one, two = (to - table[1][axis]) * inverse, (to + table[1][axis]) * inverse
        first, last = dr.select(one < two, one, two), dr.select(one < two, two, one)
        begin, end = dr.select(first > begin, first, begin), dr.select(last < end, last, end)
    t = dr.select(begin > 0, begin, end)
    return dr.select((begin <= end) & (t > 0), t, dr.inf)


def sliver(table: list, o: Any, d: Any) -> Any:
    """Distance of the hit with a triangle, inf without a hit. table: the row as three vectors, see `world`."""
    a, b, c = (v - o for v in table)
    u, v, w = dr.dot(d, dr.cross(b, c)), dr.dot(d, dr.cross(c, a)), dr.dot(d, dr.cross(a, b))
    inside = ((u >= 0) & (v >= 0) & (w >= 0)) | ((u <= 0) & (v <= 0) & (w <= 0))
    t = (u * dr.dot(a, d) + v * dr.dot(b, d) + w * dr.dot(c, d)) / (u + v + w)
    return dr.select(inside & (t > 0), t, dr.inf)


TESTS = {"spheres": sphere, "boxes": box, "slivers": sliver}
