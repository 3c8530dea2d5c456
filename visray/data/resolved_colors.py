"""Colour rules whose domain, bands and palette are known: they give each value its colour."""

from dataclasses import dataclass

import numpy as np

from visray.data.norm import Norm
from visray.data.palette import Palette
from visray.output.curves import curve, linear


@dataclass(frozen=True, eq=False)
class Colours:
    """Colours of values.

    linear: linear Rec. 709. Shape: (N, 3)
    slope: derivative of `linear` by the value. The domain is held fixed, even if it is that of the data. It is 0 for
        missing values, beyond the domain, in bands and in tables, and infinite where that of the norm is. Shape: (N, 3)
    under, over, missing: numbers of values below the domain, above it, and missing (NaN).
    """

    linear: np.ndarray
    slope: np.ndarray
    under: int
    over: int
    missing: int


@dataclass(frozen=True, eq=False)
class ResolvedColors:
    """A colour rule with all that it leaves to the data.

    norm: the norm with its domain.
    palette: the palette.
    bands: edges of the bands, ascending; None if colours change continuously. Shape: (B + 1)
    under, over, missing: colours of values below the domain, above it, and missing. sRGB. Shape: (3) each.
    """

    norm: Norm
    palette: Palette
    bands: np.ndarray | None
    under: np.ndarray
    over: np.ndarray
    missing: np.ndarray

    @property
    def lo(self) -> float:
        """Least value of the domain."""
        return self.norm.lo

    @property
    def hi(self) -> float:
        """Largest value of the domain. If the data are constant, or if there are none, it is `lo` (norm.constant)."""
        return self.norm.hi

    def share(self, values: np.ndarray) -> np.ndarray:
        """Place of values in the domain, from 0 to 1, as the norm says; bands change nothing here. Shape: (N)."""
        return self.norm.share(values)

    def value(self, t: np.ndarray) -> np.ndarray:
        """The value at a place in the domain: the inverse of `share`. Shape: (N)."""
        return self.norm.value(t)

    def position(self, values: np.ndarray) -> np.ndarray:
        """t at which the palette is read for values: that of the value's band, or `share` without bands.

        Of B bands the first has t = 0 and the last t = 1. A qualitative palette gives its first B colours. A value on
        an edge is in the upper band, and the last edge in the last band. Shape: (N).
        """
        if self.bands is None:
            return self.share(values)
        v, count = np.asarray(values, float), len(self.bands) - 1
        band = np.clip(np.searchsorted(self.bands, v, "right") - 1, 0, count - 1)
        if self.palette.steps:
            t = (band + 0.5) / self.palette.steps
        else:
            t = band / (count - 1) if count > 1 else np.full(v.shape, 0.5)
        return np.where(np.isnan(v), np.nan, t)

    def srgb(self, values: np.ndarray) -> np.ndarray:
        """Colours of values as on a screen, from 0 to 1. Shapes: values (N), result (N, 3)."""
        return curve(self.colours(values).linear, "srgb")

    def colours(self, values: np.ndarray) -> Colours:
        """Colours of values and their derivatives. Shape: values (N)."""
        v = np.asarray(values, float)
        t = self.position(v)
        light = self.palette.linear(t)
        slope = np.zeros_like(light)
        if self.bands is None:
            steep, by_t = self.norm.slope(v)[:, None], self.palette.slope(t)
            # An infinite slope of the norm changes nothing where the palette is constant.
            slope = np.multiply(steep, by_t, out=slope, where=(by_t != 0) & ~np.isnan(v)[:, None])
        places = {"under": v < self.lo, "over": v > self.hi, "missing": np.isnan(v)}
        for name, place in places.items():
            light[place] = linear(getattr(self, name))
        return Colours(light, slope, *(int(place.sum()) for place in places.values()))
