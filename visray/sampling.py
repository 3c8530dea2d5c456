"""Random numbers of samples: seeded, decorrelated between pixels, stratified within a pixel.

Each purpose, such as the position in the pixel or on the lens, has its own random dimension: one pair of numbers in the
unit square for each sample. Strata are equal squares that divide the unit square.

Everything that changes between renders (seed, sample count, first sample of a pass) is opaque data: the code does not
contain it, so a new value compiles no new kernel.
"""

from dataclasses import dataclass
from math import gcd, isqrt
from typing import Any

import drjit as dr
import numpy as np

from visray.quantities import Arrays

# 2^32 divided by the golden ratio (1.618...), an odd number: its multiples modulo 2^32 run through all 32-bit numbers.
_ODD = 0x9E3779B9


def hash32(x: Any) -> Any:
    """A well-mixed 32-bit hash. Source: Wellons' hash-prospector, which found it as the least biased one with two
    multiplications."""
    x = x ^ (x >> 16)
    x = x * 0x21F0AAAD
    x = x ^ (x >> 15)
    x = x * 0xD35A2D97
    return x ^ (x >> 15)


@dataclass(frozen=True)
class SamplePlan:
    """The samples that one pass takes, as opaque numbers: one for all lanes, or one for each lane (one lane is one
    pixel).

    Sample first + i of a pixel falls in stratum (start + i step) modulo strata, counted from a first stratum that
    differs from pixel to pixel. So the stratum of a sample depends only on its index, and not on the pass that takes
    it.

    seed: seed of the render
    first: index of the first sample
    count: number of samples
    strata: number of strata of a pixel, side * side
    side: number of strata along each side of the pixel
    step: difference between the stratum numbers of two successive samples, modulo strata
    start: first * step modulo strata
    """

    seed: Any
    first: Any
    count: Any
    strata: Any
    side: Any
    step: Any
    start: Any

    @staticmethod
    def of(a: Arrays, seed: int, spp: int, first: int | np.ndarray, count: int | np.ndarray) -> "SamplePlan":
        """The plan of samples `first` to `first + count - 1` of a render with `spp` samples per pixel.

        first, count: one number for all lanes, or one for each lane. Shapes: () or (N).
        """
        side = isqrt(spp)
        strata = side * side
        # A step without a common divisor with `strata` visits each stratum once. This is the first such step from
        # strata / 1.618 (the golden ratio) upwards.
        step = (
            next(s for s in range(max(1, round(strata * 0.618)), 2 * strata + 2) if gcd(s, strata) == 1) % strata or 1
        )

        def opaque(x: int | np.ndarray) -> Any:
            return a.put(a.U, x.astype(np.uint32)) if isinstance(x, np.ndarray) else dr.opaque(a.U, x)

        start = first * step % strata
        return SamplePlan(*map(opaque, (seed, first, count, strata)), dr.opaque(a.F, side), opaque(step), opaque(start))

    @staticmethod
    def per_lane(a: Arrays, seeds: Any, first: Any, count: Any) -> "SamplePlan":
        """A plan whose seed, first and count differ between lanes. Domain: samplers without strata."""
        one, zero = dr.opaque(a.U, 1), dr.opaque(a.U, 0)
        return SamplePlan(seeds, first, count, one, dr.opaque(a.F, 1), zero, zero)


def pixel_key(plan: SamplePlan, x: Any, y: Any) -> Any:
    """A 32-bit hash of the pixel (x, y) and the seed."""
    return hash32(x + hash32(y + hash32(plan.seed)))


def first_stratum(plan: SamplePlan, key: Any, real: Any) -> Any:
    """Number of the stratum of a pass's first sample, from 0 to strata - 1.

    key: hash of the pixel
    real: floating-point type for the computation
    """
    u = real(key >> 8) * 2.0**-24
    stratum = type(key)(u * real(plan.strata)) + plan.start
    return dr.select(stratum >= plan.strata, stratum - plan.strata, stratum)


def next_stratum(plan: SamplePlan, stratum: Any) -> Any:
    """Number of the stratum of the next sample. stratum: that of the current sample."""
    stratum = stratum + plan.step
    return dr.select(stratum >= plan.strata, stratum - plan.strata, stratum)


def jittered(stratum: Any, unstratified: Any, side: Any, h: Any, real: Any) -> tuple[Any, Any]:
    """A random point in a stratum of the unit square; in lanes where `unstratified` is true, in the whole square.

    stratum: number of the stratum, from 0 to side * side - 1
    side: number of strata along each side of the square
    h: hash of the sample
    real: floating-point type of the result
    Domain: side^2 < 2^22, so that the row of a stratum is exact in single precision.
    """
    jx, jy = real(h >> 16) * 2.0**-16 + 2.0**-17, real(h & 0xFFFF) * 2.0**-16 + 2.0**-17
    width = dr.rcp(side)
    row = dr.floor((real(stratum) + 0.5) * width)
    column = real(stratum) - row * side
    return dr.select(unstratified, jx, (column + jx) * width), dr.select(unstratified, jy, (row + jy) * width)


def scrambled(x: Any, seed: Any) -> Any:
    """Owen scrambling of a number whose bits are in reverse order. Each bit is flipped or not, as a hash of the bits
    below it says.

    Source: Laine and Karras 2011; Burley 2020; the constants are Vegdahl's. Here the multiplier in the second line is a
        hash of the seed. In the sources it is a part of the seed itself; then points of small indices are not uniform
        over seeds (tests/test_sampling.py).
    """
    x = x ^ (x * 0x3D20ADEA)
    x = (x + seed) * (hash32(seed) | 1)
    x = x ^ (x * 0x05526C56)
    return x ^ (x * 0x53A22864)


def pascal(x: Any) -> Any:
    """The second coordinate of point x of the Sobol sequence, as 32 bits in reverse order.

    The bits of x are multiplied by Pascal's triangle modulo 2. This matrix is the Kronecker product of five equal
    matrices of size 2, and each step of the loop applies one of them.
    """
    for shift, mask in ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF), (16, 0x0000FFFF)):
        x = x ^ ((x >> shift) & mask)
    return x


def sobol(index: Any, seed: Any, shuffled: bool, real: Any) -> tuple[Any, Any]:
    """A point of an Owen-scrambled (0, 2)-sequence, as a pair of numbers from 0 to 1.

    Take 2^k successive points whose first index is a multiple of 2^k, and divide the unit square into 2^k equal
    rectangles with sides 2^-i and 2^(i-k): each rectangle contains exactly one of these points.

    shuffled: whether the points are visited in an order that depends on the seed, so that points of different seeds can
        be combined
    real: floating-point type of the numbers
    """
    if shuffled:
        index = dr.brev(scrambled(dr.brev(index), seed ^ 0xA511E9B3))
    x = dr.brev(scrambled(index, seed))
    y = dr.brev(scrambled(pascal(index), hash32(seed)))
    return real(x >> 8) * 2.0**-24, real(y >> 8) * 2.0**-24


@dataclass(frozen=True)
class SampleSet:
    """Points that are stratified together, such as the samples of an area light, or the rays from one surface point.
    Fields are opaque, with one entry, or with one for each of several sets.

    count: number of points
    strata: number of strata, side * side
    side: number of strata along each side of the unit square
    """

    count: Any
    strata: Any
    side: Any

    @staticmethod
    def of(a: Arrays, n: int) -> "SampleSet":
        """The set of n points."""
        side = max(isqrt(n), 1)
        return SampleSet(dr.opaque(a.U, n), dr.opaque(a.U, side * side), dr.opaque(a.F, side))

    @staticmethod
    def table(a: Arrays, counts: list[int]) -> "SampleSet":
        """Several sets in one SampleSet, whose fields have one entry per set. counts: number of points of each set."""
        count = np.array(counts)
        side = np.array([max(isqrt(x), 1) for x in counts])
        integers = (a.put(a.U, v.astype(np.uint32)) for v in (count, side * side))
        return SampleSet(*integers, a.put(a.F, side.astype(float)))


@dataclass(frozen=True)
class SampleState:
    """The random numbers of one sample of each pixel.

    sampler: name of the sampler
    real: floating-point type of the numbers
    plan: samples of the pass
    key: hash of the pixel, the seed, and the salts of `derived`
    index: index of the sample within its pixel
    stratum: number of the stratum that the sample falls in
    """

    sampler: str
    real: Any
    plan: SamplePlan
    key: Any
    index: Any
    stratum: Any

    def pixel(self) -> tuple[Any, Any]:
        """Position of the sample within its pixel, in the unit square."""
        if self.sampler == "sobol":
            return sobol(self.index, self.key, False, self.real)
        h = hash32(self.key + (self.index + 1) * _ODD)
        if self.sampler == "independent":
            return jittered(self.stratum, True, self.plan.side, h, self.real)
        return jittered(self.stratum, self.index >= self.plan.strata, self.plan.side, h, self.real)

    def turn(self) -> Any:
        """A number from 0 to 1 that is independent of `pixel`. Of 2^k successive samples whose first index is a
        multiple of 2^k, each has its own of 2^k equal intervals, unless the sampler is independent."""
        key = hash32(self.key ^ 0x3C6EF372)
        if self.sampler == "independent":
            return self.real(hash32(key + (self.index + 1) * _ODD) >> 8) * 2.0**-24
        return sobol(self.index, key, True, self.real)[0]

    def derived(self, salt: Any) -> "SampleState":
        """Further random numbers of the sample: all dimensions again, independent of those with another salt.

        salt: number of a path vertex, or of a light that the kernel loops over
        """
        return SampleState(self.sampler, self.real, self.plan, hash32(self.key + salt * _ODD), self.index, self.stratum)

    def dimension(self, number: int) -> "Dimension":
        """The random dimension with this number. Different numbers give independent pairs."""
        return Dimension(self, hash32(self.key ^ ((number * 0x632BE5AB) & 0xFFFFFFFF)))


@dataclass(frozen=True)
class Dimension:
    """A random dimension: pairs of random numbers in the unit square for one purpose, for one sample of each pixel.

    state: the sample
    key: hash of the key of the sample and the number of the dimension
    """

    state: SampleState
    key: Any

    def point(self) -> tuple[Any, Any]:
        """The pair of the sample. Pairs of different dimensions are independent."""
        state = self.state
        if state.sampler == "sobol":
            return sobol(state.index, self.key, True, state.real)
        return jittered(state.stratum, True, state.plan.side, hash32(self.key + (state.index + 1) * _ODD), state.real)

    def set_number(self, j: Any, points: SampleSet) -> Any:
        """A third random number for pair j of a set, without strata."""
        state = self.state
        h = hash32(self.key + (state.index * points.count + j + 1) * _ODD)
        return state.real(h >> 8) * 2.0**-24

    def set_point(self, j: Any, points: SampleSet) -> tuple[Any, Any]:
        """Pair j of a set. The pairs of a set are stratified together."""
        state = self.state
        index = state.index * points.count + j
        if state.sampler == "sobol":
            return sobol(index, self.key, True, state.real)
        h = hash32(self.key + (index + 1) * _ODD)
        unstratified = True if state.sampler == "independent" else j >= points.strata
        return jittered(j, unstratified, points.side, h, state.real)
