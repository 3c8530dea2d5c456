"""What one browser sees of a prepared scene: with its own camera and the size of its window.

A lane is one pixel in the arrays of a kernel.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from visray import setup
from visray.kernel_scene import with_view
from visray.quantities import Arrays, stacked
from visray.records import altered
from visray.scene.check import checked
from visray.scene.film import Film
from visray.scene.scene import Scene
from visray.setup import Prepared


def seen(prepared: Prepared, camera: Any, size: tuple[int, int], lists: bool) -> Prepared:
    """The prepared scene with another camera and another size of its film. Raises UserError if the camera is not valid.

    camera: a camera; None: that of the scene
    size: width and height in pixels
    lists: whether camera rays find rows in lists (kernel_scene.with_view)

    Only what depends on the camera and the film is made again, which takes a few milliseconds for scenes of any size.
    """
    camera = prepared.scene.camera if camera is None else checked(Scene(camera=camera)).camera
    if _effects(camera) != _effects(prepared.scene.camera):
        prepared = prepared.updated({"camera": camera})
    film = prepared.scene.film.resized(size)
    scene = altered(prepared.scene, {"camera": camera, "film": film})
    numbers = stacked(prepared.a, type(camera), [camera])
    kernel = with_view(prepared.kernel, numbers, scene, lists)
    order, x, y = lanes(prepared.a, *size)
    packed = replace(prepared.packed, camera=numbers)
    return replace(prepared, scene=scene, packed=packed, kernel=kernel, order=order, x=x, y=y, shutter=None)


def has_lists(prepared: Prepared) -> bool:
    """Whether camera rays find rows in lists."""
    s = prepared.kernel
    return s.camera_lists is not None or (s.origin is not None and bool(s.origin.plan.lists))


def _effects(camera: Any) -> tuple:
    """What effects and kernels depend on in a camera."""
    return type(camera), camera.aperture > 0


@lru_cache(maxsize=16)
def lanes(a: Arrays, width: int, height: int) -> tuple[np.ndarray, Any, Any]:
    """Number (row * width + column), column and row of each lane's pixel (setup.lanes). Films of a size share them."""
    setup.films.check_memory(width, height)
    return setup.lanes(a, Film(width=width, height=height))
