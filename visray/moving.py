"""A frame of an animation, prepared: the scene of its moment, with what moves until the next frame."""

from collections.abc import Collection
from dataclasses import replace

from visray.motion_blur import opened
from visray.motion_vectors import has_motion, next_frame
from visray.scene.scene import Scene
from visray.setup import Prepared


def moving(
    prepared: Prepared, scene: Scene, t: float, fps: float | None = None, layers: Collection[str] = ()
) -> Prepared:
    """The prepared scene of the moment t with its shutter open, for motion blur, and with the next frame, if a layer
    needs it for motion vectors.

    scene: the animated scene.
    t: seconds.
    fps: frames per second; None: those of the animation.
    layers: names of the layers that are wanted.
    """
    after = next_frame(scene, t, fps) if has_motion(layers) else None
    return opened(replace(prepared, after=after), scene, t, fps)
