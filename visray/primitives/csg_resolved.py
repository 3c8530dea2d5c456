"""Objects with operands in one form: without instances, and with a difference in place of each cut."""

from collections.abc import Mapping

from visray.operands import named_operands
from visray.primitives.csg import Csg
from visray.primitives.csg_operands import NO_MATERIAL
from visray.primitives.instance import Instance
from visray.primitives.primitive import Primitive

# Fields of an object that has cuts. The difference that replaces it has them. An intersection or a difference also
# needs the cut_material itself.
UNCUT = {"cut": None, "material": NO_MATERIAL, "transform": ()}


def resolved(obj: Primitive, geometries: Mapping[str, Primitive]) -> Primitive:
    """The object with its geometry in place of each instance, and a difference in place of each cut, at all depths.

    geometries: the geometries of the scene.
    """
    if isinstance(obj, Instance):
        inner = resolved(geometries[obj.geometry], geometries)
        if obj.cut:
            return _cut(inner.with_fields(material=NO_MATERIAL), obj, geometries)
        return inner.with_fields(material=obj.material, transform=inner.transform + obj.transform)
    if obj.cut:
        return _cut(resolved(obj.with_fields(**UNCUT), geometries), obj, geometries)
    if isinstance(obj, Csg):
        return obj.with_fields(of=tuple(resolved(x, geometries) for x in named_operands(obj.of).values()))
    return obj


def _cut(inner: Primitive, obj: Primitive, geometries: Mapping[str, Primitive]) -> Csg:
    """An object with cuts as a difference. inner: the object without its cuts, material and transform."""
    cuts = (resolved(x, geometries) for x in named_operands(obj.cut).values())
    return Csg(op="difference", of=(inner, *cuts), material=obj.material, transform=obj.transform,
               cut_material=obj.cut_material)  # fmt: skip
