"""Objects of a VisRayTrace scene, as plain dicts of visray's fields."""

import re
from collections.abc import Callable
from math import hypot
from typing import Any

from visray.hints import hint
from visray.primitives.clips import Ball
from visray.quantities import FARTHEST
from visray.scene.legacy.entry import Entry, Log
from visray.scene.legacy.keys import OBJECTS
from visray.scene.legacy.materials import Materials
from visray.scene.legacy.meshes import Meshes
from visray.scene.legacy.moves import Moves
from visray.scene.legacy.names import unique_name, valid_name
from visray.scene.messages import line

HYPERBOLOID = ("x2", "y2", "-z2", "-1")
# Monomials that VisRayTrace read correctly. Exceptions: a letter occurs twice, once with an exponent, as in "xx2".
READ_CORRECTLY = re.compile(r"-?(\d+(\.\d*)?)?([xyz]\^?\d?)*", re.ASCII)
REPEATED_WITH_EXPONENT = re.compile(r"([xyz])\^?\d.*\1|([xyz]).*\2\^?\d", re.ASCII)


def objects(raw: list[Any], materials: Materials, meshes: Meshes, moves: Moves, log: Log) -> dict[str, dict]:
    """Dict of the objects by name. Adds their materials to `materials`, and their tracks to `moves`.

    raw: list of the objects as the file gives them.
    """
    readers = FIELDS | {"mesh": meshes.fields}
    by_name: dict[str, dict] = {}
    taken: set[str] = set()
    for i, entry in enumerate(raw):
        if not isinstance(entry, dict):
            log.error(line(f"objects.{i}", entry, "must be an object {...}"))
            continue
        name = _name(entry, i, taken, log)
        shape = _shape(entry, f"objects.{name}", readers, log)
        if shape is None:
            continue
        material = materials.name(entry, name, f"objects.{name}", log)
        if shape["type"] == "rectangle" and "texture" in materials.by_name[material]:
            shape |= _height_for_texture(shape)
        by_name[name] = moves.add(name, shape, entry) | {"material": material}
    return by_name


def clip_polynomials(objects_by_name: dict[str, dict], camera_origin: tuple[float, ...], log: Log) -> None:
    """Bounds polynomials by a ball about the origin, their clip. VisRayTrace did not bound them.

    If D is the distance of the camera from the origin, the radius is 2 D, or that of visray's default clip if that is
    larger. So the camera sees surfaces in all directions up to a distance of D, and toward the origin up to 3 D. A
    larger ball shows no more of most surfaces, and costs accuracy because f is a sum of powers of the coordinates.
    """
    radius = min(max(2 * hypot(*camera_origin), Ball.radius), FARTHEST)
    for name, fields in objects_by_name.items():
        if fields["type"] == "polynomial":
            fields["clip"] = {"type": "sphere", "radius": radius}
            text = f"only the part within {radius:.4g} of the origin is drawn; VisRayTrace had no such bound"
            log.warn(f"objects.{name}.monomis: {text}")


def _name(entry: dict, i: int, taken: set[str], log: Log) -> str:
    """A valid and unique name for an object. Warns if this name differs from the name in the file.

    entry: the object as the file gives it.
    i: index of the object in the file.
    taken: names of other objects; the new name is added.
    """
    written, kind = entry.get("name", ""), entry.get("type")
    name = valid_name(written) if isinstance(written, str) else ""
    name = name or (valid_name(kind).lower() if isinstance(kind, str) else "") or "object"
    name = unique_name(name, taken)
    taken.add(name)
    if name != written:
        log.warn(line(f"objects.{i}.name", written, f"the object is called {name!r} in visray"))
    return name


def _shape(entry: dict, address: str, readers: dict[str, Callable[[Entry], dict]], log: Log) -> dict | None:
    """Fields of an object without its material. If something in it is wrong, None with an error in the log.

    entry: the object as the file gives it.
    readers: for each type of object, the function that reads its fields.
    """
    kind = entry.get("type")
    if kind is None:
        log.error(f"{address}: the key 'type' is missing; one of {', '.join(OBJECTS)}")
        return None
    key = kind.strip().casefold() if isinstance(kind, str) else None
    if key not in OBJECTS:
        log.error(line(f"{address}.type", kind, f"unknown type; {hint(kind, OBJECTS)}"))
        return None
    errors_before = len(log.errors)
    shape = readers[key](Entry(entry, address, OBJECTS[key], log))
    return shape if len(log.errors) == errors_before else None


def _sphere(e: Entry) -> dict:
    """Fields of a sphere."""
    return {"type": "sphere", "center": e.vector("center", (0.0,) * 3), "radius": e.number("radius")}


def _plane(e: Entry) -> dict:
    """Fields of an infinite plane."""
    return {"type": "plane", "point": e.vector("point", (0.0,) * 3), "normal": e.vector("normal")}


def _triangle(e: Entry) -> dict:
    """Fields of a triangle."""
    corners = {"p1": (-1.0, -1.0, 0.0), "p2": (1.0, -1.0, 0.0), "p3": (0.0, 2.0, 0.0)}
    return {"type": "triangle"} | {
        corner: e.vector(key, default) for corner, (key, default) in zip("abc", corners.items())
    }


def _cylinder(e: Entry) -> dict:
    """Fields of a cylinder. VisRayTrace ignored the axis and drew every cylinder upright; visray uses the axis."""
    return {
        "type": "cylinder",
        "center": e.vector("center", (0.0,) * 3),
        "axis": e.vector("axis", (0.0, 1.0, 0.0)),
        "radius": e.number("radius", 0.1),
        "height": e.number("h", 4.0),
    }


def _box(e: Entry) -> dict:
    """Fields of a box. The file may give any two opposite corners."""
    corners = e.vector("minPoint", (-0.5,) * 3), e.vector("maxPoint", (0.5,) * 3)
    return {"type": "box", "min": tuple(map(min, *corners)), "max": tuple(map(max, *corners))}


def _polynomial(e: Entry) -> dict:
    """Fields of a polynomial surface. VisRayTrace misread some monomials; visray reads all as they are written."""
    monomials = e.items("monomis")
    for i, text in enumerate(monomials):
        address = f"{e.at('monomis')}.{i}"
        if not isinstance(text, str):
            e.log.error(line(address, text, 'must be a string such as "-0.5x2y"'))
        elif not READ_CORRECTLY.fullmatch(text) or REPEATED_WITH_EXPONENT.search(text):
            e.log.warn(line(address, text, "is read as it is written; VisRayTrace misread it"))
    if not monomials:
        e.log.warn(f"{e.at('monomis')}: {'is empty' if e.has('monomis') else 'is missing'}; x2 + y2 - z2 - 1 is used")
    return {"type": "polynomial", "monomis": tuple(monomials) or HYPERBOLOID}


def _fitted_plane(e: Entry) -> dict:
    """Fields of a rectangle for a fittedplane: the part of a plane whose x and z lie between pmin and pmax.

    The normal points to the same side of the plane as in the file. `width` points to +x. So the normal points up if
    `height` points to -z, and down if `height` points to +z.
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


def _height_for_texture(rectangle: dict) -> dict:
    """Dict with the field `height` of a textured rectangle. It is reversed if the image would be upside down otherwise,
    compared with VisRayTrace.

    In VisRayTrace the top row of the image lies at the smallest z, whichever side the normal points to. In visray the
    top row lies at the end of `height`. So `height` must point to -z, and then the normal points up.
    """
    x, y, z = rectangle["height"]
    return {"height": (x, -y, -z) if z > 0 else (x, y, z)}


def _offset(e: Entry, point: tuple[float, ...]) -> tuple[float, float]:
    """Offset in x and z that is added to pmin and pmax: x and z of the point if puntoCentro is true, else 0."""
    center = (point[0], point[2])
    relative = e.flag("puntoCentro")
    if relative is None and any(center):
        e.log.warn(f"{e.at('puntoCentro')}: is missing; pmin and pmax are read as absolute x and z")
    return center if relative else (0.0, 0.0)


# For each type of object but the mesh, the function that reads its fields.
FIELDS: dict[str, Callable[[Entry], dict]] = {
    "sphere": _sphere,
    "plane": _plane,
    "fittedplane": _fitted_plane,
    "triangle": _triangle,
    "cylinder": _cylinder,
    "box": _box,
    "polynomial": _polynomial,
}
