"""Clips: solids that bound polynomial surfaces. Only the part of a surface inside its clip exists."""

from dataclasses import dataclass, field
from typing import Any, Literal

from pydantic import ConfigDict

from visray.geometry import Frame, Similarity
from visray.primitives.box import Box
from visray.primitives.primitive import Bounds
from visray.primitives.sphere import Sphere
from visray.quantities import Length, Point
from visray.records import record_kind


@dataclass(frozen=True, kw_only=True)
class Clip:
    """The solid that bounds a polynomial surface. A subclass has the geometric fields of the primitive `solid`."""

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")
    # The class of the primitive with this shape. It has no type annotation, because an annotation would make it a field
    # of the scene.
    solid = None

    def frame(self) -> Frame | Similarity:
        """The map from the canonical solid to the clip, as Primitive.frame."""
        return self.solid.frame(self)

    def half_sides(self) -> tuple[Any, Any, Any]:
        """Half the extent of the clip along x, y and z, as three numbers or arrays."""
        f = self.frame()
        return (f.scale,) * 3 if isinstance(f, Similarity) else (f.x.x, f.y.y, f.z.z)

    def bounds(self, outer: Frame | None) -> Bounds:
        """Bounding box and ball of the clip in world space. outer: the object's transform, or None."""
        return self.solid.bounds(self, outer)

    def shape(self) -> tuple:
        """As Primitive.shape."""
        return ()

    def extents(self, to_world: Frame | Similarity, shape: tuple) -> tuple[Any, Any]:
        """As Primitive.extents."""
        return self.solid.extents(to_world, shape)

    def flaws(self) -> list[tuple[str, str]]:
        """As Primitive.flaws."""
        return self.solid.flaws(self)


@record_kind
@dataclass(frozen=True, kw_only=True)
class Ball(Clip):
    """A spherical clip: all points within `radius` of `center`."""

    type: Literal["sphere"] = "sphere"
    center: Point = field(default=(0.0, 0.0, 0.0), kw_only=False)
    radius: Length = field(default=5.0, kw_only=False)

    solid = Sphere


@record_kind
@dataclass(frozen=True, kw_only=True)
class Block(Clip):
    """A box-shaped clip between the corners `min` and `max`."""

    type: Literal["box"] = "box"
    min: Point = field(default=(-1.0, -1.0, -1.0), kw_only=False)
    max: Point = field(default=(1.0, 1.0, 1.0), kw_only=False)

    solid = Box
