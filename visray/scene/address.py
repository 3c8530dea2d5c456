"""Addresses of values in a scene, such as `objects.ball.center.1`: keys and indices, separated by dots. Error messages,
the command line and Python use the same addresses.

A node is an instance, a dict or a tuple on the way from the scene to a value.
"""

import re
from collections.abc import Collection, Mapping
from dataclasses import asdict, fields, is_dataclass
from typing import Any, get_args

from visray import camera as cameras
from visray.arguments import checked_arguments, python_number
from visray.data.data_scene import Data
from visray.data.layer import ROW_NUMBER
from visray.errors import UserError
from visray.hints import hint
from visray.operands import ROLES
from visray.quantities import Quantity, quantities
from visray.scene.annotations import bare, is_union
from visray.scene.check import checked, examined, parts
from visray.scene.scene import Scene
from visray.scene.source import parse
from visray.scene.validated import plain
from visray.terminal import printable

# In the value of an assignment: a further assignment, after a comma, a semicolon or a space.
SECOND = re.compile(rf"[,;\s]\s*((?:{'|'.join(f.name for f in fields(Scene))})(?:\.[^=]+)?\s*=.*)", re.DOTALL)
# Numbers with commas between them, in parentheses or not.
_NUMBER = r"\s*-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?\s*"
NUMBERS = re.compile(rf"{_NUMBER}(?:,{_NUMBER})+|\({_NUMBER}(?:,{_NUMBER})+\)")
# Decimals that JSON writes in another way.
DECIMAL = re.compile(r"\+?\d+\.\d*|[-+]?\.\d+|-\d+\.")


@checked_arguments
def value(scene: Scene, address: str) -> Any:
    """Value at an address. If there is no such value, raises a UserError that lists the keys to choose from."""
    if not _is_below_layer(scene, address):
        return _value_at(scene, address)
    data = checked(scene).data
    return data.value(*_row_edit(data, address))


@checked_arguments
def replaced(scene: Scene, address: str, new: Any) -> Scene:
    """Copy of the scene with another value at an address. Raises UserError if the new scene is not valid."""
    return changed(scene, {address: new})


def changed(scene: Scene, assignments: Mapping[str, Any]) -> Scene:
    """Copy of the scene with other values at some addresses. Raises UserError if the new scene is not valid.

    assignments: dict from addresses to new values. They are assigned in order, and the scene is checked once, after the
        last one.

    A camera that gets another type keeps the fields that both types have, and gets defaults for the others.

    Textures, materials, lights and objects that no assignment changes are the same instances in both scenes.
    """
    raw, data = parts(scene), None
    for address, new in assignments.items():
        if _is_below_layer(scene, address):
            data = data or checked(scene).data
            raw = raw | {"data": _with_row(raw["data"], *_row_edit(data, address), python_number(new))}
            continue
        _value_at(raw, address)
        if address == "camera.type" and isinstance(new, str) and new in cameras.BY_TYPE:
            raw = raw | {"camera": cameras.retyped(raw["camera"], new)}
        else:
            raw = _with(raw, address.split("."), _without_instances(new))
    result, flaws = examined(raw)
    if flaws:
        raise UserError(*flaws)
    return result


def _is_below_layer(scene: Scene, address: str) -> bool:
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


def parse_assignment(text: str) -> tuple[str, Any]:
    """The address and the value in a text `ADDRESS=VALUE`. VALUE is JSON. A word without quotes is a string, numbers
    with commas between them, such as 0,1,5 or (0, 1, 5), are a list."""
    address, equals, written = (part.strip() for part in text.partition("="))
    if not (address and equals and written):
        raise UserError(f"{text!r}: is not an assignment; write ADDRESS=VALUE, as in objects.ball.radius=2")
    if written[0] != '"' and (second := SECOND.search(written)):
        first, rest = (repr(part.strip()) for part in (f"{address}={written[: second.start()]}", second[1]))
        raise UserError(printable(f"{text!r}: is more than one assignment; write --set {first} --set {rest}"))
    if NUMBERS.fullmatch(written):
        written = f"[{written.strip('()')}]"
    if written[0] not in '{["':
        return address, _word(written)
    source = parse(written, address)
    if source.repeated:
        raise UserError(*(f"{address}: {key}: the key is written twice; keep one" for key in source.repeated))
    return address, source.raw


def numeric_addresses(scene: Scene) -> dict[str, Quantity]:
    """Quantity (size, precision and unit) of each numeric field of the scene, as a dict by address. Numeric fields are
    those whose numbers enter a kernel."""
    return dict(_numeric(scene, ""))


def _word(written: str) -> Any:
    """The value of a word on the command line: a number (also .5, 2. or +1), true, false or null; any other word is a
    string."""
    if DECIMAL.fullmatch(written):
        return float(written)
    try:
        return parse(written, "").raw
    except UserError:
        return written


def _keys(node: Any) -> Collection[str]:
    """Keys that may follow the address of a node. A single value, such as a number, has none."""
    if is_dataclass(node):
        return [f.name for f in fields(node)]
    if isinstance(node, dict):
        return node.keys()
    return [str(i) for i in range(len(node))] if isinstance(node, (tuple, list)) else []


def _entry(node: Any, key: str) -> Any:
    """Value under one key of a node. Domain: the node has the key."""
    if is_dataclass(node):
        return getattr(node, key)
    return node[key] if isinstance(node, dict) else node[int(key)]


def _value_at(root: Any, address: str) -> Any:
    """Value at an address. Raises UserError if there is no such value.

    root: the node at which the address begins, a scene or its plain dicts.
    """
    node, keys = root, address.split(".")
    for i, key in enumerate(keys):
        choices = _keys(node)
        if key not in choices:
            owner = ".".join(keys[:i]) or "the scene"
            text = f"{owner} has no {key!r}; {hint(key, choices)}"
            if owner == "camera" and (instead := _misplaced(node, key)):
                text = instead
            if re.fullmatch(r"data\.layers\.[^.]+\.rows", owner) and re.fullmatch(ROW_NUMBER, key):
                text = f"no number of row {key} is replaced; for a number of the source, write {_of_row(keys)}"
            if not choices and not isinstance(node, (dict, tuple)):
                text = f"{owner} is a single value; leave .{'.'.join(keys[i:])} out"
                if node is None and keys[i - 1] in ROLES:
                    text = f"{owner} is null, as there are no operands; assign a list of objects to it"
            raise UserError(printable(f"{address}: {text}"))
        node = _entry(node, key)
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


def _without_instances(new: Any) -> Any:
    """A value with dicts in place of dataclass instances, so that the value is checked like the content of a file."""
    if is_dataclass(new) and not isinstance(new, type):
        return asdict(new)
    if isinstance(new, dict):
        return {k: _without_instances(v) for k, v in new.items()}
    return tuple(map(_without_instances, new)) if isinstance(new, (tuple, list)) else python_number(new)


def _with(node: Any, keys: list[str], new: Any) -> Any:
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
        return node | {key: _with(node[key], rest, new)}
    i = int(key)
    return (*node[:i], _with(node[i], rest, new), *node[i + 1 :])


def _numeric(node: Any, prefix: str) -> list[tuple[str, Quantity]]:
    """List of (address, quantity) for the numeric fields below a node.

    prefix: the node's address and a dot; "" for the scene.
    """
    if not is_dataclass(node):
        return [n for key in _keys(node) for n in _numeric(_entry(node, key), f"{prefix}{key}.")]
    own, result = quantities(type(node)), []
    for f in fields(node):
        part = getattr(node, f.name)
        quantity = own.get(f.name) or _quantity_in_union(f.type, part)
        result += [(prefix + f.name, quantity)] if quantity else _numeric(part, f"{prefix}{f.name}.")
    return result


def _quantity_in_union(annotation: Any, part: Any) -> Quantity | None:
    """Quantity of a field whose type is a union, such as "a colour or a gradient". None if the type is no union, or if
    the value is a record such as a gradient, whose own fields are the numeric ones.

    annotation: type of the field.
    part: value of the field.
    """
    if is_dataclass(part) or not is_union(bare(annotation)):
        return None
    marks = [m for a in get_args(bare(annotation)) for m in getattr(a, "__metadata__", ()) if isinstance(m, Quantity)]
    return marks[0] if marks else None
