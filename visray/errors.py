"""Errors that a user can correct: one line each, never a traceback."""

from collections.abc import Iterator
from contextlib import contextmanager


class UserError(Exception):
    """An error of one or more lines; each line says the address, what is wrong, and what would be right. The command
    line prints the lines and exits with status 2."""

    def __init__(self, *lines: str):
        super().__init__("\n".join(lines))
        self.lines = lines


class FieldError(UserError, ValueError):
    """An error of the fields of a record. Where a file is read, its address is added."""


class ClusterLost(UserError):
    """The scheduler of a cluster or all its workers are lost in the middle of a job. What is done is kept."""


class MomentError(UserError):
    """The scene of an animation is not valid at some moment. Each line begins with the time."""

    def of_frame(self, number: int) -> "MomentError":
        """The same error, with the number of the frame."""
        return MomentError(*(f"frame {number}, {text}" for text in self.lines))


@contextmanager
def of_moment(when: str) -> Iterator[None]:
    """A `with` block whose errors are those of a moment. when: words for it, such as "at 1 s"."""
    try:
        yield
    except MomentError:
        raise
    except UserError as error:
        raise MomentError(*(f"{when}: {text}" for text in error.lines)) from None


class RangeWarning(UserWarning):
    """A file cannot hold some numbers of a picture: they are clamped."""


class StoppedWarning(UserWarning):
    """A picture was stopped before each of its pixels had a sample, or before its layers were computed."""


class GoalWarning(UserWarning):
    """The error of a picture is larger than was asked for, or it is unknown."""


class DepthWarning(UserWarning):
    """settings.depth ends paths that carry light."""


class LegendWarning(UserWarning):
    """A legend leaves something out, or a character of it cannot be drawn."""


class CheckpointWarning(UserWarning):
    """A checkpoint is missing or cannot be written, or it keeps the samples of a picture that was stopped."""


class ClusterWarning(UserWarning):
    """A worker of a cluster is refused, and others do its work."""


class StructureWarning(UserWarning):
    """A frame of an animation needs other kernels than the frame before."""


class AnimationWarning(UserWarning):
    """A track goes on after the end of the animation, or an assignment has no effect, as a track writes the value."""


class FittedNote(UserWarning):
    """A scene has no camera, or no lights: they were fitted (fitted_scene.py)."""
