"""Points and meshes: whether a point is inside a solid, and which triangle is nearest to it."""

from typing import Any

import drjit as dr

from visray.accel.bvh_step import Search
from visray.accel.bvh_walk import walk
from visray.accel.tree_rays import TreeRays
from visray.primitives.mesh_line import TriangleCrossing
from visray.primitives.mesh_search import SeenMesh

# The direction, a unit vector, of the rays that decide whether a point is inside. Any direction is right.
ANY_DIRECTION = (0.48, 0.6, 0.64)


def is_inside(seen: SeenMesh, lanes: int) -> Any:
    """Whether the origins of `seen` are inside their solids: whether a ray from there leaves more often than it enters.

    lanes: number of points.
    """
    a = seen.buffers.value.a

    def visit(state: tuple, part: Any, x: TriangleCrossing) -> tuple:
        (balance,) = state
        return (dr.select(x.hit & (x.t > 0), balance + dr.select(x.leaves, a.F32(1), a.F32(-1)), balance),)

    line = seen.line(a.W(*ANY_DIRECTION))
    return seen.visited(line, a.D(0), (dr.zeros(a.F32, lanes),), visit, lambda _: a.D(dr.inf))[0] > 0


def nearest_triangle(seen: SeenMesh, lanes: int) -> tuple[Any, Any]:
    """(part, distance): the triangle nearest to the origin of `seen`, and its distance in coordinates of the mesh. The
    distance is inf if no triangle is near, to within the rounding of the origin in single precision.

    lanes: number of points.
    """
    buffers, mesh = seen.buffers.value, seen.mesh
    a = buffers.a

    def visit(_: int, state: tuple, triangle: Any, present: Any) -> tuple:
        squared, old_part = state
        triangle = dr.select(present, triangle, mesh.first)
        part, new = triangle - mesh.first, _squared_distance(seen.o, buffers.triangle(triangle))
        nearer = present & ((new < squared) | ((new == squared) & (part < old_part)))
        return dr.select(nearer, new, squared), dr.select(nearer, part, old_part)

    # A ray of length 0 visits the boxes that contain its origin, and the triangles on which it lies, to within the
    # margins of the walk.
    rays = TreeRays.along(a, seen.tree, seen.o, a.W(*ANY_DIRECTION) + dr.zeros(a.W, lanes))
    start = dr.full(a.D, dr.inf, lanes), dr.zeros(a.U, lanes)
    squared, part = walk(rays, start, Search(visit, lambda _: a.D(0), lambda _: a.B(False)))
    return part, dr.sqrt(squared)


def _squared_distance(p: Any, corners: tuple[Any, Any, Any]) -> Any:
    """Squared distance between points and triangles."""
    a, b, c = corners
    n = dr.cross(b - a, c - a)
    above, result = dr.mask_t(p.x)(True), dr.inf
    for start, end in ((a, b), (b, c), (c, a)):
        edge, to_p = end - start, p - start
        above &= dr.dot(dr.cross(n, edge), to_p) >= 0
        share = dr.dot(edge, to_p) / dr.squared_norm(edge)
        off = to_p - edge * dr.select(share > 0, dr.select(share < 1, share, 1), 0)
        squared = dr.squared_norm(off)
        result = dr.select(squared < result, squared, result)
    height = dr.dot(n, p - a)
    return dr.select(above, height * height / dr.squared_norm(n), result)
