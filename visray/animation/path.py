"""Track of a point that goes along a path."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from visray.animation.paths import Path, polygon, spline
from visray.animation.track import Address, Stage, TimedTrack
from visray.quantities import FARTHEST, Triple
from visray.records import record_kind


@record_kind
@dataclass(frozen=True, kw_only=True)
class PathTrack(TimedTrack):
    """The point at `address` goes along `points` at constant speed; if the path is `closed`, from the last point back
    to the first one.

    The path is `linear`, or `smooth`: a centripetal Catmull-Rom curve, which has no loops.
    """

    is_point: ClassVar[bool] = True

    type: Literal["path"] = "path"
    address: Address
    points: tuple[Triple, ...]
    closed: Annotated[bool, Field(strict=True)] = False
    interpolation: Literal["linear", "smooth"] = "linear"

    def addresses(self) -> tuple[str, ...]:
        return (self.address,)

    def check_times(self, duration: float) -> tuple[float, ...]:
        end = duration if self.end is None else self.end
        shares = self._path.shares()
        return tuple(self.begin + (end - self.begin) * share for share in shares)

    def flaws(self, duration: float) -> list[tuple[str, str]]:
        found = super().flaws(duration)
        if len(self.points) < 2:
            return [*found, ("points", "a path has at least two points; add one")]
        ring = [*enumerate(self.points), *([(0, self.points[0])] if self.closed else [])]
        return found + [
            (f"points.{i}", f"must differ from the point before, points.{before}{_least(a, b)}")
            for (before, a), (i, b) in pairwise(ring)
            if max(abs(x - y) for x, y in zip(a, b)) < 1 / FARTHEST
        ]

    def values_at(self, t: float, stage: Stage) -> dict[str, Any]:
        point = self._path.at(self.progress(t, stage.duration))
        return {self.address: tuple(point.tolist())}

    @cached_property
    def _path(self) -> Path:
        points = np.array(self.points, float)
        return (polygon if self.interpolation == "linear" else spline)(points, self.closed)


def _least(a: tuple, b: tuple) -> str:
    """What else a message says about two neighbouring points that are too near to each other."""
    return "" if a == b else f", in a number by at least {1 / FARTHEST:g}"
