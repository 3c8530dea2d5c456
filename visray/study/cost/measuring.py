"""Measurement of choices: pictures of many seeds, and the time of their kernels.

A pass makes the pictures of several seeds side by side, so tracing in Python is paid once. The seconds of a picture are
the time of the kernels, as Dr.Jit reports it, over the number of pictures. They leave out tracing in Python, whose time
does not depend on the size of a picture, and differ less from run to run than other times.

All choices are measured in turns: the speed of the machine in a turn is common to them all, and is removed. Ctrl-C
keeps the complete turns.
Seeds, samples and rays are data, so choices share kernels. Each kernel contains a number that no kernel had before
(timed_picture.new_mark), so it is compiled exactly once in a study, whatever Dr.Jit has in its cache.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from statistics import median

import drjit as dr
import numpy as np

from visray import clock, integrator
from visray.errors import UserError
from visray.film import Film
from visray.progress import Bar, Interrupts
from visray.sampling import SamplePlan
from visray.scene.adjusted import smaller
from visray.scene.scene import Scene
from visray.setup import Prepared, arrays, prepare
from visray.study.cost.choices import Choice
from visray.study.cost.records import Band
from visray.study.spread import sign_test_trims
from visray.study.timed_picture import marked_columns, new_mark, reduced_size

# Pixels of the longer side: quick, full; and the least.
LONGEST, SMALLEST = (96, 192), 32
# Of 9 timings, the second least and the second largest are an interval of 95 % of the median, by the sign test.
TURNS = 9
# Pictures shrink by this factor of their sides, and only where they would take BEYOND times the budget: noise of the
# clock then seldom gives two studies of a scene two sizes.
STEP, BEYOND = 3 / 4, 5 / 4
# Samples per pixel of the pass that compiles a kernel and predicts its seconds.
TRIAL = 4
# Shorter kernels are over before other work on the machine gets its share, and look faster than they are. They make
# the same pictures several times side by side, in at most so many lanes.
BRIEFEST, MOST_LANES = 0.02, 2**18
# The chance that a band of seconds misses the true median.
CHANCE = 0.05


@dataclass
class Measurement:
    """Measurements of a choice.

    choice, prepared: the choice, and the scene prepared with it
    compile_seconds, operations: those of its kernel
    expected: predicted kernel seconds of a picture
    times: measured kernel seconds of a picture, one a turn
    parts: pictures of the seeds of each turn, linear light, single precision
    """

    choice: Choice
    prepared: Prepared
    compile_seconds: float
    operations: int
    expected: float
    times: list[float] = field(default_factory=list)
    parts: list[np.ndarray] = field(default_factory=list)

    @property
    def pictures(self) -> np.ndarray:
        """Pictures of all seeds. Shape: (S, H, W, 3)."""
        return np.concatenate(self.parts)

    @property
    def seconds(self) -> Band:
        """Median of the times, with its interval."""
        return band(self.times)


def band(values: Sequence[float]) -> Band:
    """The median, with its interval by the sign test; from the least to the largest value where there are too few."""
    ordered, k = sorted(values), max(sign_test_trims(len(values), CHANCE), default=0)
    return Band(median(values), ordered[k], ordered[-1 - k])


def reduced(scene: Scene, longest: int) -> Scene:
    """The scene with a smaller film, the longer side at most so many pixels."""
    return smaller(scene, reduced_size(*scene.film.size, longest))


def blank(prepared: Prepared, pictures: int) -> Film:
    """An unexposed film for several pictures side by side."""
    return Film.empty(prepared.a, np.tile(prepared.order, pictures))


def exposed(
    prepared: Prepared, film: Film, seeds: Sequence[int], done: int, count: int, mark: int
) -> tuple[Film, list[dict]]:
    """The film of several pictures, one for each seed, after one more pass of `count` samples, and Dr.Jit's records of
    the kernels."""
    a, n, spp = prepared.a, len(prepared.order), prepared.scene.settings.spp
    x, y = (a.put(a.U, np.tile(np.array(v), len(seeds))) for v in (prepared.x, prepared.y))
    numbers = a.put(a.U, np.repeat(np.array(seeds, np.uint32), n))
    dr.eval(x, y, numbers)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        x = marked_columns(a, x, mark)
        plan = replace(SamplePlan.of(a, 0, spp, done, count), seed=numbers)
        film = film.with_moments(integrator.sample(prepared.kernel, plan, x, y, film.moments), done + count)
        dr.eval(film.moments)
        dr.sync_thread()
        return film, dr.kernel_history([dr.KernelType.JIT])


def developed(prepared: Prepared, film: Film, pictures: int, kind: type = np.float32) -> np.ndarray:
    """The first pictures of a film, top row first. Shape: (pictures, H, W, 3)."""
    n = len(prepared.order)
    flat = np.array(film.mean)[:, : pictures * n].reshape(3, pictures, n)
    pixels = np.empty((pictures, n, 3), kind)
    pixels[:, prepared.order] = flat.transpose(1, 2, 0)
    if not np.isfinite(pixels).all():
        raise UserError("a pixel is not a number: render the picture, which says where")
    return pixels.reshape(pictures, *prepared.scene.film.raster[::-1], 3)


@dataclass(frozen=True)
class Turn:
    """Pictures of all choices, one after the other.

    number: number of the turn
    order: numbers of the choices
    seeds: seeds of the pictures
    """

    number: int
    order: tuple[int, ...]
    seeds: tuple[int, ...]


# Measures all turns: (studio, choices, turns, progress bar) to what Studio.measured_here yields, in any order.
Elsewhere = Callable[["Studio", list[Measurement], Sequence[Turn], Bar], Iterable[tuple[int, list]]]


@dataclass
class Studio:
    """A scene whose choices are measured.

    scene, seeds: the scene, and the seeds of its pictures
    interrupts, progress: Ctrl-C, and whether progress is shown
    elsewhere: what measures the turns; None: this process does
    mark: the number that its kernels contain
    compiled: compile seconds of the kernels so far, by hash
    """

    scene: Scene
    seeds: Sequence[int]
    interrupts: Interrupts
    progress: bool = False
    elsewhere: Elsewhere | None = None
    mark: int = field(default_factory=new_mark)
    compiled: dict[str, float] = field(default_factory=dict)

    @property
    def per_turn(self) -> int:
        """Pictures of one turn. Where a turn has one seed fewer, one of its seeds is repeated."""
        return -(-len(self.seeds) // TURNS)

    def prepared(self, choices: Sequence[Choice]) -> list[Measurement]:
        """All choices, prepared and compiled; fewer after Ctrl-C."""
        ready: list[Measurement] = []
        with Bar("compiling", len(choices), self.progress) as bar:
            if not self.compiled:
                self._start_llvm()
            for choice in choices:
                if self.interrupts.requested:
                    break
                ready.append(self._prepared(choice))
                bar.update(len(ready))
        return ready

    def _prepared(self, choice: Choice) -> Measurement:
        """A choice, prepared and compiled, with its predicted seconds."""
        prepared = prepare(choice.of(self.scene))
        spp, n = prepared.scene.settings.spp, self.per_turn
        count = min(TRIAL, spp)
        _, kernels = exposed(prepared, blank(prepared, n), self.seeds[:n], 0, count, self.mark)
        k = max(kernels, key=lambda k: k["operation_count"])
        # A kernel that exists already was compiled for an earlier choice.
        seconds = self.compiled.setdefault(k["hash"], (k["codegen_time"] + k["backend_time"]) / 1e3)
        return Measurement(
            choice, prepared, seconds, k["operation_count"], clock.kernel_seconds(kernels) / n * spp / count
        )

    def _start_llvm(self) -> None:
        """Compiles something small, so that the time to start LLVM counts for no kernel."""
        a = arrays("llvm", "single")
        dr.eval(dr.opaque(a.U, 1, 16) + a.U(self.mark))

    def fitting(self, choices: list[Measurement], budget: float) -> tuple["Studio", list[Measurement]]:
        """This studio and its choices; with smaller pictures where they would take far more than `budget` seconds."""
        needed = sum(t.expected for t in choices) * self.per_turn * TURNS
        film, steps = self.scene.film, 0
        while needed * STEP ** (2 * steps) > BEYOND * budget:
            steps += 1
        longest = max(film.size)
        smaller = max(SMALLEST, round(longest * STEP**steps))
        if smaller >= longest:
            return self, choices
        studio = replace(self, scene=reduced(self.scene, smaller))
        return studio, [studio.again(t) for t in choices]

    def again(self, choice: Measurement) -> Measurement:
        """A compiled choice, for pictures of this studio's size."""
        prepared = prepare(choice.choice.of(self.scene))
        share = len(prepared.order) / len(choice.prepared.order)
        return replace(choice, prepared=prepared, expected=choice.expected * share)

    def measure(self, choices: list[Measurement]) -> int:
        """Measures all choices in turns. Returns the seeds of each: after Ctrl-C those of the complete turns."""
        turns = []
        for number, seeds in enumerate(np.array_split(self.seeds, TURNS)):
            # Each turn has its own order, so that no choice always follows the same one.
            order = np.random.default_rng(number).permutation(len(choices))
            turns.append(Turn(number, tuple(order.tolist()), tuple(seeds.tolist())))
        with Bar("measuring", TURNS * len(choices), self.progress) as bar:
            done = dict((self.elsewhere or Studio.measured_here)(self, choices, turns, bar))
        complete = [turn for turn in turns if turn.number in done]
        for turn in complete:
            for choice, (seconds, pictures) in zip(choices, done[turn.number]):
                choice.times.append(seconds)
                choice.parts.append(pictures)
        _even(choices)
        return sum(len(turn.seeds) for turn in complete)

    def measured_here(self, choices: list[Measurement], turns: Sequence[Turn], bar: Bar) -> Iterator[tuple[int, list]]:
        """Yields the number of each turn, and what `once` says of each choice, until Ctrl-C."""
        done = 0
        for turn in turns:
            found = {}
            for i in turn.order:
                if self.interrupts.requested:
                    return
                found[i] = self.once(choices[i], turn.seeds)
                done += 1
                bar.update(done)
            yield turn.number, [found[i] for i in range(len(choices))]

    def once(self, choice: Measurement, seeds: Sequence[int]) -> tuple[float, np.ndarray]:
        """Kernel seconds of one picture, and the pictures of these seeds."""
        prepared, n = choice.prepared, self.per_turn
        copies = max(1, min(round(BRIEFEST / (n * choice.expected)), MOST_LANES // (n * len(prepared.order))))
        many = np.resize(seeds, n * copies)
        film, kernels = exposed(prepared, blank(prepared, len(many)), many, 0, prepared.scene.settings.spp, self.mark)
        return clock.kernel_seconds(kernels) / len(many), developed(prepared, film, len(seeds))


def _even(choices: list[Measurement]) -> None:
    """Divides the seconds of each turn by the pace of the machine in that turn. The pace is the median over all choices
    of: seconds in the turn, over the median of the choice's seconds."""
    if not choices or not choices[0].times:
        return
    logs = np.log([c.times for c in choices])
    pace = np.median(logs - np.median(logs, 1, keepdims=True), 0)
    for choice, row in zip(choices, logs):
        choice.times = np.exp(row - pace).tolist()
