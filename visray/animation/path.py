"""Track of a point that goes along a path."""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from visray.animation.paths import Path, polygon, spline
from visray.animation.track import Address, Stage, TimedTrack
from visray.quantities import Triple


@dataclass(frozen=True, kw_only=True)
class PathTrack(TimedTrack):
    """The point at `address` goes along `points` at constant speed; if the path is `closed`, from the last point back
    to the first one.

    The path is `linear`, or `smooth`: a centripetal Catmull-Rom curve, which has no loops.
    """

    type: Literal["path"] = "path"
    address: Address
    points: Annotated[tuple[Triple, ...], Field(min_length=2)]
    closed: Annotated[bool, Field(strict=True)] = False
    interpolation: Literal["linear", "smooth"] = "linear"

    def addresses(self) -> tuple[str, ...]:
        return (self.address,)

    def values_at(self, t: float, stage: Stage) -> dict[str, Any]:
        point = self._path.at(self.progress(t, stage.duration))
        return {self.address: tuple(point.tolist())}

    @cached_property
    def _path(self) -> Path:
        points = np.array(self.points, float)
        return (polygon if self.interpolation == "linear" else spline)(points, self.closed)
