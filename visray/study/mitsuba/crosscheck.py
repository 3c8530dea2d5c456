"""The check of a scene against Mitsuba: both programs trace the same rays and render the same picture."""

from dataclasses import replace

import numpy as np

from visray.animation.moment import still_at
from visray.data.all_objects import address_of
from visray.errors import UserError
from visray.features import features
from visray.geometry import gamma
from visray.output.image import Image
from visray.primitives.primitive import MitsubaShapes
from visray.progress import Bar
from visray.scene.adjusted import smaller
from visray.scene.scene import Scene
from visray.study.mitsuba import area_shadows, coloured_shadows, media, shadows
from visray.study.mitsuba.mitsuba_scene import MitsubaScene
from visray.study.mitsuba.omitted_effects import opaque, without_omitted_effects
from visray.study.mitsuba.placed_shapes import mitsuba_shapes
from visray.study.mitsuba.random_rays import random_rays
from visray.study.mitsuba.ray_comparison import RayComparison
from visray.study.mitsuba.report import ColouredShadowDifferences, PictureDifference, Report
from visray.study.mitsuba.shadows import ShadowComparison
from visray.study.mitsuba.visray_scene import VisrayScene
from visray.written_out import written_out

# A picture of this size shows every object that matters, and takes seconds. With many lights it is smaller, to limit
# the number of shadow rays.
LONGEST_SIDE, MOST_SHADOW_RAYS = 512, 2**21


def check(scene: Scene, *, rays: int = 100_000, seed: int = 0, other: Scene | None = None) -> Report:
    """Compares visray and Mitsuba: rays through pixel centres, shadow rays, random rays, and the picture.

    Objects and effects that Mitsuba does not have are left out in both programs (omitted_effects.OMISSIONS). The media
    of transparent solids are compared with a witness instead (media.py). Of an animated scene, the beginning is
    checked.

    rays: number of random rays
    seed: seed of the random rays
    other: the scene that Mitsuba gets, with objects and lights of the same names; None: the same scene. Only tests of
        the check use another scene.
    """
    if rays < 1:
        raise UserError(f"rays = {rays}: must be at least 1")
    # Written out, a scene with data has the same bits (tests/test_data_scene.py).
    scene, other = written_out(still_at(scene, None)), other and written_out(other)
    shapes, left_out = mitsuba_shapes(_without_instances(other or scene))
    if not shapes:
        why = "; ".join(f"{address_of(name)}: {reason}" for name, reason in left_out.items()) or "it has no objects"
        raise UserError(f"nothing of the scene can be checked: {why}")
    whole, size_notes = _reduced(scene)
    full_scene = _only_objects(whole, shapes)
    scene, effect_notes = without_omitted_effects(full_scene)
    their_lights = (other or full_scene).lights
    their_scene = without_omitted_effects(_only_objects(other, shapes))[0] if other else scene
    their_scene = _without_instances(their_scene)
    with Bar("checking", 7) as bar:
        ours = VisrayScene(opaque(scene))
        theirs = MitsubaScene(their_scene, ours.names, shapes, ours.centre)
        bar.update(1)
        of_pixels = RayComparison(ours, theirs, ours.pixel_rays())
        bar.update(2)
        shadow_comparison = shadows.compare(of_pixels)
        bar.update(3)
        opaque_scene = replace(opaque(scene), lights=full_scene.lights)
        area_lights, area_light_examples = area_shadows.compare(opaque_scene, theirs, their_lights, of_pixels.rays)
        bar.update(4)
        of_random = RayComparison(ours, theirs, random_rays(their_scene, ours.centre, rays, seed))
        bar.update(5)
        coloured, picture, difference = _compare_pictures(of_pixels, scene, shadow_comparison)
        bar.update(6)
        of_media, media_examples, media_notes = media.compare(whole, other or whole, seed)
    return Report(
        width=scene.film.size[0],
        height=scene.film.size[1],
        seed=seed,
        objects=len(shapes),
        left_out=left_out,
        notes=(*size_notes, *effect_notes, *media_notes),
        examples=(
            *of_pixels.examples("pixel"),
            *shadow_comparison.examples,
            *area_light_examples,
            *of_random.examples("random ray"),
            *media_examples,
        ),
        pixels=of_pixels.differences(),
        random=of_random.differences(),
        shadows=shadow_comparison.differences,
        tints=coloured,
        penumbras=area_lights,
        media=of_media,
        picture=picture,
        difference=difference,
    )


def _only_objects(scene: Scene, shapes: dict[str, MitsubaShapes]) -> Scene:
    """The scene with only the objects that have shapes in Mitsuba, and the geometries that these name."""
    objects = {name: primitive for name, primitive in scene.objects.items() if name in shapes}
    named = {getattr(x, "geometry", None) for x in objects.values()}
    geometries = {name: shape for name, shape in scene.geometries.items() if name in named}
    return replace(scene, objects=objects, geometries=geometries)


def _without_instances(scene: Scene) -> Scene:
    """The scene with the geometry, at its place, in place of each instance."""
    objects = {name: scene.placed_shape(x) for name, x in scene.objects.items()}
    return replace(scene, objects=objects, geometries={})


def _reduced(scene: Scene) -> tuple[Scene, list[str]]:
    """The scene with a film that is small enough, and notes for the user: one if the film was made smaller, else none.

    Small enough: the longer side has at most LONGEST_SIDE pixels, and all pixels together need at most about
    MOST_SHADOW_RAYS shadow rays.
    """
    size = np.array(scene.film.size)
    shadow_rays = len(scene.lights) * size.prod()
    scale = min(LONGEST_SIDE / size.max(), np.sqrt(MOST_SHADOW_RAYS / max(shadow_rays, 1)))
    if scale >= 1:
        return scene, []
    small = tuple(max(1, round(side * scale)) for side in size.tolist())
    note = f"checked at {small[0]} x {small[1]} pixels instead of {size[0]} x {size[1]}"
    return smaller(scene, small), [note]


def _compare_pictures(
    comparison: RayComparison, scene: Scene, shadow_comparison: ShadowComparison
) -> tuple[ColouredShadowDifferences, PictureDifference, Image]:
    """Compares the pictures of both programs, and before them the coloured shadows if the scene has any.

    Pixels are not compared if an edge of an object, a shadow or a texture is so near that rounding may decide on which
    side of the edge the pixel lies.

    comparison, shadow_comparison: camera rays and shadow rays in the scene with all objects opaque
    scene: the scene with its transparent objects

    Returns the differences of coloured shadows, the difference of the pictures, and an image with the layers that
    Report.difference lists.
    """
    ours, traced = comparison.ours, comparison.traced
    transmittances = [light.their_lit[:, None] for light in shadow_comparison.lights]
    near_edge = np.any([np.zeros(len(comparison.our_hits.t), bool), *shadow_comparison.near_edge], axis=0)
    coloured = ColouredShadowDifferences()
    if features(scene)["coloured shadows"]:
        ours = VisrayScene(scene)
        # The rows of a scene are others with its transparent meshes: such a mesh is one row, and not one a triangle.
        traced = ours.trace(comparison.rays)
        coloured, near_coloured_edge, transmittances = coloured_shadows.compare(
            comparison, ours, traced, shadow_comparison
        )
        near_edge = near_edge | near_coloured_edge
    our_colours = ours.colours(traced)
    # Both programs look up textures at visray's (u, v), rounded to single precision as stored. Mitsuba's own (u, v) are
    # compared by RayComparison; on the facets of Mitsuba's meshes, they are less accurate than the size of a texel.
    theirs, uv = comparison.theirs, comparison.our_hits.uv
    their_colours = theirs.colours(comparison.rays, comparison.si, comparison.their_hits, uv, transmittances)
    uv_error = gamma(2, "single") * np.abs(uv).max(1)
    side = theirs.surface_colours.seen(comparison.their_hits.index, comparison.their_hits.inside(comparison.rays.d))
    near_texture_edge = theirs.surface_colours.uncertain(side, uv, uv_error)
    excluded = comparison.allowed.edge | comparison.beyond | comparison.tied | near_edge | near_texture_edge
    compared = ~excluded
    difference = (our_colours - their_colours)[compared]
    rms, scale = (np.sqrt(np.mean(x**2)) if x.size else 0.0 for x in (difference, our_colours[compared]))
    picture = PictureDifference(
        pixels=len(our_colours),
        compared=int(compared.sum()),
        rms=float(rms / scale if scale else rms),
        most=float(np.abs(difference).max(initial=0.0)),
    )
    shape = scene.film.size[::-1]
    colours = {"RGB": our_colours - their_colours, "visray": our_colours, "mitsuba": their_colours}
    layers = {name: v.reshape(*shape, 3).astype(np.float32) for name, v in colours.items()}
    layers["compared"] = compared.reshape(shape).astype(np.float32)
    return coloured, picture, Image(layers, {"scene_hash": scene.hash()})
