"""Notes about the animation of a scene: what moves, whether motion is blurred, and when the scene needs another
kernel."""

from collections.abc import Iterator
from itertools import pairwise

from visray.animation.frames import frame_times
from visray.animation.moment import at
from visray.features import features
from visray.motion_blur import values_while_open
from visray.scene.scene import Scene
from visray.track_report import track_notes

# Number of moments at which it is looked at which effects a scene needs.
MOST_MOMENTS = 64
# Number of addresses that a note lists.
SHOWN = 8


def animation_notes(scene: Scene) -> list[str]:
    """A sentence each about what moves, about motion blur, about tracks that go on after the end, and about effects
    that come or go. Domain: a checked scene."""
    if scene.animation is None:
        shutter = scene.camera.shutter is not None
        return ["camera.shutter: blurs nothing, as the scene has no animation"] if shutter else []
    return [_what_moves(scene), _blur(scene), *track_notes(scene), *_changes(scene)]


def _what_moves(scene: Scene) -> str:
    """The length of the animation and the addresses that tracks write."""
    animation, frames = scene.animation, len(frame_times(scene.animation))
    moved = list(dict.fromkeys(address for track in animation.tracks.values() for address in track.addresses()))
    listed = ", ".join(moved[:SHOWN]) + (f" and {len(moved) - SHOWN} more" if len(moved) > SHOWN else "")
    text = (
        f"animation: {animation.duration:g} s, {frames} frames, {animation.fps:g} a second; moves {listed or 'nothing'}"
    )
    return f"{text}; the effects and rays above are those of the beginning"


def _blur(scene: Scene) -> str:
    """Whether frames have motion blur, and why."""
    shutter = scene.camera.shutter
    if shutter is None:
        return "motion blur: off, as camera.shutter is null"
    if not any(values_while_open(scene, t) for _, t in frame_times(scene.animation)):
        return "motion blur: off, as nothing moves while the shutter is open"
    return (
        f"motion blur: on, from {shutter.open:g} to {shutter.close:g} of a frame; "
        f"the scene is made for {shutter.moments} moments of each frame in which something moves"
    )


def _changes(scene: Scene) -> Iterator[str]:
    """Yields when effects come or go. Such a frame needs another kernel."""
    duration = scene.animation.duration
    times = {t for track in scene.animation.tracks.values() for t in track.check_times(duration) if t <= duration}
    ordered = sorted({0.0, duration} | times)
    ordered = ordered[:: -(-len(ordered) // MOST_MOMENTS)]
    on = [(t, {x.name for x in features(at(scene, t)).listed if x.on}) for t in ordered]
    for (before, old), (after, new) in pairwise(on):
        if old != new:
            parts = [f"{', '.join(sorted(x))} {word}" for x, word in ((new - old, "begins"), (old - new, "ends")) if x]
            yield f"animation: from {before:g} to {after:g} s, {'; '.join(parts)}: another kernel is compiled"
