"""What visray says of light on its way to what was hit: by its own kernels, and by searches on ways that are given."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray import integrator, pytree
from visray.accel.intersect import Target, occluded, transmittance
from visray.accel.origin import RayOrigin
from visray.direct import area_light, light_sample
from visray.interaction import Interaction, interact
from visray.kernel_scene import PreparedLight
from visray.lights.light import AreaLight, Light
from visray.quantities import stacked
from visray.ray import NO_ROW, Ray
from visray.sampling import SampleSet
from visray.study.mitsuba.shadow_rays import ShadowRays
from visray.study.mitsuba.visray_scene import Look, VisrayScene, rows


@dataclass(frozen=True)
class Arrival:
    """What of a light arrives at the points hit: whether any does, its cosine with the normal (nothing arrives where it
    is not positive), and the share that transparent objects leave, None where they count as opaque. Shapes: (N), (N),
    (N, 3)."""

    reached: np.ndarray
    cosine: np.ndarray
    share: np.ndarray | None = None


def beams(ours: VisrayScene, look: Look) -> Iterator[Arrival]:
    """The arrivals of all lights that are no area lights, in the order of the scene."""
    here = _interaction(ours, look)
    for light in _lights(ours):
        sample = light_sample(ours.kernel, here, light)
        share = (
            None
            if sample.transmittance is None
            else np.broadcast_to(rows(sample.transmittance), (len(look.answers.t), 3))
        )
        yield Arrival(np.array(sample.arrives), np.array(sample.cosine, float), share)


def beam_of_point(ours: VisrayScene, look: Look, light: AreaLight, point: np.ndarray) -> Arrival:
    """The arrival of one point of an area light, from the centre, by the kernel that takes many at random."""
    a, row = ours.a, table(ours, light)
    away = a.W(*(ours.centre + point).tolist()) - row.position
    pinned = PreparedLight(type(light), Pinned(row, away), SampleSet.of(a, 1), 1, 0, None)

    def reflected(_: Any, __: Interaction, ___: Any, sample: Any) -> Any:
        return a.V(dr.select(sample.arrives, a.F(1), 0), sample.cosine, 0)

    reached, cosine, _ = rows(area_light(ours.kernel, _interaction(ours, look), pinned, reflected)).T
    return Arrival(reached > 0, cosine)


class Pinned:
    """An area light of which one point is taken, at `away` from its middle."""

    def __init__(self, light: Any, away: Any):
        self.light, self.away = light, dr.make_opaque(away) or away

    def __getattr__(self, name: str) -> Any:
        return getattr(self.light, name)

    def point_offset(self, w: Any, u: Any, v: Any) -> Any:
        return w(self.away)


def _interaction(ours: VisrayScene, look: Look) -> Interaction:
    return interact(ours.kernel, look.ray, look.hit, integrator.single_sample_state(ours.kernel, len(look.answers.t)))


def _lights(ours: VisrayScene) -> list[PreparedLight]:
    """All lights of the scene in its order, those that are looped over one by one."""
    lights = {light.number: light for light in ours.kernel.lights}
    for batch in ours.kernel.looped_lights:
        columns = next(c for c in ours.prepared.packed.lights if c.kind is batch.kind)
        for i, place in enumerate(columns.scene_index):
            row = pytree.rows(batch.table, dr.opaque(ours.a.U, i))
            lights[place] = PreparedLight(batch.kind, row, None, 0, place, None)
    return [lights[i] for i in sorted(lights)]


def table(ours: VisrayScene, light: Light) -> Any:
    """A light as the methods of its kind take it."""
    return stacked(ours.a, type(light), [light])


def sends(ours: VisrayScene, light: Light, ways: ShadowRays) -> np.ndarray:
    """Whether a light sends anything to where the ways begin. Shapes: (N)."""
    aim = table(ours, light).falloff(ours.triples(-ways.l))
    return np.ones(len(ways.p), bool) if aim is None else np.array(aim) > 0


def flush(ours: VisrayScene, p: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which objects have a surface, or the plane that it is a part of, within their `reach` of a point; its normals.

    Shapes: (3) from the centre, (objects) -> (K), (K, 3).
    """
    place = ours.a.W(*(ours.centre + p).tolist())
    levels = [batch.kind.surface_at(batch.placed, place) for batch in ours.kernel.batches]
    f = np.concatenate([np.array(f, float) for f, _ in levels])
    n = np.concatenate([rows(g) for _, g in levels])
    size = np.linalg.norm(n, axis=1)
    on = np.flatnonzero(np.abs(f) <= reach * size)
    return on, n[on] / size[on, None]


def clear(ours: VisrayScene, look: Look, ways: ShadowRays, active: np.ndarray, arrives: bool = True) -> np.ndarray:
    """Whether nothing lies on the ways; a scene without shadows is clear. Shapes: (N).

    `arrives`: the ways begin at points that stand for those hit, and are on the same surfaces.
    """
    if not ours.prepared.scene.settings.shadows:
        return np.ones(len(ways.p), bool)
    return ~np.array(occluded(*_search(ours, look, ways, arrives), ours.a.B(active)))


def shares(ours: VisrayScene, look: Look, ways: ShadowRays, active: np.ndarray) -> np.ndarray:
    """What transparent objects leave of light on the ways from points that stand for those hit. Shapes: (N, 3)."""
    tints = tuple((batch.material.kt, batch.material.dmax) for batch in ours.kernel.batches)
    return rows(transmittance(*_search(ours, look, ways, True), ours.a.B(active), tints, False))


def _search(ours: VisrayScene, look: Look, ways: ShadowRays, arrives: bool) -> tuple[RayOrigin, Ray, Target]:
    """What kernels search on: from the light to the points, or to a light that is infinitely far away."""
    a, n = ours.a, len(ways.p)
    within = a.B(look.within())
    if ways.far:
        ray = Ray(ours.triples(ours.centre + ways.p), ours.triples(ways.l))
        target = Target(a.D(ways.length), dr.zeros(a.D, n))
        if arrives:
            # What lies flush with the surface is not met: the point is off by its error.
            cosine = a.D(np.abs((look.answers.n * ways.l).sum(1)))
            clearance = look.surface.error / dr.select(cosine > 0, cosine, 1)
            ray = Ray(ray.o, ray.d, row=look.hit.row, inside=within, clearance=clearance, part=look.hit.part)
    else:
        ray = Ray(ours.triples(ours.centre + ways.end), ours.triples(-ways.l))
        row = look.hit.row if arrives else dr.opaque(a.U, NO_ROW, n)
        # Where the end is on no row, its part is not read.
        target = Target(a.D(ways.length), look.surface.error, row, within & arrives, look.hit.part)
    return RayOrigin(ours.kernel.geometry, ray.o, shared=False), ray, target
