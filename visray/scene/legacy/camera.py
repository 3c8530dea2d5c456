"""The camera of original VisRayTrace setups, and the size of their pictures, as plain dicts of visray's fields."""

from math import isfinite

from visray.scene.legacy.entry import Entry
from visray.scene.legacy.keys import BLUR, CAMERA
from visray.scene.messages import line

# The diameter of the lens that the original always used, as it looked for the file's in the wrong place.
LENS = 2.0


def view(setup: Entry) -> dict:
    """Camera and film."""
    e = setup.inner("camera", CAMERA)
    if e is None:
        setup.log.warn("camera: is missing; it looks from (0, 0, 10) to the origin, 90 degrees wide, 400 x 400 pixels")
        e = Entry({"vup": [0, 1, 0], "vfov": 90}, "camera", CAMERA, setup.log)
    camera = {"aperture": _aperture(e)}
    camera |= {"origin": e.vector("lookFrom", (0.0, 0.0, 10.0)), "target": e.vector("lookAt", (0.0, 0.0, 0.0))}
    camera |= {"up": e.vector("vup", (0.0, 1.0, 0.0)), "fov": e.number("vfov", 90.0)}
    if not e.has("vup"):
        e.log.warn(f"{e.at('vup')}: is missing; (0, 1, 0) is used")
    if not e.has("vfov"):
        e.log.warn(f"{e.at('vfov')}: is missing; 90 degrees is used, since the original's 180 gives no picture")
    return {"camera": camera, "film": _film(e)}


def _film(e: Entry) -> dict:
    width, aspect = e.whole("pixelsX", 400), e.number("aspectRatio", 1.0)
    height = width / aspect if aspect > 0 else 0.0
    if not (aspect > 0 and isfinite(height)):
        e.error("aspectRatio", "must be greater than 0; it is width / height")
        return {}
    if width < 1:
        e.error("pixelsX", "must be at least 1; it is the width of the picture")
        return {}
    return {"width": width, "height": int(height)}


def _aperture(e: Entry) -> float:
    """The diameter of the lens, which stands in defocusBlur, or beside it, where the original looked for it.

    The lens is focused on lookAt, as in the original; that is our default.
    """
    beside = e.number("aperture", 0.0)
    blur = e.inner("defocusBlur", BLUR)
    if blur is None:
        return 0.0
    inside = blur.number("aperture", 0.0)
    if not blur.flag("enabled", False):
        return 0.0
    if not blur.has("aperture"):
        if not e.has("aperture"):
            blur.log.warn(f"{blur.at('aperture')}: is missing; {LENS:g} is used, as always in the original")
        return beside if e.has("aperture") else LENS
    if inside != LENS and not e.has("aperture"):
        blur.log.warn(line(blur.at("aperture"), inside, f"counts here; the original always used {LENS:g}"))
    return inside
