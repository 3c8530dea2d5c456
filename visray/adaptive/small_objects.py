"""Small objects of a picture, and the cells of pixels that show them: parts of pixels that get samples of their own.

An object is small if it covers so little of the film that the first samples of a picture may miss it. It is known from
the scene where such objects are on the film. A pixel that shows any is cut into cells: a rectangle around them, and the
rest of the pixel in at most four rectangles. Each cell gets its own samples, and the pixel is the sum of the means of
its cells, weighted by their areas. That is stratified sampling with known strata, and it has no bias.

Cells cost no more than MOST_SAMPLES allows. Objects for which this is too little are `missed`.
"""

from dataclasses import dataclass

import numpy as np

from visray.adaptive.footprint import Blocks, FilmMap, blocks, row_objects, triangles
from visray.batches import Batch
from visray.filters import ReconstructionFilter
from visray.scene.film import Film
from visray.setup import Prepared

# An object that covers less than this many pixels is small: the first eight samples of each pixel hit it less than 16
# times. If so many rows of one material cover this area together, they are seen as a texture is.
SMALL, MANY = 2.0, 64
# Samples that should hit each small object.
HITS = 64
# Most samples for the first look at small objects: so many, and so many for each pixel of the picture.
MOST_SAMPLES, MOST_PER_PIXEL = 2**16, 8
# If the rectangle around small objects is larger than this share of a pixel, the pixel is one cell.
LARGEST = 0.5
# Largest number of rows, of pieces of one row, and of pixels of all pieces, that are looked at.
MOST_ROWS, MOST_PIECES, MOST_TOUCHED = 2**16, 64, 2**20
# Rows of a mesh whose area is estimated first: most meshes cover more than SMALL with these.
PROBED = 2**12


@dataclass(frozen=True)
class Cells:
    """Cells of the pixels that show small objects. Shapes: P pixels, C cells.

    pixels: number (row * width + column) of each pixel, as in Prepared.order. Shape: (P).
    pixel: number, from 0 to P - 1, of each cell's pixel. Shape: (C).
    windows: left, top, width and height of each cell in the unit square of the numbers that places in the pixel are
        computed from; without a filter these are the places themselves. Shape: (C, 4).
    samples: number of samples that each cell should have at least. Shape: (C).
    objects: number in the scene of the smallest object of each pixel. Shape: (P).
    missed: numbers of the small objects that would need too many samples.
    """

    pixels: np.ndarray
    pixel: np.ndarray
    windows: np.ndarray
    samples: np.ndarray
    objects: np.ndarray
    missed: np.ndarray

    @property
    def areas(self) -> np.ndarray:
        """Areas of the cells, as shares of a pixel. Shape: (C)."""
        return self.windows[:, 2] * self.windows[:, 3]


def small_objects(prepared: Prepared) -> Cells:
    """The cells of the pixels that show small objects, and the small objects that need too many samples."""
    film = prepared.scene.film
    to_film = FilmMap(prepared.kernel, film)
    hidden = prepared.scene.hidden
    found = [x for batch in prepared.kernel.batches if batch.kind.bounded for x in _small_rows(batch, to_film, hidden)]
    if not found:
        none = np.zeros(0, np.int64)
        return Cells(none, none, np.zeros((0, 4)), none, none, none)
    found = _without_textures(prepared, found)
    objects, areas = (np.concatenate([x[i] for x in found]) for i in (1, 2))
    pieces = [x[0].cut(np.clip(np.ceil(2 * to_film.lengths(x[0])), 1, MOST_PIECES).astype(int)) for x in found]
    first = np.cumsum([0, *(len(x[1]) for x in found[:-1])])
    rows = np.concatenate([row + k for (_, row), k in zip(pieces, first)])
    rectangles = np.concatenate([to_film.rectangles(piece) for piece, _ in pieces])
    return _cells(rectangles, objects[rows], areas[rows], film, to_film.filter)


def _small_rows(batch: Batch, to_film: FilmMap, hidden: np.ndarray) -> list[tuple[Blocks, np.ndarray, np.ndarray]]:
    """The rows of the small objects of a batch, as a list with at most one tuple: their boxes, the number of each row's
    object, and the area of this object in pixels. hidden: numbers of objects that are not to be seen."""
    objects = np.broadcast_to(row_objects(batch), len(batch))
    if batch.kind.triangular and len(batch) > PROBED:
        probed = np.unique(np.linspace(0, len(batch) - 1, PROBED).astype(int))
        boxes = triangles(batch, probed)
        front = np.flatnonzero(to_film.in_front(boxes))
        areas = np.bincount(objects[probed][front], to_film.areas(boxes[front]), objects.max() + 1)
        kept = np.flatnonzero(areas[objects] < SMALL)
        if not len(kept):
            return []
        boxes, objects = triangles(batch, kept), objects[kept]
    else:
        boxes = blocks(batch)
    front = np.flatnonzero(to_film.in_front(boxes))
    boxes, objects = boxes[front], objects[front]
    if not len(front):
        return []
    areas = np.bincount(objects, to_film.areas(boxes))[objects]
    small = np.flatnonzero((areas < SMALL) & _on_film(to_film.rectangles(boxes), to_film))
    small = small[~np.isin(objects[small], hidden)]
    boxes, objects, areas = boxes[small], objects[small], areas[small]
    return [(boxes, objects, areas)] if len(small) else []


def _without_textures(prepared: Prepared, found: list) -> list:
    """The rows of small objects, without those that are so many of one material that they are seen as a texture is, and
    at most MOST_ROWS of a batch; those of the largest objects are left out.

    found: as `_small_rows` returns them, of several batches.
    """
    objects, index = np.unique(np.concatenate([x[1] for x in found]), return_inverse=True)
    areas = np.zeros(len(objects))
    areas[index] = np.concatenate([x[2] for x in found])
    names = prepared.scene.materials_of_objects()
    _, material = np.unique([names[k][0] for k in objects], return_inverse=True)
    count, total = np.bincount(material), np.bincount(material, areas)
    as_texture = objects[((count >= MANY) & (total >= MANY * SMALL))[material]]
    rest = []
    for boxes, numbers, area in found:
        kept = np.flatnonzero(~np.isin(numbers, as_texture))
        kept = kept[np.argsort(area[kept], kind="stable")[:MOST_ROWS]]
        rest.append((boxes[kept], numbers[kept], area[kept]))
    return rest


def _on_film(rectangles: np.ndarray, to_film: FilmMap) -> np.ndarray:
    """Mask of the rectangles that meet the part of the film that samples lie in."""
    return ((rectangles[:, 2:] > to_film.low) & (rectangles[:, :2] < to_film.high)).all(1)


def _cells(
    rectangles: np.ndarray, objects: np.ndarray, areas: np.ndarray, film: Film, filter: ReconstructionFilter
) -> Cells:
    """The cells of pixels, from pieces of small objects.

    rectangles: left, top, right and bottom of each piece. Shape: (pieces, 4).
    objects: number of each piece's object. Shape: (pieces).
    areas: area of this object, in pixels. Shape: (pieces).
    filter: filter of the pixels. A pixel shows all objects within its radius.
    """
    corner, size, radius = np.array(film.corner), np.array(film.raster), filter.radius
    rectangles = rectangles - np.tile(corner, 2)
    low = np.clip(np.floor(rectangles[:, :2] - (radius + 0.5)) + 1, 0, size).astype(np.int64)
    high = np.clip(np.ceil(rectangles[:, 2:] + (radius - 0.5)), 0, size).astype(np.int64)
    across, down = np.maximum(high - low, 0).T
    touched = across * down
    kept = np.cumsum(touched) <= MOST_TOUCHED
    dropped, touched = np.unique(objects[~kept]), np.where(kept, touched, 0)
    piece = np.repeat(np.arange(len(touched)), touched)
    i = np.arange(len(piece)) - np.repeat(np.cumsum(touched) - touched, touched)
    x, y = low[piece, 0] + i % across[piece], low[piece, 1] + i // across[piece]
    pixels, pixel = np.unique(y * size[0] + x, return_inverse=True)
    first, last = 0.5 - radius, 0.5 + radius
    inside = np.clip(rectangles[piece] - np.stack([x, y, x, y], 1), first, last)
    on_film = np.repeat([[last, last, first, first]], len(pixels), 0)
    np.minimum.at(on_film, (pixel[:, None], [0, 1]), inside[:, :2])
    np.maximum.at(on_film, (pixel[:, None], [2, 3]), inside[:, 2:])
    unions = filter.share(on_film)
    sides = unions[:, 2:] - unions[:, :2]
    whole = (sides.prod(1) > LARGEST) | (sides <= 0).any(1)
    unions[whole], on_film[whole] = (0, 0, 1, 1), (first, first, last, last)
    smallest = np.lexsort((areas[piece], pixel))
    smallest = piece[smallest[np.unique(pixel[smallest], return_index=True)[1]]]
    wanted = HITS * (on_film[:, 2:] - on_film[:, :2]).prod(1) / np.maximum(areas[smallest], 1e-300)
    order = np.argsort(wanted, kind="stable")
    fits = np.zeros(len(pixels), bool)
    fits[order] = np.cumsum(wanted[order]) <= max(MOST_SAMPLES, MOST_PER_PIXEL * size.prod())
    missed = np.union1d(dropped, objects[smallest[~fits]])
    return _cut(pixels[fits], unions[fits], wanted[fits], objects[smallest[fits]], missed)


def _cut(pixels: np.ndarray, inner: np.ndarray, wanted: np.ndarray, objects: np.ndarray, missed: np.ndarray) -> Cells:
    """The cells of pixels: an inner rectangle, the parts of the pixel left and right of it, and those above and below.

    inner: left, top, right and bottom of the inner rectangle of each pixel. Shape: (P, 4).
    wanted: number of samples of the inner rectangle. Shape: (P).
    """
    left, top, right, bottom = inner.T
    zero, one = np.zeros_like(left), np.ones_like(left)
    parts = [(left, top, right, bottom), (zero, zero, left, one), (right, zero, one, one), (left, zero, right, top),
             (left, bottom, right, one)]  # fmt: skip
    windows = np.stack([np.stack([x0, y0, x1 - x0, y1 - y0], 1) for x0, y0, x1, y1 in parts])
    # The parts around the inner rectangle have a quarter of its samples each: as many together.
    samples = np.stack([wanted * (1.0 if k == 0 else 0.25) for k in range(len(parts))])
    pixel, k = np.nonzero((windows[:, :, 2:] > 0).all(2).T)
    return Cells(pixels, pixel, windows[k, pixel], np.ceil(samples[k, pixel]).astype(np.int64), objects, missed)
