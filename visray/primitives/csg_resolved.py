"""Objects with operands in one form: without instances, and with a difference in place of each cut.

This form is remembered for each object: many parts of visray ask for it, and instances of one geometry share its
operands.
"""

from collections.abc import Mapping
from typing import Any
from weakref import ref

from visray.operands import named_operands
from visray.primitives.csg import Csg
from visray.primitives.csg_operands import NO_MATERIAL
from visray.primitives.instance import Instance
from visray.primitives.primitive import Primitive

# Fields of an object that has cuts. The difference that replaces it has them. An intersection or a difference also
# needs the cut_material itself.
UNCUT = {"cut": None, "material": NO_MATERIAL, "transform": ()}


class _Entry(ref):
    """An object whose form is remembered: a weak reference to it.

    key: its identity (id).
    form: its form. It does not refer to the object itself.
    used: the geometries in it, by name.
    """

    __slots__ = ("form", "key", "used")


_entries: dict[int, _Entry] = {}


def _forget(entry: _Entry, pop: Any = _entries.pop) -> None:
    """Removes an entry when its object no longer exists. pop: a default argument, because at exit Python may delete the
    module's globals first."""
    pop(entry.key, None)


def resolved(obj: Primitive, geometries: Mapping[str, Primitive]) -> Primitive:
    """The object with its geometry in place of each instance, and a difference in place of each cut, at all depths.

    geometries: the geometries of the scene.
    """
    return _resolved(obj, geometries, {})


def _resolved(obj: Primitive, geometries: Mapping[str, Primitive], used: dict[str, Primitive]) -> Primitive:
    """As `resolved`. used: the geometries in the object are added to it, by name."""
    if not (obj.cut or isinstance(obj, (Csg, Instance))):
        return obj
    entry = _entries.get(id(obj))
    if (
        entry is None
        or entry() is not obj
        or any(geometries.get(name) is not shape for name, shape in entry.used.items())
    ):
        entry = _Entry(obj, _forget)
        entry.key, entry.used = id(obj), {}
        entry.form = _made(obj, geometries, entry.used)
        _entries[entry.key] = entry
    used.update(entry.used)
    return entry.form


def _made(obj: Primitive, geometries: Mapping[str, Primitive], used: dict[str, Primitive]) -> Primitive:
    """As `_resolved`, for an object whose form is not remembered."""
    if isinstance(obj, Instance):
        geometry = used[obj.geometry] = geometries[obj.geometry]
        inner = _resolved(geometry, geometries, used)
        if obj.cut:
            return _cut(inner.with_fields(material=NO_MATERIAL), obj, geometries, used)
        return inner.with_fields(material=obj.material, transform=inner.transform + obj.transform)
    if obj.cut:
        return _cut(_made(obj.with_fields(**UNCUT), geometries, used), obj, geometries, used)
    if isinstance(obj, Csg):
        inner = tuple(_resolved(x, geometries, used) for x in named_operands(obj.of).values())
        return obj.with_fields(of=inner)
    return obj


def _cut(inner: Primitive, obj: Primitive, geometries: Mapping[str, Primitive], used: dict[str, Primitive]) -> Csg:
    """An object with cuts as a difference. inner: the object without its cuts, material and transform."""
    cuts = (_resolved(x, geometries, used) for x in named_operands(obj.cut).values())
    return Csg(op="difference", of=(inner, *cuts), material=obj.material, transform=obj.transform,
               cut_material=obj.cut_material)  # fmt: skip
