"""Root refinement: computes an isolated root to its last digit, or to a tolerance."""

from collections.abc import Callable
from typing import Any

import drjit as dr

from visray.roots.isolation import IsolatedRoot
from visray.roots.number_types import roundoff

# If f does not have the expected sign at an end of the interval, this end is moved outwards by at least this length in
# s. This happens at triple roots: there, the root of f and the root of the isolated polynomial can differ by the cube
# root of the rounding error.
WIDENED = 3e-4


def refine(
    f: Callable, root: IsolatedRoot, at_low: Any, at_high: Any, bounds: tuple, flat: Any = None, tolerance: Any = None
) -> Any:
    """The place s at which f changes from positive to negative, for each isolating interval. If f does not have the
    expected sign at an end of the interval, this end is moved outwards.

    A step is an inverse quadratic interpolation if it is certain to converge well, and a bisection otherwise.

    f: function of s. Its values are of order 1 or smaller.
    root: the isolating intervals.
    at_low, at_high: values that stand for f at the low ends (positive) and at the high ends (negative).
    bounds: (least, greatest) s, up to which an end may be moved.
    flat: bound on values that may be rounding errors, for segments that start on the surface. As long as the value at
        the positive end of the interval is not above this bound, new values from -flat to flat count as positive. After
        that, every value has its own sign. None: every value has its own sign from the beginning.
    tolerance: greatest allowed error of s; a value below the rounding error has no effect. None: s is exact to its last
        digit.

    Source: Chandrupatla 1997, rearranged so that a step has a single division.
    """
    ulp = 2 * roundoff(root.low)

    def step(a: Any, b: Any, fa: Any, fb: Any, x: Any, going: Any) -> tuple:
        # a is the newest point and x the next one. The root lies between a and b.
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

    def close_in(*state: Any) -> tuple:
        return dr.while_loop(state, lambda *state: state[-1], step, label="refine")[:4]

    middle = 0.5 * (root.low + root.high)
    a, b, fa, fb = close_in(root.high, root.low, at_high, at_low, middle, root.exists)
    # If the search ends at an end of the interval, f does not have the sign of the isolated polynomial there. Then this
    # end is moved and the search is repeated.
    move_low = root.exists & (fa != 0) & (b == root.low)
    move_high = root.exists & (fa != 0) & (b == root.high)
    more = dr.maximum(root.high - root.low, WIDENED)
    low = dr.select(move_low, dr.maximum(root.low - more, bounds[0]), root.low)
    high = dr.select(move_high, dr.minimum(root.high + more, bounds[1]), root.high)
    if tolerance is None:
        state = high, low, at_high, at_low, 0.5 * (low + high)
    else:
        # With a tolerance, the search may stop at an end only because f was never evaluated there. So the next step
        # evaluates f there. The root lies between the newest point and the moved end in any case.
        state = a, dr.select(move_low, low, high), fa, fb, b
    again = close_in(*state, move_low | move_high)
    a, b, fa, fb = (dr.select(move_low | move_high, new, old) for new, old in zip(again, (a, b, fa, fb)))
    b_is_better = dr.abs(fa) < dr.abs(fb)
    if tolerance is not None:
        # A root at the start of the segment would not be reported. So the start itself is never returned as the root.
        b_is_better = (b_is_better | (b == bounds[0])) & (a != bounds[0])
    return dr.select(b_is_better, a, b)
