"""Flaws of animations: tracks without a target, with wrong keys, or with one target for two of them."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import fields, replace
from typing import Any

from visray.animation.animation import Track
from visray.animation.between import between_flaws
from visray.animation.curves import Sort, step_key
from visray.animation.keys import KeysTrack
from visray.colors import color_of_text
from visray.data import dates
from visray.errors import UserError
from visray.scene.animation_targets import discrete, given_shape, shape, sort_of, still
from visray.scene.animation_values import track_values
from visray.scene.edits import edited, value_at, within
from visray.scene.key_checks import keys_to_check, spread
from visray.scene.messages import line
from visray.scene.scene import Scene

# What tracks cannot move: themselves, and what only pictures of several moments have.
UNMOVED = ("animation", "camera.shutter")
# The address of the size of frames. The number of their pixels is whole, but the factor is not.
SIZE = "film.scale"
# Function that returns the flaws of a scene as plain dicts (check.examined).
Examine = Callable[[dict], tuple[Any, list[str]]]


def animation_flaws(scene: Scene, examine: Examine) -> Iterator[str]:
    """The errors of the scene's animation, one line each. Domain: the rest of the scene has no flaws.

    First each track alone is looked at; if these have no errors, tracks that write one value, and then the scenes that
    all tracks make together.
    """
    if scene.animation is None:
        return
    tracks, small = scene.animation.tracks, touched(scene)
    found = [text for name, track in tracks.items() for text in _own_flaws(scene, small, name, track, examine)]
    found = found or list(_overlaps(tracks))
    yield from found or _wrong_moments(small, examine)


def _address(name: str, part: str = "") -> str:
    """Address of a part of a track."""
    return f"animation.tracks.{name}" + (f".{part}" if part else "")


def _line(name: str, track: Track, part: str, text: str) -> str:
    """The message about a part of a track."""
    value: Any = track
    for key in part.split("."):
        value = value[int(key)] if isinstance(value, tuple) else getattr(value, key)
    return line(_address(name, part), value, text)


def _own_flaws(scene: Scene, small: Scene, name: str, track: Track, examine: Examine) -> Iterator[str]:
    """The errors of one track: those that it finds itself, those of its targets, and those of its values. small: the
    scene as touched returns it"""
    own = track.flaws(scene.animation.duration)
    found = [_line(name, track, part, text) for part, text in own]
    if track.naming not in dict(own):
        found += [_line(name, track, track.naming, text) for text in _target_flaws(still(scene), track)]
    yield from found
    if not found and isinstance(track, KeysTrack):
        yield from _value_flaws(still(small), name, track, examine)


def _target_flaws(scene: Scene, track: Track) -> Iterator[str]:
    """The errors of the targets of a track: there are none, or they cannot move, or are not three numbers."""
    for address in track.addresses() if track.naming else ():
        if any(within(address, x) for x in UNMOVED):
            yield "tracks move what a picture of one moment shows, and this is no part of it; name another address"
            continue
        if within(address, SIZE):
            yield "is the size of the picture, and all frames have one size; leave the track out"
            continue
        try:
            value = value_at(scene, address)
        except UserError as error:
            meant = _meant(scene, track, address)
            yield f"is no address; write {' or '.join(meant)}" if meant else str(error).removeprefix(f"{address}: ")
            continue
        if text := discrete(scene, address):
            yield text
        elif track.is_point and shape(value) != (3,):
            yield "is not the address of a point, of three numbers"


def _meant(scene: Scene, track: Track, address: str) -> list[str]:
    """What the user may mean by an address without its first part, such as ring for objects.ring. address: the one that
    the track writes"""
    written = getattr(track, track.naming)
    found = []
    for section in (f.name for f in fields(scene) if f.name not in UNMOVED):
        with suppress(UserError):
            if discrete(scene, f"{section}.{address}") is None:
                found.append(f"{section}.{written}")
    return found


def _value_flaws(scene: Scene, name: str, track: KeysTrack, examine: Examine) -> Iterator[str]:
    """The errors of the values of keys: the form of the value, the value itself, and what lies between two of them."""
    sort, current = sort_of(scene, track.address), value_at(scene, track.address)
    wrong = {i: _form_flaw(sort, track, i, current) for i in range(len(track.values))}
    found = [_line(name, track, f"values.{i}", text) for i, text in wrong.items() if text]
    found = found or [
        _at_key(name, track, i, flaw)
        for i in keys_to_check(scene, track.address, track.values)
        for flaw in examine(edited(scene, {track.address: track.values[i]}))[1]
    ]
    if not found and track.interpolation != "step":
        found = [_line(name, track, f"values.{i}", text) for i, text in between_flaws(sort, track.values)]
    yield from found


def _form_flaw(sort: Sort, track: KeysTrack, i: int, current: Any) -> str | None:
    """What is wrong with the form of the value of a key; None if it has that of the scene's own value, `current`."""
    value, first = track.values[i], track.values[0]
    if not _fits(sort, value, current):
        return f"must be {_form(sort, current)}{_meant_color(value, current)}"
    if sort == "date" and isinstance(value, str) != isinstance(first, str):
        return "must be a date like the first key, or a number like it"
    if sort == "steps" and _fits(sort, first, current) and _kinds(value) != _kinds(first):
        return f"must have the steps of the first key, in its order: {', '.join(_kinds(first)) or 'none'}"
    return None


def _fits(sort: Sort, value: Any, current: Any) -> bool:
    """Whether a value has the form of the scene's own value."""
    if sort == "step":
        return step_key(value) == step_key(vars(current))
    if sort == "steps":
        return isinstance(value, tuple) and all(step_key(x) is not None for x in value)
    if sort == "date":
        return given_shape(value) == () or _is_date(value)
    return given_shape(value) == shape(current)


def _is_date(value: Any) -> bool:
    """Whether a value is a text with a date."""
    try:
        return isinstance(value, str) and bool(dates.parsed(value))
    except ValueError:
        return False


def _form(sort: Sort, current: Any) -> str:
    """Words for the form of the scene's own value."""
    if sort == "step":
        return f'a step with the key "{step_key(vars(current))}", like the value in the scene'
    if sort == "steps":
        return 'a list of steps, such as [{"rotate": 30}]'
    if sort == "date":
        return "a date such as 2020-06-15, or a number"
    size = shape(current)
    numbers = "a number" if not size else f"a list of {' x '.join(map(str, size))} numbers"
    return f"{numbers}, like the value in the scene"


def _meant_color(value: Any, current: Any) -> str:
    """The numbers of a colour that is given by its name, as words; empty for all other values."""
    with suppress(ValueError):
        if isinstance(value, str) and shape(current) == (3,):
            return f"; this colour is [{', '.join(f'{x:.4g}' for x in color_of_text(value))}]"
    return ""


def _kinds(steps: tuple) -> list[str | None]:
    """The kinds of the steps of a transform."""
    return [step_key(x) for x in steps]


def _overlaps(tracks: dict[str, Track]) -> Iterator[str]:
    """The errors of tracks that write a value, or a part of a value, that a track before them writes too."""
    owners: list[tuple[str, str]] = []
    for name, track in tracks.items():
        clashes = [
            (address, other, owner)
            for address in track.addresses()
            for other, owner in owners
            if (within(address, other) or within(other, address)) and track.extends == tracks[owner].extends
        ]
        for address, other, owner in clashes[:1]:
            shared = address if within(address, other) else other
            text = f"{_address(owner)} writes {shared} too; leave one of the two tracks out"
            yield _line(name, track, track.naming or "type", text)
        owners += [(address, name) for address in track.addresses()]


def _wrong_moments(scene: Scene, examine: Examine) -> Iterator[str]:
    """The errors of the scenes that all tracks make together, at some of the times that each track names."""
    tracks = scene.animation.tracks.values()
    times = {t for track in tracks for t in spread(sorted({*track.check_times(scene.animation.duration)}))}
    seen: set[str] = set()
    for t in spread(sorted(times)):
        for flaw in examine(edited(still(scene), track_values(scene, t)))[1]:
            address = flaw.partition(" = ")[0]
            if address not in seen:
                yield f"animation.tracks: at {t:g} s, {flaw}"
            seen.add(address)


def _at_key(name: str, track: KeysTrack, i: int, flaw: str) -> str:
    """The message about a flaw of the scene with the value of a key."""
    key = _address(name, f"values.{i}")
    rest = flaw.removeprefix(track.address)
    return key + rest if rest != flaw and rest[:1] in " .:" else line(key, track.values[i], f"with it, {flaw}")


def touched(scene: Scene) -> Scene:
    """The scene with as little as possible beside what the tracks write: a check of it takes no longer if the scene is
    large."""
    addresses = [a.split(".") for track in scene.animation.tracks.values() for a in track.addresses()]
    heads = {a[0] for a in addresses}
    if heads & {"data", "geometries"}:
        return scene
    names = {a[1] for a in addresses if a[0] == "objects"}
    objects = {name: obj for name, obj in scene.objects.items() if name in names}
    if any(scene.geometries for obj in objects.values() if obj.composite or hasattr(obj, "geometry") or obj.cut):
        return scene
    return replace(scene, objects=objects, geometries={}, data=None)
