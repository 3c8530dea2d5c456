"""Track of an object that turns about an axis."""

from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Literal

from visray.animation.track import Address, Stage, TimedTrack, Turns
from visray.quantities import Direction, Point


@dataclass(frozen=True, kw_only=True)
class SpinTrack(TimedTrack):
    """What is at the address `of`, such as `objects.earth`, turns about the axis `axis` through `center`, `turns`
    times; counter-clockwise when the axis points at the viewer. Its written transform comes first."""

    naming: ClassVar[str | None] = "of"

    type: Literal["spin"] = "spin"
    of: Address
    axis: Direction = (0.0, 1.0, 0.0)
    turns: Turns = 1.0
    center: Point = (0.0, 0.0, 0.0)

    def addresses(self) -> tuple[str, ...]:
        return (f"{self.of}.transform",)

    def values_at(self, t: float, stage: Stage) -> dict[str, Any]:
        [address] = self.addresses()
        steps = [asdict(step) for step in stage.value(address)]
        turn = {"rotate": 360 * self.turns * self.progress(t, stage.duration), "axis": self.axis}
        there, back = {"translate": tuple(-x for x in self.center)}, {"translate": self.center}
        return {address: (*steps, there, turn, back) if any(self.center) else (*steps, turn)}
