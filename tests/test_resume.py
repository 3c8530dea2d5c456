"""Renders to an error, and renders of the command line, that are ended anywhere and go on to the same bits."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_adaptive import EDGES, hall
from test_checkpoint import Crash, always, crash, same  # noqa: F401 - fixtures
from test_small_objects import mirrored, spark
from virtual import Machine

import visray as vr
from visray.adaptive import lane_buffer
from visray.adaptive.error_floor import Files
from visray.errors import CheckpointWarning, UserError
from visray.pass_timer import PassTimer
from visray.progress import Interrupts
from visray.scene.scene import Film
from visray.setup import Prepared, prepare

TINY = Film(width=16, height=12)
# Scenes whose decisions hang on different results, with an error to reach: of plain samples, of small objects that have
# samples of their own, of light that may be hidden, and of the depth of mirrors.
GOALS = {
    "edges": (replace(EDGES, film=TINY), 0.02),
    "small objects": (spark(), 0.05),
    "hidden light": (replace(mirrored(), film=TINY), 0.5),
    "mirrors": (hall(8, 16, 12), 0.1),
    "black": (replace(EDGES, film=TINY, lights={}, ambient=(0.0,) * 3, background=(0.0,) * 3), 0.1),
}  # fmt: skip
EACH_GOAL = pytest.mark.parametrize("what", GOALS)
FILES = Files(("a.png",))


@cache
def made_of(what: str) -> Prepared:
    scene = GOALS[what][0]
    return prepare(replace(scene, lights=scene.lights or {}, settings=replace(scene.settings, sampler="sobol")))


def pursued(what: str, **more: Any) -> vr.Image:
    return vr.render(made_of(what), progress=False, error=GOALS[what][1], files=FILES, **more)


@cache
def whole(what: str) -> vr.Image:
    return pursued(what)


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Passes of few samples. Whether first samples are quick is decided as before."""
    monkeypatch.setattr(PassTimer, "next_samples", lambda timer: 3000)
    monkeypatch.setattr(lane_buffer, "first_pass_samples", lambda made: 150)


def restarted(what: str, path: Path, crash: Any, after: int) -> tuple[vr.Image, int]:  # noqa: F811
    """The picture of a render that crashes whenever it has written `after` checkpoints; and how often that was."""
    for crashes in range(1000):
        crash(after)
        try:
            return pursued(what, checkpoint=path, resume=True), crashes
        except Crash:
            assert path.exists()
    raise AssertionError("it comes to no end")


@pytest.mark.parametrize("after", [pytest.param(n, marks=[pytest.mark.slow] * (n != 4)) for n in (1, 2, 4)])
@EACH_GOAL
@pytest.mark.filterwarnings("ignore")
def test_crashes_lose_no_bit(
    what: str, after: int, short: None, always: None, crash: Any, tmp_path: Path  # noqa: F811
) -> None:  # fmt: skip
    """Also of the decisions: the facts are the same, among them the forecast and the interval of the error."""
    image, crashes = restarted(what, tmp_path / "a.checkpoint", crash, after)
    assert crashes
    assert same(image, whole(what)) and not any(tmp_path.iterdir())


class AfterSome(Interrupts):
    """Ctrl-C, when it is asked about for the nth time."""

    left, was = np.inf, False

    @property
    def requested(self) -> bool:
        AfterSome.left -= 1
        self.was = self.was or AfterSome.left <= 0
        return self.was

    @requested.setter
    def requested(self, value: bool) -> None:
        self.was = value


@EACH_GOAL
@pytest.mark.filterwarnings("ignore")
def test_ctrl_c_at_any_moment(what: str, short: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is decided after Ctrl-C, by fewer samples, does not count when the render goes on; again and again."""
    path, uninterrupted = tmp_path / "a.checkpoint", whole(what)
    monkeypatch.setattr("visray.renderer.Interrupts", AfterSome)
    for question in range(3, 1000, 2):
        AfterSome.left = question
        image = pursued(what, checkpoint=path, resume=True)
        if not path.exists():
            break
        assert image.metadata["interrupted"]
    # The last one came when all samples were taken.
    image.metadata["interrupted"] = 0
    assert question > 8 and same(image, uninterrupted)


def test_ctrl_c_before_there_is_a_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """There is nothing to write, but the samples are kept."""
    path, made = tmp_path / "a.checkpoint", prepare(replace(EDGES, film=Film(width=200, height=150)))
    expected = vr.render(made, progress=False, error=0.05)
    with monkeypatch.context() as patch:
        Machine(patch, rate=2e-4)
        patch.setattr(lane_buffer, "first_pass_samples", lambda made: 2**12)
        patch.setattr("visray.sampled_layers.first_hit_layers", lambda *_: {})
        patch.setattr("visray.renderer.Interrupts", AfterSome)
        AfterSome.left = 2
        note = pytest.warns(CheckpointWarning, match=r"a\.checkpoint: keeps the samples; --resume goes on with them")
        with note, pytest.raises(KeyboardInterrupt, match=r"^stopped before there was a picture$"):
            vr.render(made, progress=False, error=0.05, checkpoint=path)
    with np.load(path) as file:
        counts = file["film.pixels.counts"]
        assert counts.any() and not counts.all()
    assert same(vr.render(made, progress=False, error=0.05, checkpoint=path, resume=True), expected)


@pytest.mark.filterwarnings("ignore::visray.errors.StoppedWarning")
def test_another_goal_is_refused(tmp_path: Path, short: None, always: None, crash: Any) -> None:  # noqa: F811
    path = tmp_path / "a.checkpoint"
    crash(3)
    with pytest.raises(Crash):
        pursued("edges", checkpoint=path)
    kept = path.read_bytes()
    for more, message in (
        ({"error": 0.01}, r"is of goal error 0\.02, not error 0\.01; ask for what it was begun with"),
        ({"error": None}, r"is of goal error 0\.02, not a number of samples"),
        ({"files": Files(("a.exr", "a.png"))}, r"is of files png, gamma srgb, exposure 0, not exr png, gamma srgb"),
        ({"seed": 4}, r"is of seed 0, not 4"),
    ):
        arguments = {"error": 0.02, "files": FILES, "checkpoint": path, "resume": True, "progress": False} | more
        with pytest.raises(UserError, match=rf"a\.checkpoint: {message}") as error:
            vr.render(made_of("edges"), **arguments)
        assert len(error.value.lines) == 1 and path.read_bytes() == kept


def test_nothing_to_go_on_with_is_a_note(tmp_path: Path) -> None:
    with pytest.warns(CheckpointWarning, match=r"a\.checkpoint: is not there, so the picture begins anew"):
        image = pursued("edges", checkpoint=tmp_path / "a.checkpoint", resume=True)
    assert same(image, whole("edges")) and not any(tmp_path.iterdir())
