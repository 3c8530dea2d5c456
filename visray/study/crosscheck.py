"""A scene against its twin in Mitsuba: the same rays through both, and what they say compared."""

from dataclasses import replace

import numpy as np

from visray.errors import UserError
from visray.output.image import Image
from visray.progress import Bar
from visray.render import adjusted
from visray.scene.scene import Scene
from visray.study import shadows
from visray.study.answers import Ours, Rays
from visray.study.comparison import Comparison
from visray.study.findings import Pictures, Report
from visray.study.parts import twins
from visray.study.twin import Theirs

# A picture of this size shows every object that matters, and takes seconds.
LONGEST_SIDE = 512


def check(scene: Scene, *, rays: int = 100_000, seed: int = 0, other: Scene | None = None) -> Report:
    """Compares what visray and Mitsuba say of a scene: pixel centres, shadow rays, `rays` random ones, and the picture.

    Objects that have no twin in Mitsuba are left out of both. `other`, with objects and lights of the same names, is
    what Mitsuba is given instead of the scene: with it the check is checked.
    """
    if rays < 1:
        raise UserError(f"rays = {rays}: must be at least 1")
    made, left_out = twins(other or scene)
    if not made:
        why = "; ".join(f"objects.{name}: {reason}" for name, reason in left_out.items()) or "it has no objects"
        raise UserError(f"nothing of the scene can be checked: {why}")
    scene, notes = _reduced(_kept(scene, made))
    other = _kept(other, made) if other else scene
    with Bar("checking", 5) as bar:
        ours = Ours(scene)
        theirs = Theirs(other, ours.names, made, ours.centre)
        bar.at(1)
        seen = Comparison(ours, theirs, ours.pixel_rays())
        bar.at(2)
        shade, near_shadow, dark = shadows.compare(seen)
        bar.at(3)
        spread = Comparison(ours, theirs, random_rays(scene, ours.centre, rays, seed))
        bar.at(4)
        picture, difference = _pictures(seen, near_shadow)
    return Report(
        width=scene.film.width,
        height=scene.film.height,
        seed=seed,
        objects=len(made),
        left_out=left_out,
        notes=tuple(notes),
        examples=(*seen.examples("pixel"), *dark, *spread.examples("random ray")),
        pixels=seen.crossings(),
        random=spread.crossings(),
        shadows=shade,
        picture=picture,
        difference=difference,
    )


def _kept(scene: Scene, made: dict) -> Scene:
    return replace(scene, objects={name: thing for name, thing in scene.objects.items() if name in made})


def _reduced(scene: Scene) -> tuple[Scene, list[str]]:
    """The scene with its picture's longer side at most LONGEST_SIDE, and a note of it."""
    size = (scene.film.width, scene.film.height)
    longest = max(size)
    if longest <= LONGEST_SIDE:
        return scene, []
    small = tuple(max(1, round(side * LONGEST_SIDE / longest)) for side in size)
    note = f"checked at {small[0]} x {small[1]} pixels instead of {size[0]} x {size[1]}"
    return adjusted(scene, size=small), [note]


def random_rays(scene: Scene, centre: np.ndarray, count: int, seed: int) -> Rays:
    """Rays from in and around the bounds of the bounded objects: half of them anywhere, half to a place in an object's.

    Where there are none, the bounds of camera, target and lights take their place.
    """
    rng = np.random.default_rng(seed)
    boxes = [box for thing in scene.objects.values() if (box := thing.bounds()) is not None]
    if not boxes:
        points = [scene.camera.origin, scene.camera.target, *(light.position for light in scene.lights.values())]
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


def _pictures(seen: Comparison, near_shadow: np.ndarray) -> tuple[Pictures, Image]:
    """The pictures of both, compared where no edge of an object or a shadow is within rounding."""
    scene = seen.ours.made.scene
    mine = seen.ours.colours(seen.look)
    yours = seen.theirs.colours(seen.rays, seen.si, seen.b, seen.shift)
    compared = ~(seen.slack.edge | seen.beyond | seen.tied | near_shadow)
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
    return found, Image(layers | {"compared": compared.reshape(shape).astype(np.float32)}, {"scene_hash": scene.hash()})
