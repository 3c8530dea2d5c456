"""All controls of a scene. They are made when they are asked for, because a scene may have 10,000 objects."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice

from visray.data.all_objects import address_of
from visray.data.rows import Rows
from visray.live import data_controls, fields
from visray.live.controls import Control, control, extent_of, is_code, is_read, name_of, placed
from visray.live.looks import words_of
from visray.materials import Material
from visray.scene.edits import within
from visray.scene.scene import Scene

# How near a word is to a part of an address that it is, that begins with it, or that contains it.
SAME, BEGINS, CONTAINS = 0, 1, 3
# Ranks of fields: what is changed most is shown first. A field that is not named here comes after these.
RANKS = (
    ("parameters", "date", "domain"),
    ("kd", "intensity", "ambient", "fov", "aperture", "focus", "camera.height"),
    ("kr", "kt", "ks", "shininess", "ior", "Id", "background", "top", "bottom", "textures.a", "textures.b"),
    ("radius", "center", "position", "direction", "color"),
)
LAST = len(RANKS) + 1
# Most names of each sort that are told if nothing is found.
NAMED = 12
# Numbers of the parts of vectors and of colours.
AXES = {"x": 0, "y": 1, "z": 2, "r": 0, "g": 1, "b": 2}
MEANINGS = {name: rank for rank, names in enumerate(RANKS) for name in names}


@dataclass(frozen=True)
class Found:
    """What was searched for. controls: the best ones. more: number of others that fit, too."""

    controls: tuple[Control, ...]
    more: int


class Controls:
    """The controls of a scene."""

    def __init__(self, scene: Scene):
        self.scene = scene
        self.extent = extent_of(scene)

    def __len__(self) -> int:
        return len(self.texts)

    def __iter__(self) -> Iterator[Control]:
        return (made for address in self.texts if (made := self.at(address)) is not None)

    @cached_property
    def texts(self) -> dict[str, str]:
        """By the address of each control the text that is searched, in small letters: the address, and for a row of
        data its name."""
        own = (a for a in fields.addresses(self.scene) if is_read(self.scene, a))
        listed = [*data_controls.addresses(self.scene), *own]
        found = {address: address.lower() for address in listed}
        for layer, rows in self._rows().items():
            found |= {a: f"{a} {name}".lower() for a, name in fields.row_addresses(layer, rows)}
        return found

    @cached_property
    def looks(self) -> dict[str, str]:
        """By the address of each control its text, with words for what a user sees, such as red, ball and lamp."""
        words = words_of(self.scene)
        return {a: f"{text} {words.get('.'.join(a.split('.')[:2]), '')}" for a, text in self.texts.items()}

    def names(self) -> tuple[str, ...]:
        """Names of what the scene has, at most NAMED of each sort, such as objects ball."""
        found = []
        for sort in ("objects", "materials", "lights"):
            entries = list(getattr(self.scene, sort))
            rest = (f"and {len(entries) - NAMED} more {sort}",) if len(entries) > NAMED else ()
            found += [f"{sort}.{name}" for name in entries[:NAMED]] + [*rest]
        return tuple(found)

    def _rows(self) -> dict[str, Rows]:
        """The rows of the data whose numbers can be changed, by layer: those of lines cannot."""
        data = self.scene.data
        return {} if data is None else {k: x for k, x in data.rows.items() if data.layers[k].gizmo != "line"}

    def with_scene(self, scene: Scene) -> "Controls":
        """The controls of a scene in which only values are others, so that it has the same addresses."""
        result = Controls(scene)
        if "texts" in self.__dict__:
            result.__dict__["texts"] = self.texts
        return result

    def at(self, address: str) -> Control | None:
        """The control of an address, which may be that of a part of a vector, such as objects.ball.center.1; None if
        there is no continuous value."""
        made = data_controls.control(self.scene, address) or control(self.scene, address, self.extent)
        if made is not None and self._leaves_ka(address):
            made = replace(made, hint=f"{made.hint}; ka is written, so that ambient light keeps its colour")
        track = made and next((name for other, name in self.tracks.items() if within(address, other)), "")
        if not track:
            return made
        return replace(made, track=track, hint=f"{made.hint}; animation.tracks.{track} moves it")

    def _leaves_ka(self, address: str) -> bool:
        """Whether an address is the kd of a material whose ka does not follow it."""
        section, *rest = address.split(".")
        material = self.scene.materials.get(rest[0]) if section == "materials" else None
        return material is not None and rest[1] == "kd" and material.ka is not None and not material.unlit

    @cached_property
    def tracks(self) -> dict[str, str]:
        """By the addresses that the tracks of the animation write the names of the tracks."""
        tracks = {} if self.scene.animation is None else self.scene.animation.tracks
        return {a: name for name, x in tracks.items() if not x.needs_scene for a in x.addresses()}

    def of_object(self, name: str, limit: int) -> Found:
        """The controls of an object and of its materials. name: name or address of the object, such as ball,
        objects.ball, data.base or data.rain.12; or address of an operand or a part of it, whose controls come first."""
        address = name.partition(":")[0] if "." in name else f"objects.{name}"
        section, *parts = address.split(".")
        name = parts[0] if section == "objects" else address
        if name not in self.scene.all_objects:
            return Found((), 0)
        obj = self.scene.all_objects[name]
        own = self._below(address) | self._below(address_of(name))
        around = {}
        if (geometry := getattr(obj, "geometry", None)) is not None:
            around |= self._below(f"geometries.{geometry}")
        if section == "data" and parts[0] in self.scene.data.layers:
            around |= self._below(f"data.layers.{parts[0]}")
        for material in self.scene.materials_of(obj):
            around |= self._below(f"materials.{material}")
        # Of an object with very many numbers, such as CSG, the materials are shown, too.
        first = own if len(own) <= limit // 2 else dict.fromkeys(list(own)[: limit // 2])
        return self._found(list(first | around | own), limit)

    def _below(self, owner: str) -> dict[str, None]:
        """The addresses of controls at and below an address, in order."""
        return {a: None for a in self.texts if within(a, owner)}

    def relevant(self, limit: int) -> Found:
        """The controls that a new scene shows: those that are changed most, at most so many."""
        ranks = {a: self._rank(a) for a in self.texts}
        best = sorted(ranks, key=ranks.get)
        return self._found(best, limit)

    def _rank(self, address: str) -> int:
        """How early the control of an address is shown: 0 is first."""
        section, *rest = address.split(".")
        name = name_of(address)
        rank = MEANINGS.get(f"{section}.{name}", MEANINGS.get(name, LAST - 1))
        if section in ("objects", "geometries"):
            return 0 if "parameters" in rest else LAST if is_code(address) else max(rank, 3)
        if section == "data" and rest[0] not in ("layers", "base", "date"):
            return LAST
        entry = self.scene.materials.get(rest[0]) if section == "materials" else None
        return rank if entry is None or _matters(entry, name) else LAST

    def _found(self, addresses: list[str], limit: int) -> Found:
        """The controls of some addresses, at most so many."""
        made = (x for a in addresses if (x := self.at(a)) is not None)
        first = tuple(islice(made, limit))
        return Found(first, max(0, len(addresses) - limit))


def _matters(material: Material, name: str) -> bool:
    """Whether a small change of a field of a material is likely to be seen."""
    if name in ("kd", "ka"):
        return material.texture is None
    if name in ("kr", "kt"):
        return any(getattr(material, name))
    return any({"ior": material.kt, "dmax": material.kt, "shininess": material.ks}.get(name, (1,)))


def search(controls: Controls, text: str, limit: int) -> Found:
    """The controls whose addresses contain all words of a text, best first. Small and capital letters are the same. A
    word may be the beginning or another piece of a part of the address; x, y and z are the parts of a vector, and r, g
    and b those of a colour. If there are none, and the
    text is no address, words may also say how a thing looks (looks.py).

    limit: at most so many.
    """
    wanted = text.lower().replace(".", " ").split()
    axis = AXES.get(wanted[-1]) if len(wanted) > 1 else None
    scores = _scores(controls, wanted)
    vectors = {} if scores or axis is None else _scores(controls, wanted[:-1])
    if not vectors:
        if "." not in text:
            scores = scores or _scores(controls, wanted, by_looks=True)
        return controls._found(sorted(scores, key=scores.get), limit)
    found = controls._found(sorted(vectors, key=vectors.get), limit)
    is_color = wanted[-1] in "rgb"
    fitting = [c for c in found.controls if len(c.parts) > axis and (c.kind in ("color", "share")) == is_color]
    parts = tuple(c.parts[axis] for c in fitting)
    return Found(parts, found.more)


def _scores(controls: Controls, wanted: list[str], by_looks: bool = False) -> dict[str, tuple]:
    """How well addresses fit some words, those that have all of them. The least score is best. by_looks: whether words
    may say how a thing looks."""
    result = {}
    for address, text in (controls.looks if by_looks else controls.texts).items():
        if wanted and all(word in text for word in wanted):
            parts = text.replace(".", " ").split()
            distance = sum(min(_distance(word, part) for part in parts) for word in wanted)
            result[address] = distance, controls._rank(address), len(placed(address)[2])
    return result


def _distance(word: str, part: str) -> int:
    """How far a word is from a part of an address."""
    if word == part:
        return SAME
    return BEGINS if part.startswith(word) else CONTAINS if word in part else LAST
