"""One moment of a scene: the values of its tracks at a time, and the plain scene that they make."""

import math
from dataclasses import replace
from typing import Any

from visray.animation.targets import sort_of
from visray.animation.track import Stage
from visray.arguments import checked_arguments
from visray.errors import UserError
from visray.scene.address import changed, value
from visray.scene.check import checked
from visray.scene.scene import Scene


def assignments(scene: Scene, t: float) -> dict[str, Any]:
    """The values of all tracks at time t, by address. Domain: a checked scene.

    t: seconds; before 0 and after the duration the values are those of the ends.
    """
    animation = scene.animation
    if animation is None:
        return {}
    t, still = min(max(t, 0.0), animation.duration), replace(scene, animation=None)
    found: dict[str, Any] = {}

    def moved(address: str) -> Any:
        """The value at an address with what the other tracks write."""
        written = {a: x for a, x in found.items() if a == address or a.startswith(f"{address}.")}
        return value(changed(still, written), address) if written else value(still, address)

    stage = Stage(animation.duration, lambda a: value(still, a), moved, lambda a: sort_of(still, a))
    for track in sorted(animation.tracks.values(), key=lambda track: track.follows):
        found |= track.values_at(t, stage)
    return found


@checked_arguments
def at(scene: Scene, t: float) -> Scene:
    """The scene of one moment: a plain scene without an animation.

    t: seconds, from 0 to the duration of the animation
    """
    if scene.animation is None:
        raise UserError("at: the scene has no animation; give it one, or use the scene as it is")
    duration = scene.animation.duration
    if not isinstance(t, int | float) or not math.isfinite(t) or not 0 <= t <= duration:
        raise UserError(f"t = {t}: must be a time of the animation, from 0 to {duration:g} s")
    scene = checked(scene)
    return changed(replace(scene, animation=None), assignments(scene, t))
