"""What a scene contains, each thing with balls around it: what a fitted camera must show (fitted_scene.py).

A thing is an object, the base of the data, all rows of a data layer, or a visible light. All of it is NumPy, and runs
once for a scene.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from visray.data.row_balls import row_balls
from visray.data.rows import Rows
from visray.fitting import Balls
from visray.primitives import KINDS
from visray.primitives.instance import Instance
from visray.primitives.primitive import Primitive, bounding_box, scalars, transform_frame
from visray.primitives.sphere import Sphere
from visray.scene.scene import Scene

# A thing is shown by its bounding ball if the ball is smaller than the bounding box by this factor, else by the box.
ROUND = 0.75
# Sizes of things that a camera can be fitted to, in world units: squares of other numbers are 0 or infinite.
SIZES = (1e-90, 1e90)

BY_TYPE = {kind.type: kind for kind in KINDS}


@dataclass(frozen=True)
class Thing:
    """One thing of a scene.

    address: its address.
    shape: the object as it is placed in the world, or the shape of a light; None for the rows of a layer.
    opaque: whether light does not pass through it.
    low, high: corners of its bounding box; None if it is unbounded. Shape: (3) each.
    balls: balls that contain it; None if it is unbounded.
    """

    address: str
    shape: Primitive | None
    opaque: bool
    low: np.ndarray | None = None
    high: np.ndarray | None = None
    balls: Balls | None = None

    @property
    def center(self) -> np.ndarray:
        """The middle of its box. Domain: bounded things."""
        return 0.5 * (self.low + self.high)

    @cached_property
    def reach(self) -> float:
        """Radius of a ball about the middle of its box. Domain: bounded things."""
        if len(self.balls.radius) == 1:
            return float(self.balls.radius[0])
        return 0.5 * float(np.linalg.norm(self.high - self.low))


def things_of(scene: Scene) -> list[Thing]:
    """All things of a scene, in order. Domain: a scene without flaws, but perhaps without camera and lights."""
    transparent = {name for name, m in scene.materials.items() if any(m.kt)}
    found = []
    for name, obj in scene.written_objects.items():
        opaque = transparent.isdisjoint(scene.materials_of(obj))
        address = name if "." in name else f"objects.{name}"
        found.append(_bounded(Thing(address, scene.placed_shape(obj), opaque)))
    return [*found, *_layers(scene), *_visible_lights(scene)]


def _visible_lights(scene: Scene) -> Iterator[Thing]:
    """The shapes of the lights that are visible."""
    for name, light in (scene.lights or {}).items():
        if light.seen:
            kind, names = light.shape
            shape = BY_TYPE[kind](**{ours: getattr(light, theirs) for ours, theirs in names.items()})
            yield _bounded(Thing(f"lights.{name}", shape, True))


def _layers(scene: Scene) -> Iterator[Thing]:
    """The rows of each data layer."""
    for name, rows in () if scene.data is None else scene.data.rows.items():
        if len(rows):
            balls = _framed(scene, rows) if "frame" in rows.fields else row_balls(rows)
            low, high = balls.box()
            yield Thing(f"data.layers.{name}", None, False, low, high, balls)


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
    """The corners of a box. Shapes: (3), (3); result (8, 3)."""
    return np.stack(np.meshgrid(*zip(low, high), indexing="ij"), axis=-1).reshape(-1, 3)


def _bounded(thing: Thing) -> Thing:
    """The thing with its box and its balls, if it is bounded."""
    shape = thing.shape
    if type(shape) is Sphere and not shape.transform:
        center, radius = np.array(shape.center, float), float(shape.radius)
        low, high = center - radius, center + radius
    elif not shape.bounded:
        return thing
    else:
        bounds = scalars(shape).bounds(transform_frame(shape))
        low, high, center = (np.array(x, float).ravel() for x in (bounds.low, bounds.high, bounds.centre))
        radius = float(np.ravel(bounds.radius)[0])
    half = 0.5 * float(np.linalg.norm(high - low))
    # The box of an empty shape is inside out.
    if not (np.isfinite([*low, *high]).all() and (low <= high).all() and SIZES[0] < half < SIZES[1]):
        return thing
    balls = Balls(center[None], np.array([radius]))
    if radius >= ROUND * half:
        balls = Balls(corners_of(low, high), np.zeros(8))
    return Thing(thing.address, shape, thing.opaque, low, high, balls)
