"""The film: the samples of a picture's pixels while it is rendered. An Image (output/image.py) is the finished result.

A film keeps counts and moments of samples (moments.py), so it can always take more samples. Saving, loading and merging
films keep every bit.
"""

import json
import os
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import drjit as dr
import numpy as np

from visray import memory
from visray.errors import UserError
from visray.moments import Moments
from visray.output.files import replacing
from visray.quantities import Arrays
from visray.scene.scene import Scene
from visray.version import __version__

# Bytes of memory per pixel at the peak, with all layers: 411 measured, for 2000 x 2000 pixels rendered and written as
# EXR.
BYTES_PER_PIXEL = 420


class PictureIdentity:
    """Everything that the bits of a film depend on, except the machine. Films of the same picture have equal
    identities.

    The number of samples is included for the stratified sampler only, because it decides the strata.

    facts: version, backend, precision, size, seed, sampler, spp, and the hash of the scene without these
    """

    def __init__(self, scene: Scene | None = None, a: Arrays | None = None, facts: dict[str, Any] | None = None):
        self._scene, self._a, self._facts = scene, a, facts

    @cached_property
    def facts(self) -> dict[str, Any]:
        """The facts by name. Computed when first read, because the hash of a large scene takes a while."""
        if self._facts is not None:
            return self._facts
        scene, s = self._scene, self._scene.settings
        # The accelerator is left out, because it changes no bit.
        settings = replace(s, seed=0, spp=1, accelerator="auto")
        hashed = replace(scene, settings=settings, film=replace(scene.film, width=1, height=1))
        return {
            "visray": __version__,
            "backend": self._a.backend,
            "precision": s.precision,
            "size": [scene.film.width, scene.film.height],
            "seed": s.seed,
            "sampler": s.sampler,
            "spp": s.spp if s.sampler == "stratified" else None,
            "scene": hashed.hash(),
        }

    def check(self, other: "PictureIdentity", name: str) -> None:
        """Raises UserError if `other` is the identity of another picture, because films of two pictures cannot be
        combined.

        name: what the message calls the film with the `other` identity
        """
        if self is other or (self._scene is not None and self._scene is other._scene and self._a == other._a):
            return
        for fact, value in self.facts.items():
            if (theirs := other.facts.get(fact)) == value:
                continue
            if fact == "scene":
                raise UserError(f"{name}: is of another scene; give a film of this one, or begin anew")
            raise UserError(f"{name}: is of {fact} {_shown(theirs)}, not {_shown(value)}; give another, or begin anew")


def _shown(value: Any) -> str:
    """The value of a fact as text for messages; a size as `width x height`."""
    return " x ".join(map(str, value)) if isinstance(value, list) else str(value)


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
            raise UserError("film: has other pixels than are to be exposed; give a film of these, or begin anew")

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

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the film to a file. If it is loaded again and given more samples, the bits are those of a film that
        was never saved."""
        arrays = {f"moments.{name}": np.array(x) for name, x in vars(self.moments).items()}
        facts = np.frombuffer(json.dumps(self.identity.facts).encode(), np.uint8)
        with replacing(path) as aside, open(aside, "wb") as file:
            np.savez(file, origin=facts, counts=self.counts, pixels=self.pixels, **arrays)

    @staticmethod
    def load(a: Arrays, path: str | os.PathLike[str], identity: PictureIdentity | None = None) -> "Film":
        """The film in a file. Raises UserError if the file is not a film, or is a film of another picture.

        identity: identity of the expected picture; None accepts any picture of this version of visray, with the backend
            and the precision of `a`
        """
        name, kinds = os.fspath(path), dict(zip(Moments.__dataclass_fields__, Moments.types(a)))
        try:
            with np.load(path, allow_pickle=False) as file:
                facts = json.loads(bytes(file["origin"]))
                counts, pixels = file["counts"], file["pixels"]
                arrays = {key: file[f"moments.{key}"] for key in kinds}
                n, (width, height) = len(pixels), map(int, facts["size"])
                shapes = {key: (n,) if kind in (a.D, a.F) else (3, n) for key, kind in kinds.items()}
                consistent = n and counts.shape == (n,) and {key: x.shape for key, x in arrays.items()} == shapes
                consistent = consistent and all(x.dtype.kind in "iu" for x in (counts, pixels))
                consistent = consistent and all(x.dtype.kind == "f" for x in arrays.values())
                for numbers, limit in ((counts, 2**32), (pixels, width * height)):
                    consistent = consistent and numbers.min() >= 0 and numbers.max() < limit
                if not consistent:
                    raise ValueError("arrays of other shapes, types or sizes")
        except OSError as error:
            raise UserError(f"{name}: cannot be read, {error.strerror or error}") from error
        # RuntimeError: raised for zip files that are encrypted, or compressed by a method unknown to Python.
        except (zipfile.BadZipFile, zlib.error, KeyError, TypeError, ValueError, EOFError, RuntimeError) as error:
            raise UserError(f"{name}: is no film of visray, or is damaged; begin anew") from error
        loaded = PictureIdentity(facts=facts)
        current = facts | {"visray": __version__, "backend": a.backend, "precision": a.precision}
        (identity or PictureIdentity(facts=current)).check(loaded, name)
        return Film(a, Moments(**{key: a.put(kinds[key], x) for key, x in arrays.items()}), counts, pixels, loaded)

    @staticmethod
    def merged(films: Sequence["Film"]) -> "Film":
        """One film with the pixels of several films, in the order of the picture's lanes. Raises UserError if two films
        share a pixel or are of different pictures."""
        if not films or any(f.identity is None for f in films):
            raise UserError("films: there is none, or one that is of no picture; give the films of a picture's tiles")
        first = films[0]
        width, height = first.identity.facts["size"]
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
