"""Names of things in original VisRayTrace scenes: ours for the things, and theirs for the fields."""

import re
from collections.abc import Container, Mapping

# What the addresses of our fields are called in a setup file.
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
# What the fields of a part of a scene are called in the files, where they are not called the same.
LIGHT = {"samples": "numLights"}
MATERIAL = {"kr": "ks", "ior": "nut"}
OBJECTS = {
    "box": {"min": "minPoint", "max": "maxPoint"},
    "cylinder": {"height": "h"},
    "triangle": {"a": "p1", "b": "p2", "c": "p3"},
    "rectangle": {"center": "point", "width": "pmax", "height": "pmax"},
}


def valid(written: str) -> str:
    """The nearest text that can be a name; empty where there is none. Halves of a character (\\ud800) are no text."""
    return written.replace(".", "_").encode(errors="replace").decode().strip()


def distinct(wanted: str, taken: Container[str]) -> str:
    """A name, numbered where it is taken."""
    name, count = wanted, 1
    while name in taken:
        count += 1
        name = f"{wanted} {count}"
    return name


def respelled(text: str, kinds: Mapping[str, str]) -> str:
    """An error with the addresses of the original files; `kinds` are our types of the objects, by name."""
    part = re.match(r"(lights)\.light (\d+)(?:\.(\w+))?|(objects|materials)\.([^.]+)\.(\w+)", text)
    if part is None:
        ours = next((ours for ours in SETUP if text.startswith((f"{ours} ", f"{ours}.", f"{ours}:"))), None)
        return SETUP[ours] + text.removeprefix(ours) if ours else text
    rest = text[part.end() :]
    if part[1]:
        field = f".{LIGHT.get(part[3], part[3])}" if part[3] else ""
        return f"lights.{int(part[2]) - 1}{field}{rest}"
    if part[4] == "materials":
        return f"objects.{part[5]}.material.{MATERIAL.get(part[6], part[6])}{rest}"
    return f"objects.{part[5]}.{OBJECTS.get(kinds.get(part[5], ''), {}).get(part[6], part[6])}{rest}"
