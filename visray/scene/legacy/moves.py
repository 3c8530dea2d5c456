"""What moves in a VisRayTrace scene, as plain dicts of visray's tracks.

The programs of 2020-21 let objects move by suffixes: `ELLIPSE,rx,rz,frames`, `DOUBLEELLIPSE,rx,rz,frames,rx2,rz2,
frames2` and `ROTATION,frames`, each with the number of frames of a turn. In a JSON file, an object's key `animation`
has them as one text, or as a list. VisRayTrace (2021-22) had objects for steps of transforms between two frames, and no
key for them; here they are {"frames": [first, last], "translate": [x, y, z], "scale": s, "rotate": degrees or {"angle":
degrees, "axis": [x, y, z]}}. What a step does stays after its last frame.

A frame is 1/25 s.
"""

import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from visray.animation.ellipse import SHORTEST
from visray.hints import hint
from visray.scene.legacy.entry import Entry, Log, is_number
from visray.scene.messages import line

FRAMES_PER_SECOND = 25
# VisRayTrace rendered this number of frames.
FRAMES = 20
# Least number of frames of a turn.
FEWEST = SHORTEST * FRAMES_PER_SECOND
# The suffixes, each with the number of its numbers.
SUFFIXES = {"ELLIPSE": 3, "DOUBLEELLIPSE": 6, "ROTATION": 1, "IGNORELIGHTS": 0}
STEP = dict.fromkeys(("frames", "translate", "scale", "rotate"), ())
ROTATE = {"angle": ("degrees",), "axis": ()}


@dataclass
class Moves:
    """Tracks of the objects of a scene.

    log: log that receives errors and warnings
    tracks: the tracks by name
    frames: number of frames of the animation
    """

    log: Log
    tracks: dict[str, dict] = field(default_factory=dict)
    frames: int = FRAMES

    @property
    def animation(self) -> dict:
        """The animation of the scene."""
        return {"duration": self.frames / FRAMES_PER_SECOND, "fps": float(FRAMES_PER_SECOND), "tracks": self.tracks}

    def add(self, name: str, shape: dict, entry: dict) -> dict:
        """The fields of an object, with the steps of its transform that tracks move. Its tracks are added.

        name: name of the object
        shape: its fields
        entry: the object as the file gives it
        """
        key = next((k for k in entry if k.strip(" \t:").casefold() == "animation"), None)
        if key is None:
            return shape
        address = f"objects.{name}.{key}"
        found = _suffixes(entry[key], address, self.log)
        shape = self._with_suffixes(name, shape, {word: numbers for word, numbers in found if word})
        for number, step in enumerate(x for word, x in found if not word):
            shape = self._with_step(f"{name} {number + 1}", name, shape, Entry(step, address, STEP, self.log))
        return shape

    def _with_suffixes(self, name: str, shape: dict, numbers: dict[str, list[float]]) -> dict:
        """As `add`, for the suffixes of an object. numbers: the numbers of each suffix"""
        first = numbers.get("ELLIPSE") or numbers.get("DOUBLEELLIPSE")
        ellipse = first and _ellipse(first[:3]) | ({"around": _ellipse(first[3:])} if first[3:] else {})
        turns = "ROTATION" in numbers and self.frames / numbers["ROTATION"][0]
        at, center = f"objects.{name}", _center(shape)
        if turns and ellipse:
            # The object turns about its own centre, and then the ellipse takes it along.
            away = {"translate": tuple(-x for x in center)}
            shape, first = _with_steps(shape, away, {"rotate": 0.0}, {"translate": center})
            self.tracks[f"{name} rotation"] = self._even(f"{at}.transform.{first + 1}.rotate", 0.0, 360 * turns)
            address = f"{at}.transform.{first + 2}.translate"
        elif turns:
            self.tracks[f"{name} rotation"] = {"type": "spin", "of": at, "turns": turns, "center": center}
        elif ellipse and "center" in shape:
            address = f"{at}.center"
        elif ellipse:
            shape, first = _with_steps(shape, {"translate": (0.0, 0.0, 0.0)})
            address = f"{at}.transform.{first}.translate"
        if ellipse:
            self.tracks[f"{name} ellipse"] = {"type": "ellipse", "address": address} | ellipse
        return shape

    def _with_step(self, track: str, name: str, shape: dict, e: Entry) -> dict:
        """As `add`, for steps of a transform between two frames. track: first words of the names of its tracks"""
        frames = e.vector("frames", (0.0, 10.0), size=2)
        if not 0 <= frames[0] < frames[1]:
            e.error("frames", "must be two frames, the first one before the last one")
            return shape
        begin, end = (k / FRAMES_PER_SECOND for k in frames)
        rotate = e.nested("rotate", ROTATE) if isinstance(e.values.get("rotate"), dict) else None
        ends: dict[str, tuple[Any, Any, dict]] = {}
        if e.has("scale"):
            scale = e.values["scale"]
            ends["scale"] = 1.0 if is_number(scale) else (1.0,) * 3, scale, {}
        if rotate is not None:
            ends["rotate"] = 0.0, rotate.number("angle"), {"axis": rotate.vector("axis", (0.0, 1.0, 0.0))}
        elif e.has("rotate"):
            ends["rotate"] = 0.0, e.number("rotate"), {}
        if e.has("translate"):
            ends["translate"] = (0.0,) * 3, e.vector("translate"), {}
        for key, (start, last, more) in ends.items():
            shape, place = _with_steps(shape, {key: start} | more)
            address = f"objects.{name}.transform.{place}.{key}"
            self.tracks[f"{track} {key}"] = self._even(address, start, last, begin, end)
        return shape

    def _even(self, address: str, first: Any, last: Any, begin: float = 0.0, end: float | None = None) -> dict:
        """An even track from one value to another."""
        end = self.frames / FRAMES_PER_SECOND if end is None else end
        return {"type": "keys", "address": address, "times": (begin, end), "values": (first, last)}


def _suffixes(written: Any, address: str, log: Log) -> list[tuple[str, Any]]:
    """What the key `animation` of an object says: a list of suffixes, each as a word and its numbers, and of steps of
    transforms, each with an empty word.

    written: the value of the key
    """
    parts = written if isinstance(written, list) else [written]
    found: list[tuple[str, Any]] = [("", part) for part in parts if isinstance(part, dict)]
    words = [x for part in parts if not isinstance(part, dict) for x in re.split(r"[,;]", str(part)) if x.strip()]
    while words:
        word, count = words[0].strip().upper(), 0
        if word not in SUFFIXES:
            log.error(line(address, written, f"unknown suffix {words[0].strip()!r}; {hint(word, SUFFIXES)}"))
            return []
        count = SUFFIXES[word]
        numbers = [_number(x) for x in words[1 : 1 + count]]
        if len(numbers) < count or None in numbers:
            log.error(
                line(address, written, f"{word} takes {count} numbers, the last of each three a number of frames")
            )
            return []
        turns = numbers[2::3] or numbers
        if any(frames < FEWEST for frames in turns):
            least = "greater than 0" if any(frames <= 0 for frames in turns) else f"at least {FEWEST:g}"
            log.error(line(address, written, f"the number of frames of {word} must be {least}"))
            return []
        if word == "IGNORELIGHTS":
            log.warn(line(address, written, 'IGNORELIGHTS is ignored; give the material the shading "unlit"'))
        else:
            found.append((word, numbers))
        words = words[1 + count :]
    return found


def _number(text: str) -> float | None:
    """The finite number that a text stands for; None if it is none."""
    try:
        number = float(text)
    except ValueError:
        return None
    return number if np.isfinite(number) else None


def _ellipse(numbers: list[float]) -> dict:
    """Fields of an ellipse. numbers: its radii in x and z, and the number of frames of a turn"""
    return {"radii": tuple(map(abs, numbers[:2])), "period": numbers[2] / FRAMES_PER_SECOND}


def _with_steps(shape: dict, *steps: dict) -> tuple[dict, int]:
    """The fields of an object with further steps of its transform, and the place of the first of these."""
    before = tuple(shape.get("transform", ()))
    return shape | {"transform": (*before, *steps)}, len(before)


def _center(shape: dict) -> tuple[float, float, float]:
    """The point about which an object turns: its centre, or else the origin of its coordinates."""
    corners = {"box": ("min", "max"), "triangle": ("a", "b", "c")}.get(shape["type"], ())
    points = [shape[corner] for corner in corners] or [shape.get("center", shape.get("point", (0.0, 0.0, 0.0)))]
    return tuple(np.mean(points, axis=0).tolist())
