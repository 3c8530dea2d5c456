"""What other threads ask of the engine of a live picture, and what has changed then."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from visray.scene.scene import Scene


@dataclass(frozen=True)
class Change:
    """What has changed in the scene.

    kind: "values" (numbers at addresses), "scene" (another scene), "time" or "effects"
    addresses: of the values that changed
    """

    kind: str
    addresses: tuple[str, ...] = ()


@dataclass(frozen=True)
class Wishes:
    """What was asked for since the engine has last looked. Of each sort only the newest counts.

    values: newest value by address, the newest address last
    scene: another scene; None for the same
    seconds: moment of an animated scene; None for the same
    left_out: effects that are not simulated; None for the same
    """

    values: Mapping[str, Any] = field(default_factory=dict)
    scene: Scene | None = None
    seconds: float | None = None
    left_out: tuple[str, ...] | None = None

    def with_values(self, values: Mapping[str, Any]) -> "Wishes":
        """The wishes with newer values."""
        older = {address: value for address, value in self.values.items() if address not in values}
        return replace(self, values=older | dict(values))

    def one_by_one(self) -> list["Wishes"]:
        """The same wishes, each value on its own, so that a wrong one does not hold up others."""
        others = replace(self, values={})
        single = [Wishes({address: value}) for address, value in self.values.items()]
        return ([others] if others else []) + single

    def __bool__(self) -> bool:
        return self != Wishes()
