"""Whether the file of a frame is up to date, as its metadata say, and why not."""

from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Any

from visray.errors import UserError
from visray.output import exr, png
from visray.output.layers import BY_NAME

# A frame that has no file yet.
MISSING = "missing"
# In a picture to a goal, each half of a pixel has at least two samples if the pixel has this many.
ENOUGH_FOR_VARIANCE = 4
# What a file is in which a fact is another one. Its samples, seed and precision are parts of its scene.
DIFFERENCES = {
    "visray": "of another version of visray",
    "backend": "of another backend",
    "error_asked": "not to this error",
    "time_asked": "not of this time",
    "interrupted": "unfinished",
    "scene_hash": "of another scene",
    "next_scene_hash": "of another scene",
    "legend": "with another legend",
    "gamma": "of another display curve",
    "exposure": "of another exposure",
    "float32": "of another type of numbers",
}


@dataclass(frozen=True)
class Wanted:
    """What the file of a frame must be.

    facts: what its metadata must say; None for what they must not have.
    settings: what its metadata say if the scene has the right settings. It tells why a scene is another one.
    layers: names of the layers of an EXR file. To a goal, `variance` is missing if a pixel may have too few samples.
    curve: display curve and exposure of a PNG file.
    float32: whether colours of an EXR file are float.
    """

    facts: dict[str, Any]
    settings: dict[str, Any] = field(default_factory=dict)
    layers: tuple[str, ...] = ()
    curve: dict[str, Any] = field(default_factory=dict)
    float32: bool = False


def outdated(path: Path, wanted: Wanted) -> str | None:
    """Why a file must be written again: MISSING, or what it is in place of what is wanted; None if it is up to date."""
    if not path.exists():
        return MISSING
    try:
        if path.suffix.lower() == ".png":
            return _difference(png.read_facts(path), _texts(wanted.facts | wanted.curve), _texts(wanted.settings))
        found, channels = exr.read_facts(path)
    except UserError:
        return "damaged"
    has_few = found.get("spp_least", inf) < ENOUGH_FOR_VARIANCE or "small_object_pixels" in found
    asked = (BY_NAME[name] for name in wanted.layers if not (name == "variance" and has_few))
    needed = {channel for layer in asked for channel in layer.channels}
    facts = wanted.facts | {"float32": 1 if wanted.float32 else None}
    return _difference(found, facts, wanted.settings) or (None if needed <= channels else "without some layers")


def _texts(facts: dict[str, Any]) -> dict[str, str | None]:
    """Facts as the texts in a PNG file."""
    return {key: None if value is None else png.as_text(value) for key, value in facts.items()}


def _difference(found: dict[str, Any], facts: dict[str, Any], settings: dict[str, Any]) -> str | None:
    """What a file is in place of what is wanted; None if it has all facts."""
    wrong = [key for key in DIFFERENCES if key in facts and found.get(key) != facts[key]]
    if not wrong:
        return None
    if wrong[0].endswith("scene_hash"):
        for key, value in settings.items():
            if found.get(key, value) != value:
                return f"of {key.removesuffix('_asked')} {found[key]}, not {value}"
    return DIFFERENCES[wrong[0]]
