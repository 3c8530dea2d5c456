"""One moment of a scene: the values of its tracks at a time, and the plain scene that they make."""

import math
from dataclasses import replace
from typing import Any

from visray.animation.animation import Animation
from visray.arguments import checked_arguments
from visray.errors import UserError, of_moment
from visray.identity_cache import IdentityCache
from visray.scene.address import changed
from visray.scene.animation_targets import still
from visray.scene.animation_values import track_values
from visray.scene.check import checked
from visray.scene.edits import SECTIONS
from visray.scene.scene import Scene

# The checked animations of scenes, each with the state (_state) of the scene at that time.
_animations = IdentityCache()


def assignments(scene: Scene, t: float) -> dict[str, Any]:
    """The values of all tracks at time t, by address. Domain: a checked scene.

    t: seconds; before 0 and after the duration the values are those of the ends.
    """
    if scene.animation is None:
        return {}
    return track_values(scene, min(max(t, 0.0), scene.animation.duration))


@checked_arguments
def at(scene: Scene, t: float) -> Scene:
    """The scene of one moment: a plain scene without an animation.

    t: seconds, from 0 to the duration of the animation
    """
    if scene.animation is None:
        raise UserError("at: the scene has no animation; give it one, or use the scene as it is")
    scene = _checked(scene if scene.camera is not None and scene.lights is not None else checked(scene))
    duration = scene.animation.duration
    if not isinstance(t, int | float) or not math.isfinite(t) or not 0 <= t <= duration:
        raise UserError(f"t = {t}: must be a time of the animation, from 0 to {duration:g} s")
    with of_moment(f"at {t:g} s"):
        return changed(_sharp(still(scene)), assignments(scene, t))


def _checked(scene: Scene) -> Scene:
    """Validated copy of a scene with an animation. The animation is checked once, as this takes long for many keys."""
    if not isinstance(scene.animation, Animation):
        return checked(scene)
    known = _animations.get(scene)
    if known is None or known[0] != _state(scene):
        animation = checked(scene).animation
        known = _state(scene), animation
        _animations.put(scene, known)
    return replace(checked(still(scene)), animation=known[1])


def _state(scene: Scene) -> tuple:
    """All names in a valid scene, each with the id() of its value: it tells whether a dict of the scene was changed in
    place."""
    layers = {} if scene.data is None else scene.data.layers
    sections = (*(getattr(scene, name) for name in SECTIONS), layers, scene.animation.tracks)
    return tuple((name, id(value)) for section in sections for name, value in section.items())


def _sharp(scene: Scene) -> Scene:
    """The scene without a shutter, which blurs only what moves."""
    return replace(scene, camera=replace(scene.camera, shutter=None)) if scene.camera.shutter else scene


def still_at(scene: Scene, t: float | None) -> Scene:
    """What a picture of a scene shows: of an animated scene the moment t, else the scene itself. Domain: a checked
    scene.

    t: seconds; None: the beginning of the animation. Raises UserError for another t if there is no animation.
    """
    if scene.animation is None and t is None:
        return _sharp(scene)
    return at(scene, 0.0 if t is None else t)
