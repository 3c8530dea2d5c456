"""Where samples fall: one seed, decorrelated from pixel to pixel, stratified within a pixel.

Everything that changes from render to render (seed, sample count, first sample of a pass) is opaque data.
"""

from dataclasses import dataclass
from math import gcd, isqrt
from typing import Any

import drjit as dr
import numpy as np

from visray.quantities import Arrays

_ODD = 0x9E3779B9  # 2^32 over the golden ratio: steps through all 32-bit numbers without a short cycle


def hash32(x: Any) -> Any:
    """A well mixed 32-bit hash. Source: Wellons' hash-prospector, the function of least bias with two
    multiplications."""
    x = x ^ (x >> 16)
    x = x * 0x21F0AAAD
    x = x ^ (x >> 15)
    x = x * 0xD35A2D97
    return x ^ (x >> 15)


@dataclass(frozen=True)
class SamplePlan:
    """The samples of one pass, as opaque numbers of one entry, or of one for each lane.

    seed; first and count: which samples this pass takes; strata: the pixel's k x k strata; side: k; step and start: the
    order in which a pixel visits them, start + i step modulo strata for sample first + i. Where a sample falls depends
    on its index, not on the pass that takes it.
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
        """first, count: of all lanes, or of each. Shapes: () or (N)."""
        side = isqrt(spp)
        strata = side * side
        # A step that has no divisor in common with strata visits each once: the one nearest to strata over the golden
        # ratio.
        step = (
            next(s for s in range(max(1, round(strata * 0.618)), 2 * strata + 2) if gcd(s, strata) == 1) % strata or 1
        )

        def number(x: int | np.ndarray) -> Any:
            return a.put(a.U, x.astype(np.uint32)) if isinstance(x, np.ndarray) else dr.opaque(a.U, x)

        start = first * step % strata
        return SamplePlan(*map(number, (seed, first, count, strata)), dr.opaque(a.F, side), number(step), number(start))

    @staticmethod
    def per_lane(a: Arrays, seeds: Any, first: Any, count: Any) -> "SamplePlan":
        """Samples that differ from lane to lane in seed, first and count, for samplers without strata."""
        one, none = dr.opaque(a.U, 1), dr.opaque(a.U, 0)
        return SamplePlan(seeds, first, count, one, dr.opaque(a.F, 1), none, none)


def pixel_key(plan: SamplePlan, x: Any, y: Any) -> Any:
    """A 32-bit number for each pixel and seed."""
    return hash32(x + hash32(y + hash32(plan.seed)))


def first_stratum(plan: SamplePlan, key: Any, real: Any) -> Any:
    """The stratum that the first sample of a pass falls in, from 0 to strata - 1."""
    u = real(key >> 8) * 2.0**-24
    stratum = type(key)(u * real(plan.strata)) + plan.start
    return dr.select(stratum >= plan.strata, stratum - plan.strata, stratum)


def next_stratum(plan: SamplePlan, stratum: Any) -> Any:
    stratum = stratum + plan.step
    return dr.select(stratum >= plan.strata, stratum - plan.strata, stratum)


def jittered(stratum: Any, spare: Any, side: Any, h: Any, real: Any) -> tuple[Any, Any]:
    """A point of the unit square: jittered by the hash h in a stratum of side x side, or anywhere for `spare` ones.

    Domain: side^2 < 2^22, so that the row of a stratum comes out right in single precision.
    """
    jx, jy = real(h >> 16) * 2.0**-16 + 2.0**-17, real(h & 0xFFFF) * 2.0**-16 + 2.0**-17
    width = dr.rcp(side)
    row = dr.floor((real(stratum) + 0.5) * width)
    column = real(stratum) - row * side
    return dr.select(spare, jx, (column + jx) * width), dr.select(spare, jy, (row + jy) * width)


def scrambled(x: Any, seed: Any) -> Any:
    """Owen's scrambling of a number whose bits are in reverse order: each bit is flipped by a hash of those below it.

    Source: Laine and Karras 2011; Burley 2020; the constants are Vegdahl's. The factor is a hash, where theirs is part
    of the seed: the points of small indices were not uniform over seeds (tests/test_sampling.py).
    """
    x = x ^ (x * 0x3D20ADEA)
    x = (x + seed) * (hash32(seed) | 1)
    x = x ^ (x * 0x05526C56)
    return x ^ (x * 0x53A22864)


def pascal(x: Any) -> Any:
    """Sobol's second dimension of the index x, its bits in reverse order: Pascal's triangle modulo 2 as a matrix, which
    is a Kronecker product of five equal ones."""
    for shift, mask in ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF), (16, 0x0000FFFF)):
        x = x ^ ((x >> shift) & mask)
    return x


def sobol(index: Any, seed: Any, shuffled: bool, real: Any) -> tuple[Any, Any]:
    """A point of an Owen-scrambled (0, 2)-sequence: any 2^k of them from a multiple of 2^k on are stratified in every
    way.

    shuffled: in an order of its own, so that sequences of different seeds can be paired.
    """
    if shuffled:
        index = dr.brev(scrambled(dr.brev(index), seed ^ 0xA511E9B3))
    x = dr.brev(scrambled(index, seed))
    y = dr.brev(scrambled(pascal(index), hash32(seed)))
    return real(x >> 8) * 2.0**-24, real(y >> 8) * 2.0**-24


@dataclass(frozen=True)
class SampleSet:
    """So many points that are taken together: light samples, rays of one point. Opaque, of one entry each."""

    count: Any
    strata: Any
    side: Any

    @staticmethod
    def of(a: Arrays, n: int) -> "SampleSet":
        side = max(isqrt(n), 1)
        return SampleSet(dr.opaque(a.U, n), dr.opaque(a.U, side * side), dr.opaque(a.F, side))

    @staticmethod
    def table(a: Arrays, counts: list[int]) -> "SampleSet":
        """Sets of several sizes, an entry each."""
        n = np.array(counts)
        side = np.array([max(isqrt(x), 1) for x in counts])
        whole = (a.put(a.U, v.astype(np.uint32)) for v in (n, side * side))
        return SampleSet(*whole, a.put(a.F, side.astype(float)))


@dataclass(frozen=True)
class SampleState:
    """The random numbers of one sample of each pixel.

    key: of the pixel, and of the path; index: which sample of the pixel it is; stratum: the stratum it falls in.
    """

    sampler: str
    real: Any
    plan: SamplePlan
    key: Any
    index: Any
    stratum: Any

    def pixel(self) -> tuple[Any, Any]:
        """Where in the pixel the sample falls."""
        if self.sampler == "sobol":
            return sobol(self.index, self.key, False, self.real)
        h = hash32(self.key + (self.index + 1) * _ODD)
        if self.sampler == "independent":
            return jittered(self.stratum, True, self.plan.side, h, self.real)
        return jittered(self.stratum, self.index >= self.plan.strata, self.plan.side, h, self.real)

    def derived(self, salt: Any) -> "SampleState":
        """The random numbers of a path's further level: as many dimensions again, each unlike all others."""
        return SampleState(self.sampler, self.real, self.plan, hash32(self.key + salt * _ODD), self.index, self.stratum)

    def dimension(self, number: int) -> "Dimension":
        """The pairs of numbers for one purpose. Distinct numbers give independent ones."""
        return Dimension(self, hash32(self.key ^ ((number * 0x632BE5AB) & 0xFFFFFFFF)))


@dataclass(frozen=True)
class Dimension:
    """Pairs of numbers from the unit square for one purpose, of one sample of each pixel."""

    state: SampleState
    key: Any

    def point(self) -> tuple[Any, Any]:
        """One pair, unrelated to all others."""
        d = self.state
        if d.sampler == "sobol":
            return sobol(d.index, self.key, True, d.real)
        return jittered(d.stratum, True, d.plan.side, hash32(self.key + (d.index + 1) * _ODD), d.real)

    def set_number(self, j: Any, points: SampleSet) -> Any:
        """A number for pair j of a set that goes with no stratum."""
        d = self.state
        h = hash32(self.key + (d.index * points.count + j + 1) * _ODD)
        return d.real(h >> 8) * 2.0**-24

    def set_point(self, j: Any, points: SampleSet) -> tuple[Any, Any]:
        """Pair number j of a set that is taken together."""
        d = self.state
        whole = d.index * points.count + j
        if d.sampler == "sobol":
            return sobol(whole, self.key, True, d.real)
        h = hash32(self.key + (whole + 1) * _ODD)
        spare = True if d.sampler == "independent" else j >= points.strata
        return jittered(j, spare, points.side, h, d.real)
