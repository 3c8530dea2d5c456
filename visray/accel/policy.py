"""The policy of acceleration: how rays find the rows that they hit. Kernels follow it, and `visray explain` shows it.

There are three ways. Unrolled: the guards of the rows stand in the kernel's code one after the other. Looped: a loop
tests all rows. Tree: rays walk through a bounding volume hierarchy. All give the same answers, bit for bit.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Accelerator = Literal["auto", "none", "tree"]

# At most this many rows are unrolled; more are put in the tree. An unrolled row costs a few cycles per ray, but about a
# millisecond of compile time wherever rays start.
MAX_UNROLLED = 32
# The same for rays that share their origin, whose guards are computed in advance (reference/bench_mitsuba.py: 100
# spheres take 0.7 times as long as in a tree, and 200 spheres take as long).
MAX_UNROLLED_SHARED = 128
# For batches of at most this many rows the exact tests are unrolled too, not only the guards.
MAX_INLINED = 12


@dataclass(frozen=True)
class BatchSize:
    """A batch as the policy sees it: its number of rows, and whether they are bounded."""

    rows: int
    bounded: bool


@dataclass(frozen=True)
class Plan:
    """How rays find rows: the numbers of the batches that go each way.

    unrolled, looped, tree: numbers of batches, ascending.
    reason: why, as `visray explain` says it.
    """

    unrolled: tuple[int, ...]
    looped: tuple[int, ...]
    tree: tuple[int, ...]
    reason: str

    @property
    def name(self) -> str:
        """The plan in a few words, as `visray explain` shows it."""
        batches_of = {"one by one": self.unrolled, "in a loop": self.looped, "in a tree": self.tree}
        return ", others ".join(words for words, batches in batches_of.items() if batches) or "no objects"


def plan(sizes: Sequence[BatchSize], accelerator: Accelerator, shared: bool) -> Plan:
    """How rays find the rows of all batches. shared: the rays share one origin."""
    numbers = range(len(sizes))
    limit = MAX_UNROLLED_SHARED if shared else MAX_UNROLLED
    bounded = [i for i in numbers if sizes[i].bounded]
    small = {i for i in numbers if sizes[i].rows <= limit}
    endless = "; infinite planes are never in the tree" if len(bounded) < len(sizes) else ""
    if accelerator == "none":
        few = {i for i in numbers if sizes[i].rows <= MAX_INLINED}
        return _plan(numbers, few, set(), "settings.accelerator is none: every object is tested")
    if accelerator == "tree":
        return _plan(numbers, small - set(bounded), set(bounded), f"settings.accelerator is tree{endless}")
    total = sum(sizes[i].rows for i in bounded)
    if total <= limit:
        return _plan(numbers, small, set(), f"{total} bounded objects, at most {limit}: each is tested")
    # One tree serves all rays, so it holds the rows that are too many for rays without a shared origin.
    unrolled: set[int] = set()
    for i in sorted(bounded, key=lambda i: sizes[i].rows):
        if sum(sizes[j].rows for j in unrolled) + sizes[i].rows <= MAX_UNROLLED:
            unrolled.add(i)
    tree = set(bounded) - unrolled
    return _plan(numbers, small - tree, tree, f"{total} bounded objects, more than {limit}{endless}")


def _plan(numbers: range, unrolled: set[int], tree: set[int], reason: str) -> Plan:
    """The plan in which batches that are neither unrolled nor in the tree are looped over."""
    looped = (i for i in numbers if i not in unrolled | tree)
    return Plan(tuple(sorted(unrolled)), tuple(looped), tuple(sorted(tree)), reason)
