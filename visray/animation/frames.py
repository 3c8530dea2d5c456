"""Frames of an animation: their numbers and their times."""

import re

from visray.animation.animation import Animation
from visray.errors import UserError

_RANGE = re.compile(r"(-?\d+)?:(-?\d+)?(?::(-?\d+)?)?")
RULE = "write a:b:step, as Python's slices (b is left out), or one number, counted from 0"


def frame_times(
    animation: Animation, frames: str | slice | int | None = None, fps: float | None = None
) -> list[tuple[int, float]]:
    """Number and time in seconds of each frame.

    frames: which frames: a range such as `0:50:2`, as Python's slices, or one number; None: all of them
    fps: frames per second; None: those of the animation
    """
    rate = animation.fps if fps is None else fps
    if not 0 < rate < float("inf"):
        raise UserError(f"fps = {rate:g}: must be greater than 0 and finite")
    count = max(1, round(animation.duration * rate))
    chosen = range(count) if frames is None else _chosen(frames, count)
    return [(k, min(k / rate, animation.duration)) for k in chosen]


def _chosen(frames: str | slice | int, count: int) -> range:
    """Numbers of the chosen frames of `count` ones. Raises UserError if a frame does not exist, or if none is
    chosen."""
    shown = frames if isinstance(frames, str) else _text(frames)
    asked = _parsed(frames) if isinstance(frames, str) else frames
    if isinstance(asked, slice):
        ends = [x for x in (asked.start, asked.stop) if x is not None]
        step = 1 if asked.step is None else asked.step
    else:
        ends, step = [asked, asked + 1 if asked >= 0 else asked], 1
    if step == 0:
        raise UserError(f"frames = {shown}: the step must not be 0")
    if any(not -count <= x <= count for x in ends):
        raise UserError(f"frames = {shown}: is outside; the animation has {count} frames, 0 to {count - 1}")
    found = range(count)[asked] if isinstance(asked, slice) else range(count)[asked : asked + 1 or None]
    if not found:
        raise UserError(f"frames = {shown}: chooses no frame; {RULE}")
    return found


def _parsed(text: str) -> slice | int:
    """The slice or the number that a text stands for."""
    if re.fullmatch(r"-?\d+", text.strip()):
        return int(text)
    parts = _RANGE.fullmatch(text.strip())
    if parts is None:
        raise UserError(f"frames = {text!r}: is no range of frames; {RULE}")
    return slice(*(None if x is None else int(x) for x in parts.groups()))


def _text(frames: slice | int) -> str:
    """A slice or a number as it is written."""
    if isinstance(frames, int):
        return str(frames)
    parts = [frames.start, frames.stop] + ([] if frames.step is None else [frames.step])
    return ":".join("" if x is None else str(x) for x in parts)
