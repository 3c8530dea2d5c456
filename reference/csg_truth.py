"""The colour of rays that meet a solid of csg_scenes.py, in extended precision: who is right where programs differ.

It is a third implementation. All operands are convex, so a ray is inside each of them in one interval. Between the ends
of these intervals, whether the ray is inside the solid does not change; the operation is evaluated in the middle of
each piece.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from bench_povray import View
from csg_scenes import AMBIENT, BACKGROUND, COLOURS, DIFFUSE, LAMP, Solid

# Numbers of 64 bits of mantissa on x86.
L = np.longdouble
# Rays that are judged together, as memory allows.
TOGETHER = 4096


@dataclass(frozen=True)
class Pieces:
    """The ends of all operands' intervals on each ray, in order, and what lies between them.

    t: the ends, in [0, most]. Shapes: (N, 2K)
    leaf: the operand that each end belongs to. Shapes: (N, 2K)
    solid: whether the piece between an end and the next has a length and is inside the solid. Shapes: (N, 2K - 1)
    """

    t: np.ndarray
    leaf: np.ndarray
    solid: np.ndarray


class Truth:
    """The true colours of a solid.

    solid: the scene; size: pixels on a side of its picture
    """

    def __init__(self, solid: Solid, size: int):
        self.view, self.node, self.leaves, self.size = View.of(solid), solid.node, solid.node.leaves(), size
        self.lamp = L(solid.radius) * np.array(LAMP, L)[:, None]

    def colours(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Colours of the rays through the points (x, y) of the picture, in pixels from its top left corner.

        Shapes: x and y (N,), result (N, 3).
        """
        parts = [slice(i, i + TOGETHER) for i in range(0, len(x), TOGETHER)]
        return np.concatenate([np.empty((0, 3), L), *(self._colours(x[p], y[p]) for p in parts)])

    def _colours(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        v = self.view
        across, down = ((2 * L(1) * w / self.size - 1) * L(v.half) for w in (x, y))
        d = v.forward[:, None] + across * v.right[:, None] - down * v.up[:, None]
        o = np.broadcast_to(v.eye.astype(L)[:, None], d.shape)
        pieces = self._pieces(*self._intervals(o, d), L(np.inf))
        hits = np.flatnonzero(pieces.solid.any(1))
        colours = np.tile(np.array(BACKGROUND, L), (len(x), 1))
        first = pieces.solid[hits].argmax(1)
        t, leaf = pieces.t[hits, first], pieces.leaf[hits, first]
        colours[hits] = self._shaded(o[:, hits] + t * d[:, hits], d[:, hits], leaf)
        return colours

    def _intervals(self, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Both ends of the interval of each ray inside each operand. Shapes: (N, K)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            near, far = zip(*(leaf.interval(o, d) for leaf in self.leaves))
        return np.stack(near, 1), np.stack(far, 1)

    def _pieces(self, near: np.ndarray, far: np.ndarray, most: Any) -> Pieces:
        """The pieces of rays with these intervals, between 0 and `most`."""
        missed = ~(near < far)
        near, far = np.where(missed, np.inf, near), np.where(missed, np.inf, far)
        ends = np.concatenate([near, far], 1)
        order = np.argsort(ends, axis=1, kind="stable")
        t = np.take_along_axis(np.clip(ends, 0, most), order, 1)
        begin, end = t[:, :-1], t[:, 1:]
        # A piece that ends at infinity is outside all operands.
        long = (end > begin) & np.isfinite(end)
        middle = np.where(long, begin / 2 + end / 2, -1)
        inside = ((near[:, k, None] < middle) & (middle < far[:, k, None]) for k in range(near.shape[1]))
        return Pieces(t, order % near.shape[1], long & self.node.inside(inside))

    def _shaded(self, p: np.ndarray, d: np.ndarray, leaf: np.ndarray) -> np.ndarray:
        """Colours at points p of the surface, seen along d. leaf: the operand on whose surface each point lies.

        Shapes: p and d (3, N), leaf (N,), result (N, 3).
        """
        n, paint = np.empty_like(p), np.empty((p.shape[1], 3), L)
        for k, solid in enumerate(self.leaves):
            if (mine := leaf == k).any():
                n[:, mine], paint[mine] = solid.normal(p[:, mine]), COLOURS[solid.colour]
        n = np.where((n * d).sum(0) > 0, -n, n)
        l = self.lamp - p
        distance = np.sqrt((l * l).sum(0))
        cosine = np.maximum((n * l).sum(0) / distance, 0)
        lit = np.where(self._shadowed(p, l, leaf), 0, cosine)
        return paint * (L(AMBIENT) + L(DIFFUSE) * lit)[:, None]

    def _shadowed(self, p: np.ndarray, l: np.ndarray, leaf: np.ndarray) -> np.ndarray:
        """Whether the solid lies between points p of its surface and the lamp. l: the way to the lamp."""
        near, far = self._intervals(p, l)
        rays = np.arange(len(leaf))
        # p is on the operand `leaf`: that end of its interval is exactly 0, but computed with rounding.
        at_near = abs(near[rays, leaf]) <= abs(far[rays, leaf])
        near[rays, leaf] = np.where(at_near, 0, near[rays, leaf])
        far[rays, leaf] = np.where(at_near, far[rays, leaf], 0)
        return self._pieces(near, far, L(1)).solid.any(1)
