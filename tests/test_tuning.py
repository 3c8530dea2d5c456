"""Knobs for an error or for a time: the picture keeps to the error, the choice is the model's best, no more is turned.

What must not depend on the machine is proved in a world that is made up, where renders take what the model says.
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
from visray.study.cost.reasons import reasons, remains
from visray.study.cost.records import Band, Curve, Point, Report
from visray.study.cost.scaled import Scaled
from visray.study.cost.study import cost
from visray.study.cost.truth import luminance
from visray.study.cost.tuned import LATE, Measured, Target, Tuned, as_scene
from visray.study.cost.tuning import GAIN, WORTH, tune

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

# One worker makes what its tests share.
pytestmark = pytest.mark.xdist_group("tuning")
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
# Of a world that is made up: seconds that a render takes whatever it does, and the model's variance that it has.
ONCE, PART = 0.02, 0.6


@pytest.fixture(scope="module")
def report() -> Report:
    with pytest.MonkeyPatch.context() as patch:
        Machine(patch)
        patch.setattr(study, "BUDGETS", (HURRY, HURRY))
        return cost(SOFT, quick=True, progress=False)


@pytest.fixture(autouse=True)
def even(machine: Machine) -> None:
    """Seconds go by work alone."""


@pytest.fixture
def known(report: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    """The costs of SOFT are measured once."""
    monkeypatch.setattr(tuning, "cost", lambda *_, **__: report)


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


@pytest.fixture(scope="module")
def smooth(report: Report) -> Report:
    """The report with laws instead of measurements: what is proved by it does not depend on the machine."""

    def point(p: Point) -> Point:
        s = report.default.settings | p.settings
        spp, lights, sampler = s["settings.spp"], s["lights.window.samples"], s["settings.sampler"]
        seconds = 1e-4 * spp * (1 + 0.3 * lights) * (1.2 if sampler == "sobol" else 1.0)
        seconds *= 1.3 if s["settings.precision"] == "double" else 1.0
        power = {"stratified": 1.3, "sobol": 1.5, "independent": 1.0}[sampler]
        error = sqrt(0.01 * spp**-power + 0.02 / spp / lights)
        band = Band(error, 0.99 * error, 1.01 * error)
        error = replace(p.error, rmse=band, bias=Band(0.0, 0.0, 1e-4), deviation=band)
        return replace(p, seconds=Band(seconds, seconds, seconds), error=error)

    curves = tuple(replace(c, points=tuple(map(point, c.points))) for c in report.curves)
    return replace(report, default=point(report.default), curves=curves, floors={})


def made_up(
    report: Report, monkeypatch: pytest.MonkeyPatch, wrong: Callable[[dict], float] = lambda s: 1.0
) -> Callable[..., Tuned]:
    """A world where renders take what the model says and a bit more, the scene as it is about a second; the variance is
    `wrong` times what the model says. Returns what tunes SOFT in it."""

    def measured(self: Any, settings: dict) -> Measured:
        model = self.scaled.model
        seconds = ONCE + model.seconds(settings) / model.seconds(self.scaled.own)
        noise = PART * wrong(settings) * model.error(settings) ** 2
        error = sqrt(noise + self.scaled.bias(settings))
        return Measured(settings, Band(seconds, seconds, seconds), Band(error, error, error), noise)

    monkeypatch.setattr(tuning._Tuning, "_measured", measured)
    scaled = Scaled(SOFT, report)
    return lambda error=None, time=None: tuning._Tuning(scaled, Target(error, time), Interrupts(), False).run()


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
    monkeypatch.delattr(tuning, "cost")
    with pytest.raises(UserError) as error:
        tune(SOFT, progress=False, **asked)
    assert error.value.lines == (text,)


@pytest.mark.parametrize("error", [0.05, 0.01])
@pytest.mark.slow
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
        "settings.accelerator",
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
    assert len(found.reasons) >= 1 and all("->" in text for text in found.reasons)
    console = Console(width=120, record=True, file=open("/dev/null", "w"))  # noqa: SIM115 - the console keeps it
    console.print(found.table())
    text = console.export_text()
    assert "as asked" in text and "settings.spp" in text and "%" in text
    assert repr(found) == str(found) and repr(found).startswith("<Tuned for error = 0.004: met, error 0.")
    assert repr(found).endswith("; " + ", ".join(f"{a} = {v}" for a, v in found.changed.items()) + ">")
    assert repr(replace(found, changed={}, met=False)).endswith("; nothing changed>")


@pytest.mark.parametrize("stopped", [False, True])
@pytest.mark.slow
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


@pytest.mark.parametrize(
    ("asked", "text"),
    [
        ({"error": 1e-9}, "error = 1e-09: the best of the settings measured makes"),
        ({"time": 1e-7}, "time = 1e-07: the fastest of the settings measured takes"),
    ],
)
@pytest.mark.slow
def test_what_is_out_of_reach(known: None, asked: dict[str, float], text: str) -> None:
    with pytest.raises(UserError, match=f"^{text}"):
        tune(SOFT, progress=False, **asked)


@pytest.mark.slow
def test_more_time_is_less_error(smooth: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    choose = made_up(smooth, monkeypatch)
    before = choose(time=1e9).before.seconds.middle
    found: list[Tuned] = [choose(time=before * x) for x in (0.3, 1, 3, 10)]
    assert all(t.met for t in found)
    errors = [t.error.middle for t in found]
    assert errors == sorted(errors, reverse=True) and errors[-1] < errors[0] / 2


@pytest.mark.parametrize("share", [0.1, 0.5, 2])
@pytest.mark.slow
def test_the_choice_is_the_best_of_the_model(smooth: Report, monkeypatch: pytest.MonkeyPatch, share: float) -> None:
    choose = made_up(smooth, monkeypatch)
    before = choose(error=1.0).before
    for found, price in (
        (choose(time=share * before.seconds.middle), lambda t, e: e),
        (choose(error=before.error.middle / sqrt(share)), lambda t, e: t),
    ):
        scaled = Scaled(SOFT, smooth)
        kept = scaled.kept(scaled.model).choices
        own = scaled.model.seconds(scaled.own)
        every = [(ONCE + c.seconds / own, sqrt(PART) * c.error) for c in kept]
        target = found.target
        allowed = [(t, e) for t, e in every if (t <= target.time if target.time else e <= target.error)]
        best = min(price(t, e) for t, e in allowed)
        # What stays as it is, what gains too little to be tried, and what gains too little to be turned.
        near = WORTH / GAIN**2
        assert found.met and price(found.seconds.middle, found.error.middle) <= near * best


@pytest.mark.slow
def test_where_time_tells_nothing_no_more_samples_are_taken_than_needed(
    smooth: Report, monkeypatch: pytest.MonkeyPatch
) -> None:
    def timeless(p: Point) -> Point:
        return replace(p, seconds=smooth.default.seconds)

    curves = tuple(replace(c, points=tuple(map(timeless, c.points))) for c in smooth.curves)
    choose = made_up(replace(smooth, curves=curves), monkeypatch)
    before = choose(error=1.0).before
    found = choose(error=before.error.middle / 2)
    scaled = Scaled(SOFT, smooth)
    fewer = found.settings | {"settings.spp": found.settings["settings.spp"] - 1}
    if found.settings["settings.sampler"] == "stratified":
        fewer["settings.spp"] = (round(sqrt(found.settings["settings.spp"])) - 1) ** 2
    assert found.met and sqrt(PART) * scaled.model.error(fewer) > found.target.error


@pytest.mark.slow
def test_where_the_model_is_wrong_what_is_measured_counts(smooth: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    own = smooth.default.settings["lights.window.samples"]
    choose = made_up(smooth, monkeypatch, wrong=lambda s: 5.0 if s["lights.window.samples"] < own else 1.0)
    before = choose(error=1.0).before
    found = choose(error=2 * before.error.middle)
    assert found.met and found.error.high <= 2 * before.error.middle
    slow = choose(time=before.seconds.middle / 4)
    assert slow.met and slow.seconds.middle <= LATE * before.seconds.middle / 4


@pytest.mark.slow
def test_where_nothing_is_better_the_scene_stays(smooth: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    choose = made_up(smooth, monkeypatch, wrong=lambda s: 1.0 if s == smooth.default.settings else 1e3)
    found = choose(error=0.02)
    assert found.met and found.changed == {} and found.scene == SOFT
    assert found.reasons == ("the scene's own settings: none that were measured are clearly better",)


@pytest.mark.parametrize("sampler", ["sobol", "stratified", "independent"])
@pytest.mark.slow
def test_of_the_latest_that_was_measured_the_model_says_just_that(smooth: Report, sampler: str) -> None:
    """With all its other settings too: variance and seconds, whatever samplers that came before it did."""
    scaled, own = Scaled(SOFT, smooth), smooth.default.settings

    def measured(settings: dict, noise: float, seconds: float) -> Measured:
        error = sqrt(noise)
        return Measured(settings, Band(seconds, seconds, seconds), Band(error, error, error), noise)

    fast = measured(own | {"settings.spp": 1}, 1e-3, 0.05)
    latest = measured(own | {"settings.sampler": sampler, "settings.spp": 49, "lights.window.samples": 9}, 2e-6, 0.7)
    whole = scaled.whole([measured(own, 5e-5, 0.3), latest], fast)
    assert whole.error(latest.settings) == pytest.approx(sqrt(2e-6), rel=1e-9)
    assert whole.seconds(latest.settings) == pytest.approx(0.7, rel=1e-9)


@pytest.mark.parametrize(("sampler", "spp"), [("sobol", 147), ("independent", 147), ("stratified", 169)])
@pytest.mark.slow
def test_where_all_predictions_fail_more_samples_do(smooth: Report, sampler: str, spp: int) -> None:
    """What came nearest, with as many more as independent ones would need: 1.21^2 times 100 here."""
    scaled, own = Scaled(SOFT, smooth), smooth.default.settings
    near = own | {"settings.sampler": sampler, "settings.spp": 100}
    tried = [
        Measured(s, Band(1.0, 1.0, 1.0), Band(high / 1.1, high / 1.2, high), (high / 1.1) ** 2)
        for s, high in ((own, 0.02), (near, 0.00605), (own | {"settings.spp": 36}, 0.007))
    ]
    tuner = tuning._Tuning(scaled, Target(0.005, None), Interrupts(), False, tried)
    # Single precision leaves nothing out here: noise is all.
    assert sqrt(scaled.bias(near)) < 1e-4
    assert tuner._more() == near | {"settings.spp": spp}
    # Where what samples do not take away is as much as is asked for, they are of no use.
    rough = Scaled(SOFT, replace(smooth, floors={"single precision": 0.005}))
    assert tuning._Tuning(rough, Target(0.005, None), Interrupts(), False, tried)._more() is None


@pytest.mark.slow
def test_a_miss_is_told(smooth: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    # Whatever is measured, the next has twice the variance.
    more = (2.0**k for k in count())
    choose = made_up(smooth, monkeypatch, wrong=lambda s: next(more))
    error = sqrt(PART) * smooth.default.error.rmse.middle / 1.25
    found = choose(error=error)
    assert not found.met and found.error.high > error
    assert found.reasons[-1] == "no settings were found that do it: these come nearest"


@pytest.mark.parametrize(("share", "met"), [(0.5, False), (2, True)])
@pytest.mark.parametrize("measured", [1, 2])
@pytest.mark.slow
def test_stopped_it_keeps_the_best_that_was_tried(
    smooth: Report, monkeypatch: pytest.MonkeyPatch, measured: int, share: float, met: bool
) -> None:
    """That is the scene as it is: the fastest settings, which come second, only tell how fast renders are."""
    choose = made_up(smooth, monkeypatch)
    before, whole, asked = choose(error=1.0).before, tuning._Tuning._measured, []

    def interrupted(self: Any, settings: dict) -> Measured:
        asked.append(settings)
        if len(asked) > measured:
            self.interrupts.requested = True
            raise KeyboardInterrupt
        return whole(self, settings)

    monkeypatch.setattr(tuning._Tuning, "_measured", interrupted)
    found = choose(error=share * before.error.middle)
    assert found.stopped and found.as_json()["stopped"] and found.reasons[-1].startswith("stopped before its end")
    assert found.met == met and found.settings == before.settings and found.scene == SOFT
    monkeypatch.setattr(tuning._Tuning, "_measured", whole)
    assert not choose(error=share * before.error.middle).stopped


@pytest.mark.slow
def test_double_precision_only_where_the_error_wants_it(smooth: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    rough = replace(smooth, floors={"single precision": 0.008})
    choose = made_up(rough, monkeypatch)
    assert "settings.precision" not in choose(error=0.02).changed
    assert "settings.precision" not in choose(time=100.0).changed
    found = choose(error=0.006)
    assert found.met and found.changed["settings.precision"] == "double"
    assert any(text.startswith("precision single -> double") for text in found.reasons)
    with pytest.raises(UserError, match="the best of the settings measured makes"):
        choose(error=1e-7)


@pytest.mark.slow
def test_what_a_depth_leaves_out_is_part_of_the_error(report: Report) -> None:
    points = tuple(replace(report.default, value=depth) for depth in (1, 2, 4, 8))
    mirrored = replace(report, curves=(*report.curves, Curve("depth", "bias", points)))
    scaled = Scaled(MIRRORS, mirrored)
    deep = picture(changed(MIRRORS, {"settings.depth": 60}))
    for p in points:
        shallow = picture(changed(MIRRORS, {"settings.depth": p.value}))
        left = sqrt(((shallow - deep) ** 2).mean()) / luminance(deep)
        settings = {"settings.depth": p.value, "settings.precision": "double"}
        squares = scaled.left(settings)
        middle, low, high = (sqrt(x) for x in (squares.middle, squares.low, squares.high))
        # The estimate is what is left out, and what must surely be met counts as much as it may be: no less than it
        # is, but for chance.
        assert scaled.bias(settings) == squares.high and low < middle < high
        assert 0.9 * left < middle < 1.1 * left and 0.97 * left <= high < 1.3 * left


@pytest.mark.slow
def test_the_error_is_told_with_the_estimate_of_what_is_left_and_its_bound(report: Report) -> None:
    """Its middle is noise and the estimate, its ends are both ends; what is asked for is met by the upper one."""
    points = tuple(replace(report.default, value=depth) for depth in (1, 2, 4, 8))
    scaled = Scaled(MIRRORS, replace(report, curves=(*report.curves, Curve("depth", "bias", points))))
    # Rarely seen and bright, it is known so badly.
    scaled.__dict__["cut"] = {8: Band(0.0032**2, 0.001**2, 0.0071**2)}
    tuner = tuning._Tuning(scaled, Target(0.006, None), Interrupts(), False)
    found = tuner._measured(scaled.own | {"settings.precision": "double"})
    assert found.error.middle**2 == pytest.approx(found.noise + 0.0032**2)
    noise = found.error.high**2 - 0.0071**2
    assert found.noise < noise and found.error.low**2 - 0.001**2 < found.noise
    assert found.error.high > 0.0071 and not Target(0.0071, None).met(found)
    # And chosen by, as the model has it.
    assert tuner._price(found) == found.seconds.middle
    for_time = replace(tuner, target=Target(None, 1.0))
    assert for_time._price(found) == pytest.approx(sqrt(found.noise + 0.0071**2))
    assert remains(scaled.left(found.settings)) == "0.0032 (at most 0.0071)"
    assert remains(Band(0.0032**2, 0.0031**2, 0.0032001**2)) == "0.0032"


@pytest.mark.slow
def test_how_badly_noise_is_known_is_not_how_badly_a_depth_is(smooth: Report) -> None:
    """The model counts all that may be left: where the noise is known exactly, it is asked for no less than the error
    itself, however far the estimate is below the bound."""
    scaled = Scaled(SOFT, smooth)
    scaled.__dict__["cut"] = {SOFT.settings.depth: Band(0.0032**2, 0.001**2, 0.0071**2)}
    ends = (sqrt(1e-5 + left**2) for left in (0.0032, 0.001, 0.0071))
    own = Measured(scaled.own, Band(1.0, 1.0, 1.0), Band(*ends), 1e-5)
    tuner = tuning._Tuning(scaled, Target(0.018, None), Interrupts(), False, [own])
    tuner.base, tuner.fastest = (
        own,
        replace(own, settings=scaled.own | {"settings.spp": 1}, seconds=Band(0.1, 0.1, 0.1)),
    )
    assert 0.8 * 0.018 < tuner._wanted(True).error <= 0.018
    # What was expected is told as what was measured is: with the estimate.
    assert tuner._told(own).predicted_error == pytest.approx(own.error.middle)


@pytest.mark.slow
def test_reasons_and_refusals_say_what_is_left_and_how_much_it_may_be(report: Report) -> None:
    def at(depth: int, seconds: float) -> Point:
        d = report.default
        took = Band(seconds, seconds, seconds)
        return replace(d, knob="depth", value=depth, settings=d.settings | {"settings.depth": depth}, seconds=took)

    seconds = report.default.seconds.middle
    default = at(SOFT.settings.depth, seconds)
    points = at(2, seconds / 4), default, at(2 * SOFT.settings.depth, 1.1 * seconds)
    curves = (*(c for c in report.curves if c.kind == "sampling"), Curve("depth", "bias", points))
    curves = tuple(
        replace(c, points=tuple(replace(p, settings=default.settings | p.settings) for p in c.points)) for c in curves
    )
    deep = replace(report, default=replace(default, knob="default"), curves=curves, floors={})
    scaled = Scaled(SOFT, deep)
    scaled.__dict__["cut"] = {p.value: Band(0.0032**2, 0.001**2, 0.0071**2) for p in points}
    model = scaled.model
    turned = scaled.own | {"settings.depth": 2}
    assert any(
        "0.0032 (at most 0.0071) is left whatever the samples" in text for text in reasons(scaled, model, turned)
    )
    with pytest.raises(UserError, match=r", 0\.0032 \(at most 0\.0071\) of it whatever the samples, by settings.depth"):
        tuning._Tuning(scaled, Target(0.005, None), Interrupts(), False)._refuse(model)


def test_without_noise_one_sample_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study, "BUDGETS", (HURRY, HURRY))
    found = tune(FLAT, error=0.001, progress=False)
    assert found.met and found.changed == {"settings.spp": 1} and found.error.high < 1e-6
    (text,) = found.reasons
    assert text.startswith("samples per pixel 4 -> 1: the picture has no noise, one sample does")


@pytest.mark.parametrize("asked", [{"error": 0.001}, {"time": 100.0}])
@pytest.mark.parametrize("spp", [1, 16])
def test_without_noise_it_is_one_sample_whatever_the_clock_says(
    spp: int, asked: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also of a black picture, whose renders take as long with any samples; and no two reasons are at odds."""
    monkeypatch.setattr(study, "BUDGETS", (HURRY, HURRY))
    dark = replace(FLAT, objects={}, background=(0.0, 0.0, 0.0), settings=replace(FLAT.settings, spp=spp))
    whole = tuning._Tuning._measured
    later = count()

    def measured(self: Any, settings: dict) -> Measured:
        # Whatever comes later takes a bit longer.
        seconds = 0.01 + 1e-4 * next(later)
        return replace(whole(self, settings), seconds=Band(seconds, seconds, seconds))

    monkeypatch.setattr(tuning._Tuning, "_measured", measured)
    found = tune(dark, progress=False, **asked)
    assert found.met and found.settings["settings.spp"] == 1
    better = [text for text in found.reasons if "none that were measured are clearly better" in text]
    assert len(better) == (spp == 1) and any("one sample does" in text for text in found.reasons)


def test_without_noise_the_model_wants_one_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where time tells nothing."""
    monkeypatch.setattr(study, "BUDGETS", (HURRY, HURRY))
    flat = replace(FLAT, settings=replace(FLAT.settings, sampler="independent"))
    report = cost(flat, quick=True, progress=False, whole=False)
    seconds = report.default.seconds
    curves = tuple(replace(c, points=tuple(replace(p, seconds=seconds) for p in c.points)) for c in report.curves)
    scaled = Scaled(flat, replace(report, curves=curves))
    own = Measured(scaled.own, Band(1.0, 1.0, 1.0), Band(1e-8, 1e-8, 1e-8), 0.0)
    for target in (Target(0.001, None), Target(None, 100.0)):
        tuner = tuning._Tuning(scaled, target, Interrupts(), False, [own])
        tuner.base = tuner.fastest = own
        assert tuner._wanted(True).settings["settings.spp"] == tuner._wanted(False).settings["settings.spp"] == 1


def test_without_noise_more_samples_are_never_called_best(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped before one sample was tried, the scene stays as it is; but that it is best is not said."""
    monkeypatch.setattr(study, "BUDGETS", (HURRY, HURRY))
    whole, asked = tuning._Tuning._measured, []

    def interrupted(self: Any, settings: dict) -> Measured:
        asked.append(settings)
        if len(asked) > 1:
            self.interrupts.requested = True
            raise KeyboardInterrupt
        return whole(self, settings)

    monkeypatch.setattr(tuning._Tuning, "_measured", interrupted)
    found = tune(FLAT, error=0.001, progress=False)
    assert found.stopped and found.changed == {}
    assert found.reasons[0] == "the picture has no noise: one sample does" and len(found.reasons) == 2


@pytest.mark.slow
def test_noise_that_only_the_whole_picture_shows_is_noise(smooth: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    choose = made_up(replace(smooth, noiseless=True), monkeypatch)
    found = choose(error=0.02)
    assert found.met and found.settings["settings.spp"] > 1
    assert not any("no noise" in text for text in found.reasons)
