"""Sets of points on rays, known but for rounding, and the boolean algebra of such sets.

A point of a ray is outside of a set, inside, or unknown: within rounding of the set's surface. The three states are the
numbers 0, 2 and 1. So union is the maximum, intersection the minimum and complement 2 - x: Kleene's logic. Where its
answer is 0 or 2, it is that of all surfaces within rounding of the true ones.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

OUT, UNKNOWN, IN = 0, 1, 2


@dataclass(frozen=True)
class Sets:
    """For each of N rays, a set of points at distances from 0 to infinity.

    cut: distances at which the state changes, in ascending order, inf where there are no more. Shape: (K, N)
    state: the state before the first cut, between cuts, and after the last one. Shape: (K + 1, N)
    """

    cut: np.ndarray
    state: np.ndarray

    def at(self, t: np.ndarray) -> np.ndarray:
        """The states at distances between the cuts. Shapes: (M, N)."""
        place = np.zeros(t.shape, int)
        for cut in self.cut:
            place += cut < t
        return np.take_along_axis(self.state, place, 0)

    @staticmethod
    def of(cut: np.ndarray, state: Callable[[np.ndarray], np.ndarray]) -> "Sets":
        """From distances at which the state may change, in any order, and the state at distances between them."""
        cut = np.sort(np.maximum(np.where(np.isnan(cut), np.inf, cut), 0), 0)
        low, high = _ends(cut)
        middle = np.where(np.isfinite(high), (low + np.where(np.isfinite(high), high, 0)) / 2, 2 * low + 1)
        found = state(middle)
        begin, found = _packed(low < high, low, found)
        changed = np.isfinite(begin) & np.concatenate([np.full_like(begin[:1], True, bool), found[1:] != found[:-1]])
        begin, found = _packed(changed, begin, found)
        return Sets(begin[1:], found)

    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """(begin, end) of the pieces of each ray. Shapes: (K + 1, N)."""
        return _ends(self.cut)

    @staticmethod
    def combined(parts: Sequence["Sets"], how: Callable[[np.ndarray], np.ndarray]) -> "Sets":
        """The set that follows from several by a rule of their states, such as their maximum."""
        return Sets.of(
            np.concatenate([p.cut for p in parts]), lambda t: np.asarray(how(np.stack([p.at(t) for p in parts])))
        )

    def unknown_between(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Whether the state is unknown somewhere from `low` to `high`, both included. Shapes: (N)."""
        begin, end = _ends(self.cut)
        return ((self.state == UNKNOWN) & (begin <= high) & (end >= low) & (begin < end)).any(0)

    def starting(self, inside: np.ndarray, where: np.ndarray) -> "Sets":
        """The sets of some rays with their first pieces known to be inside, or outside. inside, where: masks (N)."""
        state = self.state.copy()
        state[0] = np.where(where, np.where(inside, IN, OUT), state[0])
        known = Sets(self.cut, state)
        return Sets.of(self.cut, known.at)

    def length(self, state: int, end: Any) -> np.ndarray:
        """The length of each ray up to `end` that is in a state. Shape: (N)."""
        begin, until = _ends(self.cut)
        piece = np.maximum(np.minimum(until, end) - np.minimum(begin, end), 0)
        return np.where(self.state == state, piece, 0).sum(0)


def _ends(cut: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(begin, end) of the pieces of each ray. Shapes: (K + 1, N)."""
    row = np.zeros((1, cut.shape[1]), cut.dtype)
    return np.concatenate([row, cut]), np.concatenate([cut, row + np.inf])


def _packed(kept: np.ndarray, begin: np.ndarray, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The pieces of each ray that are kept, in order. Behind them, `begin` is inf, and the state that of the last."""
    order, count = np.argsort(~kept, 0, kind="stable"), kept.sum(0)
    begin, state = (np.take_along_axis(x, order, 0)[: count.max(initial=1)] for x in (begin, state))
    last = np.take_along_axis(state, np.maximum(count - 1, 0)[None], 0)
    beyond = np.arange(len(begin))[:, None] >= count
    return np.where(beyond, np.inf, begin), np.where(beyond, last, state)


@dataclass(frozen=True)
class Boundary:
    """The first boundary of a set on each ray. Shapes: (N)

    hit: whether there is one
    low, high: its distance lies between these
    enters: whether the ray is outside before it
    sure: whether all that is so for all surfaces within rounding; the other fields of an unsure ray mean nothing
    """

    hit: np.ndarray
    low: np.ndarray
    high: np.ndarray
    enters: np.ndarray
    sure: np.ndarray


def first_boundary(sets: Sets) -> Boundary:
    """The first boundary of each ray's set.

    It is unsure if the ray starts within rounding of a surface, or if its first unknown piece has the same state on
    both sides: there the ray just touches, or passes between two surfaces that coincide within rounding.
    """
    n = sets.state.shape[1]
    cut = np.concatenate([sets.cut, np.full((2, n), np.inf, sets.cut.dtype)])
    state = np.concatenate([sets.state, sets.state[-1:], sets.state[-1:]])
    hit = np.isfinite(cut[0])
    wide = state[1] == UNKNOWN
    high, after = np.where(wide, cut[1], cut[0]), np.where(wide, state[2], state[1])
    sure = (state[0] != UNKNOWN) & (~hit | (np.isfinite(high) & (after != state[0]) & (after != UNKNOWN)))
    return Boundary(hit, cut[0], high, state[0] == OUT, sure)
