"""Which accelerator serves which rays: one decision, that kernels follow and `visray explain` shows.

Three ways lead to a row. Written out: its guard is in the kernel's code, one after the other. Looped: rows are asked in
a loop. Tree: rows are found in a bounding volume hierarchy. (Lists of rows by cells of directions, for rays that share
an origin, have their place here when they come.) Every way gives the same answers, bit for bit.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Accelerator = Literal["auto", "none", "tree"]

# So many rows are written out; more hang in the tree. Written out they cost a few cycles each, but each takes a
# millisecond to compile, wherever rays start anew.
MAX_UNROLLED = 32
# For rays that share their origin, whose guards are made before, it pays for four times as many (reference/
# bench_mitsuba.py: 100 spheres take 0.7 of the time that they take in a tree, 200 as much).
MAX_UNROLLED_SHARED = 128
# Up to so many of a batch, not only their guards but all that is done with them.
MAX_INLINED = 12


@dataclass(frozen=True)
class BatchSize:
    """A batch as the policy sees it."""

    rows: int
    bounded: bool


@dataclass(frozen=True)
class Plan:
    """The numbers of the batches that are written out, looped over, and in the tree, and why, in words."""

    unrolled: tuple[int, ...]
    looped: tuple[int, ...]
    tree: tuple[int, ...]
    reason: str

    @property
    def name(self) -> str:
        """What it is called."""
        ways = {"one by one": self.unrolled, "in a loop": self.looped, "in a tree": self.tree}
        return ", others ".join(way for way, batches in ways.items() if batches) or "nothing to find"


def plan(sizes: Sequence[BatchSize], accelerator: Accelerator, shared: bool) -> Plan:
    """How rays find rows. shared: they share their origin."""
    numbers = range(len(sizes))
    limit = MAX_UNROLLED_SHARED if shared else MAX_UNROLLED
    bounded = [i for i in numbers if sizes[i].bounded]
    small = {i for i in numbers if sizes[i].rows <= limit}
    endless = "; endless planes are in no tree" if len(bounded) < len(sizes) else ""
    if accelerator == "none":
        few = {i for i in numbers if sizes[i].rows <= MAX_INLINED}
        return _plan(numbers, few, set(), "settings.accelerator is none: every object is asked")
    if accelerator == "tree":
        return _plan(numbers, small - set(bounded), set(bounded), f"settings.accelerator is tree{endless}")
    total = sum(sizes[i].rows for i in bounded)
    if total <= limit:
        return _plan(numbers, small, set(), f"{total} objects that have an end, at most {limit}: each is asked")
    # The tree is the same for all rays: it holds what is too much for those that share no origin.
    written: set[int] = set()
    for i in sorted(bounded, key=lambda i: sizes[i].rows):
        if sum(sizes[j].rows for j in written) + sizes[i].rows <= MAX_UNROLLED:
            written.add(i)
    tree = set(bounded) - written
    return _plan(numbers, small - tree, tree, f"{total} objects that have an end, more than {limit}{endless}")


def _plan(numbers: range, written: set[int], tree: set[int], reason: str) -> Plan:
    """The plan where what is neither written out nor in the tree is looped over."""
    looped = (i for i in numbers if i not in written | tree)
    return Plan(tuple(sorted(written)), tuple(looped), tuple(sorted(tree)), reason)
