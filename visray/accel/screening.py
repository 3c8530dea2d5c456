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
        candidate, guard, _ = guarded(k, looking)
        bounds = guard.bounds(d)
        nearer = candidate & bounds.sure & (bounds.high < low)
        doubt = doubt | candidate & ~nearer & ~(bounds.sure & (bounds.low > high))
        best, low, high = (
            dr.select(nearer, new, old) for new, old in zip((k, bounds.low, bounds.high), (best, low, high))
        )
        k = k + 1
        # The next row is looked at only if it is near enough; most lists end here, at the back of the first object.
        within = dr.gather(a.F32, lists.near, k, looking & (k < end)) <= high
        return k, best, low, high, doubt, within & ~doubt & (k < end)

    none, error = end, gamma(4, "single")
    low, high = a.F32(t * (1 - error)), a.F32(t * (1 + error))
    looking = (first < end) & (dr.gather(a.F32, lists.near, first, first < end) <= high)
    start = (first, none, low, high, dr.full(a.B, False, dr.width(first)), looking)
    _, best, _, _, doubt, _ = dr.while_loop(start, lambda *state: state[-1], look, label="nearest in list")
    return dr.select(doubt, first, best), dr.select(doubt, end, dr.minimum(best + 1, end))


def any_hit(
    a: Arrays, lists: RowLists, d: Any, first: Any, end: Any, farthest: Any, guarded: Callable, surely: Callable
) -> tuple[Any, Any]:
    """(mask of the rays that surely hit a row, first entry of a list that needs an exact test, or `end`).

    d, first, end, guarded: as in `nearest`
    farthest: bound on `near` beyond which rows do not count, in single
    surely(c, guard, bounds): function that returns two masks, for rays that surely cross a row: whether they do so
        before their end, and whether they do so behind it; both are false if this is uncertain
    """

    def look(k: Any, hit: Any, unsure: Any, looking: Any) -> tuple:
        candidate, guard, c = guarded(k, looking)
        bounds: CrossingBounds = guard.bounds(d)
        hits, misses = surely(c, guard, bounds)
        hit = hit | (candidate & bounds.sure & hits)
        unsure = dr.select(candidate & ~hit & ~(bounds.sure & misses) & (unsure == end), k, unsure)
        k = k + 1
        within = dr.gather(a.F32, lists.near, k, looking & (k < end)) <= most
        return k, hit, unsure, within & ~hit & (k < end)

    most = farthest * (1 + gamma(4, "single"))
    looking = (first < end) & (dr.gather(a.F32, lists.near, first, first < end) <= most)
    start = (first, dr.full(a.B, False, dr.width(first)), end | dr.zeros(a.U, dr.width(first)), looking)
    _, hit, unsure, _ = dr.while_loop(start, lambda *state: state[-1], look, label="any in list")
    return hit, dr.select(hit, end, unsure)
