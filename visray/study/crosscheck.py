"""A scene against its twin in Mitsuba: the same rays through both, and what they say compared."""

from dataclasses import replace
from typing import Any

import numpy as np

from visray.errors import UserError
from visray.output.image import Image
from visray.progress import Bar
from visray.render import adjusted
from visray.scene.scene import Scene
from visray.study.answers import Answers, Look, Ours, Rays
from visray.study.findings import Crossings, Pictures, Report, Shadows
from visray.study.rounding import Slack, angle, gaps, moved, slack, tied
from visray.study.shadowcheck import shadows
from visray.study.twin import LARGEST_SQUARE, Theirs, twins

LONGEST_SIDE = 512
EXAMPLES = 3


def check(scene: Scene, *, rays: int = 100_000, seed: int = 0, other: Scene | None = None) -> Report:
    """Compares what visray and Mitsuba say of a scene: pixel centres, shadow rays, `rays` random ones, and the picture.

    Objects that have no twin in Mitsuba are left out of both. `other` is what Mitsuba is given instead of the scene: with
    it the check is checked.
    """
    made, left_out = twins(other or scene)
    if not made:
        why = "; ".join(f"objects.{name}: {reason}" for name, reason in left_out.items()) or "it has no objects"
        raise UserError(f"nothing of the scene can be checked: {why}")
    scene, notes = _reduced(_kept(scene, made))
    other = _kept(other, made) if other else scene
    with Bar("checking", 6) as bar:
        ours = Ours(scene)
        theirs = Theirs(other, ours.names, made, ours.centre)
        bar.at(1)
        seen = _Comparison(ours, theirs, ours.pixel_rays())
        bar.at(2)
        shadows, dim = _shadows(seen)
        bar.at(3)
        spread = _Comparison(ours, theirs, random_rays(scene, ours.centre, rays, seed))
        bar.at(4)
        picture, difference = _pictures(seen, dim)
        bar.at(5)
    crossings = (seen.crossings(), spread.crossings())
    examples = tuple(seen.examples("pixel") + spread.examples("random ray"))
    return Report(
        scene.film.width, scene.film.height, seed, len(made), left_out, tuple(notes), examples, *crossings,
        shadows, picture, difference,
    )  # fmt: skip


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
    """Rays in and around the bounds of the scene's bounded objects: half of them anyhow, half aimed at an object."""
    rng = np.random.default_rng(seed)
    boxes = [b for b in (thing.bounds() for thing in scene.objects.values()) if b is not None]
    if not boxes:
        points = np.array([scene.camera.origin, scene.camera.target, *(l.position for l in scene.lights.values())], float)
        boxes = [(points.min(0), points.max(0))]
    low, high = (np.array(side) - centre for side in zip(*boxes))
    least, most = low.min(0), high.max(0)
    margin = 0.5 * (most - least).max()
    o = rng.uniform(least - margin, most + margin, (count, 3))
    at = rng.integers(len(boxes), size=count // 2)
    d = rng.normal(size=(count, 3))
    d[: count // 2] = rng.uniform(low[at], high[at]) - o[: count // 2]
    length = np.linalg.norm(d, axis=1, keepdims=True)
    d = np.where(length > 0, d / np.where(length > 0, length, 1), (0, 1, 0))
    return Rays(o.astype(np.float32), d.astype(np.float32))


def _pictures(seen: _Comparison, dim: np.ndarray) -> tuple[Pictures, Image]:
    """The pictures of both, compared where neither an edge nor that of a shadow is within rounding."""
    ours, film = seen.ours, seen.ours.made.scene.film
    mine = ours.colours(seen.look)
    shift = seen.theirs.extents.shift(seen.a.index, seen.b.index)
    yours = seen.theirs.colours(seen.rays, seen.si, seen.b, shift)
    compared = ~(seen.slack.edge | seen.beyond | seen.tied | dim)
    difference = (mine - yours)[compared]
    rms, scale = (np.sqrt(np.mean(x**2)) if x.size else 0.0 for x in (difference, mine[compared]))
    found = Pictures(
        len(mine), int(compared.sum()), float(rms / scale if scale else rms), float(np.abs(difference).max(initial=0.0))
    )
    layers = {"RGB": mine - yours, "visray": mine, "mitsuba": yours, "compared": compared[:, None]}
    shape = (film.height, film.width)
    pictures = {name: v.reshape(*shape, -1).squeeze(-1) if v.shape[1] == 1 else v.reshape(*shape, 3) for name, v in layers.items()}
    return found, Image({name: v.astype(np.float32) for name, v in pictures.items()}, {"scene_hash": ours.made.scene.hash()})
