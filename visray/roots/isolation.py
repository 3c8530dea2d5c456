"""Root isolation: finds an interval of a chord that contains the first root of a polynomial and no other root.

The chord is the part of a ray's line inside the ball or box that bounds the surface. Its points have the coordinate s,
from -1 to 1.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import drjit as dr

from visray.roots.number_types import Univariate, roundoff

# An interval about s is not divided further if it is narrower than this number times the unit roundoff times |s| (or
# times 2^-30, if |s| is smaller). In narrower intervals, too few different values of s exist.
NARROWEST = 32
# If the coefficients of an interval are negative by less than their error bound, the interval is halved only if they
# differ by more than this number of error bounds.
FLAT = 4


@dataclass(frozen=True)
class IsolatedRoot:
    """An interval [low, high] of a chord that contains the first root and no other.

    exists: mask of the lanes that have a root.
    unresolved: number of places on which the search cannot decide whether there is a root: either a negative value
        could be a rounding error, or the interval became too narrow.
    """

    low: Any
    high: Any
    exists: Any
    unresolved: Any


@cache
def conversion(d: int) -> list[list[float]]:
    """The matrix that converts coefficients of the powers s^k to Bernstein coefficients on [-1, 1], for degree d.

    Shapes: (d + 1, d + 1); each column belongs to one power.
    """
    comb = math.comb

    def entry(i: int, k: int) -> Fraction:
        # With s = 2 u - 1, u runs from 0 to 1, and u^j has the Bernstein coefficients C(i, j) / C(d, j).
        return sum(Fraction(comb(k, j) * 2**j * comb(i, j) * (-1) ** (k - j), comb(d, j)) for j in range(k + 1))

    return [[float(entry(i, k)) for k in range(d + 1)] for i in range(d + 1)]


def bernstein(c: tuple, middle: Any, half: Any) -> list[Any]:
    """Bernstein coefficients on the interval [middle - half, middle + half] of the polynomial with coefficients c.

    c: coefficients of the powers of s, the constant one first.

    Domain: the interval lies in [-1, 1].
    Error: a few unit roundoffs times the sum of |c|, because no entry of `conversion` is above 1 (tests/test_roots.py).
    The usual expansion about an end of the interval would have an error up to 3^d times as large.
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
    """Bernstein coefficients on [-1, 1] of the polynomial with coefficients c of the powers of s."""
    d, b = len(c) - 1, [None] * len(c)
    for i in range(d // 2 + 1):
        row = conversion(d)[i]
        even, odd = c[0], row[1] * c[1]
        for k in range(2, d + 1, 2):
            even = dr.fma(row[k], c[k], even) if row[k] else even
        for k in range(3, d + 1, 2):
            odd = dr.fma(row[k], c[k], odd) if row[k] else odd
        # Row d - i of the matrix is row i, except that the entries of odd powers have the opposite sign.
        b[i], b[d - i] = even + odd, even - odd
    return b


def isolate(
    c: tuple, noise: Callable, accurate_bernstein: Callable, first: Any, last: Any, active: Any,
    starts_at_root: Any = None,
) -> IsolatedRoot:  # fmt: skip
    """Isolates the first root on [first, last] of a polynomial that counts as positive at `first`.

    This root is the place where the polynomial becomes negative.

    c: coefficients of the powers of s, the constant one first.
    noise(r): function that returns an error bound of the polynomial's values for |s| <= r.
    accurate_bernstein(middle, half): function that returns the Bernstein coefficients on the interval
        [middle - half, middle + half], computed more accurately than from c, and their error bound. It is called if the
        least coefficient is negative, but not by more than the noise.
    active: mask of the lanes that search.
    starts_at_root: mask of the lanes in which `first` is known to be a root. Then the computed value there is a
        rounding error, and its sign does not count. None if there is no such lane.

    A loop goes from interval to interval. If the signs of the Bernstein coefficients change more than once, the loop
    skips the first piece of the interval, in which the convex hull of the coefficients is positive, and halves what is
    left. If the accurate coefficients could still be negative, the interval is halved as long as they differ by more
    than their error.
    """
    d, n = len(c) - 1, max(map(dr.width, (*c, first, last, active)))
    number, count = type(c[0]), dr.uint32_array_t(type(c[0]))

    def step(a: Any, w: Any, going: Any, isolated: Any, unsure: Any, unresolved: Any) -> tuple:
        # The interval is [a, a + w]. unsure: the polynomial could be negative in an interval that was left behind.
        half = 0.5 * w
        middle = a + half
        b, error = bernstein(c, middle, half), noise(dr.abs(middle) + half)
        # The value at a known root is a rounding error. If it were taken for a negative value, the interval would be
        # halved again and again, down to the size of the rounding errors.
        begins_at_root = None if starts_at_root is None else starts_at_root & (a == first)
        least, most = _range(b, begins_at_root)
        blurred = (least < 0) & (least >= -error)

        def again(*_: Any) -> tuple:
            b, error = accurate_bernstein(middle, half)
            return (*b, error, *_range(b, begins_at_root))

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
        # The straight line from b[0] with the steepest slope lies below all coefficients. It is positive before the
        # share `clear` of the interval.
        clear = dr.select((b[0] > error) & ~blurred, -b[0] / steepest, 0)
        end = a + w
        new_a = dr.select(leave, end, dr.fma(clear, w, a))
        rest = end - new_a
        left = last - end
        w = dr.select(leave, dr.select(2 * w < left, 2 * w, left), dr.select(take, rest, 0.5 * rest))
        # The polynomial could be negative in an interval that was left behind. If a root is isolated next, both belong
        # to this root. If a certainly positive interval comes next, the interval before may hide a pair of roots, and
        # counts as unresolved.
        clean = leave & (least >= 0)
        unresolved += dr.select((unsure & clean) | (narrow & ~take & (changes > 0)), count(1), 0)
        unsure = (unsure & ~clean & ~take) | (leave & (least < 0))
        return new_a, w, going & ~take & (w > 0), isolated | take, unsure, unresolved

    no = dr.full(dr.mask_t(c[0]), False, n)
    interval = first + dr.zeros(number, n), last - first + dr.zeros(number, n)
    start = *interval, no | active, no, no, dr.zeros(count, n)
    a, w, _, isolated, unsure, unresolved = dr.while_loop(start, lambda a, w, going, *_: going, step, label="march")
    return IsolatedRoot(a, a + w, isolated, unresolved + dr.select(unsure, count(1), 0))


def _range(b: Sequence, begins_at_root: Any) -> tuple[Any, Any]:
    """(the least, the greatest) of the Bernstein coefficients, lane by lane.

    begins_at_root: mask of the lanes in which the first coefficient counts as 0, whatever its computed value, or None.
    """
    least = most = b[0] if begins_at_root is None else dr.select(begins_at_root, 0, b[0])
    for x in b[1:]:
        least, most = dr.select(x < least, x, least), dr.select(x > most, x, most)
    return least, most


def isolate_by_formula(c: tuple, noise: Callable, first: Any, last: Any, active: Any) -> tuple[IsolatedRoot, Any]:
    """(isolated root, s): the first root of a polynomial of degree 1 or 2, and its place s by a formula.

    The parameters are those of `isolate`. On each side of a parabola's extremum there is at most one root, so the
    extremum is an end of the isolating interval.
    """
    zero = 0 * c[0]
    square = zero if len(c) < 3 else c[2]
    extremum = -0.5 * c[1] / square
    extremum = dr.select((square > 0) & (extremum > first) & (extremum < last), extremum, last)
    # Pairs (depth of the polynomial below zero, error bound), at the extremum and at the last end.
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
