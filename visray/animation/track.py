"""The interface of all kinds of tracks.

A track writes values at some addresses of a scene as functions of the time t, in seconds. A kind of track is one frozen
dataclass in one file. It knows no scene: what it needs of one is in the `Stage`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from pydantic import ConfigDict, Field

from visray.quantities import Real

# Longest animation in seconds: a day.
LONGEST = 86400
Seconds = Annotated[Real, Field(ge=0, le=LONGEST)]
MOST_TURNS = 1e6
Turns = Annotated[Real, Field(ge=-MOST_TURNS, le=MOST_TURNS)]
Address = Annotated[str, Field(strict=True, min_length=1)]

# Steps of a track at whose ends the scene is checked.
CHECKS = 4
# Least time between two keys. It is far less than a frame, and one can divide by it. Times of a day are rounded by
# 1e-11 s, so it is a little less than the 1e-9 s of messages.
LEAST = 2.0**-30
LEAST_SHOWN = "1e-09 s"


@dataclass(frozen=True)
class Stage:
    """What a track needs of the scene that it moves.

    duration: length of the animation in seconds
    value: function that returns the value at an address as the scene has it, without any track
    moved: function that returns the value at an address at the time in question, with the tracks that need no other
        one; only for tracks that follow others
    center: function that returns the centre of the bounding box of what is at an address, after its transform, at the
        time in question; only for tracks that follow others
    sort: function that returns how values at an address are interpolated (curves.Sort)
    """

    duration: float
    value: Callable[[str], Any]
    moved: Callable[[str], Any]
    center: Callable[[str], tuple[float, float, float]]
    sort: Callable[[str], str]


@dataclass(frozen=True, kw_only=True)
class Track:
    """A track writes values of the scene as functions of time.

    naming: the field that names what moves; None if there is none
    is_point: whether what moves must be a point
    extends: whether the track adds something to what other tracks write at its addresses
    follows: whether the track needs values that other tracks write at the same time
    needs_scene: whether the values of the track depend on those that the scene has at its addresses
    """

    naming: ClassVar[str | None] = "address"
    is_point: ClassVar[bool] = False
    extends: ClassVar[bool] = False
    follows: ClassVar[bool] = False
    needs_scene: ClassVar[bool] = False

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")

    def addresses(self) -> tuple[str, ...]:
        """Addresses that the track writes. They are the same at all times."""
        raise TypeError(f"{type(self).__name__} has no addresses")

    def values_at(self, t: float, stage: Stage) -> dict[str, Any]:
        """The values at time t, by address."""
        raise TypeError(f"{type(self).__name__} has no values")

    def check_times(self, duration: float) -> tuple[float, ...]:
        """Times at which the scene must be valid, so that it is likely to be valid at all times."""
        return (0.0, duration)

    def flaws(self, duration: float) -> list[tuple[str, str]]:
        """Errors that concern several fields together, as pairs of a field's name and a message.

        duration: length of the animation in seconds
        """
        return []

    def notes(self, duration: float) -> list[tuple[str, str]]:
        """What is odd about the track, as pairs of a field's name and a message.

        duration: length of the animation in seconds
        """
        return []


@dataclass(frozen=True, kw_only=True)
class TimedTrack(Track):
    """It begins at `begin` and is complete at `end`. Before and after it holds still."""

    begin: Seconds = 0.0
    end: Seconds | None = None

    def progress(self, t: float, duration: float) -> float:
        """Share of the track that is done at time t, from 0 to 1."""
        end = duration if self.end is None else self.end
        return min(max((t - self.begin) / (end - self.begin), 0.0), 1.0)

    def check_times(self, duration: float) -> tuple[float, ...]:
        end = duration if self.end is None else self.end
        return tuple(self.begin + (end - self.begin) * k / CHECKS for k in range(CHECKS + 1))

    def flaws(self, duration: float) -> list[tuple[str, str]]:
        end = duration if self.end is None else self.end
        if end - self.begin >= LEAST:
            return []
        if self.end is None:
            return [("begin", f"must be before the end of the animation, {duration:g} s")]
        least = f", by at least {LEAST_SHOWN}" if end > self.begin else ""
        return [("end", f"must be after begin, which is {self.begin:g} s{least}")]

    def notes(self, duration: float) -> list[tuple[str, str]]:
        if self.end is None or self.end <= duration:
            return []
        last = f"the end of the animation, {duration:g} s"
        if self.begin >= duration:
            return [("begin", f"{self.begin:g} s is not before {last}, so the track moves nothing")]
        return [("end", f"{self.end:g} s is after {last}, so the track is cut off there")]
