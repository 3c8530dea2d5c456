"""Spot light."""

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import drjit as dr
import numpy as np
from pydantic import Field

from visray.lights.light import Light
from visray.quantities import Direction, Factor, Point, Quantity, Real
from visray.records import record_kind

HalfAngle = Annotated[
    Real, Field(ge=0.01, le=180), Quantity(1, "geometry", "degrees from the axis to the edge, from 0.01 to 180")
]


@record_kind
@dataclass(frozen=True, kw_only=True)
class SpotLight(Light):
    """A light that shines from `position` along `direction` into a cone. `angle` is the angle between the cone's axis
    and its edge.

    Within the cone the light is multiplied by ((cos t - cos angle) / (1 - cos angle))^exponent, where t is the angle
    from the axis: a hard edge for exponent 0, a softer one for larger exponents.
    """

    type: Literal["spot"] = "spot"
    position: Point = field(kw_only=False)
    direction: Direction = field(kw_only=False)
    angle: HalfAngle = field(default=30.0, kw_only=False)
    exponent: Factor = 0.0

    def falloff(self, d: Any) -> Any:
        # 1 - cos of both angles, computed from half angles and differences of unit vectors: no digits cancel.
        axis = dr.normalize(self.direction)
        edge = 2 * dr.square(dr.sin(self.angle * (0.25 * dr.pi / 90)))
        deviation = 0.5 * dr.squared_norm(d - axis)
        base = (edge - deviation) / edge
        lit = base > 0
        power = dr.exp2(type(d.x)(self.exponent) * dr.log2(dr.select(lit, base, 1)))
        return dr.select(lit, power, 0)

    def falloff_reference(self, d: np.ndarray) -> np.ndarray:
        """Computed from the difference of the cosines.

        Error: 2^-52 / 1.5e-8 of the factor, because 1 - cos(angle) is at least 1.5e-8 (angle = 0.01 degrees).
        """
        axis, edge = np.array(self.direction, float), np.cos(np.radians(self.angle))
        inside = d @ axis / np.linalg.norm(axis) - edge
        lit = inside > 0
        return np.where(lit, np.where(lit, inside / (1 - edge), 1) ** self.exponent, 0)
