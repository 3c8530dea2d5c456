"""Scenes of the original VisRayTrace 2021-22, and of the programs of the same family, as visray scenes.

Such a scene is two JSON files: the objects, and a setup with camera, lights and background. What they say is drawn as
they mean it, with the original's defects mended. `compat` restores what the original did on purpose, and we do
otherwise:

- area lights light from their centre, and only their shadow comes from all samples (settings.area = "centre");
- the rays of the ambient occlusion crowd as in its box (settings.occlusion.hemisphere = "box", where it is on);
- the own colour of a transparent surface counts in full, beside what it lets through (settings.local = "full");
- the numbers of pictures are kd as they stand, not sRGB (textures with encoding = "linear");
- MAXDEPTH counts strictly, down to 1, its default: no reflection and no refraction (settings.depth = MAXDEPTH - 1).

It restores no defects: not the highlights drawn to the viewer, the shift of half a pixel, the missing total internal
reflection, the shadows from beyond a light, the occlusion of the global light that is 0, the boxes without light, the
lens that is always 2 wide, the spot light without a cone where a = b = c = 0, the monomials that were misread; nor the
fourth root in a spot light's falloff, one sample a pixel, or the original's random numbers.
"""

from pathlib import Path
from typing import Any

from visray.errors import UserError
from visray.scene.check import examined
from visray.scene.legacy.entry import Entry, Log
from visray.scene.legacy.keys import SCENE, SCENES, SETUP
from visray.scene.legacy.materials import Looks
from visray.scene.legacy.names import respelled
from visray.scene.legacy.objects import clipped, objects
from visray.scene.legacy.pictures import Pictures
from visray.scene.legacy.setup import effects, setup
from visray.scene.messages import hint, line
from visray.scene.scene import Scene
from visray.scene.source import read

# Keys of our scenes that no original scene has.
OURS = {"camera", "film", "materials", "lights", "settings", "background", "ambient"}


class SeedWarning(UserWarning):
    """Something in a file of the original VisRayTrace that was passed over, or is not built yet."""


def is_seed(raw: Any) -> bool:
    """Whether the content of a file is a scene of the original format."""
    if not isinstance(raw, dict):
        return False
    if any(key.strip(" :").casefold() == "typescene" for key in raw):
        return True
    lists = any(isinstance(raw.get(key), list) for key in ("objects", "properties", "attributes"))
    return lists and not OURS & raw.keys()


def is_setup(raw: Any) -> bool:
    """Whether the content of a file is a setup of the original format."""
    if not isinstance(raw, dict) or is_seed(raw):
        return False
    camera = raw.get("camera")
    return "renderType" in raw or (isinstance(camera, dict) and "lookFrom" in camera)


def convert(
    scene_file: str | Path, setup_file: str | Path | None = None, compat: bool = False
) -> tuple[Scene, list[str]]:
    """The scene in a scene file and its setup, and a warning for everything that is passed over.

    With `compat` it is drawn more like in the original (see above). Its pictures are named as seen from here, not from
    the scene file. Raises UserError with all errors of both files.
    """
    log, setup_log = Log(str(scene_file)), Log(str(setup_file or scene_file))
    raw, raw_setup = _read(scene_file, log), {} if setup_file is None else _read(setup_file, setup_log)
    _check_order(raw, raw_setup, log, setup_log)
    if log.errors or setup_log.errors:
        raise UserError(*log.errors, *setup_log.errors)
    if setup_file is None:
        log.warn("no setup file: no lights, a black background, and a camera at (0, 0, 10) that looks at the origin")
        raw_setup = {"camera": {"vup": [0, 1, 0], "vfov": 90}}
    e = Entry(raw_setup, "", SETUP, setup_log)
    looks = Looks(effects(e), Pictures(scene_file, compat))
    things = _objects(raw, looks, log)
    made = setup(e, looks.materials.values(), compat)
    clipped(things, made["camera"]["origin"], log)
    parts = {"textures": looks.pictures.textures, "materials": looks.materials, "objects": things}
    scene, wrong = examined(made | parts)
    kinds = {name: thing["type"] for name, thing in things.items()}
    for text in wrong:
        (log if text.startswith(tuple(f"{part}." for part in parts)) else setup_log).error(respelled(text, kinds))
    errors = [*log.errors, *setup_log.errors]
    if errors or scene is None:
        raise UserError(*errors)
    return scene, [*log.warnings, *setup_log.warnings]


def _read(path: str | Path, log: Log) -> Any:
    """The content of a file. Its errors go to the log, so that those of both files are told."""
    try:
        source = read(path)
    except UserError as error:
        log.errors += error.lines
        return {}
    for address in source.repeated:
        log.warn(f"{address}: the key is written twice; the last one counts")
    return source.raw


def _check_order(raw: Any, raw_setup: Any, log: Log, setup_log: Log) -> None:
    """Errors for files that are no scene and no setup, most often because they were swapped."""
    if log.errors or setup_log.errors:
        return
    if is_setup(raw):
        log.error("is a setup file; the file with the objects comes first, and the setup after it")
    elif not isinstance(raw, dict):
        log.error(line("", raw, "is not a scene; a scene is an object {...}"))
    if is_seed(raw_setup):
        setup_log.error("is a scene file; a setup has a camera and lights")
    elif not isinstance(raw_setup, dict):
        setup_log.error(line("", raw_setup, "is not a setup; a setup is an object {...}"))


def _objects(raw: dict, looks: Looks, log: Log) -> dict[str, dict]:
    """The objects of a scene file; an error if the scene is of a type that is not built."""
    e = Entry(raw, "", SCENE, log)
    written = e.text("typeScene")
    if written is None:
        written = "REALDATA" if e.has("properties") and not e.has("objects") else "VIRTUALWORLD"
        log.warn(f"typeScene: is missing; {written} is used")
    kind = next((k for k in SCENES if written.strip().upper().startswith(k)), None)
    name = e.text("scene") or "no name"
    if kind is None:
        log.error(line("typeScene", written, f"unknown typeScene; {hint(written.upper(), SCENES)}"))
    elif kind == "REALDATA":
        log.error(line("typeScene", written, f"a data scene ({name}) is not built yet"))
    elif kind == "TEMPORAL":
        log.error(line("typeScene", written, f"an animated scene ({name}) is not built yet"))
    elif not e.has("objects"):
        log.error("objects: the key is missing; it is the list of the scene's objects")
    return objects(e.entries("objects"), looks, log)
