"""Clusters: large groups of operands, split into small ones that lie near each other.

A ray meets few of many operands. So a group is looped over in two or more steps: first over clusters, then over the
operands of those whose ball the ray meets. Clusters change only how the kernel loops, and no result.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from visray.primitives.csg_bounds import hull_of_tree, leaf_hull
from visray.primitives.csg_form import Form, Leaf, Node

# Largest number of children in a cluster, and in a group that is not split.
CLUSTER, UNSPLIT = 8, 16


def clustered(form: Form) -> Form:
    """The structure with its large groups split."""
    within = None if form.within is None else _clustered(form.within)
    return replace(form, surface=_clustered(form.surface), within=within)


def _clustered(tree: Any) -> Any:
    """The tree with its large groups split."""
    if isinstance(tree, Leaf):
        return tree
    groups = tuple(_levels(tree.both, tuple(map(_clustered, group))) for group in tree.groups)
    return replace(tree, groups=groups)


def _levels(both: bool, group: tuple) -> tuple:
    """The children of a group, in clusters of clusters if there are many."""
    while len(group) > UNSPLIT and group[0].site.localized:
        centres = np.array([_hull(x).centre for x in group])
        group = tuple(Node(both, (tuple(group[i] for i in part),), True) for part in split(centres))
    return group


def _hull(tree: Any) -> Any:
    """The hull of a tree, as hull_of_tree."""
    return hull_of_tree(tree, {leaf.number: leaf_hull(leaf) for leaf in _leaves(tree)})


def _leaves(tree: Any) -> list[Leaf]:
    """The leaves of a tree."""
    return [tree] if isinstance(tree, Leaf) else [leaf for x in tree.children for leaf in _leaves(x)]


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
