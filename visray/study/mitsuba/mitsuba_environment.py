"""An environment map as Mitsuba's `envmap`.

Mitsuba puts the first row of pixels at the upper pole and the last row at the lower one; visray, like most programs,
puts their centres half a row away from the poles. So Mitsuba gets a picture of 2 H + 1 rows, each blended from two of
the H rows: between the rows both blends are then the same linear functions.

At to_world = 1 the left edge of Mitsuba's picture is towards -z. So visray's map is the same with a rotation of 180
degrees more.
"""

from typing import Any

import mitsuba as mi
import numpy as np

from visray.environment_map import EnvironmentMap
from visray.images.environment import read_map


def envmap(sky: EnvironmentMap) -> dict[str, Any]:
    """The map, as a dict for Mitsuba's load_dict."""
    turned = mi.ScalarTransform4f().rotate([0, 1, 0], 180 + sky.rotation)
    return {
        "type": "envmap",
        "bitmap": mi.Bitmap(rows_at_poles(read_map(sky)).astype(np.float32)),
        "scale": sky.intensity,
        "to_world": turned,
    }


def rows_at_poles(pixels: np.ndarray) -> np.ndarray:
    """The rows of a map at the latitudes j / 2 H from the upper pole, j = 0 to 2 H.

    Shapes: (H, W, 3) -> (2 H + 1, W, 3).
    """
    height = len(pixels)
    place = np.clip(np.arange(2 * height + 1) / 2 - 0.5, 0, height - 1)
    above = np.floor(place).astype(int)
    below, share = np.minimum(above + 1, height - 1), (place - above)[:, None, None]
    return (1 - share) * pixels[above] + share * pixels[below]


def environment_light(sky: EnvironmentMap, d: np.ndarray) -> np.ndarray:
    """Light from directions, by Mitsuba. d: unit vectors. Shapes: (N, 3)."""
    emitter = mi.load_dict(envmap(sky))
    si = mi.SurfaceInteraction3f()
    si.wi = -mi.Vector3f(*d.T.astype(np.float32))
    return np.array(emitter.eval(si), float).T
