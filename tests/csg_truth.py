"""The truth about CSG: the boolean expression of an object, applied to the sets of its operands on each ray.

It shares no code with the kernels. csg_leaves.py says which points of a ray are in each operand, but for rounding;
csg_sets.py joins these sets. Rays on which rounding decides (coinciding faces, grazing rays) are told as unsure.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from csg_algebra import Level, Tube, clip_of
from csg_leaves import Convex, HalfSpace, Leaf
from csg_sets import IN, OUT, UNKNOWN, Boundary, Sets, first_boundary
from csg_triangles import Shell
from samples import dot, real

from visray.primitives import Csg, Mesh, Plane, Polynomial, Torus
from visray.transforms import Transform


def any_of(states: np.ndarray) -> np.ndarray:
    return np.max(states, 0)


def all_of(states: np.ndarray) -> np.ndarray:
    return np.min(states, 0)


def none_of(states: np.ndarray) -> np.ndarray:
    return IN - np.max(states, 0)


@dataclass(frozen=True)
class Node:
    """An expression: a rule that joins the states of its parts. A part is a node, or the number of a leaf."""

    rule: Callable[[np.ndarray], np.ndarray]
    parts: tuple["Node | int", ...]

    def value(self, leaf: Callable[[int], np.ndarray]) -> np.ndarray:
        """The state at points. leaf: the states of one leaf at these points."""
        return self.rule(np.stack([leaf(p) if isinstance(p, int) else p.value(leaf) for p in self.parts]))

    def sets(self, leaves: list[Sets]) -> Sets:
        return Sets.combined([leaves[p] if isinstance(p, int) else p.sets(leaves) for p in self.parts], self.rule)


def listed(operands: Any) -> tuple:
    """Operands that are given as a list, by name, or not at all."""
    return tuple(operands.values() if isinstance(operands, dict) else operands or ())


class Solid:
    """An object as an expression of leaves."""

    def __init__(self, obj: Any):
        self.leaves: list[Leaf] = []
        self.root = self._node(obj, ())

    def _node(self, obj: Any, around: tuple[Transform, ...]) -> Node:
        """The expression of an object with its cuts. around: the transforms of what is around it, outwards."""
        steps = (*obj.transform, *around)
        if isinstance(obj, Csg):
            parts = [self._node(x, steps) for x in listed(obj.of)]
            if obj.op == "difference":
                rest = (Node(none_of, tuple(parts[1:])),) if parts[1:] else ()
                node = Node(all_of, (parts[0], *rest))
            else:
                node = Node(all_of if obj.op == "intersection" else any_of, tuple(parts))
        else:
            node = Node(all_of, self._leaf_parts(obj, steps))
        cuts = tuple(self._node(x, steps) for x in listed(obj.cut))
        return Node(all_of, (node, Node(none_of, cuts))) if cuts else node

    def _leaf_parts(self, obj: Any, steps: tuple[Transform, ...]) -> tuple[int, ...]:
        """The numbers of the leaves whose intersection an object without its cuts is."""
        shape = replace(obj, transform=(), cut=None)
        if isinstance(obj, Polynomial):
            assert obj.ends == "capped", "a polynomial that is no solid"
            kinds = [(Level, shape), (Convex, clip_of(shape))]
        else:
            known = {Plane: HalfSpace, Mesh: Shell, Torus: Tube}
            kinds = [(known.get(type(obj), Convex), shape)]
        first = len(self.leaves)
        self.leaves += [kind(thing, steps, obj.material) for kind, thing in kinds]
        return tuple(range(first, len(self.leaves)))

    def at(self, p: np.ndarray) -> np.ndarray:
        """The state of world points: inside, outside, or within rounding of the surface."""
        return self.root.value(lambda i: self.leaves[i].state(p))

    def on(self, o: np.ndarray, d: np.ndarray) -> "Crossed":
        """The sets of world rays."""
        o, d = real(o), real(d)
        leaves = [leaf.sets(o, d) for leaf in self.leaves]
        return Crossed(self, o, d, leaves, self.root.sets(leaves))

    def leaving(self, p: np.ndarray, d: np.ndarray, leaf: np.ndarray, n: np.ndarray) -> tuple["Crossed", np.ndarray]:
        """The sets of rays that leave the whole's surface, and which of them rounding leaves no choice of.

        leaf: number of the leaf on whose surface each ray starts, to within rounding.
        n: outward unit normal of the whole there.
        """
        free = self.on(p, d)
        outwards, sure, leaves = dot(n, real(d)) > 0, np.ones(len(p), bool), []
        near = np.zeros(len(p), free.o.dtype)
        for i, sets in enumerate(free.leaves):
            here = leaf == i
            g = self.leaves[i].world_normal(self.leaves[i].surface(self.leaves[i].local_point(p[here]))[1])
            inside = np.zeros(len(p), bool)
            inside[here] = dot(g, real(d[here])) < 0
            # The ray starts within rounding of this leaf, and there is only one way on.
            after = sets.state[min(1, len(sets.state) - 1)]
            sure &= ~here | ((sets.state[0] == UNKNOWN) & (after == np.where(inside, IN, OUT)))
            near = np.where(here, sets.ends()[1][0], near)
            leaves.append(sets.starting(inside, here))
        whole = self.root.sets(leaves)
        after = whole.state[min(1, len(whole.state) - 1)]
        side = np.where(outwards, OUT, IN)
        sure &= (whole.state[0] == side) | ((whole.state[0] == UNKNOWN) & (after == side))
        crossed = Crossed(self, free.o, free.d, leaves, whole.starting(~outwards, whole.state[0] == UNKNOWN))
        # As far as the ray is within rounding of the leaf that it leaves, nothing says what comes first.
        return crossed, sure & ~(crossed.first.hit & (crossed.first.low < near))


@dataclass(frozen=True)
class Crossed:
    """Rays with the sets of a solid and of its leaves on them."""

    solid: Solid
    o: np.ndarray
    d: np.ndarray
    leaves: list[Sets]
    whole: Sets

    @cached_property
    def first(self) -> Boundary:
        return first_boundary(self.whole)

    @cached_property
    def leaf(self) -> np.ndarray:
        """Number of the leaf whose surface the first boundary is; -1 where there is none or several are as near."""
        b = self.first
        near = np.stack([x.unknown_between(b.low, b.high) for x in self.leaves])
        return np.where(b.sure & b.hit & (near.sum(0) == 1), near.argmax(0), -1)

    def normal_at(self, t: np.ndarray) -> np.ndarray:
        """The outward unit normal of the whole at distances near the first boundary, where `leaf` tells whose it is; 0
        elsewhere. Shapes: (N), (N, 3)."""
        n, enters = np.zeros_like(self.o), self.first.enters
        for i in np.unique(self.leaf[self.leaf >= 0]):
            at = self.leaf == i
            leaf = self.solid.leaves[i]
            out = leaf.world_normal(leaf.surface(leaf.local_point(self.o[at] + t[at, None] * self.d[at]))[1])
            n[at] = np.where(((dot(out, self.d[at]) < 0) == enters[at])[:, None], out, -out)
        return n
