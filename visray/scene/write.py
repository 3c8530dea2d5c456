"""Scenes as JSON, and the JSON Schema of scene files."""

import json
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any

from visray import lights, primitives
from visray.camera import Camera
from visray.materials import Material
from visray.quantities import quantities
from visray.scene.check import checked
from visray.scene.scene import ADAPTER, Film, Gradient, Scene, Settings
from visray.transforms import STEPS

LONGEST_LINE = 100
DIALECT = "https://json-schema.org/draft/2020-12/schema"
KINDS = (Scene, Camera, Film, Gradient, Settings, Material, *lights.KINDS, *primitives.KINDS, *STEPS.values())
TYPED = (*lights.KINDS, *primitives.KINDS)
# A kind's own fields tell more than those that all kinds have.
LAST = ("material", "transform")


def dump(scene: Scene) -> str:
    """The text of a scene file that loads back as an equal scene; fields equal to their default are left out."""
    return pretty(_plain(checked(scene))) + "\n"


def _plain(value: Any) -> Any:
    """Dicts and lists for a part of a scene."""
    if is_dataclass(value):
        told = [f for f in fields(value) if f.name == "type" or getattr(value, f.name) != _default(f)]
        told.sort(key=lambda f: (f.name != "type", f.name in LAST))
        return {f.name: _plain(getattr(value, f.name)) for f in told}
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    return [_plain(v) for v in value] if isinstance(value, tuple) else value


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
        for name, quantity in quantities(kind).items():
            described["properties"][name]["description"] = quantity.unit
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
