"""Track of keys: values at given times, and what lies between."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator

from visray.animation.curves import Interpolation, Sort, curve
from visray.animation.key_values import key_value
from visray.animation.track import LEAST, LEAST_SHOWN, Address, Seconds, Stage, Track
from visray.records import record_kind

KeyValue = Annotated[Any, BeforeValidator(key_value)]


@record_kind
@dataclass(frozen=True, kw_only=True)
class KeysTrack(Track):
    """The value at `address` has the value `values[i]` at the time `times[i]`. Before the first time and after the last
    one it holds still.

    Between two times it is interpolated: `linear`; `smooth`, a monotone cubic, which does not overshoot; or `step`, the
    value of the key before. Directions and rotations go the short way.
    """

    type: Literal["keys"] = "keys"
    address: Address
    times: tuple[Seconds, ...]
    values: tuple[KeyValue, ...]
    interpolation: Interpolation = "linear"

    def addresses(self) -> tuple[str, ...]:
        return (self.address,)

    def check_times(self, duration: float) -> tuple[float, ...]:
        return self.times

    def flaws(self, duration: float) -> list[tuple[str, str]]:
        if len(self.times) < 2:
            return [("times", "a track has at least two keys; add one, or write the value in the scene itself")]
        if len(self.values) != len(self.times):
            return [("values", f"has {len(self.values)} entries for {len(self.times)} times; give one for each time")]
        return [
            (f"times.{i}", f"must be after times.{i - 1}, which is {before:g} s{_least(before, time)}")
            for i, (before, time) in enumerate(pairwise(self.times), 1)
            if not time - before >= LEAST
        ]

    def notes(self, duration: float) -> list[tuple[str, str]]:
        late = [t for t in self.times if t > duration]
        if not late:
            return []
        are = f"{len(late)} of {len(self.times)} keys are" if late[1:] else f"the last key, {late[0]:g} s, is"
        return [("times", f"{are} after the end of the animation, {duration:g} s, so the track is cut off there")]

    def values_at(self, t: float, stage: Stage) -> dict[str, Any]:
        return {self.address: self._curve(stage.sort(self.address))(t)}

    @cached_property
    def _curves(self) -> dict[Sort, Callable[[float], Any]]:
        """The curves through the keys that were asked for, by the sort of their values."""
        return {}

    def _curve(self, sort: Sort) -> Callable[[float], Any]:
        if sort not in self._curves:
            self._curves[sort] = curve(sort, self.interpolation, self.times, self.values)
        return self._curves[sort]


def _least(before: float, time: float) -> str:
    """What else a message says about the time of a key that comes too soon after the key before."""
    return f", by at least {LEAST_SHOWN}" if time > before else ""
