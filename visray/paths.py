"""Light that comes by way of other surfaces: reflected, refracted, scattered.

A path has one ray at each of its levels. Where a surface both reflects and lets through, one of the two is drawn, with
a chance by their strength. Of a matte surface that the eye sees, settings.scatter.rays paths are followed.

    I = (1 - kt) local + kr reflected + kt refracted, and matte: local + kd (mean of what comes over the hemisphere)

All of the light that is refracted is reflected where the angle is beyond the critical one (weight kt).
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray import tables, warp
from visray.ray import NO_OBJECT, Hit, Ray, unit
from visray.scenery import Scenery, Site, site
from visray.search import Watch, closest
from visray.shading import shade
from visray.tables import Group, Kinship
from visray.trees import rows

LOBE, SCATTER = 5, 6


@dataclass(frozen=True)
class Lens:
    """The solid that rays pass at a surface, and what lies around it there.

    ratio: the index of refraction on the viewer's side over that beyond. buried: it lies in a smaller transparent
    solid, whose index holds there, so that nothing is seen of its surface.
    """

    ratio: Any
    buried: Any


def weight_of_local(s: Scenery, site: Site, lens: Lens | None) -> Any:
    """How much of a surface's own colour is seen: 1 - kt, and nothing of one that is buried; None for all of it."""
    if not s.features["refraction"]:
        return None
    kt = site.material.kt
    weight = 1 - kt if s.settings.local == "weighted" else s.a.V(1) + 0 * kt
    if lens is None or lens.buried is None:
        return weight
    return dr.select(lens.buried, 0, weight)


def lens(s: Scenery, site: Site) -> Lens | None:
    """What the ray goes through at the surface. Where transparent solids overlap, the index of the smaller one holds
    (by the spheres around them): so an inner one counts, wherever it stands in the file."""
    if not s.features["refraction"]:
        return None
    a, n = s.a, dr.width(site.surface.p)
    far = dr.full(a.D, dr.inf, n)
    around, best, own = dr.full(a.D, 1, n), (far, dr.full(a.U, NO_OBJECT, n)), far
    closed = dr.full(a.B, False, n)
    base = 0
    for k, group in zip(s.kin, s.groups):
        size = len(k.names)
        if k.kind.closed:
            here = (site.hit.index >= base) & (site.hit.index < base + size)
            closed |= here
            own = dr.select(here, dr.gather(a.D, group.radius, dr.select(here, site.hit.index - base, 0)), own)
            if s.features["nested media"]:
                around, *best = _inside(s, site, k, group, base, around, *best)
        base += size
    under = _smaller(*best, own, site.hit.index)
    within, ior = site.within, site.material.ior
    outer = dr.select(under, ior, around)
    ratio = dr.select(within, ior / outer, outer / ior)
    # A sheet has no inside: light goes straight through.
    hidden = closed & under & (_most(site.material.kt) > 0) if s.features["nested media"] else None
    return Lens(dr.select(closed, ratio, 1), hidden)


def _smaller(size: Any, index: Any, other: Any, other_index: Any) -> Any:
    """Which of two solids' indices of refraction holds: that of the smaller; of equals, that which comes first."""
    return (size < other) | ((size == other) & (index < other_index))


def _most(colour: Any) -> Any:
    """The greatest of a colour's parts: whether there is any of it."""
    c = dr.detach(colour)
    return dr.maximum(dr.maximum(c.x, c.y), c.z)


def _inside(s: Scenery, site: Site, k: Kinship, group: Group, base: int, *state: Any) -> tuple:
    """The index of refraction, the size and the number of the smallest transparent solid, of those so far and those of
    a group, that holds the point: but that of the surface itself."""
    size, kt = len(k.names), group.material.kt

    def step(i: Any, around: Any, best: Any, number: Any) -> tuple:
        placed, radius, clear, ior = rows((group.placed, group.radius, kt, group.material.ior), i)
        f = k.kind.level(placed, dr.detach(site.surface.p))[0]
        index = i + base
        found = (f < 0) & (_most(clear) > 0) & (site.hit.index != index) & _smaller(radius, index, best, number)
        return tuple(dr.select(found, x, y) for x, y in ((ior, around), (radius, best), (index, number)))

    if size > tables.FEW:
        return s.repeated(size, dr.opaque(s.a.U, size), site.hit.valid, state, step)
    for i in range(size):
        state = step(s.a.U(i), *state)
    return state


def _strength(colour: Any) -> Any:
    """How strong a way for light is. One of strength 0 counts as 1 where its derivative is asked for."""
    most = _most(colour)
    return dr.select(most > 0, most, 1) if dr.grad_enabled(colour) else most


@dataclass(frozen=True)
class Bounce:
    """How a path goes on from a surface: its next ray, the weight of what that sees, and which ways it took."""

    ray: Ray
    weight: Any
    alive: Any
    scattered: Any


def scattered(s: Scenery, site: Site, j: Any) -> Bounce:
    """Ray number j of those that a matte surface scatters."""
    draw = site.draw.stream(SCATTER)
    u, v = draw.one() if j is None else draw.many(j, s.lots["scatter"])
    d = warp.cosine(site.n, u, v)
    yes = dr.full(s.a.B, True, dr.width(d))
    ray = site.leaving(unit(d, s.a.W), s.a.D(dr.dot(site.n, d))).exact()
    return Bounce(ray, site.material.kd, yes, yes)


def bounce(s: Scenery, site: Site, ray: Ray, lens: Lens | None, mirrors: Any, scatters: Any, j: Any = None) -> Bounce:
    """How a path goes on: `mirrors` and `scatters` are how many more reflections or refractions, and scatterings, it
    may have."""
    a, on, m = s.a, s.features, site.material
    kr = _strength(m.kr) if on["reflection"] else a.F(0)
    kt = _strength(m.kt) if on["refraction"] else a.F(0)
    shiny = kr + kt > 0
    n = dr.select(site.within, -site.surface.exact, site.surface.exact)
    cosine = -dr.dot(n, ray.d)
    d, weight, through = ray.d + (2 * cosine) * n, dr.zeros(a.V, 1), a.B(False)
    if on["reflection"]:
        weight = m.kr
    if on["refraction"]:
        chance = dr.select(shiny, kt / (kr + kt), 0)
        chosen = kt > 0
        if on["reflection"]:
            chosen = site.draw.stream(LOBE).one()[0] < chance
            weight = weight / dr.select(chosen, 1, 1 - chance)
        left = 1 - dr.square(lens.ratio) * (1 - dr.square(cosine))
        passes = left > 0
        bent = lens.ratio * ray.d + (lens.ratio * cosine - dr.sqrt(dr.select(passes, left, 0))) * n
        weight = dr.select(chosen, m.kt / dr.select(chosen, chance, 1), weight)
        through = chosen & passes
        d = dr.select(through, bent, d)
        if lens.buried is not None:
            straight = dr.select(lens.buried, ray.d, d)
            d, weight, through = straight, dr.select(lens.buried, 1, weight), through | lens.buried
    alive = shiny & (mirrors > 0)
    inside = site.within ^ through
    ray = replace(site.leaving(unit(d, a.W), dr.abs(dr.dot(n, d))).exact(), inside=inside)
    onward = Bounce(ray, weight, alive, a.B(False))
    if on["scatter"]:
        onward = _either(~shiny & (scatters > 0), scattered(s, site, j), onward)
    lit = onward.alive & site.hit.valid & (_strength(onward.weight) > 0)
    return Bounce(onward.ray, onward.weight, lit, onward.scattered)


def _either(first: Any, x: Bounce, y: Bounce) -> Bounce:
    """x where `first` holds, and y elsewhere."""
    ray = Ray(*(dr.select(first, p, q) for p, q in zip(_parts(x.ray), _parts(y.ray))))
    return Bounce(ray, dr.select(first, x.weight, y.weight), first | y.alive, first)


def missed(s: Scenery, d: Any) -> Any:
    """What a secondary ray sees that hits nothing."""
    return s.ambient if s.settings.misses == "ambient" else background(s, d)


def background(s: Scenery, d: Any) -> Any:
    """The sky in a direction: linear in its y, from bottom to top."""
    if not s.features["background"]:
        return s.a.V(0)
    up = 0.5 * s.a.F(d.y) + 0.5
    return dr.fma(s.sky.top - s.sky.bottom, up, s.sky.bottom)


def onward(s: Scenery, first: Site, ray: Ray, glass: Lens | None) -> Any:
    """The light that comes to a surface by way of others, as the ray sees it.

    One loop over the levels of one path after the other; written out where derivatives are asked for.
    """
    a, settings, lot, n = s.a, s.settings, s.lots["scatter"], dr.width(first.surface.p)
    mirrors, scatters = (dr.full(a.U, 0, n) + x for x in s.levels)
    b = bounce(s, first, ray, glass, mirrors, scatters, a.U(0))
    # Of what the eye sees, only a matte surface has more than one path.
    split = b.alive & b.scattered
    count = dr.select(split, lot.count, 1)
    share = dr.select(split, dr.rcp(a.F(lot.count)), 1)

    def begun(number: Any, b: Bounce, alive: Any) -> tuple:
        left = _left(a, b, mirrors, scatters)
        return a.U(number), dr.zeros(a.U, n), *left, *_parts(b.ray), b.weight * share, alive

    def level(number: Any, i: Any, mirrors: Any, scatters: Any, *rest: Any) -> tuple:
        *parts, weight, alive, total = rest
        path = Ray(*parts)
        hit = closest(Watch(a, s.kin, s.groups, path.o, shared=False), path, s.plain, alive)
        hit = Hit(hit.t, dr.select(alive, hit.index, NO_OBJECT))
        here = site(s, path, hit, first.draw.along(1 + number + (i << 16)))
        glass = lens(s, here)
        colour, own = shade(s, here), weight_of_local(s, here, glass)
        colour = dr.select(hit.valid, colour if own is None else colour * own, missed(s, path.d))
        total = dr.select(alive, total + weight * colour, total)
        b = bounce(s, here, path, glass, mirrors, scatters)
        left = _left(a, b, mirrors, scatters)
        return number, i + 1, *left, *_parts(b.ray), weight * b.weight, alive & b.alive, total

    def step(*state: Any) -> tuple:
        number, *rest, alive, total = level(*state)
        again = ~alive & (number + 1 < count)
        new = begun(number + 1, scattered(s, first, number + 1), again)
        state = tuple(dr.select(again, x, y) for x, y in zip(new, (number, *rest, alive)))
        return *state, total

    total = dr.zeros(a.V, n)
    if not s.attached:
        start = (dr.zeros(a.U, n) + begun(0, b, b.alive)[0], *begun(0, b, b.alive)[1:], total)
        return dr.while_loop(start, lambda *state: state[-2], step, label="paths")[-1]
    for number in range(max(settings.scatter.rays, 1)):
        state = begun(number, b if number == 0 else scattered(s, first, a.U(number)), b.alive if number == 0 else split)
        for _ in range(settings.depth + settings.scatter.depth):
            *state, total = level(*state, total)
    return total


def _parts(ray: Ray) -> tuple:
    return ray.o, ray.d, ray.source, ray.inside, ray.start


def _left(a: Any, b: Bounce, mirrors: Any, scatters: Any) -> tuple:
    """How many more reflections and scatterings a path may have after a bounce."""
    return mirrors - dr.select(b.scattered, a.U(0), 1), scatters - dr.select(b.scattered, a.U(1), 0)
