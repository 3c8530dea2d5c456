"""Writes scenes as JSON, and the JSON Schema of scene files."""

import json
import os
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from inspect import cleandoc, get_annotations
from pathlib import Path
from typing import Any

from visray import camera as cameras
from visray import filters, lights, primitives, textures
from visray.animation import kinds as tracks
from visray.animation.animation import Animation
from visray.animation.ellipse import Ellipse
from visray.arguments import checked_arguments
from visray.colors import color_as_picked, spelled
from visray.data import base as bases
from visray.data.color_rule import ColorRule
from visray.data.data_scene import Data
from visray.data.layer import DataLayer, RowEdit
from visray.data.legend import Legend
from visray.data.number_column import NumberColumn
from visray.data.size_rule import SizeRule
from visray.data.source import TableValue
from visray.environment_map import EnvironmentMap
from visray.materials import Material
from visray.meshes.reading import files_of_mesh
from visray.number_table import NumberTable
from visray.operands import ROLES, like_operands, named_operands
from visray.primitives.clips import Ball, Block
from visray.primitives.mesh import FitBox
from visray.quantities import quantities
from visray.scene.check import checked
from visray.scene.files import WITH_FILES, OutsideWarning, is_below
from visray.scene.film import Film
from visray.scene.meanings import MEANINGS
from visray.scene.scene import ADAPTER, Occlusion, Scatter, Scene, Settings, SkyGradient
from visray.scene.source import read
from visray.transforms import STEPS

LONGEST_LINE = 100
DIALECT = "https://json-schema.org/draft/2020-12/schema"
# A camera and a track without a type are of the first kind.
TYPED = (
    *cameras.KINDS[1:],
    *textures.KINDS,
    *lights.KINDS,
    *primitives.OBJECTS,
    Ball,
    Block,
    *bases.KINDS,
    *filters.KINDS,
    *tracks.KINDS[1:],
)
ANIMATION = (Animation, Ellipse, tracks.KINDS[0])
DATA = (Data, DataLayer, RowEdit, Legend, SizeRule, ColorRule)
KINDS = (
    Scene,
    cameras.KINDS[0],
    cameras.Shutter,
    Film,
    SkyGradient,
    EnvironmentMap,
    Settings,
    Occlusion,
    Scatter,
    Material,
    *TYPED,
    FitBox,
    *DATA,
    *ANIMATION,
    *STEPS.values(),
)
# Fields that every object has. They are written last, because an object's other fields say more about it.
LAST = ("material", "transform", "cut", "cut_material")
# Fields in which the order of names has a meaning: the first operand is the one that others cut.
ORDERED = ROLES


@checked_arguments
def dump(scene: Scene, folder: str | Path | None = None, like: str | Path | None = None) -> str:
    """Text of a scene file that loads as an equal scene. Fields that equal their default are left out.

    folder: folder of the file; paths of texture files are written relative to this folder. If None: relative to the
        current folder.
    like: another scene file, or None. Its order of keys, the defaults that it writes out, and its `$schema` are kept.
    """
    scene = checked(scene)
    destination = folder or "."
    raw = read(like).raw if like else None
    moved = scene if folder is None else with_files(scene, lambda file: _relative_path(destination, file))
    if folder is not None:
        _warn_of_files_outside(scene, folder)
    tree = _json_tree(moved, raw)
    if isinstance(raw, dict) and "$schema" in raw:
        name = raw["$schema"]
        schema_file = os.path.join(os.path.dirname(like), name)
        shown = _relative_path(destination, schema_file) if os.path.exists(schema_file) else name
        tree = {"$schema": shown} | tree
    return pretty(tree) + "\n"


def value_text(value: Any) -> str:
    """A value of a scene as JSON in one line, as after the = of an assignment."""
    return json.dumps(_json_tree(value), ensure_ascii=False, allow_nan=False)


def text_with_files(scene: Scene, renamed: Callable[[str], str]) -> str:
    """Text of a scene file with other paths of files, which need not exist here.

    renamed: as in with_files
    """
    return pretty(_json_tree(with_files(checked(scene), renamed))) + "\n"


def _warn_of_files_outside(scene: Scene, folder: str | Path) -> None:
    """Warns if a scene names files that a scene file in this folder may not read."""
    outside = []
    with_files(scene, lambda file: file if is_below(file, folder) else outside.append(file) or file)
    if outside:
        more = f" and {len(outside) - 1} more" if len(outside) > 1 else ""
        problem = f"{outside[0]}{more}: is outside of the folder of the scene file that is written"
        advice = "so the scene is read only with --allow-outside; or write it to a folder above, or copy the file below"
        warnings.warn(f"{problem}; {advice}", OutsideWarning, stacklevel=3)


def with_files(scene: Scene, renamed: Callable[[str], str]) -> Scene:
    """The scene with other paths of texture, map, mesh and data files.

    renamed: function that returns the new path for each path.
    """

    def moved(entries: dict[str, Any]) -> dict[str, Any]:
        return {name: moved_entry(x) for name, x in entries.items()}

    def moved_entry(entry: Any) -> Any:
        """An entry, and its operands at all depths, with other paths."""
        new = {"file": renamed(entry.file)} if getattr(entry, "file", None) else {}
        for role in ROLES:
            if (operands := getattr(entry, role, None)) is not None:
                new[role] = like_operands(moved(named_operands(operands)), operands)
        return replace(entry, **new) if new else entry

    data = scene.data
    if data is not None:
        sources = {name: layer.source for name, layer in data.layers.items() if isinstance(layer.source, str)}
        layers = {name: replace(data.layers[name], source=renamed(source)) for name, source in sources.items()}
        data = replace(data, layers=data.layers | layers) if layers else data
    background = moved_entry(scene.background)
    return replace(
        scene, data=data, background=background, **{name: moved(getattr(scene, name)) for name in WITH_FILES}
    )


def files_of(scene: Scene) -> tuple[str, ...]:
    """Paths of all files that are read for a scene, without the scene's own."""
    named: list[str] = []
    with_files(scene, lambda file: named.append(file) or file)
    return tuple(dict.fromkeys(path for file in named for path in files_of_mesh(file)))


def _relative_path(folder: str | Path, file: str) -> str:
    """Path of a file relative to a folder, with forward slashes."""
    # Links are followed first, because `..` means the parent of the folder that a link points to, not the parent of
    # the folder that contains the link.
    parent, name = os.path.split(file)
    return Path(os.path.relpath(os.path.realpath(parent), os.path.realpath(folder)), name).as_posix()


def _json_tree(value: Any, like: Any = None, ordered: bool = False) -> Any:
    """A part of a scene as dicts and lists.

    like: the same part of an existing file, or None. Its order and the defaults that it writes out are kept.
    ordered: whether the order of the keys has a meaning, so that it is not that of the file.
    """
    previous = like if isinstance(like, dict) else {}
    place = {key: i for i, key in enumerate(previous)}
    if isinstance(value, filters.ReconstructionFilter) and value == type(value)() and not isinstance(like, dict):
        return value.type
    if is_dataclass(value):
        kept = {*previous, "type"} if type(value) in TYPED else {*previous}
        written = [f.name for f in fields(value) if f.name in kept or getattr(value, f.name) != _default(f)]
        written.sort(key=lambda name: (name != "type", name in LAST))
        written.sort(key=lambda name: place.get(name, len(place)))
        tree = {x: _json_tree(getattr(value, x), previous.get(x), x in ORDERED) for x in written}
        return _with_color(tree, previous, value) if isinstance(value, Material) else tree
    if isinstance(value, (TableValue, NumberColumn)):
        value = value.listed()
        value = tuple(value) if isinstance(value, list) else value
    if isinstance(value, dict):
        names = list(value) if ordered else sorted(value, key=lambda k: place.get(k, len(place)))
        return {k: _json_tree(value[k], previous.get(k)) for k in names}
    tree = value.values.tolist() if isinstance(value, NumberTable) else value
    if isinstance(value, tuple):
        like_parts = like if isinstance(like, list) and len(like) == len(value) else [None] * len(value)
        tree = [_json_tree(v, part) for v, part in zip(value, like_parts)]
        if any(isinstance(part, dict) for part in tree):
            return tree
    # An equal value keeps its spelling: a file's 2 is not written as 2.0.
    return like if tree == like or _spells(like, value) else tree


def _with_color(tree: dict, previous: dict, material: Material) -> dict:
    """A material as it is written, with its colour as in an existing file, if it is the same and was not in kd.

    previous: the material in that file
    """
    with suppress(ValueError):
        if "color" in previous and color_as_picked(previous["color"]) == material.kd:
            renamed = {("color" if name == "kd" else name): part for name, part in tree.items()}
            return renamed | {"color": previous["color"]}
    return tree


def _spells(like: Any, value: Any) -> bool:
    """Whether a file's text or number spells a colour."""
    if not isinstance(value, tuple) or len(value) != 3 or not isinstance(like, (str, int, float)):
        return False
    with suppress(ValueError):
        return spelled(like) == value
    return False


def _default(f: Field) -> Any:
    """Default value of a dataclass field."""
    return f.default_factory() if f.default_factory is not MISSING else f.default


def pretty(value: Any, indent: str = "") -> str:
    """JSON text with one entry per line. Short lists are on one line.

    indent: indentation of the line on which the value begins, as a text of spaces.
    """
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
    """The JSON Schema of scene files, as a dict. With it, editors show the meaning and the unit of each field."""
    scene_schema = ADAPTER.json_schema()
    definitions = scene_schema["$defs"] | {"Scene": scene_schema}
    for kind in KINDS:
        definition = definitions[kind.__name__]
        definition["description"] = _description(kind)
        for name, meaning in _meanings(kind).items():
            definition["properties"][name]["description"] = meaning
        for field in definition["properties"].values():
            field.pop("title", None)  # a title only repeats the field's name
        if kind in TYPED:
            definition["required"] = ["type", *definition.get("required", ())]
    definitions["Object"]["description"] = "An object of any type."
    scene_schema["properties"]["$schema"] = {"type": "string"}
    scene_schema["title"] = "visray scene"
    scene_schema["$defs"] = scene_schema.pop("$defs")  # moves the definitions behind the scene itself
    return {"$schema": DIALECT, "$id": "urn:visray:scene", **_tidy(scene_schema)}


def _description(kind: type) -> str:
    """Docstring of a class, followed by the docstrings of its base classes that declare fields."""
    bases = [base for base in kind.__mro__ if is_dataclass(base)]
    declaring = [base for base in bases if any(f.name in get_annotations(base) for f in fields(base))]
    return "\n\n".join(cleandoc(base.__doc__ or "") for base in declaring)


def _meanings(kind: type) -> dict[str, str]:
    """Meaning of each field of a class and of its base classes, as a dict by name: a unit, or a text of MEANINGS."""
    texts = {name: text for base in reversed(kind.__mro__) for name, text in MEANINGS.get(base, {}).items()}
    return texts | {name: quantity.unit for name, quantity in quantities(kind).items()}


def _tidy(tree: Any) -> Any:
    """The schema with lists of equal entries described once (`items`), not entry by entry (`prefixItems`), and without
    entries whose names are not valid."""
    if isinstance(tree, list):
        return [_tidy(v) for v in tree]
    if not isinstance(tree, dict):
        return tree
    entries = tree.get("prefixItems")
    if entries and all(v == entries[0] for v in entries):
        tree = {("items" if k == "prefixItems" else k): (v[0] if k == "prefixItems" else v) for k, v in tree.items()}
    if "patternProperties" in tree:
        tree = tree | {"additionalProperties": False}
    return {k: _tidy(v) for k, v in tree.items()}
