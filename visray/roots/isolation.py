"""The part of a chord in which a polynomial is zero for the first time."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import drjit as dr

from visray.roots.number_types import Univariate, roundoff

# No root is looked for within a part that is narrower than so many roundings of its distance from the middle of the
# chord (or of 2^-30): beyond, the places s are no longer told apart.
NARROWEST = 32
# A part whose coefficients differ by no more than so many times what they are off is not worth to be halved.
FLAT = 4


@dataclass(frozen=True)
class IsolatedRoot:
    """Parts [low, high] of chords in which a polynomial crosses zero exactly once, first of all; `found`: lanes that
    have one. unresolved: how many places were left without knowing: what is below zero there could be noise, or the
    part was too narrow."""

    low: Any
    high: Any
    found: Any
    unresolved: Any


@cache
def conversion(d: int) -> list[list[float]]:
    """The coefficients in Bernstein's basis on [-1, 1] of each power s^k up to degree d. Shape: (d + 1, d + 1)."""
    comb = math.comb

    def entry(i: int, k: int) -> Fraction:
        # s = 2 u - 1 with u from 0 to 1, and u^j has the coefficients C(i, j) / C(d, j).
        return sum(Fraction(comb(k, j) * 2**j * comb(i, j) * (-1) ** (k - j), comb(d, j)) for j in range(k + 1))

    return [[float(entry(i, k)) for k in range(d + 1)] for i in range(d + 1)]


def bernstein(c: tuple, middle: Any, half: Any) -> list[Any]:
    """The coefficients in Bernstein's basis on [middle - half, middle + half] of the polynomial with coefficients `c`.

    Error: some roundings of the sum of the sizes of c, as no entry of `conversion` is above 1 and the interval is in
    [-1, 1] (tests/test_roots.py). From the interval's end, as usual, it would be 3^d times as much.
    """
    d, c = len(c) - 1, list(c)
    for i in range(d):
        for j in range(d - 1, i - 1, -1):
            c[j] = dr.fma(middle, c[j + 1], c[j])
    power = half
    for k in range(1, d + 1):
        c[k] = c[k] * power
        power = power * half
    return to_bernstein(c)


def to_bernstein(c: Sequence) -> list[Any]:
    """The same on [-1, 1]."""
    d, found = len(c) - 1, [None] * len(c)
    for i in range(d // 2 + 1):
        row = conversion(d)[i]
        even, odd = c[0], row[1] * c[1]
        for k in range(2, d + 1, 2):
            even = dr.fma(row[k], c[k], even) if row[k] else even
        for k in range(3, d + 1, 2):
            odd = dr.fma(row[k], c[k], odd) if row[k] else odd
        # The other half of the rows differs in the sign of the odd powers.
        found[i], found[d - i] = even + odd, even - odd
    return found


def isolate(
    c: tuple, noise: Callable, accurate_bernstein: Callable, first: Any, last: Any, active: Any
) -> IsolatedRoot:
    """The first crossing from above zero to below on [first, last], for a polynomial that counts as positive at first.

    noise(r): how far off its values are for |s| <= r. Where its sign changes more than once, the first part of the
    interval is left behind, up to which the coefficients' hull stays above zero, and the rest halved.
    accurate_bernstein(middle, half): coefficients in Bernstein's basis on a part, and how far off they are, with more
    care: asked for where coefficients could be below zero but for the noise. Where they still could, the part is
    halved as long as they differ by more than that.
    """
    d, n = len(c) - 1, max(map(dr.width, (*c, first, last, active)))
    number, count = type(c[0]), dr.uint32_array_t(type(c[0]))

    def step(a: Any, w: Any, going: Any, found: Any, unsure: Any, unresolved: Any) -> tuple:
        half = 0.5 * w
        middle = a + half
        b, off = bernstein(c, middle, half), noise(dr.abs(middle) + half)
        least, most = _range(b)
        blurred = (least < 0) & (least >= -off)

        def again(*_: Any) -> tuple:
            b, off = accurate_bernstein(middle, half)
            return (*b, off, *_range(b))

        *b, off, least, most = dr.if_stmt((*b, off, least, most), blurred, again, lambda *same: same, label="blurred")
        changes, below = count(0), type(going)(False)
        for x in b:
            changed = dr.select(below, x > off, x < -off)
            below ^= changed
            changes += dr.select(changed, count(1), 0)
        falls = b[d] < -off
        narrow = w <= NARROWEST * roundoff(w) * dr.maximum(dr.abs(middle), 2.0**-30)
        take = ((changes == 1) | narrow) & falls
        blurred &= (changes == 0) & (least < 0) & (most - least > FLAT * off) & ~narrow
        leave = ((changes == 0) & ~blurred) | (narrow & ~falls)
        steepest = (b[1] - b[0]) * d
        for i in range(2, d + 1):
            slope = (b[i] - b[0]) * (d / i)
            steepest = dr.select(slope < steepest, slope, steepest)
        # Up to there a straight line below all coefficients stays above zero.
        clear = dr.select((b[0] > off) & ~blurred, -b[0] / steepest, 0)
        end = a + w
        nearer = dr.select(leave, end, dr.fma(clear, w, a))
        rest = end - nearer
        left = last - end
        w = dr.select(leave, dr.select(2 * w < left, 2 * w, left), dr.select(take, rest, 0.5 * rest))
        # What is left although it could be below zero is the foot of the next crossing, or has two of its own.
        clean = leave & (least >= 0)
        unresolved += dr.select((unsure & clean) | (narrow & ~take & (changes > 0)), count(1), 0)
        unsure = (unsure & ~clean & ~take) | (leave & (least < 0))
        return nearer, w, going & ~take & (w > 0), found | take, unsure, unresolved

    no = dr.full(dr.mask_t(c[0]), False, n)
    places = first + dr.zeros(number, n), last - first + dr.zeros(number, n)
    start = *places, no | active, no, no, dr.zeros(count, n)
    a, w, _, found, unsure, unresolved = dr.while_loop(start, lambda a, w, going, *_: going, step, label="march")
    return IsolatedRoot(a, a + w, found, unresolved + dr.select(unsure, count(1), 0))


def _range(b: Sequence) -> tuple[Any, Any]:
    """The least and the greatest of some numbers."""
    least = most = b[0]
    for x in b[1:]:
        least, most = dr.select(x < least, x, least), dr.select(x > most, x, most)
    return least, most


def isolate_by_formula(c: tuple, noise: Callable, first: Any, last: Any, active: Any) -> tuple[IsolatedRoot, Any]:
    """As isolate, and the crossing itself, for degrees 1 and 2: up to the extremum and beyond it there is one root."""
    zero = 0 * c[0]
    flat = zero if len(c) < 3 else c[2]
    extremum = -0.5 * c[1] / flat
    extremum = dr.select((flat > 0) & (extremum > first) & (extremum < last), extremum, last)
    # How deep it is at its extremum and at its end, and how far that may be off.
    depths = [(-Univariate(*c)(s), noise(dr.abs(s))) for s in (extremum, last)]
    down, end = (depth > off for depth, off in depths)
    blurred = ~(down | end) & ((depths[0][0] > 0) | (depths[1][0] > 0))
    # A parabola that opens downwards falls after its extremum, one that opens upwards before it.
    root = dr.sqrt(dr.maximum(c[1] * c[1] - 4 * flat * c[0], 0))
    q = -0.5 * (c[1] + dr.copysign(root, c[1]))
    one, two = dr.select(q == 0, zero, c[0] / q), dr.select(flat == 0, dr.inf, q / flat)
    low, high = dr.select(one < two, one, two), dr.select(one < two, two, one)
    s = dr.select(flat == 0, one, dr.select(flat > 0, low, high))
    found = active & (down | end)
    s = dr.select(found, dr.maximum(dr.minimum(s, last), first), 0)
    unresolved = dr.select(active & blurred, dr.uint32_array_t(type(zero))(1), 0)
    return IsolatedRoot(first + zero, dr.select(down, extremum, last), found, unresolved), s
