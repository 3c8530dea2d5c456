"""The stack of rays that walk through a tree: the children of nodes that a ray has still to visit.

A lane is one entry of a Dr.Jit array; here it is one ray. An entry holds the children of one node that are left, the
next one first. It has 32 bits: 24 for the number of the block of the node's first child; then, for the children that
are left, their number minus 1 (2 bits), and their places among the node's children (2 bits each, from the lowest bits).

The REGISTERS top entries of a lane are separate arrays, because a packet shifts an array with one instruction. Memory
with a computed address costs each lane several. If more entries are pushed, the lowest ones go to memory (`local`).
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.accel.hierarchy import MOST_LEVELS

REGISTERS = 8
EMPTY = 0xFFFFFFFF  # what stands in the place of an entry if there is none
NUMBER_BITS, SLOT_BITS = 8, 6  # bits below the number of the block, and below the number of children


@dataclass(frozen=True)
class Stack:
    """The stack of each lane.

    entries: the top entries, the uppermost first.
    local: memory for all other entries, the lowest first.
    spilled: number of entries in `local`.
    """

    u: Any
    entries: tuple[Any, ...]
    local: Any
    spilled: Any

    @staticmethod
    def empty(u: Any, n: int) -> "Stack":
        """The empty stack of n lanes. u: type of unsigned integers."""
        # A ray pushes at most one entry per level of the tree.
        local = dr.alloc_local(u, MOST_LEVELS - REGISTERS, value=dr.zeros(u, n))
        return Stack(u, tuple(dr.full(u, EMPTY, n) for _ in range(REGISTERS)), local, dr.zeros(u, n))

    @property
    def arrays(self) -> tuple[Any, ...]:
        """The stack as a part of the state of a loop."""
        return *self.entries, self.local, self.spilled

    @staticmethod
    def read(u: Any, state: tuple) -> tuple["Stack", tuple]:
        """(the stack at the beginning of the state of a loop, the rest of that state)."""
        return Stack(u, state[:REGISTERS], *state[REGISTERS : REGISTERS + 2]), state[REGISTERS + 2 :]

    @staticmethod
    def entry(first_child: Any, places: Any, count: Any) -> Any:
        """The entry for children of one node.

        first_child: number of the block of the node's first child.
        places: places of the children among the node's children, from the lowest bits.
        count: number of the children, from 1 to 3.
        """
        return (first_child << NUMBER_BITS) | ((count - 1) << SLOT_BITS) | places

    def moved(self, pushes: Any, entry: Any, pops: Any) -> tuple["Stack", Any]:
        """(the stack after each lane pushes an entry, or takes one child from the uppermost entry, or does neither; the
        block of that child, or EMPTY).

        pushes: mask of the lanes that push `entry`.
        pops: mask of the lanes that take a child. No lane does both.
        """
        u, top, below = self.u, self.entries[0], (*self.entries[1:], self.u(EMPTY))
        nothing, more = top == EMPTY, (top >> SLOT_BITS) & 3
        child = dr.select(nothing, top, (top >> NUMBER_BITS) + (top & 3))
        places = (top >> 2) & 15
        rest = dr.select(nothing, top, (top & (EMPTY << NUMBER_BITS & EMPTY)) | ((more - 1) << SLOT_BITS) | places)
        removes = pops & (more == 0)
        kept = dr.select(pops, rest, top), *self.entries[1:]
        above = entry, *self.entries[:-1]
        entries = [dr.select(pushes, x, dr.select(removes, z, y)) for x, y, z in zip(above, kept, below)]
        spills, fills = pushes & (self.entries[-1] != EMPTY), removes & (self.spilled != 0)

        def exchange(local: Any, last: Any, spilled: Any) -> tuple:
            local.write(self.entries[-1], spilled, spills)
            filled = local.read(dr.select(fills, spilled - 1, 0), fills)
            spilled = dr.select(spills, spilled + 1, dr.select(fills, spilled - 1, spilled))
            return local, dr.select(fills, filled, last), spilled

        local, entries[-1], spilled = dr.if_stmt(
            (self.local, entries[-1], self.spilled), spills | fills, exchange, lambda *same: same, label="spill"
        )
        return Stack(u, tuple(entries), local, spilled), child
