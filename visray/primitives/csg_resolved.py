"""Objects with operands in one form: without instances, and with a difference in place of each cut.

This form is remembered for each object: many parts of visray ask for it, and instances of one geometry share its
operands.
"""

from collections.abc import Mapping

from visray.identity_cache import IdentityCache
from visray.operands import named_operands
from visray.primitives.csg import Csg
from visray.primitives.csg_operands import NO_MATERIAL
from visray.primitives.instance import Instance
from visray.primitives.primitive import Primitive

# Fields of an object that has cuts. The difference that replaces it has them. An intersection or a difference also
# needs the cut_material itself.
UNCUT = {"cut": None, "material": NO_MATERIAL, "transform": ()}
# Objects made of it have other fields, which are not checked: visray's own names of materials have dots.
DIFFERENCE = Csg(op="difference", of=())
# For each object its form, which does not refer to the object itself, and the geometries in it, by name.
_entries = IdentityCache()


def resolved(obj: Primitive, geometries: Mapping[str, Primitive]) -> Primitive:
    """The object with its geometry in place of each instance, and a difference in place of each cut, at all depths.

    geometries: the geometries of the scene.
    """
    return _resolved(obj, geometries, {})


def _resolved(obj: Primitive, geometries: Mapping[str, Primitive], used: dict[str, Primitive]) -> Primitive:
    """As `resolved`. used: the geometries in the object are added to it, by name."""
    if not (obj.cut or isinstance(obj, (Csg, Instance))):
        return obj
    form, own = _entries.get(obj) or (None, {})
    if form is None or any(geometries.get(name) is not shape for name, shape in own.items()):
        own = {}
        form = _made(obj, geometries, own)
        _entries.put(obj, (form, own))
    used.update(own)
    return form


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
    own = {"material": obj.material, "transform": obj.transform, "cut_material": obj.cut_material}
    return DIFFERENCE.with_fields(of=(inner, *cuts), **own)
