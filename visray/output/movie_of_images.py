"""Movies from pictures in Python: vr.write_movie."""

import os
from typing import Any

import numpy as np

from visray.arguments import checked_arguments, shown
from visray.errors import UserError
from visray.output.curves import Gamma
from visray.output.image import Image, check_curve
from visray.output.movie import movie


@checked_arguments
def write_movie(
    path: str | os.PathLike[str], images: Any, fps: float = 25.0, gamma: Gamma = "srgb", exposure: float = 0.0
) -> None:
    """Writes a movie of pictures: an .mp4, .gif or .webp file. An old file is replaced when the movie is complete.

    images: a list or a generator of pictures, such as vr.animate(scene): of Image, or of uint8 arrays with the shape
        (H, W, 3), or (H, W, 4) with alpha, which are shown as they are. All have one size.
    fps: frames per second.
    gamma, exposure: display curve and exposure in stops of each Image.
    """
    check_curve(gamma, exposure)
    is_several = hasattr(images, "__iter__") and getattr(images, "shape", None) != ()
    if isinstance(images, Image | str | bytes) or not is_several:
        raise UserError(f"images = {shown(images)}: must be a list or a generator of pictures")
    with movie(path, fps) as writer:
        for number, image in enumerate(images):
            writer.add(_pixels(number, image, gamma, exposure))


def _pixels(number: int, image: Any, gamma: Gamma, exposure: float) -> np.ndarray:
    """A picture in the numbers for a screen. Shapes: uint8 (H, W, 3), or (H, W, 4) with alpha.

    number: its number among all pictures.
    """
    if isinstance(image, Image):
        return image.display(gamma, exposure)
    right = "must be an Image, or a uint8 array with the shape (height, width, 3) or (height, width, 4)"
    if not isinstance(image, np.ndarray):
        raise UserError(f"images[{number}] = {shown(image)}: {right}")
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] not in (3, 4) or not image.size:
        raise UserError(f"images[{number}]: is an array of {image.dtype} with the shape {image.shape}; {right}")
    return image
