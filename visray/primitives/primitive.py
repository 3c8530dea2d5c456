"""The interface of a primitive: the fields and methods that each kind of object has.

A kind is one class in one file. Its fields are the numbers that a scene gives. Its methods run in kernels. There, one
call serves all objects of a batch, a set of objects of one kind. Three methods form a chain, and each computes the data
that the next one needs:

    object.placed(outer)               data of the object that depends on no ray
    kind.seen(placed, o)               data of the object that depends on the ray origin o, but not on the direction
    kind.crossing(seen, ray, begin, end, known)
                                       the first crossing of the ray with the surface between two distances

Five more methods complete a kind:

    object.bounds(outer)               a box and a ball in world space that contain the object
    kind.inside(placed, p)             whether a point is inside; for closed kinds
    kind.volumes(table, outer)         volumes, for closed kinds: where glass overlaps, the smaller solid counts
    kind.surface_at(placed, p, part)   (f, g): f is zero on the surface and negative inside; g is its gradient
    kind.uv(placed, p, part)           texture coordinates of a surface point

The closest hit, shadow rays, coloured shadows and nested media are derived from these methods: see accel/intersect.py,
accel/ray_segment.py and indirect.py.

`placed` and `seen` are records of arrays in double. An array has one entry per object, or one entry per lane (an entry
of a Dr.Jit array, here one ray or point). A pytree.Shared field holds data that all objects of a batch have in common.

A part is one smooth piece of a surface, such as a face. The canonical shape of a kind is its simplest member, such as
the unit sphere; a frame maps its local coordinates to the world. The local direction of a ray is not normalised, so
distances along the ray are equal in local and in world coordinates.

The subclasses Flat and ConvexSolid implement the interface for a canonical shape in a frame. PolynomialSolid implements
it for a kind that is defined by a polynomial, such as the torus.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import drjit as dr
import numpy as np
from pydantic import ConfigDict

from visray.geometry import Frame, Similarity
from visray.operands import OptionalOperands
from visray.quantities import Arrays, quantities, stacked
from visray.ray import Crossing, KnownEnds, Ray
from visray.records import altered
from visray.references import MaterialName
from visray.transforms import Transform, compose


@dataclass(frozen=True)
class Bounds:
    """A bounding box and a bounding ball of each object, correct to within rounding. Units: world.

    low, high: corners of the box with the least and the greatest coordinates.
    centre, radius: the ball.
    """

    low: Any
    high: Any
    centre: Any
    radius: Any


@dataclass(frozen=True)
class Placed:
    """Data of an object that depends on no ray.

    inverse: map from world coordinates to coordinates of the canonical shape.
    shape: parameters of the canonical shape, as `Primitive.shape` returns them.
    """

    inverse: Any
    shape: tuple = ()


@dataclass(frozen=True)
class Seen:
    """Data of an object that depends on the ray origin, but not on the ray direction.

    inverse, shape: as in Placed.
    o: the ray origin in coordinates of the canonical shape.
    """

    inverse: Any
    shape: tuple
    o: Any


@dataclass(frozen=True)
class MitsubaShapes:
    """An object, described as shapes for Mitsuba.

    shapes: a list of dicts. Each has a `type`, and these entries:
        `rectangle`, `disk`, `cylinder`, `cone`, `plane`: `to_world`, the affine map (4 x 4) from visray's canonical
            shape. (u, v) are as in visray, and solids are closed.
        `sphere`: `to_world`, the affine map from the unit sphere with poles on the z axis. (u, v) are Mitsuba's.
        `capsule`: `to_world`, and a number `shape`: half the length of the axis divided by the radius.
        `torus`: `to_world`, and a number `shape`: the minor radius divided by the major radius.
        `mesh`: `vertices` and `faces`, and for each vertex its unit normal for shading (`normals`) and texture
            coordinates (`uv`), or none. Without `uv`, (u, v) are barycentric coordinates.
    uv: function that converts Mitsuba's (u, v) to visray's; None if they are equal.
    """

    shapes: list[dict]
    uv: Callable | None = None


@dataclass(frozen=True, kw_only=True)
class Primitive:
    """An object of the scene. Each kind is a subclass.

    material: name of the object's material.
    transform: steps of the object's transform, applied in this order.
    cut: solids that are taken away from the object before it is transformed: a list, or solids by name.
    cut_material: name of the material of the faces that are made by cutting; by default, the object's material.
    """

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")

    material: MaterialName = "default"
    transform: tuple[Transform, ...] = ()
    cut: OptionalOperands = None
    cut_material: MaterialName | None = None

    # By the name of a field that a material has: what is right instead.
    MISPLACED: ClassVar[dict[str, str]] = dict.fromkeys(
        ("color", "colour", "ka", "kd", "ks", "kr", "kt", "ior", "shininess", "emission", "texture"),
        "a material has this; write it in materials, and the material's name as the object's material",
    )
    # Facts about the kind. They have no type annotation, because an annotation would make them fields of the scene.
    section = "geometries"  # the section that has shapes which others refer to (records.Reference)
    closed = False  # whether the surface encloses a solid
    bounded = True  # whether the object has a bounding box
    smooth = False  # whether the surface has no creases
    finds_roots = False  # whether crossings are numerically isolated roots, with a certificate
    parts = 1  # number of parts of the surface, such as faces
    uses_part = False  # whether crossings depend on the part on which a ray starts or ends
    max_crossings = 1  # greatest number of crossings of a line with the surface
    triangular = False  # whether a row is a triangle (corners)
    # Radius of an infinite cylinder about the z axis of the canonical shape that contains the shape. None: rays are not
    # tested against such a cylinder.
    girth = None
    fills_ball = False  # whether an object without a transform is its own bounding ball
    many_rows = False  # whether an object has several rows, such as the triangles of a mesh
    stores_normals = False  # whether `placed` contains the unit normal of each row, in single (unit_normal)
    own_frames = False  # whether the table of the kind contains the objects' transforms
    walks = False  # whether the test of a row is a long loop, such as a walk through a tree of its own
    own_passage = False  # whether the kind has own methods `occludes` and `passage`, as those of accel/ray_segment.py
    turns_at_end = False  # whether a segment that ends on the surface is searched from its end
    composite = False  # whether the object is made of operands
    v_ends = False  # whether v is from 0 to 1 and ends at a pole: no pixel of a texture is blended in from beyond it
    axis_fields = ()  # names of the fields that turn the z axis of the frame, about which u and v are found (tangents)
    bends_normals = False  # whether shading uses normals other than those of the surface (shading_normal)
    flows = False  # whether changed fields bend the surface as no frame does, so that points move along its normals

    @property
    def kind(self) -> "type[Primitive]":
        """The class whose methods serve this object. Objects of one kind share code in the kernel."""
        return type(self)

    @property
    def operand_kind(self) -> "type[Primitive]":
        """The class whose methods serve this object as an operand of CSG."""
        return self.kind

    @classmethod
    def table(cls, a: Arrays, objects: list) -> Any:
        """The fields of several objects of this kind: a record of arrays with one entry per object."""
        return stacked(a, cls, objects)

    @classmethod
    def columns(cls, primitive: Any, table: Any) -> dict[str, Any]:
        """A dict of the arrays in a table. Its keys are the names of the numbers in addresses, such as `radius`.

        primitive: one object of the kind.
        """
        return {name: getattr(table, name) for name in quantities(cls)}

    def with_fields(self, **changes: Any) -> "Primitive":
        """A copy of the object with other values in some fields. Unlike dataclasses.replace, it keeps what else an
        object may know, such as Polynomial.varied, and does not check the values."""
        return altered(self, changes)

    def flaws(self) -> list[tuple[str, str]]:
        """A list of errors (field, message) that concern several fields together; empty if there is no error."""
        return []

    def frame(self) -> Frame | Similarity:
        """The map from the canonical shape to the object before its transform. The fields must be Dr.Jit arrays."""
        raise TypeError(f"{type(self).__name__} has no frame")

    def shape(self) -> tuple:
        """A tuple of the parameters of the canonical shape, such as the two radii of a torus; empty for most kinds.

        They change the shape in ways that no frame can. The fields of the object must be Dr.Jit arrays.
        """
        return ()

    def carrier(self) -> Frame | Similarity:
        """The map to the object before its transform from the coordinates that points of the surface keep while fields
        change (surface_motion.py). The fields must be Dr.Jit arrays."""
        return self.frame()

    @staticmethod
    def reshaped(q: np.ndarray, was: tuple, now: tuple) -> np.ndarray:
        """Points q of the canonical shape with the parameters `was`, as points of that with the parameters `now`.

        was, now: numbers, as `shape` returns them. Shape: q (N, 3).
        """
        return q

    def placed(self, outer: Frame | None) -> Any:
        """Data of the object that depends on no ray. outer: the object's transform, or None."""
        return Placed(self.frame().then(outer).inverse(), self.shape())

    def bounds(self, outer: Frame | None) -> Bounds:
        """Bounding box and ball in world space. outer: the object's transform, or None. Domain: bounded kinds."""
        to_world = self.frame().then(outer)
        radius, half = self.extents(to_world, self.shape())
        return Bounds(to_world.o - half, to_world.o + half, to_world.o, radius)

    @staticmethod
    def extents(to_world: Frame | Similarity, shape: tuple) -> tuple[Any, Any]:
        """(radius of a ball, half sides of a box): both are centred at the frame's origin and contain the object.

        to_world: map from the canonical shape to the world.
        """
        raise TypeError("an unbounded primitive has no extents")

    @classmethod
    def volumes(cls, table: Any, outer: Frame | None) -> tuple[Any, Any]:
        """(volume, error) of the solids of a table, in world space. Domain: closed kinds.

        table: what `table` returns.
        outer: the objects' transforms, or None.
        error: bound on the error of the volume, apart from rounding; 0 for kinds with a closed form.
        """
        volume = cls.canonical_volume(table.shape()) * table.frame().then(outer).volume_factor()
        return volume, 0 * volume

    @staticmethod
    def canonical_volume(shape: tuple) -> Any:
        """Volume of the canonical shape. shape: its parameters, as Primitive.shape returns them."""
        raise TypeError("no closed form for the volume")

    @staticmethod
    def seen(placed: Any, o: Any) -> Any:
        """Data of the object that depends on the ray origin o, but not on the ray direction."""
        return Seen(placed.inverse, placed.shape, placed.inverse.point(o))

    @classmethod
    def crossing(cls, seen: Any, ray: Ray, begin: Any, end: Any, known: KnownEnds) -> Crossing:
        """The first crossing of the ray with the surface at a distance above `begin` and below `end`.

        end: distance of the end of the ray; None if the ray is endless.
        known: which ends of the ray are known to lie on the surface. Such an end is not reported as a crossing.
        """
        raise TypeError(f"{cls.__name__} has no crossing")

    @staticmethod
    def never_rehit(inside: Any) -> Any:
        """Whether a ray that starts on the surface can never meet the object again.

        inside: whether the ray runs into the object.
        """
        return False

    @classmethod
    def runs_inside(cls, seen: Any, ray: Ray, slope: Any, begin: Any, end: Any, error: Any) -> Any:
        """Whether a segment of a ray is inside the object, next to an end of the segment that lies on the surface.

        begin, end: distances of the two ends. One of the ends lies on the surface.
        slope: n . d at the end on the surface, for the outward normal n and the direction d from this end into the
            segment.
        error: bound on the distance between this end and the true surface point.
        """
        return slope < 0

    @classmethod
    def inside(cls, placed: Any, p: Any) -> Any:
        """Whether a point is inside the object. Domain: closed kinds."""
        return cls.surface_at(placed, p)[0] < 0

    @staticmethod
    def surface_at(placed: Any, p: Any, part: Any = None) -> tuple[Any, Any]:
        """(f, g) at a point p.

        f: a function that is zero on the surface, and negative inside closed kinds.
        g: the gradient of f in world space, which points outwards.

        part: number of the part on which p lies; None for the nearest part.
        """
        raise TypeError("no surface")

    @staticmethod
    def has_normal(placed: Any, p: Any) -> Any:
        """Whether the surface has a unique normal at a surface point p, and so has two sides there."""
        return True

    @staticmethod
    def uv(placed: Any, p: Any, part: Any = None) -> tuple[Any, Any]:
        """(u, v): texture coordinates of a surface point p. v grows upwards."""
        raise TypeError("no uv")

    @staticmethod
    def corners(placed: Any) -> tuple[Any, Any, Any]:
        """The corners in world space. Domain: kinds that are `triangular`."""
        raise TypeError("no corners")

    @staticmethod
    def unit_normal(placed: Any) -> Any:
        """The unit normal of the surface, in single precision. Domain: kinds with `stores_normals`."""
        raise TypeError("no stored normal")

    @staticmethod
    def shading_normal(placed: Any, p: Any, part: Any = None) -> Any:
        """The unit normal with which a surface point p is shaded. Domain: kinds with `bends_normals`."""
        raise TypeError("no normal of its own for shading")

    def advice_for_solid(self) -> str:
        """What to write where a solid is needed and the object is none. Domain: open objects."""
        return "use a solid, such as a box or a cylinder"

    def row_count(self) -> int:
        """Number of rows of the object. Domain: kinds with `many_rows`."""
        raise TypeError("an object is one row")

    def mitsuba(self) -> MitsubaShapes | str:
        """The shapes that represent the object in Mitsuba, or a text that says why Mitsuba cannot represent it."""
        return f"Mitsuba has no {self.type}"


def scalars(record: Any) -> Any:
    """A copy of a primitive or clip whose vectors are scalar Dr.Jit values.

    So methods that are written for kernels, such as `frame`, also run on plain numbers outside of kernels.
    """
    triples = _triples(type(record))
    return altered(record, {k: dr.scalar.Array3f64(*getattr(record, k)) for k in triples}) if triples else record


@cache
def _triples(kind: type) -> tuple[str, ...]:
    """Names of the fields of a kind that are vectors."""
    return tuple(name for name, q in quantities(kind).items() if q.size == 3)


def transform_frame(primitive: Primitive) -> Frame | None:
    """The object's transform as a Frame of scalar values; None if the object has no transform."""
    matrix = compose(primitive.transform)
    return None if matrix is None else Frame(*(dr.scalar.Array3f64(*column) for column in matrix.T))


def identity() -> Frame:
    """The world frame, as scalar values."""
    return Frame(*(dr.scalar.Array3f64(*(float(i == j) for j in range(3))) for i in range(4)))


def bounding_box(primitive: Primitive) -> tuple[np.ndarray, np.ndarray] | None:
    """(low corner, high corner) of the object's bounding box in world space; None if the object is unbounded."""
    if not primitive.bounded:
        return None
    bounds = scalars(primitive).bounds(transform_frame(primitive))
    return np.array(bounds.low, float), np.array(bounds.high, float)


def half_extents(frame: Frame | Similarity, straight: str, round: str = "") -> Any:
    """Half sides of the tight bounding box, about the frame's origin, of a sum of simple sets.

    straight: axes of the frame, such as "xy". For each, the sum has a segment from -1 to 1 along this axis.
    round: axes of the frame. If there are any, the sum also has one unit ball (or disk, or segment) in these axes.

    The sum of sets is the Minkowski sum: all sums of one point from each set.
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
    """Greatest distance between the frame's origin and the eight points with the local coordinates (+-1, +-1, +-1)."""
    squared = [dr.squared_norm(frame.x + sy * frame.y + sz * frame.z) for sy in (1, -1) for sz in (1, -1)]
    return dr.sqrt(dr.maximum(dr.maximum(squared[0], squared[1]), dr.maximum(squared[2], squared[3])))


def to_world_matrix(frame: Frame, outer: np.ndarray | None) -> np.ndarray:
    """The 4 x 4 matrix of a frame followed by a transform, for Mitsuba's `to_world`.

    frame: frame of scalar values.
    outer: 3 x 4 matrix of the transform, or None.
    """
    matrix = np.vstack([np.stack([np.array(v, float) for v in (frame.x, frame.y, frame.z, frame.o)], 1), [0, 0, 0, 1]])
    return matrix if outer is None else np.vstack([outer, [0, 0, 0, 1]]) @ matrix
