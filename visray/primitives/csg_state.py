"""States of operands and of their combinations at one point of a ray, as a walk along the ray needs them.

An event is a crossing of the ray with the surface of an operand. Events that lie at one point, to within rounding,
count as one. At an event, each operand has a state before it and after it: whether the ray is inside. So has each node
of the tree (csg_form.py).

The states of two operands give that of their intersection or union, and also a distance up to which it certainly does
not change. An example: a ray is outside of two balls, and will enter one after 2 and the other after 5. Their
intersection is certainly empty up to 5, and their union up to 2.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

NO_LEAF = 0xFFFFFFFF


@dataclass(frozen=True)
class State:
    """The state of an operand, or of a node, at a point of each ray.

    before, after: whether the ray is inside before the point and behind it.
    owner: code (csg_leaves.py) of the leaf whose surface is seen if `before` and `after` differ; else NO_LEAF.
    next: a distance behind the point, up to which the state certainly stays as it is; inf if it never changes again.
    event: code of the leaf that has an event there.
    enters: whether that event leads into the leaf's operand.
    unresolved: number of pieces of the ray on which a search could not decide (ray.Crossing).
    """

    before: Any
    after: Any
    owner: Any
    next: Any
    event: Any
    enters: Any
    unresolved: Any

    def arrays(self) -> tuple:
        """The arrays of the state, as the state of a loop."""
        return self.before, self.after, self.owner, self.next, self.event, self.enters, self.unresolved

    @staticmethod
    def constant(inside: bool, a: Any, lanes: int) -> "State":
        """The state of a set that is everything, or nothing. a: array types, as fields D, U and B."""
        everywhere, none = dr.full(a.B, inside, lanes), dr.full(a.U, NO_LEAF, lanes)
        return State(everywhere, everywhere, none, dr.full(a.D, dr.inf, lanes), none, dr.full(a.B, False, lanes),
                     dr.zeros(a.U, lanes))  # fmt: skip

    def where(self, mask: Any, other: "State") -> "State":
        """This state where the mask is true, and the other one elsewhere."""
        return State(*(dr.select(mask, x, y) for x, y in zip(self.arrays(), other.arrays())))

    def is_open(self, both: bool) -> Any:
        """Whether the state of a second set matters for its intersection with this one if `both`, else for its union
        with it. It does not if this set alone decides: outside of it an intersection is empty."""
        return (self.before | self.after) if both else ~(self.before & self.after)

    def complement(self) -> "State":
        """The state of the complement."""
        return replace(self, before=~self.before, after=~self.after)

    def joined(self, other: "State", both: bool) -> "State":
        """The state of the intersection of two sets if `both`, else of their union.

        An intersection is empty as long as the ray is outside of one set. So if it is outside of both, the later of
        their next events counts; if it is outside of one, the next event of that one; if of none, the first event. A
        union is the complement of the intersection of the complements.

        Of two surfaces at one point, that with the lower code is seen.
        """
        x, y = self, other
        before, after = (x.before & y.before, x.after & y.after) if both else (x.before | y.before, x.after | y.after)
        # Whether the other set decides.
        x_leaves, y_leaves = (x.after, y.after) if both else (~x.after, ~y.after)
        first = x.next < y.next
        takes_x = dr.select(x_leaves, y_leaves & first, y_leaves | ~first)
        owner_x, owner_y = (dr.select((s.before != s.after) & (s.after == after), s.owner, NO_LEAF) for s in (x, y))
        owner = dr.select(before == after, NO_LEAF, dr.select(owner_x < owner_y, owner_x, owner_y))
        pairs = (x.next, y.next), (x.event, y.event), (x.enters, y.enters)
        return State(before, after, owner, *(dr.select(takes_x, *pair) for pair in pairs), x.unresolved + y.unresolved)
