"""Scenes of the original VisRayTrace 2021-22, and of the programs of the same family, as visray scenes.

Such a scene is two JSON files: the objects, and a setup with camera, lights and background.
"""

import re
from pathlib import Path
from typing import Any

from visray.errors import UserError
from visray.scene.check import examined
from visray.scene.messages import hint, line
from visray.scene.scene import Scene
from visray.scene.seed_entry import Entry, Log
from visray.scene.seed_keys import SCENE, SCENES
from visray.scene.seed_objects import objects
from visray.scene.seed_setup import SPELLINGS, setup
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


def convert(scene_file: str | Path, setup_file: str | Path | None = None) -> tuple[Scene, list[str]]:
    """The scene in a scene file and its setup, and a warning for everything that is passed over.

    Raises UserError with all errors of both files.
    """
    log, setup_log = Log(str(scene_file)), Log(str(setup_file or scene_file))
    raw, raw_setup = _read(scene_file, log), {} if setup_file is None else _read(setup_file, setup_log)
    _check_order(raw, raw_setup, log, setup_log)
    if log.errors or setup_log.errors:
        raise UserError(*log.errors, *setup_log.errors)
    if setup_file is None:
        log.warn("no setup file: no lights, a black background, and a camera at (0, 0, 10) that looks at the origin")
        raw_setup = {"camera": {"vup": [0, 1, 0], "vfov": 90}}
    things, materials = _objects(raw, log)
    made = setup(raw_setup, setup_log)
    scene, wrong = examined({**made, "materials": materials, "objects": things})
    for text in wrong:
        (log if text.startswith(("objects.", "materials.")) else setup_log).error(_respelled(text))
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


def _objects(raw: dict, log: Log) -> tuple[dict, dict]:
    """Objects and materials of a scene file, unless it is of a type that is not built."""
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
    return objects(e.entries("objects"), log)


def _respelled(text: str) -> str:
    """An error with the addresses of the original files."""
    light = re.match(r"lights\.light (\d+)", text)
    if light:
        return f"lights.{int(light[1]) - 1}{text[light.end() :]}"
    ours = next((ours for ours in SPELLINGS if text.startswith((f"{ours} ", f"{ours}.", f"{ours}:"))), None)
    return SPELLINGS[ours] + text.removeprefix(ours) if ours else text
