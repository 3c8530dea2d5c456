"""The moment of an animated scene that a command shows, and the files for it."""

import re
from pathlib import Path
from typing import TYPE_CHECKING

from visray.errors import UserError

if TYPE_CHECKING:
    from visray.scene.scene import Scene


def moment(scene: "Scene", at: float | None, frame: int | None) -> float | None:
    """The moment in seconds; None if no option says it.

    at: value of the option --at, in seconds. frame: value of the option --frame.
    """
    from visray.animation.frames import chosen_frames

    if frame is None:
        return at
    if at is not None:
        raise UserError(f"--at = {at:g} and --frame = {frame}: both say the moment; leave one out")
    return chosen_frames(scene.animation, frame)[0].time


def files_at(scene: "Scene", outputs: list[Path], at: float | None) -> list[Path]:
    """The files for a picture of one moment: in a name such as shot.####.exr, #### becomes the number of its frame.

    at: seconds; None: the beginning.
    """
    from visray.animation.frames import frame_at
    from visray.output.sequence import frame_file, is_pattern

    patterns = [path for path in outputs if is_pattern(path)]
    if not patterns:
        return outputs
    if scene.animation is None:
        still = re.sub(r"[._-]?#+", "", patterns[0].stem) or "picture"
        right = patterns[0].with_name(still + patterns[0].suffix)
        raise UserError(f"{patterns[0]}: # is for numbers of frames, and nothing moves in the scene; write {right}")
    number = frame_at(scene.animation, at or 0.0)
    if number is None:
        raise UserError(f"{patterns[0]}: # is for the number of a frame, and at {at:g} s there is none; give --frame")
    return [frame_file(path, number) if path in patterns else path for path in outputs]
