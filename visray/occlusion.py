"""Ambient occlusion: how much ambient light gets to a point, by rays over the hemisphere above it.

Rays are drawn by their cosine with the normal, so that each counts alike.
"""

from typing import Any

import drjit as dr

from visray import warp
from visray.guards import Cone
from visray.ray import Ray
from visray.scenery import Scenery, Site, felt_distance
from visray.search import End, Watch, blocked, closest

SKY, NEAR, TURN = 2, 3, 6


def sky(s: Scenery, site: Site) -> Any:
    """The share of the sky that is seen: of the rays that meet nothing."""

    def step(j: Any, seen: Any) -> tuple:
        ray = _ray(s, site, SKY, j)
        hidden = blocked(watch, ray, End(dr.full(s.a.F, dr.inf, dr.width(seen))), site.hit.valid, s.plain)
        return (seen + dr.select(hidden, s.a.F(0), 1),)

    watch = _above(s, site)
    return _mean(s, site, "sky", s.settings.occlusion.sky, step)


def near(s: Scenery, site: Site) -> Any:
    """The mean over rays of the distance to what they meet, as a share of settings.occlusion.distance, at most 1."""

    def step(j: Any, free: Any) -> tuple:
        ray = _ray(s, site, NEAR, j)
        hit = closest(watch, ray, s.plain, site.hit.valid, s.reach)
        t = felt_distance(s, ray, hit) if s.attached else hit.t
        return (free + dr.select(hit.valid, s.a.F(t) * dr.rcp(s.a.F(s.reach)), 1),)

    watch = _above(s, site)
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
        d = warp.box(n, u, v, site.draw.stream(stream + TURN).loose(j, lot))
    else:
        d = warp.cosine(n, u, v)
    return site.leaving(d, dr.dot(n, d), dr.zeros(s.a.F, dr.width(d)))


def _above(s: Scenery, site: Site) -> Watch:
    """The watch from the point for rays over its hemisphere."""
    right = s.a.F32(1), s.a.F32(0)
    return site.watch.toward(Cone(s.a.V32(dr.detach(site.n)), *right))
