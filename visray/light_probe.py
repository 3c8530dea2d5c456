"""What happens to the light of each light at a few surface points: how it falls, how much is left, and what is in the
way. The reports on single pixels and on black pictures are made from it.

Each number comes from the functions that pictures are rendered with. One lane is one surface point, or one sample of an
area light at a point.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from visray.accel.intersect import closest
from visray.accel.origin import RayOrigin
from visray.direct import LightSample, area_sampler, attenuation, light_sample
from visray.features import Features
from visray.integrator import camera_ray, object_of
from visray.interaction import Interaction, interact
from visray.kernel_scene import KernelScene
from visray.lights.light import Light
from visray.prepared_lights import PreparedLight
from visray.pytree import evaluated, rows
from visray.ray import NO_ROW, Hit, Ray
from visray.sampling import SamplePlan, SampleState, first_stratum, pixel_key
from visray.shading import reflected

# The largest number of objects that are looked for in the way of one ray.
MOST_IN_WAY = 16


@dataclass(frozen=True)
class LightProbe:
    """The light of one light at N surface points, or from N samples of it at one point. All fields are NumPy arrays.

    distance: distance of the light, or of the sample; inf for directional lights
    cosine: cosine of the angle between the normal and the direction to the light
    to_light: unit direction to the light
    faces: whether the light is on the side of the surface that is seen
    attenuation: factor of the distance
    falloff: factor of the direction from the light; 1 for lights that shine the same in all directions
    transmittance: share of the light that passes all objects in the way, a colour; 0 if it is blocked
    diffuse, specular: the parts that the surface reflects, colours
    in_way: for each lane, numbers of the objects in the way, the nearest to the surface first

    Shapes: (N), (N, 3)
    """

    distance: np.ndarray
    cosine: np.ndarray
    to_light: np.ndarray
    faces: np.ndarray
    attenuation: np.ndarray
    falloff: np.ndarray
    transmittance: np.ndarray
    diffuse: np.ndarray
    specular: np.ndarray
    in_way: list[list[int]]


def numbers(value: Any, n: int) -> np.ndarray:
    """The values of a Dr.Jit array or a plain number in NumPy. Shapes: (n), or (n, 3) for a triple."""
    x = np.array(value)
    return np.broadcast_to(x, (3, n)).T if x.ndim == 2 else np.broadcast_to(x, n)


def centre_sample(s: KernelScene, x: Any, y: Any) -> tuple[Ray, SampleState]:
    """The camera rays through the centres of the pixels (x, y), and the random numbers of their first samples."""
    plan = SamplePlan.of(s.a, s.settings.seed, s.settings.spp, 0, 1)
    key = pixel_key(plan, x, y)
    state = SampleState(s.settings.sampler, s.a.F, plan, key, 0 * x, first_stratum(plan, key, s.a.F))
    return camera_ray(s, s.a.F(x) + 0.5, s.a.F(y) + 0.5), state


def prepared_lights(s: KernelScene) -> Iterator[tuple[int, PreparedLight, int]]:
    """Yields for each light of the scene: its number, its data, and the salt of its random points. In the order of the
    scene, except for lights that kernels loop over."""
    for light in s.lights:
        yield light.number, light, 0
    for batch in s.looped_lights:
        for i in range(int(np.array(batch.count)[0])):
            row, points = rows((batch.table, batch.points), dr.opaque(s.a.U, i))
            yield batch.number + i, PreparedLight(batch.kind, row, points, 0, batch.number, None), i


def probed(s: KernelScene, si: Interaction, light: PreparedLight, salt: int, j: Any) -> LightProbe:
    """The light of a light at the surface points of si, whose arrays are evaluated.

    salt: as prepared_lights yields it
    j: for area lights, the number of the sample in each lane
    """
    a, n, row = s.a, dr.width(si.surface.p), light.light
    open_scene = replace(s, features=_without_shadows(s.features))
    if light.kind.has_area:
        salt = dr.opaque(a.U, salt)
        sample, to_light = area_sampler(s, si, light, salt)(j)
        unshadowed = area_sampler(open_scene, si, light, salt)(j)[0]
    else:
        sample, unshadowed = light_sample(s, si, light), light_sample(open_scene, si, light)
        to_light = row.position - si.surface.p if light.kind.has_position else None
    distance = dr.full(a.D, dr.inf, n) if to_light is None else a.D(dr.norm(to_light))
    weight = attenuation(s, row, a.F(distance)) if light.kind.has_position else sample.weight
    falloff = None
    if light.kind.has_position and light.kind.falloff is not Light.falloff:
        falloff = row.falloff(-dr.normalize(to_light))
    black = a.V(0)
    parts = (reflected(s, si, replace(row, Is=black), sample), reflected(s, si, replace(row, Id=black), sample))
    passed = a.V(1) if sample.transmittance is None else sample.transmittance
    passed = dr.select(sample.arrives, passed, 0)
    evaluated((distance, unshadowed.cosine, unshadowed.l, unshadowed.arrives, weight, falloff, passed, parts))
    values = [numbers(1 if x is None else x, n) for x in (
        distance, unshadowed.cosine, unshadowed.l, _faces(si, unshadowed), weight, falloff, passed, *parts
    )]  # fmt: skip
    blocked = unshadowed.arrives & (dr.min(passed) < 1)
    return LightProbe(*values, _in_way(s, si, unshadowed, distance, blocked))


def _faces(si: Interaction, sample: LightSample) -> Any:
    """Mask of the lanes in which a light is on the side of the surface that is seen."""
    return si.hit.valid & (sample.cosine > 0) & (si.face_cosine(sample.l, sample.cosine) > 0)


def _without_shadows(features: Features) -> Features:
    """The effects without shadows."""
    shadows = ("shadows", "coloured shadows")
    return replace(features, listed=tuple(replace(f, on=f.on and f.name not in shadows) for f in features.listed))


def _in_way(s: KernelScene, si: Interaction, sample: LightSample, distance: Any, blocked: Any) -> list[list[int]]:
    """Numbers of the objects between surface points and a light, a list for each lane.

    sample: the light sample without shadows
    distance: distance of the light
    blocked: mask of the lanes in which something is in the way
    """
    a, n = s.a, dr.width(si.surface.p)
    found: list[list[int]] = [[] for _ in range(n)]
    d, left, active = sample.l, distance, blocked & si.hit.valid
    for _ in range(MOST_IN_WAY):
        evaluated((left, active))
        if not np.array(active).any():
            break
        ray = si.spawn_ray(d, dr.abs(dr.dot(si.n, d)))
        hit = closest(RayOrigin(s.geometry, ray.o, shared=False), ray, s.brute_force, active, left)
        ray, hit = ray.exact(), Hit(hit.t, dr.select(active, hit.row, NO_ROW), hit.part)
        active = active & hit.valid
        next_si = interaction_of(s, ray, hit, si.sample)
        objects = numbers(object_of(s, hit), n)
        for lane in np.flatnonzero(numbers(active, n)):
            if int(objects[lane]) not in found[lane]:
                found[lane].append(int(objects[lane]))
        # The ray goes straight on, on the other side of this surface.
        left = left - dr.select(hit.valid, hit.t, 0)
        si = replace(next_si, n=-next_si.n, face=None if next_si.face is None else -next_si.face,
                     from_inside=~next_si.from_inside)  # fmt: skip
        if not s.features["coloured shadows"]:
            break
        active = active & (dr.max(next_si.material.kt) > 0)
        d = a.V(d)
    return found


def interaction_of(s: KernelScene, ray: Any, hit: Hit, sample: Any) -> Interaction:
    """The interaction at a hit, with all its arrays evaluated, so that each further kernel is small."""
    si = interact(s, ray, hit, sample)
    names = ("o", "d", "hit", "surface", "n", "face", "from_inside", "material", "u", "v")
    si = replace(si, **dict(zip(names, evaluated(tuple(getattr(si, name) for name in names)))))
    origin = None if si.origin is None else RayOrigin(s.geometry, si.surface.p, shared=False)
    return replace(si, origin=origin)
