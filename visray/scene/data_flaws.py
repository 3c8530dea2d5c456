"""Flaws of the data of a scene."""

from typing import Any

from visray.data.data_scene import Data
from visray.hints import hint
from visray.primitives.csg_operands import has_operands
from visray.primitives.instance import Instance
from visray.scene.csg_flaws import solid_material_flaws, with_operands
from visray.scene.messages import line
from visray.scene.nesting_flaws import nesting_flaws
from visray.scene.scene import DEFAULT_MATERIAL, Scene
from visray.scene.shape_flaws import shape_named, uv_flaw
from visray.scene.transform_flaws import transform_flaw, transform_lines


def geometries_of_data(scene: Scene) -> set[str]:
    """Names of the geometries that data layers show."""
    layers = scene.data.layers.values() if scene.data is not None else ()
    return {layer.geometry for layer in layers if layer.geometry is not None}


def data_flaws(scene: Scene) -> list[str]:
    """List of the errors of the scene's data, one line each."""
    if scene.data is None:
        return []
    data, base = scene.data, scene.data.base
    named = {"data.base.material": base.material}
    named |= {f"data.layers.{name}.material": layer.material for name, layer in data.layers.items()}
    texts = [
        line(address, material, f"unknown material; {hint(material, [*scene.materials, DEFAULT_MATERIAL])}")
        for address, material in named.items()
        if material not in (DEFAULT_MATERIAL, *scene.materials)
    ]
    for name, layer in data.layers.items():
        if layer.geometry is not None and layer.geometry not in scene.geometries:
            text = f"unknown geometry; {hint(layer.geometry, scene.geometries)}"
            texts.append(line(f"data.layers.{name}.geometry", layer.geometry, text))
    if flaw := transform_flaw(base.transform):
        return [*texts, *transform_lines("data.base", base, flaw)]
    found = data.flaws()
    # Two properties of one column have the same flaw.
    texts += dict.fromkeys(_data_line(data, part, text) for part, text in found)
    if texts:
        return texts
    for name, rows in data.rows.items():
        if not len(rows):
            continue
        obj = rows.object(0)
        if text := uv_flaw(scene, rows.material, shape_named(scene, obj)):
            texts.append(line(f"data.layers.{name}.material", rows.material, text))
        if isinstance(obj, Instance) and has_operands(scene.geometries[obj.geometry]):
            texts += _of_operands(scene, f"data.layers.{name}", obj)
    return texts


def _of_operands(scene: Scene, address: str, obj: Instance) -> list[str]:
    """List of the errors of the materials of a geometry with operands; empty if it contains itself, which is another
    error."""
    if any(nesting_flaws(scene, with_operands(scene))):
        return []
    return list(solid_material_flaws(scene, address, obj))


def _data_line(data: Data, part: str, text: str) -> str:
    """The message about a part of the data. part: its address below `data`"""
    value: Any = data
    for key in part.split("."):
        value = value.get(key) if isinstance(value, dict) else getattr(value, key, None)
    shown = isinstance(value, (str, int, float)) or (isinstance(value, tuple) and value)
    return line(f"data.{part}", value, text) if shown else f"data.{part}: {text}"
