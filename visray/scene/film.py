"""The film of a scene: the size of the picture, the part of it that is rendered, and the filter of its pixels."""

from dataclasses import dataclass, field, replace
from math import floor
from typing import Annotated

from pydantic import ConfigDict, Field

from visray.filters import SQUARE, Filter
from visray.quantities import Count, Real
from visray.records import record_kind

LARGEST_SCALE = 1000
_Edge = Annotated[int, Field(strict=True)]


@record_kind
@dataclass(frozen=True, kw_only=True)
class Film:
    """Size of the picture in pixels. If the film is `transparent`, the background is left out, and layer A contains the
    coverage (alpha) of each pixel: the share of it that shows objects.

    filter: how light near a pixel's centre counts in the pixel.
    region: the part of the picture that is rendered, as left, top, right and bottom edge in pixels of the whole
        picture; null: all of it. Its pixels are those of the whole picture.
    scale: multiplies width and height; the results are rounded, and at least 1.
    """

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")
    width: Count = field(default=640, kw_only=False)
    height: Count = field(default=480, kw_only=False)
    transparent: Annotated[bool, Field(strict=True)] = False
    filter: Filter = SQUARE
    region: tuple[_Edge, _Edge, _Edge, _Edge] | None = None
    scale: Annotated[Real, Field(gt=0, le=LARGEST_SCALE)] = 1.0

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the whole picture in pixels."""
        if self.scale == 1:
            return self.width, self.height
        return max(1, floor(self.width * self.scale + 0.5)), max(1, floor(self.height * self.scale + 0.5))

    @property
    def corner(self) -> tuple[int, int]:
        """Column and row of the first pixel that is rendered, in the whole picture."""
        return (0, 0) if self.region is None else self.region[:2]

    @property
    def raster(self) -> tuple[int, int]:
        """Width and height in pixels of what is rendered."""
        if self.region is None:
            return self.size
        left, top, right, bottom = self.region
        return right - left, bottom - top

    def resized(self, size: tuple[int, int]) -> "Film":
        """The film of the whole picture in another size."""
        return replace(self, width=size[0], height=size[1], region=None, scale=1.0)


def film_flaw(film: Film) -> tuple[str, object, str] | None:
    """What is wrong with the region of a film: an address, its value, and a text; None if nothing is."""
    if film.region is None:
        return None
    (left, top, right, bottom), (width, height) = film.region, film.size
    whole = f"the picture has {width} x {height} pixels"
    if left >= right or top >= bottom:
        swapped = [min(left, right), min(top, bottom), max(left, right), max(top, bottom)]
        inside = 0 <= swapped[0] < swapped[2] <= width and 0 <= swapped[1] < swapped[3] <= height
        advice = f"write {swapped}" if inside else f"right is beyond left, and bottom below top; {whole}"
        return "film.region", film.region, f"must be left, top, right, bottom, of at least one pixel; {advice}"
    if left < 0 or top < 0 or right > width or bottom > height:
        inside = [max(left, 0), max(top, 0), min(right, width), min(bottom, height)]
        some = inside[0] < inside[2] and inside[1] < inside[3]
        advice = f"inside of it is {inside}" if some else f"give a region in [0, 0, {width}, {height}]"
        return "film.region", film.region, f"reaches beyond the picture: {whole}; {advice}"
    return None
