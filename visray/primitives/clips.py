"""Clips: what part of an unbounded surface there is."""

from dataclasses import dataclass
from typing import Any, Literal

from pydantic import ConfigDict

from visray.geometry import Frame, Similarity
from visray.primitives.box import Box
from visray.primitives.primitive import Bounds
from visray.primitives.sphere import Sphere
from visray.quantities import Length, Point


@dataclass(frozen=True, kw_only=True)
class Clip:
    """What part of a surface there is: that in a solid, whose fields these are."""

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")
    # Without a type: it would be a field.
    solid = None

    def frame(self) -> Frame | Similarity:
        """The map from the canonical solid to this one."""
        return self.solid.frame(self)

    def half(self) -> tuple[Any, Any, Any]:
        """Half its extents along the axes."""
        f = self.frame()
        return (f.scale,) * 3 if isinstance(f, Similarity) else (f.x.x, f.y.y, f.z.z)

    def bounds(self, outer: Frame | None) -> Bounds:
        """A box and a ball in the world that hold it."""
        return self.solid.bounds(self, outer)

    def shape(self) -> tuple:
        """As of a primitive."""
        return ()

    def extents(self, whole: Frame | Similarity, shape: tuple) -> tuple[Any, Any]:
        """As of a primitive."""
        return self.solid.extents(whole, shape)

    def flaws(self) -> list[tuple[str, str]]:
        """As of a primitive."""
        return self.solid.flaws(self)


@dataclass(frozen=True, kw_only=True)
class Ball(Clip):
    """A clip: all points within `radius` of `center`."""

    type: Literal["sphere"] = "sphere"
    center: Point = (0.0, 0.0, 0.0)
    radius: Length = 5.0

    solid = Sphere


@dataclass(frozen=True, kw_only=True)
class Block(Clip):
    """A clip: all points between two corners, `min` and `max`."""

    type: Literal["box"] = "box"
    min: Point = (-1.0, -1.0, -1.0)
    max: Point = (1.0, 1.0, 1.0)

    solid = Box
