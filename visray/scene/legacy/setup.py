"""A VisRayTrace setup (camera, lights, background, settings) as plain dicts of visray's fields."""

from collections.abc import Iterable
from typing import Any

from visray import modes
from visray.hints import hint
from visray.scene.legacy.camera import camera_and_film
from visray.scene.legacy.entry import BLACK, Entry
from visray.scene.legacy.keys import MODELS, OCCLUSION, RENDERS, SHADINGS
from visray.scene.legacy.lights import lights
from visray.scene.legacy.materials import EnabledEffects
from visray.scene.messages import line
from visray.scene.scene import DEEPEST, Settings


def enabled_effects(e: Entry) -> EnabledEffects:
    """Whether a setup enables each effect of materials. Later programs of the VisRayTrace family have these switches.

    e: the setup.
    """
    return EnabledEffects(e.flag("reflections", True), e.flag("refractions", True), e.flag("textures", True))


def setup(e: Entry, materials: Iterable[dict], compat: bool, moves: bool) -> dict:
    """Dict of the camera, film, background, ambient, lights and settings of the visray scene.

    e: the setup.
    materials: fields of the materials of the scene's objects.
    compat: whether VisRayTrace's rules apply.
    moves: whether the scene is animated.
    """
    e.text("output")
    render = e.text("renderType")
    if render is not None and render.strip().upper() not in RENDERS:
        e.log.warn(line("renderType", render, f"ignored; {hint(render, RENDERS)}"))
    elif render is not None and render.strip().upper() == "TEMPORAL" and not moves:
        e.log.warn(line("renderType", render, "nothing moves in the scene; it is one picture"))
    has_bounces = any(any(m.get(share, BLACK)) for m in materials for share in ("kr", "kt"))
    return {
        **camera_and_film(e),
        "background": _background(e),
        "ambient": e.vector("globalLight", BLACK),
        "lights": lights(e.items("lights"), e.log),
        "settings": _settings(e, compat) | _depth(e, has_bounces, compat),
    }


def _background(e: Entry) -> Any:
    """Background: a gradient, or black if both of its colours are black."""
    ends = {"top": e.vector("colorTopBackground", BLACK), "bottom": e.vector("colorDownBackground", BLACK)}
    return BLACK if set(ends.values()) == {BLACK} else ends


def _settings(e: Entry, compat: bool) -> dict:
    """Fields of the settings, except `depth`.

    The setup's key `background` says which colour a reflected or refracted ray has if it hits nothing: the background,
    or the global light.
    """
    settings: dict[str, Any] = {"misses": "background" if e.flag("background", True) else "ambient"}
    samples = e.integer("numSamples", 0)
    if e.has("numSamples"):
        settings["spp"] = samples
    occlusion = _occlusion(e)
    if compat:
        settings |= {"area": "centre", "local": "full"}
        occlusion |= {"hemisphere": "box"} if occlusion else {}
    return settings | _shading(e) | ({"occlusion": occlusion} if occlusion else {})


def _shading(e: Entry) -> dict:
    """Fields of the settings: shading mode and shadows. The key `shadows` decides whether there are shadows. If it is
    missing, there are shadows if `shading` ends in "Shadow" or is missing too."""
    written = e.choice("shading", SHADINGS)
    model = MODELS[(written or "BlinnPhong").removesuffix("Shadow")]
    shadows = e.flag("shadows", written.endswith("Shadow") if written else True)
    if modes.BY_NAME[model].lit and not shadows and not e.has("shadows"):
        e.log.warn(line("shading", written, f"has no shadows; write {written}Shadow to have them"))
    return {"shading": model, "shadows": shadows}


def _occlusion(e: Entry) -> dict:
    """Rays and distance of the ambient occlusion; {} if it is off. The defaults are VisRayTrace's constants."""
    occlusion = e.nested("ambientOcclusion", OCCLUSION)
    if occlusion is None or not occlusion.flag("enabled", False):
        return {}
    rays = {"sky": occlusion.integer("raysGlobal", 20), "near": occlusion.integer("raysLocal", 20)}
    return rays | {"distance": occlusion.number("maxDistance", 100.0)}


def _depth(e: Entry, has_bounces: bool, compat: bool) -> dict:
    """Dict with the field `depth`, the number of reflections and refractions in a row; {} for visray's default.

    MAXDEPTH counts the camera ray too, so depth = MAXDEPTH - 1. VisRayTrace did not use MAXDEPTH, and nearly all of its
    files say 1. So 1 is ignored unless VisRayTrace's rules apply (`compat`).

    has_bounces: whether a material reflects or refracts.
    """
    levels = e.integer("MAXDEPTH", 1)
    if not compat and levels < 2:
        if has_bounces:
            ignored = line("MAXDEPTH", levels, "did not count in VisRayTrace")
            text = f"{Settings.depth} reflections and refractions are followed (none with --set settings.depth=0)"
            e.log.warn(f"{ignored if e.has('MAXDEPTH') else 'MAXDEPTH: is missing'}; {text}")
        return {}
    if levels > DEEPEST + 1:
        e.log.warn(line("MAXDEPTH", levels, f"must be at most {DEEPEST + 1}, which is used"))
    return {"depth": min(max(levels - 1, 0), DEEPEST)}
