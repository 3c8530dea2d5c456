"""Unions whose operands are drawn as bodies of their own, each a row of the kernel like any other object.

A union of transparent solids keeps the surfaces inside it, which one solid does not have. Rays find very many solids
faster as rows in lists or in a tree. All bodies of a union have the number and the name of the union.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from visray.primitives.csg import Csg
from visray.primitives.csg_operands import NO_MATERIAL, Operand, bodies
from visray.primitives.instance import Instance
from visray.primitives.plane import Plane
from visray.primitives.primitive import Primitive

# Largest number of opaque operands of a union that is one solid. Rays find more than these several times as fast in
# lists or in a tree (merge and objects in reference/csg_growth.py). Fewer stay one solid, because only within a solid
# there is a rule for faces that coincide.
MOST_JOINED = 64
# The CSG that a half-space becomes has other fields, which are not checked: names of materials that visray makes have
# dots.
MERGE = Csg(op="merge", of=())


@dataclass(frozen=True)
class Body:
    """A body of a union.

    operand: the operand of the union.
    obj: the same as an object, with the operand's material, and all transforms from its coordinates to the world.
    """

    operand: Operand
    obj: Primitive


def separate_bodies(
    address: str, obj: Primitive, geometries: Mapping[str, Primitive], transparent: Collection[str]
) -> dict[str, Body]:
    """The bodies of an object that is drawn as several, by name; empty for all other objects. The name of a body is its
    address, such as `objects.lens.of.front`; below an instance it begins with the address of the instance.

    address: address of the object.
    geometries: the scene's geometries.
    transparent: names of the transparent materials.
    """
    shape = geometries.get(obj.geometry, obj) if isinstance(obj, Instance) else obj
    if not (shape.composite and shape.op == "union"):
        return {}
    found = bodies(address, obj, geometries)
    if len(found) == 1 or (len(found) <= MOST_JOINED and not any(x.material in transparent for x in found)):
        return {}
    return {_name(x): Body(x, _as_object(x)) for x in found}


def _name(operand: Operand) -> str:
    """The name of a body: its address, with that of an instance in place of that of the geometry."""
    around = operand.around
    if around is None:
        return operand.address
    return _name(around) + ("" if operand.role == "geometry" else operand.address[len(around.address) :])


def _as_object(operand: Operand) -> Primitive:
    """An operand as an object. An instance stays one, so that all instances of a mesh share it; a plane, which is a
    half-space as an operand, becomes CSG of this operand alone."""
    if operand.role == "geometry" and not isinstance(operand.shape, Plane):
        return operand.around.shape.with_fields(material=operand.material, transform=operand.around.steps)
    shape = operand.shape.with_fields(material=operand.material, transform=operand.steps)
    if not isinstance(shape, Plane):
        return shape
    plane = shape.with_fields(material=NO_MATERIAL, transform=())
    return MERGE.with_fields(of=(plane,), material=operand.material, transform=operand.steps)
