"""What every primitive is, and the two families: flat ones and closed convex solids.

A kind is one file. It declares its fields, says how its canonical shape is placed in the world (`frame`), and answers
for that canonical shape; the family does the rest. A kind that fits neither family overrides the methods of Primitive.

How a ray meets an object, in three steps that share their work:
    kind.placed(table, outer)   once a scene: what of the object depends on no ray
    kind.seen(placed, o)        once an origin: camera and point lights are origins shared by all rays
    kind.crossings(seen, d)     once a ray

All of it is double. The distance t along the world ray is kept by affine maps, so local directions are not normalised.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import drjit as dr
import numpy as np
from drjit.scalar import Array3f64
from pydantic import ConfigDict

from visray.geometry import Frame, Similarity
from visray.quantities import Arrays, Name, quantities, stacked
from visray.ray import Ray
from visray.transforms import Transform, compose


@dataclass(frozen=True)
class Seen:
    """An object as seen from an origin: the inverse of its frame, and the origin in local coordinates."""

    inverse: Any
    o: Any


@dataclass(frozen=True)
class Twin:
    """The same object for Mitsuba: shapes as plain dicts, and how our (u, v) follow from Mitsuba's.

    A shape is a canonical one and an affine map `to_world` (4 x 4): a `rectangle`, `disk`, `cylinder`, `cone` or
    `plane` as in visray, with its (u, v), the solids closed; or a `sphere`, its poles on the z axis, with Mitsuba's
    (u, v). Or it is a `mesh` of `vertices` and `faces`, its (u, v) barycentric.
    """

    shapes: list[dict]
    uv: Callable | None = None


@dataclass(frozen=True, kw_only=True)
class Primitive:
    """A named object of the scene: its material and its transform, whose steps are applied in order."""

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")

    material: Name = "default"
    transform: tuple[Transform, ...] = ()

    closed: ClassVar[bool] = False
    bounded: ClassVar[bool] = True
    # Whether crossings are searched for, and come with a certificate (`unresolved`).
    searched: ClassVar[bool] = False

    @property
    def kind(self) -> "type[Primitive]":
        """Objects of one kind share their code."""
        return type(self)

    @classmethod
    def columns(cls, thing: Any, table: Any) -> dict[str, Any]:
        """The arrays of a table by the names of an object's numbers, as in addresses."""
        return {name: getattr(table, name) for name in quantities(cls)}

    @classmethod
    def table(cls, a: Arrays, things: list) -> Any:
        """The numbers of objects of this kind as arrays, an entry each."""
        return stacked(a, cls, things)

    @staticmethod
    def gone(inside: Any) -> Any:
        """Whether a ray that leaves the object, and runs into it or not, never meets it again."""
        raise TypeError("not known")

    def flaws(self) -> list[tuple[str, str]]:
        """What no field alone can show to be wrong: pairs of a field and what is wrong with it."""
        return []

    def frame(self) -> Frame | Similarity:
        """The map from the canonical shape to the object, before its transform. Fields are Dr.Jit arrays here."""
        raise TypeError(f"{type(self).__name__} has no frame")

    def placed(self, outer: Frame | None) -> Any:
        """What of the object depends on no ray: by default the inverse of its frame."""
        return self.frame().then(outer).inverse()

    def sphere(self, outer: Frame | None) -> tuple[Any, Any]:
        """Centre and radius of a sphere in the world that holds the object."""
        whole = self.frame().then(outer)
        return whole.o, self.reach(whole)

    def bounds(self) -> tuple[np.ndarray, np.ndarray] | None:
        """The least corner and the greatest of a box in world units that holds the object, or None if it is
        unbounded."""
        if not self.bounded:
            return None
        centre, radius = (np.array(v, float) for v in self.numbers().sphere(self.outer_numbers()))
        return centre - radius, centre + radius

    def numbers(self) -> "Primitive":
        """This object as `scalars`."""
        return scalars(self)

    def outer_numbers(self) -> Frame | None:
        """The object's transform as a Frame of scalar values."""
        whole = compose(self.transform)
        return None if whole is None else Frame(*(Array3f64(*column) for column in whole.T))

    @staticmethod
    def reach(whole: Frame | Similarity) -> Any:
        """Radius of a sphere about the frame's origin that holds the placed canonical shape."""
        raise TypeError("an unbounded primitive has no reach")

    @staticmethod
    def seen(placed: Any, o: Any) -> Seen:
        """What of the object depends on the ray's origin only."""
        return Seen(placed, placed.point(o))

    @classmethod
    def first(cls, seen: Seen, ray: Ray, leaving: Any, inside: Any) -> Any:
        """Distance of the first crossing with t > 0, inf if there is none.

        `leaving`: the ray starts on this object, and runs into it if `inside`; None if no ray does.
        """
        raise TypeError(f"{cls.__name__} has no first crossing")

    @classmethod
    def blocks(cls, seen: Seen, ray: Ray, length: Any, arrives: Any, inward: Any, leaving: Any, inside: Any) -> Any:
        """Whether the object lies between the ray's origin and the point at `length`.

        `arrives`: that point lies on this object; `inward`: the ray reaches it from within. leaving, inside: as in
        first.
        """
        raise TypeError(f"{cls.__name__} has no blocks")

    @classmethod
    def runs_within(cls, seen: Seen, ray: Ray, outwards: Any, begin: Any, end: Any, error: Any) -> Any:
        """Whether a ray runs in the object between two distances, of which one is on its surface.

        outwards: the ray's slope along the normal there, as seen by who goes away from there. error: how well that
        point is known.
        """
        return outwards < 0

    @classmethod
    def passage(cls, seen: Seen, ray: Ray, length: Any, arrives: Any, leaving: Any) -> tuple[Any, Any]:
        """For a ray that the object lies in the way of: whether it enters and leaves it on that way, and how long it is
        inside. A point of the object's own surface counts as entered or left. A flat object has no inside.
        """
        return arrives & ~arrives, 0 * length

    @classmethod
    def unresolved(cls, seen: Any, ray: Ray) -> Any:
        """How many parts of a ray are left of which it is not known whether the object is crossed there: 0 expected."""
        raise TypeError(f"{cls.__name__} is not searched for")

    @staticmethod
    def level(placed: Any, p: Any) -> tuple[Any, Any]:
        """(f, g): a function that is zero on the surface and its world gradient at p, outwards."""
        raise TypeError("no level")

    @staticmethod
    def sided(placed: Any, p: Any) -> Any:
        """Whether there is one normal at a point of the surface, and so two sides."""
        return True

    @staticmethod
    def uv(placed: Any, p: Any) -> tuple[Any, Any]:
        """Texture coordinates of a point on the surface; v runs upwards."""
        raise TypeError("no uv")

    def mitsuba(self) -> Twin | str:
        """The same shape for Mitsuba, or why there is none."""
        return f"Mitsuba has no {self.type}"


def scalars(thing: Any) -> Any:
    """A record with its fields as scalar Dr.Jit values, so that the methods written for kernels serve the host."""
    sizes = quantities(type(thing))
    return replace(thing, **{k: Array3f64(*getattr(thing, k)) for k, q in sizes.items() if q.size == 3})


def boxed_reach(whole: Frame) -> Any:
    """Distance of the farthest of the corners (+-1, +-1, +-1)."""
    far = [dr.squared_norm(whole.x + sy * whole.y + sz * whole.z) for sy in (1, -1) for sz in (1, -1)]
    return dr.sqrt(dr.maximum(dr.maximum(far[0], far[1]), dr.maximum(far[2], far[3])))


def homogeneous(frame: Frame, outer: np.ndarray | None) -> np.ndarray:
    """A frame of scalar values as a 4 x 4 matrix, after a transform: what Mitsuba's `to_world` takes."""
    whole = np.vstack([np.stack([np.array(v, float) for v in (frame.x, frame.y, frame.z, frame.o)], 1), [0, 0, 0, 1]])
    return whole if outer is None else np.vstack([outer, [0, 0, 0, 1]]) @ whole
