"""Edits of scenes: the value at an address, and the plain dicts of a scene with other values at some addresses, before
they are checked.

A node is an instance, a dict or a tuple on the way from the scene to a value. An entry is a texture, a material, a
light, a geometry or an object.
"""

import re
from collections.abc import Collection, Mapping
from dataclasses import asdict, fields, is_dataclass
from typing import Any

from visray import camera as cameras
from visray import lights, primitives, textures
from visray.arguments import python_number, shown
from visray.colors import color_as_picked
from visray.data.data_scene import Data
from visray.data.layer import ROW_NUMBER
from visray.errors import UserError
from visray.hints import OTHER_WORDS, hint
from visray.lights.light import INSTEAD
from visray.materials import Material
from visray.operands import ROLES
from visray.primitives.primitive import Primitive
from visray.scene.scene import Scene
from visray.scene.validated import plain
from visray.terminal import printable

# The sections of a scene, each with the kinds of its entries.
COLOR = re.compile(r"(materials\.[^.]+)\.color((?:\..*)?)")
SECTIONS = {
    "textures": frozenset(textures.KINDS),
    "materials": frozenset((Material,)),
    "lights": frozenset(lights.KINDS),
    "geometries": frozenset(primitives.KINDS),
    "objects": frozenset(primitives.OBJECTS),
}


def parts(scene: Scene) -> dict[str, Any]:
    """The scene as plain dicts. Only entries stay instances."""
    sections = {f.name: getattr(scene, f.name) for f in fields(scene)}
    return {name: _with_instances(part) if name in SECTIONS else plain(part) for name, part in sections.items()}


def _with_instances(section: Any) -> Any:
    """A section as a dict of entries. Dataclass instances stay as they are; all else becomes plain dicts."""
    if not isinstance(section, dict):
        return plain(section)
    return {name: entry if is_dataclass(type(entry)) else plain(entry) for name, entry in section.items()}


def canonical(address: str) -> str:
    """The address of the field that an address means: materials.red.kd for materials.red.color; else the same."""
    return COLOR.sub(r"\1.kd\2", address) if COLOR.fullmatch(address) else address


def value_at(scene: Scene, address: str) -> Any:
    """Value at an address. Raises UserError if there is no such value. Domain: the scene's data have no flaws."""
    if not is_below_layer(scene, address):
        return _value_at(scene, address)
    return scene.data.value(*_row_edit(scene.data, address))


def value_in(raw: dict[str, Any], address: str) -> Any:
    """Value at an address of a scene that is given as plain dicts. Raises UserError if there is no such value."""
    return _value_at(raw, address)


def edited(scene: Scene, assignments: Mapping[str, Any]) -> dict[str, Any]:
    """The scene as plain dicts, with other values at some addresses, which are not checked. Only entries that no
    assignment changes stay instances. Raises UserError if there is no such address.

    assignments: dict from addresses to new values. They are assigned in order.

    Domain: if an address is below a layer, the scene's data have no flaws.
    """
    raw = parts(scene)
    for address, new in assignments.items():
        if is_below_layer(scene, address):
            raw = raw | {"data": _with_row(raw["data"], *_row_edit(scene.data, address), python_number(new))}
            continue
        _value_at(raw, address)
        if COLOR.fullmatch(address):
            raw = _with_color(raw, address, python_number(new))
        elif address == "camera.type" and isinstance(new, str) and new in cameras.BY_TYPE:
            raw = raw | {"camera": cameras.retyped(raw["camera"], new)}
        elif address == "film.filter.type":
            raw = raw | {"film": raw["film"] | {"filter": {"type": python_number(new)}}}
        else:
            raw = with_value(raw, address.split("."), _without_instances(new))
    return raw


def _with_color(raw: dict[str, Any], address: str, new: Any) -> dict[str, Any]:
    """The plain dicts with another colour of a material, whose ka follows then. address: one that COLOR matches"""
    owner, component = COLOR.fullmatch(address).groups()
    if component:
        right = f"write {owner}.color as a whole, or {canonical(address)} in linear light"
        raise UserError(printable(f"{address} = {shown(new)}: color has no numbers of its own; {right}"))
    raw = with_value(raw, [*owner.split("."), "ka"], None)
    try:
        return with_value(raw, canonical(address).split("."), color_as_picked(new))
    except ValueError as error:
        raise UserError(printable(f"{address} = {shown(new)}: {error}")) from None


def within(address: str, other: str) -> bool:
    """Whether an address is another one, or a part of it."""
    return f"{address}.".startswith(f"{other}.")


def is_below_layer(scene: Scene, address: str) -> bool:
    """Whether an address begins with a layer of data, such as `data.rain`, as those of its rows do."""
    head, *rest = address.split(".")
    return head == "data" and scene.data is not None and bool(rest) and rest[0] in scene.data.layers


def _row_edit(data: Data, address: str) -> tuple[str, str, str]:
    """Layer, number and property of an address of a row, such as `data.rain.12.height`. Raises UserError if there is no
    such number. Domain: addresses below a layer of the data, which have no flaws."""
    _, layer, *rest = address.split(".")
    rows = data.rows[layer]
    if not rest:
        raise UserError(f"{address}: write a row and a property, as in {address}.0.lon, or data.layers.{layer}")
    if not re.fullmatch(ROW_NUMBER, rest[0]):
        raise UserError(printable(f"{address}: the fields of a layer are below data.layers.{layer}; a row is a number"))
    if rows.index(int(rest[0])) is None:
        raise UserError(printable(f"{address}: data.{layer} shows no row {rest[0]}; {rows.numbers_text()}"))
    if len(rest) != 2 or rest[1] not in rows.values:
        wrong = ".".join(rest[1:])
        raise UserError(printable(f"{address}: a row of data.{layer} has no {wrong!r}; {hint(wrong, rows.values)}"))
    return layer, rest[0], rest[1]


def _with_row(data: Any, layer: str, number: str, name: str, new: Any) -> dict:
    """Copy of the raw data in which one number of a row has another value."""
    data = plain(data)
    own = data["layers"][layer]
    edits = own["rows"] | {number: own["rows"].get(number, {}) | {name: new}}
    return data | {"layers": data["layers"] | {layer: own | {"rows": edits}}}


def keys_of(node: Any) -> Collection[str]:
    """Keys that may follow the address of a node. A single value, such as a number, has none."""
    if is_dataclass(node):
        return [f.name for f in fields(node)]
    if isinstance(node, dict):
        return node.keys()
    return [str(i) for i in range(len(node))] if isinstance(node, (tuple, list)) else []


def entry_of(node: Any, key: str) -> Any:
    """Value under one key of a node. Domain: the node has the key."""
    if is_dataclass(node):
        return getattr(node, key)
    return node[key] if isinstance(node, dict) else node[int(key)]


def _value_at(root: Any, address: str) -> Any:
    """Value at an address. Raises UserError if there is no such value.

    root: the node at which the address begins, a scene or its plain dicts.
    """
    node, keys = root, canonical(address).split(".")
    for i, key in enumerate(keys):
        choices = keys_of(node)
        if key not in choices:
            owner = ".".join(keys[:i]) or "the scene"
            more = ["color"] if i == 2 and keys[0] == "materials" else []
            text = f"{owner} has no {key!r}; {hint(key, [*more, *choices])}"
            if i == 0 and (own := OTHER_WORDS.get(key, key)) in Scene.OWNERS:
                text = f"the scene has no {key!r}; write {'.'.join((Scene.OWNERS[own], own, *keys[1:]))}"
            if owner == "camera" and node is not None and (instead := _misplaced(node, key)):
                text = instead
            if i == 2 and keys[0] == "objects" and key in Primitive.MISPLACED:
                text = _of_its_material(root, node, key)
            if i == 2 and keys[0] == "lights" and key in INSTEAD:
                text = f"{owner} has no {key!r}; write {owner}.{INSTEAD[key]}"
            if key in (own := getattr(node, "parameters", None) or ()) and isinstance(own, dict):
                text = f"{owner} has no {key!r}, but its formula has; write {owner}.parameters.{key}"
            if re.fullmatch(r"data\.layers\.[^.]+\.rows", owner) and re.fullmatch(ROW_NUMBER, key):
                text = f"no number of row {key} is replaced; for a number of the source, write {_of_row(keys)}"
            if not choices and not isinstance(node, (dict, tuple)):
                text = f"{owner} is a single value; leave .{'.'.join(keys[i:])} out"
                if node is None and keys[i - 1] in ROLES:
                    text = f"{owner} is null, as there are no operands; assign a list of objects to it"
            raise UserError(printable(f"{address}: {text}"))
        node = entry_of(node, key)
    return node


def _of_row(keys: list[str]) -> str:
    """The address of a number of a row, from the keys of the address of its replacement below `rows`."""
    _, _, layer, _, number, *rest = keys
    return ".".join(["data", layer, number, *(rest or ["height"])])


def _misplaced(camera: Any, key: str) -> str | None:
    """What is right instead of a key that only another type of camera has; None for all other keys.

    camera: a camera, or its plain dict.
    """
    type_name = camera["type"] if isinstance(camera, dict) else camera.type
    kind = cameras.BY_TYPE.get(type_name) if isinstance(type_name, str) else None
    return kind and kind.MISPLACED.get(key)


def _of_its_material(root: Any, node: Any, key: str) -> str:
    """What is right instead of a key of an object that materials have.

    root: a scene, or its plain dict. node: the object, or its plain dict.
    """
    name = node.get("material") if isinstance(node, dict) else getattr(node, "material", None)
    if name in (root.get("materials", {}) if isinstance(root, dict) else root.materials):
        return f"its material has this; write materials.{name}.{key}"
    return Primitive.MISPLACED[key]


def _without_instances(new: Any) -> Any:
    """A value with dicts in place of dataclass instances, so that the value is checked like the content of a file."""
    if is_dataclass(new) and not isinstance(new, type):
        return asdict(new)
    if isinstance(new, dict):
        return {k: _without_instances(v) for k, v in new.items()}
    return tuple(map(_without_instances, new)) if isinstance(new, (tuple, list)) else python_number(new)


def with_value(node: Any, keys: list[str], new: Any) -> Any:
    """Copy of a node with another value at the end of a path of keys.

    keys: the path, from the node to the value.
    new: the new value.

    Instances on the path become dicts, so that they are checked again, with the new value.
    """
    if not keys:
        return new
    key, *rest = keys
    node = plain(node) if is_dataclass(node) else node
    if isinstance(node, dict):
        return node | {key: with_value(node[key], rest, new)}
    i = int(key)
    return (*node[:i], with_value(node[i], rest, new), *node[i + 1 :])
