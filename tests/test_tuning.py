"""Choice of settings for an error or for a time: pictures keep to the error, and only better settings are taken.

What must not depend on the machine is tested in a made-up world, in which seconds and noise follow a formula.
"""

import json
import signal
from collections.abc import Callable
from dataclasses import replace
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
from visray.renderer import render
from visray.scene.address import changed
from visray.scene.load import dump, load
from visray.scene.scene import Film, Scene, Settings
from visray.study.cost import study, tuning
from visray.study.cost import tuned as tuned_records
from visray.study.cost.records import Band, Curve, Record, Report
from visray.study.cost.slopes import slope
from visray.study.cost.truth import luminance
from visray.study.cost.tuned import Measured, Target, as_scene
from visray.study.cost.tuning import tune

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
    """The study of SOFT is made once."""
    monkeypatch.setattr(study, "studied", lambda *_, **__: report)


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    fine = changed(SOFT, {"settings.sampler": "sobol", "settings.precision": "double", "settings.seed": 999})
    return picture(fine, spp=4096)


def picture(scene: Scene, **more: Any) -> np.ndarray:
    return render(scene, layers=("RGB",), progress=False, **more)["RGB"].astype(float)


def law(settings: dict[str, Any]) -> tuple[float, float]:
    """Seconds and noise of one sample per pixel in the made-up world. Noise falls as samples^-0.75."""
    lights = settings["lights.window.samples"]
    seconds = 1e-4 * (1 + 0.3 * lights) * (1.3 if settings["settings.precision"] == "double" else 1.0)
    return seconds, 0.1 * sqrt(1 + 2 / lights)


@pytest.fixture(scope="module")
def smooth(report: Report) -> Report:
    """The report with the law in place of its measurements."""

    def lawful(p: Record) -> Record:
        settings = report.default.settings | p.settings
        seconds, noise = law(settings)
        seconds, noise = seconds * settings["settings.spp"], noise * settings["settings.spp"] ** -0.75
        error = replace(p.error, rmse=exact(noise), bias=Band(0.0, 0.0, 1e-4), deviation=exact(noise))
        return replace(p, settings=settings, seconds=exact(seconds), error=error, squares=np.full(16, noise**2))

    curves = []
    for c in report.curves:
        points = tuple(map(lawful, c.points))
        k = slope([p.value for p in points], [p.squares for p in points]) if c.kind == "sampling" else None
        curves.append(replace(c, points=points, by_count=k, by_time=k))
    return replace(report, default=lawful(report.default), curves=tuple(curves), joint=(), floors={})


def exact(x: float) -> Band:
    return Band(x, 0.999 * x, 1.001 * x)


def made_up(monkeypatch: pytest.MonkeyPatch, slower: Callable[[dict], float] = lambda s: 1.0) -> list[dict]:
    """Makes renders follow the law, `slower` times as long. Returns a list that gets the settings of each render."""
    rendered = []

    def render_once(self: Any, settings: dict, prepared: Any, number: int) -> Measured:
        rendered.append(settings)
        seconds, noise = law(settings)
        seconds *= slower(settings)
        if self.target.error is not None:
            spp = (noise / self.target.error) ** (1 / 0.75)
            return Measured(settings, exact(spp * seconds), Band(*[self.target.error] * 3), spp)
        spp = self.target.time / seconds
        return Measured(settings, Band(*[self.target.time] * 3), exact(noise * spp**-0.75), spp)

    monkeypatch.setattr(tuning._Tuner, "_render", render_once)
    return rendered


def tuner(report: Report, error: float | None = None, time: float | None = None, scene: Scene = SOFT) -> tuning._Tuner:
    return tuning._Tuner(scene, report, Target(error, time), Interrupts())


def price(lights: int) -> float:
    """Seconds for an error in the made-up world, by the number of light samples."""
    seconds, noise = law({"lights.window.samples": lights, "settings.precision": "single"})
    return seconds * noise ** (1 / 0.75)


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
@pytest.mark.parametrize("error", [0.02, 0.005])
def test_the_picture_keeps_to_the_error(known: None, truth: np.ndarray, error: float) -> None:
    tuned = tune(SOFT, error=error, progress=False)
    assert tuned.met and tuned.error.high <= error
    scale = luminance(truth)
    squares = [((picture(tuned.scene, error=error, seed=n) - truth) ** 2).mean() / scale**2 for n in range(71, 75)]
    # Four pictures of 1728 pixels with an edge tell the error to about a tenth.
    assert error / 2 < sqrt(np.mean(squares)) < 1.1 * error
    assert tuned.error.low / 1.1 <= sqrt(np.mean(squares)) <= 1.1 * tuned.error.high


@pytest.mark.slow
@pytest.mark.parametrize("asked", [{"error": 0.01}, {"time": 3.0}])
def test_the_best_number_of_light_samples_is_taken(
    smooth: Report, asked: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """That of the least time for an error, by the law, among the measured numbers; it has the least error in a time."""
    made_up(monkeypatch)
    (lights,) = (c for c in smooth.curves if c.setting == "light samples")
    best = min((p.value for p in lights.points), key=price)
    # The test would prove nothing if the scene's own number were the best.
    assert price(best) < 0.9 * price(4)
    tuned = tuner(smooth, **asked).run()
    assert tuned.met and tuned.changed == {"lights.window.samples": best}
    assert tuned.scene == changed(SOFT, tuned.changed) and tuned.before.settings == tuner(smooth).own
    if "error" in asked:
        assert tuned.seconds.middle / tuned.before.seconds.middle == pytest.approx(price(best) / price(4))
    else:
        assert tuned.error.middle < tuned.before.error.middle and tuned.seconds.middle == 3.0


@pytest.mark.slow
@pytest.mark.parametrize("asked", [{"error": 0.01}, {"time": 3.0}])
def test_renders_decide_where_the_study_is_wrong(
    smooth: Report, asked: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    own = tuner(smooth).own
    rendered = made_up(monkeypatch, slower=lambda s: 1.0 if s == own else 3.0)
    tuned = tuner(smooth, **asked).run()
    assert own in rendered and any(s != own for s in rendered)
    assert tuned.met and tuned.changed == {} and tuned.scene == SOFT
    assert tuned.reasons[0] == "the scene's own settings: nothing that was measured is clearly better"


@pytest.mark.slow
def test_a_miss_is_told(smooth: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    made_up(monkeypatch)
    once = tuning._Tuner._render
    far = lambda *given: replace(once(*given), error=Band(0.02, 0.01, 0.03))  # noqa: E731 - a name for a row
    monkeypatch.setattr(tuning._Tuner, "_render", far)
    tuned = tuner(smooth, error=0.01).run()
    assert not tuned.met and "the target was missed: these settings come nearest" in tuned.reasons


@pytest.mark.slow
def test_the_scene_loads_again_and_the_result_is_told(
    smooth: Report, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made_up(monkeypatch)
    tuned = tuner(smooth, error=0.004).run()
    path, own = tmp_path / "tuned.json", tmp_path / "own.json"
    # In the file's own order, with what it says of itself, and defaults that it spells out.
    said = {"$schema": "schema.json", "settings": {"depth": SOFT.settings.depth, "spp": 16, "seed": 5}}
    own.write_text(json.dumps(said | json.loads(dump(SOFT)) | said))
    assert load(own) == SOFT
    path.write_text(as_scene(tuned, tmp_path, own))
    text = json.loads(path.read_text())
    assert list(text) == list(json.loads(own.read_text())) and text["$schema"] == "schema.json"
    assert list(text["settings"])[:3] == ["depth", "spp", "seed"]
    assert load(path) == tuned.scene == changed(SOFT, tuned.changed)
    report = json.loads(json.dumps(tuned.as_json(), allow_nan=False))
    assert report["asked"] == {"error": 0.004} and report["met"] and report["changed"] == tuned.changed
    assert report["measured"]["error"]["middle"] == tuned.error.middle
    assert report["before"]["spp"] == tuned.before.spp
    assert tuned.reasons[-1] == "to get this picture, render the scene with --error 0.004"
    console = Console(width=120, record=True, file=open("/dev/null", "w"))  # noqa: SIM115 - the console keeps it
    console.print(tuned.table())
    shown = console.export_text()
    assert shown.split(":")[0].endswith("--error 0.004") and shown.startswith("Use lights.window.samples=2 with ")
    assert "lights.window.samples" in shown and "%" in shown
    console.print(replace(tuned, before=None).table())
    assert "out of reach" in console.export_text()
    assert repr(tuned) == str(tuned) and repr(tuned).startswith("<Tuned for error = 0.004: met, error 0.")
    assert repr(tuned).endswith("; " + ", ".join(f"{a} = {v}" for a, v in tuned.changed.items()) + ">")
    assert repr(replace(tuned, changed={}, met=False)).endswith("; nothing changed>")


@pytest.mark.slow
@pytest.mark.parametrize("stopped", [False, True])
def test_ctrl_c_while_a_scene_is_written_loses_nothing(
    smooth: Report, stopped: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    made_up(monkeypatch)
    own, out, written = tmp_path / "own.json", tmp_path / "tuned.json", tuned_records.as_scene
    own.write_text(dump(SOFT))
    tuned, lost = replace(tuner(smooth, error=0.004).run(), stopped=stopped), []

    def slow(*given: Any) -> str:
        signal.raise_signal(signal.SIGINT)
        return written(*given)

    monkeypatch.setattr(tuned_records, "as_scene", slow)
    monkeypatch.setattr(tuning, "tune", lambda *_, **__: tuned)
    # A signal that nobody takes would end the tests.
    before = signal.signal(signal.SIGINT, lambda *_: lost.append(1))
    try:
        code = studies.tune(own, error=0.004, output=out, json=True)
    finally:
        signal.signal(signal.SIGINT, before)
    assert code == (130 if stopped else 0) and not lost and load(out) == tuned.scene
    assert json.loads(capsys.readouterr().out) == tuned.as_json() | {"output": str(out)}
    studies.tune(own, error=0.004, json=True)
    assert "output" not in json.loads(capsys.readouterr().out)


@pytest.mark.slow
@pytest.mark.parametrize("renders", [0, 1, 2])
def test_ctrl_c_keeps_the_better_of_the_settings_that_were_rendered(
    smooth: Report, renders: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rendered, once = made_up(monkeypatch), tuning._Tuner._render

    def interrupted(self: Any, *given: Any) -> Measured:
        if len(rendered) == renders:
            self.interrupts.requested = True
            raise KeyboardInterrupt
        return once(self, *given)

    monkeypatch.setattr(tuning._Tuner, "_render", interrupted)
    search = tuner(smooth, error=0.01)
    if renders == 0:
        with pytest.raises(KeyboardInterrupt):
            search.run()
        return
    tuned = search.run()
    # After two renders, one of each, the better one is known.
    assert tuned.stopped and tuned.met and bool(tuned.changed) == (renders == 2)
    assert "stopped before its end: not all renders were made" in tuned.reasons


@pytest.mark.slow
@pytest.mark.parametrize(
    ("asked", "text"),
    [
        ({"error": 1e-9}, "error = 1e-09: it would take about "),
        ({"time": 1e-7}, "time = 1e-07: loading, compiling and writing alone take"),
    ],
)
def test_what_is_out_of_reach(known: None, asked: dict[str, float], text: str) -> None:
    with pytest.raises(UserError, match=f"^{text}"):
        tune(SOFT, progress=False, **asked)


@pytest.mark.slow
def test_double_precision_only_if_the_error_needs_it(smooth: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    """The scene's own settings are then out of reach, if the renders say so."""
    rendered, once = made_up(monkeypatch), tuning._Tuner._render
    rough = replace(smooth, floors={"single precision": 0.004})
    assert "settings.precision" not in tuner(rough, error=0.03).run().changed
    assert "settings.precision" not in tuner(rough, time=100.0).run().changed

    def refused(self: Any, settings: dict, *given: Any) -> Measured:
        if settings["settings.precision"] == "single":
            raise UserError("single precision is off")
        return once(self, settings, *given)

    monkeypatch.setattr(tuning._Tuner, "_render", refused)
    tuned = tuner(rough, error=0.006).run()
    assert tuned.met and tuned.changed["settings.precision"] == "double" and tuned.before is None
    assert "precision single -> double" in tuned.reasons
    with pytest.raises(UserError, match="single precision is off"):
        tuner(smooth, error=0.006).run()
    assert rendered


def mirrored(report: Report) -> Report:
    """A report of depths; the smaller ones are faster."""
    points = []
    for depth in (1, 2, 4, 8):
        seconds = report.default.seconds.middle * (0.2 + 0.1 * depth)
        settings = report.default.settings | {"settings.depth": depth}
        points.append(replace(report.default, value=depth, settings=settings, seconds=Band(*[seconds] * 3)))
    curve = Curve("depth", "bias", tuple(points))
    return replace(report, default=replace(points[-1], setting="scene"), curves=(*report.curves, curve))


@pytest.mark.slow
def test_the_bias_of_a_depth_is_that_of_converged_pictures(report: Report) -> None:
    biases = tuner(mirrored(report), 0.01, scene=MIRRORS).depth_biases()
    deep = picture(changed(MIRRORS, {"settings.depth": 60}))
    for depth in (1, 2, 4, 8):
        shallow = picture(changed(MIRRORS, {"settings.depth": depth}))
        left = sqrt(((shallow - deep) ** 2).mean()) / luminance(deep)
        middle, low, high = (sqrt(x) for x in (biases[depth].middle, biases[depth].low, biases[depth].high))
        assert low < middle < high and 0.9 * left < middle < 1.1 * left and 0.97 * left <= high < 1.3 * left


@pytest.mark.slow
def test_the_depth_is_the_least_that_leaves_out_far_less_than_the_error(
    report: Report, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = {1: 0.01, 2: 0.002, 4: 1e-4, 8: 1e-6}
    biases = {depth: Band(x**2, (0.9 * x) ** 2, (1.1 * x) ** 2) for depth, x in left.items()}
    monkeypatch.setattr(tuning._Tuner, "depth_biases", lambda self: biases)
    search = tuner(mirrored(report), 0.01, scene=MIRRORS)
    assert search._depth(0.01) == {"settings.depth": 2}
    assert search._depth(0.002) == {"settings.depth": 4}
    # None leaves out far less than this error, but one leaves room for noise.
    assert search._depth(3e-6) == {"settings.depth": 8}
    # No depth is good enough: the render refuses the error, with a depth that would do.
    assert search._depth(1e-6) == {}
    # A smaller depth that is no faster is not taken.
    own = replace(search.report.default, seconds=Band(*[1e-9] * 3))
    assert replace(search, report=replace(search.report, default=own))._depth(0.01) == {"settings.depth": 8}
    # A scene without mirrors and glass has no such setting.
    assert tuner(report, 0.01)._depth(0.01) == {}


@pytest.mark.slow
def test_each_render_has_its_own_seed(known: None, monkeypatch: pytest.MonkeyPatch) -> None:
    seeds, adaptive = [], tuning.render_adaptively
    monkeypatch.setattr(
        tuning, "render_adaptively", lambda p, *more: (seeds.append(p.scene.settings.seed), adaptive(p, *more))[1]
    )
    tune(SOFT, error=0.05, progress=False)
    assert len(seeds) >= 5 and len(set(seeds[::2])) == len(seeds[::2])


@pytest.mark.slow
@pytest.mark.parametrize("asked", [{"error": 0.001}, {"time": 100.0}])
def test_without_noise_nothing_is_changed(asked: dict[str, float], monkeypatch: pytest.MonkeyPatch) -> None:
    """Also for a black picture. Samples until the time is spent would change nothing."""
    monkeypatch.setattr(study, "BUDGETS", (HURRY, HURRY))
    for scene in (FLAT, replace(FLAT, objects={}, background=(0.0, 0.0, 0.0))):
        tuned = tune(scene, progress=False, **asked)
        assert tuned.changed == {} and tuned.after.spp <= 128
        assert tuned.met or scene is not FLAT  # of a black picture nothing is known
