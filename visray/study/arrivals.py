"""What visray says of light on its way to what was hit: by its own kernels, and by searches on ways that are given."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray import integrator, tables, trees
from visray.lighting import beam, spread
from visray.lights.light import AreaLight, Light
from visray.ray import NO_OBJECT, Ray
from visray.sampling import Lot
from visray.scenery import Lamp, Site, site
from visray.search import End, Watch, blocked, transmitted
from visray.study.answers import Look, Ours, rows
from visray.study.ways import Ways


@dataclass(frozen=True)
class Arrival:
    """What of a light arrives at the points hit: whether any does, its cosine with the normal (nothing arrives where it
    is not positive), and the share that transparent objects leave, None where they count as opaque. Shapes: (N), (N),
    (N, 3)."""

    reached: np.ndarray
    cosine: np.ndarray
    share: np.ndarray | None = None


def beams(ours: Ours, look: Look) -> Iterator[Arrival]:
    """The arrivals of all lights that are no area lights, in the order of the scene."""
    here = _site(ours, look)
    for lamp in _lamps(ours):
        b = beam(ours.scenery, here, lamp)
        share = None if b.share is None else np.broadcast_to(rows(b.share), (len(look.answers.t), 3))
        yield Arrival(np.array(b.reached), np.array(b.cosine, float), share)


def beam_of_point(ours: Ours, look: Look, light: AreaLight, point: np.ndarray) -> Arrival:
    """The arrival of one point of an area light, from the centre, by the kernel that takes many at random."""
    a, row = ours.a, table(ours, light)
    away = a.W(*(ours.centre + point).tolist()) - row.position
    lamp = Lamp(type(light), Pinned(row, away), Lot.of(a, 1), 1, 0, None)

    def answer(_: Any, __: Site, ___: Any, b: Any) -> Any:
        return a.V(dr.select(b.reached, a.F(1), 0), b.cosine, 0)

    reached, cosine, _ = rows(spread(ours.scenery, _site(ours, look), lamp, answer)).T
    return Arrival(reached > 0, cosine)


class Pinned:
    """An area light of which one point is taken, at `away` from its middle."""

    def __init__(self, light: Any, away: Any):
        self.light, self.away = light, dr.make_opaque(away) or away

    def __getattr__(self, name: str) -> Any:
        return getattr(self.light, name)

    def offset(self, w: Any, u: Any, v: Any) -> Any:
        return w(self.away)


def _site(ours: Ours, look: Look) -> Site:
    return site(ours.scenery, look.ray, look.hit, integrator.first_draw(ours.stage, len(look.answers.t)))


def _lamps(ours: Ours) -> list[Lamp]:
    """All lights of the scene in its order, those of crowds one by one."""
    scene, s = ours.made.scene, ours.scenery
    place = {name: i for i, name in enumerate(scene.lights)}
    found = {lamp.number: lamp for lamp in s.lamps}
    for crowd in s.crowds:
        names = next(t.names for t in tables.troops(scene) if t.kind is crowd.kind)
        for i, name in enumerate(names):
            light = trees.rows(crowd.table, dr.opaque(ours.a.U, i))
            found[place[name]] = Lamp(crowd.kind, light, None, 0, place[name], None)
    return [found[i] for i in sorted(found)]


def table(ours: Ours, light: Light) -> Any:
    """A light as the methods of its kind take it."""
    return tables.stacked(ours.a, type(light), [light])


def sends(ours: Ours, light: Light, ways: Ways) -> np.ndarray:
    """Whether a light sends anything to where the ways begin. Shapes: (N)."""
    aim = table(ours, light).aim(ours.triples(-ways.l))
    return np.ones(len(ways.p), bool) if aim is None else np.array(aim) > 0


def flush(ours: Ours, p: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which objects have a surface, or the plane that it is a part of, within their `reach` of a point; its normals.

    Shapes: (3) from the centre, (objects) -> (K), (K, 3).
    """
    place = ours.a.W(*(ours.centre + p).tolist())
    levels = [k.kind.level(g.placed, place) for k, g in zip(ours.scenery.kin, ours.scenery.groups)]
    f = np.concatenate([np.array(f, float) for f, _ in levels])
    n = np.concatenate([rows(g) for _, g in levels])
    size = np.linalg.norm(n, axis=1)
    on = np.flatnonzero(np.abs(f) <= reach * size)
    return on, n[on] / size[on, None]


def clear(ours: Ours, look: Look, ways: Ways, active: np.ndarray, arrives: bool = True) -> np.ndarray:
    """Whether nothing lies on the ways; a scene without shadows is clear. Shapes: (N).

    `arrives`: the ways begin at points that stand for those hit, and are on the same surfaces.
    """
    if not ours.made.scene.settings.shadows:
        return np.ones(len(ways.p), bool)
    watch, ray, end = _search(ours, look, ways, arrives)
    return ~np.array(blocked(watch, ray, end, ours.a.B(active)))


def shares(ours: Ours, look: Look, ways: Ways, active: np.ndarray) -> np.ndarray:
    """What transparent objects leave of light on the ways from points that stand for those hit. Shapes: (N, 3)."""
    watch, ray, end = _search(ours, look, ways, True)
    tints = tuple((g.material.kt, g.material.dmax) for g in ours.scenery.groups)
    return rows(transmitted(watch, ray, end, ours.a.B(active), tints, False))


def _search(ours: Ours, look: Look, ways: Ways, arrives: bool) -> tuple[Watch, Ray, End]:
    """What kernels search on: from the light to the points, or to a light that is infinitely far away."""
    a, n = ours.a, len(ways.p)
    within = a.B(look.within())
    if ways.far:
        nothing = dr.zeros(a.D, n)
        ray = Ray(ours.triples(ours.centre + ways.p), ours.triples(ways.l), error=nothing)
        end = End(a.D(ways.length))
        if arrives:
            # What lies flush with the surface is not met: the point is off by its error.
            cosine = a.D(np.abs((look.answers.n * ways.l).sum(1)))
            start = look.surface.error / dr.select(cosine > 0, cosine, 1)
            ray = Ray(ray.o, ray.d, source=look.hit.index, inside=within, start=start, error=nothing)
    else:
        ray = Ray(ours.triples(ours.centre + ways.end), ours.triples(-ways.l), error=look.surface.error)
        index = look.hit.index if arrives else dr.opaque(a.U, NO_OBJECT, n)
        end = End(a.D(ways.length), index, within & arrives)
    return Watch(a, ours.scenery.kin, ours.scenery.groups, ray.o, shared=False), ray, end
