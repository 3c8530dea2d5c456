"""What a tuner is asked for, what it measured, and what it found."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from rich.table import Table

from visray.adaptive.stopping import check_target
from visray.errors import UserError
from visray.scene.load import dump
from visray.scene.scene import Scene
from visray.study.cost.records import Band, Report
from visray.study.cost.wording import duration, percent

# A time may be exceeded by so much.
LATE = 1.1

Settings = dict[str, Any]


@dataclass(frozen=True)
class Target:
    """What is asked for: an error, or seconds of one render; the other is None."""

    error: float | None
    time: float | None

    @staticmethod
    def of(error: float | None, time: float | None) -> "Target":
        for name, given, example in (("error", error, 0.01), ("time", time, 10)):
            check_target(name, given, example)
        if error is not None and time is not None:
            raise UserError(f"error = {error:g} and time = {time:g}: only one can be asked for; leave the other out")
        if error is None and time is None:
            raise UserError("nothing is asked for; give an error, such as 0.01, or a time in seconds, such as 10")
        return Target(error, time)

    def met(self, found: "Measured") -> bool:
        if self.error is not None:
            return found.error.high <= self.error
        return found.seconds.middle <= LATE * self.time

    def missed(self, found: "Measured") -> float:
        """By what factor at most."""
        return found.seconds.middle / self.time if self.error is None else found.error.high / self.error


@dataclass(frozen=True)
class Measured:
    """Renders at the scene's own size. seconds: of one, its kernels compiled, the scene set up; error: relative, with
    what is left whatever the samples; noise: the squared part of it that differs from seed to seed."""

    settings: Settings
    seconds: Band
    error: Band
    noise: float


@dataclass(frozen=True)
class Tuned:
    """The knobs of a scene, chosen.

    settings: of all knobs, by address; changed: those that differ from the scene's. error and seconds: measured with
    them at the scene's own size, predicted_*: by the model before that; before: the same of the scene as it is. met:
    whether the target is reached; stopped: by Ctrl-C. reasons: a sentence for each knob that is changed; variance is
    squared noise. scene: with these settings.
    """

    target: Target
    settings: Settings
    changed: Settings
    predicted_error: float
    predicted_seconds: float
    error: Band
    seconds: Band
    before: Measured
    met: bool
    stopped: bool
    reasons: tuple[str, ...]
    scene: Scene = field(repr=False)
    report: Report = field(repr=False)

    def __repr__(self) -> str:
        asked = [f"{k} = {v:g}" for k, v in asdict(self.target).items() if v is not None]
        changed = ", ".join(f"{a} = {v}" for a, v in self.changed.items()) or "nothing changed"
        came = f"error {percent(self.error.middle)} in {duration(self.seconds.middle)}"
        return f"<Tuned for {asked[0]}: {'met' if self.met else 'not met'}, {came}; {changed}>"

    def as_json(self) -> dict[str, Any]:
        """All of it as json.dumps takes it; of the report only its notes, and the machine."""
        found = {
            "asked": {k: v for k, v in asdict(self.target).items() if v is not None},
            "met": self.met,
            "stopped": self.stopped,
            "settings": self.settings,
            "changed": self.changed,
            "predicted": {"error": self.predicted_error, "seconds": self.predicted_seconds},
            "measured": {"error": asdict(self.error), "seconds": asdict(self.seconds)},
            "before": {"error": asdict(self.before.error), "seconds": asdict(self.before.seconds)},
        }
        told = {"reasons": list(self.reasons), "notes": list(self.report.notes), "machine": self.report.machine}
        return found | told | {"scene_hash": self.scene.hash()}

    def table(self) -> Table:
        """What changes, for the terminal, and why."""
        film = self.scene.film
        title = f"{film.width} x {film.height} pixels: " + ("as asked" if self.met else "not quite as asked")
        rows = Table(title=title, caption="\n".join(self.reasons), caption_justify="left")
        rows.add_column("")
        for name in ("the scene", "tuned"):
            rows.add_column(name, justify="right", no_wrap=True)
        for address, new in self.settings.items():
            # What stays needs no look.
            text = f"[bold]{new}[/]" if address in self.changed else f"[dim]{new}[/]"
            rows.add_row(address, str(self.before.settings[address]), text)
        rows.add_section()
        for name, unit, factor in (("error", "%", 100), ("seconds", "s", 1)):
            bands = getattr(self.before, name), getattr(self, name)
            rows.add_row(name, *(f"{factor * b.middle:.3g} {unit}" for b in bands))
        return rows


def as_scene(tuned: Tuned, folder: Path | None = None, like: Path | None = None) -> str:
    """The tuned scene as the text of a JSON file, in which files of textures are relative to its folder; `like`: the
    file that it comes from, of which all else is kept."""
    return dump(tuned.scene, folder, like)
