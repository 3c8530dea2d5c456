"""The data of a VisRayTrace scene (typeScene REALDATA) as the field `data` of a visray scene."""

from dataclasses import dataclass, field
from typing import Any

from visray.data.data_scene import RESERVED
from visray.hints import hint
from visray.scene.legacy.color_maps import palette
from visray.scene.legacy.data_layers import (
    Property,
    domain,
    gizmo,
    largest_size,
    layers_of,
    report_values_outside,
    value_column,
)
from visray.scene.legacy.data_mapping import Corners, corners, flat_placement
from visray.scene.legacy.data_places import FlatPlacement, GlobePlacement
from visray.scene.legacy.data_rows import data_rows
from visray.scene.legacy.entry import Entry, Log
from visray.scene.legacy.keys import BASES, OBJECTS, PROPERTY
from visray.scene.legacy.materials import Materials
from visray.scene.legacy.names import unique_name
from visray.scene.legacy.objects import FIELDS
from visray.scene.messages import line


@dataclass(frozen=True)
class DataParts:
    """Data of a scene.

    fields: the field `data` of the visray scene; empty if there are errors.
    properties: for each layer, the address of its property in the file.
    """

    fields: dict[str, Any] = field(default_factory=dict)
    properties: dict[str, str] = field(default_factory=dict)


def data_parts(e: Entry, materials: Materials, compat: bool) -> DataParts:
    """The data of a scene. Adds the materials of the base and of the gizmos to `materials`.

    e: the scene file. It has a base.
    compat: whether data are mirrored and coloured as in VisRayTrace.
    """
    log = e.log
    errors_before = len(log.errors)
    base = _base(e)
    material = "" if base is None else materials.name(e.values["base"], "base", "base", log)
    properties = [
        _property(raw, f"{e.at('properties')}.{i}", compat, log) for i, raw in enumerate(e.items("properties"))
    ]
    properties = [p for p in properties if p is not None]
    given = corners(e, on_globe=base is not None and base["type"] == "sphere")
    if len(log.errors) > errors_before:
        return DataParts()
    base["pictured"] = "texture" in materials.by_name[material]
    placement, largest = _placement(given, base, properties, compat, e), largest_size(given, log)
    if placement is None:
        return DataParts()
    layers: dict[str, dict] = {}
    addresses: dict[str, str] = {}
    for p in properties:
        report_values_outside(p, largest)
        name = value_column(p.e)
        own = materials.name(p.e.values, unique_name(name, materials.by_name), p.e.address, log, colored=True)
        for layer in layers_of(p, placement, own, largest, compat):
            layer_name = unique_name(name, (*layers, *RESERVED))
            layers[layer_name], addresses[layer_name] = layer, p.e.address
    return DataParts({"base": placement.base | {"material": material}, "layers": layers}, addresses)


def _base(e: Entry) -> dict[str, Any] | None:
    """Fields of the base: those of visray's rectangle, plane or sphere, and the height `y` on which gizmos stand. None
    with errors in the log if something in it is wrong."""
    raw = e.values.get("base")
    if not isinstance(raw, dict):
        text = f"it is an object of the type {', '.join(BASES)}"
        e.log.error(
            line("base", raw, f"is no object; {text}") if e.has("base") else f"base: the key is missing; {text}"
        )
        return None
    kind = raw.get("type")
    key = kind.strip().casefold() if isinstance(kind, str) else None
    if kind is None:
        e.log.error(f"base: the key 'type' is missing; one of {', '.join(BASES)}")
    elif key not in BASES:
        e.log.error(line("base.type", kind, f"cannot be a base; {hint(kind, BASES)}"))
    if key not in BASES:
        return None
    errors_before = len(e.log.errors)
    own = Entry(raw, "base", OBJECTS[key], e.log)
    fields = FIELDS[key](own)
    if len(e.log.errors) > errors_before:
        return None
    return fields if key == "sphere" else fields | {"y": _level(own)}


def _level(base: Entry) -> float:
    """Height of a flat base. In VisRayTrace all gizmos stand at y of the base's point. So the base is level in visray,
    even if its normal leans."""
    x, y, z = base.vector("normal")
    if y == 0:
        base.error("normal", "the base of data lies level, so its normal must not be level")
    elif x or z:
        text = "the base is level; gizmos stand at y of its point, as in VisRayTrace"
        base.log.warn(line(base.at("normal"), base.values["normal"], text))
    return base.vector("point", (0.0,) * 3)[1]


def _property(raw: Any, address: str, compat: bool, log: Log) -> Property | None:
    """A property of the file; None if it has no rows, or with errors in the log if something in it is wrong.

    raw: the property as the file gives it.
    """
    if not isinstance(raw, dict):
        log.error(line(address, raw, "must be an object {...}"))
        return None
    e = Entry(raw, address, PROPERTY, log)
    kind, rows = gizmo(e), data_rows(e, compat)
    ends = None if rows is None else domain(e, rows)
    if kind is None or ends is None:
        return None
    return Property(e, kind, ends, palette(e), rows)


def _placement(
    given: Corners, base: dict[str, Any], properties: list[Property], compat: bool, e: Entry
) -> FlatPlacement | GlobePlacement | None:
    """Where the data of all properties lie; None with an error in the log."""
    points = [point for p in properties for point in zip(p.rows.x, p.rows.z)]
    if base["type"] != "sphere":
        return flat_placement(given, base, points, compat, e.log)
    if beyond := sum(abs(z) > 90 for _, z in points):
        text = "a row is [longitude, latitude, value]; the way goes on over the pole, as in VisRayTrace"
        e.log.warn(f"{e.at('properties')}: {beyond} of {len(points)} latitudes are beyond a pole; {text}")
    return GlobePlacement({"type": "globe", "center": base["center"], "radius": base["radius"]})
