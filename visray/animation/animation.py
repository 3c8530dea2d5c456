"""The animation of a scene: its length, its frames, and its tracks by name."""

from dataclasses import dataclass, field
from typing import Annotated, Any, Union

from pydantic import ConfigDict, Discriminator, Field, Tag

from visray.animation.keys import KeysTrack
from visray.animation.kinds import KINDS
from visray.animation.track import LONGEST
from visray.quantities import Name, Real
from visray.records import record_kind

Duration = Annotated[Real, Field(gt=0, le=LONGEST)]
# What high-speed cameras reach.
MOST_FPS = 1e6
FramesPerSecond = Annotated[Real, Field(gt=0, le=MOST_FPS)]


def _track_type(raw: Any) -> Any:
    """Type of a track, given as a dict or as an instance; None for anything else. A dict without a type stands for a
    track of keys."""
    return raw.get("type", KeysTrack.type) if isinstance(raw, dict) else getattr(raw, "type", None)


Track = Annotated[Union[tuple(Annotated[kind, Tag(kind.type)] for kind in KINDS)], Discriminator(_track_type)]


@record_kind
@dataclass(frozen=True, kw_only=True)
class Animation:
    """What moves in a scene, as functions of time.

    duration: length in seconds. Times are from 0 to `duration`.
    fps: frames per second. Frame k is at the time k / fps; the last one is before `duration`, so that a loop closes.
    tracks: tracks by name. No two of them write the same value.
    """

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")
    duration: Duration
    fps: FramesPerSecond = 25.0
    tracks: dict[Name, Track] = field(default_factory=dict)
