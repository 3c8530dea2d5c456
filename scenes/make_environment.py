"""The environment map scenes/textures/dusk.exr: the sky after a summer's day, computed from the numbers in this file
alone, so free to use like it.

    python scenes/make_environment.py
    python scenes/make_environment.py -o somewhere/dusk.exr

Equirectangular, 768 x 384 pixels of half floats in linear light; the same every time. The light is that of a painter:
a clear sky over a warm horizon, a low sun with a glow, thin clouds that it colours from below, and hills.
"""

import argparse
from pathlib import Path

import numpy as np
import OpenEXR

WIDTH, HEIGHT = 768, 384
# The sun: longitude and latitude in degrees, 0 and 0 in the middle of the picture; its radius, and its light.
SUN, RADIUS, SUNLIGHT = (-52.0, 8.5), 2.4, np.array([7.0, 4.0, 1.6])
# Colours of the sky by height, on the side of the sun and opposite to it.
HEIGHTS = np.radians([0.0, 4.0, 12.0, 28.0, 55.0, 90.0])
NEAR = np.array(
    [[2.6, 1.05, 0.3], [2.2, 1.0, 0.42], [1.25, 0.82, 0.6], [0.5, 0.55, 0.7], [0.16, 0.27, 0.55], [0.07, 0.14, 0.36]]
)
FAR = np.array(
    [[0.5, 0.4, 0.45], [0.62, 0.45, 0.5], [0.5, 0.42, 0.56], [0.26, 0.31, 0.52], [0.12, 0.2, 0.44], [0.07, 0.14, 0.36]]
)
GROUND = np.array([0.1, 0.075, 0.06])
# Pixels over which the edge of a hill fades: where the map is seen enlarged, its pixels are not.
SOFT = 5.0


def directions() -> np.ndarray:
    """The unit directions of the pixels: the middle towards -z, +x to the right of it, y up. Shape: (H, W, 3)."""
    longitude = 2 * np.pi * ((np.arange(WIDTH) + 0.5) / WIDTH - 0.5)
    latitude = np.pi * (0.5 - (np.arange(HEIGHT) + 0.5) / HEIGHT)
    across = np.cos(latitude)[:, None]
    y = np.broadcast_to(np.sin(latitude)[:, None], (HEIGHT, WIDTH))
    return np.stack([across * np.sin(longitude), y, -across * np.cos(longitude)], 2)


def toward(longitude: float, latitude: float) -> np.ndarray:
    """The unit direction of a place in the picture, given in degrees."""
    u, v = np.radians([longitude, latitude])
    return np.array([np.cos(v) * np.sin(u), np.sin(v), -np.cos(v) * np.cos(u)])


def waves(p: np.ndarray, octaves: int, seed: int) -> np.ndarray:
    """Smooth noise from about -1 to 1, a sum of plane waves of ever smaller length. p: points, (..., 3)."""
    rng, total, weight = np.random.default_rng(seed), np.zeros(p.shape[:-1]), 0.0
    for octave in range(octaves):
        for _ in range(6):
            along = rng.normal(size=3)
            along *= 1.7**octave / np.linalg.norm(along)
            total += 0.62**octave * np.sin(p @ along + rng.uniform(0, 2 * np.pi))
        weight += 0.62 ** (2 * octave) * 3
    return total / np.sqrt(weight)


def blended(height: np.ndarray, colours: np.ndarray) -> np.ndarray:
    """Colours by height above the horizon, in radians. Shapes: (H, W); result (H, W, 3)."""
    return np.stack([np.interp(height, HEIGHTS, channel) for channel in colours.T], -1)


def sky(d: np.ndarray) -> np.ndarray:
    """Light of the sky in some directions. Shapes: (H, W, 3)."""
    sun = toward(*SUN)
    height, cosine = np.arcsin(np.clip(d[..., 1], 0, 1)), d @ sun
    side = ((1 + cosine) / 2)[..., None] ** 1.5
    clear = (1 - side) * blended(height, FAR) + side * blended(height, NEAR)
    # Clouds lie in a layer; seen at a low angle they are long and thin.
    layer = d / (0.12 + np.abs(d[..., 1:2])) * np.array([1.1, 0.0, 2.6])
    density = np.clip(waves(layer + 11, 6, 3) - 0.1, 0, 1) * np.clip(height / 0.12, 0, 1) * np.clip(1.35 - height, 0, 1)
    lit = 0.75 * clear + side * np.exp(-2.2 * height)[..., None] * np.array([1.5, 0.6, 0.35])
    cover = (1 - np.exp(-2.5 * density))[..., None]
    light = (1 - cover) * clear + cover * lit
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))[..., None]
    glow = 4.0 * np.exp(-angle / 5.0) + 0.9 * np.exp(-angle / 20.0)
    disk = np.clip((RADIUS - angle) / 0.4 + 0.5, 0, 1)
    return light + glow * np.array([1.0, 0.55, 0.22]) + disk * SUNLIGHT


def dusk() -> np.ndarray:
    """The picture. Shape: float16 (H, W, 3), the top row first."""
    d = directions()
    flat = d * np.array([1, 0, 1]) / np.maximum(np.hypot(d[..., :1], d[..., 2:]), 1e-9)
    height = np.degrees(np.arcsin(d[..., 1]))
    light = sky(d)
    for distance, (tall, seed, share) in enumerate([(5.5, 5, 0.32), (3.0, 8, 0.14)]):
        ridge = tall * (0.75 + 0.35 * waves(flat * (3 + 3 * distance), 4, seed))
        above = np.clip((height - ridge) * HEIGHT / 180 / SOFT + 0.5, 0, 1)[..., None]
        haze = share * sky(np.stack([flat[..., 0], 0.03 + 0 * height, flat[..., 2]], 2)).clip(0, 3)
        light = above * light + (1 - above) * haze
    below = np.clip(-height / 1.5, 0, 1)[..., None]
    return ((1 - below) * light + below * GROUND).astype(np.float16)


def main() -> None:
    parser = argparse.ArgumentParser(description="Writes the environment map of scenes/environment.json.")
    own = Path(__file__).resolve().parent / "textures" / "dusk.exr"
    parser.add_argument("-o", "--output", type=Path, default=own, metavar="FILE", help="the file to write")
    header = {"compression": OpenEXR.PIZ_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": dusk()}).write(str(parser.parse_args().output))


if __name__ == "__main__":
    main()
