"""What each effect costs: kernels that hold nothing else differently, costs that are there, and noise that is said."""

import json
import signal
from dataclasses import replace
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
from test_features import ALL, FULL, MATTE, STEPS, folder, kernel

from visray.cli import main
from visray.errors import UserError
from visray.feature_rules import RULES
from visray.features import features
from visray.passes import expose
from visray.scene.load import dump
from visray.scene.scene import Scene
from visray.setup import prepare
from visray.study import ablation, spread
from visray.study.ablation import MOST_SAMPLES, RENDER_SECONDS, cost, fitting_samples
from visray.study.effect_costs import Cost
from visray.study.leaving_out import prepared_without
from visray.study.spread import FEWEST_RUNS, Spread
from visray.study.timed_picture import LONGEST_SIDE, UncachedPicture, marked_columns, reduced_size

__all__ = ["folder"]  # the fixture


def small(scene: Scene) -> Scene:
    return replace(scene, film=replace(scene.film, width=8, height=6))


@pytest.mark.parametrize("effect", STEPS)
def test_what_is_left_out_leaves_the_kernel_of_the_scene_without_it(effect: str) -> None:
    """Instruction by instruction the kernel of the scene that does not call for the effect."""
    before, after = (change(MATTE) for change in STEPS[effect])
    assert kernel(prepared_without(after, effect))["hash"] == kernel(prepare(before))["hash"]


def test_effects_are_left_out_with_those_that_refine_them() -> None:
    full = ALL(FULL)
    expected = {
        "ambient": {"sky occlusion", "near occlusion"},
        "specular": {"fractional shininess"},
        "shadows": {"coloured shadows"},
        "refraction": {"nested media"},
        "textures": {"bilinear"},
        "background": {"environment map"},
    }
    # Area lights become point lights, of which nothing is seen, whatever is visible of the lights that they replace.
    replaced = {"area lights": {"visible lights"}}
    for effect in features(full).names():
        lost = set(features(full).names()) - set(prepared_without(full, effect).features.names())
        assert lost == {effect} | (expected | replaced).get(effect, set())
    assert {r.name for r in RULES if r.needs} == set().union(*expected.values())


def test_the_mark_moves_no_pixel_and_makes_the_kernel_new() -> None:
    made = prepare(small(MATTE))
    one, other = UncachedPicture.of(made), UncachedPicture.of(made)
    assert one.mark != other.mark and one.mark >= 2**31 > made.scene.film.width
    assert all(p.compiled()[1] > 0 for p in (one, other))
    # The second time it is the same kernel: nothing is compiled.
    assert max(one.kernels(), key=lambda k: k["operation_count"])["backend_time"] == 0
    other = replace(made, x=marked_columns(made.a, made.x, one.mark))
    np.testing.assert_array_equal(np.array(expose(other)[0].mean), np.array(expose(made)[0].mean))


def test_spreads() -> None:
    """The sign test: with 8 values the median is between the least and the greatest but for 2 of 2^8 cases."""
    assert Spread.of([3.0, 1.0, 2.0, 8.0, 7.0, 6.0, 5.0, 4.0]) == Spread(4.5, 1.0, 8.0)
    assert Spread.of(list(range(100))) == Spread(49.5, 36, 63)
    with pytest.raises(ValueError):
        Spread.of([1.0] * (FEWEST_RUNS - 1))
    rng = np.random.default_rng(0)
    caught = [s.low <= 1 <= s.high for s in (Spread.of(list(v)) for v in rng.normal(1, 3, (2000, 15)))]
    # 15 values: it misses with a chance of 0.0074, so up to 15 in 2000 are likely, and 35 are not once in 10^5 times.
    p, n = 0.0074, 2000
    assert sum(caught) >= n - (n * p + NormalDist().inv_cdf(1 - 1e-5) * (n * p) ** 0.5)


def test_a_cost_says_where_it_is_noise() -> None:
    noise = Cost(12, Spread(0.001, -0.0004, 0.002), Spread(-0.3, -0.5, 0.1))
    assert noise.texts() == ("12", "< 2.00", "< 0.50")
    assert noise.as_json()["seconds_in_noise"] and noise.as_json()["compile_seconds_in_noise"]
    clear = Cost(1200, Spread(0.0021, 0.002, 0.0024), Spread(-0.3, -0.5, -0.1))
    assert clear.texts() == ("1,200", "2.10 ± 0.30", "-0.30 ± 0.20")
    assert not (clear.as_json()["seconds_in_noise"] or clear.as_json()["compile_seconds_in_noise"])


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["diffuse", "scatter"])
def test_the_report_of_a_scene_with_one_effect(effect: str) -> None:
    scene = small(STEPS[effect][1](MATTE))
    report = cost(scene, spp=2, runs=FEWEST_RUNS)
    assert list(report.costs) == features(scene).names()
    # With the mark that keeps a kernel out of the cache. It takes a few operations, fewer where nothing is shaded.
    full, without = (UncachedPicture.of(prepare(s)).compiled()[0] for s in (scene, small(STEPS[effect][0](MATTE))))
    assert report.costs[effect].operations == full - without
    assert report.total.seconds.low > 0 and report.total.compile_seconds.low > 0
    assert report.total.operations > report.costs[effect].operations


def test_the_report_of_a_scene_without_any_effect() -> None:
    report = cost(replace(small(MATTE), objects={}), spp=2, runs=FEWEST_RUNS)
    assert report.costs == {} and report.total.operations > 0
    assert not any(f["on"] for f in report.as_json()["features"])


@pytest.mark.slow
def test_the_report_of_a_scene_with_all_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    # Two runs, where a user is asked for eight: tracing takes the time.
    monkeypatch.setattr(ablation, "FEWEST_RUNS", 2)
    monkeypatch.setattr(spread, "CHANCE", 0.5)
    scene = small(ALL(replace(FULL, objects={name: FULL.objects[name] for name in ("floor", "ball", "box")})))
    report = cost(scene, spp=2, runs=2)
    found = json.loads(json.dumps(report.as_json(), allow_nan=False))
    assert found["scene_hash"] == scene.hash()
    assert found["picture"] == {"width": 8, "height": 6, "spp": 2, "runs": 2}
    assert [f["name"] for f in found["features"]] == [r.name for r in RULES]
    numbers = {"operations", "seconds", "seconds_spread", "seconds_in_noise", "compile_seconds",
               "compile_seconds_spread", "compile_seconds_in_noise", "left_out_with"}  # fmt: skip
    assert set(found["total"]) == numbers
    for f in found["features"]:
        assert set(f) == {"name", "on", "reason"} | (numbers if f["on"] else set())
        assert not f["on"] or f["operations"] > 0
    assert [f["name"] for f in found["features"] if not f["on"]] == ["coverage"]


@pytest.mark.parametrize("size", [(640, 480), (100, 5000), (256, 256), (3, 2), (5000, 1)])
def test_reduced_size(size: tuple[int, int]) -> None:
    width, height = reduced_size(*size)
    scale = min(1, LONGEST_SIDE / max(size))
    assert max(width, height) == min(LONGEST_SIDE, max(size)) and min(width, height) >= 1
    assert abs(width - scale * size[0]) <= 1 and abs(height - scale * size[1]) <= 1


@pytest.fixture
def file(tmp_path: Path) -> str:
    """A file of a scene of which a picture is made in no time."""
    path = tmp_path / "matte.json"
    path.write_text(dump(small(MATTE)))
    return str(path)


def test_on_the_command_line(file: str, capsys: pytest.CaptureFixture) -> None:
    tokens = ["explain", file, "--cost", "--spp", "1", "--runs", str(FEWEST_RUNS)]
    assert main(tokens) == 0
    text = capsys.readouterr().out
    heads = "operations", "rendering, ms", "compiling, s"
    for word in ("8 x 6 pixels with 1 sample per pixel", *heads, "the whole picture"):
        assert word in text
    assert main([*tokens, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [f["name"] for f in found["features"] if "operations" in f] == ["diffuse"]
    assert main(["explain", file, "--json"]) == 0
    plain = json.loads(capsys.readouterr().out)
    strip = [{k: f[k] for k in ("name", "on", "reason")} for f in found["features"]]
    assert (plain["scene_hash"], plain["features"]) == (found["scene_hash"], strip)


@pytest.mark.parametrize(
    ("extra", "hint"),
    [(["--runs", "3"], f"at least {FEWEST_RUNS}"), (["--spp", "0"], "settings.spp"), (["--runs", "many"], "many")],
)
def test_bad_input(file: str, extra: list[str], hint: str, capsys: pytest.CaptureFixture) -> None:
    assert main(["explain", file, "--cost", *extra]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and hint in err


def test_a_picture_has_as_many_samples_as_run_in_no_time(monkeypatch: pytest.MonkeyPatch) -> None:
    for seconds, samples in ((1e-6, MOST_SAMPLES), (RENDER_SECONDS / 5.5, 5), (10 * RENDER_SECONDS, 1)):
        monkeypatch.setattr(UncachedPicture, "seconds", lambda _, s=seconds: s)
        assert fitting_samples(small(MATTE)) == samples
        if samples == 5:
            assert cost(small(MATTE)).spp == 5 and cost(small(MATTE), spp=7).spp == 7


def test_runs_must_be_a_number() -> None:
    with pytest.raises(UserError, match="whole number"):
        cost(MATTE, runs=9.5)


def test_ctrl_c_stops_between_two_pictures(
    file: str, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    handler = signal.getsignal(signal.SIGINT)
    made = []

    def seconds(picture: UncachedPicture) -> float:
        if made:
            signal.raise_signal(signal.SIGINT)
        made.append(picture.kernels())
        return RENDER_SECONDS

    monkeypatch.setattr(UncachedPicture, "seconds", seconds)
    assert main(["explain", file, "--cost"]) == 130
    out, err = capsys.readouterr()
    assert out == "" and "stopped" in err and len(made) == 2
    assert signal.getsignal(signal.SIGINT) is handler
