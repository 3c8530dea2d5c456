"""A bounding volume hierarchy over many objects of one kinship.

The tree is complete: node i has the children 2i and 2i + 1, the root is 1, and all leaves are on one level. So a ray's
way back needs no stack: a bit a level says whether the sibling still waits (a bit trail; Hapala et al. 2011, Barringer
and Akenine-Moeller 2013, in the form for complete trees). A stack in memory costs Dr.Jit six times the time of
registers.

Boxes are single and grown outwards, objects are tested in double: the answer is that of the plain loop, bit for bit.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray.geometry import gamma
from visray.quantities import Arrays
from visray.ray import NO_OBJECT

LEAF = 4  # objects a leaf holds at most


@dataclass(frozen=True)
class Tree:
    """slots: the object in each place of each leaf, or NO_OBJECT; low, high: the corners of each node's box, in double.

    Shapes: slots (leaves x LEAF), low and high (3, 2 x leaves), the node's number as index.
    """

    slots: Any
    low: Any
    high: Any


def leaves_for(n: int) -> int:
    """The number of leaves over n objects: the least power of two that leaves LEAF or fewer in each."""
    return 1 << max(0, int(np.ceil(np.log2(n / LEAF))))


def build(a: Arrays, centre: np.ndarray, radius: np.ndarray) -> Tree:
    """The tree over spheres. Shapes: centre (n, 3), radius (n). Level by level: each node is cut in two equal halves
    across the longest side of the box around its centres."""
    n, leaves = len(radius), leaves_for(len(radius))
    order, starts = np.arange(n), np.array([0, n])
    while len(starts) - 1 < leaves:
        owner = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        points = centre[order]
        extent = np.maximum.reduceat(points, starts[:-1]) - np.minimum.reduceat(points, starts[:-1])
        along = points[np.arange(n), np.argmax(extent, axis=1)[owner]]
        order = order[np.lexsort((along, owner))]
        middles = (starts[:-1] + starts[1:]) // 2
        starts = np.sort(np.concatenate([starts, middles]))
    slots = np.full((leaves, LEAF), NO_OBJECT, np.uint32)
    place = np.arange(n) - np.repeat(starts[:-1], np.diff(starts))
    slots[np.repeat(np.arange(leaves), np.diff(starts)), place] = order
    # The spheres hold the objects but for the rounding of their centres and radii; the rest is room for Walk's own.
    span = np.abs(centre).max(axis=1) + radius
    grown = (radius * (1 + 2.0**-20) + gamma(16) * span)[order, None]
    low, high = np.full((2 * leaves, 3), np.inf), np.full((2 * leaves, 3), -np.inf)
    low[leaves:] = np.minimum.reduceat(centre[order] - grown, starts[:-1])
    high[leaves:] = np.maximum.reduceat(centre[order] + grown, starts[:-1])
    level = leaves
    while level > 1:
        low[level // 2 : level] = np.minimum(low[level : 2 * level : 2], low[level + 1 : 2 * level : 2])
        high[level // 2 : level] = np.maximum(high[level : 2 * level : 2], high[level + 1 : 2 * level : 2])
        level //= 2
    low[0], high[0] = low[1], high[1]
    return Tree(a.put(a.U, slots.ravel()), a.put(a.W, low.T), a.put(a.W, high.T))


def packets(a: Arrays, tree: Tree, o: Any) -> Any:
    """The boxes of all nodes relative to one origin, in single, rounded outwards: packets of four numbers.

    First the low corners of all nodes, then the high ones; the fourth number is not used.
    """
    corners = [_outwards(a, corner - o, out) for corner, out in ((tree.low, -1), (tree.high, 1))]
    x, y, z = (dr.concat([c[axis] for c in corners]) for axis in range(3))
    dr.eval(x, y, z)  # what concat scatters must be there before ravel reads it
    return dr.ravel(a.Q32(x, y, z, 0))


def _outwards(a: Arrays, exact: Any, out: int) -> Any:
    """A corner in single, beyond the exact one: the conversion errs by 2^-24 of it, the product that adds 2^-23 too."""
    return a.V32(exact + out * dr.abs(exact) * 2.0**-22)


@dataclass(frozen=True)
class Walk:
    """A tree and how rays run past it: their direction's reciprocal in single, and the boxes as seen from the origin.

    boxes: the packets of a shared origin, or None, and then o is one origin a lane.
    """

    a: Arrays
    tree: Tree
    boxes: Any
    o: Any
    inverse: Any

    @staticmethod
    def along(a: Arrays, tree: Tree, boxes: Any, o: Any, d: Any) -> "Walk":
        # A component below 2^-60 counts as 2^-60, so that no product is inf times 0: over any distance at which an
        # object's box can be told from a point the ray is then off by less than the box was grown.
        least = 2.0**-60
        return Walk(a, tree, boxes, o, dr.rcp(dr.select(dr.abs(d) < least, dr.copysign(type(d)(least), d), d)))

    def enters(self, node: Any, reach: Any) -> tuple[Any, Any]:
        """Whether rays enter a node's box before `reach`, and where."""
        if self.boxes is None:
            low, high = (dr.gather(self.a.W, c, node) - self.o for c in (self.tree.low, self.tree.high))
            low, high = _outwards(self.a, low, -1), _outwards(self.a, high, 1)
        else:
            count = dr.width(self.tree.low)
            low, high = (dr.gather(self.a.Q32, self.boxes, node + shift) for shift in (0, count))
        near, far = self.a.F32(0), reach
        for axis in range(3):
            t0, t1 = low[axis] * self.inverse[axis], high[axis] * self.inverse[axis]
            forward = self.inverse[axis] > 0
            first, last = dr.select(forward, t0, t1), dr.select(forward, t1, t0)
            near, far = dr.select(first > near, first, near), dr.select(last < far, last, far)
        # Reciprocal and product are each off by one rounding, at both ends, and reach by its conversion (Ize 2013).
        return near <= far * (1 + gamma(6, "single")), near

    def through(self, state: tuple, visit: Any, reach: Any, done: Any) -> tuple:
        """`state` after visit(state, object, present) for every object whose leaf a ray enters before reach(state)."""
        u, leaves = self.a.U, dr.width(self.tree.slots) // LEAF
        n = dr.width(self.inverse)

        def at_leaf(node: Any, trail: Any, *state: Any) -> tuple:
            for place in range(LEAF):
                thing = dr.gather(u, self.tree.slots, (node - leaves) * LEAF + place)
                state = visit(state, thing, thing != NO_OBJECT)
            node, trail = _back(node, trail)
            return dr.select(done(state), 0, node), trail, *state

        def at_fork(node: Any, trail: Any, *state: Any) -> tuple:
            left, right = 2 * node, 2 * node + 1
            (in_left, near_left), (in_right, near_right) = (self.enters(c, reach(state)) for c in (left, right))
            chosen = dr.select(in_right & (~in_left | (near_right < near_left)), right, left)
            back, left_trail = _back(node, trail)
            deeper = (trail << 1) | dr.select(in_left & in_right, u(1), u(0))
            met = in_left | in_right
            return dr.select(met, chosen, back), dr.select(met, deeper, left_trail), *state

        def body(node: Any, trail: Any, *state: Any) -> tuple:
            if leaves == 1:
                return at_leaf(node, trail, *state)
            return dr.if_stmt((node, trail, *state), node >= leaves, at_leaf, at_fork, label="node")

        start = (dr.full(u, 1, n), dr.zeros(u, n), *state)
        return dr.while_loop(start, lambda node, *_: node != 0, body, label="tree")[2:]


def _back(node: Any, trail: Any) -> tuple[Any, Any]:
    """The nearest sibling that waits, and the trail without it; node 0 where none does."""
    up = dr.tzcnt(trail)
    waits = trail != 0
    return dr.select(waits, (node >> up) ^ 1, 0), dr.select(waits, (trail >> up) ^ 1, 0)
