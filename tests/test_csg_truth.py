"""CSG against the truth (csg_truth.py): random trees of all kinds of operands, at all depths, with transforms at each.

A disagreement is a ray that the truth is sure of and the kernel answers otherwise. None is allowed. Rays that rounding
leaves open are counted, and must be few.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import numpy as np
import pytest
from csg_edges import near_edges
from csg_sets import IN, OUT, UNKNOWN
from csg_traced import Found, Traced
from csg_trees import OPERANDS, hulls, rays, tree
from csg_truth import Solid
from samples import norm, unit

import visray as vr
from visray.geometry import gamma
from visray.scene.address import changed
from visray.setup import prepare

# Some random trees have empty parts, or planes alone.
pytestmark = pytest.mark.filterwarnings("ignore::visray.csg_report.CsgWarning")

# Share of the rays that rounding may leave open. A bound of the slack is 1e-12 of the size of a tree, so that a ray is
# open by chance once in a billion; but rays come from up to 1,000 sizes away, and some graze.
MOST_OPEN = 1e-3
# The same for rays that are aimed at points as near as 10^-12 to cut edges: two of nine decades.
MOST_OPEN_AT_EDGES = 0.25
# Normals that change by more than this within the slack are not judged: at singular points of polynomials.
STEEP = 1e-3


@dataclass
class Tally:
    """Numbers of rays. open: left open by rounding. hits: hits that are sure. Others are disagreements."""

    rays: int = 0
    open: int = 0
    hits: int = 0
    hit_or_miss: int = 0
    distance: int = 0
    side: int = 0
    operand: int = 0
    normal: int = 0
    occluded: int = 0
    length: int = 0

    @property
    def wrong(self) -> dict[str, int]:
        """The disagreements that are not 0."""
        names = [f.name for f in fields(self)][3:]
        return {name: getattr(self, name) for name in names if getattr(self, name)}

    def judge(self, traced: Traced, o: np.ndarray, d: np.ndarray) -> tuple[Found, np.ndarray, np.ndarray]:
        """Adds the first hits of rays. Returns the right hits on one leaf, its number, and the outward unit normals."""
        found, truth = traced.first(o, d), traced.solid.on(o, d)
        b = truth.first
        met = b.sure & b.hit & found.hit
        # Of t, rounding to a double comes on top.
        low, high, t = (np.where(met, x, 0) for x in (b.low, b.high, found.t))
        near = met & (t >= low - 2.0**-52 * high) & (t <= high + 2.0**-52 * high)
        one = near & (truth.leaf >= 0)
        ends = [truth.normal_at(t) for t in (b.low, b.high)]
        change = norm(ends[1] - ends[0])
        bent = norm(ends[0] - found.n) > 2 * change + 1e-9
        self.rays += len(o)
        self.open += int((~b.sure).sum())
        self.hits += int(met.sum())
        self.hit_or_miss += int((b.sure & (b.hit != found.hit)).sum())
        self.distance += int((met & ~near).sum())
        self.side += int((near & (found.inside == b.enters)).sum())
        self.operand += int((one & (traced.material_of[truth.leaf] != found.leaf)).sum())
        self.normal += int((one & (change < STEEP) & bent).sum())
        return found.at(one), truth.leaf[one], ends[0][one]

    def judge_leaving(self, rng: np.random.Generator, traced: Traced, start: Found, leaf: np.ndarray, n: np.ndarray):
        """Adds rays that leave hits on both sides, half of them at less than 3 degrees, and shadow rays along them."""
        count = len(leaf)
        cosine = rng.random(count) * np.where(rng.random(count) < 0.5, 0.05, 1) * rng.choice([-1, 1], count)
        across = unit(np.cross(n, rng.normal(size=n.shape)))
        d = unit(cosine[:, None] * n + np.sqrt(1 - cosine**2)[:, None] * across).astype(float)
        truth, sure = traced.solid.leaving(start.p, d, leaf, n)
        b, found = truth.first, traced.first_from(start, d)
        sure &= b.sure
        both = sure & b.hit & found.hit
        # The start is off by its error, and the end by as much over its own slope, which the unknown piece says.
        low, high, t = (np.where(both, x, 0) for x in (b.low, b.high, found.t))
        slack = 2 * start.error + (high - low) + 2.0**-52 * high
        self.rays += count
        self.open += int((~sure).sum())
        self.hits += int(both.sum())
        self.hit_or_miss += int((sure & (b.hit != found.hit)).sum())
        self.distance += int((both & ((t < low - slack) | (t > high + slack))).sum())
        light = start.p + 10 ** rng.uniform(-2, 1.5, (count, 1)) * d
        length = norm(light - start.p)
        clear = sure & (~b.hit | (b.high < length * (1 - 1e-12)) | (b.low > length * (1 + 1e-12)))
        # Only lights on the side that is seen shine on a point. A surface less than the errors of the point and of the
        # light's ray above the point does not count, because to within rounding it is the surface itself
        # (direct.light_sample).
        height = start.error + gamma(9) * (np.abs(light).sum(1) + length)
        clear &= ((cosine > 0) != start.inside) & (~b.hit | (b.low * np.abs(cosine) > 2 * height))
        for occluded in (traced.occluded_to(start, light), traced.occluded_from(light, start)):
            self.occluded += int((clear & (occluded != (b.hit & (b.high < length)))).sum())
        # How long the rays are inside, up to lights that are outside.
        free = sure & (traced.solid.at(light) == OUT)
        inside, unknown = (truth.whole.length(state, length) for state in (IN, UNKNOWN))
        slack = unknown + 2 * start.error / np.abs(cosine) + 2.0**-50 * length
        self.length += int((free & ~(np.abs(traced.lengths_from(start, d, length) - inside) <= slack)).sum())


def traced_trees(seed: int, count: int, depth: int, **how: str) -> Iterator[tuple[np.random.Generator, Traced]]:
    """Random trees that hold each kind of operand about equally often."""
    rng, names = np.random.default_rng(seed), []
    for _ in range(count):
        names = names or list(rng.permutation(list(OPERANDS)))
        yield rng, Traced(tree(rng, depth, names), **how)


def test_the_truth_is_that_of_points() -> None:
    """20 trees, 16,000 points: whether they are inside, from the crossings along a ray, and from the point alone."""
    rng, names, unknown = np.random.default_rng(1), [], 0
    for _ in range(20):
        names = names or list(rng.permutation(list(OPERANDS)))
        solid = Solid(tree(rng, 3, names))
        o, d = rays(rng, solid, 100)
        crossed = solid.on(o, d)
        for t in 10 ** rng.uniform(-1, 1, (8, len(o))):
            along, alone = crossed.whole.at(t[None])[0], solid.at(o + t[:, None] * d)
            known = (along != UNKNOWN) & (alone != UNKNOWN)
            assert np.array_equal(along[known], alone[known])
            unknown += (~known).sum()
    assert unknown < 10


@pytest.mark.parametrize("seed, trees, per", [
    pytest.param(2, 6, 500, id="quick"),
    pytest.param(3, 200, 5000, id="a million", marks=pytest.mark.nightly),
])  # fmt: skip
def test_first_hits_are_those_of_the_truth(seed: int, trees: int, per: int) -> None:
    """Hit or miss, distance, side, operand and normal."""
    tally = Tally()
    for rng, traced in traced_trees(seed, trees, 3):
        tally.judge(traced, *rays(rng, traced.solid, per))
    assert tally.wrong == {} and tally.open <= MOST_OPEN * tally.rays and tally.hits > tally.rays / 5


@pytest.mark.slow
@pytest.mark.parametrize("how", [{"precision": "single"}, {"brute_force": True}], ids=["single", "brute force"])
def test_first_hits_in_single_and_without_guards_are_the_same(how: dict) -> None:
    for rng, traced in traced_trees(4, 10, 3):
        o, d = rays(rng, traced.solid, 2000)
        one, other = traced.first(o, d), Traced(traced.obj, **how).first(o, d)
        for name in ("hit", "t", "leaf", "part"):
            assert np.array_equal(getattr(one, name), getattr(other, name)), name


@pytest.mark.parametrize("seed, trees, per, times", [
    pytest.param(5, 5, 100, 3, id="quick"),
    pytest.param(6, 200, 400, 100, id="a million", marks=pytest.mark.nightly),
])  # fmt: skip
def test_nothing_is_met_again_and_nothing_leaks_at_cut_edges(seed: int, trees: int, per: int, times: int) -> None:
    """Rays from points as near as 10^-12 to edges, on both sides, and shadow rays in both directions."""
    first, leaving = Tally(), Tally()
    for rng, traced in traced_trees(seed, trees, 1):
        p, n, _ = near_edges(rng, traced.solid, per)
        if not len(p):
            continue
        away = unit(n + 0.9 * unit(rng.normal(size=n.shape)))
        o = (p + 10 ** rng.uniform(-1, 2, (len(p), 1)) * away).astype(float)
        start, leaf, n = first.judge(traced, o, unit(p - o).astype(float))
        again = np.tile(np.arange(len(leaf)), times)
        leaving.judge_leaving(rng, traced, start.at(again), leaf[again], n[again])
    assert first.wrong == {} and first.open <= MOST_OPEN_AT_EDGES * first.rays and first.hits > trees * per / 10
    assert leaving.wrong == {} and leaving.open <= MOST_OPEN_AT_EDGES * leaving.rays and leaving.hits > 0


@pytest.mark.parametrize("seed, trees, per", [
    pytest.param(7, 4, 500, id="quick"),
    pytest.param(8, 100, 3000, id="all", marks=pytest.mark.nightly),
])  # fmt: skip
def test_shadows_lengths_and_points_inside_are_those_of_the_truth(seed: int, trees: int, per: int) -> None:
    """Segments that start and end in free space: whether they cross the surface, and how long they are inside."""
    judged = 0
    for rng, traced in traced_trees(seed, trees, 2):
        o, d = rays(rng, traced.solid, per)
        length = norm(rng.uniform(0.2, 1.8, (per, 1)) * o)
        crossed, end = traced.solid.on(o, d), traced.solid.at(o + length[:, None] * d)
        ends = np.stack([crossed.whole.state[0], end])
        clear = (ends != UNKNOWN).all(0) & ~crossed.whole.unknown_between(length, length)
        b = crossed.first
        sure = clear & b.sure & ((b.high < length) | (b.low > length))
        assert np.array_equal(traced.between(o, d, length)[sure], (b.hit & (b.high < length))[sure])
        states = [crossed.whole.length(state, length) for state in (IN, UNKNOWN)]
        free = clear & (ends == OUT).all(0)
        found = traced.lengths_inside(o, d, length)
        # Pieces that rounding leaves open, such as where the ray grazes, may be inside or not.
        slack = states[1] + 2.0**-50 * length
        assert (np.abs(found - states[0])[free] <= slack[free]).all()
        inside = traced.inside(o + length[:, None] * d)
        assert np.array_equal(inside[end != UNKNOWN], end[end != UNKNOWN] == IN)
        judged += int((free & (states[0] > 0)).sum())
    assert judged > trees * per / 20


@pytest.mark.parametrize("name", OPERANDS)
def test_a_hole_is_the_solid_turned_inside_out(name: str) -> None:
    """From inside: distances and texture coordinates are those of the solid alone, and normals are turned."""
    rng = np.random.default_rng(11)
    thing = OPERANDS[name](rng)
    solid = Solid(thing)
    middle, reach = (x[0] for x in hulls(solid))
    o = middle + reach * rng.uniform(-1, 1, (8000, 3))
    o = o[solid.at(o) == IN][:1000]
    d = unit(rng.normal(size=o.shape)).astype(float)
    body = vr.Box(min=(-99.0, -99.0, -99.0), max=(99.0, 99.0, 99.0))
    alone, hole = (Traced(x).first(o, d) for x in (thing, vr.Csg(op="difference", of=(body, thing))))
    seen = hole.hit & (hole.leaf == 1)
    assert seen.sum() > 200 and alone.hit[seen].all()
    one, other = alone.at(seen), hole.at(seen)
    assert (np.abs(one.t - other.t) <= 16 * one.error).all()
    assert (norm(one.n + other.n) < 1e-9).mean() > 0.99
    assert (np.abs(one.uv - other.uv).max(1) < 1e-9).mean() > 0.99


@pytest.mark.parametrize("name", OPERANDS)
@pytest.mark.parametrize("origins", [4, pytest.param(30, marks=pytest.mark.slow)])
def test_a_camera_on_a_surface_sees_what_is_before_it(name: str, origins: int) -> None:
    """All rays start at a point that is on some operand, but nothing tells on which one, and on which side they run."""
    rng = np.random.default_rng(10)
    thing = OPERANDS[name](rng)
    hull = hulls(Solid(thing))[0][0]
    dent = vr.Sphere(center=tuple((hull + 0.3 * unit(rng.normal(size=3)).astype(float)).tolist()), radius=0.4)
    traced = Traced(vr.Csg(op="difference", of=(thing, dent)))
    start, leaf, n = Tally().judge(traced, *rays(rng, traced.solid, 40 * origins))
    judged = 0
    for i in np.argsort(start.error)[:origins]:
        p, d = start.p[i], unit(rng.normal(size=(300, 3))).astype(float)
        truth, sure = traced.solid.leaving(np.tile(p, (300, 1)), d, np.full(300, leaf[i]), np.tile(n[i], (300, 1)))
        b = truth.first
        hit, t = traced.first_from_origin(p, d)
        sure &= b.sure
        assert np.array_equal(hit[sure], b.hit[sure])
        both = sure & b.hit
        slack = 2 * start.error[i] + 2.0**-52 * b.high[both]
        assert (t[both] >= b.low[both] - slack).all() and (t[both] <= b.high[both] + slack).all()
        judged += int(sure.sum())
    assert judged > 250 * origins


def test_a_ray_to_a_light_keeps_the_operand_that_it_leaves() -> None:
    """From a ball that lies in the mirror image of a cone, which the cone's equation takes for its inside."""
    cone = vr.Cone(base=(0.0, 3.0, 0.0), axis=(0.0, -1.0, 0.0), radius=2.0, height=2.0)
    traced = Traced(vr.Csg(op="union", of=(vr.Sphere(radius=0.5), cone)))
    rng = np.random.default_rng(9)
    o = np.array([[3.0, 0.6, 0.0]]) + rng.uniform(-0.1, 0.1, (500, 3))
    d = unit(0.45 * unit(rng.normal(size=o.shape)) - o).astype(float)
    start = traced.first(o, d)
    up = start.hit & (start.n[:, 1] > 0.2)
    start = start.at(up)
    light = np.array([0.0, 4.0, 0.0]) + rng.uniform(-0.5, 0.5, start.p.shape)
    assert up.sum() > 100 and traced.occluded_to(start, light).all() and traced.occluded_from(light, start).all()


@pytest.mark.slow
def test_pictures_do_not_depend_on_how_rays_find_objects() -> None:
    """Six trees on a floor, in light of a point, from afar and from an area: guards, lists and trees change no bit."""
    rng, names, objects = np.random.default_rng(1), [], {"floor": vr.Plane(point=(0.0, -1.2, 0.0))}
    for k in range(6):
        names = names or list(rng.permutation(list(OPERANDS)))
        obj = tree(rng, 2, names)
        place = vr.Translate(translate=(2.0 * (k % 3) - 2.0, 1.5 * (k // 3), -2.0 * (k // 3)))
        objects[f"tree{k}"] = replace(obj, transform=(*obj.transform, vr.Scale(scale=0.5), place))
    scene = vr.Scene(
        camera=vr.Camera(origin=(0.3, 2.0, 7.0), target=(0.0, 0.5, -1.0), fov=45.0),
        film=vr.Film(width=120, height=80),
        lights={
            "point": vr.PointLight(position=(3.0, 5.0, 4.0)),
            "sun": vr.DirectionalLight(direction=(1.0, -2.0, -1.0)),
            "ball": vr.SphereLight(position=(-4.0, 4.0, 3.0), radius=0.5, samples=2),
        },
        objects=objects,
    )
    changes = [changed(scene, {"settings.accelerator": x}) for x in ("auto", "none", "tree", "lists")]
    prepared = [*map(prepare, changes), prepare(scene, brute_force=True)]
    auto, *others = (vr.render(x, layers=("RGB",), progress=False)["RGB"] for x in prepared)
    assert auto.std() > 0.1 and all(np.array_equal(auto, other) for other in others)
