"""Instances: objects that take their shape from one of the scene's geometries."""

from dataclasses import dataclass, field
from typing import Literal

from visray.primitives.primitive import Primitive
from visray.records import record_kind
from visray.references import GeometryName


@record_kind
@dataclass(frozen=True, kw_only=True)
class Instance(Primitive):
    """A copy of one of the scene's `geometries`, with its own material and transform.

    The transform of the geometry is applied first, then that of the instance.
    """

    type: Literal["instance"] = "instance"
    geometry: GeometryName = field(kw_only=False)

    def placed_shape(self, geometry: Primitive) -> Primitive:
        """The geometry as an object of its own kind, with the material of the instance and both transforms."""
        return geometry.with_fields(material=self.material, transform=geometry.transform + self.transform)
