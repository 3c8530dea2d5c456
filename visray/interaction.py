"""Surface interactions: the surface point of a hit, its normal, its material and its texture coordinates u and v.

The search finds the hit without derivatives (detached). Here the row that is hit is evaluated again with derivatives
(attached).
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.accel import policy
from visray.accel.origin import RayOrigin
from visray.batches import Batch
from visray.columns import NO_TEXTURE, Looks
from visray.geometry import face_forward, gamma, l1_norm
from visray.images import lookup as texturing
from visray.kernel_scene import KernelScene
from visray.materials import Material
from visray.pytree import leaves, mapped, rebuilt, rows
from visray.ray import Hit, Ray, Surface
from visray.sampling import SampleState


@dataclass(frozen=True)
class Interaction:
    """A hit with all data that shading needs. Parameters named `si` (surface interaction) are of this type.

    o, d: origin and direction of the ray
    hit: result of the search
    surface: surface point with its outward normal
    n: unit normal for shading, on the side that the ray comes from
    face: unit normal of the surface itself on this side; None if it is `n` in all lanes
    from_inside: whether the ray sees the surface from inside
    material: material at the point, with the colour of its texture (Material.textured)
    u, v: texture coordinates
    origin: the point as origin of further rays; None if no rays start there
    sample: random numbers of the sample; None if none are needed
    """

    o: Any
    d: Any
    hit: Hit
    surface: Surface
    n: Any
    face: Any
    from_inside: Any
    material: Material
    u: Any
    v: Any
    origin: RayOrigin | None
    sample: SampleState | None

    def spawn_ray(self, d: Any, cosine: Any) -> Ray:
        """A ray that starts at the point, on the side of the normal n.

        d: unit direction
        cosine: cosine of the angle between d and n

        The ray ignores other surfaces whose height above the point is at most the error of the point, because to within
        rounding they lie on the same surface.
        """
        if self.face is not None:
            cosine = dr.abs(self.face_cosine(d, cosine))
        return Ray(self.surface.p, d, self.hit.row, self.from_inside, self.surface.error, cosine, self.hit.part)

    def face_cosine(self, d: Any, cosine: Any) -> Any:
        """Cosine of the angle between a direction d and the normal of the surface itself. It decides on which side of
        the surface d runs. cosine: the same for the normal n."""
        return cosine if self.face is None else dr.dot(type(d)(self.face), d)


def interact(s: KernelScene, ray: Ray, hit: Hit, sample: SampleState | None = None) -> Interaction:
    """The interaction at the hit of a ray. sample: random numbers of the sample, if further rays start there."""
    surface, material, u, v = surface_of(s, ray, hit)
    d = _direction(s, ray)
    face, from_inside = face_forward(surface.n, d)
    n, shading = face, surface.shading
    if shading is None:
        face = None
    else:
        n = s.a.V(dr.select(from_inside, -shading, shading))
    origin = RayOrigin(s.geometry, surface.p, shared=False) if s.rays_leave_surfaces and sample is not None else None
    return Interaction(ray.o, d, hit, surface, n, face, from_inside, material, u, v, origin, sample)


def _direction(s: KernelScene, ray: Ray) -> Any:
    """Direction of a ray, in the precision of shading."""
    return s.a.V(ray.d if ray.d_single is None else ray.d_single)


def surface_of(s: KernelScene, ray: Ray, hit: Hit) -> tuple[Surface, Material, Any, Any]:
    """The surface point of a hit, its material, and its texture coordinates u and v.

    The derivative of t follows from the implicit function theorem: f(o + t d) = 0 gives dt = -df / (g.d), where g is
    the gradient of f.
    """
    a, n, textured = s.a, ray.lanes, s.features["textures"]
    # Lanes without a hit compute at the ray's origin, so that no inf or NaN enters a derivative.
    t = dr.select(hit.valid, hit.t, 0)
    # Without derivatives, p does not depend on the row, so no branch needs to return it.
    p = dr.fma(t, ray.d, ray.o)
    attached_p = dr.zeros(a.W, n) if s.attached else None
    bends_normals = any(batch.kind.bends_normals for batch in s.batches)
    normals = (
        dr.zeros(a.V, n),
        dr.zeros(a.W, n) if s.features["paths"] else None,
        dr.zeros(a.W, n) if bends_normals else None,
    )
    texture = dr.zeros(a.U, n) if textured else None
    # Double, because texture coordinates far out on a plane are large.
    zero = dr.zeros(a.D if textured else a.F, n)
    state = (
        attached_p,
        *normals,
        dr.zeros(a.D, n),
        mapped(lambda x: dr.zeros(type(x), n), s.zero_material),
        texture,
        zero,
        zero,
    )
    for batch in s.batches:
        in_batch = batch.has(hit.row)

        def evaluate(*_: Any, batch: Batch = batch, in_batch: Any = in_batch) -> tuple:
            placed, front, back, coordinate_bound = _row_of(s, batch, in_batch, hit.row - batch.first_row, hit.part)
            attached_p, *normals, u, v = _surface(s, batch, placed, ray, t, p, hit.part, bends_normals)
            material, texture = front if back is None else _seen_side(front, back, normals[0], _direction(s, ray))
            return leaves((attached_p, *normals, coordinate_bound, material, texture, type(zero)(u), type(zero)(v)))

        if len(s.batches) == 1:
            state = rebuilt(state, evaluate())
        elif s.attached:
            state = rebuilt(state, tuple(dr.select(in_batch, new, old) for new, old in zip(evaluate(), leaves(state))))
        else:
            state = rebuilt(state, dr.if_stmt(leaves(state), in_batch, evaluate, lambda *old: old, label="interact"))
    attached_p, normal, exact, shading, coordinate_bound, material, texture, u, v = state
    # The error of p: two roundings for each coordinate of o + t d, and five more for the error of t, which moves p
    # along the ray by at most the error of the local origin. The rounded numbers are at most |o| + t + the coordinate
    # bound of the row. Tested against exact arithmetic; a transform that shears multiplies the error by the distortion
    # of its frame.
    error = gamma(8) * (l1_norm(ray.o) + t + coordinate_bound)
    surface = Surface(attached_p if s.attached else p, normal, error, exact, shading)
    if textured:
        has_texture, bilinear = texture != NO_TEXTURE, s.features["bilinear"]
        material = texturing.coloured(a, s.atlas, material, texture, has_texture, (u, v), bilinear)
    return surface, material, a.F(u), a.F(v)


def attached_distance(s: KernelScene, ray: Ray, hit: Hit) -> Any:
    """Distance of a hit along its ray, with derivatives."""
    ray = ray.exact()
    return dr.dot(surface_of(s, ray, hit)[0].p - ray.o, ray.d)


def _row_of(s: KernelScene, batch: Batch, in_batch: Any, index: Any, part: Any) -> tuple:
    """The data of the row that each lane needs: a tuple of placed data, front, back and coordinate bound. Front and
    back are as `_sides` returns them.

    A small table is read by branches, because the lanes of a packet need few of its rows. A large table is gathered
    from memory, and so is every table if derivatives are asked for: Dr.Jit 1.5 returns zero derivatives for values from
    outside a loop that pass through a branch inside it.

    in_batch: mask of the lanes that hit a row of the batch
    index: number of this row in the batch
    part: part of its surface
    """
    front, back = _sides(s, batch)
    if s.attached or batch.object_of is not None or batch.kind.walks or len(batch) > policy.MAX_INLINED:
        index = dr.select(in_batch, index, 0)
        placed, bound = rows(batch.placed, index), batch.coordinate_bound
        bound = bound if batch.object_of is not None else rows(bound, index)
        number = batch.object_at(index)
        if (looks := batch.looks) is not None:
            look = dr.gather(s.a.U, looks.of, dr.select(in_batch, batch.kind.leaf_number(part), 0))
            return (placed, *rows(_sides(s, looks), look), bound)
        gathered = rows if batch.packets is None or s.attached else batch.packets.rows
        return (placed, *gathered((front, back), number), bound)
    u, table = s.a.U, (batch.placed, front, back, batch.coordinate_bound)
    row = leaves(rows(table, u(0)))
    for i in range(1, len(batch)):
        row = dr.if_stmt(row, index == i, lambda *_, i=i: leaves(rows(table, u(i))), lambda *old: old, label="row")
    return rebuilt(table, row)


def _sides(s: KernelScene, shown: Batch | Looks) -> tuple:
    """What the objects of a batch, or some looks, show on the front and on the back: each a tuple of materials and
    textures (None in scenes without textures). The back is None if the kernel has no code for it."""
    textured, back = s.features["textures"], shown.back
    front = shown.material, shown.texture if textured else None
    return front, back and (back.material, back.texture if textured else None)


def _seen_side(front: tuple, back: tuple, n: Any, d: Any) -> tuple:
    """Material and texture of the side that rays see.

    front, back: material and texture of each side
    n: outward normal
    d: direction of the rays
    """
    _, from_inside = face_forward(n, d)
    return rebuilt(front, tuple(dr.select(from_inside, b, f) for f, b in zip(leaves(front), leaves(back))))


def _surface(
    s: KernelScene, batch: Batch, placed: Any, ray: Ray, t: Any, p: Any, part: Any, bends_normals: bool
) -> tuple:
    """Surface data at the points p = o + t d on rows of a batch. Returns a tuple of p with derivatives (None if none
    are asked for), the unit normal, the same normal in double (None if no path continues), the unit normal for shading
    in double (None if no kind of the scene has its own), u and v.

    placed: placed data of each lane's row
    bends_normals: whether some kind of the scene has its own normals for shading
    """
    kind, part = batch.kind, batch.part(part)
    f, g = kind.surface_at(placed, p, part)
    if dr.grad_enabled((f, p)):
        t = t - (f - dr.detach(f)) / dr.detach(dr.dot(g, ray.d))
        p = dr.fma(t, ray.d, ray.o)
        g = kind.surface_at(placed, p, part)[1]
    u, v = kind.uv(placed, p, part)
    exact = dr.normalize(g) if s.features["paths"] else None
    shading = None
    if bends_normals:
        shading = kind.shading_normal(placed, p, part) if kind.bends_normals else dr.normalize(g)
    stored = kind.stores_normals and not s.attached and s.a.precision == "single"
    normal = kind.unit_normal(placed) if stored else dr.normalize(s.a.V(g))
    return p if s.attached else None, normal, exact, shading, u, v
