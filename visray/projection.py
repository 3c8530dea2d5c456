"""Where points of the world lie in the picture: the matrices of the camera."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from visray.arguments import checked_arguments
from visray.camera import OrthographicCamera
from visray.data.base import GlobeBase
from visray.errors import UserError
from visray.primitives.primitive import scalars
from visray.scene.check import checked
from visray.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class Projected:
    """Points as the camera sees them.

    x, y: position in pixels, from the left and from the top edge of the picture: pixel (column i, row j) shows the
        points with i <= x < i + 1 and j <= y < j + 1. NaN behind the camera.
    depth: distance along the view direction, in world units; not above 0 behind the camera.
    visible: whether a point lies in the picture, and not behind the globe of a data scene. Other objects are not looked
        at: a point behind one of them counts as visible.

    Shapes: (N) each.
    """

    x: np.ndarray
    y: np.ndarray
    depth: np.ndarray
    visible: np.ndarray


def camera_matrices(scene: Scene) -> dict[str, list[list[float]]]:
    """The matrices worldToCamera and worldToNDC, as a dict of lists of rows. They multiply a row vector v from the
    right: v M.

    In camera space x points to the right, y up, and z along the view direction. In NDC the picture extends from (0, 0)
    at the top left to (1, 1) at the bottom right; z is 1 for a perspective camera, and the depth for an orthographic
    one.
    """
    c, f = scene.camera, scene.film
    right, up, forward, _ = (np.array(v, float) for v in scalars(c).axes())
    o = np.array(c.origin, float)
    to_camera = np.eye(4)
    to_camera[:3, :3] = np.stack([right, up, forward], axis=1)
    to_camera[3, :3] = -o @ to_camera[:3, :3]
    parallel = isinstance(c, OrthographicCamera)
    half = 0.5 * c.height if parallel else np.tan(np.radians(c.fov) / 2)
    to_middle = [0.5, 0.5, 0, 1]
    to_ndc = np.array(
        [
            [0.5 * f.size[1] / f.size[0] / half, 0, 0, 0],
            [0, -0.5 / half, 0, 0],
            *([[0, 0, 1, 0], to_middle] if parallel else [[0.5, 0.5, 1, 1], [0, 0, 0, 0]]),
        ]
    )
    return {"worldToCamera": to_camera.tolist(), "worldToNDC": (to_camera @ to_ndc).tolist()}


@checked_arguments
def projected(scene: Scene, points: Any) -> Projected:
    """Where points lie in the picture of a scene.

    points: in world units; one point counts as a list of one. Those of places on the base of a data scene are
        scene.data.base.place(longitudes, latitudes).point.

    A camera with a lens is taken as its centre. Error: a few roundings of double precision.
    Shapes: points (N, 3).
    """
    p = _checked(points)
    scene = checked(scene) if scene.camera is None else scene  # the camera is fitted
    film, matrices = scene.film, camera_matrices(scene)
    with_one = np.column_stack([p, np.ones(len(p))])
    depth = (with_one @ matrices["worldToCamera"])[:, 2]
    across, down, _, weight = (with_one @ matrices["worldToNDC"]).T
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = (
            np.where(depth > 0, size * v / weight, np.nan) for v, size in ((across, film.size[0]), (down, film.size[1]))
        )
        seen = (x >= 0) & (x < film.size[0]) & (y >= 0) & (y < film.size[1])
    base = scene.data.base if scene.data is not None else None
    if isinstance(base, GlobeBase):
        origin, forward = np.array(scene.camera.origin, float), np.array(matrices["worldToCamera"])[:3, 2]
        parallel = isinstance(scene.camera, OrthographicCamera)
        seen &= ~_behind(base, p, p - depth[:, None] * forward if parallel else origin)
    return Projected(x, y, depth, seen)


def _checked(points: Any) -> np.ndarray:
    """The points as an array of shape (N, 3)."""
    try:
        array = np.atleast_2d(np.asarray(points, float))
    except (TypeError, ValueError):
        array = np.zeros((0, 0))
    if array.ndim != 2 or array.shape[1] != 3 or not np.isfinite(array).all():
        raise UserError("points: must be an array of N x 3 finite numbers, such as [[0, 1, 0]]")
    return array


def _behind(globe: GlobeBase, points: np.ndarray, eyes: np.ndarray) -> np.ndarray:
    """Whether the globe hides points that lie on it or outside of it.

    A line meets the globe only if its nearest point to the centre is inside. If it does, this nearest point hides all
    points beyond it, and the globe hides none before it.

    eyes: where each point is seen from. Shapes: points (N, 3), eyes (N, 3) or (3).
    """
    centre = globe.place(np.array([0.0, 180.0]), np.zeros(2)).point.mean(axis=0)
    way, to_centre = points - eyes, centre - eyes
    share = (way * to_centre).sum(axis=1) / (way * way).sum(axis=1)
    nearest = np.linalg.norm(to_centre - share[:, None] * way, axis=1)
    return (share > 0) & (share < 1) & (nearest < 0.5 * globe.size)
