"""Scenes as JSON, and the JSON Schema of scene files."""

import json
import os
from collections.abc import Callable
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from inspect import cleandoc, get_annotations
from pathlib import Path
from typing import Any

from visray import lights, primitives, textures
from visray.camera import Camera
from visray.lights.light import AreaLight
from visray.materials import Material
from visray.polynomials.catalogue import SURFACES
from visray.primitives.clips import Ball, Block
from visray.primitives.polynomial import Polynomial
from visray.primitives.primitive import Primitive
from visray.quantities import quantities
from visray.scene.check import checked
from visray.scene.scene import ADAPTER, Film, Occlusion, Scatter, Scene, Settings, SkyGradient
from visray.scene.source import read
from visray.textures import ImageTexture, Texture
from visray.transforms import STEPS, Matrix, Rotate, Scale

LONGEST_LINE = 100
DIALECT = "https://json-schema.org/draft/2020-12/schema"
TYPED = (*textures.KINDS, *lights.KINDS, *primitives.KINDS, Ball, Block)
KINDS = (Scene, Camera, Film, SkyGradient, Settings, Occlusion, Scatter, Material, *TYPED, *STEPS.values())
# A kind's own fields tell more than those that all kinds have.
LAST = ("material", "transform")

# What the fields mean that are no numbers of a kernel; those have a unit (quantities.Quantity).
MEANINGS: dict[type, dict[str, str]] = {
    Scene: {
        "background": "what a ray sees that hits nothing: one colour, or a gradient",
        "textures": "textures by name",
        "materials": "materials by name",
        "lights": "lights by name",
        "objects": "objects by name",
    },
    Film: {
        "width": "pixels, > 0",
        "height": "pixels, > 0",
        "transparent": "whether the background is left out",
    },
    Settings: {
        "spp": "samples per pixel, > 0",
        "seed": "a whole number; another one is other noise",
        "precision": "that of shading; geometry is double",
        "sampler": "where the samples of a pixel fall",
        "shading": "what is shown: light by one of three models, or one property of the surface",
        "shadows": "whether there are shadows",
        "depth": "reflections and refractions in a row, from 0, which switches both off, to 1000",
        "misses": "what a secondary ray sees that hits nothing",
        "local": "the weight of the own colour of a transparent surface: 1 - kt, or 1",
        "area": "where area lights light from: every sample, or their centre",
        "accelerator": "how rays find what they hit; the picture is the same bit for bit",
    },
    Occlusion: {
        "sky": "rays per point, from 0 to 65536",
        "near": "rays per point, from 0 to 65536",
        "hemisphere": "how the rays lie: by the cosine, or as in the original",
    },
    Scatter: {
        "rays": "rays per point that the eye sees, from 0 to 65536",
        "depth": "levels, from 0 to 1000",
    },
    Material: {"texture": "the name of one of the scene's textures, or null"},
    Texture: {
        "scale": "per unit of u and of v, each from -1e6 to 1e6",
        "offset": "units of the texture's u and v, each from -1e6 to 1e6",
    },
    ImageTexture: {
        "file": "a path, relative to the scene file",
        "filter": "the nearest pixel, or a blend of four",
        "wrap": "what is seen beyond the edges",
        "encoding": "auto: sRGB in PNG and JPEG files, linear in EXR files",
    },
    AreaLight: {"samples": "points of the light per shaded point, from 1 to 65536"},
    Primitive: {
        "material": "the name of one of the scene's materials, or default",
        "transform": "steps, the first one applied first",
    },
    Polynomial: {
        "expression": 'f as in "x^2 + y^2 - z^2 - a": of x, y, z, numbers, pi, phi, sqrt(number) and the parameters',
        "monomis": 'the terms of f, as in ["0.9x2", "-3y2", "-1"]',
        "surface": f"the name of a known surface: {', '.join(SURFACES)}",
        "parameters": "numbers by name, for those in the expression or instead of those of the known surface",
        "clip": "what part of the surface there is; by default that of the known surface, or a ball of radius 5",
        "ends": "whether the surface is open where the clip cuts it, or the solid where f < 0 is closed there",
        "tolerance": "how far off crossings may be, from 0 to 1: a share of half a ray's chord in the clip",
    },
    Scale: {"scale": "one factor, or one for each axis; not 0"},
    Rotate: {"rotate": "degrees"},
    Matrix: {"matrix": "the three upper rows of a 4 x 4 matrix"},
}


def dump(scene: Scene, folder: str | Path | None = None, like: str | Path | None = None) -> str:
    """The text of a scene file that loads back as an equal scene; fields equal to their default are left out.

    The files of textures are named as seen from the current folder, or from `folder`, where the text will lie. like: a
    scene file whose order is kept, with the defaults that it spells out and its `$schema`.
    """
    scene = checked(scene)
    place = folder or "."
    raw = read(like).raw if like else None
    found = _plain(scene if folder is None else with_files(scene, lambda file: _way(place, file)), raw)
    if isinstance(raw, dict) and "$schema" in raw:
        name = raw["$schema"]
        near = os.path.join(os.path.dirname(like), name)
        found = {"$schema": _way(place, near) if os.path.exists(near) else name} | found
    return pretty(found) + "\n"


def with_files(scene: Scene, renamed: Callable[[str], str]) -> Scene:
    """The scene with other names for the files of its textures."""
    found = {
        name: replace(texture, file=renamed(texture.file)) if isinstance(texture, ImageTexture) else texture
        for name, texture in scene.textures.items()
    }
    return replace(scene, textures=found)


def _way(folder: str | Path, file: str) -> str:
    """The way from a folder to a file, with forward slashes."""
    # `..` leads out of what a link to a folder points at, not out of where the link lies: follow links first.
    place, name = os.path.split(file)
    return Path(os.path.relpath(os.path.realpath(place), os.path.realpath(folder)), name).as_posix()


def _plain(value: Any, like: Any = None) -> Any:
    """Dicts and lists for a part of a scene; `like`: that part of a file which it should resemble."""
    old = like if isinstance(like, dict) else {}
    if is_dataclass(value):
        told = [f for f in fields(value) if f.name in {"type", *old} or getattr(value, f.name) != _default(f)]
        told.sort(key=lambda f: (f.name != "type", f.name in LAST))
        value = {f.name: getattr(value, f.name) for f in told}
    if isinstance(value, dict):
        names = sorted(value, key=lambda k: list(old).index(k) if k in old else len(old))
        return {k: _plain(value[k], old.get(k)) for k in names}
    found = value
    if isinstance(value, tuple):
        parts = like if isinstance(like, list) and len(like) == len(value) else [None] * len(value)
        found = [_plain(v, part) for v, part in zip(value, parts)]
    # A whole number stays one.
    return like if found == like else found


def _default(f: Field) -> Any:
    return f.default_factory() if f.default_factory is not MISSING else f.default


def pretty(value: Any, indent: str = "") -> str:
    """JSON with an entry a line, but short lists on one line."""
    flat = json.dumps(value, ensure_ascii=False, allow_nan=False)
    short = isinstance(value, list) and len(indent) + len(flat) <= LONGEST_LINE
    if short or not value or not isinstance(value, (dict, list)):
        return flat
    deeper = indent + "  "
    if isinstance(value, dict):
        body = [f"{json.dumps(k, ensure_ascii=False)}: {pretty(v, deeper)}" for k, v in value.items()]
    else:
        body = [pretty(v, deeper) for v in value]
    opening, closing = "{}" if isinstance(value, dict) else "[]"
    return f"{opening}\n{deeper}" + f",\n{deeper}".join(body) + f"\n{indent}{closing}"


def schema() -> dict:
    """The JSON Schema of scene files, for editors: what each field means, and in which unit."""
    made = ADAPTER.json_schema()
    kinds = made["$defs"] | {"Scene": made}
    for kind in KINDS:
        described = kinds[kind.__name__]
        described["description"] = _told(kind)
        for name, meaning in _meanings(kind).items():
            described["properties"][name]["description"] = meaning
        for field in described["properties"].values():
            field.pop("title", None)  # it only repeats the name
            if "patternProperties" in field:
                field["additionalProperties"] = False
        if kind in TYPED:
            described["required"] = ["type", *described.get("required", ())]
    made["properties"]["$schema"] = {"type": "string"}
    made["title"] = "visray scene"
    made["$defs"] = made.pop("$defs")  # the scene itself first
    return {"$schema": DIALECT, "$id": "urn:visray:scene", **_shortened(made)}


def _told(kind: type) -> str:
    """The docstring of a kind, and those of its bases that bring fields into it."""
    bases = [base for base in kind.__mro__ if is_dataclass(base)]
    telling = [base for base in bases if any(f.name in get_annotations(base) for f in fields(base))]
    return "\n\n".join(cleandoc(base.__doc__ or "") for base in telling)


def _meanings(kind: type) -> dict[str, str]:
    """What the fields of a kind mean, its own and those of its bases: a unit, or what is to choose."""
    others = {name: text for base in reversed(kind.__mro__) for name, text in MEANINGS.get(base, {}).items()}
    return others | {name: quantity.unit for name, quantity in quantities(kind).items()}


def _shortened(tree: Any) -> Any:
    """The schema with lists of like entries described once, not entry by entry."""
    if isinstance(tree, list):
        return [_shortened(v) for v in tree]
    if not isinstance(tree, dict):
        return tree
    each = tree.get("prefixItems")
    if each and all(v == each[0] for v in each):
        tree = {("items" if k == "prefixItems" else k): (v[0] if k == "prefixItems" else v) for k, v in tree.items()}
    return {k: _shortened(v) for k, v in tree.items()}
