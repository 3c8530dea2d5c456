"""Direct light: on its way to a point from points, from afar and from shapes, with its shadows."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray.accel.culling import DirectionCone
from visray.accel.intersect import Target, occluded, transmittance
from visray.accel.origin import RayOrigin
from visray.geometry import gamma, l1_norm
from visray.interaction import Interaction
from visray.kernel_scene import KernelScene, LightBatch, PreparedLight
from visray.lights.light import Light
from visray.pytree import rows
from visray.ray import Ray, inverse_length

# Dimensions of random numbers from here on belong to lights.
DIMENSION = 16


@dataclass(frozen=True)
class LightSample:
    """Light on its way to a point: unit direction to the light, cosine with the normal, whether any arrives.

    weight: what attenuation and aim leave of it; share: what transparent objects leave; None where that is all.
    """

    l: Any
    cosine: Any
    arrives: Any
    weight: Any = None
    transmittance: Any = None


def direct(s: KernelScene, si: Interaction, reflected: Callable) -> Any:
    """What all lights add: the sum of reflected(s, si, light's row, light sample)."""
    colour = dr.zeros(s.a.V, 1)
    for light in s.lights:
        if light.kind.has_area:
            colour = colour + area_light(s, si, light, reflected)
        else:
            colour = colour + reflected(s, si, light.light, light_sample(s, si, light))
    for batch in s.looped_lights:
        colour = colour + _looped(s, si, batch, reflected)
    return colour


def _looped(s: KernelScene, si: Interaction, batch: LightBatch, reflected: Callable) -> Any:
    """What the lights of a batch add, one after the other."""

    def step(i: Any, colour: Any) -> tuple:
        row, points = rows(batch.table, i), rows(batch.points, i)
        light = PreparedLight(batch.kind, row, points, 0, batch.number, None)
        if batch.kind.has_area:
            return (colour + area_light(s, si, light, reflected, i),)
        return (colour + reflected(s, si, row, light_sample(s, si, light)),)

    black = dr.zeros(s.a.V, dr.width(si.surface.p))
    return s.loop(0, batch.count, si.hit.valid, (black,), step)[0]


def area_light(s: KernelScene, si: Interaction, light: PreparedLight, reflected: Callable, salt: Any = 0) -> Any:
    """What an area light adds: the mean over its samples of what each point of it would.

    With settings.area "centre" as in the original: what its middle adds, weakened by the mean of all shadows.
    """
    a, n, row = s.a, dr.width(si.surface.p), light.light
    dimension = si.sample.derived(salt).dimension(DIMENSION + light.number)
    base = a.V(row.position - si.surface.p)
    middle = None if s.settings.area == "samples" else _along(s, si, row, base)
    origin = None
    if s.features["shadows"]:
        origin = si.origin.toward(DirectionCone.around(a, base, row.radius_bound()))

    def step(j: Any, colour: Any) -> tuple:
        sample = _along(s, si, row, base + row.point_offset(a.V, *dimension.set_point(j, light.points)), origin, middle)
        return (colour + reflected(s, si, row, sample),)

    total = s.loop(light.samples, light.points.count, si.hit.valid, (dr.zeros(a.V, n),), step)
    return total[0] * dr.rcp(a.F(light.points.count))


def _along(
    s: KernelScene, si: Interaction, row: Any, way: Any, origin: RayOrigin | None = None,
    middle: LightSample | None = None,
) -> LightSample:  # fmt: skip
    """The light along `way` from a point of an area light, in the precision of shading; its shadow is looked for from
    `origin`. `middle`: the light sample to shade with, which takes only its shadow from this one."""
    a = s.a
    squared = dr.squared_norm(way)
    inverse = dr.select(squared > 0, dr.rsqrt(squared), 0) if a.precision == "single" else inverse_length(way, None)
    l = way * inverse
    distance = squared * inverse
    cosine = dr.dot(si.n, l)
    reached = si.hit.valid & (cosine > 0)
    sample = LightSample(l, cosine, reached, attenuation(s, row, distance))
    if middle is not None:
        sample = LightSample(middle.l, middle.cosine, reached & middle.arrives, middle.weight)
    if origin is None:
        return sample
    # The light's point is known as well as the way to it: a sum, whose parts may be longer than the light is wide.
    longest = distance + a.F(row.radius_bound())
    error = gamma(8, a.precision) * longest + a.F(gamma(9) * l1_norm(row.position))
    return _shadowed(s, origin, si.spawn_ray(l, cosine), Target(distance, error, may_touch=True), sample)


def light_sample(s: KernelScene, si: Interaction, light: PreparedLight) -> LightSample:
    """What arrives of a light that is a point, or infinitely far away."""
    if not light.kind.has_position:
        return _from_afar(s, si, light.light)
    a, row = s.a, light.light
    way = si.surface.p - row.position
    # What comes near nothing on its way needs no more than single; where light is aimed digits would cancel.
    late = a.precision == "single"
    if late:
        squared = dr.squared_norm(a.V(way))
        inverse = dr.select(squared > 0, dr.rsqrt(squared), 0)
        d = a.V(way) * inverse
    else:
        squared = dr.squared_norm(way)
        inverse = inverse_length(way, None)
        d = way * inverse
    distance, l = squared * inverse, a.V(-d)
    cosine = dr.dot(si.n, l)
    reached = si.hit.valid & (cosine > 0)
    aimed = late and light.kind.falloff is not Light.falloff
    weight, aim = attenuation(s, row, a.F(distance)), row.falloff(way * inverse_length(way, a.F32) if aimed else d)
    if aim is not None:
        aim = a.F(aim)
        reached &= aim > 0
        weight = aim if weight is None else weight * aim
    sample = LightSample(l, cosine, reached, weight)
    if not s.features["shadows"]:
        return sample
    if light.origin is None:
        error = gamma(9) * (l1_norm(row.position) + a.D(distance))
        ray = replace(si.spawn_ray(-d, cosine), to_target=-way if late else None)
        return _shadowed(s, si.origin, ray, Target(distance, error, may_touch=True), sample)
    # The ray runs from the light to the point: all rays of a light share their origin. It counts as arrived where
    # it meets a surface flush with the one seen: no farther above it than both are off, as seen from eye and light.
    error = si.surface.error + gamma(9) * (l1_norm(row.position) + a.D(distance))
    target = Target(distance, error, si.hit.row, si.from_inside, si.hit.part, slack=error, cosine=cosine)
    return _shadowed(s, light.origin, Ray(row.position, d, to_target=way if late else None), target, sample)


def _from_afar(s: KernelScene, si: Interaction, row: Any) -> LightSample:
    """What arrives of a directional light."""
    a = s.a
    d = -dr.normalize(row.direction)
    l = a.V(d)
    cosine = dr.dot(si.n, l)
    weight = None
    if s.features["attenuation"]:
        weight = dr.select(row.a > 0, dr.rcp(row.a), 1)
    sample = LightSample(l, cosine, si.hit.valid & (cosine > 0), weight)
    if not s.features["shadows"]:
        return sample
    everywhere = dr.zeros(a.D, dr.width(si.surface.p))
    ray = si.spawn_ray(d + everywhere, cosine)
    return _shadowed(s, si.origin, ray, Target(everywhere + dr.inf, everywhere), sample)


def attenuation(s: KernelScene, row: Any, distance: Any) -> Any:
    """1 / (a + b d + c d^2), or 1 where a = b = c = 0; None where no light has any."""
    if not s.features["attenuation"]:
        return None
    weight = row.a + distance * (row.b + distance * row.c)
    return dr.select(weight > 0, dr.rcp(weight), 1)


def _shadowed(s: KernelScene, origin: RayOrigin, ray: Ray, target: Target, sample: LightSample) -> LightSample:
    """The light sample with what is left of it beyond the objects on its way."""
    if not s.features["coloured shadows"]:
        hidden = occluded(origin, ray, target, sample.arrives, s.brute_force)
        return LightSample(sample.l, sample.cosine, sample.arrives & ~hidden, sample.weight)
    tints = tuple((b.material.kt, b.material.dmax) for b in s.batches)
    share = transmittance(origin, ray, target, sample.arrives, tints, s.attached, s.brute_force)
    return LightSample(sample.l, sample.cosine, sample.arrives, sample.weight, share)
