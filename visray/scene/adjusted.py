"""Changes of the size of the film and of settings, as options of the command line and arguments in Python give them."""

from dataclasses import replace
from typing import Any

import numpy as np

from visray.arguments import shown
from visray.errors import UserError
from visray.scene.check import checked_as_written, fitted
from visray.scene.scene import Scene


def adjusted(scene: Scene, *, size: tuple[int, int] | None = None, **settings: Any) -> Scene:
    """The validated scene with another size of the film and other settings. A camera and lights that it does not have
    are fitted to this size.

    size: width and height in pixels; None keeps the size.
    settings: values of fields of Settings by name, such as spp; None keeps the value.
    """
    return fitted(adjusted_as_written(scene, size=size, **settings))


def adjusted_as_written(scene: Scene, *, size: tuple[int, int] | None = None, **settings: Any) -> Scene:
    """As `adjusted`, but what the scene does not have is not fitted."""
    scene = checked_as_written(scene)
    changed = {k: v for k, v in settings.items() if v is not None}
    if changed:
        scene = replace(scene, settings=replace(scene.settings, **changed))
    if size is not None:
        if not isinstance(size, (tuple, list, np.ndarray)) or np.shape(size)[:1] != (2,):
            raise UserError(f"size = {shown(size)}: must be a width and a height, such as (640, 480)")
        scene = replace(scene, film=replace(scene.film, width=size[0], height=size[1]))
    return checked_as_written(scene) if changed or size is not None else scene
