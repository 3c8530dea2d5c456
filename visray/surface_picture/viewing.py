"""From where a surface is looked at: the direction from which much of it is seen, and the camera."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from visray.camera import Camera
from visray.fitting import Balls, Rig, fitted_lights, fitted_view
from visray.lights.light import Light
from visray.primitives.clips import Ball
from visray.surface_picture.field import Field
from visray.surface_picture.points import nodes

# Directions that are tried: azimuths in degrees from x to y, and elevations above the plane z = 0.
AZIMUTHS, ELEVATIONS = np.arange(-180, 180, 30) - 52.5, (12.0, 25.0, 36.0)
# The direction of a view as in a book. Another is taken if it shows more: this share more for each degree that it is
# turned or raised.
BOOK, TURNED, RAISED = (-52.5, 25.0), 0.002, 0.01
# How much more a view is worth if the parts of the surface are turned to the camera differently.
VARIED = 1.5
# Beside the best azimuth, those at this distance in degrees are tried too.
FINER = 12.0
# Elevations that are tried too if the surface is a cylinder. Its generators are looked at under INTO degrees; a view is
# worth less by the square of the difference, times this number.
STEEP, INTO, ASKEW = (50.0, 65.0), 25.0, 0.004
# Of a cylinder, the mean square of the cosine between normals and generators is less than the first, and normals are
# not all alike by the second.
STRAIGHT, CURVED = 1e-16, 1e-3
# How much more a view is worth that shows all nodes, points from which they are searched for, and where the way from a
# node to the camera begins, as a share of the radius of the clip. The camera is moved by this many radians.
SHOWN, STARTS, AWAY, MOVED = 0.5, 500, 0.03, 0.15
# Rays across a picture and steps along each, when directions are compared.
ACROSS, STEPS = 30, 44
# Cells of space, along the radius of the clip, of which is counted how many are seen.
CELLS = 5
# Numbers of the camera are rounded to this share of the size of the surface, and those of the lights.
ROUNDED, ROUNDED_LIGHTS = 1e-3, 0.03


@dataclass(frozen=True)
class Seen:
    """What is seen of a surface from one direction, through parallel rays.

    points: the points that rays hit. Shape: (N, 3).
    front: whether each is seen from the side where f > 0. Shape: (N).
    """

    points: np.ndarray
    front: np.ndarray


def seen(field: Field, ball: Ball, axes: np.ndarray, across: int = ACROSS) -> Seen:
    """What is seen of the surface in a ball. axes: of the camera (`axes_towards`). across: rays along the width."""
    centre, r = np.array(ball.center), ball.radius
    u, v = (x.ravel() for x in np.meshgrid(*2 * [(np.arange(across) + 0.5) * 2 / across - 1]))
    inside = u * u + v * v < 1
    u, v = u[inside], v[inside]
    depth = np.sqrt(1 - u * u - v * v)
    # Not quite through the same places on all rays, as surfaces often go through the middles of things.
    t = np.linspace(-1, 1, STEPS) * r * depth[:, None]
    d = np.tile(axes[2], (len(u), 1))
    o = centre + r * (u[:, None] * axes[0] + v[:, None] * axes[1])
    at, lines = field.first_crossings(o, d, t)
    before = o[lines] + (at - 1e-4 * r)[:, None] * d[lines]
    return Seen(o[lines] + at[:, None] * d[lines], field.front(before) > 0)


def axes_towards(towards: Any, up: Any) -> np.ndarray:
    """Axes of a camera that looks against a direction: to the right, up and forward, an axis in each row. A direction
    along `up` is looked at with y upwards."""
    forward = -np.array(towards, float) / np.linalg.norm(towards)
    right = np.cross(forward, np.array(up, float))
    if np.linalg.norm(right) < 1e-6 * np.linalg.norm(up):
        right = np.cross(forward, [0.0, 1.0, 0.0] if abs(forward[1]) < 0.9 else [0.0, 0.0, 1.0])
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])


def direction(azimuth: float, elevation: float) -> np.ndarray:
    """Unit vector from angles in degrees; z is upwards. Shape: (3)."""
    a, e = np.radians([azimuth, elevation])
    return np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])


def best_direction(field: Field, ball: Ball, points: np.ndarray) -> tuple[float, float, float]:
    """The direction towards the camera from which the most cells of the surface are seen, with each side counted, and
    not all of them straight, and nodes are not hidden. A view as in a book is taken before others that show hardly
    more. A cylinder is looked into, so that its profile is seen.

    points: points of the surface all over the ball. Shape: (N, 3).
    """
    generator = generator_of(field, points)
    singular = nodes(field, np.array(ball.center), ball.radius, points[:: max(1, len(points) // STARTS)])
    worth = {}

    def worth_of(azimuth: float, elevation: float) -> float:
        if (azimuth, elevation) not in worth:
            towards = direction(azimuth, elevation)
            turned = abs((azimuth - BOOK[0] + 180) % 360 - 180)
            other = 1 + TURNED * turned + RAISED * abs(elevation - BOOK[1])
            if generator is not None:
                other *= 1 + ASKEW * (np.degrees(np.arccos(min(1.0, abs(towards @ generator)))) - INTO) ** 2
            found = seen(field, ball, axes_towards(towards, (0, 0, 1)))
            value = _cells(found, ball) * (1 + VARIED * _variety(field, found, towards))
            worth[azimuth, elevation] = value * (1 + SHOWN * _shown(field, ball, singular, towards)) / other
        return worth[azimuth, elevation]

    worth_of(*BOOK)
    for elevation in ELEVATIONS if generator is None else (*ELEVATIONS, *STEEP):
        for azimuth in AZIMUTHS:
            worth_of(float(azimuth), elevation)
    azimuth, elevation = max(worth, key=worth.get)
    # The first of equal ones is taken, so the same surface is always seen from the same direction.
    for beside in (-FINER, FINER):
        worth_of(azimuth + beside, elevation)
    return tuple(np.round(direction(*max(worth, key=worth.get)), 2).tolist())


def generator_of(field: Field, points: np.ndarray) -> np.ndarray | None:
    """The unit vector along which a cylinder over a plane curve goes on; None if the surface is no cylinder, or flat.
    points: points of the surface. Shape: (N, 3)."""
    _, gradient = field.slope(points)
    length = np.linalg.norm(gradient, axis=0)
    normals = gradient[:, length > 0] / length[length > 0]
    if normals.shape[1] < 3:
        return None
    sizes, axes = np.linalg.eigh(normals @ normals.T / normals.shape[1])
    return axes[:, 0] if sizes[0] < STRAIGHT and sizes[1] > CURVED else None


def _shown(field: Field, ball: Ball, singular: np.ndarray, towards: np.ndarray) -> float:
    """The share of the nodes that nothing hides from a camera, also if it is moved a little. Shapes: singular (N, 3),
    towards (3)."""
    if not len(singular):
        return 0.0
    across = MOVED * axes_towards(towards, (0, 0, 1))[:2]
    cameras = towards + np.concatenate([np.zeros((1, 3)), across, -across])
    t = np.linspace(AWAY, 2, STEPS) * ball.radius
    places = singular[:, None, None] + t[:, None] * cameras[:, None, :]
    inside = np.linalg.norm(places - np.array(ball.center), axis=-1) < ball.radius
    above = field.values(places) > 0
    hidden = ((above[..., 1:] != above[..., :-1]) & inside[..., 1:]).any(-1)
    return 1 - float(hidden.mean())


def _variety(field: Field, found: Seen, towards: np.ndarray) -> float:
    """How differently the parts that are seen are turned to the camera: the standard deviation of the cosines. A bent
    sheet that is looked at straight seems flat."""
    if not len(found.points):
        return 0.0
    _, gradient = field.slope(found.points)
    length = np.linalg.norm(gradient, axis=0)
    return float(np.std(np.abs(towards @ gradient)[length > 0] / length[length > 0])) if length.any() else 0.0


def _cells(found: Seen, ball: Ball) -> int:
    """Number of the cells of space, counted for each side, in which the surface is seen."""
    cells = np.floor((found.points - np.array(ball.center)) / ball.radius * CELLS)
    return len(np.unique(np.column_stack([cells, found.front]), axis=0))


def camera_for(points: np.ndarray, towards: Any, up: Any, aspect: float, zoom: float = 1.0) -> Camera:
    """The camera that sees all points from a direction. zoom: how much larger than if all just fitted."""
    axes = axes_towards(towards, up)
    camera = fitted_view(Balls(points, np.zeros(len(points))), axes, aspect, share=ROUNDED)
    slope = np.tan(np.radians(camera.fov / 2)) / zoom
    fov = round(float(np.degrees(2 * np.arctan(slope))), 3)
    upright = abs(axes[1] @ np.array(up, float)) > 1e-3 * np.linalg.norm(up)
    return replace(camera, up=tuple(map(float, up)) if upright else camera.up, fov=fov)


def lights_for(ball: Ball, towards: Any, up: Any, rig: Rig) -> dict[str, Light]:
    """The lights of a picture, which stand to the camera as the rig says."""
    shown = Balls(np.array([ball.center]), np.array([ball.radius]))
    return fitted_lights(shown, axes_towards(towards, up), rig, ROUNDED_LIGHTS)
