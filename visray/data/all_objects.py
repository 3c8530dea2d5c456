"""All objects of a scene under their names: those that are written, and those that its data make.

The base of the data is named `data.base`, and row 12 of the layer `rain` is named `data.rain.12`. Names of written
objects have no dot, so each name is one object. Objects of rows are made when they are asked for.

A line is one object, too, with one name and one number. Where one example is enough, it is its first segment. Where all
segments count, they are the parts `data.roads.3:0`, `data.roads.3:1` and so on; all other objects are their own part.
"""

import re
from collections.abc import Callable, Collection, ItemsView, Iterator, Mapping, ValuesView

import numpy as np

from visray.data.data_scene import Data
from visray.data.layer import ROW_NUMBER
from visray.data.rows import Rows
from visray.primitives.primitive import Primitive

BASE = "data.base"


def address_of(name: str) -> str:
    """Address of the object with a name: that of a written object is below `objects`."""
    return name if "." in name else f"objects.{name}"


class AllObjects(Mapping[str, Primitive]):
    """The objects of a scene by name, numbered in order: the written ones, the base, then the rows of each layer."""

    def __init__(self, written: Mapping[str, Primitive], data: Data):
        self.written = {**written, BASE: data.base.object()}
        self.layers = data.rows
        sizes = [len(self.written), *(len(rows.first) for rows in self.layers.values())]
        # Number of the first row of each layer, among all objects.
        self.starts = dict(zip(self.layers, np.cumsum(sizes)[:-1].tolist()))
        self.count = sum(sizes)

    def __len__(self) -> int:
        return self.count

    def __iter__(self) -> Iterator[str]:
        yield from self.written
        for layer, rows in self.layers.items():
            yield from (f"data.{layer}.{number}" for number in rows.number[rows.first].tolist())

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and (name in self.written or self._row(name) is not None)

    def __getitem__(self, name: str) -> Primitive:
        if name in self.written:
            return self.written[name]
        found = self._row(name)
        if found is None:
            raise KeyError(name)
        return found[0].object(found[1])

    def _row(self, name: str) -> tuple[Rows, int] | None:
        """The layer of a row, and the row's index in it; None if there is no such row."""
        head, _, rest = name.partition(".")
        layer, _, number = rest.partition(".")
        if head != "data" or layer not in self.layers or not re.fullmatch(ROW_NUMBER, number):
            return None
        rows = self.layers[layer]
        i = rows.index(int(number))
        return None if i is None else (rows, i)

    def items(self) -> ItemsView[str, Primitive]:
        return _Items(self)

    def values(self) -> ValuesView[Primitive]:
        return _Values(self)

    @property
    def hidden(self) -> np.ndarray:
        """Numbers of the rows that the date of the data hides, among all objects."""
        found = [self.starts[name] + np.flatnonzero(rows.hidden) for name, rows in self.layers.items()]
        return np.concatenate([np.zeros(0, int), *found])

    @property
    def representatives(self) -> dict[str, Primitive]:
        """The written objects, the base, and the first row of each layer. All rows of a layer have its kind and its
        material, so these say which kinds and materials a scene has."""
        first = {f"data.{name}.{rows.number[0]}": rows.object(0) for name, rows in self.layers.items() if len(rows)}
        return self.written | first

    def parts(self) -> Iterator[tuple[str, Primitive]]:
        """Yields the name and the object of each part, in order."""
        yield from self.written.items()
        for layer, rows in self.layers.items():
            yield from _parts(layer, rows)

    def of_materials(
        self, materials: Collection[str], materials_of: Callable[[Primitive], tuple[str, ...]]
    ) -> dict[str, Primitive]:
        """The parts with one of these materials, by name, in order. materials_of: says which materials an object has"""
        found = {name: x for name, x in self.written.items() if not set(materials_of(x)).isdisjoint(materials)}
        for layer, rows in self.layers.items():
            if len(rows) and not set(materials_of(rows.object(0))).isdisjoint(materials):
                found.update(_parts(layer, rows))
        return found

    def materials(self, materials_of: Callable[[Primitive], tuple[str, ...]]) -> list[tuple[str, ...]]:
        """Names of the materials of each object, in order. materials_of: as in of_materials"""
        own = [materials_of(x) for x in self.written.values()]
        layers = [rows for rows in self.layers.values() if len(rows)]
        return own + [m for rows in layers for m in [materials_of(rows.object(0))] * len(rows.first)]


def _objects(layer: str, rows: Rows) -> Iterator[tuple[str, Primitive]]:
    """Yields the name and the object of each row of a layer."""
    for i, number in zip(rows.first.tolist(), rows.number[rows.first].tolist()):
        yield f"data.{layer}.{number}", rows.object(i)


def part_names(layer: str, rows: Rows) -> Iterator[str]:
    """Yields the name of each gizmo of a layer."""
    sizes = np.diff(rows.first, append=len(rows))
    for number, size in zip(rows.number[rows.first].tolist(), sizes.tolist()):
        name = f"data.{layer}.{number}"
        yield from [name] if size == 1 else (f"{name}:{i}" for i in range(size))


def _parts(layer: str, rows: Rows) -> Iterator[tuple[str, Primitive]]:
    """Yields the name and the object of each part of a layer."""
    return zip(part_names(layer, rows), map(rows.object, range(len(rows))))


class _Items(ItemsView):
    """The items of AllObjects. They are made one after another, without a search for each name."""

    def __iter__(self) -> Iterator[tuple[str, Primitive]]:
        yield from self._mapping.written.items()
        for layer, rows in self._mapping.layers.items():
            yield from _objects(layer, rows)


class _Values(ValuesView):
    """As _Items."""

    def __iter__(self) -> Iterator[Primitive]:
        return (x for _, x in self._mapping.items())
