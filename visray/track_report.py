"""Notes about tracks of an animation that go on after its end."""

from visray.errors import AnimationWarning
from visray.scene.scene import Scene
from visray.warn import warn


def warn_of_tracks(scene: Scene) -> None:
    """Warns of tracks that go on after the end of the animation."""
    for text in track_notes(scene):
        warn(text, AnimationWarning)


def track_notes(scene: Scene) -> list[str]:
    """List of sentences about tracks that go on after the end of the animation, each of which begins with an
    address."""
    if scene.animation is None:
        return []
    tracks, duration = scene.animation.tracks, scene.animation.duration
    return [
        f"animation.tracks.{name}.{part}: {text}"
        for name, track in tracks.items()
        for part, text in track.notes(duration)
    ]
