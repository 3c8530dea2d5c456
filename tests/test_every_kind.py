"""Every kind of primitive against exact arithmetic, and by rays at edges, from surfaces, far away, huge and tiny.

All tests run over visray.primitives.KINDS; what they know of a kind is its entry in SAMPLES of samples.py.
"""

import drjit as dr
import numpy as np
import pytest
from exact_surfaces import exact_first
from samples import (
    CONVEX,
    NAMES,
    SAMPLES,
    Lineup,
    aimed,
    array,
    crossed,
    gap,
    instances,
    rounding,
    truth,
    unit,
)

from visray.geometry import gamma

EACH = pytest.mark.parametrize("name", NAMES)
CLOSED = [name for name in NAMES if SAMPLES[name].posed.closed]


class Traced:
    """Objects with rays at them, and where the kernel says that these hit. Shapes: (objects, rays)."""

    def __init__(self, things: list, o: np.ndarray, d: np.ndarray):
        self.things, self.o, self.d, shape = things, o, d, o.shape[:2]
        line = Lineup(things, shape[1])
        ray = line.ray(o, d)
        crossing = line.crossing(ray)
        surface, _, _ = line.surface(ray, crossing.t, crossing.part)
        self.t, self.error = (np.array(x).reshape(shape) for x in (crossing.t, surface.error))
        self.hit = np.isfinite(self.t)
        self.p = np.where(self.hit[..., None], array(surface.p).reshape(o.shape), 0)

    def judge(self) -> int:
        """Compares hits, distances and error bounds with the twins. Returns how many rays rounding leaves open."""
        unsure = 0
        for thing, o, d, t, hit, p, error in zip(self.things, self.o, self.d, self.t, self.hit, self.p, self.error):
            exact = truth(thing, o, d)
            unsure += int((~exact.sure).sum())
            assert np.array_equal(hit[exact.sure], exact.what[exact.sure] > 0)
            met = exact.sure & hit
            slack = gamma(2) * exact.high[met]
            assert (t[met] >= exact.low[met] - slack).all() and (t[met] <= exact.high[met] + slack).all()
            assert (np.abs(gap(thing, p[hit])[0]) <= error[hit]).all()
        return unsure


def rays_at(things: list, seed: int, per: int, aim=aimed) -> tuple[np.ndarray, np.ndarray]:
    """Rays at each object. Shapes: (objects, per, 3)."""
    rng = np.random.default_rng(seed)
    pairs = [aim(rng, thing, per) for thing in things]
    return np.stack([o for o, _ in pairs]), np.stack([d for _, d in pairs])


@EACH
def test_the_first_crossing_is_that_of_exact_arithmetic(name: str) -> None:
    """600 rays. The equations of the surface are put along each ray in rational numbers, and all real roots isolated.

    A distance is off by what rounding moves the surface by, over the cosine at which the ray meets it; twice that, as
    the cosine changes on the way. Not judged so: rays so flat that this is no small part of the radius of curvature.
    """
    things = instances(name, 31, 30, False)
    o, d = rays_at(things, 32, 20)
    traced, flat = Traced(things, o, d), 0
    for i, thing in enumerate(things):
        pieces = SAMPLES[name].exact(thing)
        exact = [exact_first(pieces, *ray) for ray in zip(o[i], d[i])]
        assert all(hit.sure for hit in exact)
        assert np.array_equal(traced.hit[i], [hit.t is not None for hit in exact])
        met = np.flatnonzero(traced.hit[i])
        if not len(met):
            continue
        _, n, bend, _ = gap(thing, traced.p[i][met])
        cosine = np.abs((n * d[i][met]).sum(1))
        bound = rounding(thing, o[i][met], d[i][met], traced.t[i][met])
        judged = cosine**2 * bend > 100 * bound
        flat += (~judged).sum()
        for t, k, most in zip(traced.t[i][met], met, 2 * bound / cosine + gamma(2) * traced.t[i][met]):
            if judged[met == k][0]:
                assert abs(float(exact[k].t - t)) <= most
    assert flat <= 0.01 * traced.hit.sum() and traced.hit.sum() > 60


def at_edges(rng: np.random.Generator, thing, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays past an edge, a corner, an apex or a silhouette, off it by 10^U(-16, -1) of the angle to it.

    Of two rays from one origin one hits and one misses; what lies between is halved by the twin until it is the edge.
    A plane has its horizon for an edge.
    """
    pairs: list[np.ndarray] = []
    while sum(map(len, pairs)) < count:
        o, hitting = aimed(rng, thing, 6 * count)
        missing = unit(hitting + 10 ** rng.uniform(-2, 1, (len(o), 1)) * rng.normal(size=o.shape)).astype(float)
        good = (crossed(thing, o, hitting) > 0) & (crossed(thing, o, missing) == 0)
        pairs.append(np.stack([o, hitting, missing], 1)[good])
    o, hitting, missing = np.concatenate(pairs)[:count].transpose(1, 0, 2)
    hitting, missing = unit(hitting), unit(missing)
    aside = unit(missing - hitting)
    for _ in range(55):
        between = unit(hitting + missing)
        hits = (crossed(thing, o, between) > 0)[:, None]
        hitting, missing = np.where(hits, between, hitting), np.where(hits, missing, between)
    off = 10 ** rng.uniform(-16, -1, (count, 1)) * rng.choice([-1, 1], (count, 1))
    return o, unit(hitting + off * aside).astype(float)


@EACH
def test_rays_at_edges_agree_with_the_twin(name: str) -> None:
    """2,000 rays: every decision that rounding leaves no choice of is the twin's."""
    things = instances(name, 33, 10, False)
    traced = Traced(things, *rays_at(things, 34, 200, at_edges))
    # Off an edge by less than 1e-12 of the angle, of 15 decades, the answer is open; at most three decades more are, as
    # rays come from up to 1,000 sizes away, and the bound grows with the distance.
    assert traced.judge() <= 0.5 * traced.hit.size
    assert 0.2 < traced.hit.mean() < 0.8


def from_far(rng: np.random.Generator, thing, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays at the ball around an object, from 10^3 to 10^6 of its reaches away."""
    o, d = aimed(rng, thing, count, beyond=1.0)
    middle, reach = SAMPLES[type(thing).__name__].hull(thing)
    away = 10 ** rng.uniform(3, 6, (count, 1)) * reach
    target = middle + reach * 0.7 * rng.uniform(-1, 1, (count, 3))
    d = unit(rng.normal(size=(count, 3))).astype(float)
    o = target - away * d
    return o, unit(target - o).astype(float)


@pytest.mark.parametrize("aim", [aimed, from_far])
@EACH
def test_huge_and_tiny_objects_from_near_and_far_agree_with_the_twin(name: str, aim) -> None:
    """6,400 rays at objects of 1e-8 to 1e8: all decisions, distances and error bounds. From a million sizes away a ray
    is within rounding of an edge, 1e-8 of the size, with a chance of about 1e-8."""
    things = instances(name, 35, 100, False, decades=7)
    traced = Traced(things, *rays_at(things, 36, 64, aim))
    assert traced.judge() <= 1 and traced.hit.sum() > traced.hit.size / 10


@pytest.mark.parametrize("name", CLOSED)
def test_ray_that_leaves_a_point_neither_meets_it_again_nor_leaks(name: str) -> None:
    """Up to 10,000 rays from points as kernels know them, inwards and outwards, half of them at less than 3 degrees."""
    rng = np.random.default_rng(21)
    for thing in instances(name, 22, 10, False):
        o, d = aimed(rng, thing, 20_000, beyond=1.0)
        line = Lineup([thing], len(o))
        c = line.crossing(line.ray(o, d))
        s, _, _ = line.surface(line.ray(o, d), c.t, c.part)
        met = np.flatnonzero(np.isfinite(np.array(c.t)))[:1000]
        p, n, error = array(s.p)[met], unit(array(s.n)[met]), np.array(s.error)[met]
        count = len(met)
        assert count > 500
        side = rng.choice([-1.0, 1.0], count)
        cosine = rng.random(count) * np.where(rng.random(count) < 0.5, 0.05, 1.0)
        across = unit(np.cross(n, rng.normal(size=(count, 3))))
        d = unit((side * cosine)[:, None] * n + np.sqrt(1 - cosine**2)[:, None] * across).astype(float)
        line, inside = Lineup([thing], count), side < 0
        part = None if c.part is None else line.a.U(np.array(c.part)[met])
        ray = line.ray(p, d, inside=line.a.B(inside), part=part)
        leaving = dr.full(line.a.B, True, count)
        t = np.array(line.first(ray, leaving))
        # No leak: who goes in comes out.
        assert np.isfinite(t[inside]).all() and (t[inside] > 0).all()
        # It comes out where the twin says, which starts off the surface on the side where the ray is; and no sooner. No
        # wonder where the ray is so flat that it comes out within that.
        off = 64 * error
        _, _, bend, crease = gap(thing, p)
        clear = (cosine**2 * bend > 100 * off) & (crease > 100 * off)
        twin = truth(thing, p + (side * off)[:, None] * n, d)
        sure = clear & twin.sure
        assert sure.mean() > 0.9
        assert np.array_equal(np.isfinite(t)[sure], twin.what[sure] > 0)
        both = sure & np.isfinite(t)
        assert np.array_equal(inside[both], twin.what[both] == 2)
        if name in CONVEX:
            assert np.isinf(t[~inside]).all()
        # The start was moved: the end by as much over its own slope, twice as where that changes on the way.
        end = p[both] + t[both, None] * d[both]
        slope = np.abs(np.sum(gap(thing, end)[1] * d[both], axis=1))
        flat = slope**2 * gap(thing, end)[2] <= 100 * off[both]
        moved = 2 * off[both] * (1 + 1 / np.maximum(slope, gamma(1)))
        assert (flat | (np.abs(t[both] - twin.t[both]) <= moved)).all()
        # Shadow rays say the same.
        known = {"on_start": leaving, "inside": ray.inside, "start_part": part}
        occluded = np.array(line.occludes(line.piece(ray, line.a.D(1e30)).ray, line.a.D(1e30), **known))
        assert np.array_equal(occluded, np.isfinite(t))
