"""The film: the samples of a picture's pixels while it is rendered. An Image (output/image.py) is the finished result.

A film keeps counts and moments of samples (moments.py), so it can always take more samples. Saving, loading and merging
films keep every bit.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import drjit as dr
import numpy as np

from visray import memory
from visray.array_file import opened_arrays, write_arrays
from visray.errors import UserError
from visray.moments import Moments
from visray.picture_identity import PictureIdentity, raster_of
from visray.quantities import Arrays

# Bytes of memory per pixel at the peak, with all layers: 411 measured, for 2000 x 2000 pixels rendered and written as
# EXR.
BYTES_PER_PIXEL = 420


@dataclass(frozen=True, eq=False)
class Film:
    """Samples of all pixels of a picture, or of some of them. A lane is one of these pixels.

    The bits depend only on the picture's identity and on the counts. They do not depend on how samples are divided into
    passes, or pixels into films.

    a: array types
    moments: moments of the samples of each lane
    counts: number of samples of each lane. Shapes: (N)
    pixels: number (row * width + column) of each lane's pixel. Shapes: (N)
    identity: identity of the picture; None for films that are neither saved nor merged
    """

    a: Arrays
    moments: Moments
    counts: np.ndarray
    pixels: np.ndarray
    identity: PictureIdentity | None = None

    @staticmethod
    def empty(a: Arrays, pixels: np.ndarray, identity: PictureIdentity | None = None) -> "Film":
        """A film without samples. pixels: number (row * width + column) of each lane's pixel."""
        return Film(a, Moments.empty(a, len(pixels)), np.zeros(len(pixels), np.int64), pixels, identity)

    def with_moments(self, moments: Moments, counts: np.ndarray | int) -> "Film":
        """A film of the same pixels with other moments.

        counts: number of samples in these moments, one for all lanes or one for each lane
        """
        counts = np.broadcast_to(np.asarray(counts, np.int64), self.counts.shape)
        return replace(self, moments=moments, counts=counts)

    def check(self, identity: PictureIdentity, pixels: np.ndarray) -> None:
        """Raises UserError if the film is of another picture than the one with this `identity`, or of other pixels than
        `pixels`."""
        identity.check(self.identity, "film")
        if not np.array_equal(self.pixels, pixels):
            raise UserError(
                "film: has other pixels than are to be exposed; give the film of these pixels, or begin anew"
            )

    @cached_property
    def closed(self) -> Moments:
        """Moments of all samples, including those of the open block (moments.py). The film itself keeps this block
        open, so that it can take more samples."""
        moments = self.moments.closed(self.a, self.a.put(self.a.U, self.counts.astype(np.uint32)))
        dr.eval(moments)
        return moments

    @property
    def mean(self) -> Any:
        """Mean colour of the samples, in double. Shapes: (3, N)."""
        return self.closed.mean

    @property
    def squares(self) -> Any:
        """Sum of squared differences of the samples from their mean, in double. Shapes: (3, N)."""
        return self.closed.squares

    @property
    def coverage(self) -> Any:
        """Number of covered samples of each lane, that is, of samples that hit an object; 0 if the film is opaque.
        Shapes: (N)."""
        return self.closed.coverage

    def arrays(self) -> dict[str, np.ndarray]:
        """All numbers of the film, as arrays by name; `of_arrays` makes a film of them."""
        moments = {f"moments.{name}": np.asarray(x) for name, x in vars(self.moments).items()}
        return {"counts": self.counts, "pixels": self.pixels} | moments

    @staticmethod
    def of_arrays(a: Arrays, arrays: Mapping[str, np.ndarray], identity: PictureIdentity) -> "Film":
        """The film with these arrays. Raises KeyError or ValueError if they are not those of a film."""
        kinds = dict(zip(Moments.__dataclass_fields__, Moments.types(a)))
        counts, pixels = arrays["counts"], arrays["pixels"]
        moments = {key: arrays[f"moments.{key}"] for key in kinds}
        n, (width, height) = len(pixels), raster_of(identity.facts)
        shapes = {key: (n,) if kind in (a.D, a.F) else (3, n) for key, kind in kinds.items()}
        consistent = n and counts.shape == (n,) and {key: x.shape for key, x in moments.items()} == shapes
        consistent = consistent and all(x.dtype.kind in "iu" for x in (counts, pixels))
        consistent = consistent and all(x.dtype.kind == "f" for x in moments.values())
        for numbers, limit in ((counts, 2**32), (pixels, width * height)):
            consistent = consistent and numbers.min() >= 0 and numbers.max() < limit
        if not consistent:
            raise ValueError("arrays of other shapes, types or sizes")
        return Film(a, Moments(**{key: a.put(kinds[key], x) for key, x in moments.items()}), counts, pixels, identity)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the film to a file. If it is loaded again and given more samples, the bits are those of a film that
        was never saved."""
        write_arrays(path, self.arrays(), self.identity.facts)

    @staticmethod
    def load(a: Arrays, path: str | os.PathLike[str], identity: PictureIdentity | None = None) -> "Film":
        """The film in a file. Raises UserError if the file is not a film, or is a film of another picture.

        identity: identity of the expected picture; None accepts any picture of this version of visray, with the backend
            and the precision of `a`
        """
        with opened_arrays(path, "is no film of visray, or is damaged; begin anew") as (arrays, facts):
            loaded = PictureIdentity(facts=facts)
            (identity or PictureIdentity.of_this_program(facts, a)).check(loaded, os.fspath(path))
            return Film.of_arrays(a, arrays, loaded)

    @staticmethod
    def merged(films: Sequence["Film"]) -> "Film":
        """One film with the pixels of several films, in the order of the picture's lanes. Raises UserError if two films
        share a pixel or are of different pictures."""
        if not films or any(f.identity is None for f in films):
            raise UserError("films: there is none, or one that is of no picture; give the films of a picture's tiles")
        first = films[0]
        width, height = raster_of(first.identity.facts)
        for i, other in enumerate(films[1:], 1):
            first.identity.check(other.identity, f"films[{i}]")
        pixels, counts = (np.concatenate([getattr(f, name) for f in films]) for name in ("pixels", "counts"))
        rank = np.empty(width * height, np.int64)
        rank[tile_order(width, height)] = np.arange(width * height)
        order = np.argsort(rank[pixels], kind="stable")
        pixels = pixels[order]
        if (duplicates := pixels[1:][pixels[1:] == pixels[:-1]]).size:
            y, x = divmod(int(duplicates[0]), width)
            raise UserError(f"films: more than one has pixel {x}, {y}; merge films that have no pixel in common")
        a, columns = first.a, zip(*(f.moments.arrays for f in films))
        moments = Moments(
            *(
                a.put(kind, np.concatenate([np.array(x) for x in column], -1)[..., order])
                for kind, column in zip(Moments.types(a), columns)
            )
        )
        return Film(a, moments, counts[order], pixels, first.identity)


def tile_order(width: int, height: int, side: int = 4) -> np.ndarray:
    """Numbers (row * width + column) of all pixels, ordered by small square tiles.

    With this order sixteen neighbouring lanes see nearly the same objects. A packet of lanes, which the processor
    computes together, then skips more objects.

    side: width and height of a tile in pixels
    """
    across, down = -(-width // side), -(-height // side)
    x = np.arange(across * side, dtype=np.int64).reshape(across, 1, side)[None]
    y = np.arange(down * side, dtype=np.int64).reshape(down, 1, side, 1)
    order = np.where((x < width) & (y < height), y * width + x, -1).ravel()
    return order[order >= 0]


def check_memory(width: int, height: int, films: int = 1) -> None:
    """Raises UserError, with an estimate, if `films` films of this size do not fit into memory."""
    needed, free = films * width * height * BYTES_PER_PIXEL, memory.free()
    if free is not None and needed > free.size:
        raise UserError(
            f"film = {width} x {height}: needs about {needed / 2**30:.1f} GiB, {free}; make it smaller with --size"
        )
