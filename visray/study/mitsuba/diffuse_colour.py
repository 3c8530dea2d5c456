"""The diffuse colour of objects at (u, v), in NumPy: by the same words as the kernels, in other arithmetic."""

import numpy as np

from visray.images import read_image
from visray.materials import Material
from visray.scene.scene import Scene
from visray.study.mitsuba.rounding import UNRESOLVED
from visray.textures import CheckerTexture, ImageTexture, Texture


class DiffuseColours:
    """The kd of a scene's objects, in the order of `names`."""

    def __init__(self, scene: Scene, names: tuple[str, ...]):
        materials = {"default": Material()} | scene.materials
        used = [materials[scene.objects[name].material] for name in names]
        self.kd = np.array([m.kd for m in used] + [(0, 0, 0)], float)
        self.textures = [m.texture and scene.textures[m.texture] for m in used]
        pictures = {n: t for n, t in scene.textures.items() if isinstance(t, ImageTexture)}
        self.pixels = {id(t): read_image(t.file, t.encoding, f"textures.{n}.file") for n, t in pictures.items()}

    def colours(self, index: np.ndarray, uv: np.ndarray) -> np.ndarray:
        """kd of objects at (u, v); index -1 is none. Shapes: (N), (N, 2) -> (N, 3)."""
        found = self.kd[index]
        for i, texture in enumerate(self.textures):
            lanes = np.flatnonzero(index == i) if texture else ()
            if len(lanes):
                found[lanes] = self._seen(texture, uv[lanes])
        return found

    def uncertain(self, index: np.ndarray, uv: np.ndarray, slack: np.ndarray) -> np.ndarray:
        """Whether (u, v) that are off by `slack` may have quite another colour. Shapes: (N), (N, 2), (N) -> (N)."""
        painted = np.append([t is not None for t in self.textures], False)[index]
        found = np.zeros(len(index), bool)
        lanes = np.flatnonzero(painted)
        here = self.colours(index[lanes], uv[lanes])
        for way in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            beside = self.colours(index[lanes], uv[lanes] + slack[lanes, None] * way)
            found[lanes] |= np.abs(beside - here).max(1, initial=0) > UNRESOLVED
        return found

    def _seen(self, t: Texture, uv: np.ndarray) -> np.ndarray:
        place = uv * t.scale + t.offset
        if isinstance(t, CheckerTexture):
            cells = np.floor(2 * place).astype(np.int64).sum(1)
            return np.where((cells % 2 == 0)[:, None], t.a, t.b)
        return _looked_up(self.pixels[id(t)], t.filter == "bilinear", t.wrap, place)


def _looked_up(pixels: np.ndarray, bilinear: bool, wrap: str, place: np.ndarray) -> np.ndarray:
    """A picture at places, (0, 0) its lower left corner and (1, 1) its upper right one. Shapes: (H, W, 3), (N, 2)."""
    size = np.array([pixels.shape[1], pixels.shape[0]])
    if not bilinear:
        return _texel(pixels, wrap, np.floor(place * size).astype(np.int64))
    x = place * size - 0.5
    low = np.floor(x)
    total = np.zeros((len(place), 3))
    for step in np.ndindex(2, 2):
        share = np.where(step, x - low, 1 - (x - low)).prod(1)
        total += share[:, None] * _texel(pixels, wrap, low.astype(np.int64) + step)
    return total


def _texel(pixels: np.ndarray, wrap: str, cell: np.ndarray) -> np.ndarray:
    """Pixels by column from the left and row from below, any whole numbers. Shapes: (N, 2) -> (N, 3)."""
    size = np.array([pixels.shape[1], pixels.shape[0]])
    if wrap == "repeat":
        cell = cell % size
    elif wrap == "mirror":
        cell = np.minimum(cell % (2 * size), 2 * size - 1 - cell % (2 * size))
    cell = np.clip(cell, 0, size - 1)
    return pixels[size[1] - 1 - cell[:, 1], cell[:, 0]].astype(float)
