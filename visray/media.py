"""Media on both sides of a refracting surface, where transparent solids may be nested or overlap."""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.accel import policy
from visray.accel.culling import touches
from visray.batches import Batch
from visray.interaction import Interaction
from visray.kernel_scene import KernelScene
from visray.pytree import leaves, rows
from visray.ray import NO_ROW


@dataclass(frozen=True)
class Interface:
    """The interface between two media at a refracting surface.

    ratio: index of refraction on the viewer's side divided by that on the other side
    hidden: whether the surface is invisible, because it lies inside a smaller transparent solid, whose index holds
        there; None in scenes without nested media
    """

    ratio: Any
    hidden: Any


def local_weight(s: KernelScene, si: Interaction, interface: Interface | None) -> Any:
    """Weight of the surface's own colour: 1 - kt, or 0 where the surface is hidden; None where all weights are 1."""
    if not s.features["refraction"]:
        return None
    kt = si.material.kt
    weight = 1 - kt if s.settings.local == "weighted" else s.a.V(1) + 0 * kt
    if interface is None or interface.hidden is None:
        return weight
    return dr.select(interface.hidden, 0, weight)


@dataclass(frozen=True)
class Medium:
    """The medium on one side of a surface.

    ior: index of refraction
    size: radius of the bounding ball of the solid that fills the side; inf outside all solids
    row: row of this solid, NO_ROW outside all solids
    """

    ior: Any
    size: Any
    row: Any

    def with_solid(self, where: Any, ior: Any, size: Any, row: Any) -> "Medium":
        """The medium with one more solid considered. Of overlapping solids the index of the smaller one holds; of
        equally large ones, that of the first.

        where: lanes in which the solid fills the side
        """
        replaces = where & ((size < self.size) | ((size == self.size) & (row < self.row)))
        return Medium(*(dr.select(replaces, x, y) for x, y in ((ior, self.ior), (size, self.size), (row, self.row))))


def interface_at(s: KernelScene, si: Interaction) -> Interface | None:
    """The interface at a surface. Where transparent solids overlap, the index of the smaller one holds, by their
    bounding balls. So an inner solid counts, wherever it stands in the scene file."""
    if not s.features["refraction"]:
        return None
    a, n = s.a, dr.width(si.surface.p)
    air = Medium(dr.full(a.D, 1, n), dr.full(a.D, dr.inf, n), dr.full(a.U, NO_ROW, n))
    near_side, far_side = air, air
    closed = dr.full(a.B, False, n)
    for batch in (b for b in s.batches if b.kind.closed):
        in_batch = batch.has(si.hit.row)
        closed |= in_batch
        size = dr.gather(a.D, batch.radius, dr.select(in_batch, si.hit.row - batch.first_row, 0))
        solid = si.material.ior, size, si.hit.row
        near_side = near_side.with_solid(in_batch & si.from_inside, *solid)
        far_side = far_side.with_solid(in_batch & ~si.from_inside, *solid)
        if s.features["nested media"]:
            near_side, far_side = _nested_media(s, si, batch, near_side, far_side)
    # A flat object has no inside: light passes straight through it, except where a solid begins or ends flush with it.
    ratio = near_side.ior / far_side.ior
    if not s.features["nested media"]:
        return Interface(ratio, None)
    return Interface(ratio, closed & (near_side.row == far_side.row) & (max_component(si.material.kt) > 0))


def _nested_media(
    s: KernelScene, si: Interaction, batch: Batch, near_side: Medium, far_side: Medium
) -> tuple[Medium, Medium]:
    """The media on both sides (viewer's side first) with all other solids of a batch considered. A solid whose surface
    lies flush with the point fills one side or the other, depending on whether the ray leaves or enters it there."""
    size = len(batch)

    def step(i: Any, *state: Any) -> tuple:
        near_side, far_side = Medium(*state[:3]), Medium(*state[3:])
        row_batch, material = batch.rows_at(i), rows(batch.material, i)
        p, row = dr.detach(si.surface.p), i + batch.first_row
        f, g = batch.kind.surface_at(row_batch.placed, p)
        other_solid = (max_component(material.kt) > 0) & (si.hit.row != row)
        flush, leaves_solid = touches(row_batch, f, g, p, si.surface.error), dr.dot(g, s.a.W(dr.detach(si.d))) > 0
        inside, solid = batch.kind.inside(row_batch.placed, p), (material.ior, row_batch.radius, row)
        near_side = near_side.with_solid(other_solid & dr.select(flush, leaves_solid, inside), *solid)
        far_side = far_side.with_solid(other_solid & dr.select(flush, ~leaves_solid, inside), *solid)
        return (*leaves(near_side), *leaves(far_side))

    state = (*leaves(near_side), *leaves(far_side))
    if size > policy.MAX_INLINED:
        state = s.loop(size, dr.opaque(s.a.U, size), si.hit.valid, state, step)
    else:
        for i in range(size):
            state = step(s.a.U(i), *state)
    return Medium(*state[:3]), Medium(*state[3:])


def max_component(colour: Any) -> Any:
    """The largest component of a colour, detached; 0 where the colour is black."""
    c = dr.detach(colour)
    return dr.maximum(dr.maximum(c.x, c.y), c.z)
