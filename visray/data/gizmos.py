"""Gizmos: the shapes that show the rows of a data layer, one for each row.

A gizmo stands on a foot, a point of the base. `up` is the base's normal there, `east` the direction to the east.

The formulas take arrays of NumPy or of Dr.Jit: with NumPy they give the numbers of a picture, with attached arrays of
Dr.Jit their derivatives. Vectors have the shape (3, N), numbers the shape (N).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from visray import primitives
from visray.primitives.primitive import Primitive


@dataclass(frozen=True)
class Stand:
    """Where gizmos stand and how large they are.

    foot, up, east, north: foot of each gizmo, and unit vectors of the base there
    height: extent along `up`, >= 0
    sign: 1 for gizmos that stand on the base, -1 for those that hang below it
    radius: half their extent along east and north
    sunk: share of the gizmo's own extent along `up` that is below the foot
    """

    foot: Any
    up: Any
    east: Any
    north: Any
    height: Any
    sign: Any
    radius: Any
    sunk: float

    def middle(self, extent: Any) -> Any:
        """The middle of gizmos that extend so far along `up`."""
        return self.foot + self.up * (self.sign * extent * (0.5 - self.sunk))

    def bottom(self, extent: Any) -> Any:
        """The end of such gizmos that is nearest to the base, or in it."""
        return self.foot - self.up * (self.sign * extent * self.sunk)


# What a gizmo is made of: the fields of its kind by name. "frame" is a frame x, y, z, o that follows.
Fields = dict[str, Any]


@dataclass(frozen=True)
class Gizmo:
    """A kind of gizmo.

    name: its name in a scene
    kind: kind of the objects; None if a geometry of the scene decides
    fields: function from a Stand to the fields of the objects
    sizes: names of the properties that give its size
    flat: whether it is flat, and lies on the base
    on_line: whether its places are those of a line on the base, and not the foot of a Stand
    """

    name: str
    kind: type[Primitive] | None
    fields: Callable[[Stand], Fields]
    sizes: tuple[str, ...]
    flat: bool = False
    on_line: bool = False


def _sphere(s: Stand) -> Fields:
    return {"center": s.middle(2 * s.radius), "radius": s.radius}


def _cylinder(s: Stand) -> Fields:
    return {"center": s.middle(s.height), "axis": s.up * s.sign, "radius": s.radius, "height": s.height}


def _cone(s: Stand) -> Fields:
    return {"base": s.bottom(s.height), "axis": s.up * s.sign, "radius": s.radius, "height": s.height}


def _box(s: Stand) -> Fields:
    half = 0.5 * s.height
    return {"frame": (s.east * s.radius, s.up * half, -s.north * s.radius, s.middle(s.height))}


def _triangle(s: Stand) -> Fields:
    bottom = s.bottom(s.height)
    side = s.east * s.radius
    return {"a": bottom - side, "b": bottom + side, "c": bottom + s.up * (s.sign * s.height)}


def _disk(s: Stand) -> Fields:
    return {"center": s.foot, "normal": s.up, "radius": s.radius}


def _line(s: Stand) -> Fields:
    return {"radius": s.radius}


def _geometry(s: Stand) -> Fields:
    return {"frame": (s.east * s.radius, s.up * (s.sign * s.height), -s.north * s.radius, s.bottom(s.height))}


def carrier(gizmo: Gizmo, s: Stand) -> tuple[Any, Any, Any, Any]:
    """The frames x, y, z, o of the coordinates that points of gizmos keep while their feet and sizes change. Domain: no
    lines."""
    extent = s.height if "height" in gizmo.sizes else 2 * s.radius
    return _geometry(replace(s, height=extent))["frame"]


GIZMOS = {
    gizmo.name: gizmo
    for gizmo in (
        Gizmo("sphere", primitives.Sphere, _sphere, ("radius",)),
        Gizmo("cylinder", primitives.Cylinder, _cylinder, ("height", "radius")),
        Gizmo("box", primitives.Box, _box, ("height", "radius")),
        Gizmo("cone", primitives.Cone, _cone, ("height", "radius")),
        Gizmo("triangle", primitives.Triangle, _triangle, ("height", "radius")),
        Gizmo("disk", primitives.Disk, _disk, ("radius",), flat=True),
        Gizmo("line", primitives.Capsule, _line, ("radius",), on_line=True),
        Gizmo("geometry", None, _geometry, ("height", "radius")),
    )
}
# Fields of gizmos that are the same for all rows.
CONSTANT = {"box": {"min": (-1.0, -1.0, -1.0), "max": (1.0, 1.0, 1.0)}}
