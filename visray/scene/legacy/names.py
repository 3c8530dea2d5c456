"""Names that are valid in visray, and error messages with the addresses of the VisRayTrace files."""

import re
from collections.abc import Container, Mapping

# For each address in a visray scene, the address of the same value in a setup file.
SETUP = {
    "camera.origin": "camera.lookFrom",
    "camera.target": "camera.lookAt",
    "camera.up": "camera.vup",
    "camera.fov": "camera.vfov",
    "camera.aperture": "camera.defocusBlur.aperture",
    "film.width": "camera.pixelsX",
    "film.height": "camera.pixelsX / camera.aspectRatio",
    "ambient": "globalLight",
    "background.top": "colorTopBackground",
    "background.bottom": "colorDownBackground",
    "settings.spp": "numSamples",
    "settings.occlusion.sky": "ambientOcclusion.raysGlobal",
    "settings.occlusion.near": "ambientOcclusion.raysLocal",
    "settings.occlusion.distance": "ambientOcclusion.maxDistance",
}
# For fields of lights, materials and objects, their names in the files, if these differ from visray's names.
LIGHT = {"samples": "numLights"}
MATERIAL = {"kr": "ks", "ior": "nut"}
OBJECTS = {
    "box": {"min": "minPoint", "max": "maxPoint"},
    "cylinder": {"height": "h"},
    "mesh": {"file": "objFileName"},
    "triangle": {"a": "p1", "b": "p2", "c": "p3"},
    "rectangle": {"center": "point", "width": "pmax", "height": "pmax"},
}


def valid_name(text: str) -> str:
    """A valid name made from a text; "" if no character can be used."""
    # JSON may contain lone surrogates such as \ud800. They become `?`.
    return text.replace(".", "_").encode(errors="replace").decode().strip()


def unique_name(name: str, taken: Container[str]) -> str:
    """The name, followed by a number if the name is already taken.

    taken: names in use.
    """
    unique, count = name, 1
    while unique in taken:
        count += 1
        unique = f"{name} {count}"
    return unique


# For fields of the base and of the layers of data, their names in the files.
BASE = {"extent": "Real", "width": "base.pmax", "depth": "base.pmax", "radius": "base.radius", "center": "base.point"}
LAYER = {"gizmo": "gyzmo", "height": "maxValue", "radius": "maxValue", "color": "colorMap", "source": "data"}


def with_legacy_address(
    text: str, kinds: Mapping[str, str], materials: Mapping[str, str], properties: Mapping[str, str]
) -> str:
    """An error message in which the visray address is replaced by the address in the VisRayTrace file.

    kinds: dict of the objects' visray types, by object name.
    materials: dict of the addresses of materials in the file, by name.
    properties: dict of the addresses of properties in the file, by the name of the layer that shows them.
    """
    if text.startswith("data."):
        return _with_data_address(text, properties)
    match = re.match(r"(lights)\.light (\d+)(?:\.(\w+))?|(objects|materials)\.([^.]+)\.(\w+)", text)
    if match is None:
        address = next((a for a in SETUP if text.startswith((f"{a} ", f"{a}.", f"{a}:"))), None)
        return SETUP[address] + text.removeprefix(address) if address else text
    light, number, light_field, section, name, field = match.groups()
    rest = text[match.end() :]
    if light:
        suffix = f".{LIGHT.get(light_field, light_field)}" if light_field else ""
        return f"lights.{int(number) - 1}{suffix}{rest}"
    if section == "materials":
        return f"{materials.get(name, name)}.{MATERIAL.get(field, field)}{rest}"
    return f"objects.{name}.{OBJECTS.get(kinds.get(name, ''), {}).get(field, field)}{rest}"


def _with_data_address(text: str, properties: Mapping[str, str]) -> str:
    """A message about the data of a scene with the address in the VisRayTrace file."""
    match = re.match(r"data\.base\.(\w+)|data\.(?:layers\.)?([^.:=]+)(?:\.(\w+))?(?:\.\w+)*", text)
    if match is None:
        return text
    base, layer, field = match.groups()
    rest = text[match.end() :]
    if base:
        return f"{BASE.get(base, f'base.{base}')}{rest}"
    address = properties.get(layer.strip(), f"properties.{layer}")
    if field is None:
        return f"{address}{rest}"
    return f"{address}.{f'data.{field}' if field.isdigit() else LAYER.get(field, field)}{rest}"
