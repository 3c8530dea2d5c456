"""Root refinement: an isolated root to the last digit, or to a tolerance."""

from collections.abc import Callable
from typing import Any

import drjit as dr

from visray.roots.isolation import IsolatedRoot
from visray.roots.number_types import roundoff

# An interval end at which f does not have the expected sign is moved outwards by at least this part of the chord. This
# happens at triple roots, where f and the isolated polynomial differ by the cube root of the rounding.
WIDENED = 3e-4


def refine(
    f: Callable, root: IsolatedRoot, at_low: Any, at_high: Any, bounds: tuple, flat: Any = None, tolerance: Any = None
) -> Any:
    """The zero of f in each interval, where f counts as positive at the low end and negative at the high end.

    Inverse quadratic interpolation where it is certain to converge well, bisection elsewhere.

    f: function of s, of order 1 or less.
    at_low, at_high: values that count as those of f at the ends.
    bounds: no end is moved beyond these.
    flat: a value of at most this size has no sign of its own. It counts as positive until a larger value is found.
    tolerance: greatest error of s, where that is more than its last digit; None: the last digit.

    Source: Chandrupatla 1997, with a single division.
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
    # Where the search has closed in on an end, f does not have the sign of the isolated polynomial there. Then that end
    # is moved and the search is repeated.
    move_low = root.exists & (fa != 0) & (b == root.low)
    move_high = root.exists & (fa != 0) & (b == root.high)
    more = dr.maximum(root.high - root.low, WIDENED)
    low = dr.select(move_low, dr.maximum(root.low - more, bounds[0]), root.low)
    high = dr.select(move_high, dr.minimum(root.high + more, bounds[1]), root.high)
    if tolerance is None:
        state = high, low, at_high, at_low, 0.5 * (low + high)
    else:
        # With a tolerance the end may just not have been evaluated yet. It is evaluated next, and the other end keeps
        # its place.
        state = a, dr.select(move_low, low, high), fa, fb, b
    again = close_in(*state, move_low | move_high)
    a, b, fa, fb = (dr.select(move_low | move_high, new, old) for new, old in zip(again, (a, b, fa, fb)))
    b_is_better = dr.abs(fa) < dr.abs(fb)
    if tolerance is not None:
        # A root near the start of the segment is placed beyond the start, because a root at the start is not reported.
        b_is_better = (b_is_better | (b == bounds[0])) & (a != bounds[0])
    return dr.select(b_is_better, a, b)
