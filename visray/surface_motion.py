"""Where points of surfaces go from one moment to another.

A point keeps its coordinates in the frame of its shape (Primitive.carrier) while the numbers of the shape change. So it
keeps its texture coordinates u and v, too. Points of polynomial surfaces move along the normal, because such a surface
has no frame that follows its parameters.
"""

from dataclasses import dataclass, field
from typing import Any

import drjit as dr
import numpy as np

from visray.data.all_objects import BASE
from visray.data.gizmos import carrier
from visray.data.rows import Rows
from visray.geometry import Frame
from visray.operands import ROLES
from visray.primitives.csg_operands import Operand, operands
from visray.primitives.instance import Instance
from visray.primitives.primitive import Primitive, identity, scalars, to_world_matrix
from visray.pytree import evaluated
from visray.quantities import Arrays
from visray.scene.scene import Scene
from visray.transforms import Transform, compose, composed

# Steps of Newton's method from a point to the changed surface. Each step doubles the number of right digits.
STEPS = 5
# A point is on the surface if the last step is shorter than this share of the whole way.
ARRIVED = 1e-3


@dataclass
class Motions:
    """Affine motions of many objects, to be applied to all their points at once.

    matrices: one 3 x 4 matrix for each motion
    lanes: for each motion, the numbers of the points that it moves
    """

    matrices: list[np.ndarray] = field(default_factory=list)
    lanes: list[np.ndarray] = field(default_factory=list)

    def note(self, before: np.ndarray, behind: np.ndarray, lanes: np.ndarray) -> None:
        """Adds the motion of points that keep their coordinates in a frame. before, behind: its 4 x 4 matrices"""
        self.matrices.append((behind @ np.linalg.inv(before))[:3])
        self.lanes.append(lanes)

    def apply(self, points: np.ndarray) -> None:
        """Moves the points."""
        if self.lanes:
            lanes, sizes = np.concatenate(self.lanes), [len(x) for x in self.lanes]
            points[lanes] = _applied(np.stack(self.matrices)[np.repeat(np.arange(len(sizes)), sizes)], points[lanes])


def carried(a: Arrays, scene: Scene, after: Scene, points: np.ndarray, number: np.ndarray) -> np.ndarray:
    """The points of surfaces of a scene, where they are in the scene of another moment.

    number: number in the scene of the object that each point lies on, from 1; 0 for points of no object, which stay
        where they are, as do those of objects that the other scene does not have.

    Shapes: points (N, 3), number (N).
    """
    moved, motions = points.copy(), Motions()
    written, others = scene.written_objects, after.written_objects
    for name, lanes in _lanes_of(number, list(written)).items():
        if name in others and not _stays(written[name], others[name], scene, after):
            of_both = [(x, _leaves(x, s)) for x, s in ((written[name], scene), (others[name], after))]
            _move(a, *of_both, moved, lanes, motions)
    for name, rows in scene.data.rows.items() if scene.data is not None else ():
        first = scene.all_objects.starts[name] + 1
        lanes = np.flatnonzero((number >= first) & (number < first + len(rows.first)))
        other = after.data.rows.get(name, rows)
        if len(lanes) and other is not rows:
            if rows.gizmo.on_line:
                # Lines lie on the base.
                motions.note(*(_matrix(x[BASE], x[BASE].transform) for x in (written, others)), lanes)
            elif len(other):
                _move_rows(rows, other, number[lanes] - first, moved, lanes)
    motions.apply(moved)
    return moved


def _lanes_of(number: np.ndarray, names: list[str]) -> dict[str, np.ndarray]:
    """For each name of an object that is seen, the numbers of its points."""
    order = np.argsort(number, kind="stable")
    seen, starts = np.unique(number[order], return_index=True)
    lanes = np.split(order, starts[1:])
    return {names[n - 1]: at for n, at in zip(seen.tolist(), lanes) if 0 < n <= len(names)}


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
    a: Arrays, old: tuple[Primitive, list[Operand]], new: tuple[Primitive, list[Operand]], points: np.ndarray,
    lanes: np.ndarray, motions: Motions,
) -> None:  # fmt: skip
    """Moves the points of one object, or notes how they move.

    old, new: the object and its leaves, at both moments
    lanes: the numbers of its points
    """
    (obj, leaves), (other, others) = old, new
    if [type(x.shape) for x in leaves] != [type(x.shape) for x in others]:
        # The leaves cannot be matched. The object as a whole still has a transform.
        motions.note(_whole(compose(obj.transform)), _whole(compose(other.transform)), lanes)
        return
    of_lane = np.zeros(len(lanes), int) if len(leaves) == 1 else _nearest(a, leaves, points[lanes])
    for i, (was, now) in enumerate(zip(leaves, others)):
        own = lanes[of_lane == i]
        if len(own) and (was.shape, was.steps) != (now.shape, now.steps):
            _move_leaf(a, was, now, points, own, motions)


def _move_leaf(a: Arrays, was: Operand, now: Operand, points: np.ndarray, lanes: np.ndarray, motions: Motions) -> None:
    """Moves points of a shape, or notes how they move. was, now: the shape at both moments"""
    before, behind = (_matrix(x.shape, x.steps) for x in (was, now))
    old, new = (_parameters(x.shape) for x in (was, now))
    bends = was.shape.flows and _fields(was.shape) != _fields(now.shape)
    if old == new and not bends:
        motions.note(before, behind, lanes)
        return
    local = was.shape.reshaped(_applied(np.linalg.inv(before)[None, :3], points[lanes]), old, new)
    points[lanes] = _applied(behind[None, :3], local)
    if bends:
        points[lanes] = _settled(a, now, points[lanes])


def _matrix(shape: Primitive, steps: tuple[Transform, ...]) -> np.ndarray:
    """The 4 x 4 matrix from the coordinates that points of a shape keep to the world. steps: its transforms"""
    return to_world_matrix(scalars(shape).carrier().then(identity()), compose(steps))


def _parameters(shape: Primitive) -> tuple[float, ...]:
    """The parameters of the canonical shape as plain numbers."""
    return tuple(map(float, scalars(shape).shape()))


def _whole(matrix: np.ndarray | None) -> np.ndarray:
    """The 4 x 4 matrix of a 3 x 4 one. None: the identity."""
    return np.eye(4) if matrix is None else np.vstack([matrix, [0.0, 0.0, 0.0, 1.0]])


def _applied(matrices: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The points after affine maps. Shapes: matrices (N, 3, 4) or (1, 3, 4), points (N, 3)."""
    if len(matrices) == 1:
        return points @ matrices[0, :, :3].T + matrices[0, :, 3]
    return (matrices[:, :, :3] @ points[:, :, None])[:, :, 0] + matrices[:, :, 3]


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


def _settled(a: Arrays, leaf: Operand, points: np.ndarray) -> np.ndarray:
    """The points, moved along the normal onto the surface of a shape. Those that do not arrive stay where they are."""
    kind, placed = _placed(a, leaf)
    p = q = a.put(a.W, points.T)
    for _ in range(STEPS):
        f, g = kind.surface_at(placed, q)
        step = f * g
        q = q - step
        dr.eval(q, step)
    arrived = dr.norm(step) <= ARRIVED * dr.norm(q - p)
    return np.array(dr.select(arrived, q, p)).T


def _move_rows(rows: Rows, after: Rows, index: np.ndarray, points: np.ndarray, lanes: np.ndarray) -> None:
    """Moves points of the rows of a layer. Rows that the layer has no more stay where they are.

    index: for each point its row, among those that are shown
    lanes: numbers of the points
    """
    seen, of_lane = np.unique(index, return_inverse=True)
    there = np.minimum(np.searchsorted(after.number, rows.number[seen]), len(after) - 1)
    found = after.number[there] == rows.number[seen]
    before, behind = (_row_frames(x, at[found]) for x, at in ((rows, seen), (after, there)))
    motion = np.tile(np.eye(4), (len(seen), 1, 1))
    motion[found] = behind @ np.linalg.inv(before)
    points[lanes] = _applied(motion[of_lane, :3], points[lanes])


def _row_frames(rows: Rows, at: np.ndarray) -> np.ndarray:
    """The 4 x 4 matrices of the frames of some rows. at: their numbers"""
    frames = np.tile(np.eye(4), (len(at), 1, 1))
    frames[:, :3] = Frame(*carrier(rows.gizmo, rows.stand)).matrices()[at]
    return frames
