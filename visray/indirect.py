"""Indirect light: light that reaches a surface from other surfaces, by reflection, refraction and scattering.

A path has one ray from each of its vertices. If a surface both reflects and refracts, one of the two is chosen at
random, with probability proportional to its strength. At a matte surface that the camera sees, settings.scatter.rays
paths start; at all other surfaces, one path continues.

For surfaces that reflect or refract, the light I that leaves the surface is

    I = (1 - kt) local + kr reflected + kt refracted

and for matte surfaces, with the cosine of the angle to the normal as weight in the mean,

    I = local + kd (mean of the light over the hemisphere)

`local` is the light that the surface sends without light from other surfaces (shading.py). Beyond the critical angle
all refracted light is reflected instead, with weight kt.

If the material has `fresnel`, with its share f (media.fresnel_share),

    dielectric   I = (1 - f) (1 - kt) local + f kr reflected + (1 - f) kt refracted
    metal        I = (1 - f) local + (kr + (1 - kr) f) reflected

No more light leaves such a surface than arrives if kr, kt and the albedo of `local` are at most 1, and for a metal the
sum of kr and this albedo. Beyond the critical angle f is 1, so that all light is reflected, with weight kr.

Light that runs a length d in an absorbing medium is multiplied by exp(-absorption d) (media.transmitted).
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray import warp
from visray.accel.intersect import closest
from visray.accel.origin import RayOrigin
from visray.background import background
from visray.interaction import Interaction, interact
from visray.kernel_scene import KernelScene
from visray.media import (
    Interface,
    interface_at,
    local_weight,
    max_component,
    mirror_normal,
    reflected_share,
    refracted_share,
    transmitted,
)
from visray.ray import NO_ROW, Hit, Ray, unit
from visray.sampling import SampleSet
from visray.shading import shade
from visray.visible_lights import SeenLight, nearest_light

# Random dimensions (sampling.py): the choice between reflection and refraction, and the direction of scattering.
LOBE, SCATTER = 5, 6


def _strength(colour: Any, asked: bool) -> Any:
    """Largest component of a colour: the weight for choosing one of several bounces. If derivatives with respect to the
    colour are asked for, a strength of 0 becomes 1, because a bounce that adds no light may still add to the
    derivative."""
    strength = max_component(colour)
    return dr.select(strength > 0, strength, 1) if asked else strength


@dataclass(frozen=True)
class Bounce:
    """The continuation of a path from a surface.

    ray: the next ray
    weight: colour by which the light along the next ray is multiplied
    alive: mask of the lanes in which the path continues
    scattered: mask of the lanes in which the bounce is scattering; elsewhere it is reflection or refraction
    """

    ray: Ray
    weight: Any
    alive: Any
    scattered: Any


def scattered(s: KernelScene, si: Interaction, j: Any, starts: SampleSet | None = None) -> Bounce:
    """A bounce by scattering at a matte surface.

    j: number of the path, if several paths start at this surface; None at later vertices of a path
    starts: set of the paths that start at the surface; by default that of the first surface
    """
    dimension = si.sample.dimension(SCATTER)
    u, v = dimension.point() if j is None else dimension.set_point(j, starts or s.sample_sets["scatter"])
    d = warp.cosine(si.n, u, v)
    always = dr.full(s.a.B, True, dr.width(d))
    cosine = s.a.D(dr.dot(si.n, d))
    ray = si.spawn_ray(unit(d, s.a.W), cosine).exact()
    # A direction above the normal for shading may be below the surface; no light comes from there.
    alive = always if si.face is None else si.face_cosine(d, cosine) > 0
    return Bounce(ray, si.material.kd, alive, always)


def bounce(
    s: KernelScene,
    si: Interaction,
    ray: Ray,
    interface: Interface | None,
    specular_left: Any,
    scatters_left: Any,
    j: Any = None,
    starts: SampleSet | None = None,
) -> Bounce:
    """The continuation of a path at a surface.

    ray: ray that reaches the surface
    interface: media at the surface; None in scenes without refraction
    specular_left: number of reflections and refractions that are still allowed
    scatters_left: number of scatterings that are still allowed
    j, starts: as in `scattered`
    """
    a, effects, m, asked = s.a, s.features, si.material, s.asked
    of_mirror = reflected_share(si, interface) if effects["reflection"] else None
    of_glass = refracted_share(si, interface) if effects["refraction"] else None
    kr = _strength(of_mirror, "kr" in asked) if effects["reflection"] else a.F(0)
    kt = _strength(of_glass, "kt" in asked) if effects["refraction"] else a.F(0)
    shiny, matte = kr + kt > 0, None
    if effects["scatter"]:
        matte = (max_component(m.kr) + max_component(m.kt) == 0) & (_strength(m.kd, "kd" in asked) > 0)
        matte = matte & (m.shading == 0) if effects["unlit"] else matte
    n, face = mirror_normal(si)
    cosine = -dr.dot(n, ray.d)
    d, weight, through = ray.d + (2 * cosine) * n, dr.zeros(a.V, 1), a.B(False)
    if effects["reflection"]:
        weight = of_mirror
    if effects["refraction"]:
        p_refract = dr.select(shiny, kt / (kr + kt), 0)
        refracts = kt > 0
        if effects["reflection"]:
            refracts = si.sample.dimension(LOBE).point()[0] < p_refract
            weight = weight / dr.select(refracts, 1, 1 - p_refract)
        cos2_refracted = 1 - dr.square(interface.ratio) * (1 - dr.square(cosine))
        transmits = cos2_refracted > 0
        cos_refracted = dr.sqrt(dr.select(transmits, cos2_refracted, 0))
        refracted = interface.ratio * ray.d + (interface.ratio * cosine - cos_refracted) * n
        weight = dr.select(refracts, of_glass / dr.select(refracts, p_refract, 1), weight)
        through = refracts & transmits
        d = dr.select(through, refracted, d)
        if (hidden := interface.hidden) is not None:
            d, weight, through = dr.select(hidden, ray.d, d), dr.select(hidden, 1, weight), through | hidden
    if si.face is not None:
        # The normal for shading may give a direction on the wrong side of the surface. It is mirrored at the surface.
        across = dr.dot(face, d)
        d = dr.select((across < 0) ^ through, d - (2 * across) * face, d)
    alive = shiny & (specular_left > 0)
    inside = si.from_inside ^ through
    ray = replace(si.spawn_ray(unit(d, a.W), dr.abs(dr.dot(n, d))).exact(), inside=inside)
    result = Bounce(ray, weight, alive, a.B(False))
    if effects["scatter"]:
        result = _either(matte & (scatters_left > 0), scattered(s, si, j, starts), result)
    alive_and_lit = (
        result.alive & si.hit.valid & (_strength(result.weight, not asked.isdisjoint(("kr", "kt", "kd"))) > 0)
    )
    return Bounce(result.ray, result.weight, alive_and_lit, result.scattered)


def _either(use_x: Any, x: Bounce, y: Bounce) -> Bounce:
    """Bounce x in lanes where `use_x` is true, else bounce y. x is a scattering, y a reflection or refraction."""
    ray = _ray(*(dr.select(use_x, p, q) for p, q in zip(_state(x.ray), _state(y.ray))))
    return Bounce(ray, dr.select(use_x, x.weight, y.weight), dr.select(use_x, x.alive, y.alive), use_x)


def miss_radiance(s: KernelScene, d: Any) -> Any:
    """Light along a ray after a bounce that hits nothing. d: direction of the ray."""
    return s.ambient if s.settings.misses == "ambient" else background(s, d)


def light_before(s: KernelScene, ray: Ray, hit: Hit, scatters_left: Any) -> SeenLight | None:
    """The visible lights that rays meet before what they hit; None if no light is visible.

    scatters_left: number of scatterings that are still allowed; None without scattering
    """
    if not s.visible_lights:
        return None
    lamp = nearest_light(s.visible_lights, ray, hit)
    if scatters_left is None:
        return lamp
    # A surface that has scattered the path gets the light of all lights directly.
    return replace(lamp, met=lamp.met & (scatters_left == s.bounce_limits[1]))


def indirect(s: KernelScene, first: Interaction, ray: Ray, first_interface: Interface | None) -> Any:
    """The light that reaches a surface from other surfaces and leaves it towards the camera. Shapes: (3, N).

    first: the surface that the camera ray hits
    ray: the camera ray
    first_interface: media at this surface; None in scenes without refraction

    One loop runs over the vertices of all paths, one path after the other. Derivatives follow paths in another way
    (wavefront.py).
    """
    a, rays, n = s.a, s.sample_sets["scatter"], dr.width(first.surface.p)
    specular_left, scatters_left = (dr.full(a.U, 0, n) + limit for limit in s.bounce_limits)
    # Values that never change are not part of the loop state (as in integrator.sample). Without scattering there is
    # only one path; its number, and the number of scatterings left, never change.
    first_path = dr.zeros(a.U, n) if s.features["scatter"] else None
    scatters_left = scatters_left if s.features["scatter"] else None
    first_bounce = bounce(s, first, ray, first_interface, specular_left, scatters_left, a.U(0))
    # Several paths start only at a matte surface that the camera sees.
    splits = first_bounce.alive & first_bounce.scattered
    path_count = dr.select(splits, rays.count, 1)
    path_weight = dr.select(splits, dr.rcp(a.F(rays.count)), 1)

    def path_start(number: Any, b: Bounce, alive: Any) -> tuple:
        limits = limits_after(a, b, specular_left, scatters_left)
        return number, dr.zeros(a.U, n), *limits, *_state(b.ray), b.weight * path_weight, alive

    def extend(number: Any, i: Any, specular_left: Any, scatters_left: Any, *rest: Any) -> tuple:
        *state, weight, alive, total = rest
        ray = _ray(*state)
        hit = closest(RayOrigin(s.geometry, ray.o, shared=False), ray, s.brute_force, alive)
        hit = Hit(hit.t, dr.select(alive, hit.row, NO_ROW), hit.part)
        si = interact(s, ray, hit, first.sample.derived(1 + (0 if number is None else number) + (i << 16)))
        media = interface_at(s, si)
        lamp = light_before(s, ray, hit, scatters_left)
        if (passed := transmitted(s, si, media, lamp)) is not None:
            weight = weight * passed
        colour, own_weight = shade(s, si), local_weight(s, si, media)
        colour = dr.select(hit.valid, colour if own_weight is None else colour * own_weight, miss_radiance(s, ray.d))
        colour = colour if lamp is None else lamp.over(colour)
        total = dr.select(alive, total + weight * colour, total)
        b = bounce(s, si, ray, media, specular_left, scatters_left)
        alive = alive if lamp is None else alive & ~lamp.met
        limits = limits_after(a, b, specular_left, scatters_left)
        return number, i + 1, *limits, *_state(b.ray), weight * b.weight, alive & b.alive, total

    def step(*state: Any) -> tuple:
        number, *rest, alive, total = extend(*state)
        if not s.features["scatter"]:
            return number, *rest, alive, total
        starts_next = ~alive & (number + 1 < path_count)
        next_path = path_start(number + 1, scattered(s, first, number + 1), starts_next)
        state = tuple(dr.select(starts_next, x, y) for x, y in zip(next_path, (number, *rest, alive)))
        return *state, total

    start = *path_start(first_path, first_bounce, first_bounce.alive), dr.zeros(a.V, n)
    return dr.while_loop(start, lambda *state: state[-2], step, label="paths")[-1]


def _state(ray: Ray) -> tuple:
    """The arrays of a ray, as a tuple for the state of a loop: o, d, row, inside, clearance, and part unless it is
    None."""
    state = ray.o, ray.d, ray.row, ray.inside, ray.clearance
    return state if ray.part is None else (*state, ray.part)


def _ray(o: Any, d: Any, row: Any, inside: Any, clearance: Any, part: Any = None) -> Ray:
    """The ray with the arrays that `_state` returns."""
    return Ray(o, d, row, inside, clearance, part=part)


def limits_after(a: Any, b: Bounce, specular_left: Any, scatters_left: Any) -> tuple:
    """Numbers of bounces that are still allowed after bounce b: of reflections and refractions, and of scatterings
    (None if none are simulated)."""
    remaining = None if scatters_left is None else scatters_left - dr.select(b.scattered, a.U(1), 0)
    return specular_left - dr.select(b.scattered, a.U(0), 1), remaining
