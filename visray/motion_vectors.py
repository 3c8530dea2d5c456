"""Motion vectors: how far what a pixel shows moves in the picture until the next frame.

They are those of the surface point that the ray through the pixel's centre meets (surface_motion.py). The background is
infinitely far away, so only a camera that turns moves it, or the rotation of an environment map.
"""

from collections.abc import Collection
from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np

from visray.animation.moment import at
from visray.camera import OrthographicCamera
from visray.environment_map import EnvironmentMap
from visray.errors import UserError
from visray.geometry import Frame, gamma, l1_norm
from visray.output.layers import NAMES, names_from
from visray.projection import camera_matrices
from visray.pytree import rows
from visray.quantities import Arrays
from visray.scene.scene import Scene
from visray.setup import Prepared
from visray.surface_motion import Motion, motion


def next_frame(scene: Scene, t: float, fps: float | None = None) -> Scene:
    """The scene of the frame that follows time t. At the end of the animation tracks hold their values, so nothing
    moves.

    fps: frames per second; None: those of the animation
    """
    animation = scene.animation
    return at(scene, min(t + 1 / (fps or animation.fps), animation.duration))


def has_motion(layers: Collection[str]) -> bool:
    """Whether motion vectors are asked for. layers: names of the layers that are wanted."""
    return not set(names_from("motion")).isdisjoint(layers)


def check_motion(layers: tuple[str, ...], after: Scene | None) -> None:
    """Raises a UserError if motion vectors are asked for, and there is no next frame. Who asks for all layers (NAMES)
    gets those that there are.

    after: the scene of the next frame, or None
    """
    asked = [name for name in layers if name in names_from("motion")]
    if asked and layers != NAMES and after is None:
        problem = "only a moment of a scene with an animation has that"
        raise UserError(f"layers = {', '.join(asked)}: {problem}; leave it out, or give the scene tracks")


def forward(prepared: Prepared, hit: dict[str, Any]) -> tuple[Any, Any]:
    """The motion vectors of all pixels, to the right and down, in pixels, in the order of lanes.

    hit: the layers P and id, with pixels in the order of lanes

    A vector is 0 if its point will not be before the camera, and for the background of an orthographic camera, which
    has one colour.
    Domain: a scene of an animation (Prepared.after).
    Error: P is rounded to single precision, but the vector is the difference of two places of the same rounded point.
    """
    a, lanes, scene = prepared.a, len(prepared.order), prepared.scene
    after, parallel = replace(prepared.after, film=scene.film), isinstance(scene.camera, OrthographicCamera)
    number = np.broadcast_to(np.array(hit["id"]), lanes)
    moves = motion(a, scene, after, np.broadcast_to(np.array(hit["P"], float).T, (lanes, 3)), number)
    here, there, surface = a.W(hit["P"]), _moved(a, moves, hit), hit["id"] > 0
    size = l1_norm(there) + dr.opaque(a.D, float(np.abs(after.camera.origin).sum()))
    now, then = (_picture(a, x) for x in (scene, after))
    if not parallel:
        # The background's directions stay as they are.
        away = now.inverse().vector(a.W(prepared.x + 0.5, prepared.y + 0.5, 1))
        here = dr.select(surface, here, away)
        there = dr.select(surface, there, _turned(a, away, scene.background, after.background))
        size = dr.select(surface, size, l1_norm(away))
    (x, y, _), (x_there, y_there, depth) = (
        _place(frame, p, surface, parallel) for frame, p in ((now, here), (then, there))
    )
    # Beyond the camera's plane, or so near to it that the rounding of P may have moved the point through.
    shown = (depth > gamma(4, "single") * size) & (surface | (not parallel))
    vectors = tuple(dr.select(shown, a.F(end - begin), 0) for begin, end in ((x, x_there), (y, y_there)))
    dr.eval(vectors)
    return vectors


def _moved(a: Arrays, moves: Motion, hit: dict[str, Any]) -> Any:
    """The points of the layer P at the next moment."""
    # The last matrix and the last slot are for no object. With them no table has a single row, which is another kernel.
    table = Frame.table(a, np.concatenate([moves.matrices, np.eye(4)[None]])[:, :3])
    slots = a.put(a.U, np.append(moves.slot, np.uint32(0)))
    start = a.put(a.W, moves.points.T) if moves.bends else a.W(hit["P"])
    return rows(table, dr.gather(a.U, slots, hit["id"])).point(start)


def _turned(a: Arrays, d: Any, before: Any, after: Any) -> Any:
    """Directions of the background at the next moment. before, after: the background now and then."""
    if not (isinstance(before, EnvironmentMap) and isinstance(after, EnvironmentMap)):
        return d
    sine, cosine = dr.sincos(dr.opaque(a.D, np.radians(after.rotation - before.rotation)))
    return a.W(cosine * d.x + sine * d.z, d.y, cosine * d.z - sine * d.x)


def _picture(a: Arrays, scene: Scene) -> Frame:
    """The map from the world to (x w, y w, depth), for the position (x, y) in pixels. w is the depth for a perspective
    camera, and 1 for an orthographic one."""
    matrix = np.array(camera_matrices(scene)["worldToNDC"])[:, :3].T
    return Frame.table(a, (matrix * np.array([[scene.film.size[0]], [scene.film.size[1]], [1]]))[None])


def _place(picture: Frame, p: Any, surface: Any, parallel: bool) -> tuple[Any, Any, Any]:
    """(x, y, depth) of a point, or of a direction where there is no surface."""
    q = picture.vector(p) + dr.select(surface, picture.o, 0)
    scale = 1 if parallel else dr.rcp(q.z)
    return q.x * scale, q.y * scale, q.z
