"""What `visray animate` finds of its outputs: what it must not replace, and what is finished already."""

from collections import Counter
from typing import TYPE_CHECKING

from visray.errors import CheckpointWarning, UserError
from visray.warn import warn

if TYPE_CHECKING:
    from visray.animation.frames import Frame
    from visray.frame_maker import FrameMaker
    from visray.output.frame_files import FrameFiles, FrameWriter


def refuse_existing(files: "FrameFiles", chosen: list["Frame"]) -> None:
    """Raises a UserError if movies or files of frames exist."""
    found = files.existing([frame.number for frame in chosen])
    if found:
        more = f", and {len(found) - 1} more of these files" if found[1:] else ""
        right = "--resume renders only what is missing, --overwrite replaces what exists"
        raise UserError(f"{found[0]}: exists already{more}; {right}")


def missing_frames(chosen: list["Frame"], maker: "FrameMaker", writer: "FrameWriter") -> list["Frame"]:
    """The frames that are to be rendered: those without files, or with files of another picture, of which a note tells.
    The others go to the movies."""
    from visray.output.up_to_date import MISSING

    missing, replaced = [], Counter()
    for frame in chosen:
        reason = writer.files.outdated(frame.number, maker.wanted(frame))
        if reason is None:
            writer.keep(frame.number)
            continue
        missing.append(frame)
        if reason != MISSING:
            replaced[reason] += 1
    if replaced:
        parts = ", ".join(f"{count} {reason}" for reason, count in replaced.items())
        total = f"{replaced.total()} finished frame{'s' * (replaced.total() > 1)}"
        warn(f"{writer.files.sequences[0]}: {total} made again: {parts}", CheckpointWarning)
    return missing


def say_how_to_go_on(files: "FrameFiles") -> None:
    """Says after Ctrl-C how the other frames are rendered."""
    if files.are_kept:
        warn(f"{files.outputs[0]}: --resume renders the frames that are missing", CheckpointWarning)
    else:
        text = "keeps no frames, so --overwrite begins anew; with --checkpoint, --resume would go on"
        warn(f"{files.movies[0]}: {text}", CheckpointWarning)
