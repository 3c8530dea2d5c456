"""Media on both sides of a surface, and what they do to light. Transparent solids may be nested or overlap."""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray import fresnel
from visray.absorption import let_through
from visray.accel import policy
from visray.accel.culling import touches
from visray.batches import Batch
from visray.interaction import Interaction
from visray.kernel_scene import KernelScene
from visray.materials import DIELECTRIC, METAL
from visray.pytree import detached, leaves, rows
from visray.ray import NO_ROW


@dataclass(frozen=True)
class Interface:
    """The interface between two media at a surface.

    ratio: index of refraction on the viewer's side divided by the index on the other side; None in scenes without
        refraction
    hidden: mask of the lanes in which the surface is invisible, because it lies inside a transparent solid whose index
        of refraction counts there; None in scenes without nested media
    share: what `fresnel` takes from the surface's own colour and from kt, a number from 0 to 1 (fresnel_share); None in
        scenes without this effect
    absorption: that of the medium on the viewer's side, a colour; None in scenes without absorption
    """

    ratio: Any = None
    hidden: Any = None
    share: Any = None
    absorption: Any = None


def local_weight(s: KernelScene, si: Interaction, interface: Interface | None) -> Any:
    """Weight of the surface's own colour: (1 - share) (1 - kt), or 1 if settings.local is "full"; 0 in lanes in which
    the surface is hidden. None in scenes without refraction and fresnel, where it is 1."""
    if interface is None or (interface.ratio is None and interface.share is None):
        return None
    weight = s.a.V(1)
    if interface.ratio is not None:
        weight = 1 - si.material.kt if s.settings.local == "weighted" else s.a.V(1) + 0 * si.material.kt
    if interface.share is not None and s.settings.local == "weighted":
        weight = weight * (1 - interface.share)
    return weight if interface.hidden is None else dr.select(interface.hidden, 0, weight)


def reflected_share(si: Interaction, interface: Interface | None) -> Any:
    """The share of light that the surface reflects like a mirror, a colour: kr, as `fresnel` changes it."""
    kr, share = si.material.kr, interface and interface.share
    if share is None:
        return kr
    return dr.select(si.material.fresnel == DIELECTRIC, kr * share, kr + (1 - kr) * share)


def refracted_share(si: Interaction, interface: Interface) -> Any:
    """The share of light that passes through the surface, a colour: kt, as `fresnel` changes it."""
    return si.material.kt if interface.share is None else si.material.kt * (1 - interface.share)


def transmitted(s: KernelScene, si: Interaction, interface: Interface | None, lamp: Any = None) -> Any:
    """The share of light that the medium on the viewer's side lets through on the way from the surface to the ray's
    origin, a colour; 1 in lanes without a hit. None in scenes without absorption.

    lamp: visible lights (SeenLight) that the ray meets before the surface, from which its way then starts; or None
    """
    if interface is None or interface.absorption is None:
        return None
    length = dr.dot(si.surface.p - si.o, si.d) if s.attached else si.hit.t
    length = length if lamp is None else dr.select(lamp.met, lamp.distance, length)
    return let_through(interface.absorption, dr.select(si.hit.valid, length, 0))


def mirror_normal(si: Interaction) -> tuple[Any, Any]:
    """The normal at which a ray is reflected and refracted, and the normal of the surface itself, both in double and on
    the side that the ray comes from."""
    face = dr.select(si.from_inside, -si.surface.exact, si.surface.exact)
    if si.face is None:
        return face, face
    n = dr.select(si.from_inside, -si.surface.shading, si.surface.shading)
    return dr.select(dr.dot(n, si.d) < 0, n, face), face


@dataclass(frozen=True)
class Medium:
    """The medium on one side of a surface. A solid fills this side, or air.

    solid: index of refraction. If more than this is asked for (_needs_rows), the row of the solid instead, NO_ROW for
        air
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
    """The interface at a surface; None in scenes without refraction and fresnel.

    If transparent solids overlap, the medium is that of the solid with the lowest rank: the one with the highest
    priority; of equal priorities, the smallest one. So an inner solid counts, whatever its place in the file.
    """
    if not s.features["refraction"]:
        return Interface(share=_fresnel_share(s, si, None, None, 1)) if s.features["fresnel"] else None
    a, n = s.a, dr.width(si.surface.p)
    closed_batches = [b for b in s.batches if b.kind.closed]
    closed = dr.full(a.B, False, n)
    for batch in closed_batches:
        closed |= batch.has(si.hit.row)
    # A flat object has no inside: light passes straight through it, unless a solid's surface lies at the same point.
    near, far = (dr.select(closed & side, a.D(si.material.ior), 1) for side in (si.from_inside, ~si.from_inside))
    if not s.features["nested media"]:
        absorption = None
        if s.features["absorption"]:
            own = closed & si.from_inside & (max_component(si.material.kt) > 0)
            absorption = dr.select(own, si.material.absorption, 0)
        return _interface(s, si, closed, near, far, None, absorption)
    rank = dr.full(a.U, NO_ROW, n)
    for batch in closed_batches:
        own = batch.has(si.hit.row)
        rank = dr.select(own, dr.gather(a.U, batch.rank, dr.select(own, si.hit.row - batch.first_row, 0)), rank)
    if _needs_rows(s):
        near, far = (dr.select(closed & side, si.hit.row, NO_ROW) for side in (si.from_inside, ~si.from_inside))
    near_side = Medium(near, dr.select(si.from_inside, rank, NO_ROW))
    far_side = Medium(far, dr.select(si.from_inside, NO_ROW, rank))
    for batch in closed_batches:
        near_side, far_side = _nested_media(s, si, batch, near_side, far_side)
    hidden = closed & (near_side.rank == far_side.rank) & (max_component(si.material.kt) > 0)
    absorption = _absorption(s, near_side) if s.features["absorption"] else None
    return _interface(s, si, closed, _ior(s, near_side), _ior(s, far_side), hidden, absorption)


def _interface(
    s: KernelScene, si: Interaction, closed: Any, near: Any, far: Any, hidden: Any, absorption: Any
) -> Interface:
    """The interface between media with the indices of refraction `near` and `far`. closed: mask of the lanes whose
    surface is that of a solid."""
    ratio, share = near / far, None
    if s.features["fresnel"]:
        share = _fresnel_share(s, si, closed, ratio, near)
    return Interface(ratio, hidden, share, absorption)


def _fresnel_share(s: KernelScene, si: Interaction, closed: Any, ratio: Any, near: Any) -> Any:
    """The field `share` of an Interface: for "dielectric", the reflectance F; for "metal", the weight of Schlick; for
    "none", and for materials without kr and kt, 0.

    At an opaque surface, F is that of an interface between the medium in front of it and a medium of its own index. The
    inside of an opaque solid is air. A transparent surface that is open is a thin sheet of its own index.

    closed, near: as in `_interface`; closed is None in scenes without refraction
    ratio: that of the interface
    """
    m, cosine = si.material, dr.maximum(-dr.dot(mirror_normal(si)[0], si.d), 0)
    if closed is None:
        share = fresnel.dielectric(cosine, near / s.a.D(m.ior))
    else:
        clear = max_component(m.kt) > 0
        around = dr.select(closed & si.from_inside, 1, near)
        share = fresnel.dielectric(cosine, dr.select(closed & clear, ratio, around / s.a.D(m.ior)))
        share = dr.select(clear & ~closed, fresnel.thin_sheet(share), share)
    share = dr.select(m.fresnel == METAL, fresnel.schlick(cosine), share)
    strengths = [max_component(x) for x, on in ((m.kr, "reflection"), (m.kt, "refraction")) if s.features[on]]
    return s.a.F(dr.select((m.fresnel > 0) & (sum(strengths) > 0), share, 0))


def _needs_rows(s: KernelScene) -> bool:
    """Whether media are found as rows of solids, and their numbers are read afterwards: a loop over solids does not
    carry derivatives, and carries few numbers faster than many."""
    return s.attached or s.features["absorption"]


def _ior(s: KernelScene, medium: Medium) -> Any:
    """The index of refraction of a medium."""
    return _of_solid(s, medium, "ior", s.a.D(1)) if _needs_rows(s) else medium.solid


def _absorption(s: KernelScene, medium: Medium) -> Any:
    """The absorption of a medium, a colour. The inside of an opaque solid absorbs nothing."""
    clear = max_component(_of_solid(s, medium, "kt", s.a.V(0))) > 0
    return dr.select(clear, _of_solid(s, medium, "absorption", s.a.V(0)), 0)


def _of_solid(s: KernelScene, medium: Medium, field: str, in_air: Any) -> Any:
    """A number of the material of the solid that fills a medium.

    in_air: the same for air
    """
    value = in_air
    for batch in (b for b in s.batches if b.kind.closed):
        own = batch.has(medium.solid)
        number = batch.object_at(dr.select(own, medium.solid - batch.first_row, 0))
        value = dr.select(own, type(in_air)(rows(getattr(batch.material, field), number)), value)
    return value


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
        inside, solid = (
            batch.kind.inside(row_batch.placed, p),
            (row if _needs_rows(s) else material.ior, row_batch.rank),
        )
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
