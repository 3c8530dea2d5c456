"""A contact sheet: pictures of known surfaces in rows, with the name of each under it."""

import os
import warnings
from dataclasses import dataclass
from math import ceil, sqrt
from typing import Any

import numpy as np

from visray.errors import UserError
from visray.output import png
from visray.polynomials.catalogue import SURFACES
from visray.progress import Bar, Interrupts
from visray.renderer import render
from visray.surface_picture.captions import captioned
from visray.surface_picture.known_report import degree
from visray.surface_picture.scene import SurfaceWarning, surface_scene
from visray.version import __version__

# Width and height of a picture in pixels, and its samples per pixel.
SIZE, SPP = (240, 240), 64
# A sheet is about this many times as wide as it is high.
ASPECT = 1.25
# Height of a caption and width of the gaps between pictures, as shares of the width of a picture, and their least
# values in pixels.
CAPTION, LEAST_CAPTION = 0.2, 24
GAP, LEAST_GAP = 0.035, 2
# Greatest width and height of a sheet in pixels.
LARGEST = 30_000


@dataclass(frozen=True, eq=False)
class ContactSheet:
    """A contact sheet.

    pixels: as they are shown, in sRGB.
    names: the surfaces that are on it.
    stopped: whether Ctrl-C ended the work before all were.
    size: width and height of each picture in pixels.
    columns: number of pictures side by side.

    Shapes: pixels uint8 (H, W, 3).
    """

    pixels: np.ndarray
    names: tuple[str, ...]
    stopped: bool
    size: tuple[int, int]
    columns: int

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the sheet to a PNG file."""
        facts = {"software": f"visray {__version__}", "surfaces": list(self.names)}
        png.write_png(path, png.encode(self.pixels, facts, srgb=True))

    def as_json(self) -> dict[str, Any]:
        """A report on the sheet."""
        height, width = self.pixels.shape[:2]
        return {
            "width": width,
            "height": height,
            "size": list(self.size),
            "columns": self.columns,
            "surfaces": list(self.names),
            "stopped": self.stopped,
        }


def contact_sheet(
    names: tuple[str, ...],
    size: tuple[int, int] = SIZE,
    columns: int | None = None,
    spp: int = SPP,
    progress: bool = True,
) -> ContactSheet:
    """A contact sheet of known surfaces.

    size: width and height of each picture in pixels.
    columns: number of pictures side by side; None: as many as make the sheet a little wider than high.
    spp: samples per pixel.
    progress: whether a progress bar may appear.

    Ctrl-C keeps the pictures that are finished. Raises a UserError if the sheet would be too large.
    """
    columns = _columns(len(names), size) if columns is None else columns
    if columns < 1:
        raise UserError(f"columns = {columns}: must be a whole number greater than 0")
    gap, caption = max(LEAST_GAP, round(GAP * size[0])), max(LEAST_CAPTION, round(CAPTION * size[0]))
    columns = min(columns, len(names))
    across, down = columns, ceil(len(names) / columns)
    widest = max(gap + across * (size[0] + gap), gap + down * (size[1] + caption + gap))
    if widest > LARGEST:
        raise UserError(
            f"size: the sheet would be {widest:,} pixels long; at most {LARGEST:,}; make each picture smaller"
        )
    tiles: list[np.ndarray] = []
    with Interrupts(has_results=False) as interrupts, Bar("surfaces", len(names), progress) as bar:
        for i, name in enumerate(names):
            picture = _picture(name, size, spp)
            # A picture that Ctrl-C has stopped has too few samples.
            if interrupts.requested:
                break
            title = SURFACES[name].title
            tiles.append(captioned(picture, title, f"{name}, degree {degree(SURFACES[name])}", caption))
            interrupts.has_results = True
            bar.update(i + 1)
    return ContactSheet(_assembled(tiles, columns, gap), names[: len(tiles)], len(tiles) < len(names), size, columns)


def _columns(count: int, size: tuple[int, int]) -> int:
    """The number of columns that makes a sheet of `count` pictures a little wider than high."""
    return max(1, round(sqrt(ASPECT * count * size[1] * (1 + CAPTION) / size[0])))


def _picture(name: str, size: tuple[int, int], spp: int) -> np.ndarray:
    """A picture of a known surface. Shape: uint8 (H, W, 3)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SurfaceWarning)
        scene = surface_scene(name, size=size)
    return render(scene, spp=spp, layers=("RGB",), progress=False).display()


def _assembled(tiles: list[np.ndarray], columns: int, gap: int) -> np.ndarray:
    """Pictures in rows on white, with gaps between them and around them. Shapes: uint8 (h, w, 3), (H, W, 3)."""
    if not tiles:
        return np.full((0, 0, 3), 255, np.uint8)
    height, width = tiles[0].shape[:2]
    across, down = min(columns, len(tiles)), ceil(len(tiles) / columns)
    sheet = np.full((gap + down * (height + gap), gap + across * (width + gap), 3), 255, np.uint8)
    for i, tile in enumerate(tiles):
        row, column = divmod(i, columns)
        y, x = gap + row * (height + gap), gap + column * (width + gap)
        sheet[y : y + height, x : x + width] = tile
    return sheet
