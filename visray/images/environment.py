"""Environment maps in kernels: the pixels in arrays, and the light from a direction.

A map is equirectangular: its columns are equal steps of longitude, its rows equal steps of latitude.
"""

from dataclasses import dataclass
from math import pi
from typing import Any

import drjit as dr
import numpy as np

from visray.environment_map import EnvironmentMap
from visray.errors import UserError
from visray.images.atlas import WRAPS
from visray.images.lookup import around, blend
from visray.images.reading import read_image
from visray.quantities import Arrays

ADDRESS = "background.file"
REPEAT, CLAMP = WRAPS.index("repeat"), WRAPS.index("clamp")


@dataclass(frozen=True)
class Panorama:
    """The pixels of a map in arrays.

    texels: R, G, B and 0 of each pixel, the bottom row first
    width, height: numbers of columns and rows
    """

    texels: Any
    width: Any
    height: Any


@dataclass(frozen=True)
class Environment:
    """An environment map as kernels read it.

    panorama: its pixels
    turn: its rotation about y, in turns, from 0 to 1
    intensity: factor of its light
    """

    panorama: Panorama
    turn: Any
    intensity: Any


def read_map(background: EnvironmentMap) -> np.ndarray:
    """Pixels of a map in linear light, as float32. Shape: (H, W, 3), the top row first.

    Raises a UserError of one line if the file cannot be read, if it is a part of a picture, if it is not twice as wide
    as high, or if a pixel is negative or not finite.
    """
    pixels = read_image(background.file, "auto", ADDRESS, whole=True)
    height, width = pixels.shape[:2]
    if width != 2 * height:
        right = f"{2 * height} x {height}" if width > height else f"{width + width % 2} x {(width + 1) // 2}"
        problem = f"has {width} x {height} pixels, and an equirectangular map is twice as wide as high"
        raise UserError(f'{ADDRESS} = "{background.file}": {problem}; convert it, to {right} for example')
    return pixels


def pack_map(a: Arrays, background: EnvironmentMap) -> Panorama:
    """The pixels of a map in arrays. Reads its file; errors are those of read_map."""
    pixels = read_map(background)
    height, width = pixels.shape[:2]
    texels = np.zeros((height * width, 4), np.float32)
    texels[:, :3] = pixels[::-1].reshape(-1, 3)
    packed = Panorama(a.put(a.F32, texels.ravel()), dr.opaque(a.F, width), dr.opaque(a.F, height))
    # Dr.Jit must copy the arrays now: NumPy's memory is freed when this function returns.
    dr.eval(packed)
    return packed


def environment(a: Arrays, panorama: Panorama, numbers: EnvironmentMap) -> Environment:
    """The map as kernels read it. Derivatives flow through it. numbers: rotation and intensity, as arrays."""
    turn = numbers.rotation / 360
    return Environment(panorama, a.F(turn - dr.floor(dr.detach(turn))), numbers.intensity)


def light(a: Arrays, sky: Environment, d: Any) -> Any:
    """Light of a map from direction d, a colour: a blend of the four nearest pixels, times the intensity.

    The first and the last column are neighbours. Above the middle of the top row and below that of the bottom row there
    is only this row.

    d: direction to look in, of any length but 0
    Domain: any d; where it is not finite, the light is that of any pixels. Derivatives by d and by the rotation jump at
        the centres of pixels. Straight up and down, longitude has no derivative: there it counts as 0.
    Error: of the place in the map, at most 2^-20 of its size (tests/test_environment.py); in double precision 2^-49.
    """
    x, y, z = (a.F(component) for component in d)
    across2 = dr.square(x) + dr.square(z)
    upright = across2 == 0
    across = dr.select(upright, 0, dr.sqrt(dr.select(upright, 1, across2)))
    longitude = dr.atan2(dr.select(upright, 0, x), dr.select(upright, 1, -z))
    u = longitude * (0.5 / pi) + (0.5 + sky.turn)
    # fmax turns NaN into 0.
    u = dr.fmax(u - dr.floor(u), 0)
    v = dr.fmin(dr.fmax(dr.atan2(across, -y) * (1 / pi), 0), 1)
    return _blended(a, sky.panorama, u, v) * sky.intensity


def _blended(a: Arrays, panorama: Panorama, u: Any, v: Any) -> Any:
    """The blend of the four pixels around (u, v) in [0, 1]^2; v is 0 at the bottom."""
    pitch = a.U(panorama.width)

    def texel(i: Any, j: Any) -> Any:
        rgb0 = dr.gather(a.Q32, panorama.texels, j * pitch + i)
        return a.V(rgb0.x, rgb0.y, rgb0.z)

    left, right, s = around(a, u, panorama.width, REPEAT, 1)
    below, above, t = around(a, v, panorama.height, CLAMP, 1)
    low, high = (blend(texel(left, j), texel(right, j), s) for j in (below, above))
    return blend(low, high, t)
