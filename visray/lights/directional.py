"""Directional light."""

from dataclasses import dataclass, field
from typing import ClassVar, Literal

from visray.lights.light import Light
from visray.quantities import Direction
from visray.records import record_kind


@record_kind
@dataclass(frozen=True, kw_only=True)
class DirectionalLight(Light):
    """A light infinitely far away, like the sun. It shines along `direction` everywhere. Its distance is infinite, so
    the coefficients `b` and `c` of attenuation must be 0."""

    has_position: ClassVar[bool] = False

    type: Literal["directional"] = "directional"
    direction: Direction = field(kw_only=False)

    def flaws(self) -> list[tuple[str, str]]:
        message = "must be 0: a directional light is infinitely far away, so it would not be seen"
        return [(name, message) for name in ("b", "c") if getattr(self, name)]
