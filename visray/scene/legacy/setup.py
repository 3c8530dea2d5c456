"""The setup of original VisRayTrace scenes (camera, lights, background, settings) as plain dicts of visray's fields."""

from collections.abc import Iterable
from typing import Any

from visray import modes
from visray.scene.legacy.camera import view
from visray.scene.legacy.entry import BLACK, Entry
from visray.scene.legacy.keys import MODELS, OCCLUSION, RENDERS, SHADINGS
from visray.scene.legacy.lights import lights
from visray.scene.legacy.materials import Effects
from visray.scene.messages import hint, line
from visray.scene.scene import Settings

DEEPEST = 1000


def effects(e: Entry) -> Effects:
    """What of the materials the setup lets count: later programs of the family have a switch for each."""
    return Effects(e.flag("reflections", True), e.flag("refractions", True), e.flag("textures", True))


def setup(e: Entry, materials: Iterable[dict], compat: bool) -> dict:
    """Camera, film, background, ambient, lights and settings of our scene; `materials` are those of its objects."""
    e.text("output")
    render = e.text("renderType")
    if render is not None and render.strip().upper() not in RENDERS:
        e.log.warn(line("renderType", render, f"passed over; {hint(render, RENDERS)}"))
    elif render is not None and render.strip().upper() == "TEMPORAL":
        e.log.warn(line("renderType", render, "a sequence of frames is not built yet; the scene is one picture"))
    bounces = any(any(m.get(share, BLACK)) for m in materials for share in ("kr", "kt"))
    return {
        **view(e),
        "background": _background(e),
        "ambient": e.vector("globalLight", BLACK),
        "lights": lights(e.entries("lights"), e.log),
        "settings": _settings(e, compat) | _depth(e, bounces, compat),
    }


def _background(e: Entry) -> Any:
    ends = {"top": e.vector("colorTopBackground", BLACK), "bottom": e.vector("colorDownBackground", BLACK)}
    return BLACK if set(ends.values()) == {BLACK} else ends


def _settings(e: Entry, compat: bool) -> dict:
    """`background` says whether rays that a surface sends on see it, or else the global light."""
    made: dict[str, Any] = {"misses": "background" if e.flag("background", True) else "ambient"}
    samples = e.whole("numSamples", 0)
    if e.has("numSamples"):
        made["spp"] = samples
    occlusion = _occlusion(e)
    if compat:
        made |= {"area": "centre", "local": "full"}
        occlusion |= {"hemisphere": "box"} if occlusion else {}
    return made | _shading(e) | ({"occlusion": occlusion} if occlusion else {})


def _shading(e: Entry) -> dict:
    """The model, and whether there are shadows: `shadows` says so, or else the end of `shading` does."""
    written = e.chosen("shading", SHADINGS)
    model = MODELS[(written or "BlinnPhong").removesuffix("Shadow")]
    shadows = e.flag("shadows", written.endswith("Shadow") if written else True)
    if modes.BY_NAME[model].lit and not shadows and not e.has("shadows"):
        e.log.warn(line("shading", written, f"has no shadows; write {written}Shadow to have them"))
    return {"shading": model, "shadows": shadows}


def _occlusion(e: Entry) -> dict:
    """Rays and distance of the ambient occlusion, by default the constants of the original; empty where it is off."""
    inner = e.inner("ambientOcclusion", OCCLUSION)
    if inner is None or not inner.flag("enabled", False):
        return {}
    rays = {"sky": inner.whole("raysGlobal", 20), "near": inner.whole("raysLocal", 20)}
    return rays | {"distance": inner.number("maxDistance", 100.0)}


def _depth(e: Entry, bounces: bool, compat: bool) -> dict:
    """How many reflections and refractions are followed; MAXDEPTH counts the ray from the eye as well.

    The original never read it, and nearly all of its files say 1. So a 1 counts only with `compat`.
    """
    levels = e.whole("MAXDEPTH", 1)
    if not compat and levels < 2:
        if bounces:
            found = line("MAXDEPTH", levels, "did not count in the original")
            text = f"{Settings.depth} reflections and refractions are followed (none with --set settings.depth=0)"
            e.log.warn(f"{found if e.has('MAXDEPTH') else 'MAXDEPTH: is missing'}; {text}")
        return {}
    if levels > DEEPEST + 1:
        e.log.warn(line("MAXDEPTH", levels, f"must be at most {DEEPEST + 1}, which is used"))
    return {"depth": min(max(levels - 1, 0), DEEPEST)}
