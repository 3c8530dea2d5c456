"""Shadow rays in visray and in Mitsuba, from the points that pixels see to every light that these points face."""

from dataclasses import dataclass, replace

import numpy as np

from visray.geometry import gamma
from visray.lights.light import Light
from visray.study.mitsuba import visray_lighting
from visray.study.mitsuba.ray_comparison import EXAMPLES, RayComparison, select
from visray.study.mitsuba.report import ShadowDifferences
from visray.study.mitsuba.rounding import AXES, RayError
from visray.study.mitsuba.shadow_rays import ShadowRays
from visray.study.mitsuba.visray_lighting import LightArrival

# Shadow rays to a light that is infinitely far away are cut off at HORIZON times the size of the scene. Only planes lie
# beyond that. A ray that is parallel to a plane would hit the plane somewhere far away because of its rounding errors.
HORIZON = 256


@dataclass(frozen=True)
class LightVisibility:
    """The visibility of one light from the points that pixels see, in both programs. Shapes: one entry a pixel.

    our_light, their_light: the light in visray and in Mitsuba
    our_rays, their_rays: shadow rays to the light, shortened by `_shortened`
    cut_off: the pieces that `_shortened` cut off at the end of our_rays and that must contain no occluder; None: no
        pieces
    touching: indices of the objects on whose surface the light lies, (K)
    facing: whether the point faces the light
    cosine: cosine of the angle between normal and direction to the light in visray; 1 if not `facing`
    margin: distance along the shadow ray up to which Mitsuba may hit the surface on which the ray starts (world units)
    largest_margin: this distance for the least cosine that rounding allows; inf if the ray may be parallel to the
        surface
    our_lit, their_lit: whether light arrives, in visray and in Mitsuba
    """

    our_light: Light
    their_light: Light
    our_rays: ShadowRays
    cut_off: ShadowRays | None
    touching: np.ndarray
    their_rays: ShadowRays
    facing: np.ndarray
    cosine: np.ndarray
    margin: np.ndarray
    largest_margin: np.ndarray
    our_lit: np.ndarray
    their_lit: np.ndarray

    def differs(self) -> np.ndarray:
        """Whether light arrives in one program only."""
        return self.facing & (self.our_lit != self.their_lit)


@dataclass
class ShadowComparison:
    """The comparison of the shadows of all lights.

    differences: counts over all lights
    lights: a LightVisibility for each light
    near_edge: for each light, a mask of the pixels near the edge of a shadow, (N)
    examples: a line of text for each of the first mismatches
    """

    differences: ShadowDifferences
    lights: list[LightVisibility]
    near_edge: list[np.ndarray]
    examples: list[str]


def compare(comparison: RayComparison) -> ShadowComparison:
    """Compares the shadows of every light, in a scene that has no area lights."""
    our_scene, their_scene = comparison.ours.prepared.scene, comparison.theirs.scene
    shadows = ShadowComparison(ShadowDifferences(0, 0, 0, 0), [], [], [])
    counts = np.zeros(4, int)
    arrivals = visray_lighting.arriving_light(comparison.ours, comparison.traced)
    for (name, our_light), their_light, arrival in zip(our_scene.lights.items(), their_scene.lights.values(), arrivals):
        light = visibility(comparison, our_light, their_light, arrival)
        edge = light.facing & near_edge(comparison, light)
        mismatch = light.differs() & ~edge
        shadows.lights.append(light)
        shadows.near_edge.append(edge)
        counts += [light.facing.sum(), (light.facing & light.our_lit).sum(), edge.sum(), mismatch.sum()]
        shadows.examples += examples(comparison, name, light, mismatch)
    if our_scene.settings.shadows:
        shadows.differences = ShadowDifferences(*map(int, counts))
    return shadows


def examples(comparison: RayComparison, name: str, light: LightVisibility, mismatch: np.ndarray) -> list[str]:
    """A line of text for each of the first EXAMPLES mismatches. name: name of the light."""
    lines = []
    for lane in np.flatnonzero(mismatch)[:EXAMPLES]:
        p = (comparison.ours.centre + comparison.points()[lane]).tolist()
        verdicts = "visray lit, Mitsuba dark" if light.our_lit[lane] else "visray dark, Mitsuba lit"
        lines.append(f"light {name}, {p} on {comparison.ours.names[comparison.our_hits.index[lane]]}: {verdicts}")
    return lines


def visibility(
    comparison: RayComparison, our_light: Light, their_light: Light, arrival: LightArrival
) -> LightVisibility:
    """The visibility of a light from the hit points.

    our_light, their_light: the light in visray and in Mitsuba
    arrival: the light that arrives according to visray's kernels
    """
    p = comparison.points()
    facing = comparison.our_hits.hit & ~comparison.beyond & (arrival.cosine > 0)
    cosine = np.where(facing, arrival.cosine, 1)
    start, least = comparison.ray_error.start(p), cosine - comparison.allowed.angle
    margin = np.where(facing, start / cosine, 0)
    largest_margin = np.where(facing & (least > 0), start / np.where(least > 0, least, 1), np.inf)
    (our_rays, cut_off, touching), (their_rays, *_) = (
        _shortened(comparison, ShadowRays.to(p, light, comparison.ours.centre)) for light in (our_light, their_light)
    )
    their_lit = comparison.theirs.unoccluded(their_rays, margin)
    their_lit = their_lit & (their_light.falloff_reference(-their_rays.l) > 0)
    return LightVisibility(
        our_light, their_light, our_rays, cut_off, touching, their_rays,
        facing, cosine, margin, largest_margin, arrival.reached, their_lit,
    )  # fmt: skip


def _shortened(comparison: RayComparison, shadow_rays: ShadowRays) -> tuple[ShadowRays, ShadowRays | None, np.ndarray]:
    """Shadow rays to a light, cut off at the horizon or before the surfaces on which the light lies.

    A surface does not hide a light that lies on the surface. But rounding in Mitsuba may move the light away from the
    surface, may move the surface as far, and a moved ray ends up to sqrt(3) times the largest error away. So the rays
    are cut off before all these errors.

    Returns the shortened rays; the pieces that were cut off before the surfaces (None: no such pieces); and the indices
    of the objects on whose surface the light lies.
    """
    ours, rounding, objects = comparison.ours, comparison.theirs.rounding, np.arange(len(comparison.ours.names))
    if shadow_rays.infinite:
        size = np.linalg.norm(shadow_rays.p, axis=1) + rounding.far[rounding.bounded].max(initial=0.0)
        return shadow_rays.limited(HORIZON * size), None, objects[:0]
    light, error = shadow_rays.end[0], rounding.ray_error(objects)
    largest_error = rounding.largest_ray_error(len(shadow_rays.p))
    tolerance = error.start(np.broadcast_to(light, (len(objects), 3)))
    touching, normals = visray_lighting.objects_touching(ours, light, tolerance)
    if not touching.size:
        return shadow_rays, None, touching
    cosine = np.abs(shadow_rays.l @ normals.T)
    moves = np.sqrt(3) * (largest_error.start(shadow_rays.p) + largest_error.slope() * shadow_rays.length)
    single = 2 * (tolerance[touching] + error.slope()[touching] * shadow_rays.length[:, None]) + moves[:, None]
    # `double` bounds the distance before the light at which a ray in double precision may hit the surface on which the
    # light lies. It comes from the rounding of coordinates.
    size = np.linalg.norm(ours.centre + light) + np.linalg.norm(ours.centre + shadow_rays.p, axis=1)
    double = (gamma(32) * size)[:, None]
    single_end, double_end = (
        np.where(cosine > 0, x / np.where(cosine > 0, cosine, 1), np.inf).max(1) for x in (single, double)
    )
    cut_off = shadow_rays.without_end(double_end).without_start(shadow_rays.length - single_end)
    return shadow_rays.without_end(single_end), cut_off, touching


def near_edge(comparison: RayComparison, light: LightVisibility) -> np.ndarray:
    """Whether visray's result changes if a shadow ray is moved, or cut off elsewhere, within Mitsuba's rounding error.

    If visray and Mitsuba differ on a ray, the occluder may be any object. So the ray is moved by the largest error of
    all objects. Such a ray is also near an edge if Mitsuba's result changes when the ray is moved. Shapes: (N).
    """
    ours, traced, differs = comparison.ours, comparison.traced, light.differs()
    error = comparison.ray_error.where(differs, comparison.theirs.rounding.largest_ray_error(len(differs)))

    def lit(shadow_rays: ShadowRays, on_hit_surface: bool = True) -> np.ndarray:
        clear = visray_lighting.unoccluded(ours, traced, shadow_rays, light.facing, on_hit_surface)
        return clear & visray_lighting.sends_light(ours, light.our_light, shadow_rays)

    # The result of the picture's kernel (light.our_lit) is not used here: if it were wrong, all moved rays would differ
    # from it, and the error would be taken for an edge.
    unmoved = lit(light.our_rays)
    changes = np.isinf(light.largest_margin) | (light.our_rays.length == 0)
    if light.cut_off is not None:
        changes |= ~visray_lighting.unoccluded(ours, traced, light.cut_off, light.facing, on_hit_surface=False)
    if light.our_rays.infinite:
        changes |= lit(replace(light.our_rays, length=np.full(len(unmoved), np.inf))) != unmoved
    margin = np.where(np.isinf(light.largest_margin), 0, light.largest_margin)
    changes |= lit(light.our_rays.without_start(margin), on_hit_surface=False) != unmoved
    for shadow_rays in moved_shadow_rays(light.our_rays, error):
        changes |= lit(shadow_rays) != unmoved
    lanes = np.flatnonzero(differs & ~changes)
    if lanes.size:
        error_of_lanes, their_rays = select(error, lanes), select(light.their_rays, lanes)
        # A moved ray may start below the surface. The margin grows by as much, so that the surface does not hide it.
        margin = light.margin[lanes] + np.sqrt(3) * error_of_lanes.start(their_rays.p) / light.cosine[lanes]
        for shadow_rays in moved_shadow_rays(their_rays, error_of_lanes):
            their_lit = comparison.theirs.unoccluded(shadow_rays, margin)
            their_lit = their_lit & (light.their_light.falloff_reference(-shadow_rays.l) > 0)
            changes[lanes] |= their_lit != light.their_lit[lanes]
    return changes


def moved_shadow_rays(shadow_rays: ShadowRays, error: RayError) -> list[ShadowRays]:
    """The shadow rays, moved by the error along each of AXES: a list of six."""
    start, slope = error.start(shadow_rays.p), error.slope()
    return [shadow_rays.moved(start, slope, e) for e in AXES]
