"""Finds the numbers of a scene in its packed arrays, by address: for derivatives and updates.

An address is the dotted name of a value in a scene, such as `objects.ball.radius` (scene/address.py).
"""

from collections.abc import Iterator
from dataclasses import dataclass, is_dataclass
from functools import cached_property
from typing import Any

import numpy as np

from visray.columns import Columns, materials_of
from visray.data.all_objects import address_of
from visray.errors import UserError
from visray.pack import LightColumns, Packed
from visray.primitives.csg_bodies import Body
from visray.primitives.csg_operands import operand_at, operands
from visray.primitives.instance import Instance
from visray.primitives.mesh import Mesh
from visray.primitives.primitive import Primitive
from visray.quantities import quantities
from visray.scene import address as addresses
from visray.scene.scene import Scene


@dataclass(frozen=True)
class Slot:
    """The place where the packed arrays contain the value of one address: a number or a triple of numbers.

    arrays: the arrays that contain the value. A background of one colour is stored twice, as top and bottom of a sky,
        and has two arrays. A value of a geometry is stored once for each of its instances.
    rows: for each array, the indices of the entries that contain the value
    component: 0, 1 or 2 for one number of a triple; None for the whole entry
    """

    arrays: tuple[Any, ...]
    rows: tuple[tuple[int, ...], ...]
    component: int | None

    @staticmethod
    def at(arrays: tuple[Any, ...], row: int, component: int | None) -> "Slot":
        """The place of a value that is the entry `row` of each array."""
        return Slot(arrays, ((row,),) * len(arrays), component)

    def read(self, values: tuple | list) -> Any:
        """Reads the entry at this place from `values`. Returns a number, or a NumPy array of three numbers.

        values: one array for each of `self.arrays`, of the same shape, such as its gradient. If there are several
            entries, they are added.
        """
        entry = sum(np.array(v, float)[..., list(rows)].sum(-1) for v, rows in zip(values, self.rows))
        return float(entry) if entry.ndim == 0 else entry if self.component is None else float(entry[self.component])

    def spread(self, value: np.ndarray) -> list[np.ndarray]:
        """NumPy arrays with the shapes of `self.arrays` that are `value` at this place and 0 elsewhere, as a list.

        value: a number, or a triple for each component. Shapes: () or (3)
        """
        full = [np.zeros(np.array(v).shape) for v in self.arrays]
        for x, rows in zip(full, self.rows):
            x[(Ellipsis, list(rows)) if self.component is None else (self.component, list(rows))] = (
                value[:, None] if value.ndim else value
            )
        return full


@dataclass(frozen=True)
class TableSlot:
    """The place where the packed arrays contain a table of triples, such as the vertices of a mesh.

    arrays: the arrays that contain the table. A table of a geometry may be stored several times
    starts: for each array, the indices of the entries with which the table starts
    count: number of triples
    """

    arrays: tuple[Any, ...]
    starts: tuple[tuple[int, ...], ...]
    count: int

    def read(self, values: tuple | list) -> np.ndarray:
        """As Slot.read. Shape: (count, 3)."""
        tables = [np.array(v, float)[:, i : i + self.count] for v, starts in zip(values, self.starts) for i in starts]
        return sum(tables).T

    def spread(self, value: np.ndarray) -> list[np.ndarray]:
        """As Slot.spread. value: a number, or a table of shape (count, 3)."""
        full = [np.zeros(np.array(v).shape) for v in self.arrays]
        for x, starts in zip(full, self.starts):
            for i in starts:
                x[:, i : i + self.count] = value.T
        return full


class AddressIndex:
    """Maps the addresses of a scene to places in its packed arrays."""

    def __init__(self, scene: Scene, packed: Packed):
        self.scene, self.packed = scene, packed

    def row_of(self, section: tuple[Columns, ...] | tuple[LightColumns, ...], name: str) -> tuple[int, int]:
        """Number of the batch that contains an object or a light, and the row in this batch. Raises KeyError if there
        is none.

        section: batches of all objects, or batches of all lights
        name: name of the object or light
        """
        for number, batch in enumerate(section):
            if (row := batch.names.row(name)) is not None:
                return number, row
        raise KeyError(name)

    def slot(self, address: str) -> Slot | TableSlot:
        """The place of the value at `address`. Raises UserError if the picture does not depend smoothly on this value,
        or if the address names more than one number, triple or table."""
        parts, packed = address.split("."), self.packed
        head, name, field = (parts + ["", ""])[:3]
        if isinstance(value := addresses.value(self.scene, address), dict) or is_dataclass(value):
            raise UserError(f"{address}: is not one number or three; name one of its parts")
        if head == "ambient":
            return Slot.at((packed.ambient,), 0, int(name) if name else None)
        if head == "background":
            plain, sky = isinstance(self.scene.background, tuple), packed.background
            if not plain and name not in quantities(type(sky)):
                raise UserError(
                    f"{address}: has no derivative; those of background are {', '.join(quantities(type(sky)))}"
                )
            numbers = (sky.top, sky.bottom) if plain else (getattr(sky, name),)
            rest = name if plain else field
            return Slot.at(numbers, 0, int(rest) if rest else None)
        if head == "camera":
            table, row, field, rest = packed.camera, 0, name, parts[2:]
        elif head == "materials":
            return self._of_material(address, name, field, parts[3:])
        elif head in ("objects", "geometries"):
            return self._of_shape(getattr(self.scene, head)[name], address, parts[2:])
        elif head == "data":
            return self._of_row(address, parts)
        elif head == "lights":
            number, row = self.row_of(packed.lights, name)
            table, rest = packed.lights[number].numbers, parts[3:]
        elif address == "settings.occlusion.distance":
            table, row, rest = packed.occlusion, 0, parts[3:]
        elif head == "textures" and address in addresses.numeric_addresses(self.scene):
            raise UserError(f"{address}: derivatives by textures are not computed; vr.difference takes differences")
        else:
            raise UserError(f"{address}: is not a number that a picture depends on smoothly")
        if field not in quantities(type(table)):
            raise UserError(f"{address}: has no derivative; those of {head} are {', '.join(quantities(type(table)))}")
        return Slot.at((getattr(table, field),), row, int(rest[0]) if rest else None)

    def _of_material(self, address: str, name: str, field: str, rest: list[str]) -> Slot:
        """The place of a number of a material. A kd that is the ambient colour too is stored twice.

        name, field, rest: parts of the address behind the section
        """
        materials, table = materials_of(self.scene), self.packed.materials
        if field == "color" and materials[name].ka is not None:
            raise UserError(f"{address}: has no derivative, as it also sets ka, which is written here; name kd")
        field = "kd" if field == "color" else field
        if field not in quantities(type(table)):
            known = ", ".join(quantities(type(table)))
            raise UserError(f"{address}: has no derivative; those of materials are {known}")
        if getattr(materials[name], field) is None:
            raise UserError(
                f"{address}: has no derivative of its own, as ka follows kd; name kd, or write numbers in ka"
            )
        names = ("kd", "ka") if field == "kd" and materials[name].ka_is_kd else (field,)
        arrays = tuple(getattr(table, x) for x in names)
        return Slot.at(arrays, list(materials).index(name), int(rest[0]) if rest else None)

    def _of_row(self, address: str, parts: list[str]) -> Slot:
        """The place of a number of a row of a data layer. Raises UserError if the address is another one.

        parts: the address, split at the dots
        """
        known = "a row's lon, lat, height, radius and color, where the layer takes them from columns"
        if len(parts) != 4 or parts[1] not in self.scene.data.layers:
            raise UserError(f"{address}: has no derivative; those of data are {known}")
        # A row may have several gizmos: segments of a line, or bodies of a union, which can be in several batches.
        row_of = {i: batch.names.row(".".join(parts[:3])) for i, batch in enumerate(self.packed.batches)}
        places = [(self.packed.batches[i], row) for i, row in row_of.items() if row is not None]
        if not places:
            raise UserError(f"{address}: has no derivative, as the row has no gizmo")
        arrays, rows = [], []
        for batch, row in places:
            values = batch.color if parts[3] == "color" else getattr(batch.numbers, "values", None)
            array = getattr(values, "value" if parts[3] == "color" else parts[3], None)
            if array is not None:
                arrays.append(array)
                rows.append(tuple(range(row, row + batch.names.repeats(row))))
        if not arrays:
            raise UserError(f"{address}: has no derivative; those of data are {known}, and are no geometries")
        if flaw := self.scene.data.rows[parts[1]].slope_flaw(int(parts[2]), parts[3]):
            raise UserError(f"{address}: has no derivative, {flaw}")
        return Slot(tuple(arrays), tuple(rows), None)

    @cached_property
    def _leaves(self) -> dict[str, list[tuple[str, int]]]:
        """The operands of CSG by their addresses: names of objects and bodies, and numbers of the leaves in them."""
        found: dict[str, list[tuple[str, int]]] = {}
        scene = self.scene
        walks = {
            name: operands(address_of(name), obj, scene.geometries)
            for name, obj in scene.written_objects.items()
            if scene.shape_of(obj).composite and name not in scene.unions
        }
        walks |= {body: x.operand.walk(scene.geometries) for body, x in self._bodies if scene.shape_of(x.obj).composite}
        for name, walk in walks.items():
            for number, leaf in enumerate(x for x in walk if x.is_leaf):
                found.setdefault(leaf.address, []).append((name, number))
        return found

    def operand_of(self, name: str, leaf: int) -> str | None:
        """Address of a leaf of CSG; None for rows of data. name: name of the object or body; leaf: number in it."""
        return self._addresses.get((name, leaf))

    @cached_property
    def _addresses(self) -> dict[tuple[str, int], str]:
        """The addresses of the leaves of CSG, by the names of objects and bodies and the numbers of leaves in them."""
        return {place: address for address, places in self._leaves.items() for place in places}

    @property
    def _bodies(self) -> Iterator[tuple[str, Body]]:
        """Yields the bodies of all unions that are drawn as several, by name."""
        yield from (item for bodies in self.scene.unions.values() for item in bodies.items())

    def _plain(self, own: str) -> list[str]:
        """Names of the objects and bodies that show a shape and are not CSG. own: address of the shape."""
        section, _, name = own.partition(".")
        shown = self.scene.written_objects
        if section == "objects":
            # The numbers of an instance's shape are those of its geometry.
            names = [] if isinstance(shown.get(name), Instance) else [name]
        else:
            names = [n for n, x in shown.items() if getattr(x, "geometry", None) == name]
        names = [n for n in names if n in shown and not self.scene.shape_of(shown[n]).composite]
        bodies = (body for body, x in self._bodies if x.operand.address == own)
        return names + [body for body in bodies if not self.scene.shape_of(self.scene.bodies[body]).composite]

    def _tables(self, own: str) -> Iterator[tuple[type[Primitive], Any, int]]:
        """Yields the kind, the table and the row of each copy of a shape in the packed arrays. For meshes, a row is a
        mesh. own: address of the shape."""
        for name in self._plain(own):
            number, row = self.row_of(self.packed.batches, name)
            batch = self.packed.batches[number]
            yield batch.kind, batch.numbers, batch.names.listed.index(name) if batch.kind.many_rows else row
        for name, leaf in self._leaves.get(own, ()):
            number, row = self.row_of(self.packed.batches, name)
            table, row = self.packed.batches[number].numbers.leaf(row, leaf)
            yield table.kind, table.numbers, row

    def _layer_of(self, own: str) -> str | None:
        """Name of a data layer whose rows show a shape of a geometry; None if there is none. own: address of the shape.

        The rows have copies of its numbers, which are not packed one by one.
        """
        layers = self.scene.data.rows.items() if self.scene.data is not None else ()
        for name, rows in layers:
            if rows.geometry is not None and len(rows):
                shown = operands("", rows.object(0), self.scene.geometries)
                if any(x.address == own for x in shown):
                    return name
        return None

    def _of_shape(self, shape: Primitive, address: str, path: list[str]) -> Slot | TableSlot:
        """The place of one value of an object, an operand or a geometry. Raises UserError if the value has no
        derivative.

        shape: the object or the geometry
        address: address of the value
        path: rest of the address after that of the shape, split at the dots
        """
        shape, path = operand_at(shape, path)
        own = address.removesuffix("." + ".".join(path))
        if layer := self._layer_of(own):
            raise UserError(f"{address}: has no derivative, as rows of data.layers.{layer} show this geometry")
        if shape.many_rows:
            return self._of_mesh(shape, address, own, path)
        rows: dict[int, list[int]] = {}
        tables: dict[int, tuple[type[Primitive], Any]] = {}
        for kind, table, row in self._tables(own):
            rows.setdefault(id(table), []).append(row)
            tables[id(table)] = kind, table
        columns = [kind.columns(shape, table) for kind, table in tables.values()]
        for field in columns[0] if columns else ():
            size = len(field.split("."))
            if ".".join(path[:size]) == field:
                arrays = tuple(x[field] for x in columns)
                return Slot(arrays, tuple(map(tuple, rows.values())), int(path[size]) if path[size:] else None)
        known = ", ".join(columns[0] if columns else ()) or "none of its own"
        raise UserError(f"{address}: has no derivative; those of a {shape.type} are {known}")

    def _of_mesh(self, mesh: Mesh, address: str, own: str, path: list[str]) -> TableSlot:
        """As _of_shape, for a mesh. Only its vertices have derivatives."""
        problem = None
        if path != ["vertices"]:
            problem = "those of a mesh are vertices"
        elif mesh.vertices is None:
            problem = "the vertices are in a file; give vertices and faces in the scene"
        elif mesh.fit is not None:
            problem = "fit scales the mesh by the vertices; give fitted vertices, and leave fit out"
        if problem:
            raise UserError(f"{address}: has no derivative; {problem}")
        starts: dict[int, list[int]] = {}
        arrays = {}
        for _, table, row in self._tables(own):
            vertices, start = table.vertices.value, table.first_vertex(row)
            arrays[id(table)] = vertices
            if start not in starts.setdefault(id(table), []):  # bodies with one mesh share its vertices
                starts[id(table)].append(start)
        return TableSlot(tuple(arrays.values()), tuple(map(tuple, starts.values())), len(mesh.vertices))
