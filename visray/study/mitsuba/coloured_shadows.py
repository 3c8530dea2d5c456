"""Coloured shadows by visray and by Mitsuba: the light that transparent objects let through to the visible points.

Mitsuba has no coloured shadows. But Mitsuba finds where a shadow ray first hits an object, from either end of the ray.
The piece between these two hits is taken as the path inside the object. That is right for convex objects only.
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
from visray.study.mitsuba.visray_scene import VisrayScene

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
    length: length of the path inside the object (world units)
    error: bound of the error of the length (world units)
    """

    hit: np.ndarray
    length: np.ndarray
    error: np.ndarray


def compare(
    comparison: RayComparison, coloured: VisrayScene, shadows: ShadowComparison
) -> tuple[ColouredShadowDifferences, np.ndarray, list[np.ndarray]]:
    """Compares the transmittances of the shadow rays to all lights.

    comparison: hits of camera rays, in the scene with all objects opaque
    coloured: the scene with its transparent objects
    shadows: shadows in the scene with all objects opaque

    Returns the differences; a mask of the pixels near an edge, (N); and Mitsuba's transmittances, an array of shape
    (N, 3) for each light.
    """
    near_edge, their_shares = np.zeros(len(comparison.our_hits.t), bool), []
    rays = rays_near_edge = 0
    difference = bound = 0.0
    arrivals = visray_lighting.arriving_light(coloured, comparison.traced)
    for light, edge, arrival in zip(shadows.lights, shadows.near_edge, arrivals):
        theirs = _their_transmittance(comparison, light)
        share = np.where(arrival.reached[:, None], arrival.transmittance, 0)
        # Rays that hit nothing have transmittance 1; shadows.py compares them.
        blocked = light.facing & ~(light.their_lit & light.our_lit)
        change = _change(comparison, coloured, light, blocked)
        undecided = blocked & (edge | (change > UNRESOLVED) | (theirs.error > UNRESOLVED))
        difference_of_rays, decided = np.abs(share - theirs.share).max(1), blocked & ~undecided
        rays, rays_near_edge = rays + blocked.sum(), rays_near_edge + undecided.sum()
        difference = max(difference, largest(difference_of_rays, decided))
        bound = max(bound, largest(difference_of_rays, decided, change + theirs.error))
        near_edge |= undecided
        their_shares.append(theirs.share)
    return ColouredShadowDifferences(int(rays), int(rays_near_edge), difference, bound), near_edge, their_shares


def _change(comparison: RayComparison, coloured: VisrayScene, light: LightVisibility, active: np.ndarray) -> np.ndarray:
    """The largest change of visray's transmittance if shadow rays are moved by Mitsuba's rounding. Shapes: (N).

    The change is inf if a ray may be parallel to the surface on which it starts, because its start is not certain then.
    It is also inf if the light sends light along a moved ray in one program only, at the border of a spot light's cone.

    active: mask of the rays that are compared
    """
    unmoved = visray_lighting.transmittances(coloured, comparison.traced, light.our_rays, active)
    change = np.where(np.isinf(light.largest_margin) | (light.our_rays.length == 0), np.inf, 0)
    error = comparison.theirs.rounding.largest_ray_error(len(active))
    for shadow_rays in moved_shadow_rays(light.our_rays, error):
        moved = visray_lighting.transmittances(coloured, comparison.traced, shadow_rays, active)
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
        absorbed, error_of_absorbed = (np.minimum(x / materials[i].dmax, 1) for x in (path.length, path.error))
        share[dark] *= np.where(path.hit[:, None], materials[i].kt * (1 - absorbed)[:, None], 1)
        error[dark] += np.where(path.hit, max(materials[i].kt) * error_of_absorbed, 0)
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
    t, cosine = theirs.first_hit(shadow_rays, (name,))
    hit, zero = np.isfinite(t), np.zeros(len(t))
    if not primitive.closed:
        return InsidePath(hit, zero, zero)
    low, high = (np.array(corner) - theirs.centre for corner in bounding_box(primitive))
    # A second ray runs from beyond the object back to the start.
    beyond = np.linalg.norm(0.5 * (low + high) - shadow_rays.p, axis=1) + np.linalg.norm(high - low)
    forward = shadow_rays.limited(beyond)
    t_back, cosine_back = theirs.first_hit(replace(forward, p=forward.end, l=-shadow_rays.l), (name,))
    entry = np.where(comparison.our_hits.index[lanes] == i, -margin, t)
    leave = forward.length - t_back
    if i in light.touching:
        # The path inside ends at the light itself, though the shadow rays are cut off before it.
        points = comparison.points()[lanes]
        leave = ShadowRays.to(points, light.their_light, theirs.centre).length - margin
    finite = hit & np.isfinite(entry) & np.isfinite(leave)
    length = np.where(finite, np.maximum(leave - entry, 0), 0)
    ray_error = theirs.rounding.ray_error(np.full(len(t), i))
    across = ray_error.start(shadow_rays.p) + ray_error.slope() * forward.length
    grazing = np.minimum(cosine, cosine_back)
    error = 2 * np.divide(across, grazing, out=np.full_like(across, np.inf), where=grazing > 0)
    return InsidePath(hit, length, error)
