"""The diffuse colour of objects at (u, v): a reference implementation of textures in NumPy.

The definitions are those of the kernels; the arithmetic is independent of them.
"""

import numpy as np

from visray.images import read_image
from visray.materials import Material
from visray.scene.scene import Scene
from visray.study.mitsuba.rounding import UNRESOLVED
from visray.textures import CheckerTexture, ImageTexture, Texture


class DiffuseColours:
    """The diffuse colours kd of a scene's objects. Index i stands for the object names[i]."""

    def __init__(self, scene: Scene, names: tuple[str, ...]):
        materials = {"default": Material()} | scene.materials
        materials_of_objects = [materials[scene.objects[name].material] for name in names]
        self.kd = np.array([m.kd for m in materials_of_objects] + [(0, 0, 0)], float)
        self.textures = [m.texture and scene.textures[m.texture] for m in materials_of_objects]
        images = {n: t for n, t in scene.textures.items() if isinstance(t, ImageTexture)}
        self.pixels = {id(t): read_image(t.file, t.encoding, f"textures.{n}.file") for n, t in images.items()}

    def colours(self, index: np.ndarray, uv: np.ndarray) -> np.ndarray:
        """kd of objects at (u, v); black for index -1.

        index: the object in each lane
        Shapes: (N), (N, 2) -> (N, 3).
        """
        kd = self.kd[index]
        for i, texture in enumerate(self.textures):
            lanes = np.flatnonzero(index == i) if texture else ()
            if len(lanes):
                kd[lanes] = self._texture_colour(texture, uv[lanes])
        return kd

    def uncertain(self, index: np.ndarray, uv: np.ndarray, error: np.ndarray) -> np.ndarray:
        """Whether the colour changes by more than UNRESOLVED if u and v are both changed by `error`, up or down.

        Shapes: (N), (N, 2), (N) -> (N).
        """
        textured = np.append([t is not None for t in self.textures], False)[index]
        changes = np.zeros(len(index), bool)
        lanes = np.flatnonzero(textured)
        unmoved = self.colours(index[lanes], uv[lanes])
        for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            moved = self.colours(index[lanes], uv[lanes] + error[lanes, None] * signs)
            changes[lanes] |= np.abs(moved - unmoved).max(1, initial=0) > UNRESOLVED
        return changes

    def _texture_colour(self, t: Texture, uv: np.ndarray) -> np.ndarray:
        st = uv * t.scale + t.offset
        if isinstance(t, CheckerTexture):
            cells = np.floor(2 * st).astype(np.int64).sum(1)
            return np.where((cells % 2 == 0)[:, None], t.a, t.b)
        return _image_colour(self.pixels[id(t)], t.filter == "bilinear", t.wrap, st)


def _image_colour(pixels: np.ndarray, bilinear: bool, wrap: str, st: np.ndarray) -> np.ndarray:
    """Colours of an image at st: (0, 0) is the lower left corner of the image, (1, 1) the upper right corner.

    bilinear: whether the four nearest texels are blended; otherwise the texel that contains st is taken
    wrap: how the image continues outside, as in ImageTexture
    Shapes: pixels (H, W, 3), st (N, 2) -> (N, 3).
    """
    size = np.array([pixels.shape[1], pixels.shape[0]])
    if not bilinear:
        return _texel(pixels, wrap, np.floor(st * size).astype(np.int64))
    x = st * size - 0.5
    low = np.floor(x)
    total = np.zeros((len(st), 3))
    for step in np.ndindex(2, 2):
        weight = np.where(step, x - low, 1 - (x - low)).prod(1)
        total += weight[:, None] * _texel(pixels, wrap, low.astype(np.int64) + step)
    return total


def _texel(pixels: np.ndarray, wrap: str, cell: np.ndarray) -> np.ndarray:
    """Colours of texels. Shapes: cell (N, 2) -> (N, 3).

    cell: column from the left and row from below. It may lie outside the image; then `wrap` says which texel is taken.
    """
    size = np.array([pixels.shape[1], pixels.shape[0]])
    if wrap == "repeat":
        cell = cell % size
    elif wrap == "mirror":
        cell = np.minimum(cell % (2 * size), 2 * size - 1 - cell % (2 * size))
    cell = np.clip(cell, 0, size - 1)
    return pixels[size[1] - 1 - cell[:, 1], cell[:, 0]].astype(float)
