"""Checks scenes from files and from Python: first each field alone, then the conditions between several fields.

An entry is a texture, a material, a light, a geometry or an object. A section is the dict of a scene that contains
entries of one of these five sorts by name. A flaw is an error that concerns several fields together.

Entries that were validated before are not validated again (validated.py). References by name are checked every time,
since a user may change the dicts of a scene. If anything is wrong, the whole scene is validated again without this
shortcut, to report all errors at once.
"""

import sys
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from itertools import islice
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from visray.camera import Camera
from visray.errors import FittedNote, UserError
from visray.fitted_scene import completed
from visray.geometry import gamma
from visray.hints import similar
from visray.primitives.csg_operands import has_operands
from visray.primitives.instance import Instance
from visray.primitives.mesh import Mesh
from visray.quantities import Name
from visray.records import altered
from visray.scene.animation_flaws import animation_flaws
from visray.scene.animation_targets import still
from visray.scene.animation_values import track_values
from visray.scene.csg_flaws import named_geometries, operand_flaws, reference_flaws, with_operands
from visray.scene.data_flaws import data_flaws, geometries_of_data
from visray.scene.edits import SECTIONS, edited, parts
from visray.scene.film import film_flaw
from visray.scene.garbage import uncollected
from visray.scene.material_flaws import material_flaws
from visray.scene.messages import MOST, limited, line, lines
from visray.scene.nesting_flaws import too_deep
from visray.scene.scene import ADAPTER, DEFAULT_MATERIAL, Occlusion, Scene
from visray.scene.shape_flaws import has_unknown_name, own_flaws, shape_named, unknown_names, uv_flaw
from visray.scene.source import wrong_texts
from visray.scene.summary import summary
from visray.scene.transform_flaws import transform_flaw, transform_lines
from visray.scene.validated import plain, remember, validated
from visray.terminal import printable
from visray.warn import warn_once

# Sections whose entries are referred to by name, each with a valid entry. This entry takes the place of a wrong one
# while the rest of the scene is checked.
STAND_INS = {"textures": {"type": "checker"}, "materials": {}, "geometries": {"type": "sphere"}}
NAMES = TypeAdapter(list[Name])


def checked(scene: Scene) -> Scene:
    """Validated copy of the scene, with a camera and lights: those that it does not have are fitted, which a FittedNote
    says. Entries that were validated before are the same instances in both scenes. Raises a UserError that lists all
    errors of the scene."""
    return fitted(checked_as_written(scene))


def checked_as_written(scene: Scene) -> Scene:
    """As `checked`, but what the scene does not have is not fitted."""
    if not isinstance(scene, Scene):
        raise UserError(f"a scene is a visray Scene, not a {type(scene).__name__}")
    result, errors = examined(parts(scene))
    if errors:
        raise UserError(*errors)
    return result


def fitted(scene: Scene) -> Scene:
    """The scene with a fitted camera and fitted lights, if it has none. They fit the beginning of an animation. A
    FittedNote says so, once in a process for scenes with the same summary. Domain: a scene without flaws."""
    result, notes = completed(scene, _start(scene))
    for text in notes:
        warn_once(printable(text), FittedNote, summary(scene))
    return result


def _start(scene: Scene) -> Scene | None:
    """The beginning of an animation to which something must be fitted; None if there is none."""
    if scene.animation is None or (scene.camera is not None and scene.lights is not None):
        return None
    full = _movable(scene)
    return examined(edited(still(full), track_values(full, 0.0)))[0]


def _movable(scene: Scene) -> Scene:
    """The scene as its tracks find it: with a fitted camera and fitted lights, if any track may name a part of those.
    Domain: a scene with an animation, whose rest has no flaws."""
    fixed = {f.name for f in fields(scene) if getattr(scene, f.name) is not None}
    heads = {a.partition(".")[0] for track in scene.animation.tracks.values() for a in track.addresses()}
    return scene if heads <= fixed else completed(scene)[0]


def examined(raw: Any) -> tuple[Scene | None, list[str]]:
    """The scene that plain dicts and lists describe, and a list with one line for each error. The scene is None if a
    single field is wrong. What it does not have is not fitted.

    raw: the scene as dicts and lists. Its entries may also be instances of their kinds.
    """
    if not isinstance(raw, dict):
        return None, [line("", raw, "is not a scene; a scene is an object {...}")]
    try:
        return _examined(raw)
    except RecursionError:
        if not (found := too_deep(raw)):
            raise
        return None, limited(map(printable, found))


def _examined(raw: dict) -> tuple[Scene | None, list[str]]:
    """As examined, for operands that are nested so deeply that Python may refuse to look at them (RecursionError)."""
    scene = _accepted(raw)
    if scene is not None:
        return scene, []
    raw = {name: _without_instances(part) for name, part in raw.items()}
    try:
        scene = ADAPTER.validate_python(raw)
    except ValidationError as error:
        # pydantic shows half characters and keys that are no texts as others, so its addresses would lead nowhere.
        found = wrong_texts(raw) or too_deep(raw) or lines(error, raw) + _flaws_of_the_rest(raw, error)
        return None, limited(map(printable, found))
    return scene, flaws(scene)


def _without_instances(part: Any) -> Any:
    """A section whose entries are plain dicts."""
    return {name: _plain(entry) for name, entry in part.items()} if isinstance(part, dict) else part


def _plain(entry: Any) -> Any:
    """An entry as a plain dict. A value that is no instance is returned as it is."""
    return plain(entry) if is_dataclass(type(entry)) else entry


@uncollected()
def _accepted(raw: dict) -> Scene | None:
    """The scene that plain dicts and lists describe, or None if it has an error. Remembers new entries as validated."""
    sections = {name: raw[name] for name in SECTIONS if isinstance(raw.get(name), dict)}
    known = {name: _known(entries, SECTIONS[name]) for name, entries in sections.items()}
    unknown = {
        name: {key: _plain(entry) for key, entry in entries.items() if key not in known[name]}
        for name, entries in sections.items()
    }
    try:
        for entries in known.values():
            NAMES.validate_python(list(entries))
        new = ADAPTER.validate_python(raw | unknown)
    except ValidationError:
        return None
    joined = {name: _joined(entries, known[name], getattr(new, name)) for name, entries in sections.items()}
    scene = altered(new, joined)
    made = with_operands(scene)
    wrong = _has_own_flaws(new) or _has_wrong_reference(scene, made) or _has_mesh_flaws(scene, made)
    if wrong or data_flaws(scene):
        return None
    for name, entries in sections.items():
        for key, equal in getattr(new, name).items():
            remember(entries[key] if is_dataclass(type(entries[key])) else equal, equal)
    # Last, because it checks further scenes, which have the same entries.
    return None if any(True for _ in _flaws_in_motion(scene)) else scene


def _flaws_in_motion(scene: Scene) -> Iterator[str]:
    """The flaws of the animation of a scene. Its tracks may move a camera and lights that are fitted. Domain: the rest
    has no flaws."""
    if scene.animation is not None:
        yield from animation_flaws(_movable(scene), examined)


def _known(entries: dict, kinds: frozenset) -> dict:
    """Those entries of a section that were validated before and are of the right kind: a dict from their names to their
    validated copies.

    kinds: kinds that entries of the section may have.
    """
    return {key: equal for key, entry in entries.items() if type(equal := validated(entry)) in kinds}


def _joined(entries: dict, known: dict, new: dict) -> dict:
    """The known and the new entries of a section in one dict, in the order of `entries`.

    known: entries that were validated before. new: entries that were validated now.
    """
    if not (known and new):
        return known or new
    return {key: known[key] if key in known else new[key] for key in entries}


def _has_own_flaws(scene: Scene) -> bool:
    """Whether the camera, the film, a light, a geometry or an object has a flaw that does not depend on other parts of
    the scene."""
    with np.errstate(all="ignore"):
        shapes = *scene.geometries.values(), *scene.objects.values()
        return bool(
            _camera_flaws(scene.camera)
            or _occlusion_flaws(scene.settings.occlusion)
            or film_flaw(scene.film)
            or any(light.flaws() for light in (scene.lights or {}).values())
            or any(shape.flaws() or transform_flaw(shape.transform) for shape in shapes)
            or any(True for shape in shapes for _ in operand_flaws("", shape))
        )


def _has_wrong_reference(scene: Scene, made: dict) -> bool:
    """Whether a material has a flaw, an object names a material or a geometry that does not exist, no object names a
    geometry, a geometry has a material, an instance cannot be placed, or an operand has a flaw that depends on other
    parts of the scene. made: the objects and geometries with operands (with_operands)."""
    materials_named = {x.material for x in scene.objects.values()}
    instances = [x for x in scene.objects.values() if type(x) is Instance]
    return (
        any(material_flaws(scene))
        or not materials_named <= {DEFAULT_MATERIAL, *scene.materials}
        or any(has_unknown_name(scene, walk[0].shape) for walk in made.values())
        or named_geometries(scene, made) | geometries_of_data(scene) != set(scene.geometries)
        or any(shape.material != DEFAULT_MATERIAL for shape in scene.geometries.values())
        or any(_placement_flaw(scene, x) for x in instances)
        or any(True for _ in reference_flaws(scene, made))
    )


def _has_mesh_flaws(scene: Scene, made: dict) -> bool:
    """Whether a mesh has a flaw, or an object shows a mesh with a material that it cannot have. This is checked every
    time, because mesh files may change. made: as in _has_wrong_reference."""
    shapes = [*scene.objects.values(), *scene.geometries.values()]
    inner = [x.shape for walk in made.values() for x in walk]
    meshes = [shape for shape in (*shapes, *inner) if type(shape) is Mesh]
    # Where there are no meshes, none of very many objects is looked at.
    return any(mesh.flaws() for mesh in meshes) or any(
        uv_flaw(scene, obj.material, shape_named(scene, obj)) for obj in (scene.objects.values() if meshes else ())
    )


def _flaws_of_the_rest(raw: dict, error: ValidationError) -> list[str]:
    """List of the flaws in those parts of a scene in which pydantic found no error. They are reported together with
    pydantic's errors."""
    sections = {k: dict(v) if isinstance(v, dict) else v for k, v in raw.items()}
    for section, *inner in (e["loc"] for e in error.errors(include_url=False)):
        if section in STAND_INS and not inner:
            return []
        if section in STAND_INS and inner[-1] != "[key]":
            sections[section][inner[0]] = STAND_INS[section]  # references to its name stay valid
        elif section in ("objects", "lights", *STAND_INS) and inner:
            sections[section].pop(inner[0], None)
        else:
            sections.pop(section, None)
    sections.pop("animation", None)  # it moves what was left out here
    try:
        return flaws(ADAPTER.validate_python(sections))
    except ValidationError:
        return []


def flaws(scene: Scene) -> list[str]:
    """List of the flaws of a scene: errors that the validation of each single field does not find.

    Each flaw is one line: `ADDRESS = VALUE: what is wrong; what would be right`.
    """
    with np.errstate(all="ignore"):
        return limited(map(printable, _all_flaws(scene)))


def _all_flaws(scene: Scene) -> Iterator[str]:
    """The flaws of a scene. They are found one after another, because a message about a name takes a while."""
    wrong = False
    for text in _flaws_at_rest(scene):
        wrong = True
        yield text
    if not wrong:
        yield from _flaws_in_motion(scene)


def _flaws_at_rest(scene: Scene) -> Iterator[str]:
    """The flaws of a scene, without those of its animation."""
    yield from _camera_flaws(scene.camera)
    yield from _occlusion_flaws(scene.settings.occlusion)
    if flaw := film_flaw(scene.film):
        yield line(*flaw)
    yield from material_flaws(scene)
    for name, light in (scene.lights or {}).items():
        yield from own_flaws(f"lights.{name}", light)
    made = with_operands(scene)
    named = named_geometries(scene, made) | geometries_of_data(scene)
    # A geometry whose name is misspelt is in use.
    misspelt = islice((name for name in named if name not in scene.geometries), MOST)
    named |= {x for name in misspelt for x in similar(name, [*scene.geometries])}
    for name, shape in scene.geometries.items():
        yield from _geometry_flaws(scene, name, shape, name in named)
    for name, shape in scene.objects.items():
        yield from _object_flaws(scene, f"objects.{name}", shape)
    yield from dict.fromkeys(reference_flaws(scene, made))
    yield from data_flaws(scene)


def _object_flaws(scene: Scene, address: str, shape: Any) -> list[str]:
    """List of the errors of an object: an unknown name, its own flaws, a transform without an inverse, and the flaws of
    its operands."""
    texts = list(unknown_names(scene, address, shape))
    if text := uv_flaw(scene, shape.material, shape_named(scene, shape)):
        texts.append(line(f"{address}.material", shape.material, text))
    texts += own_flaws(address, shape)
    flaw = transform_flaw(shape.transform)
    if isinstance(shape, Instance) and shape.geometry in scene.geometries:
        flaw = flaw or _placement_flaw(scene, shape)
    return [*texts, *transform_lines(address, shape, flaw), *operand_flaws(address, shape)]


def _geometry_flaws(scene: Scene, name: str, shape: Any, shown: bool) -> list[str]:
    """List of the errors of a geometry: a material, its own flaws, a transform without an inverse, the flaws of its
    operands, and no instance.

    shown: whether there is an instance of it.
    """
    address = f"geometries.{name}"
    texts = list(unknown_names(scene, address, shape)) if shape.material == DEFAULT_MATERIAL else []
    if shape.material != DEFAULT_MATERIAL:
        text = "a geometry has no material; give one to each of its instances"
        text += ", or to its operands" if has_operands(shape) else ""
        texts.append(line(f"{address}.material", shape.material, text))
    texts += own_flaws(address, shape) + transform_lines(address, shape, transform_flaw(shape.transform))
    texts += operand_flaws(address, shape)
    if not shown:
        problem = "no object is an instance of it" + (", and no data layer shows it" if scene.data else "")
        texts.append(f"{address}: {problem}; add one, or leave the geometry out")
    return texts


def _placement_flaw(scene: Scene, instance: Instance) -> str | None:
    """Reason why the transforms of an instance and of its geometry do not go together, or None if they do."""
    steps = scene.geometries[instance.geometry].transform
    flaw = transform_flaw(steps + instance.transform) if steps and instance.transform else None
    return flaw and f"after the transform of geometries.{instance.geometry}, {flaw}"


def _occlusion_flaws(occlusion: Occlusion) -> list[str]:
    """List with the error of the occlusion, if it has one: the background's light without rays that bring it."""
    if occlusion.light == "ambient" or occlusion.sky:
        return []
    return [
        line(
            "settings.occlusion.light",
            occlusion.light,
            "needs rays that bring it; set settings.occlusion.sky, to 16 say",
        )
    ]


def _camera_flaws(camera: Camera | None) -> list[str]:
    """List with the error of the camera, if there is one and it has one: origin and target are equal, a vector is too
    long or too short, `up` is parallel to the view direction, or the shutter closes before it opens."""
    if camera is None:
        return []
    if (shutter := camera.shutter) is not None and shutter.close <= shutter.open:
        text = f"must be greater than open, which is {shutter.open:g}"
        return [line("camera.shutter.close", shutter.close, text)]
    view = np.subtract(camera.target, camera.origin)
    up = np.array(camera.up, float)
    if camera.target == camera.origin:
        return [line("camera.target", camera.target, "must differ from origin")]
    # The kernel divides by the root of a sum of squares. This sum must neither overflow nor be subnormal.
    for address, value, vector in (("camera.target", camera.target, view), ("camera.up", camera.up, up)):
        if not sys.float_info.min <= vector @ vector <= sys.float_info.max:
            return [line(address, value, "is too near or too far for double precision")]
    view, up = view / np.linalg.norm(view), up / np.linalg.norm(up)
    # Rounding error: each component of the cross product has a rounding error of at most 3 roundings of |view| |up|.
    # Each unit vector has at most 5 more: 1 from the subtraction (only view), and 4 from the norm and the quotient.
    if np.linalg.norm(np.cross(view, up)) <= np.sqrt(3) * gamma(3 + 5 + 5):
        return [line("camera.up", camera.up, "must not be parallel to the view direction, target - origin")]
    return []
