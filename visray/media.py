"""Media on both sides of a refracting surface. Transparent solids may be nested or overlap."""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.accel import policy
from visray.accel.culling import touches
from visray.batches import Batch
from visray.interaction import Interaction
from visray.kernel_scene import KernelScene
from visray.pytree import detached, leaves, rows
from visray.ray import NO_ROW


@dataclass(frozen=True)
class Interface:
    """The interface between two media at a refracting surface.

    ratio: index of refraction on the viewer's side divided by the index on the other side
    hidden: mask of the lanes in which the surface is invisible, because it lies inside a transparent solid whose index
        of refraction counts there; None in scenes without nested media
    """

    ratio: Any
    hidden: Any


def local_weight(s: KernelScene, si: Interaction, interface: Interface | None) -> Any:
    """Weight of the surface's own colour: 1 - kt, or 1 if settings.local is "full"; 0 in lanes in which the surface is
    hidden. None in scenes without refraction."""
    if not s.features["refraction"]:
        return None
    kt = si.material.kt
    weight = 1 - kt if s.settings.local == "weighted" else s.a.V(1) + 0 * kt
    if interface is None or interface.hidden is None:
        return weight
    return dr.select(interface.hidden, 0, weight)


@dataclass(frozen=True)
class Medium:
    """The medium on one side of a surface. A solid fills this side, or air.

    solid: index of refraction. If derivatives are asked for, the row of the solid instead, NO_ROW for air: a loop over
        solids does not carry derivatives, and `_ior` reads the index after it
    rank: place of the solid in the order of solids (nesting.py); NO_ROW for air
    """

    solid: Any
    rank: Any

    def with_solid(self, where: Any, solid: Any, rank: Any) -> "Medium":
        """The medium after one more solid is considered. If solids overlap, the solid with the lowest rank counts.

        where: mask of the lanes in which the solid fills this side
        solid, rank: those of the solid
        """
        replaces = where & (rank < self.rank)
        return Medium(dr.select(replaces, solid, self.solid), dr.select(replaces, rank, self.rank))


def interface_at(s: KernelScene, si: Interaction) -> Interface | None:
    """The interface at a surface; None in scenes without refraction.

    If transparent solids overlap, the index of refraction is that of the solid with the lowest rank: the one with the
    highest priority; of equal priorities, the smallest one. So an inner solid counts, whatever its place in the file.
    """
    if not s.features["refraction"]:
        return None
    a, n = s.a, dr.width(si.surface.p)
    closed_batches = [b for b in s.batches if b.kind.closed]
    closed = dr.full(a.B, False, n)
    for batch in closed_batches:
        closed |= batch.has(si.hit.row)
    # A flat object has no inside: light passes straight through it, unless a solid's surface lies at the same point.
    near, far = (dr.select(closed & side, a.D(si.material.ior), 1) for side in (si.from_inside, ~si.from_inside))
    if not s.features["nested media"]:
        return Interface(near / far, None)
    rank = dr.full(a.U, NO_ROW, n)
    for batch in closed_batches:
        own = batch.has(si.hit.row)
        rank = dr.select(own, dr.gather(a.U, batch.rank, dr.select(own, si.hit.row - batch.first_row, 0)), rank)
    if s.attached:
        near, far = (dr.select(closed & side, si.hit.row, NO_ROW) for side in (si.from_inside, ~si.from_inside))
    near_side = Medium(near, dr.select(si.from_inside, rank, NO_ROW))
    far_side = Medium(far, dr.select(si.from_inside, NO_ROW, rank))
    for batch in closed_batches:
        near_side, far_side = _nested_media(s, si, batch, near_side, far_side)
    hidden = closed & (near_side.rank == far_side.rank) & (max_component(si.material.kt) > 0)
    return Interface(_ior(s, near_side) / _ior(s, far_side), hidden)


def _ior(s: KernelScene, medium: Medium) -> Any:
    """The index of refraction of a medium."""
    if not s.attached:
        return medium.solid
    ior = s.a.D(1)
    for batch in (b for b in s.batches if b.kind.closed):
        own = batch.has(medium.solid)
        index = dr.select(own, medium.solid - batch.first_row, 0)
        ior = dr.select(own, s.a.D(rows(batch.material.ior, batch.object_at(index))), ior)
    return ior


def _nested_media(
    s: KernelScene, si: Interaction, batch: Batch, near_side: Medium, far_side: Medium
) -> tuple[Medium, Medium]:
    """The media on both sides (viewer's side first) after all other solids of a batch are considered.

    A solid whose surface contains the point, to within rounding, fills only one side: the viewer's side if the ray
    leaves the solid there, the other side if the ray enters it.
    """
    size = len(batch)
    batch = detached(batch) if s.attached else batch

    def step(i: Any, *state: Any) -> tuple:
        near_side, far_side = Medium(*state[:2]), Medium(*state[2:])
        row_batch, material = batch.rows_at(i), rows(batch.material, i)
        p, row = dr.detach(si.surface.p), i + batch.first_row
        f, g = batch.kind.surface_at(row_batch.placed, p)
        other_solid = (max_component(material.kt) > 0) & (si.hit.row != row)
        flush, leaves_solid = (
            touches(row_batch, f, g, p, dr.detach(si.surface.error)),
            dr.dot(g, s.a.W(dr.detach(si.d))) > 0,
        )
        inside, solid = batch.kind.inside(row_batch.placed, p), (row if s.attached else material.ior, row_batch.rank)
        near_side = near_side.with_solid(other_solid & dr.select(flush, leaves_solid, inside), *solid)
        far_side = far_side.with_solid(other_solid & dr.select(flush, ~leaves_solid, inside), *solid)
        return (*leaves(near_side), *leaves(far_side))

    state = (*leaves(near_side), *leaves(far_side))
    if size > policy.MAX_INLINED or (size > 1 and (batch.kind.walks or s.attached)):
        state = s.loop(dr.opaque(s.a.U, size), si.hit.valid, state, step)
    else:
        for i in range(size):
            state = step(s.a.U(i), *state)
    return Medium(*state[:2]), Medium(*state[2:])


def max_component(colour: Any) -> Any:
    """The largest component of a colour, detached; 0 if the colour is black."""
    c = dr.detach(colour)
    return dr.maximum(dr.maximum(c.x, c.y), c.z)
