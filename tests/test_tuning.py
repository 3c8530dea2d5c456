"""Knobs for an error or for a time: the picture keeps to the error, samples follow what is measured at full size.

What must not depend on the machine is proved in a made-up world, where seconds and noise follow a formula.
"""

import json
import signal
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from virtual import Machine

from visray.adaptive.dual_buffer import ratio_quantile
from visray.camera import Camera
from visray.cli import studies
from visray.errors import UserError
from visray.lights import PointLight, RectangleLight
from visray.materials import Material
from visray.primitives import Plane, Sphere
from visray.progress import Interrupts
from visray.render import render
from visray.scene.address import changed
from visray.scene.load import dump, load
from visray.scene.scene import Film, Scene, Settings
from visray.study.cost import study, tuned, tuning
from visray.study.cost.records import Band, Curve, Record, Report
from visray.study.cost.slopes import slope
from visray.study.cost.truth import luminance
from visray.study.cost.tuned import LATE, Measured, Target, Tuned, as_scene
from visray.study.cost.tuning import SURE, TRIES, remains, tune

SOFT = Scene(
    camera=Camera(origin=(0, 2, 5), target=(0, 0.5, 0)),
    film=Film(width=48, height=36),
    lights={"window": RectangleLight(position=(2, 4, 2), width=(2, 0, 0), height=(0, 0, 2), samples=4)},
    objects={"floor": Plane(), "ball": Sphere(center=(0, 0.7, 0), radius=0.7)},
    settings=Settings(spp=16, seed=5),
)
# One colour all over: albedo of a plane that fills the picture.
FLAT = replace(
    SOFT,
    camera=Camera(origin=(0, 5, 0), target=(0, 0, 0), up=(0, 0, 1)),
    lights={},
    objects={"floor": Plane()},
    settings=Settings(spp=4, shading="albedo"),
)
HURRY = (6.0, 2.0, 2.0)
# Between two mirrors, of which each bounce takes half.
MIRRORS = replace(
    SOFT,
    camera=Camera(origin=(0, 1, 0.9), target=(0.3, 1, -1)),
    materials={"mirror": Material(ka=(0.1, 0.1, 0.1), kd=(0.2, 0.2, 0.2), kr=(0.5, 0.5, 0.5))},
    lights={"lamp": PointLight(position=(0, 3, 0))},
    objects={
        "front": Plane(point=(0, 0, -1), normal=(0, 0, 1), material="mirror"),
        "back": Plane(point=(0, 0, 1), normal=(0, 0, -1), material="mirror"),
        "ball": Sphere(center=(0.4, 1, -0.3), radius=0.3),
    },
    settings=Settings(spp=16, depth=8, seed=3),
)
ONCE = 0.02  # seconds of a render in the made-up world, whatever it does


@pytest.fixture(scope="module")
def report() -> Report:
    with pytest.MonkeyPatch.context() as patch:
        Machine(patch)
        patch.setattr(study, "BUDGETS", (HURRY, HURRY))
        return study.studied(SOFT, True, study.LEAST_SEEDS, False, Interrupts(), for_tuning=True)


@pytest.fixture(autouse=True)
def even(machine: Machine) -> None:
    """Seconds go by work alone."""


@pytest.fixture
def known(report: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    """The costs of SOFT are measured once."""
    monkeypatch.setattr(study, "studied", lambda *_, **__: report)


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    fine = changed(SOFT, {"settings.sampler": "sobol", "settings.precision": "double", "settings.seed": 999})
    return picture(fine, spp=4096)


def picture(scene: Scene, **more: int) -> np.ndarray:
    return render(scene, layers=("RGB",), progress=False, **more)["RGB"].astype(float)


def off(scene: Scene, truth: np.ndarray) -> float:
    """The relative root mean square error of four pictures with other seeds."""
    squares = [((picture(scene, seed=seed) - truth) ** 2).mean() for seed in (71, 72, 73, 74)]
    return sqrt(np.mean(squares)) / luminance(truth)


POWERS = {"stratified": 0.65, "sobol": 0.75, "independent": 0.5}


def law(settings: dict[str, Any]) -> tuple[float, float]:
    """Seconds and noise in the made-up world. Sobol points take 1.2 times the time."""
    spp, lights, sampler = (settings[a] for a in ("settings.spp", "lights.window.samples", "settings.sampler"))
    seconds = 1e-4 * spp * (1 + 0.3 * lights) * (1.2 if sampler == "sobol" else 1.0)
    seconds *= 1.3 if settings["settings.precision"] == "double" else 1.0
    return seconds, 0.1 * spp ** -POWERS[sampler] * sqrt(1 + 2 / lights)


@pytest.fixture(scope="module")
def smooth(report: Report) -> Report:
    """The report with the law instead of measurements: what is proved by it does not depend on the machine."""

    def lawful(p: Record) -> Record:
        settings = report.default.settings | p.settings
        seconds, noise = law(settings)
        band = Band(noise, 0.99 * noise, 1.01 * noise)
        error = replace(p.error, rmse=band, bias=Band(0.0, 0.0, 1e-4), deviation=band)
        squares = np.full(16, noise**2)
        return replace(p, settings=settings, seconds=Band(seconds, seconds, seconds), error=error, squares=squares)

    curves = []
    for c in report.curves:
        points = tuple(map(lawful, c.points))
        k = slope([p.value for p in points], [p.squares for p in points]) if c.kind == "sampling" else None
        curves.append(replace(c, points=points, by_count=k, by_time=k))
    return replace(report, default=lawful(report.default), curves=tuple(curves), joint=(), floors={})


def made_up(
    report: Report, monkeypatch: pytest.MonkeyPatch, wrong: Callable[[dict], float] = lambda s: 1.0
) -> Callable[..., Tuned]:
    """A world where the scene as it is takes about a second, and renders have `wrong` times the noise that the study
    found. Returns what tunes SOFT in it."""

    def rendered(self: Any, settings: dict) -> Measured:
        seconds, noise = law(settings)
        seconds, noise = ONCE + seconds / law(self.own)[0], (wrong(settings) * noise) ** 2
        left = self.left(settings)
        error = (sqrt(x + y) for x, y in zip([noise] * 3, (left.middle, left.low, left.high)))
        self.tried.append(Measured(settings, Band(seconds, seconds, seconds), Band(*error), noise, noise))
        return self.tried[-1]

    monkeypatch.setattr(tuning._Tuner, "_try", rendered)
    return lambda error=None, time=None: tuner(report, error, time).run()


def tuner(report: Report, error: float | None = None, time: float | None = None, scene: Scene = SOFT) -> tuning._Tuner:
    return tuning._Tuner(scene, report, Target(error, time), Interrupts())


@pytest.mark.parametrize(
    ("asked", "text"),
    [
        ({}, "nothing is asked for; give an error, such as 0.01, or a time in seconds, such as 10"),
        ({"error": 0.1, "time": 2}, "error = 0.1 and time = 2: only one can be asked for; leave the other out"),
        ({"error": -1}, "error = -1: must be a finite number above 0, such as 0.01"),
        ({"error": 0.0}, "error = 0.0: must be a finite number above 0, such as 0.01"),
        ({"error": float("nan")}, "error = nan: must be a finite number above 0, such as 0.01"),
        ({"error": True}, "error = True: must be a finite number above 0, such as 0.01"),
        ({"time": "2"}, "time = '2': must be a finite number above 0, such as 10"),
        ({"time": float("inf")}, "time = inf: must be a finite number above 0, such as 10"),
        ({"error": 1e-17}, "error = 1e-17: double precision is off by 4e-16; ask for a larger error"),
    ],
)
def test_what_cannot_be_asked_for(asked: dict[str, Any], text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before anything is measured."""
    monkeypatch.delattr(study, "studied")
    with pytest.raises(UserError) as error:
        tune(SOFT, progress=False, **asked)
    assert error.value.lines == (text,)


@pytest.mark.slow
@pytest.mark.parametrize("error", [0.02, 0.01])
def test_the_picture_keeps_to_the_error(known: None, truth: np.ndarray, error: float) -> None:
    found = tune(SOFT, error=error, progress=False)
    assert found.met and found.error.high <= error
    true = off(found.scene, truth)
    # Four pictures of 1728 pixels with an edge tell it to about a tenth.
    assert error / 2 < true < 1.1 * error
    assert found.error.low / 1.1 <= true <= 1.1 * found.error.high


@pytest.mark.slow
def test_before_is_the_scene_as_it_is(known: None, truth: np.ndarray) -> None:
    found = tune(SOFT, error=0.02, progress=False)
    assert found.before.error.middle == pytest.approx(off(SOFT, truth), rel=0.25)


@pytest.mark.slow
def test_only_knobs_are_changed_and_the_scene_loads_again(known: None, tmp_path: Path) -> None:
    found = tune(SOFT, error=0.004, progress=False)
    assert found.changed and set(found.changed) <= {"settings.spp", "settings.sampler", "lights.window.samples"}
    assert set(found.settings) == {
        *found.changed,
        "settings.spp",
        "settings.sampler",
        "lights.window.samples",
        "settings.precision",
    }
    path, own = tmp_path / "tuned.json", tmp_path / "own.json"
    # In the file's own order, with what it says of itself, and defaults that it spells out.
    said = {"$schema": "schema.json", "settings": {"depth": SOFT.settings.depth, "spp": 16, "seed": 5}}
    own.write_text(json.dumps(said | json.loads(dump(SOFT)) | said))
    assert load(own) == SOFT
    path.write_text(as_scene(found, tmp_path, own))
    told = json.loads(path.read_text())
    assert list(told) == list(json.loads(own.read_text())) and told["$schema"] == "schema.json"
    assert list(told["settings"])[:3] == ["depth", "spp", "seed"]
    again = load(path)
    assert again == found.scene == changed(SOFT, found.changed)
    assert changed(again, {a: found.before.settings[a] for a in found.changed}) == SOFT


@pytest.mark.slow
def test_it_can_be_told(known: None) -> None:
    found = tune(SOFT, error=0.004, progress=False)
    told = json.loads(json.dumps(found.as_json(), allow_nan=False))
    assert told["asked"] == {"error": 0.004} and told["met"] and told["changed"] == found.changed
    assert told["measured"]["error"]["middle"] == found.error.middle
    assert "->" in found.reasons[0] and found.reasons[-1].startswith(
        "verified at full size with new seeds: the error is "
    )
    console = Console(width=120, record=True, file=open("/dev/null", "w"))  # noqa: SIM115 - the console keeps it
    console.print(found.table())
    text = console.export_text()
    assert "as asked" in text and "settings.spp" in text and "%" in text
    assert repr(found) == str(found) and repr(found).startswith("<Tuned for error = 0.004: met, error 0.")
    assert repr(found).endswith("; " + ", ".join(f"{a} = {v}" for a, v in found.changed.items()) + ">")
    assert repr(replace(found, changed={}, met=False)).endswith("; nothing changed>")


@pytest.mark.slow
@pytest.mark.parametrize("stopped", [False, True])
def test_ctrl_c_while_a_scene_is_written_loses_nothing(
    known: None, stopped: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    own, out, whole = tmp_path / "own.json", tmp_path / "tuned.json", tuned.as_scene
    own.write_text(dump(SOFT))
    found, lost = replace(tune(SOFT, error=0.004, progress=False), stopped=stopped), []

    def slow(*given: Any) -> str:
        signal.raise_signal(signal.SIGINT)
        return whole(*given)

    monkeypatch.setattr(tuned, "as_scene", slow)
    monkeypatch.setattr(tuning, "tune", lambda *_, **__: found)
    # One that nobody takes would end the tests.
    before = signal.signal(signal.SIGINT, lambda *_: lost.append(1))
    try:
        code = studies.tune(own, error=0.004, output=out, json=True)
    finally:
        signal.signal(signal.SIGINT, before)
    assert code == (130 if stopped else 0) and not lost and load(out) == found.scene
    assert json.loads(capsys.readouterr().out) == found.as_json() | {"output": str(out)}
    kept = "Ctrl-C keeps the best that was tried at the scene's own size, if anything was."
    assert kept in " ".join(studies.tune.__doc__.split())
    studies.tune(own, error=0.004, json=True)
    assert "output" not in json.loads(capsys.readouterr().out)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("asked", "text"),
    [
        ({"error": 1e-9}, "error = 1e-09: "),
        ({"time": 1e-7}, "time = 1e-07: one sample per pixel takes"),
    ],
)
def test_what_is_out_of_reach(known: None, asked: dict[str, float], text: str) -> None:
    with pytest.raises(UserError, match=f"^{text}"):
        tune(SOFT, progress=False, **asked)


def test_all_tries_together_are_as_sure_as_they_say() -> None:
    """The interval of a try is widened so that the upper ends of all tries hold with 97.5 % together: for any number of
    noisy pixels, by the distribution of the ratio of two mean squares."""
    for d in (1.0, 2.0, 5.0, 20.0, 100.0, 1e4):
        # The logarithm of the ratio has the density cosh(x / 2)^-d.
        x = np.linspace(0, 80 / sqrt(d), 400_001)
        chance = np.exp(-d * (np.logaddexp(x / 2, -x / 2) - np.log(2)))
        total = np.cumsum(chance) / chance.sum()
        needed = np.interp(1 - 0.05 / TRIES, total, x)
        assert needed <= SURE * 1.01 * np.log(ratio_quantile(d))


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.1, 0.5, 2])
def test_an_error_is_met_with_few_samples_too_many(
    smooth: Report, monkeypatch: pytest.MonkeyPatch, share: float
) -> None:
    """By the best sampler: a Sobol picture of that error, but for the steps of the search."""
    target = law(smooth.default.settings)[1] * sqrt(share)
    found = made_up(smooth, monkeypatch)(error=target)
    assert found.met and found.error.high <= target
    best = min(n for n in range(1, 10_000) if 0.1 * n**-0.75 * sqrt(1.5) <= target)
    assert found.settings["settings.sampler"] == "sobol"
    assert best <= found.settings["settings.spp"] <= 1.3 * best + 1


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.1, 0.5, 2, 10])
def test_a_time_is_met_and_used(smooth: Report, monkeypatch: pytest.MonkeyPatch, share: float) -> None:
    found = made_up(smooth, monkeypatch)(time=share)
    assert found.met and found.seconds.middle <= LATE * share
    # Whole samples and the time of each render leave something; with many samples Sobol points are better.
    assert found.seconds.middle >= 0.7 * share - 0.1
    assert found.settings["settings.sampler"] == "sobol" or share < 2


@pytest.mark.slow
def test_more_time_is_less_error(smooth: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    choose = made_up(smooth, monkeypatch)
    errors = [choose(time=x).error.middle for x in (0.3, 1, 3, 10)]
    assert errors == sorted(errors, reverse=True) and errors[-1] < errors[0] / 2


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [0.5, 2.0])
def test_where_the_study_is_wrong_renders_count(smooth: Report, monkeypatch: pytest.MonkeyPatch, wrong: float) -> None:
    """Pixels of another size have other noise, and Sobol points gain more or less there."""
    choose = made_up(smooth, monkeypatch, wrong=lambda s: wrong if s["settings.sampler"] == "sobol" else 1.0)
    found = choose(error=0.008)
    assert found.met and found.error.high <= 0.008
    assert found.settings["settings.sampler"] == "sobol"
    needed = (0.1 * wrong * sqrt(1.5) / 0.008) ** (1 / 0.75)
    assert found.settings["settings.spp"] <= 1.3 * needed + 1


@pytest.mark.slow
def test_other_counts_are_taken_together(smooth: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    """The curve with the best values of all knobs, where it is better beyond the noise."""

    def point(spp: int) -> Record:
        chosen = {"settings.spp": spp, "settings.sampler": "sobol", "lights.window.samples": 2}
        settings = smooth.default.settings | chosen
        seconds, noise = law(settings)
        band = Band(noise, 0.99 * noise, 1.01 * noise)
        error = replace(smooth.default.error, rmse=band, deviation=band)
        return replace(
            smooth.default, knob="together", value=spp, settings=settings, seconds=Band(seconds, seconds, seconds),
            error=error, squares=np.full(16, noise**2),
        )  # fmt: skip

    joint = replace(smooth, joint=tuple(point(n) for n in (1, 4, 16, 64)))
    found = made_up(joint, monkeypatch)(error=0.008)
    assert found.met and found.settings["lights.window.samples"] == 2
    assert found.reasons[0].startswith("sampler stratified -> sobol, lights.window.samples 4 -> 2: the same noise in ")


@pytest.mark.slow
def test_where_nothing_is_better_the_scene_stays(smooth: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    error = 1.01 * law(smooth.default.settings)[1]
    choose = made_up(smooth, monkeypatch, wrong=lambda s: 1.0 if s == smooth.default.settings else 3)
    found = choose(error=error)
    assert found.met and found.changed == {} and found.scene == SOFT
    assert found.reasons[0] == "the scene's own settings: nothing that was measured is clearly better"


@pytest.mark.slow
def test_a_miss_is_told(smooth: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    # Whatever is rendered, the next has twice the noise.
    more = (2.0**k for k in count())
    choose = made_up(smooth, monkeypatch, wrong=lambda s: next(more))
    error = law(smooth.default.settings)[1] / 1.25
    found = choose(error=error)
    assert not found.met and found.error.high > error
    assert found.reasons[-1] == "no settings were found that do it: these come nearest"


@pytest.mark.slow
@pytest.mark.parametrize(("share", "met"), [(0.5, False), (2, True)])
def test_stopped_it_keeps_the_best_that_was_tried(
    smooth: Report, monkeypatch: pytest.MonkeyPatch, share: float, met: bool
) -> None:
    choose = made_up(smooth, monkeypatch)
    rendered = tuning._Tuner._try

    def interrupted(self: Any, settings: dict) -> Measured:
        if self.tried:
            self.interrupts.requested = True
            raise KeyboardInterrupt
        return rendered(self, settings)

    monkeypatch.setattr(tuning._Tuner, "_try", interrupted)
    found = choose(error=share * law(smooth.default.settings)[1])
    assert found.stopped and found.as_json()["stopped"] and found.reasons[-1].startswith("stopped before its end")
    assert found.met == met and found.settings == smooth.default.settings and found.scene == SOFT


@pytest.mark.slow
def test_double_precision_only_where_the_error_wants_it(smooth: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    rough = replace(smooth, floors={"single precision": 0.004})
    choose = made_up(rough, monkeypatch)
    assert "settings.precision" not in choose(error=0.03).changed
    assert "settings.precision" not in choose(time=100.0).changed
    found = choose(error=0.006)
    assert found.met and found.changed["settings.precision"] == "double"
    assert any(text.startswith("precision single -> double") for text in found.reasons)


def mirrored(report: Report) -> Report:
    """A report of depths, of which the smaller ones are faster."""
    points = []
    for depth in (1, 2, 4, 8):
        seconds = report.default.seconds.middle * (0.2 + 0.1 * depth)
        settings = report.default.settings | {"settings.depth": depth}
        bands = {"seconds": Band(seconds, seconds, seconds)}
        points.append(replace(report.default, value=depth, settings=settings, **bands))
    curves = [replace(c, points=tuple(_deep(p) for p in c.points)) for c in report.curves]
    default = replace(points[-1], knob="scene")
    return replace(report, default=default, curves=(*curves, Curve("depth", "bias", tuple(points))))


def _deep(p: Record) -> Record:
    return replace(p, settings=p.settings | {"settings.depth": 8})


@pytest.mark.slow
def test_what_a_depth_leaves_out_is_part_of_the_error(report: Report) -> None:
    search = tuner(mirrored(report), 0.01, scene=MIRRORS)
    search.cut = search._depths()
    deep = picture(changed(MIRRORS, {"settings.depth": 60}))
    for depth in (1, 2, 4, 8):
        shallow = picture(changed(MIRRORS, {"settings.depth": depth}))
        left = sqrt(((shallow - deep) ** 2).mean()) / luminance(deep)
        squares = search.left({"settings.depth": depth, "settings.precision": "double"})
        middle, low, high = (sqrt(x) for x in (squares.middle, squares.low, squares.high))
        assert low < middle < high and 0.9 * left < middle < 1.1 * left and 0.97 * left <= high < 1.3 * left


@pytest.mark.slow
def test_the_depth_is_the_least_that_leaves_out_far_less_than_the_error(report: Report) -> None:
    search = tuner(mirrored(report), 0.01, scene=MIRRORS)
    search.cut = {
        d: Band(x**2, (0.9 * x) ** 2, (1.1 * x) ** 2) for d, x in ((1, 0.01), (2, 0.002), (4, 1e-4), (8, 1e-6))
    }
    assert search._discrete(0.01) == {"settings.depth": 2} and "depth 8 -> 2: it leaves out 0.2 %" in search.why[0]
    assert search._discrete(0.002) == {"settings.depth": 4}
    assert search._discrete(1e-5) == {"settings.depth": 8}
    # Not where it is no faster.
    flat = replace(search.report, default=replace(search.report.default, seconds=Band(1e-9, 1e-9, 1e-9)))
    assert replace(search, report=flat)._discrete(0.01) == {"settings.depth": 8}
    assert remains(Band(0.0032**2, 0.001**2, 0.0071**2)) == "0.32 % (at most 0.71 %)"
    assert remains(Band(0.0032**2, 0.0031**2, 0.0032001**2)) == "0.32 %"
    search.cut[8] = Band(0.02**2, 0.01**2, 0.03**2)
    with pytest.raises(UserError, match=r"settings.depth = 8 leaves out 2 % \(at most 3 %\), whatever the samples"):
        search._refuse({"settings.depth": 8})


@pytest.mark.slow
def test_the_error_is_told_with_what_is_left_and_its_bound(report: Report) -> None:
    """Its middle is noise and the estimate of the bias, its ends are both ends; the target is met by the upper one."""
    search = tuner(mirrored(report), 0.006, scene=MIRRORS)
    search.cut = {8: Band(0.0032**2, 0.001**2, 0.0071**2)}
    found = search._try(search.own | {"settings.precision": "double"})
    assert found.error.middle**2 == pytest.approx(found.noise + 0.0032**2)
    assert found.error.high**2 == pytest.approx(found.noise_high + 0.0071**2) and found.noise < found.noise_high
    assert found.error.low**2 - 0.001**2 < found.noise
    assert found.error.high > 0.0071 and not Target(0.0071, None).met(found)


@pytest.mark.slow
def test_each_try_has_new_seeds(report: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    seeds, expose = [], tuning.expose
    monkeypatch.setattr(tuning, "expose", lambda p, *more: (seeds.append(p.scene.settings.seed), expose(p, *more))[1])
    search = tuner(report, 0.01)
    search.cut = search._depths()
    for _ in range(3):
        search._try(search.own)
    assert len(set(seeds)) == len(seeds) >= 6


@pytest.mark.parametrize("asked", [{"error": 0.001}, {"time": 100.0}])
@pytest.mark.parametrize("spp", [1, 16])
@pytest.mark.slow
def test_without_noise_it_is_one_sample_whatever_the_clock_says(
    spp: int, asked: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also of a black picture, whose renders take as long with any samples; and no two reasons are at odds."""
    monkeypatch.setattr(study, "BUDGETS", (HURRY, HURRY))
    flat = replace(FLAT, settings=replace(FLAT.settings, spp=spp))
    dark = replace(flat, objects={}, background=(0.0, 0.0, 0.0))
    for scene in (flat, dark):
        found = tune(scene, progress=False, **asked)
        assert found.met and found.settings["settings.spp"] == 1 and found.error.high < 1e-6
        assert any("has no noise" in text for text in found.reasons)
        assert not any("clearly better" in text for text in found.reasons)


@pytest.mark.slow
def test_noise_that_only_the_whole_picture_shows_is_noise(smooth: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    found = made_up(replace(smooth, noiseless=True), monkeypatch)(error=0.02)
    assert found.met and found.settings["settings.spp"] > 1
    assert not any("no noise" in text for text in found.reasons)
