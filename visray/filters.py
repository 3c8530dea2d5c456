"""Reconstruction filters: the weight with which light at a place near a pixel's centre counts in the pixel.

A filter is the product of a function of x and the same function of y. Samples are drawn from it: the place of each
sample follows the absolute value of the filter, by its inverse distribution along each axis. All samples of a pixel
then have the weight 1. Where a filter is negative, the weight is negative, and the others are larger, so that their
mean is 1. So a pixel is the mean of its samples, with any filter.

Source: filter importance sampling, Ernst, Stamminger and Greiner 2006; pbrt-v4, section 8.8.

Units: pixels, from the pixel's centre. Shapes: those of the argument.
"""

from dataclasses import dataclass
from functools import cache
from math import gcd
from typing import Annotated, Any, ClassVar, Literal, Union

import drjit as dr
import numpy as np
from pydantic import BeforeValidator, ConfigDict, Field

from visray.filter_places import PARTS, Line, Roof, Table
from visray.hints import hint
from visray.quantities import Arrays, Real
from visray.records import record_kind

# Number of places at which a function is integrated for a table.
PLACES = 2**16

# The probability of negative weights is a multiple of 1 / STEPS, if the number of samples is one of STEPS.
STEPS = 16

SMALLEST, LARGEST = 0.1, 16.0
Radius = Annotated[Real, Field(ge=SMALLEST, le=LARGEST)]


@dataclass(frozen=True)
class Tabulated:
    """A function as a table. Shape: places (PARTS + 1).

    places: as Table.table
    positive: as in Table
    size: integral of the function's absolute value, divided by its integral
    """

    places: np.ndarray
    positive: float
    size: float

    def numbers(self, spp: int = STEPS) -> tuple[float, ...]:
        """The numbers of a Table, from `positive` to `size`, for pixels with `spp` samples. The probability of negative
        weights is a multiple of 1 / steps (sign_steps), the nearest to that with which all weights have the same size.
        So as many of a pixel's samples have a negative weight in each pixel, and the mean of the weights is 1."""
        steps = sign_steps(spp)
        more, less = self.size * self.positive, self.size * (1 - self.positive)
        over, under = more**2 + less**2, 2 * more * less
        chance = max(round(steps * under / (over + under)), 1) / steps if under else 0.0
        below = -under / chance if under else 0.0
        return self.positive, chance, (1 - chance) * less**2 / over, over / (1 - chance), below, self.size**2


def sign_steps(spp: int) -> int:
    """Number of equal parts of the turns (SampleState.turn), of which each pixel has equally many samples: the largest
    power of 2 up to STEPS that divides `spp`. STEPS if `spp` is odd; then no two parts have equally many."""
    return STEPS if spp % 2 else gcd(spp, STEPS)


@dataclass(frozen=True, kw_only=True)
class ReconstructionFilter:
    """A filter is 0 beyond `radius` pixels from the pixel's centre, along x and along y."""

    __pydantic_config__ = ConfigDict(extra="forbid")

    @property
    def reach(self) -> float:
        """How far samples lie beyond the edges of their pixel, at most."""
        return max(self.radius - 0.5, 0.0)

    def value(self, x: np.ndarray) -> np.ndarray:
        """The function of one axis, not normalised. Domain: |x| <= radius."""
        raise NotImplementedError

    def prepared(self, a: Arrays, spp: int = STEPS) -> Line | Roof | Table:
        """The inverse distribution for kernels, in the arrays of a backend. All numbers are opaque data.

        spp: samples per pixel that are planned
        """
        made = _tabulated(self)
        numbers = (dr.opaque(a.F, x) for x in made.numbers(spp))
        return Table(a.put(a.F, made.places), *numbers, self.may_be_negative)

    may_be_negative: ClassVar[bool] = False

    def uneven(self, spp: int, independent: bool) -> float:
        """Standard deviation of the mean weight of a pixel's samples; 0 if the mean is 1 in each pixel. The brightness
        of pixels has this deviation, relative to its mean.

        Error: below 15 % of the result (tests/test_filters.py).

        independent: whether signs are drawn for each sample alone
        """
        if not self.may_be_negative or not (independent or spp % 2):
            return 0.0
        _, chance, _, above, below, _ = _tabulated(self).numbers(spp)
        # The signs of the last samples are drawn from STEPS places without replacement.
        drawn = spp if independent else spp % STEPS
        variance = drawn * chance * (1 - chance) * (1 if independent else (STEPS - drawn) / (STEPS - 1))
        return (above - below) * variance**0.5 / spp

    def share(self, x: np.ndarray) -> np.ndarray:
        """Share of the samples whose place is at most x: the distribution that kernels invert.

        x: place in the pixel, from 0 to 1 if it is inside
        """
        x = np.clip(np.asarray(x, float) - 0.5, -self.radius, self.radius)
        half = np.interp(np.abs(x), _tabulated(self).places, np.linspace(0, 1, PARTS + 1))
        return 0.5 + 0.5 * np.copysign(half, x)


@record_kind
@dataclass(frozen=True, kw_only=True)
class BoxFilter(ReconstructionFilter):
    """All places within `radius` count alike. The radius 0.5 is the pixel itself."""

    type: Literal["box"] = "box"
    radius: Radius = 0.5

    def value(self, x: np.ndarray) -> np.ndarray:
        return np.ones_like(x)

    def prepared(self, a: Arrays, spp: int = STEPS) -> Line:
        # With the radius 0.5 these are 0 and 1, and the place is u, bit for bit.
        return Line(dr.opaque(a.F, 0.5 - self.radius), dr.opaque(a.F, 2 * self.radius))

    def share(self, x: np.ndarray) -> np.ndarray:
        return np.clip((np.asarray(x, float) - (0.5 - self.radius)) / (2 * self.radius), 0, 1)


@record_kind
@dataclass(frozen=True, kw_only=True)
class TentFilter(ReconstructionFilter):
    """The weight falls along a straight line, from the pixel's centre to 0 at `radius`."""

    type: Literal["tent"] = "tent"
    radius: Radius = 1.0

    def value(self, x: np.ndarray) -> np.ndarray:
        return 1 - np.abs(x) / self.radius

    def prepared(self, a: Arrays, spp: int = STEPS) -> Roof:
        return Roof(dr.opaque(a.F, self.radius))

    def share(self, x: np.ndarray) -> np.ndarray:
        x = np.clip((np.asarray(x, float) - 0.5) / self.radius, -1, 1)
        return 0.5 + 0.5 * np.copysign(1 - np.square(1 - np.abs(x)), x)


@record_kind
@dataclass(frozen=True, kw_only=True)
class GaussianFilter(ReconstructionFilter):
    """A normal distribution with the standard deviation `sigma`, cut off at `radius`."""

    type: Literal["gaussian"] = "gaussian"
    radius: Radius = 1.5
    sigma: Annotated[Real, Field(ge=0.05, le=LARGEST)] = 0.5

    def value(self, x: np.ndarray) -> np.ndarray:
        return np.exp(-0.5 * np.square(x / self.sigma))


@record_kind
@dataclass(frozen=True, kw_only=True)
class MitchellFilter(ReconstructionFilter):
    """Two cubic polynomials on each side of the centre. The outer one is negative: edges look sharper, and have a faint
    seam beside them.

    `b` blurs, and `c` sharpens. Source: Mitchell and Netravali 1988.
    """

    type: Literal["mitchell"] = "mitchell"
    radius: Radius = 2.0
    b: Annotated[Real, Field(ge=0, le=1)] = 1 / 3
    c: Annotated[Real, Field(ge=0, le=1)] = 1 / 3

    may_be_negative: ClassVar[bool] = True

    def value(self, x: np.ndarray) -> np.ndarray:
        x, b, c = np.abs(x) * (2 / self.radius), self.b, self.c
        inner = ((12 - 9 * b - 6 * c) * x + (-18 + 12 * b + 6 * c)) * x * x + (6 - 2 * b)
        outer = np.square(2 - x) * (2 * b + 6 * c - (b + 6 * c) * x)
        return np.where(x < 1, inner, outer) / 6


KINDS = (BoxFilter, TentFilter, GaussianFilter, MitchellFilter)
BY_TYPE = {kind.type: kind for kind in KINDS}
# The filter of pixels that are squares: samples are drawn as without a filter.
SQUARE = BoxFilter()


def _named(raw: Any) -> Any:
    """A filter that is given by its name alone, as fields; anything else as it is."""
    if not isinstance(raw, str):
        return raw
    if raw not in BY_TYPE:
        raise ValueError(f"unknown filter; {hint(raw, list(BY_TYPE))}")
    return {"type": raw}


_Kinds = Annotated[Union[KINDS], Field(discriminator="type")]
Filter = Annotated[_Kinds, BeforeValidator(_named, json_schema_input_type=Literal[tuple(BY_TYPE)] | _Kinds)]


@cache
def _tabulated(kind: ReconstructionFilter) -> Tabulated:
    """The table of a filter.

    Error: both distributions agree at PARTS places on each side, so they differ by less than 0.5 / PARTS (1.3e-4), and
        with the usual numbers of each filter by at most 5e-5 (tests/test_filters.py). A pixel at an edge between black
        and white is off by at most this, times the square of `size`.
    """
    x = np.linspace(0, kind.radius, PLACES + 1)
    step = x[1] - x[0]
    # Gauss's rule of three points for each part between two places.
    at = np.array([-np.sqrt(0.6), 0.0, np.sqrt(0.6)])
    values = kind.value((0.5 * (x[1:] + x[:-1]))[:, None] + 0.5 * step * at) @ np.array([5, 8, 5]) / 18
    total = np.abs(values).sum()
    distribution = np.concatenate([[0], np.cumsum(np.abs(values))]) / total
    places = np.interp(np.linspace(0, 1, PARTS + 1), distribution, x)
    places[-1] = kind.radius
    return Tabulated(places, float(np.maximum(values, 0).sum() / total), float(total / values.sum()))
