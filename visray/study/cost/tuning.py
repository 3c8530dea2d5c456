"""Choice of the knobs of a scene for an error or for a time.

A study measures the curves of all knobs on reduced pictures. The sampler and the numbers of light samples and rays are
those of the best measured curve, if it is better beyond the noise. The path depth is the least that leaves out far less
than the error, measured at the scene's own size. Accelerator, root tolerance and texture filter stay; precision becomes
double only where single cannot reach the error.

Samples per pixel come from renders at the scene's own size. Each try renders pairs of pictures with new seeds, whose
differences give the noise without bias, and then follows the slope of the curve to the target. The samples of a try do
not depend on its own pictures, so each try is an independent verification.
"""

from dataclasses import dataclass, field, replace
from math import ceil, sqrt
from pathlib import Path
from statistics import median
from typing import NoReturn

import numpy as np

from visray import clock
from visray.adaptive.depth_bias import depth_biases
from visray.adaptive.dual_buffer import DualBuffer, Estimate
from visray.adaptive.error_floor import DEEPEST, LARGER, check_precision
from visray.errors import UserError
from visray.geometry import UNIT_ROUNDOFF
from visray.passes import empty_film, expose, exposed_once
from visray.progress import Interrupts
from visray.render import adjusted, check_numbers, set_threads
from visray.scene.address import changed, value
from visray.scene.load import checked, load
from visray.scene.scene import Scene
from visray.setup import prepare
from visray.study.cost import study
from visray.study.cost.comparing import GAIN, price
from visray.study.cost.knobs import DEPTH, MOST_SAMPLES, PRECISION, SAMPLER, SPP, TOGETHER, is_samples
from visray.study.cost.measuring import SMALLEST, TURNS, band, reduced
from visray.study.cost.records import Band, Curve, Price, Report, Settings
from visray.study.cost.report import interval, percent, times
from visray.study.cost.tuned import LATE, Measured, Target, Tuned

# Tries of samples per pixel. An interval is widened by SURE, as a power of its factor, so that the upper ends of all
# tries hold together with 97.5 %; 4/3 is the quotient of the quantiles in the worst case, that of few noisy pixels.
TRIES, SURE = 3, 4 / 3
# A try with up to this share of samples too many is not improved.
WASTE = 0.15
# Samples per pixel go at most so far beyond the measured ones.
REACH = 64
# The squared bias of a depth or a precision is at most this share of the squared error.
BELOW = 1 / 16
# Renders are repeated, up to TURNS times, until they took so many seconds together.
ENOUGH = 1.0
# Samples per pixel that measure what a depth leaves out.
PILOT = 4
# Tries for a time aim at this share of it.
AIM = 0.97


def tune(
    scene: Scene | str | Path, *, setup: str | Path | None = None, error: float | None = None,
    time: float | None = None, quick: bool = True, progress: bool = True, threads: int | None = None,
) -> Tuned:  # fmt: skip
    """Chooses the settings of a scene, or a scene file, that reach an error in the least time, or the least error in a
    time.

    error: root mean square over pixels and channels in linear light, over the mean luminance; the upper end of the
        interval of 95 % of the chosen settings is below it
    time: seconds of one render at the scene's own size, with its kernels compiled
    quick: whether the study is the quick one
    """
    target = Target.of(error, time)
    if error is not None:
        check_precision(error, "double")
    scene = checked(load(scene, setup) if isinstance(scene, (str, Path)) else scene)
    if threads is not None:
        set_threads(threads)
    with Interrupts() as interrupts:
        report = study.studied(scene, quick, study.LEAST_SEEDS, progress, interrupts, for_tuning=True)
        if report.stopped:
            raise KeyboardInterrupt
        return _Tuner(scene, report, target, interrupts, progress).run()


@dataclass
class _Tuner:
    """The search for the settings.

    tried: the renders so far, the scene as it is first
    why: reasons for the knobs that are turned
    cut: squared relative bias of each depth
    """

    scene: Scene
    report: Report
    target: Target
    interrupts: Interrupts
    progress: bool = False
    tried: list[Measured] = field(default_factory=list)
    why: list[str] = field(default_factory=list)
    cut: dict[int, Band] = field(default_factory=dict)

    def run(self) -> Tuned:
        """The result; Ctrl-C keeps the best try, if there is one."""
        self.cut = self._depths()
        before = self._try(self.own)
        # The pictures of this size may show noise that those of the study did not.
        quiet = self.report.noiseless and before.noise <= UNIT_ROUNDOFF["single"] ** 2
        try:
            if quiet and self.own[SPP] > 1:
                self._try(self.own | {SPP: 1})
            elif not quiet:
                self._search_error() if self.target.error is not None else self._search_time()
        except KeyboardInterrupt:
            if not self.interrupts.requested:
                raise
        return self._result(self._best(quiet), quiet)

    @property
    def own(self) -> Settings:
        """The scene's own settings."""
        return self.report.default.settings

    def _search_error(self) -> None:
        """Tries for an error."""
        error, own = self.target.error, self.tried[0]
        fixed = self._discrete(error)
        allowed = error**2 - self.left(fixed).high
        if allowed <= 0:
            self._refuse(fixed)
        share = sqrt(allowed / own.noise_high) if own.noise_high > 0 else 1.0
        curve, best = self._curve(share)
        settings, k = self._turned(curve) | fixed, _power(curve)
        n = best.value if best.value is not None else curve.points[-1].settings[SPP] * (best.least / share) ** (1 / k)
        for i in range(TRIES):
            n = self._count(settings, n)
            if any(m.settings == settings | {SPP: n} for m in self.tried[1:]):
                return
            render = self._try(settings | {SPP: n})
            needed = n * (render.noise_high / allowed) ** (1 / (2 * k))
            if needed <= n and (n == 1 or needed >= (1 - WASTE) * n):
                return
            # Slope and noise are known badly; the later the try, the less it may miss.
            n = needed * (1.03 if needed <= n else 1.1 + 0.1 * i)

    def _search_time(self) -> None:
        """Tries for a time."""
        time, own, default = self.target.time, self.tried[0], self.report.default
        more = time / own.seconds.middle
        share = more ** -_power(self._own_curve())
        curve, _ = self._curve(share)
        settings = self._turned(curve) | self._discrete(sqrt(own.noise) * share)
        # Samples of the curve take so many times the seconds of the scene's.
        last = curve.points[-1]
        slow = last.seconds.middle / default.seconds.middle * self.own[SPP] / last.settings[SPP]
        n = self.own[SPP] * more / slow
        for _ in range(TRIES):
            n = self._count(settings, n, up=False)
            if any(m.settings == settings | {SPP: n} for m in self.tried):
                return
            render = self._try(settings | {SPP: n})
            took = render.seconds.middle
            if (1 - WASTE) * time <= took <= time or (n == 1 and took <= LATE * time and n * time / took < 2):
                return
            if n == 1 and took > LATE * time:
                raise UserError(f"time = {time:g}: one sample per pixel takes {took:.2g} s; give more time")
            n = n * AIM * time / took

    def _count(self, settings: Settings, n: float, up: bool = True) -> int:
        """A number of samples that the sampler takes; raises a UserError where it is too far from what was measured."""
        most = min(MOST_SAMPLES, REACH * max(p.settings[SPP] for p in self.report.records))
        if n > most and self.target.error is not None:
            self._refuse(settings, n)
        n = max(min(n, most), 1)
        if settings[SAMPLER] == "stratified":
            return (ceil(sqrt(n) - 1e-9) if up else int(sqrt(n) + 1e-9)) ** 2
        return ceil(n - 1e-9) if up else int(n + 1e-9)

    def _refuse(self, settings: Settings, n: float | None = None) -> NoReturn:
        """Raises a UserError: the error is out of reach."""
        text = f"error = {self.target.error:g}: "
        if n is not None:
            raise UserError(f"{text}it would take about {n:.2g} samples per pixel; {LARGER}")
        left, depth = self.left(settings), self._at(settings, DEPTH)
        deep = self.cut[depth].high > left.high / 2
        whose = f"settings.depth = {depth} leaves out" if deep else "rounding and roots leave"
        raise UserError(f"{text}{whose} {remains(left)}, whatever the samples; {LARGER}")

    # The choice of all knobs but samples per pixel

    def _own_curve(self) -> Curve:
        return next(c for c in self.report.curves if c.knob == f"samples, {self.own[SAMPLER]}")

    def _noise(self, curve: Curve) -> Curve:
        """The curve with its noise as its error: bias is treated apart."""
        points = tuple(replace(p, error=replace(p.error, rmse=p.error.deviation)) for p in curve.points)
        return replace(curve, points=points)

    def _curve(self, share: float) -> tuple[Curve, Price]:
        """The best curve of samples per pixel at a share of the scene's noise, and that price. Another curve than the
        scene's is taken only where it is better beyond the noise."""
        (default,) = self._noise(Curve("", "", (self.report.default,))).points
        curves = [self._noise(c) for c in self.report.curves if is_samples(c.knob)]
        if self.report.joint:
            curves.append(self._noise(study.sloped(TOGETHER, "sampling", self.report.joint)))
        own = self._noise(self._own_curve())

        def least(c: Curve) -> float:
            return min(p.error.rmse.middle for p in c.points) / default.error.rmse.middle

        chosen, ratio, band_ = own, 1.0, None
        for c in curves:
            # Where one of them was not measured that far, they are compared as far as both were.
            common = max(share, 1.001 * max(least(c), least(own)))
            one, other = price(c, default, common).factor, price(own, default, common).factor
            if one.high < other.middle and one.middle / other.middle < min(ratio, GAIN):
                chosen, ratio = c, one.middle / other.middle
                band_ = Band(*(x / other.middle for x in (one.middle, one.low, one.high)))
        if band_ is not None:
            turned = [(a, self.own[a], v) for a, v in self._turned(chosen).items() if v != self.own[a] and a != DEPTH]
            names = ", ".join(f"{a.removeprefix('settings.')} {old} -> {new}" for a, old, new in turned)
            self.why.append(f"{names}: the same noise in {times(band_)}, as the study measured")
        return chosen, price(chosen, default, share)

    def _turned(self, curve: Curve) -> Settings:
        """All settings of a curve; samples per pixel and depth are the scene's."""
        keep = {a: self.own[a] for a in (SPP, DEPTH, PRECISION) if a in self.own}
        return self.own | curve.points[0].settings | keep

    def _discrete(self, error: float) -> Settings:
        """Depth and precision for an error: the least depth whose bias is far below it, or the best one."""
        settings: Settings = {}
        limit = BELOW * error**2
        if self._single > limit and self.own[PRECISION] == "single" and self.target.error is not None:
            settings[PRECISION] = "double"
            self.why.append(f"precision single -> double: single is off by {percent(sqrt(self._single), 2)}")
        if DEPTH in self.own:
            depth, own = self._depth(limit), self.own[DEPTH]
            settings[DEPTH] = depth
            if depth != own:
                self.why.append(f"depth {own} -> {depth}: it leaves out {remains(self.cut[depth])}")
        return settings

    def _depth(self, limit: float) -> int:
        """The least depth that leaves out less than the limit and is measured to be faster than the scene's; a larger
        one where the scene's leaves out more."""
        own = self.own[DEPTH]
        points = {p.value: p for c in self.report.curves if c.knob == "depth" for p in c.points}
        for depth in sorted(self.cut):
            faster = depth in points and points[depth].seconds.high < self.report.default.seconds.low
            if self.cut[depth].high <= limit and (depth >= own or faster):
                return depth
        return max(self.cut) if self.target.error is not None else own

    # What is off whatever the samples

    def left(self, settings: Settings) -> Band:
        """Squared relative bias of settings: of their depth, their precision, and the root tolerance."""
        cut = self.cut[self._at(settings, DEPTH)]
        rest = self._rest + self._single * (self._at(settings, PRECISION) == "single")
        return Band(*(rest + x for x in (cut.middle, cut.low, cut.high)))

    def _at(self, settings: Settings, address: str) -> object:
        """The value at an address, also where the settings leave it out."""
        return settings.get(address, self.own.get(address, value(self.scene, address)))

    def _depths(self) -> dict[int, Band]:
        """Squared relative bias of each depth of the study, at the scene's own size."""
        depths = tuple(p.value for c in self.report.curves if c.knob == "depth" for p in c.points)
        if not depths:
            return {self.scene.settings.depth: Band(0.0, 0.0, 0.0)}
        halves = DualBuffer(prepare(adjusted(self.scene, sampler="sobol")))
        halves.extend(np.full_like(halves.counts, PILOT))
        scale = (halves.estimate().luminance or 1.0) ** 2
        left = depth_biases(halves, depths, min(4 * max(depths) + 4, DEEPEST))
        return {t.depth: Band(*(max(x, 0.0) / scale for x in (t.square, t.low, t.high))) for t in left}

    @property
    def _single(self) -> float:
        """Squared error of single precision, where it can be told from noise."""
        return self.report.floors.get("single precision", 0.0) ** 2

    @property
    def _rest(self) -> float:
        """Squared bias of the scene as it is that is neither its depth's nor its precision's."""
        bias, depth = self.report.default.error.bias, f"depth {self.scene.settings.depth}"
        known = self.report.floors.get(depth, 0.0) ** 2 + self._single
        return max(bias.middle**2 - known, 0.0) if bias.low > 0 else 0.0

    # Renders at the scene's own size

    def _try(self, settings: Settings) -> Measured:
        """Renders pictures of new seeds, two or more, and keeps what they tell; Ctrl-C ends them."""
        chosen = changed(self.scene, self._changes(settings))
        _compile(chosen)
        prepared, first = prepare(chosen), chosen.settings.seed + len(self.tried) * TURNS
        pictures, seconds = [], []
        while len(seconds) < 2 or (len(seconds) < TURNS and sum(seconds) < ENOUGH):
            seeded = replace(prepared, scene=adjusted(chosen, seed=(first + len(seconds)) % 2**32))
            begun = clock.now()
            film, _ = expose(seeded, self.progress, self.interrupts)
            seconds.append(clock.now() - begun)
            if self.interrupts.requested:
                raise KeyboardInterrupt
            pictures.append(np.array(film.mean))
            check_numbers(prepared, pictures[-1])
        # Pixels of several pairs side by side: each difference is an independent estimate.
        last = len(pictures) // 2 * 2
        pair = Estimate.of(*(np.concatenate(pictures[i:last:2], 1) for i in (0, 1)))
        # The variance of the mean of both is half of that of one.
        noise, factor = 2 * pair.error**2, pair.factor**SURE
        left = self.left(settings)
        error = Band(
            *(sqrt(n + x) for n, x in zip((noise, noise / factor, noise * factor), (left.middle, left.low, left.high)))
        )
        self.tried.append(Measured(settings, band(seconds), error, noise, noise * factor))
        return self.tried[-1]

    def _changes(self, settings: Settings) -> Settings:
        return {a: v for a, v in settings.items() if v != self.own[a]}

    # The result

    def _best(self, quiet: bool) -> Measured:
        """The best try that meets the target; the scene as it is where none is clearly better; where none meets it, the
        nearest. Without noise it is one sample, whatever the clock says."""
        own = self.tried[0]
        met = [m for m in self.tried if self.target.met(m)]
        if quiet:
            met = [m for m in met if m.settings[SPP] == 1] or met
        if not met:
            return min(self.tried, key=self.target.missed)
        best = min(met, key=self._price)
        return own if own in met and self._price(best) > GAIN * self._price(own) else best

    def _price(self, render: Measured) -> float:
        """Seconds where an error is asked for, else the error, with all the bias that there may be. Seconds go by those
        of a sample, from all tries that differ in samples alone, so that more samples never look faster."""
        if self.target.error is not None:
            alike = [m for m in self.tried if m.settings | {SPP: 0} == render.settings | {SPP: 0}]
            return median(m.seconds.middle / m.settings[SPP] for m in alike) * render.settings[SPP]
        return sqrt(render.noise + self.left(render.settings).high)

    def _result(self, best: Measured, quiet: bool) -> Tuned:
        changes, met, stopped = self._changes(best.settings), self.target.met(best), self.interrupts.requested
        reasons = list(self.why) if set(changes) - {SPP} else []
        if SPP in changes:
            tries, old = len(self.tried) - 1, self.own[SPP]
            how = (
                "the picture has no noise" if quiet else f"from {tries} {'tries' if tries > 1 else 'try'} at full size"
            )
            reasons.append(f"samples per pixel {old} -> {changes[SPP]}: {how}")
        elif quiet:
            reasons.append("the picture has no noise: one sample per pixel is enough")
        elif not changes:
            reasons.append("the scene's own settings: nothing that was measured is clearly better")
        if met:
            what = (
                f"the error is {interval(best.error, percent)}"
                if self.target.error is not None
                else f"{best.seconds.middle:.3g} s"
            )
            reasons.append(f"verified at full size with new seeds: {what}")
        else:
            reasons.append("no settings were found that do it: these come nearest")
        if stopped:
            reasons.append("stopped before its end: of the tries until then these are the best")
        return Tuned(
            self.target, best.settings, changes, best.error, best.seconds, self.tried[0], met, stopped, tuple(reasons),
            changed(self.scene, changes), self.report,
        )  # fmt: skip


def remains(left: Band) -> str:
    """What is left out, from its square: the estimate, and its upper end where that differs."""
    middle, high = (percent(sqrt(x), 2) for x in (left.middle, left.high))
    return middle if middle == high else f"{middle} (at most {high})"


def _power(curve: Curve) -> float:
    """The k of noise ~ samples^-k of a curve, between that of independent samples and 1."""
    return float(np.clip(curve.by_count.k, 0.5, 1.0)) if curve.by_count else 0.5


def _compile(scene: Scene) -> None:
    """Compiles the kernels of a render with a small picture: first and further passes."""
    prepared = prepare(reduced(scene, SMALLEST))
    film = empty_film(prepared)
    for count in (1, 2):
        film = exposed_once(prepared, film, count)
