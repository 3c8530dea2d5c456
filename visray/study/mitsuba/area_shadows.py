"""Shadows of area lights by visray and by Mitsuba: shadow rays to a grid of points on each light."""

from dataclasses import replace

import numpy as np

from visray.lights import PointLight
from visray.lights.light import AreaLight
from visray.scene.scene import Scene
from visray.study.mitsuba import visray_lighting
from visray.study.mitsuba.mitsuba_scene import MitsubaScene
from visray.study.mitsuba.ray_comparison import RayComparison
from visray.study.mitsuba.report import AreaLightDifferences
from visray.study.mitsuba.shadows import examples, near_edge, visibility
from visray.study.mitsuba.visray_scene import Rays, VisrayScene

# SIDE: number of points along each side of the grid on a light. MOST_RAYS: about the largest number of shadow rays; if
# all pixels together need more, only every k-th pixel is compared.
SIDE, MOST_RAYS = 4, 2**20


def compare(
    scene: Scene, theirs: MitsubaScene, their_lights: dict[str, AreaLight], rays: Rays
) -> tuple[AreaLightDifferences, list[str]]:
    """The differences over all area lights, and a list with a line of text for each of the first mismatches.

    scene: the scene with its area lights; all objects are opaque
    theirs: the same scene in Mitsuba
    their_lights: the lights that Mitsuba gets, by name
    rays: camera rays through the pixels' centres
    """
    our_lights = {name: light for name, light in scene.lights.items() if light.has_area}
    if not our_lights or not scene.settings.shadows:
        return AreaLightDifferences(), []
    step = -(-len(rays.d) * len(our_lights) * SIDE**2 // MOST_RAYS)
    comparison = RayComparison(VisrayScene(scene), theirs, replace(rays, d=rays.d[::step]))
    total = np.zeros(6)
    lines: list[str] = []
    for name, light in our_lights.items():
        counts, examples_of_light = _compare_light(comparison, light, their_lights[name], name)
        total += counts
        lines += examples_of_light
    shadow_rays, reached, edge, mismatches, compared = total[:5].astype(int).tolist()
    mean_difference = float(total[5] / max(compared, 1))
    return AreaLightDifferences(
        lights=len(our_lights),
        points=SIDE**2,
        pixels=len(comparison.our_hits.t),
        rays=shadow_rays,
        reached=reached,
        near_edge=edge,
        mismatches=mismatches,
        compared=compared,
        difference=mean_difference,
    ), lines


def _compare_light(
    comparison: RayComparison, our_light: AreaLight, their_light: AreaLight, name: str
) -> tuple[np.ndarray, list[str]]:
    """Six numbers for one light, as an array, and a list with a line of text for each of the first mismatches.

    The numbers are counts of: shadow rays, rays that reach the light, rays near an edge, mismatches, compared pixels.
    The sixth is the sum over the compared pixels of |a - b|; a and b are the fractions of the light that are visible in
    visray and in Mitsuba.
    """
    ours, n = comparison.ours, len(comparison.our_hits.t)
    counts, lines = np.zeros(4), []
    any_near_edge, difference, any_facing = np.zeros(n, bool), np.zeros(n), np.zeros(n, bool)
    for our_point, their_point in zip(points(ours, our_light), points(ours, their_light)):
        point_lights = (PointLight(position=tuple((ours.centre + x).tolist())) for x in (our_point, their_point))
        arrival = visray_lighting.arriving_light_of_point(ours, comparison.traced, our_light, our_point)
        light = visibility(comparison, *point_lights, arrival)
        edge = light.facing & near_edge(comparison, light)
        mismatch = light.differs() & ~edge
        counts += [light.facing.sum(), (light.facing & light.our_lit).sum(), edge.sum(), mismatch.sum()]
        any_near_edge, any_facing = any_near_edge | edge, any_facing | light.facing
        difference += light.facing * (light.our_lit.astype(float) - light.their_lit) / SIDE**2
        lines += examples(comparison, name, light, mismatch)
    compared = any_facing & ~any_near_edge
    return np.append(counts, [compared.sum(), np.abs(difference[compared]).sum()]), lines


def points(ours: VisrayScene, light: AreaLight) -> np.ndarray:
    """Middles of the cells of a grid of SIDE x SIDE cells on an area light, relative to the camera.

    Shapes: (SIDE^2, 3).
    """
    a, row = ours.a, visray_lighting.light_table(ours, light)
    v, u = (np.mgrid[:SIDE, :SIDE].reshape(2, -1) + 0.5) / SIDE
    return np.array(row.position + row.point_offset(a.W, a.D(u), a.D(v)), float).T - ours.centre
