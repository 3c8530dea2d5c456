"""Pictures of many seeds, for each choice of the knobs, and how long their kernels run.

A pass makes the pictures of several seeds side by side, so that tracing it in Python is paid for once. The seconds of a
picture are those that the pass's kernels run, as Dr.Jit times them, over how many pictures it makes: without tracing,
which each pass of a render does once, whatever its size. They are what repeats best.

All choices are measured by turns: noise of the machine hits all of them alike, and Ctrl-C keeps the turns that are
complete. Seeds, samples and rays are data, so that choices share kernels. Each kernel holds a number that none has held
before (ablation.new_mark): so it is compiled in this study, once, whatever Dr.Jit has kept.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from statistics import median

import drjit as dr
import numpy as np

from visray import clock, integrator
from visray.errors import UserError
from visray.film import Film
from visray.progress import Bar, Interrupts
from visray.render import adjusted
from visray.sampling import SamplePlan
from visray.scene.scene import Scene
from visray.setup import Prepared, arrays, prepare
from visray.study import ablation
from visray.study.cost.knobs import Choice
from visray.study.cost.records import Band

# Pixels of the longer side, quick and full, and of the smallest picture that is still one.
LONGEST, SMALLEST = (96, 192), 32
# Of 9 timings, the second and the last but one are as far apart as the sign test asks: one may be an accident.
TURNS = 9
# Pictures shrink by this factor of their sides, and only where they would take so many times what they may: so noise of
# the clock seldom gives two studies of one scene pictures of two sizes.
STEP, BEYOND = 3 / 4, 5 / 4
# Samples per pixel of the pass that a kernel is compiled with: so few say how long many will take.
TRIAL = 4
# Kernels that run shorter than this are over before other work on the machine gets its share, and look faster than they
# are: so the same pictures are made several times side by side, in up to so many lanes.
BRIEFEST, MOST_LANES = 0.02, 2**18
# The chance that a band of seconds misses the true median is at most this.
CHANCE = 0.05


@dataclass
class Taken:
    """What is measured of a choice: kernel seconds of a picture, an entry a turn, and the pictures of all seeds, linear
    light. Shapes: times (R), pictures (S, H, W, 3), single precision."""

    choice: Choice
    prepared: Prepared
    compile_seconds: float
    operations: int
    expected: float
    times: list[float] = field(default_factory=list)
    parts: list[np.ndarray] = field(default_factory=list)

    @property
    def pictures(self) -> np.ndarray:
        return np.concatenate(self.parts)

    @property
    def seconds(self) -> Band:
        return band(self.times)


def band(values: Sequence[float]) -> Band:
    """The median, and two of the values between which the true one lies, by the sign test; the first and the last
    where they are too few for that."""
    ordered, k = sorted(values), max(ablation.sign_test_trims(len(values), CHANCE), default=0)
    return Band(median(values), ordered[k], ordered[-1 - k])


def reduced(scene: Scene, longest: int) -> Scene:
    """The scene with the longer side of its film at most so many pixels."""
    return adjusted(scene, size=ablation.reduced_size(scene.film.width, scene.film.height, longest))


def blank(prepared: Prepared, pictures: int) -> Film:
    """An unexposed film for several pictures side by side."""
    return Film.empty(prepared.a, np.tile(prepared.order, pictures))


def exposed(
    prepared: Prepared, film: Film, seeds: Sequence[int], done: int, count: int, mark: int
) -> tuple[Film, list[dict]]:
    """The film of several pictures, a seed each, after one more pass of `count` samples; and what Dr.Jit says of the
    kernels."""
    a, n, spp = prepared.a, len(prepared.order), prepared.scene.settings.spp
    x, y = (a.put(a.U, np.tile(np.array(v), len(seeds))) for v in (prepared.x, prepared.y))
    numbers = a.put(a.U, np.repeat(np.array(seeds, np.uint32), n))
    dr.eval(x, y, numbers)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        x = ablation.marked_columns(a, x, mark)
        plan = replace(SamplePlan.of(a, 0, spp, done, count), seed=numbers)
        film = film.with_moments(integrator.sample(prepared.kernel, plan, x, y, film.moments), done + count)
        dr.eval(film.moments)
        dr.sync_thread()
        return film, dr.kernel_history([dr.KernelType.JIT])


def developed(prepared: Prepared, film: Film, pictures: int, kind: type = np.float32) -> np.ndarray:
    """The first pictures of a film, first row on top. Shape: (pictures, H, W, 3)."""
    n = len(prepared.order)
    flat = np.array(film.mean)[:, : pictures * n].reshape(3, pictures, n)
    shown = np.empty((pictures, n, 3), kind)
    shown[:, prepared.order] = flat.transpose(1, 2, 0)
    if not np.isfinite(shown).all():
        raise UserError("a pixel is not a number: render the picture, which says where")
    return shown.reshape(pictures, prepared.scene.film.height, prepared.scene.film.width, 3)


@dataclass
class Studio:
    """Where choices are measured: a scene, its seeds, and the kernels that are compiled so far, by their hash."""

    scene: Scene
    seeds: Sequence[int]
    interrupts: Interrupts
    progress: bool = False
    mark: int = field(default_factory=ablation.new_mark)
    compiled: dict[str, float] = field(default_factory=dict)

    @property
    def per_turn(self) -> int:
        """How many pictures are made in one turn: of as many seeds, or one fewer and one of them again."""
        return -(-len(self.seeds) // TURNS)

    def prepared(self, choices: Sequence[Choice]) -> list[Taken]:
        """All choices, set up and compiled; after Ctrl-C fewer."""
        found: list[Taken] = []
        with Bar("compiling", len(choices), self.progress) as bar:
            if not self.compiled:
                self._awake()
            for choice in choices:
                if self.interrupts.requested:
                    break
                found.append(self._prepared(choice))
                bar.update(len(found))
        return found

    def _prepared(self, choice: Choice) -> Taken:
        prepared = prepare(choice.of(self.scene))
        spp, n = prepared.scene.settings.spp, self.per_turn
        count = min(TRIAL, spp)
        _, kernels = exposed(prepared, blank(prepared, n), self.seeds[:n], 0, count, self.mark)
        k = max(kernels, key=lambda k: k["operation_count"])
        # A kernel that is there already took as long as it did then.
        seconds = self.compiled.setdefault(k["hash"], (k["codegen_time"] + k["backend_time"]) / 1e3)
        return Taken(choice, prepared, seconds, k["operation_count"], clock.kernel_seconds(kernels) / n * spp / count)

    def _awake(self) -> None:
        """Compiles something small: what LLVM takes to start is no kernel's."""
        a = arrays("llvm", "single")
        dr.eval(dr.opaque(a.U, 1, 16) + a.U(self.mark))

    def fitting(self, taken: list[Taken], budget: float) -> tuple["Studio", list[Taken]]:
        """This one, or where its pictures would take far longer than `budget` seconds, one with smaller ones; and the
        choices for it."""
        needed = sum(t.expected for t in taken) * self.per_turn * TURNS
        film, steps = self.scene.film, 0
        while needed * STEP ** (2 * steps) > BEYOND * budget:
            steps += 1
        longest = max(film.width, film.height)
        smaller = max(SMALLEST, round(longest * STEP**steps))
        if smaller >= longest:
            return self, taken
        studio = replace(self, scene=reduced(self.scene, smaller))
        return studio, [studio.again(t) for t in taken]

    def again(self, taken: Taken) -> Taken:
        """A choice that is compiled, for pictures of this studio's size."""
        prepared = prepare(taken.choice.of(self.scene))
        share = len(prepared.order) / len(taken.prepared.order)
        return replace(taken, prepared=prepared, expected=taken.expected * share)

    def measure(self, taken: list[Taken]) -> int:
        """Measures all by turns; how many seeds there are then of each: after Ctrl-C those of the complete turns."""
        finished, done = 0, 0
        with Bar("measuring", TURNS * len(taken), self.progress) as bar:
            for number, seeds in enumerate(np.array_split(self.seeds, TURNS)):
                # Each turn in an order of its own, so that none always comes after the same one.
                order, turn = np.random.default_rng(number).permutation(len(taken)), {}
                for i in order:
                    if self.interrupts.requested:
                        return finished
                    turn[i] = self._once(taken[i], seeds)
                    done += 1
                    bar.update(done)
                for i, (seconds, pictures) in turn.items():
                    taken[i].times.append(seconds)
                    taken[i].parts.append(pictures)
                finished += len(seeds)
        return finished

    def _once(self, taken: Taken, seeds: Sequence[int]) -> tuple[float, np.ndarray]:
        """Seconds of a picture, and the pictures."""
        prepared, n = taken.prepared, self.per_turn
        copies = max(1, min(round(BRIEFEST / (n * taken.expected)), MOST_LANES // (n * len(prepared.order))))
        many = np.resize(seeds, n * copies)
        film, kernels = exposed(prepared, blank(prepared, len(many)), many, 0, prepared.scene.settings.spp, self.mark)
        return clock.kernel_seconds(kernels) / len(many), developed(prepared, film, len(seeds))
