"""Direct light at a surface point: light from point lights, directional lights and area lights, with its shadows."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray.accel.culling import DirectionCone
from visray.accel.intersect import Target, occluded, transmittance
from visray.accel.origin import RayOrigin
from visray.accel.tint import Tint
from visray.geometry import gamma, l1_norm
from visray.interaction import Interaction
from visray.kernel_scene import KernelScene
from visray.lights.light import Light
from visray.prepared_lights import LightBatch, PreparedLight
from visray.pytree import rows
from visray.ray import Ray, inverse_length

# First random dimension of the lights (sampling.py): light i uses DIMENSION + i.
DIMENSION = 16


@dataclass(frozen=True)
class LightSample:
    """Light that travels from a light, or from one point of it, to a surface point.

    l: unit direction to the light
    cosine: cosine of the angle between l and the surface's normal
    arrives: mask of the lanes in which light arrives, because the light is on the side of the normal and is not
        occluded
    weight: attenuation times falloff, or None if it is 1
    transmittance: share of the light that passes through transparent objects, a colour; None if shadows are opaque
    """

    l: Any
    cosine: Any
    arrives: Any
    weight: Any = None
    transmittance: Any = None


def direct(s: KernelScene, si: Interaction, reflected: Callable) -> Any:
    """Light from all lights that a surface point reflects, a colour: the sum of `reflected` over light samples.

    reflected: function of (s, si, row of the light's numbers, light sample) that returns a colour
    """
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
    """Light from the lights of one batch that a surface point reflects, a colour; computed in a loop."""

    def step(i: Any, colour: Any) -> tuple:
        row, points = rows(batch.table, i), rows(batch.points, i)
        light = PreparedLight(batch.kind, row, points, 0, batch.number, None)
        if batch.kind.has_area:
            return (colour + area_light(s, si, light, reflected, i),)
        return (colour + reflected(s, si, row, light_sample(s, si, light)),)

    black = dr.zeros(s.a.V, dr.width(si.surface.p))
    return s.loop(batch.count, si.hit.valid, (black,), step)[0]


def area_light(s: KernelScene, si: Interaction, light: PreparedLight, reflected: Callable, salt: Any = 0) -> Any:
    """Light from an area light that a surface point reflects, a colour: the mean of `reflected` over points of the
    light.

    With settings.area "centre", as in the original program, direction, distance and falloff are those of the light's
    centre, and only the shadows are those of the points.

    salt: number that makes the random points of each looped light differ
    """
    row, sample_at = light.light, area_sampler(s, si, light, salt)

    def step(j: Any, colour: Any) -> tuple:
        return (colour + reflected(s, si, row, sample_at(j)[0]),)

    black = dr.zeros(s.a.V, dr.width(si.surface.p))
    total = s.loop(light.points.count, si.hit.valid, (black,), step)
    return total[0] * dr.rcp(s.a.F(light.points.count))


def area_sampler(s: KernelScene, si: Interaction, light: PreparedLight, salt: Any = 0) -> Callable:
    """Function of the number j of a point of an area light. It returns (the light sample from this point, the vector
    from the surface point to it). Arguments as in `area_light`."""
    a, row = s.a, light.light
    dimension = si.sample.derived(salt).dimension(DIMENSION + light.number)
    to_centre = a.V(row.position - si.surface.p)
    centre = None if s.settings.area == "samples" else _from_area(s, si, row, to_centre, None, None)
    origin = None
    if s.features["shadows"]:
        origin = si.origin.toward(DirectionCone.around(a, to_centre, row.radius_bound()))

    def sample_at(j: Any) -> tuple[LightSample, Any]:
        to_light = to_centre + row.point_offset(a.V, *dimension.set_point(j, light.points))
        return _from_area(s, si, row, to_light, origin, centre), to_light

    return sample_at


@dataclass(frozen=True)
class Connection:
    """A point of a light, seen from a surface point, before shadows.

    sample: the light sample
    l, cosine: direction to the point, and its cosine with the normal. Those of `sample` are the same, except with
        settings.area "centre"
    distance: distance of the point; inf for a directional light
    """

    sample: LightSample
    l: Any
    cosine: Any
    distance: Any


def to_area(s: KernelScene, si: Interaction, row: Any, to_light: Any, centre: LightSample | None) -> Connection:
    """One point of an area light, computed in the precision of shading.

    row: numbers of the light
    to_light: vector from the surface point to the point of the light
    centre: light sample from the light's centre, or None. If it is given, the result takes direction, cosine and weight
        from it, and only the shadow from the point
    """
    a = s.a
    squared_distance = dr.squared_norm(to_light)
    if a.precision == "single":
        inverse_distance = dr.select(squared_distance > 0, dr.rsqrt(squared_distance), 0)
    else:
        inverse_distance = inverse_length(to_light, None)
    l = to_light * inverse_distance
    distance = squared_distance * inverse_distance
    cosine, arrives = _incidence(si, l)
    sample = LightSample(l, cosine, arrives, attenuation(s, row, distance))
    if centre is not None:
        sample = LightSample(centre.l, centre.cosine, arrives & centre.arrives, centre.weight)
    return Connection(sample, l, cosine, distance)


def rounding_of_point(s: KernelScene, row: Any, distance: Any, extent: Any) -> Any:
    """Error of a point of a light. The vector to it is a sum whose terms may be larger than the distance.

    extent: bound on the distance of the point from the light's position
    """
    return gamma(8, s.a.precision) * (distance + extent) + s.a.F(gamma(9) * l1_norm(row.position))


def _from_area(
    s: KernelScene, si: Interaction, row: Any, to_light: Any, origin: RayOrigin | None, centre: LightSample | None
) -> LightSample:
    """A light sample from one point of an area light. Arguments as in `to_area`.

    origin: origin of shadow rays; None if there are no shadows
    """
    c = to_area(s, si, row, to_light, centre)
    if origin is None:
        return c.sample
    error = rounding_of_point(s, row, c.distance, s.a.F(row.radius_bound()))
    return _shadowed(s, origin, si.spawn_ray(c.l, c.cosine), Target(c.distance, error, may_touch=True), c.sample)


def light_sample(s: KernelScene, si: Interaction, light: PreparedLight) -> LightSample:
    """The light sample from a light without an area."""
    if not light.kind.has_position:
        return _from_far(s, si, light)
    a, row = s.a, light.light
    c, from_light, d = to_point(s, si, row, light.kind)
    if not s.features["shadows"]:
        return c.sample
    starts_single = a.precision == "single"
    if light.origin is None:
        error = gamma(9) * (l1_norm(row.position) + a.D(c.distance))
        ray = replace(si.spawn_ray(-d, c.cosine), to_target=-from_light if starts_single else None)
        return _shadowed(s, si.origin, ray, Target(c.distance, error, may_touch=True), c.sample)
    # The shadow ray runs from the light to the point, so that all shadow rays of a light share their origin. A surface
    # above the point by at most the errors of the point and of the ray's end does not occlude: to within rounding it is
    # the surface that is shaded.
    error = si.surface.error + gamma(9) * (l1_norm(row.position) + a.D(c.distance))
    slope = si.face_cosine(c.l, c.cosine)
    target = Target(c.distance, error, si.hit.row, si.from_inside, si.hit.part, slack=error, cosine=slope)
    ray = Ray(row.position, d, to_target=from_light if starts_single else None)
    return _shadowed(s, light.origin.along(light.lists, si.surface.p), ray, target, c.sample)


def to_point(s: KernelScene, si: Interaction, row: Any, kind: type[Light]) -> tuple[Connection, Any, Any]:
    """A light with a position and without an area: (the connection, vector from the light, its direction).

    row: numbers of the light
    """
    a = s.a
    from_light = si.surface.p - row.position
    # Single precision suffices for shadow rays that pass far from all objects. The falloff needs double, because digits
    # cancel in it.
    starts_single = a.precision == "single"
    if starts_single:
        squared_distance = dr.squared_norm(a.V(from_light))
        inverse_distance = dr.select(squared_distance > 0, dr.rsqrt(squared_distance), 0)
        d = a.V(from_light) * inverse_distance
    else:
        squared_distance = dr.squared_norm(from_light)
        inverse_distance = inverse_length(from_light, None)
        d = from_light * inverse_distance
    distance, l = squared_distance * inverse_distance, a.V(-d)
    cosine, arrives = _incidence(si, l)
    exact_falloff = starts_single and kind.falloff is not Light.falloff
    weight = attenuation(s, row, a.F(distance))
    falloff = row.falloff(from_light * inverse_length(from_light, a.F32) if exact_falloff else d)
    if falloff is not None:
        falloff = a.F(falloff)
        arrives &= falloff > 0
        weight = falloff if weight is None else weight * falloff
    return Connection(LightSample(l, cosine, arrives, weight), l, cosine, distance), from_light, d


def to_far(s: KernelScene, si: Interaction, row: Any) -> tuple[Connection, Any]:
    """A directional light: (the connection, the direction of the light in double). row: numbers of the light"""
    d = -dr.normalize(row.direction)
    l = s.a.V(d)
    cosine, arrives = _incidence(si, l)
    weight = None
    if s.features["attenuation"]:
        weight = dr.select(row.a > 0, dr.rcp(row.a), 1)
    return Connection(LightSample(l, cosine, arrives, weight), l, cosine, s.a.D(dr.inf)), d


def _from_far(s: KernelScene, si: Interaction, light: PreparedLight) -> LightSample:
    """The light sample from a directional light.

    Its shadow rays are endless and share their direction. They start at the surface point, so the start is the known
    end, and a search for roots begins there.
    """
    a = s.a
    c, d = to_far(s, si, light.light)
    if not s.features["shadows"]:
        return c.sample
    zeros = dr.zeros(a.D, dr.width(si.surface.p))
    ray = si.spawn_ray(d + zeros, c.cosine)
    return _shadowed(s, si.origin.along(light.lists), ray, Target(zeros + dr.inf, zeros), c.sample)


def _incidence(si: Interaction, l: Any) -> tuple[Any, Any]:
    """(cosine of the angle between the direction l to the light and the normal, mask of the lanes in which the light is
    on the side of the surface that is seen)."""
    cosine = dr.dot(si.n, l)
    arrives = si.hit.valid & (cosine > 0)
    return cosine, arrives if si.face is None else arrives & (si.face_cosine(l, cosine) > 0)


def attenuation(s: KernelScene, row: Any, distance: Any) -> Any:
    """1 / (a + b d + c d^2) at distance d, or 1 if a = b = c = 0; None in scenes without attenuation.

    row: numbers of the light
    """
    if not s.features["attenuation"]:
        return None
    weight = row.a + distance * (row.b + distance * row.c)
    return dr.select(weight > 0, dr.rcp(weight), 1)


def _shadowed(s: KernelScene, origin: RayOrigin, ray: Ray, target: Target, sample: LightSample) -> LightSample:
    """The light sample after the objects along a shadow ray have taken light from it.

    origin: origin of the shadow ray
    ray: the shadow ray
    target: its end
    sample: light sample before shadows
    """
    if not s.features["coloured shadows"]:
        is_occluded = occluded(origin, ray, target, sample.arrives, s.brute_force)
        return LightSample(sample.l, sample.cosine, sample.arrives & ~is_occluded, sample.weight)
    tints = tuple(map(Tint.of, s.batches))
    light_left = transmittance(origin, ray, target, sample.arrives, tints, s.brute_force)
    return LightSample(sample.l, sample.cosine, sample.arrives, sample.weight, light_left)
