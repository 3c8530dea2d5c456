"""Records of a tuned scene: the target, the renders, and the result."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from visray.adaptive.stopping import check_target
from visray.errors import UserError
from visray.scene.load import dump
from visray.scene.scene import Scene
from visray.study.cost.records import Band, Report, Settings
from visray.study.cost.writing import duration, number, percent
from visray.tables import Table, styled

LATE = 1.1  # a time may be exceeded by this factor


@dataclass(frozen=True)
class Target:
    """The target: an error, or seconds of one render; the other is None."""

    error: float | None
    time: float | None

    @staticmethod
    def of(error: float | None, time: float | None) -> "Target":
        """The target; raises a UserError unless exactly one of them is given, a number above 0."""
        for name, given, example in (("error", error, 0.01), ("time", time, 10)):
            check_target(name, given, example)
        if error is not None and time is not None:
            raise UserError(f"error = {error:g} and time = {time:g}: only one can be asked for; leave the other out")
        if error is None and time is None:
            raise UserError("nothing is asked for; give an error, such as 0.01, or a time in seconds, such as 10")
        return Target(error, time)

    @property
    def option(self) -> str:
        """The target as an option of `visray render`."""
        return f"--time {self.time:g}" if self.error is None else f"--error {self.error:g}"

    @property
    def wanted(self) -> str:
        """The target in words."""
        return f"a time of {duration(self.time)}" if self.error is None else f"an error of {percent(self.error, 2)}"

    def met(self, render: "Measured") -> bool:
        """Whether a render meets the target: an error by the upper end of its interval."""
        if self.error is not None:
            return render.error.high <= self.error
        return render.seconds.middle <= LATE * self.time


@dataclass(frozen=True)
class Measured:
    """Adaptive renders to the target, at the scene's own size.

    settings: values of all settings that `tune` chooses, by address
    seconds: of one render, after its kernels are compiled and the scene is prepared
    error: relative error, noise and bias together
    spp: mean samples per pixel
    """

    settings: Settings
    seconds: Band
    error: Band
    spp: float


@dataclass(frozen=True)
class Tuned:
    """The settings that `tune` chose, and what they bring.

    target: what was asked for
    settings: values of all settings that `tune` chooses, by address
    changed: those that differ from the scene's
    after: renders with these settings
    before: renders with the scene's own settings; None if these cannot reach the target
    met: whether the target is reached
    stopped: whether Ctrl-C ended the search
    reasons: changes, results and what to do next, a sentence each
    scene: the scene with these settings
    report: the study that the choice is based on
    """

    target: Target
    settings: Settings
    changed: Settings
    after: Measured
    before: Measured | None
    met: bool
    stopped: bool
    reasons: tuple[str, ...]
    scene: Scene = field(repr=False)
    report: Report = field(repr=False)

    @property
    def error(self) -> Band:
        """Error that was reached."""
        return self.after.error

    @property
    def seconds(self) -> Band:
        """Time that it took."""
        return self.after.seconds

    def __repr__(self) -> str:
        asked = [f"{k} = {v:g}" for k, v in asdict(self.target).items() if v is not None]
        changed = ", ".join(f"{a} = {v}" for a, v in self.changed.items()) or "nothing changed"
        reached = f"error {percent(self.error.middle)} in {duration(self.seconds.middle)}"
        return f"<Tuned for {asked[0]}: {'met' if self.met else 'not met'}, {reached}; {changed}>"

    def as_json(self) -> dict[str, Any]:
        """The result as json.dumps takes it, with the notes of the study and the machine."""
        return {
            "advice": self.advice(),
            "asked": {k: v for k, v in asdict(self.target).items() if v is not None},
            "met": self.met,
            "stopped": self.stopped,
            "settings": self.settings,
            "changed": self.changed,
            "measured": _numbers(self.after),
            "before": None if self.before is None else _numbers(self.before),
            "reasons": list(self.reasons),
            "notes": list(self.report.notes),
            "machine": self.report.machine,
            "scene_hash": self.scene.hash(),
        }

    def advice(self) -> str:
        """The headline: what to do, and what it brings, in one or two sentences."""
        chosen = ", ".join(f"{a.removeprefix('settings.')}={v}" for a, v in self.changed.items())
        todo = f"Use {chosen} with " if chosen else "Keep the scene's settings, and use "
        todo += self.target.option
        if self.target.time is not None:
            todo += " and some seconds more, for loading and compiling"
        width, height = self.scene.film.raster
        reached = f"an error of {percent(self.error.middle)} in about {duration(self.seconds.middle)}"
        missed = "" if self.met else f" The target was missed: nothing tried comes nearer to {self.target.wanted}."
        return f"{todo}: {reached}, at {width} x {height} pixels.{missed}"

    def table(self) -> Table:
        """The result for the terminal: what to do, settings, error, time, and reasons."""
        notes = "\n".join(f"- {r}" for r in self.reasons)
        rows = Table(title=self.advice(), title_justify="left", caption=notes, caption_justify="left")
        rows.add_column("setting")
        for name in ("the scene as it is", "tuned"):
            rows.add_column(name, justify="right", no_wrap=True)
        for address, new in self.settings.items():
            text = styled(str(new), "bold" if address in self.changed else "dim")
            rows.add_row(address, str(self.report.default.settings[address]), text)
        rows.add_section()
        columns = [self.before, self.after]
        for name, text in (
            ("error", lambda m: percent(m.error.middle)),
            ("time", lambda m: duration(m.seconds.middle)),
            ("samples per pixel", lambda m: number(m.spp)),
        ):
            rows.add_row(name, *("out of reach" if m is None else text(m) for m in columns))
        return rows


def _numbers(render: Measured) -> dict[str, Any]:
    """Error, seconds and samples of a render for JSON."""
    return {"error": asdict(render.error), "seconds": asdict(render.seconds), "spp": render.spp}


def as_scene(tuned: Tuned, folder: Path | None = None, like: Path | None = None) -> str:
    """The tuned scene as the text of a JSON file. Files of textures are relative to its folder; `like`: the original
    file, whose order and comments are kept."""
    return dump(tuned.scene, folder, like)
