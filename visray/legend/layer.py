"""The legend of a scene as a layer of its picture."""

from dataclasses import replace

import numpy as np

from visray.legend.content import legend_content
from visray.legend.covering import covering_notes
from visray.legend.drawing import Drawn, drawn
from visray.scene.scene import Scene


def has_legend(scene: Scene) -> bool:
    """Whether a scene has a legend."""
    return scene.data is not None and scene.data.legend is not None


def drawn_legend(scene: Scene, rgb: np.ndarray, alpha: np.ndarray) -> Drawn:
    """The legend of a scene that has one, as a picture, and notes for users.

    rgb, alpha: colour of the picture, premultiplied, and its coverage. The text is light or dark as the picture is
        over white. Of a region, the legend is the part of that of the whole picture, which is taken to be as the
        region is on average.

    Shapes: rgb (H, W, 3), alpha (H, W).
    """
    film, over = scene.film, rgb + (1 - alpha[..., None])
    if film.region is None:
        legend = drawn(legend_content(scene), *film.size, over)
    else:
        left, top, right, bottom = film.region
        whole = np.broadcast_to(over.mean((0, 1)), (*film.size[::-1], 3)).copy()
        whole[top:bottom, left:right] = over
        legend = drawn(legend_content(scene), *film.size, whole)
        legend = replace(legend, pixels=legend.pixels[top:bottom, left:right])
    return replace(legend, notes=(*legend.notes, *covering_notes(scene, legend.layout.panels)))
