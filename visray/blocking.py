"""Which straight lines between points opaque objects block: planes, flat shapes, balls, boxes and cylinders.

A fitted camera and fitted lights need this (fitted_scene.py): they must not stand behind a wall or below a floor.
Solids are hollow here: a segment inside one is not blocked. It is NumPy, in double precision, for many segments at
once. Objects of other kinds block nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from visray.primitives.box import Box
from visray.primitives.cylinder import Cylinder
from visray.primitives.disk import Disk
from visray.primitives.ellipsoid import Ellipsoid
from visray.primitives.plane import Plane
from visray.primitives.primitive import Primitive, identity, scalars, transform_frame
from visray.primitives.rectangle import Rectangle
from visray.primitives.sphere import Sphere
from visray.primitives.triangle import Triangle

# A test in the coordinates of the canonical shape: starts o and differences d of segments, shape (3, N), to a mask.
Test = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Blocker:
    """An object that may block segments.

    test: the test of its kind.
    inverse, shift: the linear part and the shift of the map from the world to the canonical shape: p -> inverse (p -
        shift). Shapes: (3, 3), (3).
    """

    test: Test
    inverse: np.ndarray
    shift: np.ndarray

    @staticmethod
    def of(shape: Primitive) -> "Blocker | None":
        """The blocker of an object; None if objects of its kind block nothing."""
        if (test := TESTS.get(type(shape))) is None or shape.cut:
            return None
        inverse = scalars(shape).frame().then(transform_frame(shape) or identity()).inverse()
        rows = (np.array(v, float).ravel() for v in (inverse.x, inverse.y, inverse.z))
        return Blocker(test, np.stack(list(rows)), np.array(inverse.o, float).ravel())

    def blocks(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Whether a point of the surface lies strictly between a and b. Segments that lie in a flat shape are not
        blocked. Shapes: a, b (N, 3); result (N)."""
        with np.errstate(all="ignore"):
            return self.test(self.inverse @ (a - self.shift).T, self.inverse @ (b - a).T)


def _flat(within: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Test:
    """The test of a shape in the plane z = 0. within: whether points (x, y) of the plane belong to it."""

    def test(o: np.ndarray, d: np.ndarray) -> np.ndarray:
        t = -o[2] / d[2]
        return (t > 0) & (t < 1) & within(o[0] + t * d[0], o[1] + t * d[1])

    return test


def _slabs(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest t at which each segment is in all slabs from -1 to 1, one for each coordinate."""
    s, t = (-1 - o) / d, (1 - o) / d
    # A segment along a slab is in it always or never.
    along, inside = d == 0, np.abs(o) < 1
    low = np.where(along, np.where(inside, -np.inf, np.inf), np.minimum(s, t))
    high = np.where(along, np.where(inside, np.inf, -np.inf), np.maximum(s, t))
    return low.max(axis=0), high.min(axis=0)


def _round(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest t at which each segment is in the unit ball, or in the unit disk; inside out if never."""
    squared = (d * d).sum(axis=0)
    middle = -(o * d).sum(axis=0) / squared
    nearest = o + middle * d
    rest = 1 - (nearest * nearest).sum(axis=0)
    half = np.sqrt(np.maximum(rest, 0) / squared)
    found = rest > 0
    # Of a cylinder, a segment along the axis is inside always or never.
    middle, half = np.where(squared > 0, middle, 0.0), np.where(squared > 0, half, np.inf)
    found = np.where(squared > 0, found, (o * o).sum(axis=0) < 1)
    return np.where(found, middle - half, np.inf), np.where(found, middle + half, -np.inf)


def _crosses(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Whether an end of the interval from low to high lies between 0 and 1: there a segment crosses the surface."""
    return (low < high) & (((low > 0) & (low < 1)) | ((high > 0) & (high < 1)))


def _cylinder(o: np.ndarray, d: np.ndarray) -> np.ndarray:
    """The test of the solid x^2 + y^2 <= 1, |z| <= 1."""
    wall, caps = _round(o[:2], d[:2]), _slabs(o[2:], d[2:])
    return _crosses(np.maximum(wall[0], caps[0]), np.minimum(wall[1], caps[1]))


TESTS: dict[type[Primitive], Test] = {
    Plane: _flat(lambda x, y: np.isfinite(x)),
    Rectangle: _flat(lambda x, y: (np.abs(x) <= 1) & (np.abs(y) <= 1)),
    Disk: _flat(lambda x, y: x * x + y * y <= 1),
    Triangle: _flat(lambda x, y: (x >= 0) & (y >= 0) & (x + y <= 1)),
    Sphere: lambda o, d: _crosses(*_round(o, d)),
    Ellipsoid: lambda o, d: _crosses(*_round(o, d)),
    Box: lambda o, d: _crosses(*_slabs(o, d)),
    Cylinder: _cylinder,
}
