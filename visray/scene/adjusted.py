"""Changes of the size of the film and of settings, as options of the command line and arguments in Python give them."""

from dataclasses import replace
from typing import Any

import numpy as np

from visray.arguments import shown
from visray.errors import UserError
from visray.records import altered
from visray.scene.check import checked_as_written, fitted
from visray.scene.scene import Scene


def adjusted(scene: Scene, **changes: Any) -> Scene:
    """As adjusted_as_written, and a camera and lights that the scene does not have are fitted to the new size."""
    return fitted(adjusted_as_written(scene, **changes))


def adjusted_as_written(
    scene: Scene,
    *,
    size: tuple[int, int] | None = None,
    scale: float | None = None,
    region: tuple[int, int, int, int] | None = None,
    filter: Any = None,
    **settings: Any,
) -> Scene:
    """The validated scene with another film and other settings. What the scene does not have is not fitted.

    size: width and height of the whole picture in pixels; None keeps the size. Without `scale`, the film's scale is
        then 1.
    scale, region, filter: values of fields of Film; None keeps the value.
    settings: values of fields of Settings by name, such as spp; None keeps the value.
    """
    scene = checked_as_written(scene)
    changed = {k: v for k, v in settings.items() if v is not None}
    if changed:
        # The check of the scene names the addresses of wrong values.
        scene = replace(scene, settings=altered(scene.settings, changed))
    film = {k: v for k, v in (("scale", scale), ("region", region), ("filter", filter)) if v is not None}
    if size is not None:
        if not isinstance(size, (tuple, list, np.ndarray)) or np.shape(size)[:1] != (2,):
            raise UserError(f"size = {shown(size)}: must be a width and a height, such as (640, 480)")
        film = {"width": size[0], "height": size[1], "scale": 1.0} | film
    return checked_as_written(replace(scene, film=altered(scene.film, film))) if changed or film else scene


def smaller(scene: Scene, size: tuple[int, int]) -> Scene:
    """The validated scene whose film is the whole picture in another size. size: width and height in pixels"""
    return fitted(checked_as_written(replace(scene, film=scene.film.resized(size))))
