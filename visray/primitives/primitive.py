"""What every primitive is: the contract between the kinds and everything that traces rays.

A kind is one file. It declares its fields and answers a few questions about one row, in kernels that serve all rows of
its batch. All else is derived from these answers: closest and any hit, shadows in colour, nested media
(accel/intersect.py, accel/ray_segment.py, indirect.py).

    rows.placed(outer)                 what depends on no ray: once a scene
    rows.bounds(outer)                 a box and a ball in the world that hold the object
    kind.seen(placed, o)               what depends on the ray's origin: once for rays that share it
    kind.crossing(seen, ray, begin, end, known)
                                       the first crossing between two distances, with what is known of its ends
    kind.inside(placed, p)             whether a point is in a closed kind
    kind.surface_at(placed, p, part)   (f, g): f is zero on the surface, below zero inside; g its gradient
    kind.uv(placed, p, part)           texture coordinates of a point of the surface

`placed` and `seen` are records of arrays, an entry a row or a lane; what rows have in common is in a pytree.Shared. All
of it is double. The distance t along the world ray is kept by affine maps, so local directions are not normalised.
Flat and ConvexSolid answer for kinds that are a canonical shape in a frame; a kind may be defined by another kind
(torus.py).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np
from drjit.scalar import Array3f64
from pydantic import ConfigDict

from visray.geometry import Frame, Similarity
from visray.quantities import Arrays, Name, quantities, stacked
from visray.ray import Crossing, KnownEnds, Ray
from visray.transforms import Transform, compose


@dataclass(frozen=True)
class Bounds:
    """A box (low, high) and a ball (centre, radius) in world units that hold an object, to within rounding."""

    low: Any
    high: Any
    centre: Any
    radius: Any


@dataclass(frozen=True)
class Placed:
    """An object in the world: the inverse of its frame, and what parameters its canonical shape has."""

    inverse: Any
    shape: tuple = ()


@dataclass(frozen=True)
class Seen:
    """An object as seen from an origin: as Placed, and the origin in local coordinates."""

    inverse: Any
    shape: tuple
    o: Any


@dataclass(frozen=True)
class MitsubaShapes:
    """The same object for Mitsuba: shapes as plain dicts, and how our (u, v) follow from Mitsuba's.

    A shape is a canonical one and an affine map `to_world` (4 x 4): a `rectangle`, `disk`, `cylinder`, `cone` or
    `plane` as in visray, with its (u, v), the solids closed; or a `sphere`, its poles on the z axis, with Mitsuba's
    (u, v); or a `capsule` or a `torus`, as in visray, with a number `shape`: half its axis over its radius, or its
    minor radius over its major one. Or it is a `mesh` of `vertices` and `faces`, its (u, v) barycentric.
    """

    shapes: list[dict]
    uv: Callable | None = None


@dataclass(frozen=True, kw_only=True)
class Primitive:
    """A named object of the scene: its material and its transform, whose steps are applied in order."""

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")

    material: Name = "default"
    transform: tuple[Transform, ...] = ()

    # Facts, without types, as they are no fields. closed: the surface of a solid; bounded: a box holds it; smooth: it
    # has no creases; searched: crossings are searched for, and come with a certificate; parts: how many its surface
    # has; uses_part: crossings depend on the part that a ray leaves or ends on; crossings: a line has at most so many.
    closed = False
    bounded = True
    smooth = False
    finds_roots = False
    parts = 1
    uses_part = False
    max_crossings = 1

    @property
    def kind(self) -> "type[Primitive]":
        """Objects of one kind share their code."""
        return type(self)

    @classmethod
    def table(cls, a: Arrays, things: list) -> Any:
        """The numbers of objects of this kind as arrays, an entry each."""
        return stacked(a, cls, things)

    @classmethod
    def columns(cls, thing: Any, table: Any) -> dict[str, Any]:
        """The arrays of a table by the names of an object's numbers, as in addresses."""
        return {name: getattr(table, name) for name in quantities(cls)}

    def flaws(self) -> list[tuple[str, str]]:
        """What no field alone can show to be wrong: pairs of a field and what is wrong with it."""
        return []

    def frame(self) -> Frame | Similarity:
        """The map from the canonical shape to the object, before its transform. Fields are Dr.Jit arrays here."""
        raise TypeError(f"{type(self).__name__} has no frame")

    def shape(self) -> tuple:
        """The parameters of the canonical shape: what of it no frame can change. Fields are Dr.Jit arrays here."""
        return ()

    def placed(self, outer: Frame | None) -> Any:
        """What of the object depends on no ray."""
        return Placed(self.frame().then(outer).inverse(), self.shape())

    def bounds(self, outer: Frame | None) -> Bounds:
        """A box and a ball in the world that hold the object. Domain: bounded kinds."""
        whole = self.frame().then(outer)
        radius, half = self.extents(whole, self.shape())
        return Bounds(whole.o - half, whole.o + half, whole.o, radius)

    @staticmethod
    def extents(whole: Frame | Similarity, shape: tuple) -> tuple[Any, Any]:
        """Radius of a ball about the frame's origin that holds the placed canonical shape, and half the sides of a box
        about it that does."""
        raise TypeError("an unbounded primitive has no extents")

    @staticmethod
    def seen(placed: Any, o: Any) -> Any:
        """What of the object depends on the ray's origin only."""
        return Seen(placed.inverse, placed.shape, placed.inverse.point(o))

    @classmethod
    def crossing(cls, seen: Any, ray: Ray, begin: Any, end: Any, known: KnownEnds) -> Crossing:
        """The first crossing at a distance above `begin` and below `end` (None: there is no end)."""
        raise TypeError(f"{cls.__name__} has no crossing")

    @staticmethod
    def never_rehit(inside: Any) -> Any:
        """Whether a ray that leaves the object, and runs into it or not, never meets it again."""
        return False

    @classmethod
    def runs_inside(cls, seen: Any, ray: Ray, slope: Any, begin: Any, end: Any, error: Any) -> Any:
        """Whether a ray runs in the object between two distances, of which one is on its surface.

        slope: that of the ray along the normal there, as seen by who goes away from there. error: how well that point
        is known.
        """
        return slope < 0

    @classmethod
    def inside(cls, placed: Any, p: Any) -> Any:
        """Whether a point is in the object. Domain: closed kinds."""
        return cls.surface_at(placed, p)[0] < 0

    @staticmethod
    def surface_at(placed: Any, p: Any, part: Any = None) -> tuple[Any, Any]:
        """(f, g): a function that is zero on the surface and its world gradient at p, outwards. part: the one that p is
        on; None: the nearest."""
        raise TypeError("no surface")

    @staticmethod
    def has_normal(placed: Any, p: Any) -> Any:
        """Whether there is one normal at a point of the surface, and so two sides."""
        return True

    @staticmethod
    def uv(placed: Any, p: Any, part: Any = None) -> tuple[Any, Any]:
        """Texture coordinates of a point on the surface; v runs upwards."""
        raise TypeError("no uv")

    def mitsuba(self) -> MitsubaShapes | str:
        """The same shape for Mitsuba, or why there is none."""
        return f"Mitsuba has no {self.type}"


def scalars(thing: Any) -> Any:
    """A record with its fields as scalar Dr.Jit values, so that the methods written for kernels serve the host."""
    sizes = quantities(type(thing))
    return replace(thing, **{k: Array3f64(*getattr(thing, k)) for k, q in sizes.items() if q.size == 3})


def transform_frame(thing: Primitive) -> Frame | None:
    """An object's transform as a Frame of scalar values."""
    whole = compose(thing.transform)
    return None if whole is None else Frame(*(Array3f64(*column) for column in whole.T))


def bounding_box(thing: Primitive) -> tuple[np.ndarray, np.ndarray] | None:
    """The least corner and the greatest of a box in world units that holds an object, or None if it is unbounded."""
    if not thing.bounded:
        return None
    bounds = scalars(thing).bounds(transform_frame(thing))
    return np.array(bounds.low, float), np.array(bounds.high, float)


def half_extents(frame: Frame | Similarity, straight: str, round: str = "") -> Any:
    """Half the sides of the box that holds the image of a canonical shape about its frame's origin: the sum of an
    interval from -1 to 1 along each of the axes named in `straight`, and of the unit ball over those in `round`."""
    if isinstance(frame, Similarity):
        return frame.scale
    axes = {k: dr.abs(getattr(frame, k)) for k in straight + round}
    half = sum((axes[k] for k in straight), 0)
    if not round:
        return half
    squares = sum(axes[k] * axes[k] for k in round)
    return half + type(squares)(*(dr.sqrt(x) for x in squares))


def corner_distance(whole: Frame) -> Any:
    """Distance of the farthest of the corners (+-1, +-1, +-1)."""
    far = [dr.squared_norm(whole.x + sy * whole.y + sz * whole.z) for sy in (1, -1) for sz in (1, -1)]
    return dr.sqrt(dr.maximum(dr.maximum(far[0], far[1]), dr.maximum(far[2], far[3])))


def to_world_matrix(frame: Frame, outer: np.ndarray | None) -> np.ndarray:
    """A frame of scalar values as a 4 x 4 matrix, after a transform: what Mitsuba's `to_world` takes."""
    whole = np.vstack([np.stack([np.array(v, float) for v in (frame.x, frame.y, frame.z, frame.o)], 1), [0, 0, 0, 1]])
    return whole if outer is None else np.vstack([outer, [0, 0, 0, 1]]) @ whole
