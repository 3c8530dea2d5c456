"""The legend of a scene over its live picture."""

from functools import cache
from importlib import import_module

import numpy as np

from visray import work_threads
from visray.legend.layer import drawn_legend
from visray.output.curves import curve, linear
from visray.scene.scene import Scene


@cache
def preload() -> None:
    """Begins to load what draws legends, in another thread: it takes most of a second."""
    work_threads.begun(lambda: import_module("matplotlib.figure"), "visray legend")


class LegendOver:
    """A legend that is drawn over pictures of one scene and one size.

    scene: the scene, with the camera and the size of the picture
    rgb: the picture, which chooses light or dark text. Shape: uint8 (H, W, 3)
    """

    def __init__(self, scene: Scene, rgb: np.ndarray):
        legend = drawn_legend(scene, linear(rgb / 255), np.ones(rgb.shape[:2]))
        layer = legend.pixels.reshape(-1, 4)
        # Most of the picture has no legend.
        self.pixels = np.flatnonzero(layer[:, 3] > 0)
        found = layer[self.pixels].astype(float)
        above = np.minimum(found[:, 3:], 1)
        self.colour = above * curve(np.clip(found[:, :3] / above, 0, 1), "srgb") * 255
        self.below = 1 - above

    def over(self, rgb: np.ndarray) -> np.ndarray:
        """A picture with the legend, blended in the numbers for a screen as in files. Shapes: uint8 (H, W, 3)."""
        shown = rgb.reshape(-1, 3).copy()
        shown[self.pixels] = np.floor(self.colour + self.below * shown[self.pixels] + 0.5).astype(np.uint8)
        return shown.reshape(rgb.shape)
