"""The disk."""

from dataclasses import dataclass
from typing import Any, Literal

import drjit as dr
import numpy as np

from visray.geometry import Frame, tangents
from visray.primitives.flat import Flat
from visray.primitives.primitive import Twin, homogeneous
from visray.quantities import Direction, Length, Point
from visray.transforms import compose


@dataclass(frozen=True, kw_only=True)
class Disk(Flat):
    """The points of a plane within `radius` of `center`.

    uv: the square around the disk from 0 to 1, upright as on a plane with the same normal.
    """

    type: Literal["disk"] = "disk"
    center: Point = (0.0, 0.0, 0.0)
    normal: Direction = (0.0, 1.0, 0.0)
    radius: Length = 1.0

    def frame(self) -> Frame:
        n = dr.normalize(self.normal)
        s, t = tangents(n)
        return Frame(self.radius * s, self.radius * t, n, self.center)

    @staticmethod
    def reach(whole: Frame) -> Any:
        return Frame(whole.x, whole.y, 0 * whole.z, whole.o).longest()

    @staticmethod
    def within(x: Any, y: Any) -> Any:
        return x * x + y * y <= 1

    def mitsuba(self) -> Twin | str:
        f = self.numbers().frame()
        # As long as the others, so that the map is one that Mitsuba's disk takes.
        whole = homogeneous(Frame(f.x, f.y, self.radius * f.z, f.o), compose(self.transform))

        def around(uv: tuple) -> tuple:
            """Mitsuba's u is the distance from the centre, its v the angle."""
            return tuple(0.5 + 0.5 * uv[0] * part(2 * np.pi * uv[1]) for part in (np.cos, np.sin))

        return Twin([{"type": "disk", "to_world": whole}], uv=around)
