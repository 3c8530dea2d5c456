"""Radiance and layers along rays, composed from the effects that are present."""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray import sampling
from visray.features import Features
from visray.film import Moments
from visray.geometry import facing
from visray.quantities import Arrays
from visray.ray import Ray, unit
from visray.scene.scene import Gradient
from visray.search import Watch, closest
from visray.shading import Scenery, blinn_phong, feel, scenery
from visray.tables import Kinship, Ready, View


@dataclass(frozen=True)
class Stage:
    """A scene ready to be looked at: scenery, camera, sky, and the watch kept from the camera."""

    scenery: Scenery
    view: View
    sky: Gradient
    watch: Watch
    opaque: Any


def stage(
    ready: Ready, kin: tuple[Kinship, ...], features: Features, a: Arrays, opaque: bool, plain: bool = False
) -> Stage:
    """The scene as the camera sees it. `opaque`: whether the film counts as covered where nothing is hit."""
    watch = Watch(a, kin, ready.groups, ready.view.o)
    alpha = dr.opaque(a.F, float(opaque))
    return Stage(scenery(ready, kin, features, a, plain), ready.view, ready.background, watch, alpha)


def camera_ray(s: Stage, x: Any, y: Any) -> Ray:
    """The ray through the point (x, y) of the picture, in pixels from its top left corner."""
    a = s.scenery.a
    d = dr.normalize(s.view.corner + x * s.view.right + y * s.view.down)
    return Ray(s.view.o, unit(d, a.W))


def radiance(s: Stage, ray: Ray) -> tuple[Any, Any]:
    """The colour along a ray, and how much of it the film counts as covered."""
    a, on = s.scenery.a, s.scenery.features
    sky = a.V(0)
    if on["background"]:
        up = 0.5 * a.F(ray.d.y) + 0.5
        sky = dr.fma(s.sky.top - s.sky.bottom, up, s.sky.bottom)
    hit = closest(s.watch, ray, s.scenery.plain)
    surface, material, _, _ = feel(s.scenery, ray, hit)
    colour = dr.select(hit.valid, blinn_phong(s.scenery, ray, hit, surface, material), sky)
    return colour, dr.select(hit.valid, 1, s.opaque)


def sample(s: Stage, plan: sampling.Plan, x: Any, y: Any) -> Moments:
    """The samples of one pass over the pixels (x, y): one lane a pixel, a symbolic loop over its samples."""
    a, n = s.scenery.a, dr.width(x)
    key = sampling.pixel_key(plan, x, y)
    left, top = a.F(x), a.F(y)

    def body(i: Any, cell: Any, reference: Any, total: Any, squares: Any, coverage: Any) -> tuple:
        jx, jy = sampling.in_pixel(plan, key, i + plan.first, cell, a.F)
        colour, covered = radiance(s, camera_ray(s, left + jx, top + jy))
        reference = dr.select(i == 0, dr.detach(colour), reference)
        delta = colour - reference
        squares = squares + dr.square(dr.detach(delta))
        if s.scenery.features["coverage"]:
            coverage = coverage + covered
        return i + 1, sampling.next_cell(plan, cell), reference, total + delta, squares, coverage

    start = (
        dr.zeros(a.U, n),
        sampling.first_cell(plan, key, a.F),
        *(dr.zeros(a.V, n) for _ in range(3)),
        dr.zeros(a.F, n),
    )
    done = dr.while_loop(start, lambda i, *_: i < plan.count, body, max_iterations=-1, label="samples")
    return Moments(*done[2:])


@dataclass(frozen=True)
class FirstHit:
    """The data layers of the first hit at each pixel's centre: distances are inf and the others 0 where nothing is
    hit."""

    index: Any
    distance: Any
    depth: Any
    p: Any
    n: Any
    u: Any
    v: Any
    albedo: Any


def first_hit(s: Stage, x: Any, y: Any) -> FirstHit:
    """What the ray through each pixel's centre hits first."""
    a = s.scenery.a
    ray = camera_ray(s, a.F(x) + 0.5, a.F(y) + 0.5)
    hit = closest(s.watch, ray)
    surface, material, u, v = feel(s.scenery, ray, hit)
    n = facing(surface.n, a.V(ray.d))[0]
    depth = a.F(hit.t * dr.dot(ray.d, a.W(s.view.forward)))
    shown = (dr.select(hit.valid, x, 0) for x in (a.V(surface.p), n, u, v, material.kd))
    return FirstHit(hit.index, a.F(hit.t), depth, *shown)
