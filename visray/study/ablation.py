"""What each effect of a scene costs: its picture against the same one without that effect, in one process.

An effect is left out with those that only refine it (`Rule.needs`); for area lights, points in their middles shine.
The pictures are small (LONGEST, BRIEF), each made by one kernel in one pass. Of that kernel is measured:

Operations, as Dr.Jit counts them.

Seconds: how long it runs once it is compiled. Tracing it in Python is not in them; each pass does that once, whatever
its size. The picture with all effects is made before and after each other one, `runs` times over; the cost is the
median of the differences from the mean of both.

Compile seconds: what Dr.Jit and LLVM take to make it. Dr.Jit keeps kernels in memory and on disk, and no switch in a
process turns that off; so each kernel holds a number that no kernel has held before (new_mark). Each is compiled
once, and that of all effects REPEATS times in between: what these differ by, no effect can be told from.
"""

import secrets
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from math import comb
from statistics import median
from typing import Any

import drjit as dr
from rich.table import Table

from visray import clock
from visray.errors import UserError
from visray.features import Feature
from visray.lights import PointLight
from visray.lights.light import Light
from visray.passes import empty_film, exposed_once
from visray.progress import Bar, Interrupts
from visray.quantities import Arrays
from visray.render import adjusted, explain
from visray.scene.scene import Scene
from visray.setup import Prepared, prepare

LONGEST = 256  # pixels of the longer side
MOST, BRIEF = 16, 0.1  # samples per pixel: this many, or as many as run in so many seconds
RUNS, REPEATS = 8, 3
# The chance that a spread misses the true median is at most this, for which so many values are needed.
CHANCE, FEWEST = 0.01, 8


def sign_test_trims(n: int, chance: float) -> list[int]:
    """How many of n values may be left out at each end, so that the true median lies within the others but for a
    chance, by the sign test; none where they are too few for that."""
    beyond = [sum(comb(n, i) for i in range(k + 1)) / 2**n for k in range(n // 2)]
    return [k for k, missed in enumerate(beyond) if 2 * missed <= chance]


def new_mark() -> int:
    """A number that no kernel has held before: that of a column of pixels, far outside any film."""
    return 2**31 + secrets.randbelow(2**31)


def marked_columns(a: Arrays, x: Any, mark: int) -> Any:
    """The columns of pixels, by a kernel that holds the mark: the column of that number would be moved to the first."""
    return dr.select(x == a.U(mark), 0, x)


@dataclass(frozen=True)
class Spread:
    """A measured number, and between which two it lies."""

    middle: float
    low: float
    high: float

    @staticmethod
    def of(values: list[float]) -> "Spread":
        """The median, and two of the values between which the true one lies, by the sign test."""
        ordered, k = sorted(values), max(sign_test_trims(len(values), CHANCE))
        return Spread(median(values), ordered[k], ordered[-1 - k])

    @property
    def in_noise(self) -> bool:
        """Whether it may as well be 0."""
        return self.low <= 0 <= self.high

    def text(self, scale: float = 1) -> str:
        low, middle, high = (scale * x for x in (self.low, self.middle, self.high))
        if self.in_noise:
            return f"< {max(-low, high):.2f}"
        return f"{middle:.2f} ± {max(high - middle, middle - low):.2f}"


@dataclass(frozen=True)
class Cost:
    """What an effect adds, or what all of them take. along: the effects that were left out with it."""

    operations: int
    seconds: Spread
    compile_seconds: Spread
    along: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        found: dict[str, Any] = {"operations": self.operations}
        for name, s in (("seconds", self.seconds), ("compile_seconds", self.compile_seconds)):
            found |= {name: s.middle, f"{name}_spread": [s.low, s.high], f"{name}_in_noise": s.in_noise}
        return found | {"left_out_with": list(self.along)}

    def texts(self) -> tuple[str, str, str]:
        """Operations, milliseconds and compile seconds for the terminal."""
        return f"{self.operations:,}", self.seconds.text(1e3), self.compile_seconds.text()


@dataclass(frozen=True)
class Report:
    """The effects of a scene, what each that is on costs, and what the whole picture takes."""

    scene_hash: str
    width: int
    height: int
    spp: int
    runs: int
    features: tuple[Feature, ...]
    costs: dict[str, Cost]
    total: Cost

    def as_json(self) -> dict[str, Any]:
        """The report as json.dumps takes it."""
        measured = {name: c.as_json() for name, c in self.costs.items()}
        return {
            "scene_hash": self.scene_hash,
            "picture": {"width": self.width, "height": self.height, "spp": self.spp, "runs": self.runs},
            "features": [asdict(f) | measured.get(f.name, {}) for f in self.features],
            "total": self.total.as_json(),
        }

    def table(self) -> Table:
        """The report for the terminal: what the effects that are on cost."""
        title = f"{self.width} x {self.height} pixels, {self.spp} samples each; medians of {self.runs} runs by turns"
        table = Table("effect", title=title, caption=self._notes())
        for name in ("operations", "run, ms", "compile, s"):
            table.add_column(name, justify="right", no_wrap=True)
        for name, found in self.costs.items():
            table.add_row(name, *found.texts())
        table.add_section()
        table.add_row("all", *self.total.texts())
        return table

    def _notes(self) -> str:
        """What a reader of the columns must know."""
        lines = ["run: of the compiled kernel, without tracing it in Python", "compile: with no kernel in the cache"]
        lines += [f"{name}: left out with {', '.join(c.along)}" for name, c in self.costs.items() if c.along]
        return "\n".join(lines)


@dataclass(frozen=True)
class Picture:
    """A scene that is set up, and the mark of its kernel alone."""

    prepared: Prepared
    mark: int

    @staticmethod
    def of(prepared: Prepared) -> "Picture":
        return Picture(prepared, new_mark())

    def kernels(self) -> list[dict[str, Any]]:
        """Makes the picture in one pass; what Dr.Jit says of the kernels that did."""
        prepared = self.prepared
        film = empty_film(prepared)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            # Anew each time: were it kept, the next kernel would be traced in another order.
            x = marked_columns(prepared.a, prepared.x, self.mark)
            exposed_once(replace(prepared, x=x), film, prepared.scene.settings.spp)
            return dr.kernel_history([dr.KernelType.JIT])

    def seconds(self) -> float:
        """How long its kernels run."""
        return clock.kernel_seconds(self.kernels())

    def compiled(self) -> tuple[int, float]:
        """Operations and compile seconds of its kernel, where it is made for the first time."""
        k = max(self.kernels(), key=lambda k: k["operation_count"])
        return k["operation_count"], (k["codegen_time"] + k["backend_time"]) / 1e3


def cost(scene: Scene, spp: int | None = None, runs: int = RUNS, progress: bool = False) -> Report:
    """What each effect that the scene calls for costs, and the whole picture. Ctrl-C raises KeyboardInterrupt, but not
    in the middle of a kernel."""
    if not isinstance(runs, int) or runs < FEWEST:
        raise UserError(f"runs = {runs}: must be a whole number, at least {FEWEST}, for the spread of a median")
    small = adjusted(scene, spp=spp, size=reduced_size(scene.film.width, scene.film.height))
    found = explain(small)
    with Interrupts() as interrupts:
        fitted = fitting(small)
        small = adjusted(small, spp=spp or fitted)
        costs, total = _measured(small, found.names(), runs, progress, interrupts)
    film = small.film
    return Report(scene.hash(), film.width, film.height, small.settings.spp, runs, found.listed, costs, total)


def reduced_size(width: int, height: int, longest: int = LONGEST) -> tuple[int, int]:
    """The film's size with its longer side at most so many pixels."""
    scale = longest / max(width, height, longest)
    return max(1, round(width * scale)), max(1, round(height * scale))


def fitting(scene: Scene) -> int:
    """How many samples of a pixel run in about BRIEF. With this kernel LLVM itself starts: it must be the first."""
    one = Picture.of(prepare(adjusted(scene, spp=1)))
    one.compiled()
    return min(MOST, max(1, int(BRIEF / one.seconds())))


def left_out(scene: Scene, effect: str) -> Prepared:
    """The scene set up without an effect."""
    if effect != "area lights":
        return prepare(scene, without=(effect,))
    shared = [f.name for f in fields(Light)]
    points = {
        name: PointLight(position=l.position, **{f: getattr(l, f) for f in shared}) if l.has_area else l
        for name, l in scene.lights.items()
    }
    return prepare(replace(scene, lights=points))


class _Steps:
    """Does one piece of work after the other; after Ctrl-C stops between two of them."""

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
    """The costs of the effects, and of all together."""
    n, half = len(effects), len(effects) // 2
    with Bar("measuring", (n + 1) + (n + REPEATS) + runs * (2 * n + 1), progress) as bar:
        step = _Steps(interrupts, bar)
        everything = step(partial(prepare, scene))
        lesser = {e: Picture.of(step(partial(left_out, scene, e))) for e in effects}
        wholes = [Picture.of(everything) for _ in range(REPEATS)]
        each = list(lesser.values())
        queue = [wholes[0], *each[:half], *wholes[1:-1], *each[half:], wholes[-1]]
        compiled = {p.mark: step(p.compiled) for p in queue}
        ran, differences = _by_turns(step, wholes[0], lesser, runs)
    operations, times = zip(*(compiled[w.mark] for w in wholes))
    total = Cost(operations[0], Spread.of(ran), Spread(median(times), min(times), max(times)))
    return {e: _cost(e, p, *compiled[p.mark], differences[e], total, effects) for e, p in lesser.items()}, total


def _cost(
    effect: str, picture: Picture, operations: int, seconds: float, differences: list, total: Cost, effects: list[str]
) -> Cost:
    """What an effect adds, by the operations and the compile seconds of the picture without it."""
    c, on = total.compile_seconds, picture.prepared.features
    noise, more = c.high - c.low, c.middle - seconds
    along = tuple(e for e in effects if e != effect and not on[e])
    spread = Spread(more, more - noise, more + noise)
    return Cost(total.operations - operations, Spread.of(differences), spread, along)


def _by_turns(step: _Steps, whole: Picture, lesser: dict[str, Picture], runs: int) -> tuple[list, dict[str, list]]:
    """How long the whole picture runs, and how much longer than each lesser one that it is made before and after."""
    ran: list[float] = []
    differences: dict[str, list[float]] = {effect: [] for effect in lesser}
    for _ in range(runs):
        ran.append(step(whole.seconds))
        for effect, picture in lesser.items():
            less = step(picture.seconds)
            ran.append(step(whole.seconds))
            differences[effect].append((ran[-2] + ran[-1]) / 2 - less)
    return ran, differences
