"""Where points of surfaces go from one moment to another.

A point keeps its coordinates in the frame of its shape (Primitive.carrier) while the numbers of the shape change. So it
keeps its texture coordinates u and v, too. Points of polynomial surfaces move along the normal, because such a surface
has no frame that follows its parameters.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import drjit as dr
import numpy as np

from visray.data.all_objects import BASE
from visray.data.gizmos import carrier
from visray.data.rows import Rows
from visray.geometry import Frame, gamma, l1_norm
from visray.operands import ROLES
from visray.primitives.csg_operands import Operand, operands
from visray.primitives.instance import Instance
from visray.primitives.primitive import Primitive, identity, scalars, to_world_matrix
from visray.pytree import evaluated
from visray.quantities import Arrays
from visray.ray import NOTHING_KNOWN, Ray
from visray.scene.scene import Scene
from visray.transforms import Transform, compose, composed


@dataclass
class Motion:
    """How points of surfaces move.

    number: number of the object that each point lies on, from 1; 0 for points of no object. Shape: (N)
    points: the points. Those that no matrix moves are at their end already. Shape: (N, 3)
    slot: for each number of an object, which of the matrices moves its points, from 1; 0 for none
    blocks: the matrices, each block of shape (k, 4, 4)
    bends: whether some points are moved by no matrix
    """

    number: np.ndarray
    points: np.ndarray
    slot: np.ndarray
    blocks: list[np.ndarray] = field(default_factory=list)
    bends: bool = False

    @property
    def matrices(self) -> np.ndarray:
        """The identity, for slot 0, and then all matrices. Shape: (N, 4, 4)."""
        return np.concatenate([np.eye(4)[None], *self.blocks])

    def transport(self, number: int | np.ndarray, before: np.ndarray, behind: np.ndarray) -> None:
        """Moves the points of an object, or of several, that keep their coordinates in a frame.

        number: number of the object, or an array of numbers
        before, behind: the matrix of the frame, or one for each object. Shape: (4, 4) or (k, 4, 4)
        """
        block = (behind @ np.linalg.inv(before)).reshape(-1, 4, 4)
        first = 1 + sum(map(len, self.blocks))
        self.slot[np.atleast_1d(number)] = first + np.arange(len(block))
        self.blocks.append(block)

    def put(self, lanes: np.ndarray, points: np.ndarray) -> None:
        """Moves the points with the numbers `lanes` to other places."""
        if not self.bends:
            self.points, self.bends = self.points.copy(), True
        self.points[lanes] = points


def motion(a: Arrays, scene: Scene, after: Scene, points: np.ndarray, number: np.ndarray) -> Motion:
    """How points of surfaces of a scene move to where they are in the scene of another moment. Points of no object stay
    where they are, as do those of objects that the other scene does not have.

    points, number: as in Motion
    """
    written, others, count = scene.written_objects, after.written_objects, len(scene.all_objects)
    seen = np.flatnonzero(np.bincount(number, minlength=count + 1))
    found = Motion(number, points, np.zeros(count + 1, np.uint32))
    names = [None, *written]
    for i in seen[(seen > 0) & (seen < len(names))].tolist():
        old, new = written[names[i]], others.get(names[i])
        if new is None or _stays(old, new, scene, after):
            continue
        if _stays(old.with_fields(transform=new.transform), new, scene, after):
            found.transport(i, _whole(compose(old.transform)), _whole(compose(new.transform)))
        else:
            _move(a, i, old, new, _leaves(old, scene), _leaves(new, after), found)
    for name, rows in scene.data.rows.items() if scene.data is not None else ():
        first = scene.all_objects.starts[name] + 1
        of_layer = seen[(seen >= first) & (seen < first + len(rows.first))]
        other = after.data.rows.get(name, rows)
        if len(of_layer) and len(other) and other is not rows:
            if rows.gizmo.on_line:
                # Lines lie on the base.
                found.transport(of_layer, *(_matrix(x[BASE], x[BASE].transform) for x in (written, others)))
            else:
                _move_rows(rows, other, of_layer, first, found)
    return found


def _stays(old: Primitive, new: Primitive, scene: Scene, after: Scene) -> bool:
    """Whether an object and the geometries that it is made of are the same in both scenes."""
    same_geometries = scene.geometries is after.geometries or scene.geometries == after.geometries
    return (old is new or old == new) and (same_geometries or not _refers(old, scene))


def _refers(obj: Primitive, scene: Scene) -> bool:
    """Whether an object is made of a geometry of the scene, at any depth."""
    return any(isinstance(x.shape, Instance) for x in operands("", obj, scene.geometries))


def _leaves(obj: Primitive, scene: Scene) -> list[Operand]:
    """The shapes that an object is made of: itself, unless it is CSG, an instance, or has cuts."""
    return [x for x in operands("", obj, scene.geometries) if x.is_leaf]


def _move(
    a: Arrays, number: int, old: Primitive, new: Primitive, leaves: list[Operand], others: list[Operand], found: Motion
) -> None:
    """Adds the motion of one object.

    old, new: the object at both moments
    leaves, others: its leaves at both moments
    """
    if [type(x.shape) for x in leaves] != [type(x.shape) for x in others]:
        # The leaves cannot be matched.
        found.transport(number, _whole(compose(old.transform)), _whole(compose(new.transform)))
        return
    if len(leaves) == 1 and not _bends(leaves[0], others[0]):
        found.transport(number, *(_matrix(x.shape, x.steps) for x in (leaves[0], others[0])))
        return
    lanes = np.flatnonzero(found.number == number)
    points = found.points[lanes]
    of_lane = np.zeros(len(lanes), int) if len(leaves) == 1 else _nearest(a, leaves, points)
    for i, (was, now) in enumerate(zip(leaves, others)):
        own = of_lane == i
        if own.any() and (_fields(was.shape), was.steps) != (_fields(now.shape), now.steps):
            points[own] = _moved(a, was, now, points[own])
    found.put(lanes, points)


def _bends(was: Operand, now: Operand) -> bool:
    """Whether a shape changes as no matrix does. was, now: the shape at both moments"""
    flows = was.shape.flows and _fields(was.shape) != _fields(now.shape)
    return flows or _parameters(was.shape) != _parameters(now.shape)


def _moved(a: Arrays, was: Operand, now: Operand, points: np.ndarray) -> np.ndarray:
    """Points of a shape at the next moment. was, now: the shape at both moments. Shapes: (N, 3)."""
    before, behind = (_matrix(x.shape, x.steps) for x in (was, now))
    local = _applied(np.linalg.inv(before), points)
    points = _applied(behind, was.shape.reshaped(local, _parameters(was.shape), _parameters(now.shape)))
    return _settled(a, was, now, points) if was.shape.flows and _bends(was, now) else points


def _matrix(shape: Primitive, steps: tuple[Transform, ...]) -> np.ndarray:
    """The 4 x 4 matrix from the coordinates that points of a shape keep to the world. steps: its transforms"""
    return to_world_matrix(scalars(shape).carrier().then(identity()), compose(steps))


def _parameters(shape: Primitive) -> tuple[float, ...]:
    """The parameters of the canonical shape as plain numbers."""
    return tuple(map(float, scalars(shape).shape()))


def _whole(matrix: np.ndarray | None) -> np.ndarray:
    """The 4 x 4 matrix of a 3 x 4 one. None: the identity."""
    return np.eye(4) if matrix is None else np.vstack([matrix, [0.0, 0.0, 0.0, 1.0]])


def _applied(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The points after an affine map. Shapes: matrix (4, 4), points (N, 3)."""
    # Not a product of matrices: a library would use threads for it, and they would wait for those of Dr.Jit.
    x, y, z = points.T
    return np.stack([m[0] * x + m[1] * y + m[2] * z + m[3] for m in matrix[:3]]).T


def _fields(shape: Primitive) -> dict[str, Any]:
    """The fields of a shape that decide where its surface is, before its transform and its cuts."""
    return {k: v for k, v in vars(shape).items() if k not in ("material", "cut_material", "transform", *ROLES)}


def _placed(a: Arrays, leaf: Operand) -> tuple[type[Primitive], Any]:
    """Kind of a leaf as an operand, and what the kind's `placed` returns for it."""
    kind = leaf.shape.operand_kind
    if kind.own_frames:
        body = leaf.shape.with_fields(transform=leaf.steps).body(())
        return kind, evaluated(kind.table(a, [body]).placed(None))
    return kind, evaluated(kind.table(a, [leaf.shape]).placed(Frame.table(a, composed([leaf.steps]))))


def _nearest(a: Arrays, leaves: list[Operand], points: np.ndarray) -> np.ndarray:
    """For each point, the number of the leaf whose surface is nearest. Shapes: points (N, 3), result (N)."""
    p = a.put(a.W, points.T)
    distances = []
    for leaf in leaves:
        kind, placed = _placed(a, leaf)
        distances.append(np.abs(np.array(kind.surface_at(placed, p)[0])))
    return np.argmin(np.stack([np.broadcast_to(x, len(points)) for x in distances]), axis=0)


def _settled(a: Arrays, was: Operand, now: Operand, points: np.ndarray) -> np.ndarray:
    """Points of a surface, moved along its normal to the nearest point of the changed surface. Those whose normal does
    not meet it stay where they are.

    was, now: the shape at both moments. points: the points after the shape's transform
    """
    (old_kind, old), (kind, placed) = (_placed(a, x) for x in (replace(now, shape=was.shape), now))
    p = a.put(a.W, points.T)
    n = dr.normalize(old_kind.surface_at(old, p)[1])
    # The points are rounded to single precision. The surface may lie on their other side.
    back = gamma(8, "single") * l1_norm(p)
    ways = []
    for d in (n, -n):
        dr.eval(p, d, back)
        ray = Ray(p - back * d, d)
        t = kind.crossing(kind.seen(placed, ray.o), ray, 0, None, NOTHING_KNOWN).t - back
        ways.append(evaluated(t))
    ahead = dr.abs(ways[0]) <= dr.abs(ways[1])
    way = dr.select(ahead, ways[0], -ways[1])
    end = dr.select(dr.isfinite(way), dr.fma(way, n, p), p)
    dr.eval(end)
    # NumPy's array of all three at once would need a kernel for each number of points.
    return np.stack([np.array(x) for x in end], axis=-1)


def _move_rows(rows: Rows, after: Rows, seen: np.ndarray, first: int, found: Motion) -> None:
    """Adds the motion of rows of a layer. Rows that the layer has no more stay where they are.

    seen: numbers of the rows among all objects
    first: that of the first row
    """
    index = seen - first
    there = np.minimum(np.searchsorted(after.number, rows.number[index]), len(after) - 1)
    kept = after.number[there] == rows.number[index]
    before, behind = (_row_frames(x, at[kept]) for x, at in ((rows, index), (after, there)))
    found.transport(seen[kept], before, behind)


def _row_frames(rows: Rows, at: np.ndarray) -> np.ndarray:
    """The 4 x 4 matrices of the frames of some rows. at: their numbers"""
    frames = np.tile(np.eye(4), (len(at), 1, 1))
    frames[:, :3] = Frame(*carrier(rows.gizmo, rows.stand)).matrices()[at]
    return frames
