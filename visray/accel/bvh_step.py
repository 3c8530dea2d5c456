"""One step of rays in a bounding volume hierarchy: each ray visits one block, a node or a row (blocks.py)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.accel.blocks import (
    BALL,
    BLOCK,
    CHILDREN,
    CORNER,
    FIRST_CHILD,
    HIGH,
    KIND,
    LOW,
    NODE,
    NUMBER,
    ROD,
    STEP,
    TRIANGLE,
)
from visray.accel.hierarchy import WIDTH
from visray.accel.row_tests import Verdict, test_ball, test_rod, test_triangle
from visray.accel.tree_rays import TreeRays
from visray.accel.walk_stack import EMPTY, Stack
from visray.geometry import gamma
from visray.pytree import leaves
from visray.quantities import Arrays

# In the place of a block: the walk has ended.
ENDED = EMPTY
# Bit of the number of a block: the ray waits for the exact test of its row.
WAITS = 1 << 31
# In the place of a row: there is none, or single precision has decided the search.
NO_CANDIDATE, DECIDED = 0xFFFFFFFF, 0xFFFFFFFE
# A sorting network for four children: these pairs are compared and swapped, in this order.
SORTED = ((0, 1), (2, 3), (0, 2), (1, 3), (1, 2))


@dataclass(frozen=True)
class Certain:
    """When a hit that is certain in single precision counts, without the exact test. Distances are from the origin.

    A hit of a row counts if its distance is greater than `begin`, and if the end of the ray is behind the row and more
    than `end_error` away from it.

    begin, end, end_error: arrays in double; end is inf for endless rays.
    decided: function that returns the state of the search after a hit that counts. None if the closest hit is asked
        for: then a hit that counts excludes all rows behind it, but is tested in double all the same.
    """

    begin: Any
    end: Any
    end_error: Any
    decided: Callable | None = None


@dataclass(frozen=True)
class Search:
    """What rays look for in a tree, as functions of a state (a tuple of arrays).

    visit(batch, state, row, present): returns the state after the exact test of one row. batch: number of the row's
        batch, a Python number. row: number of the row among all rows of the scene. present: mask of the lanes that
        visit a row of this batch. Rows come in no fixed order. So if two hits have the same distance, `visit` must
        prefer the row with the lower number.
    reach(state): returns a distance from the ray origin, in single or double. Boxes beyond it are skipped.
    done(state): returns a mask of the rays that stop.
    accepts(batch, state, row, present): returns a mask of the rays that may hit the row.
    certain: when a certain hit counts; None if each row that may be hit is tested in double.
    """

    visit: Callable
    reach: Callable
    done: Callable
    accepts: Callable = lambda batch, state, row, present: present
    certain: Certain | None = None


@dataclass(frozen=True)
class Position:
    """Where each ray is in the tree.

    block: number of the next block; with the bit WAITS if the ray waits for the exact test of its candidate; or ENDED.
    limit: distance from the start of the walk beyond which boxes are skipped, in single.
    candidate: number of the row to be tested in double; or NO_CANDIDATE, or DECIDED.
    low: lower bound of the distance of the candidate's hit.
    stack: the blocks after the next one.
    """

    block: Any
    limit: Any
    candidate: Any
    low: Any
    stack: Stack


class Step:
    """A step of rays, with the data that all steps of a walk share.

    state: the state of the search, which steps do not change.
    """

    def __init__(self, rays: TreeRays, search: Search, state: tuple, n: int):
        self.a, self.rays, self.search, self.state, self.n = rays.a, rays, search, state, n
        certain = search.certain
        self.decides = certain is not None and certain.decided is not None
        if certain is not None:
            self.begin, self.end = rays.at_most(certain.begin), rays.at_least(certain.end)
            # The error of the walk also bounds that of a row's own numbers.
            self.end_error = rays.a.F32(certain.end_error + rays.error) * (1 + gamma(2, "single"))

    def taken(self, at: Position) -> tuple[Position, Any]:
        """(where the rays are after the step, mask of the rays that visited a node).

        Domain: no ray waits, and no walk has ended.
        """
        u = self.a.U
        block = dr.gather(self.a.X32, self.rays.tree.blocks, at.block, shape=(BLOCK, self.n))
        kind, zeros = _word(self.a, block[KIND]), dr.zeros(u, self.n)
        is_node = kind == NODE
        # A node gives the number of children that the ray enters, the nearest of them, and a stack entry for all
        # others. A row gives 1 if the ray stays at this block, and 0 if it goes on.
        count, following, entry = dr.if_stmt(
            (zeros, at.block, at.block), is_node, lambda *_: entered(self.rays, block, at.limit), _same, label="node"
        )
        count, waits, limit, candidate, low = dr.if_stmt(
            (count, zeros, at.limit, at.candidate, at.low),
            ~is_node,
            lambda *state: self._at_row(block, kind, *state[2:]),
            _same,
            label="row",
        )
        stack, popped = at.stack.moved(count > 1, entry, count == 0)
        following = dr.select(count == 0, popped, following) | waits
        return Position(following, limit, candidate, low, stack), is_node

    def _at_row(self, block: Any, kind: Any, limit: Any, candidate: Any, low: Any) -> tuple:
        """What rays do at a row: (1 if the ray stays at this block, else 0; WAITS if it waits for an exact test, else
        0; the new limit, candidate and low).

        block, kind: words of the row's block, and its kind.
        """
        u, row, x = self.a.U, _word(self.a, block[NUMBER]), self._verdict(block, kind, limit)
        may_hit, sure = x.may_hit & self._accepted(row), self.a.B(False)
        if self.search.certain is not None:
            sure = may_hit & x.surely_hits & (x.low > self.begin) & ((self.end - x.last) * x.slope > self.end_error)
        # A certain hit in front of the candidate's takes its place, and that row is never tested. If the order of both
        # is not certain, the candidate is tested before the ray goes on.
        takes = may_hit if self.decides else may_hit & ((candidate == NO_CANDIDATE) | (sure & (x.high < low)))
        number = dr.select(sure, DECIDED, row) if self.decides else row
        goes_on = ~may_hit if self.decides else ~may_hit | (takes & sure)
        return (
            dr.select(may_hit & ~takes, u(1), u(0)),
            dr.select(goes_on, u(0), u(WAITS)),
            limit if self.decides else dr.select(takes & sure & (x.high < limit), x.high, limit),
            dr.select(takes, number, candidate),
            low if self.decides else dr.select(takes, x.low, low),
        )

    def _verdict(self, block: Any, kind: Any, limit: Any) -> Verdict:
        """What single precision says of the rows of all lanes."""
        a, kinds = self.a, set(self.rays.tree.block_kinds)
        tests = {TRIANGLE: test_triangle, BALL: test_ball, ROD: test_rod}
        if len(kinds) == 1 and kinds <= set(tests):
            return tests[kinds.pop()](a, self.rays.single, block, limit)
        zero = dr.zeros(a.F32, self.n)
        state = dr.full(a.B, True, self.n), dr.full(a.B, False, self.n), zero, zero, zero, zero
        for block_kind in sorted(kinds & set(tests)):

            def test(*_: Any, block_kind: int = block_kind) -> tuple:
                return leaves(tests[block_kind](a, self.rays.single, block, limit))

            state = dr.if_stmt(state, kind == block_kind, test, _same, label="row test")
        return Verdict(*state)

    def _accepted(self, row: Any) -> Any:
        """Mask of the rays that may hit their row, by what the search knows of it."""
        accepted = self.a.B(False)
        for batch, present in self.rays.tree.masks(self.a, row):
            accepted |= present & self.search.accepts(batch, self.state, row, present)
        return accepted


def entered(rays: TreeRays, node: Any, limit: Any) -> tuple[Any, Any, Any]:
    """The children of a node whose boxes a ray enters: (their number, the block of the nearest, a stack entry of the
    others from near to far).

    node: words of the node in each lane, as floats.
    limit: distance from the start of the walk beyond which boxes are skipped.
    """
    a, u = rays.a, rays.a.U
    near, far = [a.F32(0)] * WIDTH, [limit] * WIDTH
    for axis in range(3):
        inverse, corner, step = rays.inverse[axis], node[CORNER + axis], node[STEP + axis] * rays.inverse[axis]
        low, high, ahead = _word(a, node[LOW + axis]), _word(a, node[HIGH + axis]), inverse > 0
        first, last = dr.select(ahead, low, high), dr.select(ahead, high, low)
        first_corner, last_corner = (dr.fma(corner, inverse, x[axis]) for x in (rays.near, rays.far))
        for k in range(WIDTH):
            x, y = dr.fma(_byte(a, first, k), step, first_corner), dr.fma(_byte(a, last, k), step, last_corner)
            near[k], far[k] = dr.select(x > near[k], x, near[k]), dr.select(y < far[k], y, far[k])
    children, keys = _word(a, node[CHILDREN]), []
    for k in range(WIDTH):
        # Distances are not negative, so their bits are in the order of the distances. The lowest bits give way to the
        # child's place.
        key = (dr.reinterpret_array(u, near[k]) & (EMPTY - 3)) | u(k)
        # A node has two children at least.
        enters = near[k] <= far[k] * (1 + gamma(16, "single"))
        keys.append(dr.select(enters & (children > k) if k > 1 else enters, key, EMPTY))
    count = sum((dr.select(key != EMPTY, u(1), u(0)) for key in keys), u(0))
    for i, j in SORTED:
        keys[i], keys[j] = dr.minimum(keys[i], keys[j]), dr.maximum(keys[i], keys[j])
    first_child = _word(a, node[FIRST_CHILD])
    places = (keys[1] & 3) | ((keys[2] & 3) << 2) | ((keys[3] & 3) << 4)
    return count, first_child + (keys[0] & 3), Stack.entry(first_child, places, count - 1)


def _word(a: Arrays, x: Any) -> Any:
    """The bits of a float as an unsigned integer."""
    return dr.reinterpret_array(a.U, x)


def _byte(a: Arrays, word: Any, k: int) -> Any:
    """Byte k of a word, as a float."""
    shifted = word >> (8 * k) if k else word
    return a.F32(shifted & 255 if k < 3 else shifted)


def _same(*state: Any) -> tuple:
    return state
