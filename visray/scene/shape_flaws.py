"""Flaws of a shape by itself, and names in it that nothing in the scene has."""

from collections.abc import Iterator
from dataclasses import asdict, is_dataclass
from typing import Any

from visray.colors import is_color
from visray.hints import hint, similar
from visray.primitives.instance import Instance
from visray.primitives.mesh import Mesh
from visray.primitives.primitive import Primitive
from visray.scene.messages import UNDER_MATERIALS, line
from visray.scene.scene import DEFAULT_MATERIAL, Scene


def own_flaws(address: str, entry: Any) -> list[str]:
    """List of the errors that a light, an object or an operand reports about itself, by its method flaws()."""
    texts = []
    for field, text in entry.flaws():
        name, _, part = field.partition(".")
        value = getattr(entry, name)
        value = asdict(value) if is_dataclass(value) else value[int(part)] if part else value
        texts.append(line(f"{address}.{field}", value, text))
    return texts


def has_unknown_name(scene: Scene, shape: Primitive) -> bool:
    """Whether an object or an operand names a material or a geometry that does not exist."""
    named = shape.material, shape.cut_material
    if any(name not in (None, DEFAULT_MATERIAL) and name not in scene.materials for name in named):
        return True
    return isinstance(shape, Instance) and shape.geometry not in scene.geometries


def unknown_names(scene: Scene, address: str, shape: Primitive) -> Iterator[str]:
    """Yields a line for each name of a material or a geometry in an object or an operand that does not exist."""
    if not has_unknown_name(scene, shape):
        return
    for field in ("material", "cut_material"):
        name = getattr(shape, field)
        if name not in (None, DEFAULT_MATERIAL) and name not in scene.materials:
            known = [*dict.fromkeys([*scene.materials, DEFAULT_MATERIAL])]
            way = hint(name, known)
            if is_color(name) and not similar(name, known):
                way = UNDER_MATERIALS.format(f'{{"color": "{name}"}}')
            yield line(f"{address}.{field}", name, f"unknown material; {way}")
    if isinstance(shape, Instance) and shape.geometry not in scene.geometries:
        text = f"unknown geometry; {hint(shape.geometry, scene.geometries)}"
        if shape.geometry in scene.objects:
            text = f"unknown geometry; {shape.geometry} is an object; move it to geometries"
        yield line(f"{address}.geometry", shape.geometry, text)


def shape_named(scene: Scene, obj: Primitive) -> Primitive | None:
    """The geometry of an instance, or None if there is no such geometry; any other object itself."""
    return scene.geometries.get(obj.geometry) if isinstance(obj, Instance) else obj


def uv_flaw(scene: Scene, material: str, shape: Primitive | None) -> str | None:
    """What is wrong with the material of a shape: it or its back has a texture, and the shape is a mesh whose file has
    no texture coordinates. None if nothing is wrong, or if the mesh or the materials have other flaws.

    material: name of the material.
    """
    front = scene.materials.get(material)
    back = scene.materials.get(front and front.back)
    textures = [f"{m.texture!r}{side}" for m, side in ((front, ""), (back, " on its back")) if m and m.texture]
    if not textures or type(shape) is not Mesh or shape.file is None or shape.flaws() or shape.textured:
        return None
    problem = f"has the texture {textures[0]}, and the mesh file has no texture coordinates"
    return f"{problem}; take a material without texture"
