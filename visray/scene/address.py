"""Addresses: `objects.ball.center.1` names a value in a scene, in files, on the command line and in Python alike."""

from collections.abc import Collection, Mapping
from dataclasses import asdict, fields, is_dataclass
from typing import Any, get_args

from visray.errors import UserError
from visray.quantities import Quantity, quantities
from visray.scene.check import examined, parts
from visray.scene.messages import bare, hint, is_union, printable
from visray.scene.scene import Scene
from visray.scene.source import parse
from visray.scene.validated import plain


def value(scene: Scene, address: str) -> Any:
    """What stands at an address; raises UserError that lists what is there if the address names nothing."""
    return _found(scene, address)


def replaced(scene: Scene, address: str, new: Any) -> Scene:
    """A checked copy of the scene with another value at an address."""
    return changed(scene, {address: new})


def changed(scene: Scene, assignments: Mapping[str, Any]) -> Scene:
    """A checked copy of the scene with all the assignments made, in order; it is checked once, at the end, and what
    none of them touches is kept as it is."""
    raw = parts(scene)
    for address, new in assignments.items():
        _found(raw, address)
        raw = _with(raw, address.split("."), _plain(new))
    result, wrong = examined(raw)
    if wrong:
        raise UserError(*wrong)
    return result


def parse_assignment(text: str) -> tuple[str, Any]:
    """The address and the value of `ADDRESS=VALUE`. The value is JSON; what does not begin like JSON is a string."""
    address, equals, written = (part.strip() for part in text.partition("="))
    if not (address and equals and written):
        raise UserError(f"{text!r}: is not an assignment; write ADDRESS=VALUE, as in objects.ball.radius=2")
    if written[0] not in '{["':
        return address, _word(written)
    source = parse(written, address)
    if source.repeated:
        raise UserError(*(f"{address}: {key}: the key is written twice; keep one" for key in source.repeated))
    return address, source.raw


def numeric_addresses(scene: Scene) -> dict[str, Quantity]:
    """The addresses of all fields that are numbers in a kernel, each with its quantity."""
    return dict(_numeric(scene, ""))


def _word(written: str) -> Any:
    """A number, true, false or null; any other word as it stands."""
    try:
        return parse(written, "").raw
    except UserError:
        return written


def _keys(whole: Any) -> Collection[str]:
    """What can follow the address of `whole`."""
    if is_dataclass(whole):
        return [f.name for f in fields(whole)]
    if isinstance(whole, dict):
        return whole.keys()
    return [str(i) for i in range(len(whole))] if isinstance(whole, (tuple, list)) else []


def _entry(whole: Any, key: str) -> Any:
    if is_dataclass(whole):
        return getattr(whole, key)
    return whole[key] if isinstance(whole, dict) else whole[int(key)]


def _found(whole: Any, address: str) -> Any:
    keys = address.split(".")
    for i, key in enumerate(keys):
        there = _keys(whole)
        if key not in there:
            owner = ".".join(keys[:i]) or "the scene"
            what = f"{owner} has no {key!r}; {hint(key, there)}"
            if not there and not isinstance(whole, (dict, tuple)):
                what = f"{owner} is a single value; leave .{'.'.join(keys[i:])} out"
            raise UserError(printable(f"{address}: {what}"))
        whole = _entry(whole, key)
    return whole


def _plain(new: Any) -> Any:
    """A value without instances of the kinds, so that what is put in is checked as what a file says."""
    if is_dataclass(new) and not isinstance(new, type):
        return asdict(new)
    if isinstance(new, dict):
        return {k: _plain(v) for k, v in new.items()}
    return tuple(map(_plain, new)) if isinstance(new, (tuple, list)) else new


def _with(whole: Any, keys: list[str], new: Any) -> Any:
    """A copy of nested dicts and tuples with another value at the end of `keys`. An instance on the way becomes a dict,
    so that what is around a new value is checked with it."""
    if not keys:
        return new
    key, *rest = keys
    whole = plain(whole) if is_dataclass(whole) else whole
    if isinstance(whole, dict):
        return whole | {key: _with(whole[key], rest, new)}
    i = int(key)
    return (*whole[:i], _with(whole[i], rest, new), *whole[i + 1 :])


def _numeric(whole: Any, prefix: str) -> list[tuple[str, Quantity]]:
    """The numeric fields below an address; `prefix` is that address and a dot, or nothing."""
    if not is_dataclass(whole):
        return [n for key in _keys(whole) for n in _numeric(_entry(whole, key), f"{prefix}{key}.")]
    own, result = quantities(type(whole)), []
    for f in fields(whole):
        part = getattr(whole, f.name)
        quantity = own.get(f.name) or _of_union(f.type, part)
        result += [(prefix + f.name, quantity)] if quantity else _numeric(part, f"{prefix}{f.name}.")
    return result


def _of_union(annotation: Any, part: Any) -> Quantity | None:
    """The quantity of a field that may hold numbers or something else, if it holds numbers."""
    if is_dataclass(part) or not is_union(bare(annotation)):
        return None
    marks = [m for a in get_args(bare(annotation)) for m in getattr(a, "__metadata__", ()) if isinstance(m, Quantity)]
    return marks[0] if marks else None
