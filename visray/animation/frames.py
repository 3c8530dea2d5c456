"""Frames of an animation: their numbers and their times."""

import math
import re
from typing import Any, NamedTuple

from visray.animation.animation import MOST_FPS, Animation
from visray.arguments import LONGEST_VALUE, python_number, shown
from visray.errors import UserError

_RANGE = re.compile(r"(-?\d+)?:(-?\d+)?(?::(-?\d+)?)?")
# Digits of numbers that are read: no frame has more. Python refuses texts of thousands of digits.
_DIGITS = 18
RULE = "write a:b:step, as Python's slices (b is left out), or one number, counted from 0"


class Frame(NamedTuple):
    """A frame of an animation: its number, and its time in seconds."""

    number: int
    time: float


def chosen_frames(animation: Animation | None, frames: Any = None, fps: float | None = None) -> list[Frame]:
    """The chosen frames of an animation. Raises UserError if there is no animation.

    frames, fps: as in `frame_times`, but not yet checked; `frames` may also be a list of numbers, in any order
    """
    frames = python_number(frames)
    if (frames is not None and not isinstance(frames, str | slice | int)) or isinstance(frames, bool):
        return _listed(_given(animation), frames, fps)
    if isinstance(frames, slice):
        frames = _text(frames)
    if fps is not None and (isinstance(fps, bool) or not isinstance(fps, int | float)):
        raise UserError(f"fps = {shown(fps)}: must be a number greater than 0, such as 25")
    times = frame_times(
        _given(animation), None if frames is None else frames if isinstance(frames, str) else _digits(frames), fps
    )
    return [Frame(number, t) for number, t in times]


def _listed(animation: Animation, frames: Any, fps: float | None) -> list[Frame]:
    """The frames with the numbers in a list. Negative numbers count from the end."""
    right = f"must be numbers of frames, such as [0, 12] or range(0, 50, 2); or {RULE}"
    try:
        numbers = [python_number(number) for number in frames]
    except TypeError:
        raise UserError(f"frames = {shown(frames)}: {right}") from None
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, int):
            raise UserError(f"frames = {shown(frames)}: {shown(number)} is no number of a frame; {right}")
    if not numbers:
        raise UserError(f"frames = {shown(frames)}: chooses no frame; {right}")
    every = chosen_frames(animation, None, fps)
    for number in numbers:
        if not -len(every) <= number < len(every):
            raise UserError(f"frames: {number} {_outside(len(every))}")
    return [every[number] for number in numbers]


def _outside(count: int) -> str:
    """What is wrong with the number of a frame of an animation with `count` frames."""
    return f"is outside; the animation has {count} frame{'s' * (count > 1)}, 0 to {count - 1}"


def frames_at(animation: Animation | None, times: Any) -> list[Frame]:
    """Frames at given times, numbered from 0. Raises UserError if there is no animation, or if a time is outside."""
    duration = _given(animation).duration
    try:
        given = [python_number(t) for t in times]
    except TypeError:
        raise UserError(f"times = {shown(times)}: must be a list of times in seconds, such as [0, 0.5]") from None
    for t in given:
        if isinstance(t, bool) or not isinstance(t, int | float) or not 0 <= t <= duration:
            raise UserError(f"times: {shown(t)} must be a time of the animation, from 0 to {duration:g} s")
    return [Frame(number, float(t)) for number, t in enumerate(given)]


def frame_at(animation: Animation, t: float) -> int | None:
    """The number of the frame at a time; None if the time is between two frames."""
    number = round(t * animation.fps)
    return number if math.isclose(number / animation.fps, t) else None


def _given(animation: Animation | None) -> Animation:
    """The animation. Raises UserError if there is none."""
    if animation is None:
        raise UserError("animation: nothing moves in the scene, as it has none; give it one, or render it as it is")
    return animation


# Most frames of one call: eleven hours of them at 25 per second.
MOST = 1_000_000


def frame_times(
    animation: Animation, frames: str | slice | int | None = None, fps: float | None = None
) -> list[tuple[int, float]]:
    """Number and time in seconds of each frame.

    frames: which frames: a range such as `0:50:2`, as Python's slices, or one number; None: all of them
    fps: frames per second; None: those of the animation
    """
    rate = animation.fps if fps is None else fps
    if not 0 < rate <= MOST_FPS:
        text = f"{rate:g}" if isinstance(rate, float) else shown(rate)
        raise UserError(f"fps = {text}: must be greater than 0, and at most {MOST_FPS:g}")
    count = max(1, round(animation.duration * rate))
    chosen = range(count) if frames is None else _chosen(frames, count)
    if len(chosen) > MOST:
        raise UserError(
            f"frames: these are {len(chosen)}, and at most {MOST} are made at once; choose fewer, or fewer fps"
        )
    return [(k, min(k / rate, animation.duration)) for k in chosen]


def _chosen(frames: str | slice | int, count: int) -> range:
    """Numbers of the chosen frames of `count` ones. Raises UserError if a frame does not exist, or if none is
    chosen."""
    written = frames if isinstance(frames, str) else _text(frames)
    asked = _parsed(frames) if isinstance(frames, str) else frames
    if isinstance(asked, slice):
        ends = [x for x in (asked.start, asked.stop) if x is not None]
        step = 1 if asked.step is None else asked.step
    else:
        ends, step = [asked, asked + 1 if asked >= 0 else asked], 1
    if step == 0:
        raise UserError(f"frames = {_cut(written)}: the step must not be 0")
    if any(not -count <= x <= count for x in ends):
        raise UserError(f"frames = {_cut(written)}: {_outside(count)}")
    found = range(count)[asked] if isinstance(asked, slice) else range(count)[asked : asked + 1 or None]
    if not found:
        raise UserError(f"frames = {_cut(written)}: chooses no frame; {RULE}")
    return found


def _parsed(text: str) -> slice | int:
    """The slice or the number that a text stands for."""
    if re.fullmatch(r"-?\d+", text.strip()):
        return _whole(text.strip())
    parts = _RANGE.fullmatch(text.strip())
    if parts is None:
        raise UserError(f"frames = {shown(text)}: is no range of frames; {RULE}")
    return slice(*(None if x is None else _whole(x) for x in parts.groups()))


def _text(frames: slice | int) -> str:
    """A slice or a number as it is written."""
    if isinstance(frames, int):
        return _digits(frames)
    parts = [frames.start, frames.stop] + ([] if frames.step is None else [frames.step])
    return ":".join("" if x is None else _digits(x) for x in parts)


def _cut(written: str) -> str:
    """Frames as they are written, cut if they are long."""
    return written if len(written) <= LONGEST_VALUE else shown(written)


def _whole(text: str) -> int:
    """The whole number that a text stands for, or one that is outside of all frames as well."""
    sign, digits = ("-", text[1:]) if text[0] == "-" else ("", text)
    return int(sign + (digits.lstrip("0")[:_DIGITS] or "0"))


def _digits(number: Any) -> str:
    """A part of a slice as a text. A number of too many digits becomes one that is outside of all frames as well."""
    most = 10**_DIGITS
    return str(max(-most, min(number, most))) if isinstance(number, int) else str(number)
