"""Light on its way to a point: from points, from afar and from shapes, with its shadows."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.geometry import extent, gamma
from visray.guards import Cone
from visray.ray import Ray, inverse_length
from visray.scenery import Crowd, Lamp, Scenery, Site
from visray.search import End, Watch, blocked, transmitted
from visray.trees import rows

# Streams of random numbers from here on belong to lights.
STREAM = 16


@dataclass(frozen=True)
class Beam:
    """Light on its way to a point: unit direction to the light, cosine with the normal, whether any arrives.

    weight: what attenuation and aim leave of it; share: what transparent objects leave; None where that is all.
    """

    l: Any
    cosine: Any
    reached: Any
    weight: Any = None
    share: Any = None


def illuminated(s: Scenery, site: Site, answer: Callable) -> Any:
    """What all lights add: the sum of answer(s, site, light, beam)."""
    colour = dr.zeros(s.a.V, 1)
    for lamp in s.lamps:
        if lamp.kind.wide:
            colour = colour + spread(s, site, lamp, answer)
        else:
            colour = colour + answer(s, site, lamp.light, beam(s, site, lamp))
    for crowd in s.crowds:
        colour = colour + _each(s, site, crowd, answer)
    return colour


def _each(s: Scenery, site: Site, crowd: Crowd, answer: Callable) -> Any:
    """What the lights of a crowd add, one after the other."""

    def step(i: Any, colour: Any) -> tuple:
        light = rows(crowd.table, i)
        lot = None if crowd.lots is None else rows(crowd.lots, i)
        lamp = Lamp(crowd.kind, light, lot, 0, crowd.number, None)
        more = spread(s, site, lamp, answer, i) if crowd.kind.wide else answer(s, site, light, beam(s, site, lamp))
        return (colour + more,)

    black = dr.zeros(s.a.V, dr.width(site.surface.p))
    return s.repeated(0, crowd.count, site.hit.valid, (black,), step)[0]


def spread(s: Scenery, site: Site, lamp: Lamp, answer: Callable, salt: Any = 0) -> Any:
    """What an area light adds: the mean over its samples of what each point of it would.

    With settings.area "centre" as in the original: what its middle adds, weakened by the mean of all shadows.
    """
    a, n = s.a, dr.width(site.surface.p)
    stream = site.draw.along(salt).stream(STREAM + lamp.number)
    base = a.V(lamp.light.position - site.surface.p)
    middle = None if s.settings.area == "samples" else _from(s, site, lamp, base)
    watch = None
    if s.features["shadows"]:
        watch = site.watch.toward(Cone.around(a, base, lamp.light.reach()))

    def step(j: Any, colour: Any) -> tuple:
        b = _from(s, site, lamp, base + lamp.light.offset(a.V, *stream.many(j, lamp.lot)), watch, middle)
        return (colour + answer(s, site, lamp.light, b),)

    done = s.repeated(lamp.samples, lamp.lot.count, site.hit.valid, (dr.zeros(a.V, n),), step)
    return done[0] * dr.rcp(a.F(lamp.lot.count))


def _from(s: Scenery, site: Site, lamp: Lamp, way: Any, watch: Watch | None = None, middle: Beam | None = None) -> Beam:
    """The beam along `way` to a point of an area light, in the precision of shading; its shadow is looked for by
    `watch`. `middle`: the beam to shade with, which takes only its shadow from this one."""
    a = s.a
    squared = dr.squared_norm(way)
    inverse = dr.select(squared > 0, dr.rsqrt(squared), 0) if a.precision == "single" else inverse_length(way, None)
    l = way * inverse
    distance = squared * inverse
    cosine = dr.dot(site.n, l)
    reached = site.hit.valid & (cosine > 0)
    b = Beam(l, cosine, reached, attenuation(s, lamp.light, distance))
    if middle is not None:
        b = Beam(middle.l, middle.cosine, reached & middle.reached, middle.weight)
    if watch is None:
        return b
    # The light's point is known as well as the way to it: a sum, whose parts may be longer than the light is wide.
    longest = distance + a.F(lamp.light.reach())
    error = gamma(8, a.precision) * longest + a.F(gamma(9) * extent(lamp.light.position))
    return _shadowed(s, watch, site.leaving(l, cosine, error), End(distance, lamp=error), b)


def beam(s: Scenery, site: Site, lamp: Lamp) -> Beam:
    """What arrives of a light that is a point, or infinitely far away."""
    if not lamp.kind.placed:
        return _from_afar(s, site, lamp)
    a, light = s.a, lamp.light
    from_light = site.surface.p - light.position
    inverse = inverse_length(from_light, a.F32 if a.precision == "single" else None)
    d = from_light * inverse
    distance = dr.squared_norm(from_light) * inverse
    l = a.V(-d)
    cosine = dr.dot(site.n, l)
    reached = site.hit.valid & (cosine > 0)
    weight, aim = attenuation(s, light, a.F(distance)), light.aim(d)
    if aim is not None:
        aim = a.F(aim)
        reached &= aim > 0
        weight = aim if weight is None else weight * aim
    b = Beam(l, cosine, reached, weight)
    if not s.features["shadows"]:
        return b
    if lamp.watch is None:
        error = gamma(8) * (extent(light.position) + distance)
        return _shadowed(s, site.watch, site.leaving(-d, cosine, error), End(distance, lamp=error), b)
    # The ray runs from the light to the point: all rays of a light share their origin. It counts as arrived where
    # it meets a surface flush with the one seen: no farther above it than both are off, as seen from eye and light.
    error = site.surface.error + gamma(8) * (extent(light.position) + distance)
    length = distance - a.D(a.F(error) / cosine)
    return _shadowed(s, lamp.watch, Ray(light.position, d, error=error), End(length, site.hit.index, site.within), b)


def _from_afar(s: Scenery, site: Site, lamp: Lamp) -> Beam:
    """What arrives of a directional light."""
    a = s.a
    d = -dr.normalize(lamp.light.direction)
    l = a.V(d)
    cosine = dr.dot(site.n, l)
    weight = None
    if s.features["attenuation"]:
        weight = dr.select(lamp.light.a > 0, dr.rcp(lamp.light.a), 1)
    b = Beam(l, cosine, site.hit.valid & (cosine > 0), weight)
    if not s.features["shadows"]:
        return b
    everywhere = dr.zeros(a.D, dr.width(site.surface.p))
    ray = site.leaving(d + everywhere, cosine, everywhere)
    return _shadowed(s, site.watch, ray, End(everywhere + dr.inf), b)


def attenuation(s: Scenery, light: Any, distance: Any) -> Any:
    """1 / (a + b d + c d^2), or 1 where a = b = c = 0; None where no light has any."""
    if not s.features["attenuation"]:
        return None
    weight = light.a + distance * (light.b + distance * light.c)
    return dr.select(weight > 0, dr.rcp(weight), 1)


def _shadowed(s: Scenery, watch: Any, ray: Ray, end: End, b: Beam) -> Beam:
    """The beam with what is left of it beyond the objects on its way."""
    if not s.features["coloured shadows"]:
        hidden = blocked(watch, ray, end, b.reached, s.plain)
        return Beam(b.l, b.cosine, b.reached & ~hidden, b.weight)
    tints = tuple((g.material.kt, g.material.dmax) for g in s.groups)
    share = transmitted(watch, ray, end, b.reached, tints, s.attached, s.plain)
    return Beam(b.l, b.cosine, b.reached, b.weight, share)
