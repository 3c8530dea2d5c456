"""The diffuse and ambient colours of objects at (u, v): a reference implementation of textures in NumPy.

The definitions are those of the kernels; the arithmetic is independent of them.
"""

from fractions import Fraction
from math import ceil, floor

import numpy as np

from visray.images import read_image
from visray.scene.scene import Scene
from visray.study.mitsuba.rounding import UNRESOLVED
from visray.textures import CheckerTexture, ImageTexture, Texture


class SurfaceColours:
    """The diffuse colours kd and ambient colours ka of a scene's objects. Index i stands for the front of the object
    names[i], and index N + i for its back, where N is the number of objects.

    count: number of objects
    emission: emission of each object; black for index -1
    unlit: whether each object shows kd as it is; the last entry is False, for index -1
    """

    def __init__(self, scene: Scene, names: tuple[str, ...]):
        sides = [scene.sides_of(scene.objects[name].material) for name in names]
        materials_of_objects = [scene.material(name).resolved for side in zip(*sides) for name in side]
        self.count = len(names)
        self.kd, self.ka, self.emission = (
            np.array([getattr(m, field) for m in materials_of_objects] + [(0, 0, 0)], float)
            for field in ("kd", "ka", "emission")
        )
        self.unlit = np.array([*(m.unlit for m in materials_of_objects), False])
        self.scales_ka = [m.textured == "ka and kd" for m in materials_of_objects]
        self.v_ends = 2 * [scene.shape_of(scene.objects[name]).kind.v_ends for name in names]
        self.textures = [m.texture and scene.textures[m.texture] for m in materials_of_objects]
        images = {n: t for n, t in scene.textures.items() if isinstance(t, ImageTexture)}
        self.pixels = {id(t): read_image(t.file, t.encoding, f"textures.{n}.file") for n, t in images.items()}

    def seen(self, objects: np.ndarray, inside: np.ndarray) -> np.ndarray:
        """The index of the side that is seen of objects; -1 for the object -1.

        inside: whether it is the back
        Shapes: (N), (N) -> (N).
        """
        return np.where(inside & (objects >= 0), self.count + objects, objects)

    def diffuse(self, index: np.ndarray, uv: np.ndarray) -> np.ndarray:
        """kd of objects at (u, v); black for index -1.

        index: the object's side in each lane
        Shapes: (N), (N, 2) -> (N, 3).
        """
        return self.both(index, uv)[0]

    def both(self, index: np.ndarray, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """kd and ka of objects at (u, v); black for index -1.

        index: the object's side in each lane
        Shapes: (N), (N, 2) -> (N, 3), (N, 3).
        """
        kd, ka = self.kd[index], self.ka[index]
        for i, texture in enumerate(self.textures):
            lanes = np.flatnonzero(index == i) if texture else ()
            if len(lanes):
                kd[lanes] = self._texture_colour(texture, uv[lanes], self.v_ends[i])
                ka[lanes] *= kd[lanes] if self.scales_ka[i] else 1
        return kd, ka

    def uncertain(self, index: np.ndarray, uv: np.ndarray, error: np.ndarray) -> np.ndarray:
        """Whether the colour changes by more than UNRESOLVED if u and v are both changed by `error`, up or down.

        Shapes: (N), (N, 2), (N) -> (N).
        """
        textured = np.append([t is not None for t in self.textures], False)[index]
        changes = np.zeros(len(index), bool)
        lanes = np.flatnonzero(textured)
        unmoved = self.diffuse(index[lanes], uv[lanes])
        for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            moved = self.diffuse(index[lanes], uv[lanes] + error[lanes, None] * signs)
            changes[lanes] |= np.abs(moved - unmoved).max(1, initial=0) > UNRESOLVED
        return changes

    def _texture_colour(self, t: Texture, uv: np.ndarray, v_ends: bool) -> np.ndarray:
        """Colour of a texture. v_ends: whether v ends at poles, 0 and 1."""
        st = uv * t.scale + t.offset
        if isinstance(t, CheckerTexture):
            cells = np.floor(2 * st).astype(np.int64)
            cells[:, 1] = _between_poles(cells[:, 1], t, 2) if v_ends else cells[:, 1]
            return np.where((cells.sum(1) % 2 == 0)[:, None], t.a, t.b)
        return _image_colour(self.pixels[id(t)], t, st, v_ends)


def _between_poles(row: np.ndarray, t: Texture, height: int) -> np.ndarray:
    """The nearest row of pixels that lies between the poles, for each row. height: rows in the texture's image."""
    # Fractions of the decimal numbers in the scene file, so that rows which touch a pole are told exactly.
    offset, scale = (Fraction(repr(float(x))) for x in (t.offset[1], t.scale[1]))
    poles = sorted((offset * height, (offset + scale) * height))
    first = floor(poles[0])
    return np.clip(row, first, max(first, ceil(poles[1]) - 1))


def _image_colour(pixels: np.ndarray, t: ImageTexture, st: np.ndarray, v_ends: bool) -> np.ndarray:
    """Colours of an image at st: (0, 0) is the lower left corner of the image, (1, 1) the upper right corner.

    v_ends: whether v ends at poles, 0 and 1
    Shapes: pixels (H, W, 3), st (N, 2) -> (N, 3).
    """
    size = np.array([pixels.shape[1], pixels.shape[0]])

    def texel(cell: np.ndarray) -> np.ndarray:
        rows = _between_poles(cell[:, 1], t, size[1]) if v_ends else cell[:, 1]
        return _texel(pixels, t.wraps, np.stack((cell[:, 0], rows), 1))

    if t.filter == "nearest":
        return texel(np.floor(st * size).astype(np.int64))
    x = st * size - 0.5
    low = np.floor(x)
    total = np.zeros((len(st), 3))
    for step in np.ndindex(2, 2):
        weight = np.where(step, x - low, 1 - (x - low)).prod(1)
        total += weight[:, None] * texel(low.astype(np.int64) + step)
    return total


def _texel(pixels: np.ndarray, wraps: tuple[str, str], cell: np.ndarray) -> np.ndarray:
    """Colours of texels. Shapes: cell (N, 2) -> (N, 3).

    cell: column from the left and row from below. It may lie outside the image; then `wraps` say which texel is taken.
    """
    height, width = pixels.shape[:2]
    columns, rows = (_wrapped(*x) for x in zip(cell.T, (width, height), wraps))
    return pixels[height - 1 - rows, columns].astype(float)


def _wrapped(i: np.ndarray, size: int, wrap: str) -> np.ndarray:
    """Column or row in the image for one that may lie outside it. wrap: how the image continues, as in ImageTexture."""
    if wrap == "repeat":
        return i % size
    if wrap == "mirror":
        return np.minimum(i % (2 * size), 2 * size - 1 - i % (2 * size))
    return np.clip(i, 0, size - 1)
