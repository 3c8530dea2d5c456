"""Motion blur of a live picture: what one browser sees while the shutter is open."""

import math
from dataclasses import replace
from typing import Any

from visray.animation.moment import assignments
from visray.camera import OrthographicCamera
from visray.live.state import State
from visray.live.viewpoint import widened
from visray.motion_blur import OpenShutter, Values, values_while_open
from visray.scene.edits import within
from visray.setup import Prepared
from visray.study.leaving_out import AREA_LIGHTS

# What tells whether a browser looks from where the scene's camera is.
PLACE = ("origin", "target", "up")


def moves(state: State) -> bool:
    """Whether something of a scene moves while the shutter is open."""
    return state.scene.animation is not None and bool(values_while_open(state.scene, state.time))


def opened(prepared: Prepared, state: State) -> Prepared:
    """The prepared scene with its shutter open, if anything moves that is seen; else unchanged.

    prepared: the scene of this moment, as a browser sees it
    state: the scene, prepared

    A camera that the animation moves is blurred in browsers that look from there. One that was moved in a browser
    stands still.
    """
    home, camera = state.prepared.scene.camera, prepared.scene.camera
    is_home = type(camera) is type(home) and all(getattr(camera, f) == getattr(home, f) for f in PLACE)
    sections = [*([] if is_home else ["camera"]), *(["lights"] if AREA_LIGHTS in state.left_out else [])]

    def seen(values: Values) -> dict[str, Any]:
        kept = {a: x for a, x in values.items() if not any(within(a, section) for section in sections)}
        for name in ("fov", "height"):
            if (address := f"camera.{name}") in kept:
                wider = widened(replace(home, **{name: kept[address]}), _factor(home, camera))
                kept[address] = getattr(wider, name)
        return kept

    now, values = seen(assignments(state.scene, state.time)), values_while_open(state.scene, state.time)
    values = tuple(map(seen, values))
    if all(x == now for x in values):
        return prepared
    return replace(prepared, shutter=OpenShutter(prepared, values, state.time))


def _factor(home: Any, camera: Any) -> float:
    """How much more a browser shows than the scene's camera, as in `widening`. camera: that of the browser."""
    if isinstance(home, OrthographicCamera):
        return camera.height / home.height
    half = (math.tan(math.radians(x.fov) / 2) for x in (camera, home))
    return 1.0 if camera.fov == home.fov else next(half) / next(half)
