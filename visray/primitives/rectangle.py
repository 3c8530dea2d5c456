"""The rectangle, and any other parallelogram."""

from dataclasses import dataclass, field
from typing import Any, Literal

import drjit as dr
import numpy as np

from visray.geometry import Frame, clearly_not_parallel
from visray.primitives.flat import Flat
from visray.primitives.primitive import MitsubaShapes, half_extents, scalars, to_world_matrix
from visray.quantities import Point, Vector
from visray.records import record_kind
from visray.transforms import compose


@record_kind
@dataclass(frozen=True, kw_only=True)
class Rectangle(Flat):
    """A parallelogram: all points center + a width + b height, for a and b from -1/2 to 1/2.

    `width` and `height` are vectors, and the normal is width x height.
    uv: u goes along `width` and v along `height`, both from 0 to 1.
    """

    type: Literal["rectangle"] = "rectangle"
    center: Point = field(default=(0.0, 0.0, 0.0), kw_only=False)
    width: Vector = field(default=(1.0, 0.0, 0.0), kw_only=False)
    height: Vector = field(default=(0.0, 1.0, 0.0), kw_only=False)

    def flaws(self) -> list[tuple[str, str]]:
        if clearly_not_parallel(self.width, self.height):
            return []
        w, h = np.array(self.width, float), np.array(self.height, float)
        sine = np.linalg.norm(np.cross(w / np.linalg.norm(w), h / np.linalg.norm(h)))
        return [] if sine > 8 * np.finfo(float).eps else [("height", "must not be parallel to width")]

    def frame(self) -> Frame:
        w, h = 0.5 * self.width, 0.5 * self.height
        return Frame(w, h, dr.normalize(dr.cross(w, h)), self.center)

    @staticmethod
    def extents(to_world: Frame, shape: tuple) -> tuple[Any, Any]:
        x, y = to_world.x, to_world.y
        longest = dr.maximum(dr.squared_norm(x + y), dr.squared_norm(x - y))
        return dr.sqrt(longest), half_extents(to_world, "xy")

    @staticmethod
    def within(x: Any, y: Any) -> Any:
        return (dr.abs(x) <= 1) & (dr.abs(y) <= 1)

    def advice_for_solid(self) -> str:
        return "use a solid, such as a thin box"

    def mitsuba(self) -> MitsubaShapes | str:
        return MitsubaShapes(
            [{"type": "rectangle", "to_world": to_world_matrix(scalars(self).frame(), compose(self.transform))}]
        )
