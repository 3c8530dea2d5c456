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
        over white.

    Shapes: rgb (H, W, 3), alpha (H, W).
    """
    film = scene.film
    legend = drawn(legend_content(scene), film.width, film.height, rgb + (1 - alpha[..., None]))
    return replace(legend, notes=(*legend.notes, *covering_notes(scene, legend.layout.panels)))
