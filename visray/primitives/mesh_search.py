"""The search for the crossings of rays with meshes: each ray walks through the tree of its own mesh."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray.accel.blocks import TRIANGLE
from visray.accel.bvh import Tree
from visray.accel.bvh_step import Certain, Search
from visray.accel.bvh_walk import walk
from visray.accel.tree_rays import TreeRays
from visray.primitives.flat import farther_than
from visray.primitives.mesh_line import MeshLine, TriangleCrossing
from visray.primitives.mesh_triangle import Corners
from visray.pytree import Shared
from visray.quantities import Arrays
from visray.ray import Crossing, KnownEnds, Ray


@dataclass(frozen=True)
class MeshBuffers:
    """The triangles of several meshes, and their trees.

    a: array types.
    corners, vertices: numbers of the corners of each triangle, and the vertices in coordinates of their mesh.
    blocks: blocks of the trees of all meshes (bvh.Tree). A row of a tree is a triangle.
    """

    a: Arrays
    corners: Corners
    vertices: Any
    blocks: Any

    def triangle(self, number: Any) -> tuple[Any, Any, Any]:
        """The corners of one triangle for each lane. number: its number."""
        return self.corners.at(number).read(Shared(self.vertices))


@dataclass(frozen=True)
class MeshRows:
    """Where the mesh of each row lies in the buffers.

    first, count: number of its first triangle, and of its triangles.
    root, centre, ball, size: those of its tree (bvh.Tree), in coordinates of the mesh.
    """

    first: Any
    count: Any
    root: Any
    centre: Any
    ball: Any
    size: Any


@dataclass(frozen=True)
class SeenMesh:
    """Meshes for rays from one origin.

    buffers: triangles and trees.
    mesh: where the mesh of each row lies.
    inverse: map from the world to coordinates of the mesh.
    axes: the same map's inverse, as three vectors of the world.
    o: the ray origin, in coordinates of the mesh.
    """

    buffers: Shared
    mesh: MeshRows
    inverse: Any
    axes: tuple[Any, Any, Any]
    o: Any

    def line(self, d: Any) -> MeshLine:
        """The line of a ray. d: direction in the world, in double."""
        along = type(d)(*(dr.dot(axis, d) for axis in self.axes))
        return MeshLine.of(self.o, self.inverse.vector(d), along, self.mesh.size + self.mesh.ball)

    @property
    def tree(self) -> Tree:
        """The trees that the rays walk through."""
        mesh = self.mesh
        return Tree(self.buffers.value.blocks, mesh.centre, mesh.ball, mesh.size, (), (0,), (TRIANGLE,), mesh.root)

    def visited(
        self, line: MeshLine, begin: Any, state: tuple, visit: Callable, reach: Callable,
        done: Callable | None = None, accepts: Callable | None = None, certain: Certain | None = None,
        every: bool = False,
    ) -> tuple:  # fmt: skip
        """The state after a ray has visited all triangles that it can cross.

        begin, reach(state): distances along the ray; triangles that it crosses only outside of them may be skipped.
        visit(state, part, crossing): function that returns the state after one triangle, the number `part` of its mesh.
        done(state): function that returns a mask of the rays that stop; None if none stops early.
        accepts(part): function that returns a mask of the rays that may cross a triangle; None if they may cross all.
        certain: when a certain hit counts (bvh_step.py); all distances are along the ray.
        every: whether all triangles are visited, without the tree; a reference for tests.
        """
        buffers, mesh = self.buffers.value, self.mesh
        a = buffers.a

        def at(_: int, state: tuple, triangle: Any, present: Any) -> tuple:
            # A lane may visit nothing; it then reads the first triangle.
            triangle = dr.select(present, triangle, mesh.first)
            x = line.crossing(buffers.triangle(triangle))
            return visit(state, triangle - mesh.first, replace(x, hit=x.hit & present))

        if every:
            end = mesh.first + mesh.count
            start = mesh.first + dr.zeros(a.U, dr.width(state))

            def step(i: Any, *state: Any) -> tuple:
                return (i + 1, *at(0, state, i, i < end))

            return dr.while_loop((start, *state), lambda i, *_: i < end, step, label="every triangle")[1:]
        # In the tree, distances are those in coordinates of the mesh.
        length = dr.norm(line.d)
        rays = TreeRays.along(a, self.tree, self.o, line.d / length, (begin - line.rounding) * length)
        if certain is not None:
            # A vector of length 1 in the world is no longer than this in coordinates of the mesh.
            longest = dr.sqrt(sum(dr.squared_norm(row) for row in (self.inverse.x, self.inverse.y, self.inverse.z)))
            certain = Certain(
                certain.begin * length, certain.end * length, certain.end_error * longest, certain.decided
            )
        search = Search(
            lambda _, *arguments: at(0, *arguments),
            lambda state: reach(state) * length,
            done or (lambda _: a.B(False)),
            lambda _, state, triangle, present: present if accepts is None else accepts(triangle - mesh.first),
            certain,
        )
        return walk(rays, state, search)


class MeshSearch:
    """The search for the first crossing of each ray with its mesh.

    Parameters: as in Primitive.crossing.
    """

    def __init__(self, seen: SeenMesh, ray: Ray, begin: Any, end: Any, known: KnownEnds):
        self.seen, self.known, self.a = seen, known, seen.buffers.value.a
        self.line, self.begin, self.end = seen.line(ray.d), self.a.D(begin), end
        self.clearance = clearance = self.a.D(0 if ray.clearance is None else ray.clearance)
        arrays = self.line.d, self.line.o, self.begin, clearance, known.on_start, end
        self.lanes = max(dr.width(x) for x in arrays if x is not None)
        # A crossing whose distance from the start is at most this and its own error may lie at the start. If the search
        # starts after an earlier crossing, the clearance at the ray origin does not matter.
        self.zone = self.a.D(0)
        if known.on_start is not None:
            clearance = dr.select(self.begin > 0, 0, clearance)
            self.zone = dr.select(known.on_start, clearance + self._error_at_start(), 0)

    def _error_at_start(self) -> Any:
        """Bound on the error of the distance of the crossing at which the ray starts; 0 if it is not known."""
        if self.known.start_part is None:
            return 0
        mesh = self.seen.mesh
        part = dr.select(self.known.start_part < mesh.count, self.known.start_part, 0)
        x = self.line.crossing(self.seen.buffers.value.triangle(mesh.first + part))
        return dr.select(x.hit, x.slack, 0)

    def at_start(self, x: TriangleCrossing) -> Any:
        """Whether the ray starts on its mesh, and a crossing may lie there to within rounding."""
        on_start = self.known.on_start
        return self.a.B(False) if on_start is None else on_start & (dr.abs(x.t - self.begin) <= self.zone + x.slack)

    def starts_on(self, part: Any) -> Any:
        """Whether the ray is known to start on a triangle. part: its number."""
        known = self.known
        unknown = known.start_part is None or known.on_start is None
        return self.a.B(False) if unknown else known.on_start & (part == known.start_part)

    def ends_on(self, part: Any) -> Any:
        """Whether the ray is known to end on a triangle."""
        known = self.known
        unknown = known.end_part is None or known.on_end is None
        return self.a.B(False) if unknown else known.on_end & (part == known.end_part)

    def counts(self, part: Any, x: TriangleCrossing) -> Any:
        """Whether the crossing with a triangle counts, if it is far enough from the start: not if the ray is known to
        start or end on this triangle, or if the crossing is not before the end of the ray by more than its error."""
        counts, error = x.hit & ~self.starts_on(part) & ~self.ends_on(part), self.known.end_error
        if self.end is None:
            return counts
        if error is None:
            return counts & (x.t < self.end)
        slope, squared = dr.dot(x.n, self.line.d), dr.squared_norm(self.seen.inverse.normal(x.n))
        return counts & farther_than(self.end - x.t, slope, squared, error)

    def accepts(self, part: Any) -> Any:
        """Whether the ray may cross a triangle: it is not known to start there."""
        return ~self.starts_on(part)

    def certain(self, begin: Any, decided: Callable | None = None) -> Certain:
        """When a hit that is certain in single precision counts. begin: distance behind which it counts."""
        zero = self.a.D(0)
        end = zero + dr.inf if self.end is None else self.end
        return Certain(begin, end, zero if self.known.end_error is None else self.known.end_error, decided)

    def before_end(self, distance: Any) -> Any:
        """The distance, or that of the end of the ray if this is nearer."""
        return distance if self.end is None else dr.minimum(distance, self.end)


class SheetSearch(MeshSearch):
    """The search in meshes that are no solids: the nearest crossing. A ray that starts on a triangle crosses the other
    triangles only beyond its clearance."""

    def run(self, every: bool = False) -> Crossing:
        """The first crossing. every: whether all triangles are tested, without the tree."""
        a, begin, on_start = self.a, self.begin, self.known.on_start
        if on_start is not None:
            begin = dr.select(on_start & (self.clearance > begin), self.clearance, begin)

        def visit(state: tuple, part: Any, x: TriangleCrossing) -> tuple:
            t, old_part, _ = state
            nearer = self.counts(part, x) & (x.t > begin) & ((x.t < t) | ((x.t == t) & (part < old_part)))
            return tuple(dr.select(nearer, new, old) for new, old in zip((x.t, part, x.leaves), state))

        n = self.lanes
        start = dr.full(a.D, dr.inf, n), dr.zeros(a.U, n), dr.full(a.B, False, n)
        certain = self.certain(begin)
        t, part, leaves = self.seen.visited(
            self.line, begin, start, visit, lambda s: self.before_end(s[0]), None, self.accepts, certain, every
        )
        met = t < dr.inf
        return Crossing(met, t, part, ~leaves | ~met)
