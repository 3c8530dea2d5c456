"""The setup of original VisRayTrace scenes (camera, lights, background) as plain dicts of visray's fields."""

from math import isfinite
from typing import Any

from visray.scene.messages import hint, line
from visray.scene.seed_entry import Entry, Log
from visray.scene.seed_keys import BLUR, CAMERA, LIGHT, LIGHTS, OCCLUSION, RENDERS, SETUP, SHADINGS

BLACK = (0.0, 0.0, 0.0)
# What the addresses of our fields are called in a setup file.
SPELLINGS = {
    "camera.origin": "camera.lookFrom",
    "camera.target": "camera.lookAt",
    "camera.up": "camera.vup",
    "camera.fov": "camera.vfov",
    "film.height": "camera.pixelsX / camera.aspectRatio",
    "ambient": "globalLight",
    "background.top": "colorTopBackground",
    "background.bottom": "colorDownBackground",
    "settings.spp": "numSamples",
}


def setup(raw: dict, log: Log) -> dict:
    """Camera, film, background, ambient, lights and settings of our scene."""
    e = Entry(raw, "", SETUP, log)
    e.text("output")
    render = e.text("renderType")
    if render is not None and render.strip().upper() not in RENDERS:
        log.warn(line("renderType", render, f"passed over; {hint(render, RENDERS)}"))
    elif render is not None and render.strip().upper() == "TEMPORAL":
        log.warn(line("renderType", render, "a sequence of frames is not built yet; the scene is one picture"))
    occlusion = e.inner("ambientOcclusion", OCCLUSION)
    if occlusion and occlusion.flag("enabled", False):
        log.warn("ambientOcclusion: is not built yet; passed over")
    return {
        **_view(e),
        "background": _background(e),
        "ambient": e.vector("globalLight", BLACK),
        "lights": _lights(e.entries("lights"), log),
        "settings": _settings(e),
    }


def _background(e: Entry) -> Any:
    ends = {"top": e.vector("colorTopBackground", BLACK), "bottom": e.vector("colorDownBackground", BLACK)}
    return BLACK if set(ends.values()) == {BLACK} else ends


def _view(setup: Entry) -> dict:
    """Camera and film."""
    e = setup.inner("camera", CAMERA)
    if e is None:
        setup.log.warn("camera: is missing; it looks from (0, 0, 10) to the origin, 90 degrees wide, 400 x 400 pixels")
        e = Entry({"vup": [0, 1, 0], "vfov": 90}, "camera", CAMERA, setup.log)
    _warn_of_blur(e)
    origin, target = e.vector("lookFrom", (0.0, 0.0, 10.0)), e.vector("lookAt", BLACK)
    up, fov = e.vector("vup", BLACK), e.number("vfov", 0.0)
    if not e.has("vup"):
        e.log.warn(f"{e.at('vup')}: is missing; (0, 1, 0) is used")
        up = (0.0, 1.0, 0.0)
    if not e.has("vfov"):
        e.log.warn(f"{e.at('vfov')}: is missing; 90 degrees is used, since the original's 180 gives no picture")
        fov = 90.0
    return {"camera": {"origin": origin, "target": target, "up": up, "fov": fov}, "film": _film(e)}


def _film(e: Entry) -> dict:
    width, aspect = int(e.number("pixelsX", 400.0)), e.number("aspectRatio", 1.0)
    height = width / aspect if aspect > 0 else 0.0
    if not (aspect > 0 and isfinite(height)):
        e.error("aspectRatio", "must be greater than 0; it is width / height")
        return {}
    if width < 1:
        e.error("pixelsX", "must be at least 1; it is the width of the picture")
        return {}
    return {"width": width, "height": int(height)}


def _warn_of_blur(e: Entry) -> None:
    """The aperture stands in defocusBlur, or beside it where the original looked for it."""
    e.number("aperture", 0.0)
    blur = e.inner("defocusBlur", BLUR)
    if blur:
        blur.number("aperture", 0.0)
        if blur.flag("enabled", False):
            e.log.warn(f"{blur.address}: is not built yet; everything is sharp")


def _settings(e: Entry) -> dict:
    """Samples and shadows: `shadows` says whether there are any, or else the end of `shading` does."""
    made: dict[str, Any] = {}
    samples = e.number("numSamples", 0.0)
    if e.has("numSamples"):
        made["spp"] = int(samples)
    shading = e.chosen("shading", SHADINGS)
    if shading and not shading.startswith("BlinnPhong"):
        e.log.warn(line("shading", shading, "is not built yet; BlinnPhong is used"))
    shadows = e.flag("shadows", shading.endswith("Shadow") if shading else True)
    if shading and not shadows and not e.has("shadows"):
        e.log.warn(line("shading", shading, f"has no shadows; write {shading}Shadow to have them"))
    return made | {"shadows": shadows}


def _lights(raw: list[Any], log: Log) -> dict[str, dict]:
    """The point lights by name: they have none in the file, and are numbered from 1."""
    made = {}
    for i, found in enumerate(raw):
        if not isinstance(found, dict):
            log.error(line(f"lights.{i}", found, "must be an object {...}"))
            continue
        light = _light(found, f"lights.{i}", log)
        if light:
            made[f"light {i + 1}"] = light
    return made


def _light(found: dict, address: str, log: Log) -> dict | None:
    typed = Entry({"type": found["type"]} if "type" in found else {}, address, {"type": ()}, log)
    kind = typed.chosen("type", LIGHTS)
    if kind in LIGHTS[1:]:
        log.error(line(f"{address}.type", kind, "is not built yet; only pointLight is"))
    if not typed.has("type"):
        log.warn(f"{address}: has no type; a pointLight is used, as in the original")
        kind = LIGHTS[0]
    if kind != LIGHTS[0]:
        return None
    if "width" in found and "height" in found:
        log.warn(f"{address}: has a width and a height, which belong to an areaLight; it is a pointLight without them")
        found = {k: v for k, v in found.items() if k not in ("width", "height")}
    e = Entry(found, address, LIGHT, log)
    errors = len(log.errors)
    made = {"type": "point", "position": e.vector("position")}
    made |= {key: e.vector(key, BLACK) for key in ("Ia", "Id", "Is")} | {key: e.number(key, 0.0) for key in "abc"}
    return made if len(log.errors) == errors else None
