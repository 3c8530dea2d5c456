"""Cut edges of CSG: where the surfaces of two operands meet and both belong to the surface of the whole."""

from typing import Any

import numpy as np
from csg_leaves import Leaf
from csg_sets import IN, OUT, UNKNOWN
from csg_trees import rays
from csg_truth import Solid
from samples import dot, norm, real, unit

# Steps of Newton's iteration: of those that converge at all, nearly all do so in ten.
STEPS = 12
# Pairs of leaves that are tried, and points of the first one's visible surface from which edges are looked for.
PAIRS, TRIED = 20, 100


def surface(leaf: Leaf, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(f, gradient of f) of a leaf at world points: a distance to first order, in units of the leaf."""
    f, n = leaf.surface(leaf.local_point(p))
    return f, n @ leaf.from_world


def onto(leaves: tuple[Leaf, ...], p: np.ndarray, steps: int = STEPS) -> tuple[np.ndarray, np.ndarray]:
    """Points moved onto the surfaces of one or two leaves, along the gradients, and what is left of the distance."""
    p = real(p)
    for _ in range(steps):
        f, g = (np.stack(x) for x in zip(*(surface(leaf, p) for leaf in leaves)))
        if len(leaves) == 1:
            p = p - (f[0] / dot(g[0], g[0]))[:, None] * g[0]
            continue
        a, b, c = dot(g[0], g[0]), dot(g[0], g[1]), dot(g[1], g[1])
        whole = a * c - b * b
        whole = np.where(np.abs(whole) > 1e-6 * a * c, whole, np.inf)
        x, y = (c * f[0] - b * f[1]) / whole, (a * f[1] - b * f[0]) / whole
        p = p - x[:, None] * g[0] - y[:, None] * g[1]
    left = np.max([np.abs(surface(leaf, p)[0]) / norm(surface(leaf, p)[1]) for leaf in leaves], 0)
    return p, left


def forced(solid: Solid, p: np.ndarray, states: dict[int, int]) -> np.ndarray:
    """The state of the whole at points if some leaves had other states. states: these, by number of the leaf."""
    return solid.root.value(lambda i: np.full(len(p), states[i]) if i in states else solid.leaves[i].state(p))


def near_edges(rng: np.random.Generator, solid: Solid, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(points of the whole's surface near cut edges, outward unit normals, the number of the leaf they are on).

    Their distances from the edge are 10^-12 to 10^-3. Fewer than `count` where few are found; none without cut edges.
    """
    found: list[tuple[Any, ...]] = []
    start = solid.on(*rays(rng, solid, 6 * TRIED))
    points = start.o + np.where(start.leaf >= 0, start.first.low, 0)[:, None] * start.d
    pairs = [(i, j) for i in np.unique(start.leaf[start.leaf >= 0]) for j in range(len(solid.leaves)) if i != j]
    rng.shuffle(pairs)
    for i, j in pairs[:PAIRS]:
        if sum(len(x[0]) for x in found) >= count:
            break
        p = points[start.leaf == i][:TRIED]
        with np.errstate(all="ignore"):
            p, left = onto((solid.leaves[i], solid.leaves[j]), p)
        p = p[np.isfinite(p).all(1) & (left < 1e-16 * (1 + norm(p)))]
        if len(p):
            found.append(_beside(rng, solid, p, i, j))
    if not found:
        return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, int)
    return tuple(np.concatenate(x)[:count] for x in zip(*found))


def _beside(rng: np.random.Generator, solid: Solid, p: np.ndarray, i: int, j: int) -> tuple[np.ndarray, ...]:
    """As `near_edges`: points of leaf i beside points p of leaves i and j, where both are seen."""
    n, m = (unit(surface(solid.leaves[k], p)[1]) for k in (i, j))
    aside = m - dot(m, n)[:, None] * n
    length = norm(aside)
    aside = aside / np.where(length == 0, 1, length)[:, None]
    off = 10 ** rng.uniform(-12, -3, len(p)) * rng.choice([-1, 1], len(p))
    beside, left = onto((solid.leaves[i],), p + off[:, None] * aside, 4)
    inner, outer = (forced(solid, beside, {i: state}) for state in (IN, OUT))
    # Whether both surfaces belong to the whole's at the edge itself.
    seen = {(a, b): forced(solid, p, {i: a, j: b}) for a in (IN, OUT) for b in (IN, OUT)}
    both = (seen[IN, IN] != seen[OUT, IN]) | (seen[IN, OUT] != seen[OUT, OUT])
    both &= (seen[IN, IN] != seen[IN, OUT]) | (seen[OUT, IN] != seen[OUT, OUT])
    kept = both & (inner != outer) & (inner != UNKNOWN) & (outer != UNKNOWN) & (length > 1e-3) & (left < 1e-16)
    out = np.where((inner == IN)[:, None], n, -n)
    return beside[kept], out[kept], np.full(int(kept.sum()), i)
