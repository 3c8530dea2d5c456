"""The report of `visray animate`."""

from typing import TYPE_CHECKING, Any

from visray import clock
from visray.cli.picture_report import goal_met

if TYPE_CHECKING:
    from visray.errors import UserError
    from visray.output.frame_files import FrameFiles

# The facts about a frame that are reported, of those that its picture has.
FACTS = (
    "frame", "time", "scene_hash", "spp", "error_at_most", "depth_error_at_least", "error", "error_low", "error_high",
    "time_missed",
)  # fmt: skip


class FrameReport:
    """What was rendered and written.

    files: the files of the frames.
    asked: number of frames that were asked for.
    begun: the moment when the command began (clock.now).
    frames: a dict of facts for each frame that was rendered.
    found: number of frames whose files were finished already.
    goals_met: whether all frames have the error that was asked for.
    lost: the error that is raised when the finished frames are kept; None if there is none.
    """

    def __init__(self, files: "FrameFiles", asked: int, begun: float):
        self.files, self.asked, self.begun, self.last = files, asked, begun, clock.now()
        self.frames: list[dict[str, Any]] = []
        self.compiled: int | None = 0
        self.found, self.goals_met = 0, True
        self.size = 0, 0
        self.lost: UserError | None = None

    def add(self, picture: dict[str, Any], compiled: int | None) -> None:
        """Adds a frame whose files are written.

        picture: metadata of its picture. compiled: number of kernels that were compiled for all frames so far;
        None if it is not known, because others compile them.
        """
        now = clock.now()
        facts = {key: picture[key] for key in FACTS if key in picture}
        facts |= {"seconds": now - self.last, "compiled": None if compiled is None else compiled - (self.compiled or 0)}
        facts["files"] = [str(path) for path in self.files.paths(picture["frame"])]
        self.frames.append(facts)
        self.last, self.compiled = now, compiled
        self.goals_met = self.goals_met and goal_met(picture)

    def facts(self) -> dict[str, Any]:
        """The report for --json."""
        return {
            "outputs": self.outputs(),
            "asked": self.asked,
            "found": self.found,
            "rendered": len(self.frames),
            "compiled": self.compiled,
            "seconds": clock.now() - self.begun,
            "seconds_per_frame": self.pace(),
            "frames": self.frames,
        }

    def outputs(self) -> list[str]:
        """What was written: patterns of files, and movies."""
        return [str(path) for path in self.files.outputs]

    def pace(self) -> float | None:
        """Mean seconds of a frame after the first, which compiles kernels; None if there is none."""
        rest = [frame["seconds"] for frame in self.frames[1:]]
        return sum(rest) / len(rest) if rest else None

    def line(self, stopped: bool) -> str:
        """The report as one line of text. stopped: whether Ctrl-C ended the work."""
        total = f"{self.asked} frame{'s' * (self.asked > 1)}"
        count = f"{len(self.frames)} of {total}" if len(self.frames) < self.asked else total
        found = f", {self.found} found finished" if self.found else ""
        pace = f", {self.pace():.3g} s a frame" if self.pace() is not None else ""
        end = ", stopped" if stopped else ""
        return f"{', '.join(self.outputs())}: {count} rendered{found}{end}, {clock.now() - self.begun:.2f} s{pace}"
