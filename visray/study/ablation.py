"""The cost of each effect of a scene.

The picture with all effects (the full picture) is compared with the picture without the effect.

If an effect is left out, the effects that only refine it (`Rule.needs`) are left out too. Area lights are replaced by
point lights in their middles, which are not seen, so the cost of area lights contains that of visible ones. The
pictures are small (LONGEST_SIDE, RENDER_SECONDS), and each is rendered by one kernel in one pass. Three numbers of each
kernel are measured:

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

from collections.abc import Callable
from functools import partial
from statistics import median
from typing import Any

from visray.errors import UserError
from visray.explaining import explain
from visray.progress import Bar, Interrupts
from visray.scene.adjusted import adjusted, smaller
from visray.scene.scene import Scene
from visray.setup import prepare
from visray.study.alternation import Alternation
from visray.study.effect_costs import Cost, Report
from visray.study.leaving_out import prepared_without
from visray.study.spread import FEWEST_RUNS, Spread
from visray.study.timed_picture import UncachedPicture, reduced_size

# Samples per pixel: as many as take RENDER_SECONDS, but at most MOST_SAMPLES.
MOST_SAMPLES, RENDER_SECONDS = 16, 0.1
RUNS, FULL_COMPILATIONS = 8, 3


def cost(scene: Scene, spp: int | None = None, runs: int = RUNS, progress: bool = False) -> Report:
    """Measures the cost of each effect that the scene has, and of the full picture.

    Ctrl-C raises KeyboardInterrupt as soon as the current step has ended.

    spp: samples per pixel; None: as many as take RENDER_SECONDS, and at most MOST_SAMPLES
    runs: how often each picture is rendered, at least FEWEST_RUNS
    progress: whether a progress bar is shown
    """
    if not isinstance(runs, int) or runs < FEWEST_RUNS:
        raise UserError(f"runs = {runs}: must be a whole number, at least {FEWEST_RUNS}, for the spread of a median")
    small = adjusted(smaller(scene, reduced_size(*scene.film.size)), spp=spp)
    explanation = explain(small)
    with Interrupts() as interrupts:
        fitting = fitting_samples(small)
        small = adjusted(small, spp=spp or fitting)
        costs, total = _measured(small, explanation.names(), runs, progress, interrupts)
    film = small.film
    return Report(scene.hash(), *film.raster, small.settings.spp, runs, explanation.listed, costs, total)


def fitting_samples(scene: Scene) -> int:
    """Number of samples per pixel that take about RENDER_SECONDS, and at most MOST_SAMPLES.

    This must be called before other times are measured: the first kernel that is compiled also starts LLVM, which takes
    time.
    """
    picture = UncachedPicture.of(prepare(adjusted(scene, spp=1)))
    picture.compiled()
    return min(MOST_SAMPLES, max(1, int(RENDER_SECONDS / picture.seconds())))


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
    with Bar("measuring", (n + 1) + (n + FULL_COMPILATIONS) + 2 * n * runs + 1, progress) as bar:
        step = _Steps(interrupts, bar)
        everything = step(partial(prepare, scene))
        pictures_without = {e: UncachedPicture.of(step(partial(prepared_without, scene, e))) for e in effects}
        full = [UncachedPicture.of(everything) for _ in range(FULL_COMPILATIONS)]
        others = list(pictures_without.values())
        queue = [full[0], *others[:half], *full[1:-1], *others[half:], full[-1]]
        compiled = {p.mark: step(p.compiled) for p in queue}
        turns = Alternation(full[0], pictures_without)
        rendered = turns.runs(runs)
        for _ in range(turns.pictures(runs)):
            step(partial(next, rendered))
    operations, times = zip(*(compiled[p.mark] for p in full))
    total = Cost(operations[0], Spread.of(turns.full_seconds), Spread(median(times), min(times), max(times)))
    return {
        e: _cost(e, p, *compiled[p.mark], turns.differences[e], total, effects) for e, p in pictures_without.items()
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
