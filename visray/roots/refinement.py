"""A root to the last digit, or to a tolerance."""

from collections.abc import Callable
from typing import Any

import drjit as dr

from visray.roots.isolation import IsolatedRoot
from visray.roots.number_types import roundoff

# An end that is not confirmed by the surface's structure is moved by at least this part of the chord. Where it is
# needed (a triple root), the two differ by the cube root of the rounding.
WIDENED = 3e-4


def refine(
    f: Callable, part: IsolatedRoot, at_low: Any, at_high: Any, bounds: tuple, flat: Any = None, tolerance: Any = None
) -> Any:
    """Where f, which counts as above zero at the beginning of each part and below at its end, is zero, to the last
    digit of s: by inverse quadratic interpolation where that is certain to be good, by halves elsewhere.

    at_low, at_high: what counts as its values there. f is of order 1 or less. bounds: no end is moved beyond these.
    flat: what is no larger in size, and so of no sign, counts as above zero, as long as nothing larger has been found.
    tolerance: how far off s may be where that is more than its last digit; None: it may not.
    Source: Chandrupatla 1997, with one division.
    """
    ulp = 2 * roundoff(part.low)

    def step(a: Any, b: Any, fa: Any, fb: Any, x: Any, going: Any) -> tuple:
        # a is the newest point, x the next one; the root lies between a and b.
        fx = f(x)
        if flat is not None:
            above = dr.select(fa > 0, fa, fb)
            fx = dr.select((above <= flat) & (dr.abs(fx) <= flat), flat, fx)
        same = (fx < 0) == (fa < 0)
        c, fc = dr.select(same, a, b), dr.select(same, fa, fb)
        b, fb = dr.select(same, b, a), dr.select(same, fb, fa)
        a, fa = x, fx
        gap, ba, bc, ca = b - a, fb - fa, fb - fc, fc - fa
        least = 0.5 * ulp * (dr.abs(dr.select(dr.abs(fa) < dr.abs(fb), a, b)) + 0.5)
        if tolerance is not None:
            least = dr.maximum(least, 0.5 * tolerance)
        size, far, square = dr.abs(gap), dr.abs(c - b), bc * bc
        good = (ba * ba * far < size * square) & (ca * ca * far < (far - size) * square) & (ca != 0)
        curve = dr.abs(fa * (fc * ca * gap - (c - a) * fb * ba) / (ba * bc * ca))
        onwards = dr.select(good, curve, 0.5 * size)
        onwards = dr.maximum(least, dr.minimum(size - least, onwards))
        return a, b, fa, fb, a + dr.copysign(onwards, gap), going & (2 * least < size) & (fx != 0)

    def closed_in(*state: Any) -> tuple:
        return dr.while_loop(state, lambda *state: state[-1], step, label="refine")[:4]

    middle = 0.5 * (part.low + part.high)
    a, b, fa, fb = closed_in(part.high, part.low, at_high, at_low, middle, part.found)
    # At an end f's sign is not that of the polynomial that was isolate: then that end is moved.
    first = part.found & (fa != 0) & (b == part.low)
    last = part.found & (fa != 0) & (b == part.high)
    more = dr.maximum(part.high - part.low, WIDENED)
    low = dr.select(first, dr.maximum(part.low - more, bounds[0]), part.low)
    high = dr.select(last, dr.minimum(part.high + more, bounds[1]), part.high)
    if tolerance is None:
        state = high, low, at_high, at_low, 0.5 * (low + high)
    else:
        # That end may only not have been looked at yet: it comes next, and the other one stays as near as it came.
        state = a, dr.select(first, low, high), fa, fb, b
    again = closed_in(*state, first | last)
    a, b, fa, fb = (dr.select(first | last, new, old) for new, old in zip(again, (a, b, fa, fb)))
    better = dr.abs(fa) < dr.abs(fb)
    if tolerance is not None:
        # What is so near to where all begins is said to be beyond, not there: that would not count as met.
        better = (better | (b == bounds[0])) & (a != bounds[0])
    return dr.select(better, a, b)
