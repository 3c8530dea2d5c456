"""What a hit is like: the surface point, its material and its (u, v), with derivatives: the row that a detached search
has found, evaluated anew."""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray.accel import policy
from visray.accel.origin import RayOrigin
from visray.batches import Batch
from visray.geometry import face_forward, gamma, l1_norm
from visray.images import lookup as texturing
from visray.kernel_scene import KernelScene
from visray.materials import Material
from visray.pack import NO_TEXTURE
from visray.pytree import leaves, mapped, rebuilt, rows
from visray.ray import Hit, Ray, Surface
from visray.sampling import SampleState


@dataclass(frozen=True)
class Interaction:
    """A hit that is shaded.

    o, d: the ray's origin and direction. n: the normal turned to the viewer, who sees it from `within` or not.
    origin: rays that start at the point, where any do. sample: the random numbers that belong to it.
    """

    o: Any
    d: Any
    hit: Hit
    surface: Surface
    n: Any
    from_inside: Any
    material: Material
    u: Any
    v: Any
    origin: RayOrigin | None
    sample: SampleState | None

    def spawn_ray(self, d: Any, cosine: Any) -> Ray:
        """A ray from the point on the viewer's side, with that cosine with the normal.

        What lies flush with the surface is not met: nothing that is no farther above it than the point is off.
        """
        return Ray(self.surface.p, d, self.hit.row, self.from_inside, self.surface.error, cosine, self.hit.part)


def interact(s: KernelScene, ray: Ray, hit: Hit, sample: SampleState | None = None) -> Interaction:
    """A hit, ready to be shaded."""
    surface, material, u, v = surface_of(s, ray, hit)
    d = s.a.V(ray.d if ray.d_single is None else ray.d_single)
    n, within = face_forward(surface.n, d)
    origin = RayOrigin(s.geometry, surface.p, shared=False) if s.rays_leave_surfaces and sample is not None else None
    return Interaction(ray.o, d, hit, surface, n, within, material, u, v, origin, sample)


def surface_of(s: KernelScene, ray: Ray, hit: Hit) -> tuple[Surface, Material, Any, Any]:
    """The surface point, its material and its (u, v).

    t follows from the implicit function theorem: f(o + t d) = 0 gives dt = -df / (g.d).
    """
    a, n, textured = s.a, dr.width(ray.d), s.features["textures"]
    # Lanes that hit nothing take part at the ray's origin: no inf or NaN enters a derivative there.
    t = dr.select(hit.valid, hit.t, 0)
    # The same for all rows where no derivatives are asked for, and then no branch hands it on.
    p = dr.fma(t, ray.d, ray.o)
    moved = dr.zeros(a.W, n) if s.attached else None
    normals = dr.zeros(a.V, n), dr.zeros(a.W, n) if s.features["paths"] else None
    texture = dr.zeros(a.U, n) if textured else None
    # A texture far out on a plane is looked up in double.
    zero = dr.zeros(a.D if textured else a.F, n)
    state = (
        moved,
        *normals,
        dr.zeros(a.D, n),
        mapped(lambda x: dr.zeros(type(x), n), s.zero_material),
        texture,
        zero,
        zero,
    )
    for batch in s.batches:
        here = batch.has(hit.row)

        def touch(*_: Any, batch: Batch = batch, here: Any = here) -> tuple:
            table = (batch.placed, batch.material, batch.texture if textured else None, batch.coordinate_bound)
            placed, material, texture, span = _row_of(s, table, len(batch), here, hit.row - batch.first_row)
            moved, *normals, u, v = _surface(s, batch, placed, ray, t, p, hit.part)
            return leaves((moved, *normals, span, material, texture, type(zero)(u), type(zero)(v)))

        if len(s.batches) == 1:
            state = rebuilt(state, touch())
        elif s.attached:
            state = rebuilt(state, tuple(dr.select(here, new, old) for new, old in zip(touch(), leaves(state))))
        else:
            state = rebuilt(state, dr.if_stmt(leaves(state), here, touch, lambda *old: old, label="interact"))
    moved, normal, exact, span, material, texture, u, v = state
    # p is off by the rounding of o + t d (two for each coordinate) and that of t, which moves it along the ray by as
    # much as the local origin is known to: five more, of numbers no greater than |o| + t and the row's coordinates.
    # Tested against exact arithmetic; a transform that shears multiplies it by the distortion of its frame.
    error = gamma(8) * (l1_norm(ray.o) + t + span)
    surface = Surface(moved if s.attached else p, normal, error, exact)
    if textured:
        bare = texture == NO_TEXTURE
        painted = texturing.colour(a, s.atlas, dr.select(bare, 0, texture), u, v, s.features["bilinear"])
        material = replace(material, kd=dr.select(bare, material.kd, painted))
    return surface, material, a.F(u), a.F(v)


def attached_distance(s: KernelScene, ray: Ray, hit: Hit) -> Any:
    """How far away a hit is, with derivatives."""
    ray = ray.exact()
    return dr.dot(surface_of(s, ray, hit)[0].p - ray.o, ray.d)


def _row_of(s: KernelScene, table: tuple, size: int, here: Any, index: Any) -> tuple:
    """A row of a table for each lane: by branches, as a packet of lanes needs few of few rows.

    Not where derivatives are asked for: of what a branch in a loop hands through from outside, Dr.Jit 1.5 makes zero.
    """
    if s.attached or size > policy.MAX_INLINED:
        return rows(table, dr.select(here, index, 0))
    u = s.a.U
    row = leaves(rows(table, u(0)))
    for i in range(1, size):
        row = dr.if_stmt(row, index == i, lambda *_, i=i: leaves(rows(table, u(i))), lambda *old: old, label="row")
    return rebuilt(table, row)


def _surface(s: KernelScene, batch: Batch, placed: Any, ray: Ray, t: Any, p: Any, part: Any) -> tuple:
    """Of a point p = o + t d on a row: p itself where derivatives are asked for, with them; the unit normal, and the
    same in double where rays go on from there; u and v."""
    kind, part = batch.kind, batch.part(part)
    f, g = kind.surface_at(placed, p, part)
    if dr.grad_enabled((f, p)):
        t = t - (f - dr.detach(f)) / dr.detach(dr.dot(g, ray.d))
        p = dr.fma(t, ray.d, ray.o)
        g = kind.surface_at(placed, p, part)[1]
    u, v = kind.uv(placed, p, part)
    exact = dr.normalize(g) if s.features["paths"] else None
    return p if s.attached else None, dr.normalize(s.a.V(g)), exact, u, v
