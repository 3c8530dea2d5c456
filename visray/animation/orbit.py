"""Track of a camera that goes about its target."""

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from visray.animation.track import Stage, TimedTrack, Turns
from visray.quantities import Direction
from visray.records import record_kind
from visray.transforms import Rotate


@record_kind
@dataclass(frozen=True, kw_only=True)
class OrbitTrack(TimedTrack):
    """The camera goes about its target, on a circle about the axis `axis` through the target; without one, the axis is
    the camera's `up`. It goes counter-clockwise when the axis points at the viewer, `turns` times. If the target moves,
    the camera goes with it."""

    naming: ClassVar[str | None] = None
    follows: ClassVar[bool] = True
    needs_scene: ClassVar[bool] = True

    type: Literal["orbit"] = "orbit"
    turns: Turns = 1.0
    axis: Direction | None = None

    def addresses(self) -> tuple[str, ...]:
        return ("camera.origin", "camera.up") if self.axis is not None else ("camera.origin",)

    def values_at(self, t: float, stage: Stage) -> dict[str, Any]:
        up, origin, target = (np.array(stage.value(f"camera.{x}"), float) for x in ("up", "origin", "target"))
        axis = tuple(up.tolist()) if self.axis is None else self.axis
        turn = Rotate.affines([Rotate(rotate=360 * self.turns * self.progress(t, stage.duration), axis=axis)])[0, :, :3]
        centre = np.array(stage.moved("camera.target"), float)
        values = {"camera.origin": tuple((centre + turn @ (origin - target)).tolist())}
        if self.axis is not None:
            values["camera.up"] = tuple((turn @ up).tolist())
        return values
