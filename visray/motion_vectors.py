"""Motion vectors: how far what a pixel shows moves in the picture until the next frame.

They are those of the surface point that the ray through the pixel's centre meets (surface_motion.py). The background is
infinitely far away, so only a camera that turns moves it.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from visray.animation.moment import at
from visray.camera import OrthographicCamera
from visray.errors import UserError
from visray.geometry import gamma
from visray.output.layers import NAMES, names_from
from visray.projection import directions, positions
from visray.scene.scene import Scene
from visray.setup import Prepared
from visray.surface_motion import carried


def next_frame(scene: Scene, t: float, fps: float | None = None) -> Scene:
    """The scene of the frame that follows time t. At the end of the animation tracks hold their values, so nothing
    moves.

    fps: frames per second; None: those of the animation
    """
    animation = scene.animation
    return at(scene, min(t + 1 / (fps or animation.fps), animation.duration))


def check_motion(layers: tuple[str, ...], after: Scene | None) -> None:
    """Raises a UserError if motion vectors are asked for, and there is no next frame. Who asks for all layers (NAMES)
    gets those that there are.

    after: the scene of the next frame, or None
    """
    asked = [name for name in layers if name in names_from("motion")]
    if asked and layers != NAMES and after is None:
        problem = "only a moment of a scene with an animation has that"
        raise UserError(f"layers = {', '.join(asked)}: {problem}; leave it out, or give the scene tracks")


def forward(prepared: Prepared, hit: dict[str, Any]) -> np.ndarray:
    """The motion vectors of all pixels, to the right and down, in pixels, in the order of lanes.

    hit: the layers P and id, with pixels in the order of lanes

    A vector is 0 if its point will not be before the camera, and for the background of an orthographic camera, which
    has one colour.
    Shape: (2, N). Domain: a scene of an animation (Prepared.after).
    Error: P is rounded to single precision, but the vector is the difference of two places of the same rounded point.
    """
    lanes, scene = len(prepared.order), prepared.scene
    after = replace(prepared.after, film=scene.film)
    points = np.broadcast_to(np.array(hit["P"], float).T, (lanes, 3))
    number = np.broadcast_to(np.array(hit["id"]), lanes)
    moved = carried(prepared.a, scene, after, points, number)
    size = np.abs(moved).sum(axis=1) + np.abs(np.array(after.camera.origin)).sum()
    vectors = _between(positions(scene, points), positions(after, moved), size)
    nothing = np.flatnonzero(number == 0)
    vectors[:, nothing] = _of_background(scene, after, prepared.order[nothing])
    return vectors


def _of_background(scene: Scene, after: Scene, order: np.ndarray) -> np.ndarray:
    """The motion vectors of pixels that show no object. order: their numbers in the picture. Shape: (2, N)."""
    if isinstance(scene.camera, OrthographicCamera):
        return np.zeros((2, len(order)))
    row, column = np.divmod(order, scene.film.width)
    away = directions(scene, column + 0.5, row + 0.5)
    here, there = (positions(x, away, infinite=True) for x in (scene, after))
    return _between(here, there, np.abs(away).sum(axis=1))


def _between(here: tuple[np.ndarray, ...], there: tuple[np.ndarray, ...], size: np.ndarray) -> np.ndarray:
    """The vectors between places in two pictures. They are 0 where the second place is not before the camera, or so
    near to its plane that the rounding of P may have moved it through. Shape: (2, N).

    here, there: x, y and depth of the places. size: size of the numbers from which the depth comes. Shape: (N)
    """
    ahead = there[2] > gamma(4, "single") * size
    return np.stack([np.where(ahead, there[i] - here[i], 0.0) for i in (0, 1)])
