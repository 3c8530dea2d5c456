"""The values that the tracks of a scene write at a time."""

from typing import Any

from visray.animation.track import Stage
from visray.scene.animation_targets import sort_of, still
from visray.scene.edits import edited, value_at, value_in
from visray.scene.scene import Scene


def track_values(scene: Scene, t: float) -> dict[str, Any]:
    """The values of all tracks at time t, by address. Domain: a scene with an animation whose tracks have no flaws."""
    rest, found = still(scene), {}

    def moved(address: str) -> Any:
        """The value at an address with what the tracks before have written there or at a part of it."""
        written = {a: x for a, x in found.items() if a == address or a.startswith(f"{address}.")}
        return value_in(edited(rest, written), address) if written else value_at(rest, address)

    stage = Stage(scene.animation.duration, lambda a: value_at(rest, a), moved=moved, sort=lambda a: sort_of(rest, a))
    for track in sorted(scene.animation.tracks.values(), key=lambda track: track.follows):
        found |= track.values_at(t, stage)
    return found
