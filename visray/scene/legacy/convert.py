"""Conversion of VisRayTrace scenes (2021-22, and programs of the same family) into visray scenes.

Such a scene consists of two JSON files: the objects, and a setup with camera, lights and background. They are
interpreted as their authors meant them, without VisRayTrace's defects.

In some points VisRayTrace deliberately follows other rules than visray. With `compat` its rules apply:

- An area light shines from its centre, and only the shadow comes from all samples (settings.area = "centre").
- If ambient occlusion is on, its rays point to a half cube (settings.occlusion.hemisphere = "box").
- A transparent surface shows its own colour with weight 1, not 1 - kt (settings.local = "full").
- The numbers of an image file are kd directly, without the sRGB curve (textures with encoding = "linear").
- A texture leaves ka as it is (materials with textured = "kd"). So do the colours of data (colored = ["kd"]).
- The numbers of colour maps are kd directly, without the sRGB curve (colour rules with encoding = "linear").
- Data on a plane are mirrored between north and south, within Real.
- A second value of -1 means that a datum has none.
- The triangles of meshes are flat (normals = "face").
- MAXDEPTH limits paths even if it is 1, its default: no reflection, no refraction (settings.depth = MAXDEPTH - 1).

`compat` does not restore VisRayTrace's defects:

- Highlights are computed with the direction to the viewer.
- The picture is shifted by half a pixel.
- There is no total internal reflection.
- Objects beyond a light cast shadows.
- The occlusion of the global light is always 0.
- Boxes are not lit.
- The diameter of the lens is always 2.
- Spot lights ignore their cone if a = b = c = 0.
- Some monomials are misread.
- The last datum of the file decides whether all data have two values.
- Transparent gizmos are black (kt = 0), and values beyond minValue and maxValue have random colours.

Nor does it restore the fourth root in the falloff of a spot light, the single sample per pixel, or VisRayTrace's random
numbers.
"""

from pathlib import Path
from typing import Any

from visray.errors import UserError
from visray.hints import hint
from visray.scene.check import examined
from visray.scene.legacy.data import DataParts, data_parts
from visray.scene.legacy.entry import Entry, Log
from visray.scene.legacy.keys import SCENE, SCENES, SETUP
from visray.scene.legacy.materials import Materials
from visray.scene.legacy.meshes import Meshes
from visray.scene.legacy.moves import FRAMES, Moves
from visray.scene.legacy.names import with_legacy_address
from visray.scene.legacy.objects import clip_polynomials, objects
from visray.scene.legacy.resources import Resources
from visray.scene.legacy.setup import enabled_effects, setup
from visray.scene.legacy.textures import Textures
from visray.scene.messages import line
from visray.scene.scene import Scene
from visray.scene.source import read

# Keys of visray scenes that no VisRayTrace scene has.
VISRAY_KEYS = {"camera", "film", "data", "materials", "lights", "settings", "background", "ambient"}


class LegacyWarning(UserWarning):
    """Warning about something in a VisRayTrace file that visray ignores, changes, or cannot do yet."""


def is_legacy_scene(raw: Any) -> bool:
    """Whether the content of a file is a VisRayTrace scene."""
    if not isinstance(raw, dict):
        return False
    if any(key.strip(" :").casefold() == "typescene" for key in raw):
        return True
    if VISRAY_KEYS & raw.keys():
        return False
    objects = raw.get("objects")
    # A list of objects alone may be a mistake in a visray scene. In a VisRayTrace scene, objects have names.
    named = isinstance(objects, list) and any(isinstance(entry, dict) and "name" in entry for entry in objects)
    others = any(isinstance(raw.get(key), list) for key in ("properties", "attributes"))
    return named or others or (isinstance(objects, list) and "scene" in raw)


def is_legacy_setup(raw: Any) -> bool:
    """Whether the content of a file is a VisRayTrace setup."""
    if not isinstance(raw, dict) or is_legacy_scene(raw):
        return False
    camera = raw.get("camera")
    return "renderType" in raw or (isinstance(camera, dict) and "lookFrom" in camera)


def convert(
    scene_file: str | Path,
    setup_file: str | Path | None = None,
    compat: bool = False,
    allow_outside: bool = False,
) -> tuple[Scene, list[str]]:
    """The visray scene of a VisRayTrace scene file and its setup file, and a list of the warnings about both files.

    compat: whether VisRayTrace's rules apply (see the module's docstring).
    allow_outside: whether files outside of the resources folder may be read.

    In the scene, paths of image and mesh files are relative to the current folder. Raises a UserError that lists all
    errors of both files.
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
    resources = Resources(scene_file, allow_outside)
    materials = Materials(enabled_effects(e), Textures(resources, compat))
    moves = Moves(log)
    objects_by_name, data = _objects_and_data(
        Entry(raw, "", SCENE, log), materials, Meshes(resources, compat), moves, compat
    )
    setup_parts = setup(e, materials.by_name.values(), compat, bool(moves.tracks))
    clip_polynomials(objects_by_name, setup_parts["camera"]["origin"], log)
    scene_parts: dict[str, Any] = {
        "textures": materials.textures.by_name, "materials": materials.by_name, "objects": objects_by_name
    }  # fmt: skip
    scene_parts |= {"data": data.fields} if data.fields else {}
    scene_parts |= {"animation": moves.animation} if moves.tracks else {}
    scene, flaws = examined(setup_parts | scene_parts)
    kinds = {name: fields["type"] for name, fields in objects_by_name.items()}
    in_scene_file = tuple(f"{part}." for part in scene_parts)
    for text in flaws:
        (log if text.startswith(in_scene_file) else setup_log).error(
            with_legacy_address(text, kinds, materials.addresses, data.properties)
        )
    errors = [*log.errors, *setup_log.errors]
    if errors or scene is None:
        raise UserError(*errors)
    return scene, [*log.warnings, *setup_log.warnings]


def _read(path: str | Path, log: Log) -> Any:
    """Content of a file. If it cannot be read, {} with the errors in the log; the other file is still checked."""
    try:
        source = read(path)
    except UserError as error:
        log.errors += error.lines
        return {}
    for address in source.repeated:
        log.warn(f"{address}: the key is written twice; the last one counts")
    return source.raw


def _check_order(raw: Any, raw_setup: Any, log: Log, setup_log: Log) -> None:
    """Logs an error if the first file is not a scene or the second is not a setup. Users may have swapped the files."""
    if log.errors or setup_log.errors:
        return
    if is_legacy_setup(raw):
        log.error("is a setup file; the file with the objects comes first, and the setup after it")
    elif not isinstance(raw, dict):
        log.error(line("", raw, "is not a scene; a scene is an object {...}"))
    if is_legacy_scene(raw_setup):
        setup_log.error("is a scene file; a setup has a camera and lights")
    elif not isinstance(raw_setup, dict):
        setup_log.error(line("", raw_setup, "is not a setup; a setup is an object {...}"))


def _objects_and_data(
    e: Entry, materials: Materials, meshes: Meshes, moves: Moves, compat: bool
) -> tuple[dict[str, dict], DataParts]:
    """Dict of the objects in a scene file, by name, and its data.

    e: the scene file.
    moves: receives the tracks of the objects.
    """
    raw_objects, parts = e.items("objects"), DataParts()
    kind = _kind(e)
    moves.frames = e.integer("numFrames", FRAMES)
    if moves.frames < 1:
        e.error("numFrames", "must be at least 1")
        moves.frames = FRAMES
    if kind == "REALDATA" and e.items("properties"):
        parts = data_parts(e, materials, compat)
    elif kind == "REALDATA" and isinstance(e.values.get("base"), dict):
        e.log.warn(f"{e.at('properties')}: there are none; the scene shows its base")
        raw_objects = [{"name": "base"} | e.values["base"], *raw_objects]
    elif kind == "REALDATA":
        e.log.error(f"{e.at('properties')}: there are none, and no base; properties are a list of {{...}} with data")
    elif kind is not None and not e.has("objects"):
        e.log.error("objects: the key is missing; it is the list of the scene's objects")
    if kind == "REALDATA" and e.has("objects"):
        e.log.warn("objects: are drawn with the data; VisRayTrace drew no objects in data scenes")
    found = objects(raw_objects, materials, meshes, moves, e.log)
    if kind == "TEMPORAL" and not moves.tracks:
        e.log.warn(line("typeScene", e.text("typeScene"), 'no object has the key "animation"; the scene stands still'))
    return found, parts


def _kind(e: Entry) -> str | None:
    """The kind of scene, one of SCENES; None with an error in the log if it is unknown."""
    written = e.text("typeScene")
    has_data = not e.has("objects") and (e.has("properties") or e.has("base"))
    if written is None:
        written = "REALDATA" if has_data else "VIRTUALWORLD"
        e.log.warn(f"typeScene: is missing; {written} is used")
    kind = next((k for k in SCENES if written.strip().upper().startswith(k)), None)
    if kind is None:
        e.log.error(line("typeScene", written, f"unknown typeScene; {hint(written.upper(), SCENES)}"))
    elif kind == "TEMPORAL":
        kind = "REALDATA" if has_data else kind
    elif kind != "REALDATA" and has_data:
        e.log.warn(line("typeScene", written, "is read as REALDATA, because the file has data and no objects"))
        return "REALDATA"
    return kind
