"""The truth about open surfaces that solids cut: their crossings with each ray, and at which of them they are kept."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from csg_algebra import Level, clip_of
from csg_leaves import Convex, Leaf
from csg_sets import IN, OUT, UNKNOWN, Sets
from csg_truth import Node, Solid, all_of, listed, none_of
from samples import SAMPLES, dot, norm, real

from visray.primitives import Csg, Mesh, Plane, Polynomial
from visray.transforms import Transform


class Sheet(Leaf):
    """A flat kind, whose twin in samples.py has a plane and an outline."""

    def crossings(self, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As `OpenSurface.crossings`, of world rays. Shapes: (1, N)."""
        o, d = self.local(o, d)
        twin = SAMPLES[type(self.thing).__name__].twin
        with np.errstate(all="ignore"):
            t, outside = twin.crossing(self.thing, o, d, 0)
            g = self.slack(o, d, np.abs(np.nan_to_num(t, posinf=0, neginf=0)))
            error = np.abs(g / dot(d, twin.plane(self.thing)[0]))
        # Along the ray the crossing is off by `error`, and so it is in its plane.
        slip = g + error * norm(d)
        there = np.isfinite(t) & (t + error > 0) & (outside < slip)
        certain = there & (outside < -slip) & (t - error > 0)
        t, error = (np.where(there, x, y) for x, y in ((t, np.inf), (error, 0)))
        return np.maximum(t - error, 0)[None], (t + error)[None], certain[None]

    def surface(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        (face,) = SAMPLES[type(self.thing).__name__].twin.faces(self.thing, p)
        return face.distance, face.normal


def unknown_pieces(sets: Sets) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As `OpenSurface.crossings`: the crossings with the surface of a set."""
    row = np.full_like(sets.state[:1], UNKNOWN)
    before, after = np.concatenate([row, sets.state[:-1]]), np.concatenate([sets.state[1:], row])
    low, high = sets.ends()
    there = (sets.state == UNKNOWN) & (low < high)
    certain = there & (before != after) & (before != UNKNOWN) & (after != UNKNOWN)
    return np.where(there, low, np.inf), np.where(there, high, np.inf), certain


@dataclass(frozen=True)
class OpenHits:
    """The first hit of each ray: as csg_sets.Boundary. leaf: number of the leaf, -1 where several are as near."""

    hit: np.ndarray
    low: np.ndarray
    high: np.ndarray
    sure: np.ndarray
    leaf: np.ndarray


class OpenSurface(Solid):
    """An object that is no solid: the surface of its first operand at the points of a set. `root` is that set."""

    def __init__(self, obj: Any):
        self.leaves: list[Leaf] = []
        self.kept: list[Node] = []
        self.base: Any = self._base(obj, ())
        self.root = Node(all_of, tuple(self.kept))

    def _base(self, obj: Any, around: tuple[Transform, ...]) -> Node | int:
        """The surface: a leaf, or an expression. What cuts it is added to `kept`."""
        steps = (*obj.transform, *around)
        if isinstance(obj, Csg):
            first, *others = listed(obj.of)
            base = self._base(first, steps) if is_open(first) else self._node(first, steps)
            rest = tuple(self._node(x, steps) for x in others)
            self.kept.append(Node(none_of if obj.op == "difference" else all_of, rest))
        else:
            shape, base = replace(obj, transform=(), cut=None), len(self.leaves)
            if isinstance(obj, Polynomial):
                self.leaves += [Level(shape, steps, obj.material), Convex(clip_of(shape), steps, "default")]
                self.kept.append(Node(all_of, (base + 1,)))
            else:
                self.leaves.append(Sheet(shape, steps, obj.material))
        if obj.cut:
            self.kept.append(Node(none_of, tuple(self._node(x, steps) for x in listed(obj.cut))))
        return base

    def crossings(self, o: np.ndarray, d: np.ndarray, leaves: list[Sets | None]) -> tuple[np.ndarray, ...]:
        """(low, high, whether it is certain that there is one) of all crossings with the surface. Shapes: (K, N)."""
        if isinstance(self.base, Node):
            return unknown_pieces(self.base.sets(leaves))
        leaf = self.leaves[self.base]
        return leaf.crossings(o, d) if isinstance(leaf, Sheet) else unknown_pieces(leaves[self.base])

    def hits(self, o: np.ndarray, d: np.ndarray) -> OpenHits:
        """The first hits of world rays."""
        o, d = real(o), real(d)
        leaves = [None if isinstance(leaf, Sheet) else leaf.sets(o, d) for leaf in self.leaves]
        low, high, certain = self.crossings(o, d, leaves)
        order = np.argsort(low, 0, kind="stable")
        low, high, certain = (np.take_along_axis(x, order, 0) for x in (low, high, certain))
        within = self.root.sets(leaves)
        n = o.shape[0]
        hit, sure, going = np.zeros(n, bool), np.ones(n, bool), np.ones(n, bool)
        at = [np.full(n, np.inf, low.dtype), np.full(n, np.inf, low.dtype)]
        for a, b, c in zip(low, high, certain):
            there = going & np.isfinite(a)
            middle = np.where(there, (a + np.where(np.isfinite(b), b, a)) / 2, 0)
            state = within.at(middle[None])[0]
            clear = ~within.unknown_between(a, b) & (state == within.at(np.where(there, b, 0)[None])[0])
            state = np.where(clear, state, UNKNOWN)
            taken, open_ = there & (state == IN) & c, there & (state != OUT) & ~(c & (state == IN))
            hit |= taken
            sure &= ~open_
            at = [np.where(taken, x, y) for x, y in zip((a, b), at)]
            going &= ~taken & ~open_
        return OpenHits(hit, *at, sure, self._leaf(leaves, hit & sure, *at))

    def _leaf(self, leaves: list[Sets | None], there: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        if not isinstance(self.base, Node):
            return np.where(there, self.base, -1)
        near = np.stack([x.unknown_between(low, high) for x in leaves])
        return np.where(there & (near.sum(0) == 1), near.argmax(0), -1)


def is_open(obj: Any) -> bool:
    """Whether an object is no solid."""
    if isinstance(obj, Csg):
        return obj.ends == "open" or is_open(listed(obj.of)[0])
    if isinstance(obj, Polynomial):
        return obj.ends == "open"
    if isinstance(obj, Mesh):
        return len(obj.faces.values) == 1  # the sample of open meshes (samples.mesh_of)
    return hasattr(SAMPLES[type(obj).__name__].twin, "outline") and not isinstance(obj, Plane)
