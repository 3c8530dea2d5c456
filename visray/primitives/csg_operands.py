"""Operands of an object at all depths: where each is, what it is made of, and how it is placed.

An object is a tree. A `csg` has operands in its field `of`, each object can have further ones in its field `cut`, which
are taken away from it, and an instance stands for its geometry. The functions here walk through this tree. Everything
that asks for the shapes, materials or files of objects must ask for those of the operands too, and does it here.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from visray.operands import ROLES, like_operands, named_operands
from visray.primitives.instance import Instance
from visray.primitives.plane import Plane
from visray.primitives.primitive import Primitive
from visray.transforms import Transform

# Name of the material of objects that name none.
NO_MATERIAL = Primitive.material
# The operations in which the operands behind the first one cut it.
CUTTING = ("intersection", "difference")


@dataclass(frozen=True)
class Operand:
    """An object, or one of its operands at any depth.

    address: its address in the scene, such as `objects.cheese.of.hole`; that of an instance's geometry is below
        `geometries`.
    shape: the operand as it is written.
    named: name of the material that it names; or else of the `cut_material` of the object around it, if it cuts there;
        or else what is named around that; NO_MATERIAL if no name is written.
    material: name of the material of its faces: `named`; or else that of its own first operand; or else that of the
        object around it.
    steps: all transforms from its own coordinates to the world: its own steps, then those of the objects around it.
    role: "whole" for the object itself; "geometry" for that of an instance; "of" for an operand of a `csg`, "cut" for a
        solid that is taken away.
    first: whether it is in the place of the object around it: the first operand, or the geometry of an instance.
    around: the operand around it; None for the object itself.
    """

    address: str
    shape: Primitive
    named: str
    material: str
    steps: tuple[Transform, ...]
    role: str = "whole"
    first: bool = True
    around: "Operand | None" = None

    @property
    def is_leaf(self) -> bool:
        """Whether it is a shape of its own: no `csg`, whose operands are its shapes, and no instance."""
        return not (self.shape.composite or isinstance(self.shape, Instance))

    @property
    def cuts(self) -> bool:
        """Whether it cuts the object around it, which may give it a material by `cut_material`."""
        return self.around is not None and _cuts(self.around.shape, self.role, self.first)

    @property
    def owner(self) -> "Operand":
        """The operand with the field `material` that counts: for a geometry, its instance."""
        return self.around.owner if self.role == "geometry" else self

    def _operand(
        self, address: str, shape: Primitive, role: str, first: bool, geometries: Mapping[str, Primitive]
    ) -> "Operand":
        """An operand of this one."""
        named = shape.material
        if named == NO_MATERIAL:
            named = (self.shape.cut_material if _cuts(self.shape, role, first) else None) or self.named
        material = named if named != NO_MATERIAL else own_material(shape, geometries)
        material = material if material != NO_MATERIAL else self.material
        return Operand(address, shape, named, material, shape.transform + self.steps, role, first, self)

    def operands(self, geometries: Mapping[str, Primitive]) -> list["Operand"]:
        """Its own operands, in order. geometries: as in `operands`."""
        shape, inner = self.shape, []
        if isinstance(shape, Instance) and shape.geometry in geometries:
            address = f"geometries.{shape.geometry}"
            inner.append(self._operand(address, geometries[shape.geometry], "geometry", True, geometries))
        for role in ROLES:
            by_key = named_operands(getattr(shape, role, None)).items()
            inner += [
                self._operand(f"{self.address}.{role}.{key}", x, role, role == "of" and i == 0, geometries)
                for i, (key, x) in enumerate(by_key)
            ]
        return inner

    def walk(self, geometries: Mapping[str, Primitive]) -> Iterator["Operand"]:
        """Yields it, and then its operands at all depths, as `operands` does for an object."""
        ahead = [self]
        while ahead:
            operand = ahead.pop()
            yield operand
            ahead += reversed(operand.operands(geometries))


def _cuts(around: Primitive, role: str, first: bool) -> bool:
    """Whether an operand of an object cuts it. role, first: as in Operand"""
    return role == "cut" or (role == "of" and not first and around.op in CUTTING)


def operands(address: str, obj: Primitive, geometries: Mapping[str, Primitive]) -> Iterator[Operand]:
    """Yields an object, and then its operands at all depths: each one before its own, in the order of the scene; those
    of `of` before those of `cut`.

    address: the object's address.
    geometries: the scene's geometries. The operands of an instance's geometry are yielded for each instance. Without
        geometries, the operands are those that are written in the object itself, each with an address of its own.

    Domain: no geometry contains itself.
    """
    yield from _whole(address, obj, geometries).walk(geometries)


def _whole(address: str, obj: Primitive, geometries: Mapping[str, Primitive]) -> Operand:
    """An object as the first entry of its walk. Arguments: as in `operands`."""
    return Operand(address, obj, obj.material, own_material(obj, geometries), obj.transform)


def bodies(address: str, obj: Primitive, geometries: Mapping[str, Primitive]) -> list[Operand]:
    """The operands of an object that are bodies of their own, as those of a union are at all depths; or the object
    itself, if it is no union. Arguments and domain: as in `operands`.

    Each body has one inside, with the material `Operand.material`. Its faces may have other materials.
    """
    found, ahead = [], [_whole(address, obj, geometries)]
    while ahead:
        operand = ahead.pop()
        shape = operand.shape
        joins = isinstance(shape, Instance) or (shape.composite and shape.op == "union")
        inner = operand.operands(geometries) if joins and shape.cut is None else []
        found += [] if inner else [operand]
        ahead += reversed(inner)
    return found


def materials_of(obj: Primitive, geometries: Mapping[str, Primitive]) -> tuple[str, ...]:
    """Names of the materials that an object has, each once: its own one, then those of its operands. Arguments and
    domain: as in `operands`."""
    inner = geometries.get(obj.geometry) if isinstance(obj, Instance) else None
    if not (has_operands(obj) or (inner is not None and has_operands(inner))):
        return (obj.material,)
    leaves = (x.material for x in operands("", obj, geometries) if x.is_leaf)
    return tuple(dict.fromkeys((own_material(obj, geometries), *leaves)))


def mapped(address: str, obj: Primitive, change: Callable[[str, Primitive], Primitive]) -> Primitive:
    """The object with a change to it and to its operands at all depths, as they are written.

    address: the object's address.
    change: function of an address and the shape there, whose operands are changed already.
    """
    new: dict[str, Any] = {}
    for role in ROLES:
        if given := getattr(obj, role, None):
            parts = {k: mapped(f"{address}.{role}.{k}", x, change) for k, x in named_operands(given).items()}
            new[role] = like_operands(parts, given)
    return change(address, obj.with_fields(**new) if new else obj)


def operand_at(obj: Primitive, path: list[str]) -> tuple[Primitive, list[str]]:
    """The innermost operand to which a path leads, and the rest of the path.

    path: parts of an address behind that of the object, such as of, hole, radius.
    """
    while len(path) > 1 and path[0] in ROLES and hasattr(obj, path[0]):
        role, key, *path = path
        obj = named_operands(getattr(obj, role))[key]
    return obj, path


def own_material(obj: Primitive, geometries: Mapping[str, Primitive]) -> str:
    """Name of an object's own material, which decides what its inside does to light: the material that it names, or
    else that of its first operand."""
    while obj.material == NO_MATERIAL:
        if obj.composite and obj.of:
            obj = next(iter(named_operands(obj.of).values()))
        elif isinstance(obj, Instance) and obj.geometry in geometries:
            obj = geometries[obj.geometry]
        else:
            break
    return obj.material


def has_operands(obj: Primitive) -> bool:
    """Whether an object has operands: it is a `csg`, or something is taken away from it."""
    return obj.cut is not None or obj.composite


def is_solid(shape: Primitive, geometries: Mapping[str, Primitive]) -> bool:
    """Whether an operand is a solid; a plane is a half-space. Domain: no geometry contains itself."""
    while True:
        if shape.composite and shape.ends == "capped" and shape.of:
            shape = next(iter(named_operands(shape.of).values()))
        elif isinstance(shape, Instance) and shape.geometry in geometries:
            shape = geometries[shape.geometry]
        else:
            return isinstance(shape, Plane) or (not (shape.composite or isinstance(shape, Instance)) and shape.closed)
