"""Meshes as bodies: one row is a whole mesh, with a tree of its own over its triangles. Its parts are its triangles.

Bodies have an inside, so meshes can be of glass. And bodies with one mesh share its triangles and its tree, however
many there are, because both are in coordinates of the mesh.
"""

from functools import cache
from typing import Any

import drjit as dr

from visray.geometry import Frame
from visray.primitives.mesh_buffers import BodyTable, PlacedBody, body_table
from visray.primitives.mesh_passage import Passage
from visray.primitives.mesh_point import is_inside, nearest_triangle
from visray.primitives.mesh_search import SeenMesh, SheetSearch
from visray.primitives.mesh_triangle import PlacedMesh
from visray.primitives.primitive import Primitive
from visray.primitives.solid_search import SolidSearch
from visray.primitives.triangle import normal_of
from visray.pytree import Shared
from visray.quantities import Arrays
from visray.ray import Crossing, KnownEnds, Ray


class MeshBody(Primitive):
    """A mesh as one row. Its class says whether it is a solid, and whether it has normals of its own for shading."""

    parts = 1 << 31
    uses_part = True
    own_frames = True
    walks = True
    own_passage = True
    max_crossings = 1 << 16

    @staticmethod
    @cache
    def kind_of(closed: bool, bends_normals: bool) -> "type[MeshBody]":
        """The class of bodies with these facts."""
        return type("MeshBody", (MeshBody,), {"closed": closed, "bends_normals": bends_normals})

    @staticmethod
    def table(a: Arrays, objects: list) -> BodyTable:
        return body_table(a, objects)

    @classmethod
    def volumes(cls, table: BodyTable, outer: Frame | None) -> tuple[Any, Any]:
        volume = table.volume * table.frame.volume_factor()
        return volume, 0 * volume

    @staticmethod
    def seen(placed: PlacedBody, o: Any) -> SeenMesh:
        return SeenMesh(placed.buffers, placed.mesh, placed.inverse, placed.axes, placed.inverse.point(o))

    @classmethod
    def crossing(
        cls, seen: SeenMesh, ray: Ray, begin: Any, end: Any, known: KnownEnds, every: bool = False
    ) -> Crossing:
        """As Primitive.crossing. every: whether all triangles are tested, without the tree; a reference for tests."""
        return (SolidSearch if cls.closed else SheetSearch)(seen, ray, begin, end, known).run(every)

    @classmethod
    def occludes(cls, seen: SeenMesh, ray: Ray, begin: Any, end: Any, known: KnownEnds) -> Any:
        """Mask of the segments that cross the mesh, as ray_segment.occludes returns it."""
        return Passage(seen, ray, begin, end, known, cls.closed).occludes()

    @classmethod
    def passage(cls, seen: SeenMesh, ray: Ray, begin: Any, end: Any, known: KnownEnds) -> tuple[Any, Any, Any]:
        """As ray_segment.passage, in one walk."""
        return Passage(seen, ray, begin, end, known, cls.closed).run()

    @classmethod
    def inside(cls, placed: PlacedBody, p: Any) -> Any:
        seen = cls.seen(placed, p)
        return is_inside(seen, dr.width(seen.o))

    @classmethod
    def surface_at(cls, placed: PlacedBody, p: Any, part: Any = None) -> tuple[Any, Any]:
        far = None
        if part is None:
            seen = cls.seen(placed, p)
            part, distance = nearest_triangle(seen, dr.width(seen.o))
            far = distance
        triangle = _triangle(placed, part)
        a, b, c = triangle.corners.read(triangle.vertices)
        n = normal_of(a, b, c)
        g, height = placed.inverse.normal(n), dr.dot(placed.inverse.point(p) - a, n)
        scale = dr.rcp(dr.norm(g))
        if far is None:
            return height * dr.detach(scale), dr.normalize(g)
        # The nearest point of the triangle may lie on its edge.
        return dr.select(height < 0, -far, far) * dr.norm(n) * scale, dr.normalize(g)

    @staticmethod
    def uv(placed: PlacedBody, p: Any, part: Any = None) -> tuple[Any, Any]:
        weights = _triangle(placed, part).barycentric(placed.inverse.point(p))
        look = placed.look.value
        if look.uv_corners is None:
            return weights[1], weights[2]
        corners = look.uv_corners.at(placed.mesh.first + part)
        return tuple(sum(w * x for w, x in zip(weights, corners.read(Shared(buffer)))) for buffer in (look.u, look.v))

    @staticmethod
    def shading_normal(placed: PlacedBody, p: Any, part: Any = None) -> Any:
        weights = _triangle(placed, part).barycentric(placed.inverse.point(p))
        look = placed.look.value
        normals = look.normal_corners.at(placed.mesh.first + part).read(Shared(look.normals))
        return dr.normalize(sum(w * dr.normalize(placed.inverse.normal(n)) for w, n in zip(weights, normals)))


def _triangle(placed: PlacedBody, part: Any) -> PlacedMesh:
    """One triangle of a body for each lane, in coordinates of the mesh. part: its number in the mesh."""
    buffers = placed.buffers.value
    corners = buffers.corners.at(placed.mesh.first + part)
    return PlacedMesh(corners, Shared(buffers.vertices), *[None] * 6)
