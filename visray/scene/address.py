"""Addresses of values in a scene, such as `objects.ball.center.1`: keys and indices, separated by dots. Error messages,
the command line and Python use the same addresses.
"""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from json import JSONDecoder
from typing import Any, get_args

from visray.arguments import checked_arguments
from visray.errors import AnimationWarning, UserError
from visray.quantities import Quantity, quantities
from visray.scene.annotations import bare, is_union
from visray.scene.check import checked, examined, fitted
from visray.scene.edits import edited, entry_of, is_below_layer, keys_of, value_at, within
from visray.scene.scene import Scene
from visray.scene.source import parse
from visray.warn import warn

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
    scene = checked(scene) if _to_fit(scene, [address]) else scene
    return value_at(checked(replace(scene, animation=None)) if is_below_layer(scene, address) else scene, address)


def _to_fit(scene: Scene, addresses: Collection[str]) -> list[str]:
    """Those addresses that are below a camera or lights that the scene does not have, so that they must be fitted."""
    missing = [f"{name}." for name in ("camera", "lights") if getattr(scene, name) is None]
    return [a for a in addresses if a.startswith(tuple(missing))]


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

    A scene without camera or lights gets fitted ones if an address is below them, and otherwise stays without.
    """
    if of_fitted := _to_fit(scene, assignments):
        # What is fitted fits all other changes.
        rest = {a: x for a, x in assignments.items() if a not in of_fitted}
        scene, assignments = checked(changed(scene, rest)), {a: assignments[a] for a in of_fitted}
    if scene.data is not None and any(is_below_layer(scene, address) for address in assignments):
        scene = replace(scene, data=checked(replace(scene, animation=None)).data)
    result, flaws = examined(edited(scene, assignments))
    if flaws:
        raise UserError(*flaws)
    if result.animation is not None:
        _warn_of_tracks(result, assignments)
    return result if scene.camera is None or scene.lights is None else fitted(result)


def _warn_of_tracks(scene: Scene, addresses: Collection[str]) -> None:
    """Warns of assignments to values that a track of the scene writes."""
    for name, track in scene.animation.tracks.items():
        written = () if track.needs_scene else track.addresses()
        for address in (a for a in addresses if any(within(a, other) for other in written)):
            text = "writes this value at all times, so the assignment has no effect; change the track"
            warn(f"{address}: animation.tracks.{name} {text}", AnimationWarning)


def parse_assignments(texts: Iterable[str]) -> dict[str, Any]:
    """Values by address from texts. Each text is an assignment as parse_assignment reads it, or several, with commas,
    semicolons or spaces between. Of two values for one address, the last one counts."""
    return dict(parse_assignment(part) for text in texts for part in _single_assignments(text))


def _single_assignments(text: str) -> Iterator[str]:
    """The assignments in a text, each as a text."""
    while True:
        address, equals, written = text.partition("=")
        begin = _end_of_json(written)
        second = (SECOND.search if begin == 0 else SECOND.match)(written, begin)
        if second is None:
            yield text
            return
        yield f"{address}{equals}{written[: second.start()]}"
        text = second[1]


def _end_of_json(written: str) -> int:
    """Index of the end of the text in quotes, list or object with which a value begins; 0 if it begins with none."""
    start = len(written) - len(written.lstrip())
    if written[start : start + 1] not in ('"', "[", "{"):
        return 0
    try:
        return JSONDecoder().raw_decode(written, start)[1]
    except (ValueError, RecursionError):
        return 0  # parse_assignment says what is wrong with it


def parse_assignment(text: str) -> tuple[str, Any]:
    """The address and the value in a text `ADDRESS=VALUE`. VALUE is JSON. A word without quotes is a string, numbers
    with commas between them, such as 0,1,5 or (0, 1, 5), are a list."""
    address, equals, written = (part.strip() for part in text.partition("="))
    if not (address and equals and written):
        raise UserError(f"{text!r}: is not an assignment; write ADDRESS=VALUE, as in objects.ball.radius=2")
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
    those whose numbers enter a kernel; those of tracks do not."""
    return dict(_numeric(replace(scene, animation=None), ""))


def _word(written: str) -> Any:
    """The value of a word on the command line: a number (also .5, 2. or +1), true, false or null; any other word is a
    string."""
    if DECIMAL.fullmatch(written):
        return float(written)
    try:
        return parse(written, "").raw
    except UserError:
        return written


def _numeric(node: Any, prefix: str) -> list[tuple[str, Quantity]]:
    """List of (address, quantity) for the numeric fields below a node.

    prefix: the node's address and a dot; "" for the scene.
    """
    if not is_dataclass(node):
        return [n for key in keys_of(node) for n in _numeric(entry_of(node, key), f"{prefix}{key}.")]
    own, result = quantities(type(node)), []
    for f in fields(node):
        part = getattr(node, f.name)
        if part is None:
            continue  # a ka that follows kd, for example, has no numbers of its own
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
