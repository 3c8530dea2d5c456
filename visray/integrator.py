"""Radiance and layers along rays, composed from the effects that are present."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray import paths, sampling, warp
from visray.features import Features
from visray.geometry import UNIT_ROUNDOFF
from visray.moments import BLOCK, Moments, offset
from visray.quantities import Arrays
from visray.ray import Hit, Ray, unit
from visray.sampling import Draw
from visray.scene.scene import Scene
from visray.scenery import Scenery, scenery, site
from visray.search import Watch, closest
from visray.shading import shade
from visray.tables import Kinship, Ready, View
from visray.trees import rows

LENS = 1


@dataclass(frozen=True)
class Stage:
    """A scene ready to be looked at: scenery, camera, and the watch kept from the camera's middle."""

    scenery: Scenery
    view: View
    watch: Watch
    opaque: Any


def stage(
    ready: Ready, kin: tuple[Kinship, ...], scene: Scene, features: Features, a: Arrays, plain: bool = False
) -> Stage:
    """The scene as the camera sees it."""
    watch = Watch(a, kin, ready.groups, ready.view.o)
    # Whether the film counts as covered where nothing is hit.
    alpha = dr.opaque(a.F, float(not scene.film.transparent))
    return Stage(scenery(ready, kin, scene, features, a, plain), ready.view, watch, alpha)


def camera_ray(s: Stage, x: Any, y: Any) -> Ray:
    """The ray through the point (x, y) of the picture, in pixels from its top left corner."""
    a = s.scenery.a
    d = dr.normalize(s.view.corner + x * s.view.right + y * s.view.down)
    return Ray(s.view.o, unit(d, a.W))


def lens_ray(s: Stage, x: Any, y: Any, u: Any, v: Any) -> Ray:
    """The ray from the lens's point for (u, v) in the unit square to where the camera's ray through (x, y) is sharp."""
    a = s.scenery.a
    across, up = warp.disk(a.D(u), a.D(v))
    aside = across * s.view.aside + up * s.view.above
    straight = s.view.corner + x * s.view.right + y * s.view.down
    return Ray(s.view.o + aside, unit(dr.normalize(straight - a.V(aside * s.view.sharp)), a.W))


def first_draw(s: Stage, n: int) -> Draw:
    """The random numbers of the only sample of n pixels, where none are given."""
    a = s.scenery.a
    plan = sampling.Plan.of(a, 0, 1, 0, 1)
    lane = dr.arange(a.U, n)
    return Draw(s.scenery.settings.sampler, a.F, plan, sampling.mix(lane), plan.first + 0 * lane, 0 * lane)


def radiance(s: Stage, ray: Ray, draw: Draw | None = None) -> tuple[Any, Any]:
    """The colour along a ray from the camera, and how much of it the film counts as covered."""
    kept, on = s.scenery, s.scenery.features
    draw = draw or first_draw(s, max(dr.width(ray.d), dr.width(ray.o)))
    watch = Watch(kept.a, kept.kin, kept.groups, ray.o, shared=False) if on["defocus"] else s.watch
    hit = closest(watch, ray, kept.plain)
    here = site(kept, ray, hit, draw)
    colour = shade(kept, here)
    if on["paths"]:
        lens = paths.lens(kept, here)
        own = paths.weight_of_local(kept, here, lens)
        colour = (colour if own is None else colour * own) + paths.onward(kept, here, ray, lens)
    sky = kept.a.V(0) if kept.transparent else paths.background(kept, ray.d)
    return dr.select(hit.valid, colour, sky), dr.select(hit.valid, 1, s.opaque)


def sample(s: Stage, plan: sampling.Plan, x: Any, y: Any, moments: Moments) -> Moments:
    """The moments of the pixels (x, y) after one more pass: one lane a pixel, a symbolic loop over its blocks, and in
    that one over the samples of a block.

    What no sample changes is no state of the loops: Dr.Jit would trace all of it once more, to take that out.
    """
    a, end = s.scenery.a, plan.first + plan.count
    key, seen = _seen(s, plan, x, y)
    covers = s.scenery.features["coverage"]

    def step(i: Any, cell: Any, *state: Any) -> tuple:
        more = Moments(None, None, None, *state).plus(offset(i) == 0, *seen(i, cell))
        return i + 1, sampling.next_cell(plan, cell), *more.parts[3:]

    def block(i: Any, cell: Any, mean: Any, squares: Any, coverage: Any, *state: Any) -> tuple:
        stop = dr.minimum(end, (i | (BLOCK - 1)) + 1)
        i, cell, *state = dr.while_loop((i, cell, *state), lambda i, *_: i < stop, step, label="samples")
        return i, cell, *Moments(mean, squares, coverage, *state).joined(a, offset(i) == 0, i - BLOCK, BLOCK).parts

    before = moments if covers else replace(moments, coverage=None, open_coverage=None)
    start = dr.zeros(a.U, dr.width(x)) + plan.first, sampling.first_cell(plan, key, a.F), *before.parts
    _, _, *state = dr.while_loop(start, lambda i, *_: i < end, block, label="blocks")
    after = Moments(*state)
    return after if covers else replace(after, coverage=moments.coverage, open_coverage=moments.open_coverage)


def attached(s: Stage, plan: sampling.Plan, x: Any, y: Any) -> Any:
    """The mean colour of the samples of one pass over the pixels (x, y), with its derivatives: one loop over all
    samples, as Dr.Jit 1.5 has no derivatives of loops within loops."""
    a, n = s.scenery.a, dr.width(x)
    key, seen = _seen(s, plan, x, y)

    def step(i: Any, cell: Any, reference: Any, total: Any) -> tuple:
        colour, _ = seen(i + plan.first, cell)
        reference = dr.select(i == 0, dr.detach(colour), reference)
        return i + 1, sampling.next_cell(plan, cell), reference, total + (colour - reference)

    start = dr.zeros(a.U, n), sampling.first_cell(plan, key, a.F), dr.zeros(a.V, n), dr.zeros(a.V, n)
    _, _, reference, total = dr.while_loop(
        start, lambda i, *_: i < plan.count, step, max_iterations=-1, label="samples"
    )
    return reference + total * (1 / a.F(plan.count))


def _seen(s: Stage, plan: sampling.Plan, x: Any, y: Any) -> tuple[Any, Callable[[Any, Any], tuple[Any, Any]]]:
    """The keys of the pixels (x, y), and what a sample of them sees, by its index and stratum: its colour, and how much
    of it is covered."""
    a, key = s.scenery.a, sampling.pixel_key(plan, x, y)
    left, top = a.F(x), a.F(y)

    def seen(index: Any, cell: Any) -> tuple[Any, Any]:
        draw = Draw(s.scenery.settings.sampler, a.F, plan, key, index, cell)
        jx, jy = draw.pixel()
        if s.scenery.features["defocus"]:
            ray = lens_ray(s, left + jx, top + jy, *draw.stream(LENS).one())
        else:
            ray = camera_ray(s, left + jx, top + jy)
        return radiance(s, ray, draw)

    return key, seen


@dataclass(frozen=True)
class FirstHit:
    """The data layers of the first hit at each pixel's centre: distances are inf and the others 0 where nothing is
    hit. unresolved, residual: the certificate of what is searched for; None where nothing is."""

    index: Any
    distance: Any
    depth: Any
    p: Any
    n: Any
    u: Any
    v: Any
    albedo: Any
    unresolved: Any
    residual: Any


def first_hit(s: Stage, x: Any, y: Any) -> FirstHit:
    """What the ray through each pixel's centre hits first."""
    a = s.scenery.a
    ray = camera_ray(s, a.F(x) + 0.5, a.F(y) + 0.5)
    hit = closest(s.watch, ray)
    here = site(s.scenery, ray, hit)
    depth = a.F(hit.t * dr.dot(ray.d, a.W(s.view.forward)))
    p, kd = a.V(here.surface.p), here.material.kd
    shown = (dr.select(hit.valid, x, 0) for x in (p, here.n, here.u, here.v, kd))
    return FirstHit(hit.index, a.F(hit.t), depth, *shown, *certificate(s, ray, hit, here.surface.p))


def certificate(s: Stage, ray: Ray, hit: Hit, p: Any) -> tuple[Any, Any]:
    """Of the objects whose crossings are searched for: how many parts of a ray are unresolved, and the distance of the
    point p that is seen from its surface, to first order, in units in the last place of the largest coordinate, its own
    or the eye's."""
    a, kept = s.scenery.a, s.scenery
    if not any(k.kind.searched for k in kept.kin):
        return None, None
    unresolved, residual = dr.zeros(a.U, dr.width(ray.d)), dr.zeros(a.F, dr.width(ray.d))
    base = 0
    for number, (k, group) in enumerate(zip(kept.kin, kept.groups)):
        n, first = len(k.names), base
        base += n
        if not k.kind.searched:
            continue

        def step(i: Any, total: Any, k: Kinship = k, number: int = number) -> tuple:
            return (total + k.kind.unresolved(rows(s.watch.sights[number], i), ray),)

        unresolved = kept.repeated(n, dr.opaque(a.U, n), a.B(True), (unresolved,), step)[0]
        here = (hit.index >= first) & (hit.index < base)
        f, _ = k.kind.level(rows(group.placed, dr.select(here, hit.index - first, 0)), p)
        largest = [dr.maximum(dr.maximum(dr.abs(v.x), dr.abs(v.y)), dr.abs(v.z)) for v in (p, ray.o)]
        ulp = 2 * UNIT_ROUNDOFF["double"] * dr.maximum(*largest)
        residual = dr.select(here, a.F(dr.abs(f) / dr.select(here, ulp, 1)), residual)
    return unresolved, residual
