"""Flaws of materials: textures and backs that do not exist, and two-sided materials that are not opaque."""

from collections.abc import Iterator

from visray.hints import hint
from visray.materials import Material
from visray.scene.messages import line
from visray.scene.scene import DEFAULT_MATERIAL, Scene


def material_flaws(scene: Scene) -> Iterator[str]:
    """The errors of the scene's materials, one line each."""
    for name, material in scene.materials.items():
        texture = material.texture
        if texture is not None and texture not in scene.textures:
            text = f"unknown texture; {hint(texture, scene.textures)}"
            yield line(f"materials.{name}.texture", texture, text)
        if material.fresnel == "metal" and any(material.kt):
            text = 'a metal is opaque; write the kt [0, 0, 0], or the fresnel "dielectric"'
            yield line(f"materials.{name}.kt", material.kt, text)
        if material.back is not None:
            yield from _back_flaws(scene, name, material)


def _back_flaws(scene: Scene, name: str, material: Material) -> Iterator[str]:
    """The errors of a two-sided material. name: its name"""
    address, back = f"materials.{name}.back", material.back
    known = {DEFAULT_MATERIAL: Material()} | scene.materials
    if any(material.kt):
        text = "a material with a back is opaque; write the kt [0, 0, 0], or leave the back out"
        yield line(f"materials.{name}.kt", material.kt, text)
    if back not in known:
        yield line(address, back, f"unknown material; {hint(back, known)}")
    elif back == name:
        yield line(address, back, "is the material itself; name another one, or leave the back out")
    elif known[back].back is not None:
        yield line(address, back, f"materials.{back} has a back itself; name a material without one")
    elif any(known[back].kt):
        text = f"materials.{back} has the kt {list(known[back].kt)}; name an opaque material, whose kt is [0, 0, 0]"
        yield line(address, back, text)
