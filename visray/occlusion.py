"""Ambient occlusion: the share of ambient light that reaches a point, by rays over the hemisphere above it;
or the light of the background that they bring.

All rays have equal weight. Their density is proportional to the cosine of the angle to the normal, or, if
settings.occlusion.hemisphere is "box", that of the original program (warp.box).
"""

from typing import Any

import drjit as dr

from visray import warp
from visray.accel.culling import DirectionCone
from visray.accel.intersect import Target, closest, occluded
from visray.accel.origin import RayOrigin
from visray.background import background
from visray.interaction import Interaction, attached_distance
from visray.kernel_scene import KernelScene
from visray.ray import Ray

# Random dimensions (sampling.py) of the rays of both kinds. The third number for "box" comes from dimension + TURN.
SKY, NEAR, TURN = 2, 3, 6


def sky(s: KernelScene, si: Interaction) -> Any:
    """Visible share of the sky: the share of rays that hit nothing. Shapes: (N)."""

    def step(j: Any, visible: Any) -> tuple:
        ray, below = _ray(s, si, SKY, j)
        n = dr.width(visible)
        no_target = Target(dr.full(s.a.F, dr.inf, n), dr.zeros(s.a.F, n))
        is_occluded = occluded(origin, ray, no_target, si.hit.valid, s.brute_force)
        return (visible + dr.select(is_occluded | below, s.a.F(0), 1),)

    origin = _above(s, si)
    return _mean(s, si, "sky", s.settings.occlusion.sky, step)


def sky_light(s: KernelScene, si: Interaction) -> Any:
    """Light of the background that reaches a point: its mean over the rays, where those that hit something bring none.
    Shapes: (3, N)."""

    def step(j: Any, total: Any) -> tuple:
        ray, below = _ray(s, si, SKY, j)
        n = dr.width(total)
        no_target = Target(dr.full(s.a.F, dr.inf, n), dr.zeros(s.a.F, n))
        is_occluded = occluded(origin, ray, no_target, si.hit.valid, s.brute_force)
        return (total + dr.select(is_occluded | below, 0, background(s, ray.d)),)

    origin, count = _above(s, si), s.sample_sets["sky"].count
    start = (dr.zeros(s.a.V, dr.width(si.surface.p)),)
    return s.loop(count, si.hit.valid, start, step)[0] * dr.rcp(dr.maximum(s.a.F(count), 1))


def near(s: KernelScene, si: Interaction) -> Any:
    """Mean over rays of min(t / D, 1), where t is the distance of the first hit and D is settings.occlusion.distance.
    Shapes: (N)."""

    def step(j: Any, total: Any) -> tuple:
        ray, below = _ray(s, si, NEAR, j)
        hit = closest(origin, ray, s.brute_force, si.hit.valid, s.occlusion_distance)
        t = attached_distance(s, ray, hit) if s.attached else hit.t
        share = dr.select(hit.valid, s.a.F(t) * dr.rcp(s.a.F(s.occlusion_distance)), 1)
        return (total + dr.select(below, 0, share),)

    origin = _above(s, si)
    return _mean(s, si, "near", s.settings.occlusion.near, step)


def _mean(s: KernelScene, si: Interaction, name: str, n: int, step: Any) -> Any:
    """Mean over the rays of a set; 1 if the set has no rays. Shapes: (N).

    name: name of the set: "sky" or "near"
    n: number of rays
    step: function of (j, total) that adds the value of ray j to the total
    """
    count = s.sample_sets[name].count
    start = (dr.zeros(s.a.F, dr.width(si.surface.p)),)
    total = s.loop(count, si.hit.valid, start, step)[0]
    return dr.select(count > 0, total * dr.rcp(dr.maximum(s.a.F(count), 1)), 1)


def _ray(s: KernelScene, si: Interaction, dimension: int, j: Any) -> tuple[Ray, Any]:
    """Ray j from the surface point, in the hemisphere on the viewer's side, and a mask of the lanes in which it runs
    below the surface, because the normal for shading is not that of the surface.

    dimension: SKY for a ray of the set "sky", NEAR for a ray of the set "near"
    """
    rays = s.sample_sets["sky" if dimension == SKY else "near"]
    u, v = si.sample.dimension(dimension).set_point(j, rays)
    n = si.n
    if s.settings.occlusion.hemisphere == "box":
        d = warp.box(n, u, v, si.sample.dimension(dimension + TURN).set_number(j, rays))
    else:
        d = warp.cosine(n, u, v)
    cosine = dr.dot(n, d)
    below = s.a.B(False) if si.face is None else si.face_cosine(d, cosine) <= 0
    return si.spawn_ray(d, cosine), below


def _above(s: KernelScene, si: Interaction) -> RayOrigin:
    """The surface point as origin of rays in the hemisphere above it."""
    hemisphere = s.a.F32(1), s.a.F32(0)
    return si.origin.toward(DirectionCone(s.a.V32(dr.detach(si.n)), *hemisphere))
