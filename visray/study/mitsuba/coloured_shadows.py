"""Coloured shadows by visray and by Mitsuba: the light that transparent objects let through to the visible points.

Mitsuba has no coloured shadows. But Mitsuba finds where a shadow ray crosses an object: each ray is followed from one
crossing to the next one, up to beyond the object. Their number says whether the ray starts inside.
"""

from dataclasses import dataclass, replace

import numpy as np

from visray.geometry import gamma
from visray.primitives.primitive import Primitive, bounding_box
from visray.study.mitsuba import visray_lighting
from visray.study.mitsuba.ray_comparison import RayComparison, largest, select
from visray.study.mitsuba.report import ColouredShadowDifferences
from visray.study.mitsuba.rounding import UNRESOLVED
from visray.study.mitsuba.shadow_rays import ShadowRays
from visray.study.mitsuba.shadows import LightVisibility, ShadowComparison, moved_shadow_rays
from visray.study.mitsuba.visray_scene import TracedRays, VisrayScene

# Number of roundings for each object: the transmittance is a product over objects, and each object takes a quotient, a
# difference and two products in single precision.
ROUNDINGS = 4


@dataclass(frozen=True)
class Transmittance:
    """Mitsuba's transmittance of shadow rays.

    share: fraction of the light that arrives, (N, 3)
    error: bound of the error of the share, (N)
    """

    share: np.ndarray
    error: np.ndarray


@dataclass(frozen=True)
class InsidePath:
    """The path of shadow rays inside one object. Shapes: (N).

    hit: whether the ray hits the object
    passes: whether the ray enters and leaves the object
    length: length of the path inside the object (world units)
    error: bound of the error of the length (world units)
    """

    hit: np.ndarray
    passes: np.ndarray
    length: np.ndarray
    error: np.ndarray


def compare(
    comparison: RayComparison, coloured: VisrayScene, traced: TracedRays, shadows: ShadowComparison
) -> tuple[ColouredShadowDifferences, np.ndarray, list[np.ndarray]]:
    """Compares the transmittances of the shadow rays to all lights.

    comparison: hits of camera rays, in the scene with all objects opaque
    coloured, traced: the scene with its transparent objects, and the camera rays in it
    shadows: shadows in the scene with all objects opaque

    Returns the differences; a mask of the pixels near an edge, (N); and Mitsuba's transmittances, an array of shape
    (N, 3) for each light.
    """
    near_edge, their_shares = np.zeros(len(comparison.our_hits.t), bool), []
    rays = rays_near_edge = 0
    difference = bound = 0.0
    arrivals = visray_lighting.arriving_light(coloured, traced)
    for light, edge, arrival in zip(shadows.lights, shadows.near_edge, arrivals):
        theirs = _their_transmittance(comparison, light)
        share = np.where(arrival.reached[:, None], arrival.transmittance, 0)
        # Rays that hit nothing have transmittance 1; shadows.py compares them.
        blocked = light.facing & ~(light.their_lit & light.our_lit)
        change = _change(comparison, coloured, traced, light, blocked)
        undecided = blocked & (edge | (change > UNRESOLVED) | (theirs.error > UNRESOLVED))
        difference_of_rays, decided = np.abs(share - theirs.share).max(1), blocked & ~undecided
        rays, rays_near_edge = rays + blocked.sum(), rays_near_edge + undecided.sum()
        difference = max(difference, largest(difference_of_rays, decided))
        bound = max(bound, largest(difference_of_rays, decided, change + theirs.error))
        near_edge |= undecided
        their_shares.append(theirs.share)
    return ColouredShadowDifferences(int(rays), int(rays_near_edge), difference, bound), near_edge, their_shares


def _change(
    comparison: RayComparison, coloured: VisrayScene, traced: TracedRays, light: LightVisibility, active: np.ndarray
) -> np.ndarray:
    """The largest change of visray's transmittance if shadow rays are moved by Mitsuba's rounding. Shapes: (N).

    The change is inf if a ray may be parallel to the surface on which it starts, because its start is not certain then.
    It is also inf if the light sends light along a moved ray in one program only, at the border of a spot light's cone.

    active: mask of the rays that are compared
    """
    unmoved = visray_lighting.transmittances(coloured, traced, light.our_rays, active)
    change = np.where(np.isinf(light.largest_margin) | (light.our_rays.length == 0), np.inf, 0)
    error = comparison.theirs.rounding.largest_ray_error(len(active))
    for shadow_rays in moved_shadow_rays(light.our_rays, error):
        moved = visray_lighting.transmittances(coloured, traced, shadow_rays, active)
        change = np.maximum(change, np.abs(moved - unmoved).max(1))
        ours_lit = visray_lighting.sends_light(coloured, light.our_light, shadow_rays)
        theirs_lit = light.their_light.falloff_reference(-shadow_rays.l) > 0
        change[active & (ours_lit != theirs_lit)] = np.inf
    return change


def _their_transmittance(comparison: RayComparison, light: LightVisibility) -> Transmittance:
    """Mitsuba's transmittance of the shadow rays to a light, computed object by object."""
    objects, names = comparison.theirs.scene.objects, comparison.ours.names
    materials = [comparison.theirs.materials[objects[name].material] for name in names]
    transparent = [any(m.kt) for m in materials]
    falloff = light.their_light.falloff_reference(-light.their_rays.l)
    share = np.repeat((light.their_lit | (falloff > 0))[:, None], 3, 1).astype(float)
    error = np.full(len(share), gamma(ROUNDINGS * len(names), "single"))
    dark = np.flatnonzero(light.facing & ~light.their_lit)
    shadow_rays = select(light.their_rays, dark).without_start(light.margin[dark])
    if opaque := tuple(name for name, is_transparent in zip(names, transparent) if not is_transparent):
        hidden = np.isfinite(comparison.theirs.first_hit(shadow_rays, opaque)[0])
        share[dark[hidden]] = 0
        dark, shadow_rays = dark[~hidden], select(shadow_rays, ~hidden)
    for i in np.flatnonzero(transparent):
        path = _inside_path(comparison, i, light, dark, shadow_rays)
        # As shares of dmax, the length of path at which all light is absorbed.
        m, counts = materials[i], path.passes | np.isinf(path.error)
        absorbed = np.where(path.passes, np.minimum(path.length / m.dmax, 1), 0)
        error_of_absorbed = np.where(counts, np.minimum(path.error / m.dmax, 1), 0)
        share[dark] *= np.where(path.hit[:, None], m.kt * (1 - absorbed)[:, None], 1)
        share[dark] *= np.exp(-np.multiply.outer(path.length, m.absorption))
        error[dark] += np.where(path.hit, max(m.kt) * error_of_absorbed, 0)
        error[dark] += np.minimum(path.error * max(m.absorption), 1) if any(m.absorption) else 0
    return Transmittance(share, error)


def _inside_path(
    comparison: RayComparison, i: int, light: LightVisibility, lanes: np.ndarray, shadow_rays: ShadowRays
) -> InsidePath:
    """The path of shadow rays inside object i.

    lanes: indices of the pixels that the shadow rays belong to
    shadow_rays: rays to the light without their first piece, which is as long as light.margin
    """
    name, theirs, margin = comparison.ours.names[i], comparison.theirs, light.margin[lanes]
    primitive: Primitive = theirs.scene.objects[name]
    if not primitive.closed:
        hit = np.isfinite(theirs.first_hit(shadow_rays, (name,))[0])
        return InsidePath(hit, ~hit & hit, np.zeros(len(hit)), np.zeros(len(hit)))
    low, high = (np.array(corner) - theirs.centre for corner in bounding_box(primitive))
    beyond = np.linalg.norm(0.5 * (low + high) - shadow_rays.p, axis=1) + np.linalg.norm(high - low)
    crossings = _crossings(comparison, i, replace(shadow_rays, length=beyond))
    before = crossings.t < shadow_rays.length
    on_surface = comparison.our_hits.index[lanes] == i
    from_inside = on_surface & comparison.traced.inside()[lanes]
    # A ray that is outside in the end starts inside if it crosses the surface an odd number of times.
    odd = np.isfinite(crossings.t).sum(0) % 2 == 1
    starts_inside = np.where(on_surface, from_inside, odd)
    unsure = starts_inside != odd
    if theirs.rounding.sided[i]:
        unsure |= np.isfinite(crossings.t[0]) & ((crossings.cosine[0] > 0) != starts_inside)
    ends_inside = (before.sum(0) + starts_inside) % 2 == 1
    end = shadow_rays.length
    if touches := i in light.touching:
        # The path inside ends at the light itself, though the shadow rays are cut off before it.
        points = comparison.points()[lanes]
        end = ShadowRays.to(points, light.their_light, theirs.centre).length - margin
    leaves = (np.arange(len(before))[:, None] + starts_inside) % 2 == 1
    length = (np.where(leaves, 1, -1) * np.where(before, crossings.t, 0)).sum(0)
    length += np.where(ends_inside, end, 0) + np.where(starts_inside, margin, 0)
    passes = before.any(0) & (on_surface | ~starts_inside) & (touches | ~ends_inside)
    error = np.where(before, crossings.error, 0).sum(0)
    return InsidePath(before.any(0), passes, np.maximum(length, 0), np.where(unsure, np.inf, error))


@dataclass(frozen=True)
class Crossings:
    """The crossings of rays with the surface of one object in Mitsuba, in order. Shapes: (crossings, N).

    t: distance; inf where a ray has fewer crossings (world units)
    cosine: cosine of the angle between the outward normal and the ray
    error: bound of the error of t (world units)
    """

    t: np.ndarray
    cosine: np.ndarray
    error: np.ndarray


def _crossings(comparison: RayComparison, i: int, rays: ShadowRays) -> Crossings:
    """All crossings of rays with object i. Behind each crossing, a piece of the ray in which rounding may hit the same
    surface again is left out. A second crossing in this piece makes the number of crossings wrong, so it shows."""
    n, rounding = len(rays.p), comparison.theirs.rounding.ray_error(np.full(len(rays.p), i))
    begin, lanes = np.zeros(n), np.arange(n)
    rows: list[Crossings] = []
    while lanes.size or not rows:
        row = Crossings(np.full(n, np.inf), np.zeros(n), np.zeros(n))
        t, cosine = comparison.theirs.first_hit(
            select(rays, lanes).without_start(begin[lanes]), (comparison.ours.names[i],)
        )
        hit = np.isfinite(t)
        lanes, at, cosine = lanes[hit], (begin[lanes] + t)[hit], cosine[hit]
        across = rounding.start(rays.p)[lanes] + rounding.slope()[lanes] * at
        slope = np.abs(cosine)
        error = np.divide(across, slope, out=np.full_like(across, np.inf), where=slope > 0)
        row.t[lanes], row.cosine[lanes], row.error[lanes] = at, cosine, 2 * error
        begin[lanes] = at + 2 * error
        rows.append(row)
        lanes = lanes[begin[lanes] < rays.length[lanes]]
    return Crossings(*(np.stack([getattr(row, name) for row in rows]) for name in Crossings.__dataclass_fields__))
