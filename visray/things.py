"""What a scene contains, each thing with balls around it: what a fitted camera must show (fitted_scene.py).

A thing is an object, the base of the data, all rows of a data layer, or a visible light. All of it is NumPy, and runs
once for a scene.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from visray.data.row_balls import row_balls
from visray.data.rows import Rows
from visray.fitting import Balls
from visray.primitives import KINDS
from visray.primitives.instance import Instance
from visray.primitives.primitive import Primitive, bounding_box
from visray.scene.scene import Scene
from visray.shape_bounds import bounds_of

# A thing is shown by its bounding ball if the ball is smaller than the bounding box by this factor, else by the box.
ROUND = 0.75
# Sizes of things that a camera can be fitted to, in world units: squares of other numbers are 0 or infinite.
SIZES = (1e-90, 1e90)

# For each corner of a box, whether it has the greatest x, y and z. Shape: (8, 3).
UPPER = np.indices((2, 2, 2)).reshape(3, 8).T == 1
# The radii of the corners of a box, as balls.
POINTS = np.zeros(8)

BY_TYPE = {kind.type: kind for kind in KINDS}


@dataclass(frozen=True)
class Thing:
    """One thing of a scene.

    address: its address.
    shape: the object as it is placed in the world, or the shape of a light; None for the rows of a layer.
    opaque: whether light does not pass through it.
    low, high: corners of its bounding box; None if it is unbounded. Shape: (3) each.
    balls: balls that contain it; None if it is unbounded.
    reach: radius of a ball about the middle of its box; 0 if it is unbounded.
    """

    address: str
    shape: Primitive | None
    opaque: bool
    low: np.ndarray | None = None
    high: np.ndarray | None = None
    balls: Balls | None = None
    reach: float = 0.0

    @property
    def center(self) -> np.ndarray:
        """The middle of its box. Domain: bounded things."""
        return 0.5 * (self.low + self.high)


def things_of(scene: Scene) -> list[Thing]:
    """All things of a scene, in order. Domain: a scene without flaws, but perhaps without camera and lights."""
    transparent = {name for name, m in scene.materials.items() if any(m.kt)}
    objects = [
        Thing(
            name if "." in name else f"objects.{name}",
            scene.placed_shape(obj),
            transparent.isdisjoint(scene.materials_of(obj)),
        )
        for name, obj in scene.written_objects.items()
    ]
    return [*_bounded(objects), *_layers(scene), *_bounded(list(_visible_lights(scene)))]


def _visible_lights(scene: Scene) -> Iterator[Thing]:
    """The shapes of the lights that are visible, without bounds."""
    for name, light in (scene.lights or {}).items():
        if light.seen:
            kind, names = light.shape
            shape = BY_TYPE[kind](**{ours: getattr(light, theirs) for ours, theirs in names.items()})
            yield Thing(f"lights.{name}", shape, True)


def _layers(scene: Scene) -> Iterator[Thing]:
    """The rows of each data layer."""
    for name, rows in () if scene.data is None else scene.data.rows.items():
        if len(rows):
            balls = _framed(scene, rows) if "frame" in rows.fields else row_balls(rows)
            low, high = balls.box()
            one = len(balls.radius) == 1
            reach = float(balls.radius[0]) if one else 0.5 * float(np.linalg.norm(high - low))
            yield Thing(f"data.layers.{name}", None, False, low, high, balls, reach)


def _framed(scene: Scene, rows: Rows) -> Balls:
    """The corners of the boxes of gizmos that are one shape in the frames of the rows: boxes and geometries."""
    low, high = -np.ones(3), np.ones(3)
    if rows.geometry is not None:
        low, high = bounding_box(scene.placed_shape(Instance(geometry=rows.geometry))) or (low, high)
    x, y, z, o = rows.fields["frame"]
    u, v, w = corners_of(np.ravel(low), np.ravel(high)).T[:, :, None, None]
    points = (o + u * x + v * y + w * z).transpose(0, 2, 1).reshape(-1, 3)
    return Balls(points, np.zeros(len(points)))


def corners_of(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The corners of boxes. Shapes: (..., 3) each; result (..., 8, 3)."""
    return np.where(UPPER, high[..., None, :], low[..., None, :])


def _bounded(things: list[Thing]) -> list[Thing]:
    """The things with their boxes and their balls, where they are bounded. Domain: things with a shape."""
    bounds = bounds_of([x.shape for x in things])
    size = bounds.high - bounds.low
    half = 0.5 * np.sqrt(np.vecdot(size, size))
    # The box of an empty shape is inside out.
    usual = np.isfinite(size).all(axis=1) & (size >= 0).all(axis=1) & (SIZES[0] < half) & (half < SIZES[1])
    boxed = bounds.radius >= ROUND * half
    reach, corners = np.where(boxed, half, bounds.radius).tolist(), corners_of(bounds.low, bounds.high)
    found = list(things)
    for i in np.flatnonzero(usual).tolist():
        balls = Balls(corners[i], POINTS) if boxed[i] else Balls(bounds.centre[i : i + 1], bounds.radius[i : i + 1])
        x = things[i]
        found[i] = Thing(x.address, x.shape, x.opaque, bounds.low[i], bounds.high[i], balls, reach[i])
    return found
