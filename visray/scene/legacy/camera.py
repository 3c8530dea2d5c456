"""Camera and film of a VisRayTrace setup, as plain dicts of visray's fields."""

from math import isfinite

from visray.scene.legacy.entry import Entry
from visray.scene.legacy.keys import BLUR, CAMERA
from visray.scene.messages import line

# Lens diameter that VisRayTrace always used: it looked for the file's diameter under the wrong key.
LENS_DIAMETER = 2.0


def camera_and_film(setup: Entry) -> dict:
    """Dict with the camera and the film of a setup."""
    e = setup.nested("camera", CAMERA)
    if e is None:
        setup.log.warn("camera: is missing; it looks from (0, 0, 10) to the origin, 90 degrees wide, 400 x 400 pixels")
        e = Entry({"vup": [0, 1, 0], "vfov": 90}, "camera", CAMERA, setup.log)
    camera = {"aperture": _aperture(e)}
    camera |= {"origin": e.vector("lookFrom", (0.0, 0.0, 10.0)), "target": e.vector("lookAt", (0.0, 0.0, 0.0))}
    camera |= {"up": e.vector("vup", (0.0, 1.0, 0.0)), "fov": e.number("vfov", 90.0)}
    if not e.has("vup"):
        e.log.warn(f"{e.at('vup')}: is missing; (0, 1, 0) is used")
    if not e.has("vfov"):
        e.log.warn(f"{e.at('vfov')}: is missing; 90 degrees is used, since VisRayTrace's 180 gives no picture")
    return {"camera": camera, "film": _film(e)}


def _film(e: Entry) -> dict:
    """Fields of the film: width and height in pixels. If they are wrong, {} with an error in the log.

    e: the camera of the setup.
    """
    width, aspect = e.integer("pixelsX", 400), e.number("aspectRatio", 1.0)
    height = width / aspect if aspect > 0 else 0.0
    if not (aspect > 0 and isfinite(height)):
        e.error("aspectRatio", "must be greater than 0; it is width / height")
        return {}
    if width < 1:
        e.error("pixelsX", "must be at least 1; it is the width of the picture")
        return {}
    return {"width": width, "height": int(height)}


def _aperture(e: Entry) -> float:
    """Diameter of the lens; 0 if the setup does not enable defocus.

    The key `aperture` belongs inside defocusBlur. VisRayTrace looked for it beside defocusBlur, so that place is read
    too. The lens is focused on lookAt, as in VisRayTrace; this is visray's default.

    e: the camera of the setup.
    """
    beside = e.number("aperture", 0.0)
    blur = e.nested("defocusBlur", BLUR)
    if blur is None:
        return 0.0
    inside = blur.number("aperture", 0.0)
    if not blur.flag("enabled", False):
        return 0.0
    if not blur.has("aperture"):
        if not e.has("aperture"):
            blur.log.warn(f"{blur.at('aperture')}: is missing; {LENS_DIAMETER:g} is used, as always in VisRayTrace")
        return beside if e.has("aperture") else LENS_DIAMETER
    if inside != LENS_DIAMETER and not e.has("aperture"):
        text = f"counts in visray; VisRayTrace always used {LENS_DIAMETER:g}"
        blur.log.warn(line(blur.at("aperture"), inside, text))
    return inside
