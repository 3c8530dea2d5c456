"""Light that comes by way of other surfaces: reflected, refracted, scattered.

A path has one ray at each of its levels. Where a surface both reflects and lets through, one of the two is drawn, with
a chance by their strength. Of a matte surface that the eye sees, settings.scatter.rays paths are followed.

    I = (1 - kt) local + kr reflected + kt refracted, and matte: local + kd (mean of what comes over the hemisphere)

All of the light that is refracted is reflected where the angle is beyond the critical one (weight kt).
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray import warp
from visray.accel import policy
from visray.accel.culling import touches
from visray.accel.intersect import closest
from visray.accel.origin import RayOrigin
from visray.batches import Batch
from visray.interaction import Interaction, interact
from visray.kernel_scene import KernelScene
from visray.pytree import leaves, rows
from visray.ray import NO_ROW, Hit, Ray, unit
from visray.shading import shade

LOBE, SCATTER = 5, 6


@dataclass(frozen=True)
class Interface:
    """What rays pass at a refracting surface.

    ratio: the index of refraction on the viewer's side over that beyond. hidden: the surface lies in a smaller
    transparent solid, whose index holds there, so that nothing is seen of it; None where no solid can.
    """

    ratio: Any
    hidden: Any


def local_weight(s: KernelScene, si: Interaction, interface: Interface | None) -> Any:
    """How much of a surface's own colour is seen: 1 - kt, and nothing of one that is hidden; None for all of it."""
    if not s.features["refraction"]:
        return None
    kt = si.material.kt
    weight = 1 - kt if s.settings.local == "weighted" else s.a.V(1) + 0 * kt
    if interface is None or interface.hidden is None:
        return weight
    return dr.select(interface.hidden, 0, weight)


@dataclass(frozen=True)
class Medium:
    """What lies on one side of a surface: the index of refraction, the size and the row of the solid it is of."""

    ior: Any
    size: Any
    row: Any

    def or_in(self, where: Any, ior: Any, size: Any, row: Any) -> "Medium":
        """The medium where another solid is as well: the smaller one's index holds; of equals, the first one's."""
        other = where & ((size < self.size) | ((size == self.size) & (row < self.row)))
        return Medium(*(dr.select(other, x, y) for x, y in ((ior, self.ior), (size, self.size), (row, self.row))))


def interface(s: KernelScene, si: Interaction) -> Interface | None:
    """What a ray goes through at the surface. Where transparent solids overlap, the index of the smaller
    one holds (by the balls around them): so an inner one counts, wherever it stands in the file."""
    if not s.features["refraction"]:
        return None
    a, n = s.a, dr.width(si.surface.p)
    nothing = Medium(dr.full(a.D, 1, n), dr.full(a.D, dr.inf, n), dr.full(a.U, NO_ROW, n))
    before, beyond = nothing, nothing
    closed = dr.full(a.B, False, n)
    for batch in (b for b in s.batches if b.kind.closed):
        here = batch.has(si.hit.row)
        closed |= here
        size = dr.gather(a.D, batch.radius, dr.select(here, si.hit.row - batch.first_row, 0))
        own = si.material.ior, size, si.hit.row
        before, beyond = before.or_in(here & si.from_inside, *own), beyond.or_in(here & ~si.from_inside, *own)
        if s.features["nested media"]:
            before, beyond = _others(s, si, batch, before, beyond)
    # A sheet has no inside: light goes straight through, but where a solid begins or ends flush with it.
    ratio = before.ior / beyond.ior
    if not s.features["nested media"]:
        return Interface(ratio, None)
    return Interface(ratio, closed & (before.row == beyond.row) & (_most(si.material.kt) > 0))


def _others(s: KernelScene, si: Interaction, batch: Batch, before: Medium, beyond: Medium) -> tuple[Medium, Medium]:
    """The media on both sides, where the solids of a batch count too, but for that of the surface itself.

    One whose surface lies flush with it is on the one side or the other, as the ray leaves or enters it there.
    """
    size = len(batch)

    def step(i: Any, *state: Any) -> tuple:
        before, beyond = Medium(*state[:3]), Medium(*state[3:])
        one, material = batch.rows_at(i), rows(batch.material, i)
        p, row = dr.detach(si.surface.p), i + batch.first_row
        f, g = batch.kind.surface_at(one.placed, p)
        there = (_most(material.kt) > 0) & (si.hit.row != row)
        on, outwards = touches(one, f, g, p, si.surface.error), dr.dot(g, s.a.W(dr.detach(si.d))) > 0
        inside, solid = batch.kind.inside(one.placed, p), (material.ior, one.radius, row)
        before = before.or_in(there & dr.select(on, outwards, inside), *solid)
        beyond = beyond.or_in(there & dr.select(on, ~outwards, inside), *solid)
        return (*leaves(before), *leaves(beyond))

    state = (*leaves(before), *leaves(beyond))
    if size > policy.MAX_INLINED:
        state = s.loop(size, dr.opaque(s.a.U, size), si.hit.valid, state, step)
    else:
        for i in range(size):
            state = step(s.a.U(i), *state)
    return Medium(*state[:3]), Medium(*state[3:])


def _most(colour: Any) -> Any:
    """The greatest of a colour's parts: whether there is any of it."""
    c = dr.detach(colour)
    return dr.maximum(dr.maximum(c.x, c.y), c.z)


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


def scattered(s: KernelScene, si: Interaction, j: Any) -> Bounce:
    """Ray number j of those that a matte surface scatters."""
    dimension = si.sample.dimension(SCATTER)
    u, v = dimension.point() if j is None else dimension.set_point(j, s.sample_sets["scatter"])
    d = warp.cosine(si.n, u, v)
    yes = dr.full(s.a.B, True, dr.width(d))
    ray = si.spawn_ray(unit(d, s.a.W), s.a.D(dr.dot(si.n, d))).exact()
    return Bounce(ray, si.material.kd, yes, yes)


def bounce(
    s: KernelScene, si: Interaction, ray: Ray, interface: Interface | None, mirrors: Any, scatters: Any, j: Any = None
) -> Bounce:
    """How a path goes on: `mirrors` and `scatters` are how many more reflections or refractions, and scatterings, it
    may have."""
    a, on, m = s.a, s.features, si.material
    kr = _strength(m.kr) if on["reflection"] else a.F(0)
    kt = _strength(m.kt) if on["refraction"] else a.F(0)
    shiny = kr + kt > 0
    matte = (_most(m.kr) + _most(m.kt) == 0) & (_strength(m.kd) > 0) if on["scatter"] else None
    n = dr.select(si.from_inside, -si.surface.exact, si.surface.exact)
    cosine = -dr.dot(n, ray.d)
    d, weight, through = ray.d + (2 * cosine) * n, dr.zeros(a.V, 1), a.B(False)
    if on["reflection"]:
        weight = m.kr
    if on["refraction"]:
        chance = dr.select(shiny, kt / (kr + kt), 0)
        chosen = kt > 0
        if on["reflection"]:
            chosen = si.sample.dimension(LOBE).point()[0] < chance
            weight = weight / dr.select(chosen, 1, 1 - chance)
        left = 1 - dr.square(interface.ratio) * (1 - dr.square(cosine))
        passes = left > 0
        bent = interface.ratio * ray.d + (interface.ratio * cosine - dr.sqrt(dr.select(passes, left, 0))) * n
        weight = dr.select(chosen, m.kt / dr.select(chosen, chance, 1), weight)
        through = chosen & passes
        d = dr.select(through, bent, d)
        if (hidden := interface.hidden) is not None:
            d, weight, through = dr.select(hidden, ray.d, d), dr.select(hidden, 1, weight), through | hidden
    alive = shiny & (mirrors > 0)
    inside = si.from_inside ^ through
    ray = replace(si.spawn_ray(unit(d, a.W), dr.abs(dr.dot(n, d))).exact(), inside=inside)
    further = Bounce(ray, weight, alive, a.B(False))
    if on["scatter"]:
        further = _either(matte & (scatters > 0), scattered(s, si, j), further)
    lit = further.alive & si.hit.valid & (_strength(further.weight) > 0)
    return Bounce(further.ray, further.weight, lit, further.scattered)


def _either(first: Any, x: Bounce, y: Bounce) -> Bounce:
    """x where `first` holds, and y elsewhere."""
    ray = _ray(*(dr.select(first, p, q) for p, q in zip(_state(x.ray), _state(y.ray))))
    return Bounce(ray, dr.select(first, x.weight, y.weight), first | y.alive, first)


def miss_radiance(s: KernelScene, d: Any) -> Any:
    """What a secondary ray sees that hits nothing."""
    return s.ambient if s.settings.misses == "ambient" else background(s, d)


def background(s: KernelScene, d: Any) -> Any:
    """The sky in a direction: linear in its y, from bottom to top."""
    if not s.features["background"]:
        return s.a.V(0)
    up = 0.5 * s.a.F(d.y) + 0.5
    return dr.fma(s.sky.top - s.sky.bottom, up, s.sky.bottom)


def indirect(s: KernelScene, first: Interaction, ray: Ray, glass: Interface | None) -> Any:
    """The light that comes to a surface by way of others, as the ray sees it.

    One loop over the levels of one path after the other; written out where derivatives are asked for.
    """
    a, settings, rays, n = s.a, s.settings, s.sample_sets["scatter"], dr.width(first.surface.p)
    mirrors, scatters = (dr.full(a.U, 0, n) + x for x in s.bounce_limits)
    # What never changes is no state of the loop (as in integrator.sample): there is one path, and nothing scatters.
    first_number = dr.zeros(a.U, n) if s.features["scatter"] else None
    scatters = scatters if s.features["scatter"] else None
    b = bounce(s, first, ray, glass, mirrors, scatters, a.U(0))
    # Of what the eye sees, only a matte surface has more than one path.
    split = b.alive & b.scattered
    count = dr.select(split, rays.count, 1)
    share = dr.select(split, dr.rcp(a.F(rays.count)), 1)

    def begun(number: Any, b: Bounce, alive: Any) -> tuple:
        left = _left(a, b, mirrors, scatters)
        return number, dr.zeros(a.U, n), *left, *_state(b.ray), b.weight * share, alive

    def level(number: Any, i: Any, mirrors: Any, scatters: Any, *rest: Any) -> tuple:
        *state, weight, alive, total = rest
        path = _ray(*state)
        hit = closest(RayOrigin(s.geometry, path.o, shared=False), path, s.brute_force, alive)
        hit = Hit(hit.t, dr.select(alive, hit.row, NO_ROW), hit.part)
        here = interact(s, path, hit, first.sample.derived(1 + (0 if number is None else number) + (i << 16)))
        glass = interface(s, here)
        colour, own = shade(s, here), local_weight(s, here, glass)
        colour = dr.select(hit.valid, colour if own is None else colour * own, miss_radiance(s, path.d))
        total = dr.select(alive, total + weight * colour, total)
        b = bounce(s, here, path, glass, mirrors, scatters)
        left = _left(a, b, mirrors, scatters)
        return number, i + 1, *left, *_state(b.ray), weight * b.weight, alive & b.alive, total

    def step(*state: Any) -> tuple:
        number, *rest, alive, total = level(*state)
        if not s.features["scatter"]:
            return number, *rest, alive, total
        again = ~alive & (number + 1 < count)
        new = begun(number + 1, scattered(s, first, number + 1), again)
        state = tuple(dr.select(again, x, y) for x, y in zip(new, (number, *rest, alive)))
        return *state, total

    total = dr.zeros(a.V, n)
    if not s.attached:
        start = *begun(first_number, b, b.alive), total
        return dr.while_loop(start, lambda *state: state[-2], step, label="paths")[-1]
    mirrored = s.features["reflection"] or s.features["refraction"]
    for k in range(settings.scatter.rays if s.features["scatter"] else 1):
        number = None if first_number is None else first_number + k
        state = begun(number, b if k == 0 else scattered(s, first, a.U(k)), b.alive if k == 0 else split)
        for _ in range(settings.depth * mirrored + settings.scatter.depth * s.features["scatter"]):
            *state, total = level(*state, total)
    return total


def _state(ray: Ray) -> tuple:
    """A ray as the state of a loop: its part only where hits have any."""
    state = ray.o, ray.d, ray.row, ray.inside, ray.clearance
    return state if ray.part is None else (*state, ray.part)


def _ray(o: Any, d: Any, row: Any, inside: Any, start: Any, part: Any = None) -> Ray:
    return Ray(o, d, row, inside, start, part=part)


def _left(a: Any, b: Bounce, mirrors: Any, scatters: Any) -> tuple:
    """How many more reflections, and scatterings if any, a path may have after a bounce."""
    fewer = None if scatters is None else scatters - dr.select(b.scattered, a.U(1), 0)
    return mirrors - dr.select(b.scattered, a.U(0), 1), fewer
