"""Checks scenes, from files and from Python: the fields one by one, then what only several together show.

What has passed before is not validated again (validated.py); names that refer to others are looked up every time, as
the dicts of a scene may change. Only where something is wrong is the whole scene validated, to tell all that is.
"""

import sys
from dataclasses import asdict, fields, is_dataclass, replace
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from visray import lights, primitives, textures
from visray.camera import Camera
from visray.errors import UserError
from visray.geometry import gamma
from visray.materials import Material
from visray.quantities import FARTHEST, Name
from visray.scene.garbage import uncollected
from visray.scene.messages import hint, line, lines, printable
from visray.scene.scene import ADAPTER, Scene
from visray.scene.validated import plain, remember, validated
from visray.transforms import Transform, bounds, compose

DEFAULT_MATERIAL = "default"
# The sections whose entries are named elsewhere in a scene, and what stands in for an entry that is wrong.
STAND_INS = {"textures": {"type": "checker"}, "materials": {}}
# The sections of a scene that hold things by name, and their kinds.
SECTIONS = {
    "textures": frozenset(textures.KINDS),
    "materials": frozenset((Material,)),
    "lights": frozenset(lights.KINDS),
    "objects": frozenset(primitives.KINDS),
}
NAMES = TypeAdapter(list[Name])


def checked(scene: Scene) -> Scene:
    """A validated copy of the scene, whose parts that were validated before are kept; raises UserError with all that
    is wrong."""
    if not isinstance(scene, Scene):
        raise UserError(f"a scene is a visray Scene, not a {type(scene).__name__}")
    result, wrong = examined(parts(scene))
    if wrong:
        raise UserError(*wrong)
    return result


def parts(scene: Scene) -> dict[str, Any]:
    """The scene as plain dicts, but for the things that have names: these are instances still."""
    found = {f.name: getattr(scene, f.name) for f in fields(scene)}
    return {name: _things(part) if name in SECTIONS else plain(part) for name, part in found.items()}


def _things(section: Any) -> Any:
    if not isinstance(section, dict):
        return plain(section)
    return {name: thing if is_dataclass(type(thing)) else plain(thing) for name, thing in section.items()}


def examined(raw: Any) -> tuple[Scene | None, list[str]]:
    """The scene that plain dicts and lists describe, and a line for everything that is wrong with it. Things that have
    names may be instances of the kinds as well."""
    if not isinstance(raw, dict):
        return None, [line("", raw, "is not a scene; a scene is an object {...}")]
    scene = _accepted(raw)
    if scene is not None:
        return scene, []
    raw = {name: _without_instances(part) for name, part in raw.items()}
    try:
        scene = ADAPTER.validate_python(raw)
    except ValidationError as error:
        return None, [printable(text) for text in lines(error, raw) + _flaws_of_the_rest(raw, error)]
    return scene, flaws(scene)


def _without_instances(part: Any) -> Any:
    return {name: _plain(thing) for name, thing in part.items()} if isinstance(part, dict) else part


def _plain(thing: Any) -> Any:
    return plain(thing) if is_dataclass(type(thing)) else thing


@uncollected()
def _accepted(raw: dict) -> Scene | None:
    """The scene of these parts, if nothing is wrong with it, or None. What is new in it is remembered."""
    sections = {name: raw[name] for name in SECTIONS if isinstance(raw.get(name), dict)}
    known = {name: _known(things, SECTIONS[name]) for name, things in sections.items()}
    unknown = {
        name: {key: _plain(thing) for key, thing in things.items() if key not in known[name]}
        for name, things in sections.items()
    }
    try:
        for things in known.values():
            NAMES.validate_python(list(things))
        new = ADAPTER.validate_python(raw | unknown)
    except ValidationError:
        return None
    joined = {name: _joined(things, known[name], getattr(new, name)) for name, things in sections.items()}
    scene = replace(new, **joined)
    if _own_flaws_of(new) or _without_referent(scene):
        return None
    for name, things in sections.items():
        for key, equal in getattr(new, name).items():
            remember(things[key] if is_dataclass(type(things[key])) else equal, equal)
    return scene


def _known(things: dict, kinds: frozenset) -> dict:
    """The validated equals of those things that have passed before and are of the right kind."""
    return {key: equal for key, thing in things.items() if type(equal := validated(thing)) in kinds}


def _joined(things: dict, known: dict, new: dict) -> dict:
    """What is known and what is new, in the order of the things."""
    if not (known and new):
        return known or new
    return {key: known[key] if key in known else new[key] for key in things}


def _own_flaws_of(scene: Scene) -> bool:
    """Whether the camera, a light or an object has a flaw of its own."""
    with np.errstate(all="ignore"):
        return bool(
            _camera_flaws(scene.camera)
            or any(light.flaws() for light in scene.lights.values())
            or any(thing.flaws() or _transform_flaw(thing.transform) for thing in scene.objects.values())
        )


def _without_referent(scene: Scene) -> bool:
    """Whether the scene lacks a texture or a material that is named in it."""
    named = {m.texture for m in scene.materials.values()}, {x.material for x in scene.objects.values()}
    return not (named[0] <= {None, *scene.textures} and named[1] <= {DEFAULT_MATERIAL, *scene.materials})


def _flaws_of_the_rest(raw: dict, error: ValidationError) -> list[str]:
    """The flaws of what pydantic found nothing wrong with, so that a user sees all errors at once."""
    sections = {k: dict(v) if isinstance(v, dict) else v for k, v in raw.items()}
    for section, *inner in (e["loc"] for e in error.errors(include_url=False)):
        if section in STAND_INS and not inner:
            return []
        if section in STAND_INS and inner[-1] != "[key]":
            sections[section][inner[0]] = STAND_INS[section]  # its name is there, whatever is wrong with it
        elif section in ("objects", "lights", *STAND_INS) and inner:
            sections[section].pop(inner[0], None)
        else:
            sections.pop(section, None)
    try:
        return flaws(ADAPTER.validate_python(sections))
    except ValidationError:
        return []


def flaws(scene: Scene) -> list[str]:
    """What no field alone shows to be wrong, a line each: `ADDRESS = VALUE: what is wrong; what would be right`."""
    with np.errstate(all="ignore"):
        found = _camera_flaws(scene.camera)
        for name, material in scene.materials.items():
            found += _texture_flaws(scene, f"materials.{name}.texture", material.texture)
        for name, light in scene.lights.items():
            found += _own_flaws(f"lights.{name}", light)
        for name, thing in scene.objects.items():
            found += _object_flaws(scene, f"objects.{name}", thing)
        return [printable(text) for text in found]


def _texture_flaws(scene: Scene, address: str, texture: str | None) -> list[str]:
    if texture is None or texture in scene.textures:
        return []
    return [line(address, texture, f"unknown texture; {hint(texture, scene.textures)}")]


def _own_flaws(address: str, thing: Any) -> list[str]:
    """The flaws that a light or an object finds in itself."""
    found = []
    for field, text in thing.flaws():
        name, _, part = field.partition(".")
        value = getattr(thing, name)
        value = asdict(value) if is_dataclass(value) else value[int(part)] if part else value
        found.append(line(f"{address}.{field}", value, text))
    return found


def _object_flaws(scene: Scene, address: str, thing: Any) -> list[str]:
    found = []
    if thing.material != DEFAULT_MATERIAL and thing.material not in scene.materials:
        text = f"unknown material; {hint(thing.material, dict.fromkeys([*scene.materials, DEFAULT_MATERIAL]))}"
        found.append(line(f"{address}.material", thing.material, text))
    found += _own_flaws(address, thing)
    wrong = _transform_flaw(thing.transform)
    if wrong:
        found.append(line(f"{address}.transform", [asdict(step) for step in thing.transform], wrong))
    return found


def _camera_flaws(camera: Camera) -> list[str]:
    view = np.subtract(camera.target, camera.origin)
    up = np.array(camera.up, float)
    if camera.target == camera.origin:
        return [line("camera.target", camera.target, "must differ from origin")]
    # The kernel normalises with the root of a sum of squares, which must be a normal number.
    for address, value, vector in (("camera.target", camera.target, view), ("camera.up", camera.up, up)):
        if not sys.float_info.min <= vector @ vector <= sys.float_info.max:
            return [line(address, value, "is too near or too far for double precision")]
    view, up = view / np.linalg.norm(view), up / np.linalg.norm(up)
    # Each component of the product is off by at most 3 roundings of |view| |up|, and the unit vectors by 5 each: the
    # difference or none, and 4 of the norm and the quotient.
    if np.linalg.norm(np.cross(view, up)) <= np.sqrt(3) * gamma(3 + 5 + 5):
        return [line("camera.up", camera.up, "must not be parallel to the view direction, target - origin")]
    return []


def _transform_flaw(steps: tuple[Transform, ...]) -> str | None:
    """Why the composed transform has no inverse in double arithmetic, or None."""
    if not steps or _clearly_invertible(steps):
        return None
    whole = compose(steps)
    if not np.isfinite(whole).all():
        return "the steps together overflow double precision"
    x, y, z = whole[:, :3].T
    lengths = np.linalg.norm(whole, axis=0)
    if lengths.max() > FARTHEST or lengths[:3].min() < 1 / FARTHEST:
        return f"the steps together scale below {1 / FARTHEST:g} or reach beyond {FARTHEST:g}"
    volume = abs(x @ np.cross(y, z))
    # Every step adds at most 4 roundings to each entry, and the triple product has 6: below that its sign is unknown.
    uncertain = gamma(4 * len(steps) + 6) * np.linalg.norm(x) * np.linalg.norm(y) * np.linalg.norm(z)
    if not (volume > uncertain and sys.float_info.min <= volume <= sys.float_info.max):
        return "the steps together have no inverse in double precision; they flatten the object"
    return None


def _clearly_invertible(steps: tuple[Transform, ...]) -> bool:
    """Whether bounds show that all that is asked of a transform holds, by far more than rounding can change: that moves
    a composed entry by at most gamma(4 n + 6) times the greatest factor."""
    least, most, far = bounds(steps)
    if not (least > 2 / FARTHEST and max(most, far) < FARTHEST / 2):
        return False
    return (least / most) ** 3 > 100 * gamma(4 * len(steps) + 6)
