"""Track of an object that turns about an axis."""

from dataclasses import asdict, dataclass, is_dataclass
from typing import Any, ClassVar, Literal

from visray.animation.track import Address, Stage, TimedTrack, Turns
from visray.quantities import Direction, Point
from visray.records import record_kind


@record_kind
@dataclass(frozen=True, kw_only=True)
class SpinTrack(TimedTrack):
    """What is at the address `of`, such as `objects.earth`, turns about the axis `axis` through `center`, `turns`
    times; counter-clockwise when the axis points at the viewer. Without a center it turns in place, about the centre of
    its bounding box. Its own transform comes first, and what other tracks move."""

    naming: ClassVar[str | None] = "of"
    extends: ClassVar[bool] = True
    follows: ClassVar[bool] = True
    needs_scene: ClassVar[bool] = True

    type: Literal["spin"] = "spin"
    of: Address
    axis: Direction = (0.0, 1.0, 0.0)
    turns: Turns = 1.0
    center: Point | None = None

    def addresses(self) -> tuple[str, ...]:
        return (f"{self.of}.transform",)

    def values_at(self, t: float, stage: Stage) -> dict[str, Any]:
        [address] = self.addresses()
        steps = [asdict(step) if is_dataclass(step) else step for step in stage.moved(address)]
        turn = {"rotate": 360 * self.turns * self.progress(t, stage.duration), "axis": self.axis}
        if self.center is not None and not any(self.center):
            return {address: (*steps, turn)}
        center = stage.center(self.of) if self.center is None else self.center
        return {address: (*steps, {"translate": tuple(-x for x in center)}, turn, {"translate": center})}

    def flaws(self, duration: float) -> list[tuple[str, str]]:
        found = super().flaws(duration)
        if self.of.partition(".")[0] == "camera":
            text = "a camera has no transform; for one that goes about its target, write a track of the type orbit"
            found.append(("of", text))
        return found
