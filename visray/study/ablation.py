"""The cost of each effect of a scene.

The picture with all effects (the full picture) is compared with the picture without the effect.

If an effect is left out, the effects that only refine it (`Rule.needs`) are left out too. Area lights are replaced by
point lights in their middles. The pictures are small (LONGEST_SIDE, RENDER_SECONDS), and each is rendered by one kernel
in one pass. Three numbers of each kernel are measured:

Operations: their number, as Dr.Jit counts them.

Seconds: the time that the compiled kernel runs. The time to trace the kernel in Python is left out: each pass traces
once, whatever its size. The full picture is rendered just before and just after each picture without an effect. The
mean of these two times, minus the time of the picture without the effect, is one difference. The cost is the median of
`runs` such differences.

Compile seconds: the time that Dr.Jit and LLVM take to compile the kernel. Dr.Jit stores compiled kernels in memory and
on disk, and a process cannot turn that off. So each kernel contains a number that no kernel has had before (new_mark).
The kernel of each picture without an effect is compiled once. Between these, the kernel of the full picture is compiled
FULL_COMPILATIONS times. A cost that is smaller than the range of these FULL_COMPILATIONS times counts as noise.
"""

import secrets
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from math import comb
from statistics import median
from typing import Any

import drjit as dr

from visray import clock
from visray.errors import UserError
from visray.explaining import explain
from visray.features import Feature
from visray.lights import PointLight
from visray.lights.light import Light
from visray.passes import empty_film, exposed_once
from visray.progress import Bar, Interrupts
from visray.quantities import Arrays
from visray.scene.adjusted import adjusted
from visray.scene.scene import Scene
from visray.setup import Prepared, prepare
from visray.tables import Table

LONGEST_SIDE = 256  # pixels of the longer side of the film
# Samples per pixel: as many as take RENDER_SECONDS, but at most MOST_SAMPLES.
MOST_SAMPLES, RENDER_SECONDS = 16, 0.1
RUNS, FULL_COMPILATIONS = 8, 3
# The bounds in a Spread miss the true median with a probability of at most CHANCE. For that the sign test needs at
# least FEWEST_RUNS values.
CHANCE, FEWEST_RUNS = 0.01, 8


def sign_test_trims(n: int, chance: float) -> list[int]:
    """An ascending list of all k such that the k least and the k largest of n values may be dropped.

    The true median lies outside the values that are left with a probability of at most `chance`, by the sign test. The
    list is empty if n values are too few.
    """
    beyond = [sum(comb(n, i) for i in range(k + 1)) / 2**n for k in range(n // 2)]
    return [k for k, missed in enumerate(beyond) if 2 * missed <= chance]


def new_mark() -> int:
    """A random number that no kernel has contained before. It is larger than the number of any column of pixels."""
    return 2**31 + secrets.randbelow(2**31)


def marked_columns(a: Arrays, x: Any, mark: int) -> Any:
    """The columns x of pixels, unchanged, but computed by code that contains the mark."""
    # No column is equal to the mark (new_mark).
    return dr.select(x == a.U(mark), 0, x)


@dataclass(frozen=True)
class Spread:
    """A measured number with its uncertainty.

    middle: the median of the measured values
    low, high: bounds between which the true median lies
    """

    middle: float
    low: float
    high: float

    @staticmethod
    def of(values: list[float]) -> "Spread":
        """The median of values. Two of the values are the bounds, chosen by the sign test."""
        ordered, k = sorted(values), max(sign_test_trims(len(values), CHANCE))
        return Spread(median(values), ordered[k], ordered[-1 - k])

    @property
    def in_noise(self) -> bool:
        """Whether the true median may be 0."""
        return self.low <= 0 <= self.high

    def text(self, scale: float = 1) -> str:
        """Text for the terminal: the median times `scale` and its error; if in_noise, only an upper bound on its
        absolute value."""
        low, middle, high = (scale * x for x in (self.low, self.middle, self.high))
        if self.in_noise:
            return f"< {max(-low, high):.2f}"
        return f"{middle:.2f} ± {max(high - middle, middle - low):.2f}"


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

    def table(self) -> Table:
        """The report for the terminal: the costs of the effects that the scene has."""
        title = f"{self.width} x {self.height} pixels, {self.spp} samples per pixel; medians of {self.runs} runs"
        table = Table("effect", title=title, caption=self._notes())
        for name in ("operations", "run, ms", "compile, s"):
            table.add_column(name, justify="right", no_wrap=True)
        for name, cost_of_effect in self.costs.items():
            table.add_row(name, *cost_of_effect.texts())
        table.add_section()
        table.add_row("all", *self.total.texts())
        return table

    def _notes(self) -> str:
        """Text below the table: the meaning of the columns, and which effects were left out together."""
        lines = [
            "run: the compiled kernel, without the time to trace it in Python",
            "compile: the kernel, if it is in no cache",
            "< x: the effect may cost nothing, and costs less than x",
        ]
        lines += [f"{name}: left out together with {', '.join(c.along)}" for name, c in self.costs.items() if c.along]
        return "\n".join(lines)


@dataclass(frozen=True)
class UncachedPicture:
    """A prepared scene whose kernel is in no cache before it is rendered.

    mark: a number that only the kernel of this picture contains
    """

    prepared: Prepared
    mark: int

    @staticmethod
    def of(prepared: Prepared) -> "UncachedPicture":
        return UncachedPicture(prepared, new_mark())

    def kernels(self) -> list[dict[str, Any]]:
        """Renders the picture in one pass. Returns Dr.Jit's records of the kernels, a list of dicts."""
        prepared = self.prepared
        film = empty_film(prepared)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            # The columns are marked again in each call: if marked columns were stored, Dr.Jit would trace the next
            # kernel in another order.
            x = marked_columns(prepared.a, prepared.x, self.mark)
            exposed_once(replace(prepared, x=x), film, prepared.scene.settings.spp)
            return dr.kernel_history([dr.KernelType.JIT])

    def seconds(self) -> float:
        """Seconds that the kernels run in one rendering."""
        return clock.kernel_seconds(self.kernels())

    def compiled(self) -> tuple[int, float]:
        """Renders the picture. Returns the number of operations and the compile seconds of its largest kernel.

        Domain: the first rendering, before the kernel is in a cache.
        """
        k = max(self.kernels(), key=lambda k: k["operation_count"])
        return k["operation_count"], (k["codegen_time"] + k["backend_time"]) / 1e3


def cost(scene: Scene, spp: int | None = None, runs: int = RUNS, progress: bool = False) -> Report:
    """Measures the cost of each effect that the scene has, and of the full picture.

    Ctrl-C raises KeyboardInterrupt as soon as the current step has ended.

    spp: samples per pixel; None: as many as take RENDER_SECONDS, and at most MOST_SAMPLES
    runs: how often each picture is rendered, at least FEWEST_RUNS
    progress: whether a progress bar is shown
    """
    if not isinstance(runs, int) or runs < FEWEST_RUNS:
        raise UserError(f"runs = {runs}: must be a whole number, at least {FEWEST_RUNS}, for the spread of a median")
    small = adjusted(scene, spp=spp, size=reduced_size(scene.film.width, scene.film.height))
    explanation = explain(small)
    with Interrupts() as interrupts:
        fitting = fitting_samples(small)
        small = adjusted(small, spp=spp or fitting)
        costs, total = _measured(small, explanation.names(), runs, progress, interrupts)
    film = small.film
    return Report(scene.hash(), film.width, film.height, small.settings.spp, runs, explanation.listed, costs, total)


def reduced_size(width: int, height: int, longest: int = LONGEST_SIDE) -> tuple[int, int]:
    """Width and height of a film, scaled down so that the longer side has at most `longest` pixels."""
    scale = longest / max(width, height, longest)
    return max(1, round(width * scale)), max(1, round(height * scale))


def fitting_samples(scene: Scene) -> int:
    """Number of samples per pixel that take about RENDER_SECONDS, and at most MOST_SAMPLES.

    This must be called before other times are measured: the first kernel that is compiled also starts LLVM, which takes
    time.
    """
    picture = UncachedPicture.of(prepare(adjusted(scene, spp=1)))
    picture.compiled()
    return min(MOST_SAMPLES, max(1, int(RENDER_SECONDS / picture.seconds())))


def prepared_without(scene: Scene, effect: str) -> Prepared:
    """The scene, prepared without an effect. If the effect is "area lights", point lights replace these lights."""
    if effect != "area lights":
        return prepare(scene, without=(effect,))
    shared = [f.name for f in fields(Light)]
    points = {
        name: PointLight(position=l.position, **{f: getattr(l, f) for f in shared}) if l.has_area else l
        for name, l in scene.lights.items()
    }
    return prepare(replace(scene, lights=points))


class _Steps:
    """Runs steps of work one by one and shows progress.

    An instance is called with a function. The call runs the function and returns the function's result. After Ctrl-C,
    the next call raises KeyboardInterrupt instead.
    """

    def __init__(self, interrupts: Interrupts, bar: Bar):
        self.interrupts, self.bar, self.done = interrupts, bar, 0

    def __call__(self, work: Callable[[], Any]) -> Any:
        if self.interrupts.requested:
            raise KeyboardInterrupt
        result = work()
        self.done += 1
        self.bar.update(self.done)
        return result


def _measured(
    scene: Scene, effects: list[str], runs: int, progress: bool, interrupts: Interrupts
) -> tuple[dict[str, Cost], Cost]:
    """The cost of each effect by name, and the cost of the full picture.

    effects: names of the effects; runs, progress: see `cost`
    """
    n, half = len(effects), len(effects) // 2
    with Bar("measuring", (n + 1) + (n + FULL_COMPILATIONS) + runs * (2 * n + 1), progress) as bar:
        step = _Steps(interrupts, bar)
        everything = step(partial(prepare, scene))
        pictures_without = {e: UncachedPicture.of(step(partial(prepared_without, scene, e))) for e in effects}
        full = [UncachedPicture.of(everything) for _ in range(FULL_COMPILATIONS)]
        others = list(pictures_without.values())
        queue = [full[0], *others[:half], *full[1:-1], *others[half:], full[-1]]
        compiled = {p.mark: step(p.compiled) for p in queue}
        full_seconds, differences = _alternating_runs(step, full[0], pictures_without, runs)
    operations, times = zip(*(compiled[p.mark] for p in full))
    total = Cost(operations[0], Spread.of(full_seconds), Spread(median(times), min(times), max(times)))
    return {
        e: _cost(e, p, *compiled[p.mark], differences[e], total, effects) for e, p in pictures_without.items()
    }, total


def _cost(
    effect: str,
    picture: UncachedPicture,
    operations: int,
    seconds: float,
    differences: list,
    total: Cost,
    effects: list[str],
) -> Cost:
    """The cost of an effect.

    picture: the picture without the effect
    operations, seconds: number of operations and compile seconds of that picture's kernel
    differences: run times of the full picture minus run times of that picture (seconds)
    total: the cost of the full picture
    effects: names of all effects that the scene has
    """
    c, on = total.compile_seconds, picture.prepared.features
    noise, more = c.high - c.low, c.middle - seconds
    along = tuple(e for e in effects if e != effect and not on[e])
    spread = Spread(more, more - noise, more + noise)
    return Cost(total.operations - operations, Spread.of(differences), spread, along)


def _alternating_runs(
    step: _Steps, full: UncachedPicture, pictures_without: dict[str, UncachedPicture], runs: int
) -> tuple[list[float], dict[str, list[float]]]:
    """A list of run times of the full picture; and for each effect, a list of differences. Units: seconds.

    The full picture is rendered just before and just after each picture without an effect. A difference is the mean of
    these two times minus the time of the picture without the effect.
    """
    full_seconds: list[float] = []
    differences: dict[str, list[float]] = {effect: [] for effect in pictures_without}
    for _ in range(runs):
        full_seconds.append(step(full.seconds))
        for effect, picture in pictures_without.items():
            seconds = step(picture.seconds)
            full_seconds.append(step(full.seconds))
            differences[effect].append((full_seconds[-2] + full_seconds[-1]) / 2 - seconds)
    return full_seconds, differences
