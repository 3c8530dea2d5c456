"""Checks the frames of an animation before the first one is rendered: at some time between its keys, a scene may be
wrong, as where the camera goes through its target.
"""

from collections.abc import Sequence

from visray.animation.frames import Frame
from visray.errors import MomentError
from visray.progress import Bar
from visray.scene.animation_flaws import touched
from visray.scene.animation_targets import still
from visray.scene.animation_values import track_values
from visray.scene.check import examined
from visray.scene.edits import edited
from visray.scene.scene import Scene


def check_frames(scene: Scene, frames: Sequence[Frame], progress: bool) -> None:
    """Raises a MomentError with the first frame whose scene is not valid. Nothing is packed.

    progress: whether a progress bar is shown. Domain: a checked scene.
    """
    small, before = touched(scene), None
    with Bar("checking frames", len(frames), progress) as bar:
        for done, frame in enumerate(frames, 1):
            values = track_values(small, frame.time)
            if values != before and (flaws := examined(edited(still(small), values))[1]):
                raise MomentError(*(f"at {frame.time:g} s: {text}" for text in flaws)).of_frame(frame.number)
            before = values
            bar.update(done)
