"""The interface of a primitive: what each kind of object answers, and what is derived from its answers.

A kind is one class in one file. Its fields are the numbers that a scene gives. Its methods answer a few questions, and
they run in kernels that serve all objects of one batch at once. Three stages follow each other, and each computes what
the next one needs:

    object.placed(outer)               per object; depends on no ray
    kind.seen(placed, o)               per object and ray origin; rays that share an origin share it
    kind.crossing(seen, ray, begin, end, known)
                                       per ray: the first crossing with the surface between two distances

Four more answers complete a kind:

    object.bounds(outer)               a box and a ball in world space that contain the object
    kind.inside(placed, p)             whether a point is inside; for closed kinds
    kind.surface_at(placed, p, part)   (f, g): f is zero on the surface and negative inside; g is its gradient
    kind.uv(placed, p, part)           texture coordinates of a surface point

Closest hit, shadow rays, coloured shadows and nested media are derived from these answers: see accel/intersect.py,
accel/ray_segment.py and indirect.py.

`placed` and `seen` are records of arrays with one entry per object or per lane, in double; a pytree.Shared field holds
what the objects of a batch have in common. A local direction is the affine image of the world direction and is not
normalised, so a local distance t is also the distance along the world ray.

Flat and ConvexSolid implement this interface for a canonical shape in a frame. PolynomialSolid implements it for a kind
that is defined by a polynomial, such as the torus.
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
    """A bounding box and a bounding ball of an object, correct to within rounding. Units: world.

    low, high: corners of the box.
    centre, radius: the ball.
    """

    low: Any
    high: Any
    centre: Any
    radius: Any


@dataclass(frozen=True)
class Placed:
    """An object in the world.

    inverse: map from world coordinates to those of the canonical shape.
    shape: parameters of the canonical shape, as `Primitive.shape` returns them.
    """

    inverse: Any
    shape: tuple = ()


@dataclass(frozen=True)
class Seen:
    """An object as seen from a ray origin.

    inverse, shape: as in Placed.
    o: the ray origin in coordinates of the canonical shape.
    """

    inverse: Any
    shape: tuple
    o: Any


@dataclass(frozen=True)
class MitsubaShapes:
    """The same object in Mitsuba.

    shapes: plain dicts, each with a `type`.
        `rectangle`, `disk`, `cylinder`, `cone`, `plane`: a canonical shape and its affine map `to_world` (4 x 4); shape
            and (u, v) are visray's, and solids are closed.
        `sphere`: likewise, with poles on the z axis and Mitsuba's (u, v).
        `capsule`, `torus`: likewise, with a number `shape`: half the axis over the radius, or the minor radius over
            the major one.
        `mesh`: `vertices` and `faces`; (u, v) are barycentric.
    uv: function from Mitsuba's (u, v) to visray's; None where they are equal.
    """

    shapes: list[dict]
    uv: Callable | None = None


@dataclass(frozen=True, kw_only=True)
class Primitive:
    """An object of the scene: its material, and its transform as steps that are applied in order."""

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")

    material: Name = "default"
    transform: tuple[Transform, ...] = ()

    # Facts about the kind. They have no type annotation, because an annotation would make them fields of the scene.
    closed = False  # the surface encloses a solid
    bounded = True  # a box contains the object
    smooth = False  # the surface has no creases
    finds_roots = False  # crossings are roots that are isolated numerically, and come with a certificate
    parts = 1  # number of parts of the surface, such as faces
    uses_part = False  # crossings depend on the part that a ray starts or ends on
    max_crossings = 1  # a line crosses the surface at most so many times

    @property
    def kind(self) -> "type[Primitive]":
        """The class whose code serves this object. Objects of one kind share one kernel."""
        return type(self)

    @classmethod
    def table(cls, a: Arrays, objects: list) -> Any:
        """The fields of several objects of this kind as arrays, with one entry per object."""
        return stacked(a, cls, objects)

    @classmethod
    def columns(cls, primitive: Any, table: Any) -> dict[str, Any]:
        """The arrays of a table, by the name that each number has in an address."""
        return {name: getattr(table, name) for name in quantities(cls)}

    def flaws(self) -> list[tuple[str, str]]:
        """Errors that concern several fields together, as pairs (field, message)."""
        return []

    def frame(self) -> Frame | Similarity:
        """The map from the canonical shape to the object before its transform. Fields hold Dr.Jit arrays here."""
        raise TypeError(f"{type(self).__name__} has no frame")

    def shape(self) -> tuple:
        """Parameters of the canonical shape: those that no affine map can absorb. Fields hold Dr.Jit arrays here."""
        return ()

    def placed(self, outer: Frame | None) -> Any:
        """Per-object data that depends on no ray. outer: the object's transform, or None."""
        return Placed(self.frame().then(outer).inverse(), self.shape())

    def bounds(self, outer: Frame | None) -> Bounds:
        """Bounding box and ball in world space. outer: the object's transform, or None. Domain: bounded kinds."""
        to_world = self.frame().then(outer)
        radius, half = self.extents(to_world, self.shape())
        return Bounds(to_world.o - half, to_world.o + half, to_world.o, radius)

    @staticmethod
    def extents(to_world: Frame | Similarity, shape: tuple) -> tuple[Any, Any]:
        """Size of the placed canonical shape about the origin of its frame: the radius of a ball and the half sides of
        a box that contain it."""
        raise TypeError("an unbounded primitive has no extents")

    @staticmethod
    def seen(placed: Any, o: Any) -> Any:
        """Per-object data that depends on the ray origin, but on no ray direction."""
        return Seen(placed.inverse, placed.shape, placed.inverse.point(o))

    @classmethod
    def crossing(cls, seen: Any, ray: Ray, begin: Any, end: Any, known: KnownEnds) -> Crossing:
        """The first crossing of the ray with the surface at a distance above `begin` and below `end`.

        end: None means that the ray is endless.
        known: which ends of the ray are known to lie on this object. No crossing is reported at such an end.
        """
        raise TypeError(f"{cls.__name__} has no crossing")

    @staticmethod
    def never_rehit(inside: Any) -> Any:
        """Whether a ray that starts on the surface cannot meet the object again. inside: the ray starts into the
        object."""
        return False

    @classmethod
    def runs_inside(cls, seen: Any, ray: Ray, slope: Any, begin: Any, end: Any, error: Any) -> Any:
        """Whether the ray is inside the object between `begin` and `end`. One of the two ends lies on the surface.

        slope: n . d at that end, for the outward normal n and the direction d from that end into the segment.
        error: bound on the distance of that end from the true surface point.
        """
        return slope < 0

    @classmethod
    def inside(cls, placed: Any, p: Any) -> Any:
        """Whether a point is inside the object. Domain: closed kinds."""
        return cls.surface_at(placed, p)[0] < 0

    @staticmethod
    def surface_at(placed: Any, p: Any, part: Any = None) -> tuple[Any, Any]:
        """(f, g): a function that is zero on the surface, and its world gradient at p, which points outwards.

        part: the part of the surface that p lies on; None selects the nearest part.
        """
        raise TypeError("no surface")

    @staticmethod
    def has_normal(placed: Any, p: Any) -> Any:
        """Whether the surface has a unique normal at a surface point, and hence two sides there."""
        return True

    @staticmethod
    def uv(placed: Any, p: Any, part: Any = None) -> tuple[Any, Any]:
        """Texture coordinates of a surface point. v grows upwards."""
        raise TypeError("no uv")

    def mitsuba(self) -> MitsubaShapes | str:
        """The same object in Mitsuba, or the reason why Mitsuba cannot represent it."""
        return f"Mitsuba has no {self.type}"


def scalars(record: Any) -> Any:
    """A copy of the record with scalar Dr.Jit values, so that methods written for kernels also run on the host."""
    sizes = quantities(type(record))
    return replace(record, **{k: Array3f64(*getattr(record, k)) for k, q in sizes.items() if q.size == 3})


def transform_frame(primitive: Primitive) -> Frame | None:
    """The object's transform as a Frame of scalar values; None where it has no transform."""
    matrix = compose(primitive.transform)
    return None if matrix is None else Frame(*(Array3f64(*column) for column in matrix.T))


def bounding_box(primitive: Primitive) -> tuple[np.ndarray, np.ndarray] | None:
    """Low and high corner of the object's bounding box in world units; None if the object is unbounded."""
    if not primitive.bounded:
        return None
    bounds = scalars(primitive).bounds(transform_frame(primitive))
    return np.array(bounds.low, float), np.array(bounds.high, float)


def half_extents(frame: Frame | Similarity, straight: str, round: str = "") -> Any:
    """Half sides of the tight bounding box of a sum of simple sets, about the frame's origin.

    The set is the Minkowski sum of one segment from -1 to 1 along each axis in `straight`, and of one unit ball (or
    disk, or segment) in the axes in `round`.
    """
    if isinstance(frame, Similarity):
        return frame.scale
    axes = {k: dr.abs(getattr(frame, k)) for k in straight + round}
    half = sum((axes[k] for k in straight), 0)
    if not round:
        return half
    squares = sum(axes[k] * axes[k] for k in round)
    return half + type(squares)(*(dr.sqrt(x) for x in squares))


def corner_distance(frame: Frame) -> Any:
    """Greatest distance of the eight points (+-1, +-1, +-1), given in a frame, from the frame's origin."""
    squared = [dr.squared_norm(frame.x + sy * frame.y + sz * frame.z) for sy in (1, -1) for sz in (1, -1)]
    return dr.sqrt(dr.maximum(dr.maximum(squared[0], squared[1]), dr.maximum(squared[2], squared[3])))


def to_world_matrix(frame: Frame, outer: np.ndarray | None) -> np.ndarray:
    """A frame of scalar values, followed by the transform `outer`, as a 4 x 4 matrix: Mitsuba's `to_world`."""
    matrix = np.vstack([np.stack([np.array(v, float) for v in (frame.x, frame.y, frame.z, frame.o)], 1), [0, 0, 0, 1]])
    return matrix if outer is None else np.vstack([outer, [0, 0, 0, 1]]) @ matrix
