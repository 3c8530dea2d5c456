"""The values that the tracks of a scene write at a time."""

from typing import Any

from visray.animation.track import Stage, Track
from visray.scene.animation_targets import sort_of, still
from visray.scene.edits import value_at
from visray.scene.moved_scene import MovedScene
from visray.scene.scene import Scene


def track_values(scene: Scene, t: float) -> dict[str, Any]:
    """The values of all tracks at time t, by address. Domain: a scene with an animation whose tracks have no flaws."""
    rest, found = still(scene), {}
    now = MovedScene(rest, found)
    stage = Stage(
        scene.animation.duration,
        value=lambda a: value_at(rest, a),
        moved=now.value,
        center=now.center,
        sort=lambda a: sort_of(rest, a),
    )
    for track in sorted(scene.animation.tracks.values(), key=_order):
        found |= track.values_at(t, stage)
    return found


def _order(track: Track) -> tuple:
    """Key that puts tracks into the order in which they need each other: what is inside of something comes first, and
    geometries before their instances."""
    address = track.addresses()[0]
    return track.follows, not address.startswith("geometries."), -address.count(".")
