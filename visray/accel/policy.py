"""The policy of acceleration: how rays find the rows that they hit. Kernels follow it, and `visray explain` shows it.

A row is one object, or one triangle of a mesh, in the kernel's tables. A batch is a set of rows of one kind, which
share code. The policy chooses one of four methods for each batch. All methods give the same results, bit for bit:

    unrolled   the kernel's code contains a test for each row, one after the other
    looped     a loop in the kernel tests all rows
    lists      rays that share an origin or a direction look into one cell of a grid, which lists the rows to test
    tree       rays walk through a bounding volume hierarchy
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Accelerator = Literal["auto", "none", "lists", "tree"]
# What all rays of a family share, such as all rays of a pinhole camera: their origin, their direction, or neither.
SharedBy = Literal["origin", "direction", "nothing"]

# The greatest number of rows that are unrolled. If a scene has more, batches are put in lists or in the tree. An
# unrolled row costs a few cycles per ray, and about a millisecond of compile time for each place of the kernel where
# rays start.
MAX_UNROLLED = 32
# The same number for rays that share an origin and may not use lists.
MAX_UNROLLED_SHARED = 128
# In a batch of at most this many rows, the exact tests are unrolled too, and not only the guards.
MAX_INLINED = 12


@dataclass(frozen=True)
class BatchSize:
    """The facts about one batch that the policy depends on.

    rows: number of rows.
    bounded: whether the rows have bounding boxes.
    """

    rows: int
    bounded: bool


@dataclass(frozen=True)
class Plan:
    """The method that is chosen for each batch.

    unrolled, looped, lists, tree: numbers of the batches with this method, ascending.
    reason: why the plan was chosen, one line for `visray explain`.
    """

    unrolled: tuple[int, ...]
    looped: tuple[int, ...]
    lists: tuple[int, ...]
    tree: tuple[int, ...]
    reason: str

    @property
    def name(self) -> str:
        """The plan in a few words, for `visray explain`."""
        batches_of = {
            "one by one": self.unrolled, "in a loop": self.looped, "in lists": self.lists, "in a tree": self.tree,
        }  # fmt: skip
        return ", others ".join(words for words, batches in batches_of.items() if batches) or "no objects"


def plan(sizes: Sequence[BatchSize], accelerator: Accelerator, shared: SharedBy) -> Plan:
    """The plan for all batches of a scene.

    sizes: the batches, in the order of their numbers.
    shared: what all rays share.
    """
    numbers = range(len(sizes))
    listed = shared != "nothing" and accelerator in ("auto", "lists")
    limit = MAX_UNROLLED_SHARED if shared == "origin" and not listed else MAX_UNROLLED
    bounded = [i for i in numbers if sizes[i].bounded]
    small = {i for i in numbers if sizes[i].rows <= limit}
    where = "lists" if listed else "the tree"
    endless = f"; infinite planes are never in {where}" if len(bounded) < len(sizes) else ""
    if accelerator == "none":
        few = {i for i in numbers if sizes[i].rows <= MAX_INLINED}
        return _plan(numbers, few, (), (), "settings.accelerator is none: every object is tested")
    if accelerator == "tree" or (accelerator == "lists" and listed):
        lists, tree = (bounded, ()) if listed else ((), bounded)
        return _plan(numbers, small - set(bounded), lists, tree, f"settings.accelerator is {accelerator}{endless}")
    total = sum(sizes[i].rows for i in bounded)
    count = "1 bounded object" if total == 1 else f"{total} bounded objects"
    if total <= limit:
        return _plan(numbers, small, (), (), f"{count}, at most {limit}: each is tested")
    # One tree serves all rays. So the bounded batches outside it have at most MAX_UNROLLED rows together, also for rays
    # with a shared origin.
    unrolled: set[int] = set()
    for i in sorted(bounded, key=lambda i: sizes[i].rows):
        if sum(sizes[j].rows for j in unrolled) + sizes[i].rows <= MAX_UNROLLED:
            unrolled.add(i)
    rest = set(bounded) - unrolled
    lists, tree = (rest, ()) if listed else ((), rest)
    shares = f", and all rays have one {shared}" if listed else ""
    return _plan(numbers, small - rest, lists, tree, f"{count}, more than {limit}{shares}{endless}")


def _plan(numbers: range, unrolled: set[int], lists: Sequence[int], tree: Sequence[int], reason: str) -> Plan:
    """The plan with the given batches unrolled, in lists and in the tree, and all other batches looped."""
    looped = (i for i in numbers if i not in {*unrolled, *lists, *tree})
    return Plan(*(tuple(sorted(x)) for x in (unrolled, looped, lists, tree)), reason)
