"""The visray side of light: the light that arrives at hit points, and whether given shadow rays are occluded.

Arriving light is computed by the code that renders pictures. Occlusion is computed by the same search functions, but on
shadow rays that the caller chooses.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray import integrator, pytree
from visray.accel.intersect import Target, occluded, transmittance
from visray.accel.origin import RayOrigin
from visray.accel.tint import Tint
from visray.batches import Batch
from visray.direct import LightSample, area_light, light_sample
from visray.interaction import Interaction, interact
from visray.lights.light import AreaLight, Light
from visray.prepared_lights import PreparedLight
from visray.quantities import stacked
from visray.ray import NO_ROW, Ray
from visray.sampling import SampleSet
from visray.study.mitsuba.shadow_rays import ShadowRays
from visray.study.mitsuba.visray_scene import TracedRays, VisrayScene, to_numpy


@dataclass(frozen=True)
class LightArrival:
    """The light that arrives at hit points from one light source.

    reached: whether any light arrives, (N)
    cosine: cosine of the angle between normal and direction to the light; on a mesh, the smaller one of the triangle's
        normal and of the normal for shading. If it is not positive, no light arrives. (N)
    transmittance: fraction of the light that transparent objects let through, (N, 3); None if the scene has no coloured
        shadows
    """

    reached: np.ndarray
    cosine: np.ndarray
    transmittance: np.ndarray | None = None


def arriving_light(ours: VisrayScene, traced: TracedRays) -> Iterator[LightArrival]:
    """A LightArrival for each light, in the order of the scene. Domain: scenes without area lights."""
    interaction = _interaction(ours, traced)
    n = len(traced.first_hits.t)
    for light in _lights(ours):
        sample = light_sample(ours.kernel, interaction, light)
        share = None if sample.transmittance is None else np.broadcast_to(to_numpy(sample.transmittance), (n, 3))
        yield LightArrival(np.array(sample.arrives), np.array(_cosine(interaction, sample), float), share)


def arriving_light_of_point(ours: VisrayScene, traced: TracedRays, light: AreaLight, point: np.ndarray) -> LightArrival:
    """The light that arrives from one point of an area light, computed by the code that samples area lights.

    point: position relative to the camera, (3)
    """
    a, row = ours.a, light_table(ours, light)
    away = a.W(*(ours.centre + point).tolist()) - row.position
    pinned = PreparedLight(type(light), PinnedAreaLight(row, away), SampleSet.of(a, 1), 1, 0, None)

    def reflected(_: Any, interaction: Interaction, __: Any, sample: Any) -> Any:
        return a.V(dr.select(sample.arrives, a.F(1), 0), _cosine(interaction, sample), 0)

    reached, cosine, _ = to_numpy(area_light(ours.kernel, _interaction(ours, traced), pinned, reflected)).T
    return LightArrival(reached > 0, cosine)


def _cosine(interaction: Interaction, sample: LightSample) -> Any:
    """LightArrival.cosine of a light sample."""
    of_surface = interaction.face_cosine(sample.l, sample.cosine)
    return dr.select(of_surface < sample.cosine, of_surface, sample.cosine)


class PinnedAreaLight:
    """An area light whose samples all lie at one point.

    light: the area light, with Dr.Jit fields
    away: vector from the middle of the light to that point
    """

    def __init__(self, light: Any, away: Any):
        self.light, self.away = light, dr.make_opaque(away) or away

    def __getattr__(self, name: str) -> Any:
        return getattr(self.light, name)

    def point_offset(self, w: Any, u: Any, v: Any) -> Any:
        return w(self.away)


def _interaction(ours: VisrayScene, traced: TracedRays) -> Interaction:
    state = integrator.single_sample_state(ours.kernel, len(traced.first_hits.t))
    return interact(ours.kernel, traced.ray, traced.hit, state)


def _lights(ours: VisrayScene) -> list[PreparedLight]:
    """All lights in the order of the scene, one by one, even if the kernel loops over many lights of one kind."""
    lights = {light.number: light for light in ours.kernel.lights}
    for batch in ours.kernel.looped_lights:
        columns = next(c for c in ours.prepared.packed.lights if c.kind is batch.kind)
        for i, place in enumerate(columns.scene_index):
            row = pytree.rows(batch.table, dr.opaque(ours.a.U, i))
            lights[place] = PreparedLight(batch.kind, row, None, 0, place, None)
    return [lights[i] for i in sorted(lights)]


def light_table(ours: VisrayScene, light: Light) -> Any:
    """A light whose fields are Dr.Jit arrays, as the light's methods for kernels need them."""
    return stacked(ours.a, type(light), [light])


def sends_light(ours: VisrayScene, light: Light, shadow_rays: ShadowRays) -> np.ndarray:
    """Whether a light sends any light along shadow rays to their starts, if nothing is in between. Shapes: (N)."""
    aim = light_table(ours, light).falloff(ours.triples(-shadow_rays.l))
    return np.ones(len(shadow_rays.p), bool) if aim is None else np.array(aim) > 0


def objects_touching(ours: VisrayScene, p: np.ndarray, tolerance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the objects whose surface passes within `tolerance` of the point p, and unit normals at p. An object
    of several rows, such as a mesh, may occur several times.

    The surface of a flat object is taken to be its infinite plane, but a triangle of a mesh ends at its bounding ball.

    p: position relative to the camera, (3)
    tolerance: distance for each object (world units), (number of objects)
    Shapes: (K), (K, 3).
    """
    point = ours.a.W(*(ours.centre + p).tolist())
    levels = [batch.kind.surface_at(batch.placed, point) for batch in ours.kernel.batches]
    f = np.concatenate([np.array(f, float) for f, _ in levels])
    n = np.concatenate([to_numpy(g) for _, g in levels])
    beyond = np.concatenate([_beyond_ball(batch, ours.centre + p) for batch in ours.kernel.batches])
    size, tolerance = np.linalg.norm(n, axis=1), tolerance[ours.object_of_row[:-1]]
    touching = np.flatnonzero((np.abs(f) <= tolerance * size) & (beyond <= tolerance))
    return ours.object_of_row[touching], n[touching] / size[touching, None]


def _beyond_ball(batch: Batch, p: np.ndarray) -> np.ndarray:
    """How far the point p lies outside of the bounding ball of each row, if rows are parts of objects; else 0."""
    if batch.object_of is None:
        return np.zeros(len(batch))
    return np.linalg.norm(to_numpy(batch.centre) - p, axis=1) - np.array(batch.radius, float)


def unoccluded(
    ours: VisrayScene, traced: TracedRays, shadow_rays: ShadowRays, active: np.ndarray, on_hit_surface: bool = True
) -> np.ndarray:
    """Whether no object lies on a shadow ray; always true if the scene has no shadows. Shapes: (N).

    active: mask of the lanes that matter, (N)
    on_hit_surface: whether the shadow rays start on the surfaces that the traced rays hit
    """
    if not ours.prepared.scene.settings.shadows:
        return np.ones(len(shadow_rays.p), bool)
    return ~np.array(occluded(*_search(ours, traced, shadow_rays, on_hit_surface), ours.a.B(active)))


def transmittances(ours: VisrayScene, traced: TracedRays, shadow_rays: ShadowRays, active: np.ndarray) -> np.ndarray:
    """The transmittance of shadow rays that start on the surfaces that the traced rays hit. Shapes: (N, 3).

    active: mask of the lanes that matter, (N)
    """
    materials = tuple(map(Tint.of, ours.kernel.batches))
    return to_numpy(transmittance(*_search(ours, traced, shadow_rays, True), ours.a.B(active), materials))


def _search(
    ours: VisrayScene, traced: TracedRays, shadow_rays: ShadowRays, on_hit_surface: bool
) -> tuple[RayOrigin, Ray, Target]:
    """The origin, rays and target with which the kernels search for occluders.

    The kernels search from the light to the point. If the light is infinitely far away, they search from the point
    towards the light.
    """
    a, n = ours.a, len(shadow_rays.p)
    inside = a.B(traced.inside())
    if shadow_rays.infinite:
        ray = Ray(ours.triples(ours.centre + shadow_rays.p), ours.triples(shadow_rays.l))
        target = Target(a.D(shadow_rays.length), dr.zeros(a.D, n))
        if on_hit_surface:
            # The search starts farther away than the error of the point. So it does not hit other surfaces in the same
            # place as the surface on which the ray starts.
            cosine = a.D(np.abs((traced.first_hits.n * shadow_rays.l).sum(1)))
            clearance = traced.surface.error / dr.select(cosine > 0, cosine, 1)
            ray = Ray(ray.o, ray.d, row=traced.hit.row, inside=inside, clearance=clearance, part=traced.hit.part)
    else:
        ray = Ray(ours.triples(ours.centre + shadow_rays.end), ours.triples(-shadow_rays.l))
        row = traced.hit.row if on_hit_surface else dr.opaque(a.U, NO_ROW, n)
        # The part is not used if the ray's end lies on no row.
        error, part = traced.surface.error, traced.hit.part
        target = Target(a.D(shadow_rays.length), error, row, inside & on_hit_surface, part)
    return RayOrigin(ours.kernel.geometry, ray.o, shared=False), ray, target
