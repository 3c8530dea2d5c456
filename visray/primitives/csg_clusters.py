"""Clusters: large groups of operands, split into small ones that lie near each other.

A ray meets few of many operands. So a group is looped over in two or more steps: first over clusters, then over the
operands of those whose ball the ray meets. Clusters change only how the kernel loops, and no result.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from visray.primitives.csg_bounds import Hull, Trees, hulls_of
from visray.primitives.csg_form import Form, Leaf, Node

# Largest number of children in a cluster, and in a group that is not split. One loop over up to about 48 balls is
# faster than a loop within a loop (reference/csg_growth.py).
CLUSTER, UNSPLIT = 8, 48


def clustered(form: Form) -> Form:
    """The structure with its large groups split."""
    centres = _Centres(form)
    within = None if form.within is None else _clustered(form.within, centres)
    return replace(form, surface=_clustered(form.surface, centres), within=within)


@dataclass(frozen=True)
class _Centres:
    """Where the operands of an object are. form: its structure."""

    form: Form

    @cached_property
    def hulls(self) -> Hull:
        """The hulls of all operands, by the numbers of their leaves."""
        return hulls_of(self.form.leaves)

    def of(self, trees: Sequence[Any]) -> np.ndarray:
        """Centres of the balls of trees. Shape: (N, 3)."""
        return Trees.of(trees).hulls(self.hulls).centre


def _clustered(tree: Any, centres: _Centres) -> Any:
    """The tree with its large groups split."""
    if isinstance(tree, Leaf):
        return tree
    groups = tuple(_levels(tree.both, tuple(_clustered(x, centres) for x in group), centres) for group in tree.groups)
    return replace(tree, groups=groups)


def _levels(both: bool, group: tuple, centres: _Centres) -> tuple:
    """The children of a group, in clusters of clusters if there are many."""
    while len(group) > UNSPLIT and group[0].site.localized:
        group = tuple(Node(both, (tuple(group[i] for i in part),), True) for part in split(centres.of(group)))
    return group


def split(centres: np.ndarray) -> Sequence[np.ndarray]:
    """Indices of points in clusters: a cluster is halved across its longest side until it is small. Shape: (N, 3)."""
    whole, done = [np.arange(len(centres))], []
    while whole:
        part = whole.pop()
        if len(part) <= CLUSTER:
            done.append(np.sort(part))
            continue
        axis = np.ptp(centres[part], axis=0).argmax()
        ordered = part[np.argsort(centres[part, axis], kind="stable")]
        whole += [ordered[len(part) // 2 :], ordered[: len(part) // 2]]
    return done
