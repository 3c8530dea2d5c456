"""The kinds of primitives, the shapes that objects of a scene can have.

A new kind needs one file in this folder, its class in KINDS, and one sample in tests/samples.py (docs/extending.md).
"""

from typing import Annotated, Union

from pydantic import Field
from typing_extensions import TypeAliasType

from visray.operands import OperandsRule
from visray.primitives.box import Box
from visray.primitives.capsule import Capsule
from visray.primitives.cone import Cone
from visray.primitives.csg import Csg
from visray.primitives.cylinder import Cylinder
from visray.primitives.disk import Disk
from visray.primitives.ellipsoid import Ellipsoid
from visray.primitives.instance import Instance
from visray.primitives.mesh import Mesh
from visray.primitives.plane import Plane
from visray.primitives.polynomial import Polynomial
from visray.primitives.rectangle import Rectangle
from visray.primitives.sphere import Sphere
from visray.primitives.torus import Torus
from visray.primitives.triangle import Triangle

KINDS = (
    Sphere, Plane, Rectangle, Disk, Triangle, Box, Cylinder, Cone, Ellipsoid, Capsule, Torus, Polynomial, Mesh, Csg,
)  # fmt: skip
# An object of the scene is of one of these kinds, or an instance of a geometry of one of them.
OBJECTS = (*KINDS, Instance)
# An alias has one schema of its own. Without it, the schema of each kind would contain those of all later kinds.
OperandsRule.object_type = TypeAliasType("Object", Annotated[Union[OBJECTS], Field(discriminator="type")])
# The public names of this folder. They are also public names of visray.
__all__ = [kind.__name__ for kind in OBJECTS]
