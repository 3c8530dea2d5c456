"""Track of a point on an ellipse, as in the original VisRayTrace."""

import math
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, ConfigDict, Field

from visray.animation.track import CHECKS, Address, Stage, Track
from visray.quantities import Point, Real
from visray.records import record_kind

# Seconds of the shortest turn. There may be 86400 s of them.
SHORTEST = 1e-6
Radius = Annotated[Real, Field(ge=0, le=1e9)]


def _turns(period: float) -> float:
    """The period unchanged; raises ValueError if a turn takes next to no time."""
    if abs(period) < SHORTEST:
        raise ValueError(f"must be at least {SHORTEST:g}, or at most {-SHORTEST:g}")
    return period


Period = Annotated[Real, AfterValidator(_turns)]


@record_kind
@dataclass(frozen=True, kw_only=True)
class Ellipse:
    """A point on a horizontal ellipse with the radii `radii` in x and z. At the time t it is at (rx cos a, 0, rz sin
    a), with the angle a = `phase` + 360 t / `period`, in degrees: clockwise when seen from above, or with a negative
    period the other way round."""

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")
    radii: tuple[Radius, Radius]
    period: Period
    phase: Real = 270.0

    def offset(self, t: float) -> tuple[float, float]:
        """x and z at time t."""
        angle = math.radians(self.phase + 360 * (t / self.period))
        return self.radii[0] * math.cos(angle), self.radii[1] * math.sin(angle)


@record_kind
@dataclass(frozen=True, kw_only=True)
class EllipseTrack(Ellipse, Track):
    """The point at `address` moves on an ellipse about `center`; without a center, about the point that the scene has
    at the address. `around` is a second ellipse, which is added, as for a moon that goes about a planet."""

    is_point: ClassVar[bool] = True

    type: Literal["ellipse"] = "ellipse"
    address: Address
    center: Point | None = None
    around: Ellipse | None = None

    @property
    def needs_scene(self) -> bool:
        return self.center is None

    def addresses(self) -> tuple[str, ...]:
        return (self.address,)

    def check_times(self, duration: float) -> tuple[float, ...]:
        return tuple(duration * k / CHECKS for k in range(CHECKS + 1))

    def values_at(self, t: float, stage: Stage) -> dict[str, Any]:
        x, y, z = stage.value(self.address) if self.center is None else self.center
        for ellipse in (self, self.around):
            dx, dz = ellipse.offset(t) if ellipse is not None else (0.0, 0.0)
            x, z = x + dx, z + dz
        return {self.address: (x, y, z)}
