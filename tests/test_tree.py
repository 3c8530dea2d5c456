"""The tree over boxes: what is found through it is what the loop over all rows finds, bit for bit; every row is below
one leaf, every box holds what is below it, and its splits cost no more than equal halves."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
import pytest

from visray.accel import hierarchy, sah, walk_stack
from visray.accel.blocks import BLOCK, CHILDREN, CORNER, FIRST_CHILD, HIGH, KIND, LOW, NODE, NUMBER, ROW, STEP, TreeRows
from visray.accel.bvh import build, outwards
from visray.accel.bvh_step import Certain, Search
from visray.accel.bvh_walk import walk
from visray.accel.hierarchy import MOST_LEVELS, NONE, WIDTH, binary, widened
from visray.accel.morton import clusters
from visray.accel.sah import Level, binary_trees
from visray.accel.tree_rays import TreeRays
from visray.quantities import Arrays
from visray.ray import NO_ROW, unit

A = Arrays.of("llvm", "single")
RAYS = 16384


# Rows to find: spheres of batch 0, boxes of batch 1, each tested in double.


@dataclass(frozen=True)
class Rows:
    """Middles and half sides; the first `spheres` rows are spheres, of radius x of the half sides. Shapes: (3, n)."""

    middle: np.ndarray
    half: np.ndarray
    spheres: int

    def corners(self) -> tuple[np.ndarray, np.ndarray]:
        return (self.middle - self.half).T, (self.middle + self.half).T


def sphere(middle: Any, half: Any, o: Any, d: Any) -> Any:
    """Where rays enter spheres, or leave them if they start within; inf if they do not meet them."""
    to = middle - o
    along = dr.dot(to, d)
    aside = to - along * d
    square = half.x * half.x - dr.squared_norm(aside)
    root = dr.sqrt(dr.maximum(square, 0))
    t = dr.select(along - root > 0, along - root, along + root)
    return dr.select((square >= 0) & (t > 0), t, dr.inf)


def box(middle: Any, half: Any, o: Any, d: Any) -> Any:
    """The same for boxes."""
    begin, end = A.D(-dr.inf), A.D(dr.inf)
    for axis in range(3):
        low, high = middle[axis] - half[axis] - o[axis], middle[axis] + half[axis] - o[axis]
        along = d[axis] == 0
        within = (low <= 0) & (high >= 0)
        one, two = low / d[axis], high / d[axis]
        first = dr.select(along, dr.select(within, -dr.inf, dr.inf), dr.select(one < two, one, two))
        last = dr.select(along, dr.select(within, dr.inf, -dr.inf), dr.select(one < two, two, one))
        begin, end = dr.select(first > begin, first, begin), dr.select(last < end, last, end)
    t = dr.select(begin > 0, begin, end)
    return dr.select((begin <= end) & (t > 0), t, dr.inf)


KINDS = (sphere, box)


class Scene:
    """Rows and their tree, asked through it or one by one. Its tree knows that spheres are balls, unless `plain`."""

    def __init__(self, rows: Rows, plain: bool = False):
        self.rows = rows
        self.n = rows.middle.shape[1]
        self.middle, self.half = A.put(A.W, rows.middle), A.put(A.W, rows.half)
        (low, high), k = rows.corners(), rows.spheres
        balls = np.concatenate([rows.middle, rows.half[:1]])[:, :k].T
        parts = {0: TreeRows(0, low[:k], high[:k], balls=None if plain else balls), 1: TreeRows(k, low[k:], high[k:])}
        self.tree = build(A, {i: part for i, part in parts.items() if len(part.low)})

    def t(self, batch: int, row: Any, o: Any, d: Any) -> Any:
        return KINDS[batch](dr.gather(A.W, self.middle, row), dr.gather(A.W, self.half, row), o, d)

    def closest(self, o: Any, d: Any, plain: bool, active: Any = True) -> tuple:
        exact = d if type(d) is A.W else unit(d, A.W)

        def visit(batch: int, state: tuple, row: Any, present: Any) -> tuple:
            best, index = state
            t = self.t(batch, row, o, exact)
            nearer = ((t < best) | ((t == best) & (row < index) & (t < dr.inf))) & present
            return dr.select(nearer, t, best), dr.select(nearer, row, index)

        start = (dr.full(A.D, dr.inf, dr.width(d)), dr.full(A.U, NO_ROW, dr.width(d)))
        if plain:
            return self.loop(start, visit)
        certain = Certain(A.D(0), A.D(dr.inf), A.D(0))
        search = Search(visit, lambda s: s[0], lambda _: ~A.B(active), certain=certain)
        return walk(TreeRays.along(A, self.tree, o, d), start, search)

    def any(self, o: Any, d: Any, length: Any, plain: bool) -> Any:
        def visit(batch: int, state: tuple, row: Any, present: Any) -> tuple:
            return (state[0] | (present & (self.t(batch, row, o, d) < length)),)

        start = (dr.full(A.B, False, dr.width(d)),)
        if plain:
            return self.loop(start, visit)[0]
        certain = Certain(A.D(0), length, A.D(0), lambda _: (A.B(True),))
        search = Search(visit, lambda _: length, lambda s: s[0], certain=certain)
        return walk(TreeRays.along(A, self.tree, o, d), start, search)[0]

    def count(self, o: Any, d: Any) -> Any:
        """The number of rows that each ray meets, and the sum of their numbers."""

        def visit(batch: int, state: tuple, row: Any, present: Any) -> tuple:
            met = present & (self.t(batch, row, o, d) < dr.inf)
            return state[0] + dr.select(met, A.U(1), 0), state[1] + dr.select(met, row, 0)

        start = dr.zeros(A.U, dr.width(d)), dr.zeros(A.U, dr.width(d))
        search = Search(visit, lambda _: A.D(dr.inf), lambda _: A.B(False))
        return walk(TreeRays.along(A, self.tree, o, d), start, search), self.loop(start, visit)

    def loop(self, state: tuple, visit: Any) -> tuple:
        for batch, (begin, end) in enumerate(((0, self.rows.spheres), (self.rows.spheres, self.n))):
            end = dr.opaque(A.U, end)

            def step(row: Any, *state: Any, batch: int = batch) -> tuple:
                return (row + 1, *visit(batch, state, row, True))

            row = dr.full(A.U, begin, dr.width(state))
            state = dr.while_loop((row, *state), lambda row, *_, end=end: row < end, step)[1:]
        return state


def random(rng: np.random.Generator, n: int, size: float = 0.2) -> Rows:
    return Rows(rng.uniform(-1, 1, (3, n)), size * rng.uniform(0.01, 1, (3, n)), n // 2)


def kept_round(rows: Rows) -> Rows:
    half = rows.half.copy()
    half[1:, : rows.spheres] = half[0, : rows.spheres]
    return Rows(rows.middle, half, rows.spheres)


def flat(rng: np.random.Generator) -> Rows:
    """All in one plane, across an axis."""
    rows = random(rng, 100)
    rows.middle[2], rows.half[2, 50:] = 0.25, 0
    return rows


def alike(rng: np.random.Generator) -> Rows:
    return Rows(np.full((3, 300), 0.1), np.full((3, 300), 0.3), 150)


def points(rng: np.random.Generator) -> Rows:
    """Boxes without size, many in the same place, among a few with one."""
    rows = random(rng, 100)
    rows.half[:, 60:] = 0
    rows.middle[:, 80:] = rows.middle[:, 80:81]
    return rows


def line(rng: np.random.Generator) -> Rows:
    rows = random(rng, 64)
    rows.middle[1:], rows.half[1:, 32:] = 0, 0
    return rows


def scales(rng: np.random.Generator) -> Rows:
    """Sizes and places from 1e-9 to 1e9."""
    size = 10 ** rng.uniform(-9, 8, 200)
    middle = np.clip(rng.normal(size=(3, 200)) * size * 3, -1e9, 1e9)
    return Rows(middle, size * rng.uniform(0.1, 1, (3, 200)), 100)


def halved(rng: np.random.Generator) -> Rows:
    """Each box half as large and as far as the one before: what splits by bins peel off one by one."""
    size = 2.0 ** -np.arange(120)
    return Rows(size * np.ones((3, 1)), 0.3 * size * np.ones((3, 1)), 60)


WORLDS = {
    "sparse": lambda rng: random(rng, 37),
    "dense": lambda rng: random(rng, 500, 1.0),
    "small": lambda rng: random(rng, 2000, 0.03),
    "far from zero": lambda rng: Rows(random(rng, 200).middle + 1e6, random(rng, 200).half, 100),
    "only boxes": lambda rng: Rows(random(rng, 50).middle, random(rng, 50).half, 0),
    "only spheres": lambda rng: Rows(random(rng, 50).middle, random(rng, 50).half, 50),
    "flat": flat,
    "alike": alike,
    "points": points,
    "line": line,
    "scales": scales,
    "halved": halved,
}


def world(name: str, seed: int = 1) -> Rows:
    return kept_round(WORLDS[name](np.random.default_rng(seed)))


def rays(rows: Rows, rng: np.random.Generator, far: float, n: int = RAYS) -> tuple[np.ndarray, np.ndarray]:
    """Rays from around the rows, or from `far` of their extents away; half are aimed at points on rows, many along an
    axis or in a plane across one, some exactly at edges of boxes, from corners of
    boxes or from the middle of all."""
    low, high = rows.corners()
    middle, span = 0.5 * low.min(axis=0) + 0.5 * high.max(axis=0), np.ptp(np.concatenate([low, high]), axis=0).max()
    o = middle[:, None] + (far + 1) * span * rng.normal(size=(3, n)) * 10 ** rng.uniform(-3, 0, n)
    row = rng.integers(0, rows.middle.shape[1], n)
    target = rows.middle[:, row] + rows.half[:, row] * rng.choice([-1, -0.99, 0, 0.5, 1], (3, n))
    # In the middle of all nothing but relative errors of the distances is left.
    o[:, rng.random(n) < 0.2] = middle[:, None]
    corner = rng.random(n) < 0.1
    o[:, corner] = (rows.middle + rows.half)[:, rng.integers(0, rows.middle.shape[1], corner.sum())]
    # In the plane of a face or along an edge.
    same = (rng.random((3, n)) < 0.3) & (rng.random(n) < 0.5)
    o[same] = target[same]
    d = np.where(rng.random(n) < 0.7, target - o, rng.normal(size=(3, n)))
    d[:, ~d.any(axis=0)] = np.array([[1.0], [0], [-0.0]])
    d[rng.random((3, n)) < 0.01] *= 1e-30
    d = d / np.abs(d).max(axis=0)
    return o, d / np.sqrt((d * d).sum(axis=0))


@pytest.mark.parametrize("far", [0.0, 3.0, 1e3, 1e6, 1e10])
@pytest.mark.parametrize("name", WORLDS)
@pytest.mark.slow
def test_answers_are_those_of_the_loop_over_all_rows(name: str, far: float) -> None:
    """Rationale: a fast path equals its slow twin. Setup: worlds, origins and directions that are hard for boxes in
    single. Expected: the same distance, row and shadow, bit for bit; and not by missing everything."""
    rows = world(name)
    scene, rng = Scene(rows), np.random.default_rng(2)
    o, d = (A.put(A.W, x) for x in rays(rows, rng, far))
    (t, index), (u, other) = (scene.closest(o, d, plain) for plain in (False, True))
    assert np.array_equal(np.array(t), np.array(u)) and np.array_equal(np.array(index), np.array(other))
    met = np.array(index) != NO_ROW
    assert met.mean() > 0.02
    length = A.put(A.D, np.where(met, np.array(t) * rng.choice([0.5, 1, 1 + 2**-50, 2], RAYS), 1))
    assert np.array_equal(*(np.array(scene.any(o, d, length, plain)) for plain in (False, True)))


def test_origins_that_rays_share() -> None:
    """An origin of one entry gives what one of as many as rays gives, and so do directions in single."""
    scene, rng = Scene(world("small")), np.random.default_rng(3)
    d = rng.normal(size=(3, RAYS))
    d = A.put(A.V32, d / np.linalg.norm(d, axis=0))
    eye = np.array([[0.1], [0.2], [3.0]])
    wide, shared = (A.put(A.W, np.repeat(eye, k, axis=1)) for k in (RAYS, 1))
    single = scene.closest(shared, d, plain=False)
    for o in (wide, shared):
        exact = unit(d, A.W)
        for plain in (False, True):
            for x, y in zip(single, scene.closest(o, exact, plain)):
                assert np.array_equal(np.array(x), np.array(y))


def test_a_tree_of_one_row() -> None:
    rows = random(np.random.default_rng(4), 1)
    scene = Scene(Rows(rows.middle, rows.half, 0))
    o, d = (A.put(A.W, x) for x in rays(scene.rows, np.random.default_rng(5), 1.0))
    for x, y in zip(scene.closest(o, d, False), scene.closest(o, d, True)):
        assert np.array_equal(np.array(x), np.array(y))
    assert (np.array(scene.closest(o, d, False)[1]) == 0).any()


def test_balls_found_in_single_are_those_found_in_double() -> None:
    rows = world("only spheres")
    o, d = (A.put(A.W, x) for x in rays(rows, np.random.default_rng(9), 1.0))
    for x, y in zip(Scene(rows).closest(o, d, False), Scene(rows, plain=True).closest(o, d, False)):
        assert np.array_equal(np.array(x), np.array(y))


def test_rays_that_are_not_concerned() -> None:
    """Lanes that are done and lanes that are not finite visit nothing; a limit ends the walk before what is beyond."""
    scene, rng = Scene(world("small")), np.random.default_rng(6)
    o, d = rays(scene.rows, rng, 1.0)
    active = rng.random(RAYS) < 0.5
    bad = [(np.nan, 0), (np.inf, 1), (-np.inf, 2)]
    for k, (value, axis) in enumerate(bad):
        o[axis, k::20], d[axis, k + 5 :: 20] = value, value
    finite = np.isfinite(o).all(axis=0) & np.isfinite(d).all(axis=0)
    asked = active & finite
    o, d = A.put(A.W, o), A.put(A.W, d)

    def count(active: Any, within: float) -> tuple:
        def visit(_: int, state: tuple, row: Any, present: Any) -> tuple:
            return state

        start, rays = (dr.full(A.D, within, RAYS),), TreeRays.along(A, scene.tree, o, d)
        result = walk(rays, start, Search(visit, lambda s: s[0], lambda _: ~active), counted=True)
        return tuple(np.array(x) for x in result[1:])

    nodes, rows, tests = count(A.put(A.B, active), dr.inf)
    assert np.array_equal(nodes > 0, asked) and not rows[~asked].any() and tests.any() and (tests <= rows).all()
    for x, y in zip(count(A.B(True), 0.01), count(A.B(True), dr.inf)):
        assert (x <= y).all() and x.sum() < 0.5 * y.sum()
    index = np.array(scene.closest(o, d, False, A.put(A.B, active))[1])
    assert (index[~asked] == NO_ROW).all() and (index[asked] != NO_ROW).any()


def test_every_row_is_met_once() -> None:
    """Searches that no hit decides, such as transmittance, count on it."""
    for name in ("dense", "alike", "points", "only spheres"):
        scene = Scene(world(name))
        o, d = (A.put(A.W, x) for x in rays(scene.rows, np.random.default_rng(7), 1.0))
        through, plain = scene.count(o, d)
        assert all(np.array_equal(np.array(x), np.array(y)) for x, y in zip(through, plain))
        assert np.array(plain[0]).max() > 1


def test_stacks_that_spill(monkeypatch: pytest.MonkeyPatch) -> None:
    """A deep tree and few registers: entries go to memory and come back."""
    scene = Scene(world("halved"))
    o, d = (A.put(A.W, x) for x in rays(scene.rows, np.random.default_rng(8), 3.0))
    many = scene.closest(o, d, plain=False)
    dr.eval(many)
    monkeypatch.setattr(walk_stack, "REGISTERS", 1)
    for x, y in zip(many, scene.closest(o, d, plain=False)):
        assert np.array_equal(np.array(x), np.array(y))


class Blocks:
    """The blocks of a tree in NumPy. Corners of boxes are relative to the tree's centre.

    kind, first, count: kinds of all blocks; for nodes, the block of the first child and the number of children
    number: numbers of rows
    low, high: corners of the children's boxes. Shape: (blocks, WIDTH, 3)
    """

    def __init__(self, scene: Scene):
        numbers = np.array(scene.tree.blocks).reshape(-1, BLOCK)
        words = numbers.view(np.uint32)
        self.kind, self.first, self.count, self.number = (words[:, k] for k in (KIND, FIRST_CHILD, CHILDREN, NUMBER))
        corner, step = (numbers[:, k : k + 3].astype(np.longdouble) for k in (CORNER, STEP))
        bytes_of = lambda k: words[:, k : k + 3].copy().view(np.uint8).reshape(-1, 3, WIDTH).swapaxes(1, 2)  # noqa: E731
        with np.errstate(all="ignore"):
            self.low, self.high = (corner[:, None] + bytes_of(k) * step[:, None] for k in (LOW, HIGH))


@pytest.mark.parametrize("name", WORLDS)
def test_every_row_is_below_one_node_and_every_box_holds_what_is_below(name: str) -> None:
    scene = Scene(world(name))
    blocks = Blocks(scene)
    nodes = np.flatnonzero(blocks.kind == NODE)
    children = np.concatenate([np.arange(blocks.first[k], blocks.first[k] + blocks.count[k]) for k in nodes])
    assert np.array_equal(np.sort(children), np.arange(1, len(blocks.kind)))
    rows = np.flatnonzero(blocks.kind != NODE)
    assert np.array_equal(np.sort(blocks.number[rows]), np.arange(scene.n))
    assert (blocks.kind[rows] == ROW).sum() == scene.n - scene.rows.spheres
    centre = np.array(scene.tree.centre)[:, 0]
    exact = [c.astype(np.longdouble) - centre.astype(np.longdouble) for c in scene.rows.corners()]
    single = [outwards(c, centre, out).astype(np.longdouble) for c, out in zip(scene.rows.corners(), (-1, 1))]
    for out, x, y in zip((-1, 1), exact, single):
        assert (out * (y - x) >= 0).all()
        assert (np.abs(y - x) <= 2 * np.spacing(np.maximum(np.abs(y), 1e-38).astype(np.float32))).all()
    low, high = (np.full((len(blocks.kind), 3), x, np.longdouble) for x in (np.inf, -np.inf))
    low[rows], high[rows] = (x[blocks.number[rows]] for x in single)
    for node in nodes[::-1]:  # children come after their node
        below = slice(blocks.first[node], blocks.first[node] + blocks.count[node])
        low[node], high[node] = low[below].min(axis=0), high[below].max(axis=0)
        # Steps are chosen in double, and a child's box grows by less than two of them.
        slack = 2.0**-50 * np.maximum(np.abs(low[node]), np.abs(high[node]))
        step = (high[node] - low[node]) / 255 * (1 + 2.0**-20) + 1e-44
        for box, true, out in ((blocks.low, low, -1), (blocks.high, high, 1)):
            grown = out * (box[node, : blocks.count[node]] - true[below])
            assert (grown >= -slack).all() and (grown <= 2 * step + slack).all()


@pytest.mark.parametrize("name", WORLDS)
def test_the_stack_holds_what_a_way_down_leaves(name: str) -> None:
    blocks = Blocks(Scene(world(name)))
    depth = np.zeros(len(blocks.kind), int)
    for node in np.flatnonzero(blocks.kind == NODE):
        depth[blocks.first[node] : blocks.first[node] + blocks.count[node]] = depth[node] + 1
    assert depth.max() <= MOST_LEVELS


@pytest.mark.parametrize("limit", [6, 7, 10])
def test_no_tree_is_deeper_than_it_may_be(limit: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Boxes that ask for a deep tree are cut in equal halves where they must be."""
    monkeypatch.setattr(sah, "DEPTH", limit)
    low, high = (x.T.astype(np.float32) for x in world("halved").corners())
    low, high = low[:, : 1 << limit], high[:, : 1 << limit]
    n = low.shape[1]
    two = binary_trees(Level(low, high, np.arange(n), np.array([0]), np.array([n]), np.ones(n)))
    depth = np.zeros(len(two.child), int)
    for node in range(len(two.child)):
        depth[two.child[node][two.child[node] >= 0]] = depth[node] + 1
    assert depth.max() < limit


def halves(low: np.ndarray, high: np.ndarray, rows: np.ndarray) -> float:
    """The area of all nodes below the first, where each is cut in equal halves across its longest side."""
    if len(rows) < 2:
        return 0.0
    middle = low[rows] + high[rows]
    order = rows[np.argsort(middle[:, np.argmax(np.ptp(middle, axis=0))], kind="stable")]
    sides = order[: len(order) // 2], order[len(order) // 2 :]
    return sum(area(low[s].min(axis=0), high[s].max(axis=0)) + halves(low, high, s) for s in sides if len(s) > 1)


def area(low: np.ndarray, high: np.ndarray) -> float:
    x, y, z = np.moveaxis((high - low).astype(float), -1, 0)
    return (x * y + y * z + z * x).sum()


@pytest.mark.parametrize("name", ["sparse", "dense", "small", "flat", "scales", "halved"])
def test_splits_cost_no_more_than_equal_halves(name: str) -> None:
    low, high = (x.astype(np.float32) for x in world(name).corners())
    two = binary(low.T.copy(), high.T.copy())
    inner = two.child >= 0
    assert area(two.low[inner], two.high[inner]) <= halves(low, high, np.arange(len(low)))
    four = widened(two)
    inner = four.child >= 0
    assert area(four.low[inner], four.high[inner]) <= area(two.low[two.child >= 0], two.high[two.child >= 0])
    assert (four.child != NONE).sum(axis=1).min() >= 2


@pytest.mark.parametrize("name", WORLDS)
def test_boxes_in_clusters(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Large sets of boxes are cut into clusters first: each box is in one, and the tree is as good to within a half."""
    low, high = (x.T.astype(np.float32).copy() for x in world(name).corners())
    n = low.shape[1]
    order, head, count = clusters(low, high, 8)
    assert np.array_equal(np.sort(order), np.arange(n))
    assert np.array_equal(head, np.cumsum(count) - count) and count.sum() == n and count.min() > 0
    whole = binary(low, high)
    monkeypatch.setattr(hierarchy, "FEW", 1)
    monkeypatch.setattr(hierarchy, "PART", 16)
    parts = binary(low, high)
    for tree in (whole, parts):
        boxes, nodes = tree.child[tree.child < 0], tree.child[tree.child >= 0]
        assert np.array_equal(np.sort(-1 - boxes), np.arange(n)) and np.array_equal(np.sort(nodes), np.arange(1, n - 1))
        assert (tree.child > np.arange(len(tree.child))[:, None])[tree.child >= 0].all()
    size = lambda tree: area(tree.low[tree.child >= 0], tree.high[tree.child >= 0])  # noqa: E731
    assert size(parts) <= 1.5 * size(whole)


def test_trees_of_clusters_find_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = world("small")
    o, d = (A.put(A.W, x) for x in rays(rows, np.random.default_rng(10), 1.0))
    before = Scene(rows).closest(o, d, False)
    dr.eval(before)
    monkeypatch.setattr(hierarchy, "FEW", 1)
    for x, y in zip(before, Scene(rows).closest(o, d, False)):
        assert np.array_equal(np.array(x), np.array(y))
