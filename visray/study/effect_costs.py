"""The report of what the effects of a scene cost."""

from dataclasses import asdict, dataclass
from typing import Any

from visray.features import Feature
from visray.study.spread import Spread
from visray.tables import Table


@dataclass(frozen=True)
class Cost:
    """The cost of one effect, or of the full picture.

    For an effect, each number is that of the full picture minus that of the picture without the effect.

    operations: number of operations of the kernel
    seconds: time that the kernel runs
    compile_seconds: time to compile the kernel
    along: names of the other effects that are left out together with the effect
    """

    operations: int
    seconds: Spread
    compile_seconds: Spread
    along: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        report: dict[str, Any] = {"operations": self.operations}
        for name, s in (("seconds", self.seconds), ("compile_seconds", self.compile_seconds)):
            report |= {name: s.middle, f"{name}_spread": [s.low, s.high], f"{name}_in_noise": s.in_noise}
        return report | {"left_out_with": list(self.along)}

    def texts(self) -> tuple[str, str, str]:
        """Texts for the terminal: operations, milliseconds of a run, and compile seconds."""
        return f"{self.operations:,}", self.seconds.text(1e3), self.compile_seconds.text()


@dataclass(frozen=True)
class Report:
    """The costs of a scene's effects.

    scene_hash: hash of the scene
    width, height, spp: size of the measured picture (pixels), and its samples per pixel
    runs: how often each picture was rendered
    features: all effects that visray knows, each with whether the scene has it and why
    costs: the cost of each effect that the scene has, by the effect's name
    total: the cost of the full picture
    """

    scene_hash: str
    width: int
    height: int
    spp: int
    runs: int
    features: tuple[Feature, ...]
    costs: dict[str, Cost]
    total: Cost

    def as_json(self) -> dict[str, Any]:
        """The report as a dict for json.dumps."""
        measured = {name: c.as_json() for name, c in self.costs.items()}
        return {
            "scene_hash": self.scene_hash,
            "picture": {"width": self.width, "height": self.height, "spp": self.spp, "runs": self.runs},
            "features": [asdict(f) | measured.get(f.name, {}) for f in self.features],
            "total": self.total.as_json(),
        }

    def headline(self) -> str:
        """Which effect takes the most time, which share of the whole, and what to do."""
        costs = {name: c.seconds for name, c in self.costs.items() if c.seconds.middle > 0 and not c.seconds.in_noise}
        if not costs:
            return "No effect takes a time that can be measured; a larger --spp or --runs shows smaller times."
        name, seconds = max(costs.items(), key=lambda item: item[1].middle)
        share = 100 * seconds.middle / self.total.seconds.middle
        advice = "visray cost SCENE measures what to change."
        return f"The most costly effect: {name}, {share:.2g} % of the rendering time. {advice}"

    def table(self) -> Table:
        """The report for the terminal: the costs of the effects that the scene has."""
        table = Table(
            "effect", title=self.headline(), title_justify="left", caption=self._notes(), caption_justify="left"
        )
        for name in ("operations", "rendering, ms", "compiling, s"):
            table.add_column(name, justify="right", no_wrap=True)
        for name, cost_of_effect in self.costs.items():
            table.add_row(name, *cost_of_effect.texts())
        table.add_section()
        table.add_row("the whole picture", *self.total.texts())
        return table

    def _notes(self) -> str:
        """Text below the table: the meaning of its numbers, and which effects were left out together."""
        spp = f"{self.spp} sample{'s' * (self.spp != 1)} per pixel"
        lines = [
            f"measured on {self.width} x {self.height} pixels with {spp}; medians of {self.runs} runs",
            "each row: the whole picture, minus the picture without this effect",
            "operations: steps of the program that makes the picture",
            "rendering: time of the compiled program, without starting and compiling",
            "compiling: needed once for a kind of scene; the compiled program is kept on disk",
            "< x: the effect may cost nothing, and costs less than x",
        ]
        lines += [f"{name}: left out together with {', '.join(c.along)}" for name, c in self.costs.items() if c.along]
        return "\n".join(f"- {line}" for line in lines)
