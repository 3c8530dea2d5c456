"""Renders of the command line that are killed, stopped, or find no room on the disk; what is left, and what goes on."""

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from test_adaptive import SCENES

import visray as vr
from visray.checkpoint import Checkpoint

# The command line, with short passes, and a checkpoint after each. It says when the first one is written.
DRIVER = """
import sys
import visray
from visray import checkpoint, passes, pass_timer
from visray.adaptive import lane_buffer
from visray.cli import main

checkpoint.Checkpoint.every, checkpoint.LARGEST_SHARE = 0.0, 1e9
pass_timer.PassTimer.next_samples = lambda timer: 60_000
passes.first_pass_samples = lane_buffer.first_pass_samples = lambda made: 60_000
write = checkpoint.write_arrays

def telling(*arguments):
    write(*arguments)
    print("kept", flush=True)

checkpoint.write_arrays = telling
sys.exit(main(sys.argv[1:]))
"""
GOALS = {"samples": ("--spp", "200"), "error": ("--error", "0.0025")}
EACH_GOAL = pytest.mark.parametrize("goal", GOALS)
OLD = b"what was there before"


def command(goal: str, folder: Path, *more: str) -> list[str]:
    scene = str(SCENES / "sphere.json")
    tokens = ["render", scene, "-o", str(folder / "a.exr"), "--size", "160x120", *GOALS[goal], *more]
    return [sys.executable, "-c", DRIVER, *tokens]


def ran(goal: str, folder: Path, *more: str, **options: Any) -> subprocess.CompletedProcess:
    return subprocess.run(command(goal, folder, *more), capture_output=True, text=True, timeout=300, **options)


def begun(goal: str, folder: Path) -> subprocess.Popen:
    """A render that has just written its first checkpoint."""
    process = subprocess.Popen(
        command(goal, folder, "--checkpoint"), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "kept\n"
    return process


def layers(path: Path) -> dict[str, bytes]:
    return {name: x.tobytes() for name, x in vr.Image.read(path).layers.items()}


@cache
def whole(goal: str) -> tuple[dict[str, bytes], float, float]:
    """Layers of the picture of a render that is left alone, and the seconds until its first checkpoint, and its end."""
    with TemporaryDirectory() as name:
        folder, start = Path(name), time.perf_counter()
        process = begun(goal, folder)
        first = time.perf_counter() - start
        process.communicate(timeout=300)
        assert process.returncode == 0 and os.listdir(folder) == ["a.exr"]
        return layers(folder / "a.exr"), first, time.perf_counter() - start


def killed(goal: str, folder: Path, rng: np.random.Generator, *more: str) -> None:
    """A render that is killed at a random moment, so that it can do nothing about it: at any time, or soon after it has
    written one of its first checkpoints."""
    _, first, seconds = whole(goal)
    process = subprocess.Popen(command(goal, folder, *more), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    if checkpoints := int(rng.integers(4)):
        for _ in range(checkpoints):
            process.stdout.readline()
        time.sleep(rng.uniform(0, 0.2 * (seconds - first)))
    else:
        time.sleep(rng.uniform(0.8 * first, 1.02 * seconds))
    process.kill()
    process.communicate()


def killed_and_resumed(goal: str, seed: int, folder: Path) -> bool:
    """Kills a render at a random moment, and goes on. Returns whether there was a checkpoint."""
    rng = np.random.default_rng(seed)
    expected = whole(goal)[0]
    (folder / "a.exr").write_bytes(OLD)
    killed(goal, folder, rng, "--checkpoint")
    if rng.random() < 0.3:
        killed(goal, folder, rng, "--resume")
    content = (folder / "a.exr").read_bytes()
    assert content == OLD or layers(folder / "a.exr") == expected
    was_kept = (folder / "a.exr.checkpoint").exists()
    done = ran(goal, folder, "--resume")
    assert done.returncode == 0, done.stderr
    assert was_kept != ("begins anew" in done.stderr)
    assert layers(folder / "a.exr") == expected and os.listdir(folder) == ["a.exr"]
    return was_kept


def test_a_killed_render_goes_on(tmp_path: Path) -> None:
    """Killed after its first checkpoint; what goes on has the bits of a render in Python."""
    process = begun("samples", tmp_path)
    process.kill()
    process.communicate()
    assert (tmp_path / "a.exr.checkpoint").exists() and not (tmp_path / "a.exr").exists()
    assert ran("samples", tmp_path, "--resume").returncode == 0
    vr.render(str(SCENES / "sphere.json"), size=(160, 120), spp=200, progress=False).write(tmp_path / "b.exr")
    assert layers(tmp_path / "a.exr") == layers(tmp_path / "b.exr")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_killed_at_a_random_moment(seed: int, tmp_path: Path) -> None:
    """The old file is whole, or the new one; and what goes on has the same bits."""
    killed_and_resumed(list(GOALS)[seed % 2], seed, tmp_path)


@pytest.mark.nightly
@EACH_GOAL
def test_killed_at_many_moments(goal: str, tmp_path: Path) -> None:
    kept = 0
    for seed in range(25):
        folder = tmp_path / str(seed)
        folder.mkdir()
        kept += killed_and_resumed(goal, 100 + seed, folder)
    assert kept > 0


@pytest.mark.slow
@EACH_GOAL
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_stopped_and_gone_on_with(goal: str, number: int, code: int, tmp_path: Path) -> None:
    process = begun(goal, tmp_path)
    process.send_signal(signal.SIGSTOP)
    # Meanwhile, nobody else goes on with it.
    second = ran(goal, tmp_path, "--resume")
    refusal = f"visray: {tmp_path}/a.exr.checkpoint: another process uses it; wait for its end, or stop it\n"
    assert second.returncode == 2 and second.stderr == refusal
    process.send_signal(number)
    process.send_signal(signal.SIGCONT)
    _, err = process.communicate(timeout=100)
    assert process.returncode == code, err
    assert "a.exr.checkpoint: keeps the samples; --resume goes on with them" in err
    assert sorted(os.listdir(tmp_path)) == ["a.exr", "a.exr.checkpoint"]
    again = ran(goal, tmp_path, "--checkpoint")
    assert again.returncode == 2 and "is there already; go on with --resume" in again.stderr
    done = ran(goal, tmp_path, "--resume")
    assert done.returncode == 0 and layers(tmp_path / "a.exr") == whole(goal)[0]
    assert os.listdir(tmp_path) == ["a.exr"]


def limited(size: int) -> Callable[[], None]:
    """Function that limits the size of files in a process: what is longer finds the disk full."""
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


@pytest.mark.slow
@EACH_GOAL
def test_no_room_for_checkpoints(goal: str, tmp_path: Path) -> None:
    """The render goes on; and the checkpoint that was there is whole."""
    expected, process = whole(goal)[0], begun(goal, tmp_path)
    process.kill()
    process.communicate()
    path = tmp_path / "a.exr.checkpoint"
    before = path.read_bytes()
    # There is room for the picture, which is smaller than its film; and then not even for that.
    for room, code in ((50_000, 2), (len(before) - 100_000, 0)):
        done = ran(goal, tmp_path, "--resume", preexec_fn=limited(room))
        assert done.returncode == code, done.stderr
        told = [line for line in done.stderr.splitlines() if "the render goes on" in line]
        assert len(told) == 1 and "a.exr.checkpoint: cannot be written, the file would be larger than" in told[0]
        if code:
            assert os.listdir(tmp_path) == ["a.exr.checkpoint"] and path.read_bytes() == before
    assert os.listdir(tmp_path) == ["a.exr"] and layers(tmp_path / "a.exr") == expected


def test_a_lock_that_a_killed_process_left_is_free(tmp_path: Path) -> None:
    path = tmp_path / "a.checkpoint"
    code = "import os, sys\nfrom visray.checkpoint import Checkpoint\n"
    code += "with Checkpoint(sys.argv[1]):\n    os.kill(os.getpid(), 9)"
    assert subprocess.run([sys.executable, "-c", code, str(path)]).returncode == -signal.SIGKILL
    assert os.listdir(tmp_path) == ["a.checkpoint.lock"]
    with Checkpoint(path):
        assert os.listdir(tmp_path) == ["a.checkpoint.lock"]
    assert not os.listdir(tmp_path)
