"""Screening: decides in single precision which rows of a list need an exact test, in double.

A row is one object, or one triangle of a mesh, in the kernel's tables. Guards (culling.py) know of most rays whether
they hit a sphere or a triangle, and where, with a proven error. Only rays for which this does not decide need more than
one exact test. Results are those of exact tests of all rows, bit for bit (tests/test_lists.py).
"""

from collections.abc import Callable
from typing import Any

import drjit as dr

from visray.accel.culling import CrossingBounds
from visray.accel.lists import RowLists
from visray.geometry import gamma
from visray.quantities import Arrays


def nearest(a: Arrays, lists: RowLists, d: Any, first: Any, end: Any, t: Any, guarded: Callable) -> tuple[Any, Any]:
    """(first, end): the entries of a list that need an exact test to find the closest hit. These are none, or only the
    entry of the closest hit, or all entries if single precision cannot tell which row is hit first.

    d: directions of the rays, in single
    first, end: the entries of the ray's cell
    t: distance of the closest hit so far, in double
    guarded(k, looking): function that returns (mask of the rays that may hit the row of entry k, the row's guard, the
        candidate)
    """

    def look(k: Any, best: Any, low: Any, high: Any, doubt: Any, looking: Any) -> tuple:
        within = dr.gather(a.F32, lists.near, k, looking) <= high
        candidate, guard, _ = guarded(k, looking)
        candidate = candidate & within
        bounds = guard.bounds(d)
        nearer = candidate & bounds.sure & (bounds.high < low)
        doubt = doubt | candidate & ~nearer & ~(bounds.sure & (bounds.low > high))
        best, low, high = (
            dr.select(nearer, new, old) for new, old in zip((k, bounds.low, bounds.high), (best, low, high))
        )
        k = k + 1
        return k, best, low, high, doubt, within & ~doubt & (k < end)

    none, error = end, gamma(4, "single")
    low, high = a.F32(t * (1 - error)), a.F32(t * (1 + error))
    start = (first, none, low, high, dr.full(a.B, False, dr.width(first)), first < end)
    _, best, _, _, doubt, _ = dr.while_loop(start, lambda *state: state[-1], look, label="nearest in list")
    return dr.select(doubt, first, best), dr.select(doubt, end, dr.minimum(best + 1, end))


def any_hit(
    a: Arrays, lists: RowLists, d: Any, first: Any, end: Any, farthest: Any, guarded: Callable, surely: Callable
) -> tuple[Any, Any]:
    """(mask of the rays that surely hit a row, first entry of a list that needs an exact test, or `end`).

    d, first, end, guarded: as in `nearest`
    farthest: bound on `near` beyond which rows do not count, in single
    surely(c, guard, bounds): function that returns a mask of the rays that hit a row before their end
    """

    def look(k: Any, hit: Any, unsure: Any, looking: Any) -> tuple:
        within = dr.gather(a.F32, lists.near, k, looking) <= most
        candidate, guard, c = guarded(k, looking)
        candidate = candidate & within
        bounds: CrossingBounds = guard.bounds(d)
        hit = hit | candidate & bounds.sure & surely(c, guard, bounds)
        unsure = dr.select(candidate & ~hit & (unsure == end), k, unsure)
        k = k + 1
        return k, hit, unsure, within & ~hit & (k < end)

    most = farthest * (1 + gamma(4, "single"))
    start = (first, dr.full(a.B, False, dr.width(first)), end | dr.zeros(a.U, dr.width(first)), first < end)
    _, hit, unsure, _ = dr.while_loop(start, lambda *state: state[-1], look, label="any in list")
    return hit, dr.select(hit, end, unsure)
