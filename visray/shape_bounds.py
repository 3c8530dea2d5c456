"""Bounding boxes and balls of many shapes at once, as NumPy arrays.

A sphere without a transform needs only array arithmetic. For any other shape, `Primitive.bounds` runs on plain numbers,
as in `primitive.bounding_box`, and gives the same bits.
"""

from collections.abc import Sequence
from typing import Any

import drjit as dr
import numpy as np

from visray.geometry import Frame
from visray.primitives.primitive import Bounds, Primitive, scalars
from visray.primitives.sphere import Sphere
from visray.transforms import composed

# Numbers of a row of bounds: of a low corner, a high corner, a centre and a radius.
WIDTH = 10


def bounds_of(shapes: Sequence[Primitive]) -> Bounds:
    """The bounding boxes and balls of shapes in the world; NaN for unbounded shapes. Shapes: (N, 3), radius (N)."""
    rows = np.full((len(shapes), WIDTH), np.nan)
    plain = [type(x) is Sphere and not x.transform for x in shapes]
    if balls := [i for i, is_plain in enumerate(plain) if is_plain]:
        rows[balls] = _of_spheres([shapes[i] for i in balls])
    if others := [i for i, x in enumerate(shapes) if not plain[i] and x.bounded]:
        rows[others] = _of_others([shapes[i] for i in others])
    return Bounds(rows[:, :3], rows[:, 3:6], rows[:, 6:9], rows[:, 9])


def _of_spheres(spheres: list[Sphere]) -> np.ndarray:
    """The bounds of spheres without a transform. Shape: (N, WIDTH)."""
    centre = np.array([x.center for x in spheres], float)
    radius = np.array([x.radius for x in spheres], float)[:, None]
    return np.concatenate([centre - radius, centre + radius, centre, radius], axis=1)


def _of_others(shapes: list[Primitive]) -> list[list[float]]:
    """The bounds of any bounded shapes, as rows of WIDTH numbers."""
    moved = [i for i, x in enumerate(shapes) if x.transform]
    matrices = composed([shapes[i].transform for i in moved]).transpose(0, 2, 1).tolist()
    frames = {i: Frame(*(dr.scalar.Array3f64(*x) for x in columns)) for i, columns in zip(moved, matrices)}
    found = (scalars(x).bounds(frames.get(i)) for i, x in enumerate(shapes))
    return [[*_numbers(x.low), *_numbers(x.high), *_numbers(x.centre), *_numbers(x.radius)] for x in found]


def _numbers(values: Any) -> list[float]:
    """The numbers of a number, a scalar vector of Dr.Jit, or an array."""
    if isinstance(values, float):
        return [values]
    return list(values) if isinstance(values, dr.scalar.Array3f64) else np.ravel(np.array(values, float)).tolist()
