"""Draws one picture over another, in the numbers for a screen."""

import numpy as np

from visray.output.curves import Gamma, curve


def drawn_over(shown: np.ndarray, alpha: np.ndarray, layer: np.ndarray, gamma: Gamma) -> tuple[np.ndarray, np.ndarray]:
    """A picture with a layer over it, and its alpha.

    shown: colour of the picture for a screen, from 0 to 1, not multiplied by alpha. alpha: from 0 to 1.
    layer: red, green, blue and alpha in linear light, premultiplied.
    gamma: display curve of the picture; the colours of the layer get it too, but no exposure.

    The two are blended in the numbers for a screen, and not in linear light: so text has the weight that it has where
    it was drawn.

    Shapes: shown (H, W, 3), alpha (H, W), layer (H, W, 4).
    """
    above = np.clip(layer[..., 3].astype(float), 0, 1)[..., None]
    light = np.divide(layer[..., :3], above, out=np.zeros(shown.shape), where=above > 0)
    below = alpha[..., None] * (1 - above)
    total = above + below
    mixed = above * curve(np.clip(light, 0, 1), gamma) + below * shown
    return np.divide(mixed, total, out=np.zeros_like(mixed), where=total > 0), total[..., 0]
