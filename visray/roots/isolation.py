"""Root isolation: an interval of a chord in which a polynomial has its first root and no other."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import drjit as dr

from visray.roots.number_types import Univariate, roundoff

# An interval is not divided further once it is narrower than this many roundings of its distance from the middle of the
# chord (or of 2^-30). Below that width, rounding no longer tells places s apart.
NARROWEST = 32
# An interval is not halved for smaller errors if its Bernstein coefficients differ by at most this many error bounds.
FLAT = 4


@dataclass(frozen=True)
class IsolatedRoot:
    """An interval [low, high] of a chord that contains the first root and no other.

    exists: lanes that have a root.
    unresolved: number of places where it is not known whether there is a root, because a negative value could be noise
        or the interval became too narrow.
    """

    low: Any
    high: Any
    exists: Any
    unresolved: Any


@cache
def conversion(d: int) -> list[list[float]]:
    """The matrix from coefficients of powers s^k to Bernstein coefficients on [-1, 1], degree d.

    Shapes: (d + 1, d + 1), a column per power.
    """
    comb = math.comb

    def entry(i: int, k: int) -> Fraction:
        # s = 2 u - 1 with u from 0 to 1, and u^j has the Bernstein coefficients C(i, j) / C(d, j).
        return sum(Fraction(comb(k, j) * 2**j * comb(i, j) * (-1) ** (k - j), comb(d, j)) for j in range(k + 1))

    return [[float(entry(i, k)) for k in range(d + 1)] for i in range(d + 1)]


def bernstein(c: tuple, middle: Any, half: Any) -> list[Any]:
    """Bernstein coefficients on [middle - half, middle + half] of the polynomial with coefficients c.

    Domain: the interval lies in [-1, 1].
    Error: a few roundings of the sum of |c|, because no entry of `conversion` is above 1 (tests/test_roots.py). The
    usual expansion about an end of the interval would have an error 3^d times as large.
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
    """Bernstein coefficients on [-1, 1] of the polynomial with coefficients c."""
    d, b = len(c) - 1, [None] * len(c)
    for i in range(d // 2 + 1):
        row = conversion(d)[i]
        even, odd = c[0], row[1] * c[1]
        for k in range(2, d + 1, 2):
            even = dr.fma(row[k], c[k], even) if row[k] else even
        for k in range(3, d + 1, 2):
            odd = dr.fma(row[k], c[k], odd) if row[k] else odd
        # Row d - i of the matrix is row i with the signs of the odd powers changed.
        b[i], b[d - i] = even + odd, even - odd
    return b


def isolate(
    c: tuple, noise: Callable, accurate_bernstein: Callable, first: Any, last: Any, active: Any
) -> IsolatedRoot:
    """The first root on [first, last] of a polynomial that counts as positive at `first`: where it becomes negative.

    c: coefficients of the powers of s.
    noise(r): error bound of the values for |s| <= r.
    accurate_bernstein(middle, half): Bernstein coefficients on an interval and their error bound, computed with more
        care. Called where coefficients are negative by no more than the noise.

    The march divides the chord into intervals. Where the signs of the Bernstein coefficients change more than once, the
    first part of the interval, on which the convex hull of the coefficients is positive, is passed over, and the rest
    is halved. Where the accurate coefficients could still be negative, the interval is halved as long as they differ by
    more than their error.
    """
    d, n = len(c) - 1, max(map(dr.width, (*c, first, last, active)))
    number, count = type(c[0]), dr.uint32_array_t(type(c[0]))

    def step(a: Any, w: Any, going: Any, isolated: Any, unsure: Any, unresolved: Any) -> tuple:
        # The interval is [a, a + w]. unsure: a passed interval could be negative.
        half = 0.5 * w
        middle = a + half
        b, error = bernstein(c, middle, half), noise(dr.abs(middle) + half)
        least, most = _range(b)
        blurred = (least < 0) & (least >= -error)

        def again(*_: Any) -> tuple:
            b, error = accurate_bernstein(middle, half)
            return (*b, error, *_range(b))

        state = (*b, error, least, most)
        *b, error, least, most = dr.if_stmt(state, blurred, again, lambda *same: same, label="blurred")
        changes, below = count(0), type(going)(False)
        for x in b:
            changed = dr.select(below, x > error, x < -error)
            below ^= changed
            changes += dr.select(changed, count(1), 0)
        falls = b[d] < -error
        narrow = w <= NARROWEST * roundoff(w) * dr.maximum(dr.abs(middle), 2.0**-30)
        take = ((changes == 1) | narrow) & falls
        blurred &= (changes == 0) & (least < 0) & (most - least > FLAT * error) & ~narrow
        leave = ((changes == 0) & ~blurred) | (narrow & ~falls)
        steepest = (b[1] - b[0]) * d
        for i in range(2, d + 1):
            slope = (b[i] - b[0]) * (d / i)
            steepest = dr.select(slope < steepest, slope, steepest)
        # The straight line from b[0] with the steepest slope lies below all coefficients. It is positive up to here.
        clear = dr.select((b[0] > error) & ~blurred, -b[0] / steepest, 0)
        end = a + w
        new_a = dr.select(leave, end, dr.fma(clear, w, a))
        rest = end - new_a
        left = last - end
        w = dr.select(leave, dr.select(2 * w < left, 2 * w, left), dr.select(take, rest, 0.5 * rest))
        # A passed interval that could be negative either leads to the next root, or hides two roots of its own.
        clean = leave & (least >= 0)
        unresolved += dr.select((unsure & clean) | (narrow & ~take & (changes > 0)), count(1), 0)
        unsure = (unsure & ~clean & ~take) | (leave & (least < 0))
        return new_a, w, going & ~take & (w > 0), isolated | take, unsure, unresolved

    no = dr.full(dr.mask_t(c[0]), False, n)
    interval = first + dr.zeros(number, n), last - first + dr.zeros(number, n)
    start = *interval, no | active, no, no, dr.zeros(count, n)
    a, w, _, isolated, unsure, unresolved = dr.while_loop(start, lambda a, w, going, *_: going, step, label="march")
    return IsolatedRoot(a, a + w, isolated, unresolved + dr.select(unsure, count(1), 0))


def _range(b: Sequence) -> tuple[Any, Any]:
    """The least and the greatest of some numbers."""
    least = most = b[0]
    for x in b[1:]:
        least, most = dr.select(x < least, x, least), dr.select(x > most, x, most)
    return least, most


def isolate_by_formula(c: tuple, noise: Callable, first: Any, last: Any, active: Any) -> tuple[IsolatedRoot, Any]:
    """The first root by formula, for degrees 1 and 2: (isolating interval, s). Otherwise as `isolate`.

    On each side of the extremum there is at most one root.
    """
    zero = 0 * c[0]
    square = zero if len(c) < 3 else c[2]
    extremum = -0.5 * c[1] / square
    extremum = dr.select((square > 0) & (extremum > first) & (extremum < last), extremum, last)
    # How far the polynomial is below zero at its extremum and at the last end, with error bounds.
    depths = [(-Univariate(*c)(s), noise(dr.abs(s))) for s in (extremum, last)]
    at_extremum, at_last = (depth > error for depth, error in depths)
    blurred = ~(at_extremum | at_last) & ((depths[0][0] > 0) | (depths[1][0] > 0))
    # A parabola that opens downwards falls after its extremum; one that opens upwards falls before it.
    root = dr.sqrt(dr.maximum(c[1] * c[1] - 4 * square * c[0], 0))
    q = -0.5 * (c[1] + dr.copysign(root, c[1]))
    one, two = dr.select(q == 0, zero, c[0] / q), dr.select(square == 0, dr.inf, q / square)
    low, high = dr.select(one < two, one, two), dr.select(one < two, two, one)
    s = dr.select(square == 0, one, dr.select(square > 0, low, high))
    exists = active & (at_extremum | at_last)
    s = dr.select(exists, dr.maximum(dr.minimum(s, last), first), 0)
    unresolved = dr.select(active & blurred, dr.uint32_array_t(type(zero))(1), 0)
    return IsolatedRoot(first + zero, dr.select(at_extremum, extremum, last), exists, unresolved), s
