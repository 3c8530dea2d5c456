"""A scene against its twin in Mitsuba: the same rays through both, and what they say compared."""

from dataclasses import replace

import numpy as np

from visray.errors import UserError
from visray.features import features
from visray.geometry import gamma
from visray.output.image import Image
from visray.primitives.primitive import bounding_box
from visray.progress import Bar
from visray.render import adjusted
from visray.scene.scene import Scene
from visray.study.mitsuba import area_shadows as penumbras
from visray.study.mitsuba import coloured_shadows as tints
from visray.study.mitsuba import shadows
from visray.study.mitsuba.comparison import Comparison
from visray.study.mitsuba.mitsuba_scene import MitsubaScene
from visray.study.mitsuba.report import Pictures, Report, Tints
from visray.study.mitsuba.shadows import Found
from visray.study.mitsuba.shapes import twins
from visray.study.mitsuba.visray_scene import Rays, VisrayScene
from visray.study.mitsuba.without_effects import opaque, plain

# A picture of this size shows every object that matters, and takes seconds. With many lights it is smaller, so that
# there are no more shadow rays than these.
LONGEST_SIDE, MOST_SHADOW_RAYS = 512, 2**21


def check(scene: Scene, *, rays: int = 100_000, seed: int = 0, other: Scene | None = None) -> Report:
    """Compares what visray and Mitsuba say of a scene: pixel centres, shadow rays, `rays` random ones, and the picture.

    Objects that have no twin in Mitsuba are left out of both, and so are effects that it has not (plain.OMISSIONS).
    `other`, with objects and lights of the same names, is what Mitsuba is given instead of the scene: with it the check
    is checked.
    """
    if rays < 1:
        raise UserError(f"rays = {rays}: must be at least 1")
    made, left_out = twins(other or scene)
    if not made:
        why = "; ".join(f"objects.{name}: {reason}" for name, reason in left_out.items()) or "it has no objects"
        raise UserError(f"nothing of the scene can be checked: {why}")
    whole, smaller = _reduced(_kept(scene, made))
    scene, omitted = plain(whole)
    lights = (other or whole).lights
    other = plain(_kept(other, made))[0] if other else scene
    with Bar("checking", 6) as bar:
        ours = VisrayScene(opaque(scene))
        theirs = MitsubaScene(other, ours.names, made, ours.centre)
        bar.at(1)
        seen = Comparison(ours, theirs, ours.pixel_rays())
        bar.at(2)
        dark = shadows.compare(seen)
        bar.at(3)
        wide, partly = penumbras.compare(replace(opaque(scene), lights=whole.lights), theirs, lights, seen.rays)
        bar.at(4)
        spread = Comparison(ours, theirs, random_rays(scene, ours.centre, rays, seed))
        bar.at(5)
        tinted, picture, difference = _pictures(seen, scene, dark)
    examples = (*seen.examples("pixel"), *dark.examples, *partly, *spread.examples("random ray"))
    known = {"seed": seed, "objects": len(made), "left_out": left_out, "notes": (*smaller, *omitted)}
    crossings = {"pixels": seen.crossings(), "random": spread.crossings()}
    light = {"shadows": dark.shadows, "tints": tinted, "penumbras": wide, "picture": picture, "difference": difference}
    return Report(scene.film.width, scene.film.height, examples=examples, **known, **crossings, **light)


def _kept(scene: Scene, made: dict) -> Scene:
    return replace(scene, objects={name: thing for name, thing in scene.objects.items() if name in made})


def _reduced(scene: Scene) -> tuple[Scene, list[str]]:
    """The scene with its picture's longer side at most LONGEST_SIDE, or less for many lights, and a note of it."""
    size = np.array([scene.film.width, scene.film.height])
    rays = len(scene.lights) * size.prod()
    share = min(LONGEST_SIDE / size.max(), np.sqrt(MOST_SHADOW_RAYS / max(rays, 1)))
    if share >= 1:
        return scene, []
    small = tuple(max(1, round(side * share)) for side in size.tolist())
    note = f"checked at {small[0]} x {small[1]} pixels instead of {size[0]} x {size[1]}"
    return adjusted(scene, size=small), [note]


def random_rays(scene: Scene, centre: np.ndarray, count: int, seed: int) -> Rays:
    """Rays from in and around the bounds of the bounded objects: half of them anywhere, half to a place in an object's.

    Where there are none, the bounds of camera, target and those lights that have a place take theirs.
    """
    rng = np.random.default_rng(seed)
    boxes = [box for thing in scene.objects.values() if (box := bounding_box(thing)) is not None]
    if not boxes:
        places = [light.position for light in scene.lights.values() if light.has_position]
        points = [scene.camera.origin, scene.camera.target, *places]
        boxes = [(np.min(points, 0), np.max(points, 0))]
    low, high = (np.array(corner) - centre for corner in zip(*boxes))
    least, most = low.min(0), high.max(0)
    margin = 0.5 * (most - least).max()
    o = rng.uniform(least - margin, most + margin, (count, 3))
    d = rng.normal(size=(count, 3))
    which = rng.integers(len(boxes), size=count // 2)
    d[: count // 2] = rng.uniform(low[which], high[which]) - o[: count // 2]
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return Rays(o.astype(np.float32), d.astype(np.float32))


def _pictures(seen: Comparison, scene: Scene, dark: Found) -> tuple[Tints, Pictures, Image]:
    """The pictures of both, compared where no edge of an object, a shadow or a texture is within rounding.

    seen: of the scene with all objects opaque; its coloured shadows are compared as well.
    """
    drawn, arrive = seen.ours, [lit.met[:, None] for lit in dark.lit]
    near = np.any([np.zeros(len(seen.a.t), bool), *dark.near], axis=0)
    tinted = Tints()
    if features(scene)["coloured shadows"]:
        drawn = VisrayScene(scene)
        tinted, edges, arrive = tints.compare(seen, drawn, dark)
        near = near | edges
    mine = drawn.colours(seen.look)
    # Both look textures up at the same places, to the rounding in which these are stored: (u, v) are compared by
    # themselves, and where Mitsuba's shapes are facets, its own are not as fine as a picture.
    yours = seen.theirs.colours(seen.rays, seen.si, seen.b, seen.a.uv, arrive)
    blurred = seen.theirs.painting.uncertain(seen.b.index, seen.a.uv, gamma(2, "single") * np.abs(seen.a.uv).max(1))
    compared = ~(seen.slack.edge | seen.beyond | seen.tied | near | blurred)
    difference = (mine - yours)[compared]
    rms, scale = (np.sqrt(np.mean(x**2)) if x.size else 0.0 for x in (difference, mine[compared]))
    found = Pictures(
        pixels=len(mine),
        compared=int(compared.sum()),
        rms=float(rms / scale if scale else rms),
        most=float(np.abs(difference).max(initial=0.0)),
    )
    shape = (scene.film.height, scene.film.width)
    colours = {"RGB": mine - yours, "visray": mine, "mitsuba": yours}
    layers = {name: v.reshape(*shape, 3).astype(np.float32) for name, v in colours.items()}
    layers["compared"] = compared.reshape(shape).astype(np.float32)
    return tinted, found, Image(layers, {"scene_hash": scene.hash()})
