"""How colours look: a space in which distances are differences that people see, and red-green blindness.

The space is CAM02-UCS. Its first coordinate is lightness, from 0 (black) to about 100 (white). A distance of 1 is about
the smallest that is seen between two patches side by side.

Source: CIE 159:2004 (CIECAM02); Luo, Cui and Li 2006 (CAM02-UCS); Machado, Oliveira and Fernandes 2009 (blindness).
"""

from typing import NamedTuple

import numpy as np

_XYZ = np.array(
    [
        [0.4123907992659595, 0.357584339383878, 0.1804807884018343],
        [0.21263900587151027, 0.715168678767756, 0.07219231536073371],
        [0.01933081871559182, 0.11919477979462598, 0.9505321522496607],
    ]
)
_CAT02 = np.array([[0.7328, 0.4296, -0.1624], [-0.7036, 1.6975, 0.0061], [0.0030, 0.0136, 0.9834]])
_CONES = np.array([[0.38971, 0.68898, -0.07868], [-0.22981, 1.18340, 0.04641], [0, 0, 1]])
# For each kind of red-green blindness, the linear RGB that look to everybody as a colour looks to the blind.
BLINDNESS = {
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
}


class Viewing(NamedTuple):
    """Conditions under which colours are seen, with an average surround.

    white: X, Y and Z of white. adapting: luminance to which the eye is adapted, in cd/m^2. background: Y behind colours
    """

    white: tuple[float, float, float]
    adapting: float
    background: float


# An sRGB screen in an office: 64 lux, of which grey walls reflect a fifth (IEC 61966-2-1).
SCREEN = Viewing(tuple(100 * _XYZ.sum(axis=1)), 64 / np.pi / 5, 20.0)


def seen(light: np.ndarray) -> np.ndarray:
    """Coordinates in CAM02-UCS of linear Rec. 709 on a screen. Shapes: (N, 3) -> (N, 3)."""
    lightness, colourfulness, hue = appearance(100 * light @ _XYZ.T, SCREEN).T
    m = np.log1p(0.0228 * colourfulness) / 0.0228
    return np.stack([1.7 * lightness / (1 + 0.007 * lightness), m * np.cos(hue), m * np.sin(hue)], axis=1)


def blind(light: np.ndarray, kind: str) -> np.ndarray:
    """The linear Rec. 709 that show everybody how a colour looks to the blind. Shapes: (N, 3) -> (N, 3)."""
    return np.clip(light @ BLINDNESS[kind].T, 0, 1)


def appearance(xyz: np.ndarray, viewing: Viewing) -> np.ndarray:
    """Lightness J, colourfulness M and hue h of CIECAM02; h is in radians. Shapes: (N, 3) -> (N, 3).

    The names of the numbers are those of the standard.
    """
    white = np.array(viewing.white)
    adapted = 1 - np.exp((-viewing.adapting - 42) / 92) / 3.6
    k = 1 / (5 * viewing.adapting + 1)
    fl = 0.2 * k**4 * 5 * viewing.adapting + 0.1 * (1 - k**4) ** 2 * np.cbrt(5 * viewing.adapting)
    n = viewing.background / white[1]
    z, nbb = 1.48 + np.sqrt(n), 0.725 * n**-0.2
    gain = adapted * white[1] / (_CAT02 @ white) + 1 - adapted
    to_cones = _CONES @ np.linalg.inv(_CAT02) @ (gain[:, None] * _CAT02)

    r, g, b = _compressed(xyz @ to_cones.T, fl).T
    rw, gw, bw = _compressed(to_cones @ white, fl)
    red_green, yellow_blue = r - 12 * g / 11 + b / 11, (r + g - 2 * b) / 9
    hue = np.arctan2(yellow_blue, red_green)
    bright, bright_white = 2 * r + g + b / 20 - 0.305, 2 * rw + gw + bw / 20 - 0.305
    lightness = 100 * np.maximum(bright / bright_white, 0) ** (0.69 * z)
    eccentricity = (np.cos(hue + 2) + 3.8) / 4
    t = 50000 / 13 * nbb * eccentricity * np.hypot(red_green, yellow_blue) / (r + g + 1.05 * b)
    chroma = t**0.9 * np.sqrt(lightness / 100) * (1.64 - 0.29**n) ** 0.73
    return np.stack([lightness, chroma * fl**0.25, hue], axis=1)


def _compressed(cones: np.ndarray, fl: float) -> np.ndarray:
    """Answer of the cones of an eye to light; it grows more slowly than the light. Shape: (N, 3), or (3)."""
    power = (fl * np.abs(cones) / 100) ** 0.42
    return np.sign(cones) * 400 * power / (27.13 + power) + 0.1
