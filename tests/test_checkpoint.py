"""Checkpoints: what goes on from one has the bits of what never stopped, and nothing else is taken for one."""

import os
import re
import warnings
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_adaptive import with_settings
from test_same_bits import FOREIGN, SAMPLERS, SOFT

import visray as vr
from visray import checkpoint as checkpoints
from visray import clock, passes
from visray.checkpoint import Checkpoint
from visray.errors import CheckpointWarning, UserError
from visray.moments import BLOCK
from visray.pass_timer import PassTimer
from visray.passes import empty_film, exposed_once
from visray.progress import Interrupts
from visray.setup import Prepared, prepare

# No whole number of blocks.
SPP = BLOCK + 5
SMALL = replace(SOFT, film=replace(SOFT.film, width=12, height=9))


class Crash(Exception):
    """The process ends."""


@cache
def made_of(sampler: str) -> Prepared:
    return prepare(with_settings(SMALL, sampler=sampler, spp=SPP))


@cache
def whole(sampler: str) -> vr.Image:
    return vr.render(made_of(sampler), progress=False)


def same(one: vr.Image, other: vr.Image) -> bool:
    """Whether two pictures have the same bits in all layers, and the same facts except times."""
    facts = [{k: v for k, v in x.metadata.items() if "seconds" not in k} for x in (one, other)]
    equal = {name: x.tobytes() for name, x in one.layers.items()} == {n: x.tobytes() for n, x in other.layers.items()}
    return equal and facts[0] == facts[1]


@pytest.fixture(params=["passes", "launches"])
def short(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Short work between two checkpoints: passes of a few samples of all pixels, or launches of a part of a pass."""
    samples = {"passes": 3 * 12 * 9, "launches": 60}[request.param]
    monkeypatch.setattr(passes, "first_pass_samples", lambda made: samples)
    monkeypatch.setattr(passes, "_least_samples", lambda made: samples)
    monkeypatch.setattr(PassTimer, "next_samples", lambda timer: samples)


@pytest.fixture
def always(monkeypatch: pytest.MonkeyPatch) -> None:
    """A checkpoint is written after each launch."""
    monkeypatch.setattr(Checkpoint, "every", 0.0)
    monkeypatch.setattr(checkpoints, "LARGEST_SHARE", np.inf)


@pytest.fixture
def crash(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Function after whose call the process ends with the nth writing."""
    write = checkpoints.write_arrays
    left = [np.inf]

    def writing(*arguments: Any) -> None:
        write(*arguments)
        left[0] -= 1
        if left[0] <= 0:
            raise Crash

    monkeypatch.setattr(checkpoints, "write_arrays", writing)
    return lambda n: left.__setitem__(0, n)


@pytest.mark.parametrize("sampler", [pytest.param(s, marks=[pytest.mark.slow] * (s != "sobol")) for s in SAMPLERS])
def test_a_crash_at_any_moment_loses_no_bit(
    sampler: str, short: None, always: None, crash: Any, tmp_path: Path
) -> None:
    path = tmp_path / "a.checkpoint"
    for after in (1, 5):
        crash(after)
        with pytest.raises(Crash):
            vr.render(made_of(sampler), progress=False, checkpoint=path)
        assert [p.name for p in tmp_path.iterdir()] == ["a.checkpoint"]
        # A second crash, and then the end.
        crash(1)
        with pytest.raises(Crash):
            vr.render(made_of(sampler), progress=False, checkpoint=path, resume=True)
        crash(np.inf)
        assert same(vr.render(made_of(sampler), progress=False, checkpoint=path, resume=True), whole(sampler))
        assert not any(tmp_path.iterdir())


@pytest.fixture
def begun(tmp_path: Path) -> Path:
    """The checkpoint of a picture with some samples."""
    made, path = made_of("sobol"), tmp_path / "a.checkpoint"
    with Checkpoint(path) as checkpoint:
        checkpoint.keep(exposed_once(made, empty_film(made), 5), now=True)
    return path


def resumed(path: Path, sampler: str = "sobol", **arguments: Any) -> vr.Image:
    return vr.render(made_of(sampler), progress=False, checkpoint=path, resume=True, **arguments)


def test_a_checkpoint_says_what_it_has(begun: Path) -> None:
    with Checkpoint(begun, resume=True) as held:
        assert held.found is None
        vr.render(made_of("sobol"), progress=False, checkpoint=held)
        assert held.found == 5


def test_a_checkpoint_of_another_moment_says_the_moment(tmp_path: Path) -> None:
    path = tmp_path / "a.checkpoint"
    track = vr.KeysTrack(address="lights.lamp.position.0", times=(0.0, 1.0), values=(0.0, 1.0))
    scene = replace(
        SMALL,
        lights={"lamp": vr.PointLight(position=(0.0, 3.0, 2.0))},
        animation=vr.Animation(duration=1.0, tracks={"x": track}),
    )
    with Checkpoint(path) as held:
        vr.render(scene, at=0.25, spp=2, progress=False, checkpoint=held)
        held.is_done = False
        made = prepare(vr.at(scene, 0.25))
        held.keep(exposed_once(made, empty_film(made), 2), now=True)
    for arguments, message in (
        ({"at": 0.5}, r"is of the moment 0\.25 s, not 0\.5 s; ask for"),
        ({}, r"is of the moment 0\.25 s, not 0\.0 s"),
        ({"at": 0.25, "seed": 5}, r"is of seed \d+, not 5"),
    ):
        with pytest.raises(UserError, match=message):
            vr.render(scene, spp=4, progress=False, checkpoint=path, resume=True, **arguments)
    went_on = vr.render(scene, spp=4, at=0.25, progress=False, checkpoint=path, resume=True)
    assert same(went_on, vr.render(scene, spp=4, at=0.25, progress=False))


def test_more_samples_than_were_asked_for_first(begun: Path) -> None:
    more = vr.render(made_of("sobol"), progress=False, spp=SPP + 9)
    assert same(resumed(begun, spp=SPP + 9), more)


def refused(path: Path, message: str, made: Any = None, **arguments: Any) -> None:
    """A render that goes on with the file is refused in one line that matches, and the file stays."""
    before = path.read_bytes() if path.is_file() else None
    with pytest.raises(UserError, match=message) as error:
        vr.render(made or made_of("sobol"), progress=False, checkpoint=path, **{"resume": True} | arguments)
    assert len(error.value.lines) == 1
    assert (path.read_bytes() if path.is_file() else None) == before
    assert not list(path.parent.glob("*.lock"))


def test_fewer_samples_than_there_are_is_refused(begun: Path) -> None:
    refused(begun, r"a\.checkpoint: has 5 samples of a pixel, more than 3; ask for 5 or more", spp=3)


@pytest.mark.parametrize("what", FOREIGN)
def test_a_checkpoint_of_another_picture_is_refused(what: str, begun: Path) -> None:
    other = FOREIGN[what](made_of("sobol").scene)
    this, that = made_of("sobol").scene, other
    film = f"{this.film.width} x {this.film.height}"
    differs = {
        "seed 7": "is of seed 0, not 7",
        "size 20 x 14": f"is of size {film}, not 20 x {that.film.height}",
        "sampler independent": "is of sampler sobol, not independent",
        "precision double": "is of precision single, not double",
    }.get(what, "is of another scene")
    refused(begun, rf"a\.checkpoint: {differs}; ask for what it was begun with, or delete it", prepare(other))


def test_a_checkpoint_of_another_goal_is_refused(begun: Path) -> None:
    message = r"a\.checkpoint: is of goal a number of samples, not error 0\.1; ask for what it was begun with"
    refused(begun, message, error=0.1)


def test_a_checkpoint_of_another_version_is_refused(begun: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("visray.picture_identity.__version__", "9.0.0")
    refused(begun, rf"a\.checkpoint: is of visray {re.escape(vr.__version__)}, not 9\.0\.0; ")


def test_what_is_no_checkpoint_is_refused(begun: Path) -> None:
    good = begun.read_bytes()
    for content in (b"", b"{}", good[: len(good) // 2], good[:-1], b"\x93NUMPY"):
        begun.write_bytes(content)
        refused(begun, r"a\.checkpoint: is no checkpoint of visray, or is damaged; delete it to begin anew")
    # One bit of the samples.
    numbers = np.array(exposed_once(made_of("sobol"), empty_film(made_of("sobol")), 5).moments.reference).tobytes()
    spot = good.index(numbers) + len(numbers) // 2
    begun.write_bytes(good[:spot] + bytes([good[spot] ^ 1]) + good[spot + 1 :])
    refused(begun, r"a\.checkpoint: is no checkpoint of visray, or is damaged")
    exposed_once(made_of("sobol"), empty_film(made_of("sobol")), 5).save(begun)
    refused(begun, r"a\.checkpoint: is of goal None, not a number of samples")


def test_a_folder_or_a_place_that_is_not_there_is_refused(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    refused(tmp_path / "folder", "this is a folder; give the name of a file in it")
    refused(tmp_path / "no" / "a.checkpoint", r"the folder '.*no' does not exist; create it first")


def test_samples_are_never_lost_by_beginning_anew(begun: Path) -> None:
    message = r"a\.checkpoint: is there already; go on with --resume \(resume=True\), or delete it first"
    refused(begun, message, resume=False)


def test_nothing_to_go_on_with_is_a_note(tmp_path: Path) -> None:
    with pytest.warns(CheckpointWarning, match=r"a\.checkpoint: is not there, so the picture begins anew"):
        image = resumed(tmp_path / "a.checkpoint")
    assert same(image, whole("sobol")) and not any(tmp_path.iterdir())


def test_arguments_that_go_with_no_checkpoint(tmp_path: Path) -> None:
    refused(tmp_path / "a.checkpoint", r"^time = 5: goes with no checkpoint: .*; give an error, or samples", time=5.0)
    with pytest.raises(UserError, match=r"^resume = True: needs the checkpoint to go on with; give its file"):
        vr.render(made_of("sobol"), resume=True)


def test_two_at_once(begun: Path) -> None:
    with Checkpoint(begun, resume=True):
        lock = begun.with_name("a.checkpoint.lock")
        assert lock.exists()
        with pytest.raises(UserError, match=r"a\.checkpoint: another process uses it; wait for its end, or stop it"):
            resumed(begun)
        assert lock.exists() and begun.exists()
    assert same(resumed(begun), whole("sobol"))


def test_it_is_written_twice_a_minute(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And less often if writing takes more than its share of the time."""
    now, film, takes, written = [0.0], empty_film(made_of("sobol")), [0.0], []
    monkeypatch.setattr(clock, "now", lambda: now[0])

    def write(*_: Any) -> None:
        written.append(now[0])
        now[0] += takes[0]

    monkeypatch.setattr(checkpoints, "write_arrays", write)
    with Checkpoint(tmp_path / "a.checkpoint") as checkpoint:
        for second in range(91):
            now[0] = float(second)
            checkpoint.keep(film)
        assert written == [30, 60, 90]
        takes[0] = 3.0
        for second in range(120, 250):
            now[0] = max(now[0], float(second))
            checkpoint.keep(film)
        assert written == [30, 60, 90, 120, 183, 246]


def test_a_full_disk_stops_nothing(begun: Path, short: None, always: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is said once; and once there is room, checkpoints are written again."""
    before, write, calls = begun.read_bytes(), checkpoints.write_arrays, []

    def full(path: Path, *arguments: Any) -> None:
        calls.append(path)
        if len(calls) == 3:
            assert begun.read_bytes() == before
            write(path, *arguments)
            assert begun.read_bytes() != before
            return
        raise UserError(f"{path}: cannot be written, the disk is full; free some space or write to another disk")

    monkeypatch.setattr(checkpoints, "write_arrays", full)
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        assert same(resumed(begun), whole("sobol"))
    told = [str(n.message) for n in notes if n.category is CheckpointWarning]
    assert len(told) == 1 and re.search(r"cannot be written, the disk is full; .*; the render goes on", told[0])
    assert len(calls) > 3


@pytest.mark.filterwarnings("ignore::visray.errors.StoppedWarning")
def test_ctrl_c_keeps_the_samples(tmp_path: Path, short: None, monkeypatch: pytest.MonkeyPatch) -> None:
    path, asked = tmp_path / "a.checkpoint", []

    def enter(interrupts: Interrupts) -> Interrupts:
        asked.append(interrupts)
        interrupts.requested = len(asked) == 1
        return interrupts

    monkeypatch.setattr(Interrupts, "__enter__", enter)
    with pytest.warns(CheckpointWarning, match=r"a\.checkpoint: keeps the samples; --resume goes on with them"):
        image = vr.render(made_of("sobol"), progress=False, checkpoint=path)
    assert image.metadata["interrupted"] and os.listdir(tmp_path) == ["a.checkpoint"]
    assert same(resumed(path), whole("sobol")) and not any(tmp_path.iterdir())


def test_it_stays_until_the_picture_is_written(begun: Path) -> None:
    """The caller who holds it ends it: with an exception, nothing is lost."""
    with pytest.raises(Crash), Checkpoint(begun, resume=True) as checkpoint:
        assert same(vr.render(made_of("sobol"), progress=False, checkpoint=checkpoint), whole("sobol"))
        assert begun.exists()
        raise Crash
    assert begun.exists()
    with Checkpoint(begun, resume=True) as checkpoint:
        vr.render(made_of("sobol"), progress=False, checkpoint=checkpoint)
        assert begun.exists()
    assert not begun.exists()
