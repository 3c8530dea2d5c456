"""Ambient occlusion: how much ambient light gets to a point, by rays over the hemisphere above it.

Rays are drawn by their cosine with the normal, so that each counts alike.
"""

from typing import Any

import drjit as dr

from visray import warp
from visray.ray import Ray
from visray.scenery import Scenery, Site, feel
from visray.search import blocked, closest

SKY, NEAR, TURN = 2, 3, 4


def sky(s: Scenery, site: Site) -> Any:
    """The share of the sky that is seen: of the rays that meet nothing."""

    def step(j: Any, seen: Any) -> tuple:
        ray = _ray(s, site, SKY, j)
        nothing = dr.zeros(s.a.D, dr.width(seen))
        ray = Ray(ray.o, ray.d, ray.source, ray.inside, ray.start, nothing)
        hidden = blocked(site.watch, ray, nothing + dr.inf, None, None, site.hit.valid, s.plain)
        return (seen + dr.select(hidden, s.a.F(0), 1),)

    return _mean(s, site, "sky", s.settings.occlusion.sky, step)


def near(s: Scenery, site: Site) -> Any:
    """The mean over rays of the distance to what they meet, as a share of settings.occlusion.distance, at most 1."""

    def step(j: Any, free: Any) -> tuple:
        ray = _ray(s, site, NEAR, j)
        hit = closest(site.watch, ray, s.plain, site.hit.valid, s.reach)
        t = hit.t
        if s.attached:
            ray = ray.exact()
            t = dr.dot(feel(s, ray, hit)[0].p - ray.o, ray.d)
        return (free + dr.select(hit.valid, s.a.F(t) * dr.rcp(s.a.F(s.reach)), 1),)

    return _mean(s, site, "near", s.settings.occlusion.near, step)


def _mean(s: Scenery, site: Site, name: str, n: int, step: Any) -> Any:
    """The mean of what `step` adds up; 1 where there are no rays."""
    count = s.lots[name].count
    start = (dr.zeros(s.a.F, dr.width(site.surface.p)),)
    total = s.repeated(n, count, site.hit.valid, start, step)[0]
    return dr.select(count > 0, total * dr.rcp(dr.maximum(s.a.F(count), 1)), 1)


def _ray(s: Scenery, site: Site, stream: int, j: Any) -> Ray:
    """Ray number j of a lot, over the hemisphere on the viewer's side."""
    lot = s.lots["sky" if stream == SKY else "near"]
    u, v = site.draw.stream(stream).many(j, lot)
    n = site.n
    if s.settings.occlusion.hemisphere == "box":
        d = warp.box(n, u, v, site.draw.stream(stream + TURN).many(j, lot)[0])
    else:
        d = warp.cosine(n, u, v)
    return Ray(site.surface.p, d, site.hit.index, site.within, site.start(dr.dot(n, d)))
