"""The objects of original VisRayTrace scenes as plain dicts of visray's fields."""

import re
from collections.abc import Callable
from math import hypot
from typing import Any

from visray.primitives.clips import Ball
from visray.quantities import FARTHEST
from visray.scene.legacy.entry import Entry, Log
from visray.scene.legacy.keys import OBJECTS
from visray.scene.legacy.materials import Looks
from visray.scene.legacy.names import distinct, valid
from visray.scene.messages import hint, line

NOT_BUILT = {"mesh": "objFileName"}
HYPERBOLOID = ("x2", "y2", "-z2", "-1")
# What the original read as it is written, unless a letter comes again and one of the two has a digit, as in "xx2".
PLAIN = re.compile(r"-?(\d+(\.\d*)?)?([xyz]\^?\d?)*", re.ASCII)
AGAIN = re.compile(r"([xyz])\^?\d.*\1|([xyz]).*\2\^?\d", re.ASCII)


def objects(raw: list[Any], looks: Looks, log: Log) -> dict[str, dict]:
    """The objects by name; their materials are added to `looks`."""
    things: dict[str, dict] = {}
    taken: set[str] = set()
    for i, found in enumerate(raw):
        if not isinstance(found, dict):
            log.error(line(f"objects.{i}", found, "must be an object {...}"))
            continue
        name = _name(found, i, taken, log)
        thing = _object(found, f"objects.{name}", log)
        if thing is None:
            continue
        material = looks.name(found, name, log)
        if thing["type"] == "rectangle" and "texture" in looks.materials[material]:
            thing |= _upright(thing)
        things[name] = thing | {"material": material}
    return things


def clipped(things: dict[str, dict], eye: tuple[float, ...], log: Log) -> None:
    """Bounds the polynomials, which had no end in the original, by a ball about the origin, twice as large as the
    camera is far from there, or by a ball of the default size.

    It holds the camera and all around it up to its distance from the origin, and towards the origin three times as
    far. A larger ball would show no more of most surfaces, but costs accuracy: f is summed from powers of coordinates
    as large as the ball.
    """
    radius = min(max(2 * hypot(*eye), Ball.radius), FARTHEST)
    for name, thing in things.items():
        if thing["type"] == "polynomial":
            thing["clip"] = {"type": "sphere", "radius": radius}
            text = "is drawn of the surface; the original had no such bound"
            log.warn(f"objects.{name}.monomis: what lies within {radius:.4g} of the origin {text}")


def _name(found: dict, i: int, taken: set[str], log: Log) -> str:
    """A name that is valid and no other object's; warns if it is not the one written."""
    written, kind = found.get("name", ""), found.get("type")
    wanted = valid(written) if isinstance(written, str) else ""
    wanted = wanted or (valid(kind).lower() if isinstance(kind, str) else "") or "object"
    name = distinct(wanted, taken)
    taken.add(name)
    if name != written:
        log.warn(line(f"objects.{i}.name", written, f"the object is called {name!r} here"))
    return name


def _object(found: dict, address: str, log: Log) -> dict | None:
    """The fields of an object without its material, or None if there is an error."""
    kind = found.get("type")
    if kind is None:
        log.error(f"{address}: the key 'type' is missing; one of {', '.join(OBJECTS)}")
        return None
    key = kind.strip().casefold() if isinstance(kind, str) else None
    if key not in OBJECTS:
        log.error(line(f"{address}.type", kind, f"unknown type; {hint(kind, OBJECTS)}"))
        return None
    if key in NOT_BUILT:
        log.error(line(f"{address}.{NOT_BUILT[key]}", found.get(NOT_BUILT[key]), f"{key} is not built yet"))
        return None
    errors = len(log.errors)
    made = BUILDERS[key](Entry(found, address, OBJECTS[key], log))
    return made if len(log.errors) == errors else None


def _sphere(e: Entry) -> dict:
    return {"type": "sphere", "center": e.vector("center", (0.0,) * 3), "radius": e.number("radius")}


def _plane(e: Entry) -> dict:
    return {"type": "plane", "point": e.vector("point", (0.0,) * 3), "normal": e.vector("normal")}


def _triangle(e: Entry) -> dict:
    corners = {"p1": (-1.0, -1.0, 0.0), "p2": (1.0, -1.0, 0.0), "p3": (0.0, 2.0, 0.0)}
    return {"type": "triangle"} | {ours: e.vector(key, corner) for ours, (key, corner) in zip("abc", corners.items())}


def _cylinder(e: Entry) -> dict:
    """The original read the axis and drew every cylinder upright; here the axis counts."""
    return {
        "type": "cylinder",
        "center": e.vector("center", (0.0,) * 3),
        "axis": e.vector("axis", (0.0, 1.0, 0.0)),
        "radius": e.number("radius", 0.1),
        "height": e.number("h", 4.0),
    }


def _box(e: Entry) -> dict:
    corners = e.vector("minPoint", (-0.5,) * 3), e.vector("maxPoint", (0.5,) * 3)
    return {"type": "box", "min": tuple(map(min, *corners)), "max": tuple(map(max, *corners))}


def _polynomial(e: Entry) -> dict:
    """The original misread some of what is written; here all of it counts as it is written."""
    found = e.entries("monomis")
    for i, text in enumerate(found):
        address = f"{e.at('monomis')}.{i}"
        if not isinstance(text, str):
            e.log.error(line(address, text, 'must be a string such as "-0.5x2y"'))
        elif not PLAIN.fullmatch(text) or AGAIN.search(text):
            e.log.warn(line(address, text, "counts as it is written; the original read it otherwise"))
    if not found:
        e.log.warn(f"{e.at('monomis')}: {'is empty' if e.has('monomis') else 'is missing'}; x2 + y2 - z2 - 1 is used")
    return {"type": "polynomial", "monomis": tuple(found) or HYPERBOLOID}


def _fitted_plane(e: Entry) -> dict:
    """The part of the plane over the rectangle from pmin to pmax in x and z, with its normal on the file's side: as
    `width` runs to +x, it points up where `height` runs to -z, and down where `height` runs to +z.
    """
    point, normal = e.vector("point", (0.0,) * 3), e.vector("normal")
    low, high = e.vector("pmin", size=2), e.vector("pmax", size=2)
    if None in (point, normal, low, high):
        return {}
    if normal[1] == 0:
        e.error("normal", "a fittedplane is bounded in x and z, so its plane must not be upright")
        return {}
    offset = _offset(e, point)
    (x0, x1), (z0, z1) = (sorted((a + o, b + o)) for a, b, o in zip(low, high, offset))
    if x0 == x1 or z0 == z1:
        e.error("pmax", "must differ from pmin in x and in z")
        return {}
    slope_x, slope_z = (0.0 - n / normal[1] for n in (normal[0], normal[2]))
    x, z, side = (x0 + x1) / 2, (z0 + z1) / 2, -1.0 if normal[1] > 0 else 1.0
    y = point[1] + slope_x * (x - point[0]) + slope_z * (z - point[2])
    width = (x1 - x0, slope_x * (x1 - x0), 0.0)
    height = (0.0, side * slope_z * (z1 - z0), side * (z1 - z0))
    return {"type": "rectangle", "center": (x, y, z), "width": width, "height": height}


def _upright(plane: dict) -> dict:
    """The side of a plane that has a picture on it: in the original u runs to +x and row 0 is at the least z, whichever
    side the normal is on. Our v runs up from the last row, so `height` runs to -z, and the normal points up.
    """
    x, y, z = plane["height"]
    return {"height": (x, -y, -z) if z > 0 else (x, y, z)}


def _offset(e: Entry, point: tuple[float, ...]) -> tuple[float, float]:
    """What to add to pmin and pmax: with puntoCentro they are relative to the point."""
    middle = (point[0], point[2])
    relative = e.flag("puntoCentro")
    if relative is None and any(middle):
        e.log.warn(f"{e.at('puntoCentro')}: is missing; pmin and pmax are read as absolute x and z")
    return middle if relative else (0.0, 0.0)


BUILDERS: dict[str, Callable[[Entry], dict]] = {
    "sphere": _sphere,
    "plane": _plane,
    "fittedplane": _fitted_plane,
    "triangle": _triangle,
    "cylinder": _cylinder,
    "box": _box,
    "polynomial": _polynomial,
}
