"""Gizmos of data layers that are geometries: the bodies of which each is made, and what their surfaces look like.

Most geometries are one body. A union of transparent solids is several (primitives/csg_bodies.py).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from visray.columns import Looks, sides
from visray.data.row_table import NO_ROW
from visray.data.rows import ROW_MATERIAL, Rows
from visray.geometry import Frame
from visray.primitives.csg_bodies import Body, separate_bodies
from visray.primitives.csg_copies import copies
from visray.primitives.csg_operands import Operand, operands
from visray.primitives.instance import Instance
from visray.primitives.mesh import Mesh
from visray.primitives.mesh_buffers import Body as MeshPlace
from visray.primitives.primitive import Primitive
from visray.pytree import rows as gathered
from visray.quantities import Arrays
from visray.scene.scene import Scene
from visray.transforms import Matrix, composed, product

UNMOVED = Matrix(matrix=((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)))


@dataclass(frozen=True)
class GizmoBodies:
    """Bodies of one kind that each gizmo of a layer has.

    kind: class whose methods serve the bodies
    rows: the rows of the layer
    operands: the bodies of one gizmo, before it is moved
    shapes: the same as objects without instances and cuts, in the order of the rows of a batch: all bodies of the first
        row, then all of the second one, and so on. Their last transform moves nothing; rows have their frames in its
        place
    colored: whether these bodies have the colours of the rows. CSG may have operands that do not
    """

    kind: type[Primitive]
    rows: Rows
    operands: tuple[Operand, ...]
    shapes: tuple[Primitive, ...]
    colored: bool

    def __len__(self) -> int:
        """Number of rows of the batch."""
        return len(self.rows) * len(self.shapes)

    def materials(self) -> list[tuple[str, bool]]:
        """For each body of a gizmo the name of its material, and whether v ends at poles, as `columns.sides` takes
        them."""
        named = [x.form.medium if self.kind.composite else x.material for x in self.shapes]
        return [(self._own(name), self.kind.v_ends) for name in named]

    def table(self, a: Arrays) -> tuple[Any, Frame | None]:
        """Table and frames of the batch: the table of one gizmo, repeated."""
        gizmos, own = Frame(*self.rows.fields["frame"]).matrices(), len(self.shapes)
        if self.kind.composite:
            return copies(self.kind.table(a, list(self.shapes)), gizmos), None
        index = a.put(a.U, np.tile(np.arange(own), len(self.rows)).astype(np.uint32))
        outer = np.repeat(gizmos, own, axis=0)

        def moved(inner: np.ndarray) -> Frame:
            return Frame.table(a, product(outer, np.tile(inner, (len(self.rows), 1, 1))))

        if isinstance(self.shapes[0], Mesh):
            bodies = self.kind.table(a, [MeshPlace(x) for x in self.shapes])
            return bodies.moved(index, moved(bodies.frame.matrices())), None
        table = self.kind.table(a, list(self.shapes))
        return gathered(table, index), moved(composed([x.transform for x in self.shapes]))

    def looks(self, scene: Scene, a: Arrays) -> Looks | None:
        """The looks of the operands of CSG: those that all rows have in common, then those with the colours of rows.
        None for other kinds."""
        if not self.kind.composite:
            return None
        leaves = [leaf for x in self.shapes for leaf in x.form.leaves]
        pairs = [(x.material, x.shape.operand_kind.v_ends) for x in leaves]
        # sorted() keeps the order of equal keys.
        looks = sorted(dict.fromkeys(pairs), key=lambda pair: pair[0] == ROW_MATERIAL)
        count, own = len(self.rows), sum(name == ROW_MATERIAL for name, _ in looks)
        common, row = len(looks) - own, np.arange(count)
        index = np.array([looks.index(pair) for pair in pairs])
        # Look k >= common has an entry for each row, from common + count (k - common) on.
        first = np.where(index < common, index, common + count * (index - common))
        of = first + np.where(index < common, 0, 1) * row[:, None]
        kept = np.concatenate([np.arange(common), np.repeat(np.arange(common, len(looks)), count)])
        colour_of = np.concatenate([np.full(common, NO_ROW), np.tile(row * len(self.shapes), own)])
        of, kept, colour_of = (a.put(a.U, x.ravel().astype(np.uint32)) for x in (of, kept, colour_of))
        made = Looks(None, **sides(scene, a, [(self._own(name), v_ends) for name, v_ends in looks]))
        return replace(gathered(made, kept), of=of, row=colour_of if self.colored else None)

    def _own(self, material: str) -> str:
        """Name of a material of the scene, that of the layer in place of ROW_MATERIAL."""
        return self.rows.material if material == ROW_MATERIAL else material


def gizmo_bodies(scene: Scene, rows: Rows) -> list[GizmoBodies]:
    """The bodies of the gizmos of a layer, by kinds. Domain: gizmos that are a geometry."""
    transparent = {name for name, m in scene.materials.items() if any(m.kt)}
    if rows.material in transparent:
        transparent.add(ROW_MATERIAL)
    material = rows.material if rows.color is None else ROW_MATERIAL
    # The name ROW_MATERIAL is not one that a user can write, so it is set without a check.
    gizmo = Instance(geometry=rows.geometry, transform=(UNMOVED,)).with_fields(material=material)
    bodies: Sequence[Body] = list(separate_bodies("", gizmo, scene.geometries, transparent).values())
    if not bodies:
        bodies = [Body(next(operands("", gizmo, scene.geometries)), gizmo)]
    found: dict[tuple, list[tuple[Operand, Primitive]]] = {}
    for body in bodies:
        shape = scene.placed_shape(body.obj)
        kind = shape.body_kind if isinstance(shape, Mesh) else shape.kind
        found.setdefault((kind, body.obj.material == ROW_MATERIAL), []).append((body.operand, shape))
    return [GizmoBodies(kind, rows, *zip(*members), colored) for (kind, colored), members in found.items()]
