"""Passes are long enough that tracing is little of them, and short enough for what is left."""

from math import inf
from threading import Thread

import drjit as dr
import numpy as np
import pytest

from visray import clock
from visray import pass_timer as pace
from visray.camera import Camera
from visray.pass_timer import GROWTH, LONGEST_PASS, PASS_SECONDS, RUN_PER_TRACE, SAFE_SHARE, PassTimer
from visray.passes import empty_film, exposed_once
from visray.primitives import Sphere
from visray.scene.scene import Film, Scene, Settings
from visray.setup import prepare


def told(monkeypatch: pytest.MonkeyPatch, *passes: tuple[float, float, int]) -> PassTimer:
    """After passes of so many seconds of tracing and running, and samples."""
    found = PassTimer()
    for tracing, running, samples in passes:
        monkeypatch.setattr(clock, "now", lambda tracing=tracing: tracing)
        monkeypatch.setattr(pace, "timed_eval", lambda film, running=running: running)
        assert found.evaluate(0.0, samples, None) == running
    return found


def test_small_passes_do_not_tell_how_long_samples_take(monkeypatch: pytest.MonkeyPatch) -> None:
    found = told(monkeypatch, (0.01, 0.2, 1000), (0.03, 0.1, 5))
    assert found.sample_seconds == pytest.approx(2e-4) and found.trace_seconds == pytest.approx(0.03)
    assert found.predicted_seconds(500) == pytest.approx(0.03 + 0.1)
    found = told(monkeypatch, (0.01, 0.2, 1000), (0.03, 0.4, 1000))
    assert found.sample_seconds == pytest.approx(4e-4)


@pytest.mark.parametrize(
    ("tracing", "seconds"), [(0.01, PASS_SECONDS), (0.1, RUN_PER_TRACE * 0.1), (0.5, LONGEST_PASS), (2.0, 4.0)]
)
def test_passes_run_long_against_their_tracing(tracing: float, seconds: float) -> None:
    found = PassTimer(tracing, 1e-6, 10**6)
    assert found.next_seconds() == pytest.approx(seconds) and found.next_samples() == pytest.approx(seconds / 1e-6)
    assert found.next_seconds(1e3) == found.next_seconds(inf)
    # What is left is shared by tracing and samples; half of it is for those that are dearer than was thought.
    assert found.next_seconds(3 * tracing) == pytest.approx(min(SAFE_SHARE * 2 * tracing, seconds))
    assert found.next_seconds(1.99 * tracing) == found.next_seconds(0) == found.next_seconds(-1.0) == 0


def test_what_took_no_time_tells_little() -> None:
    assert PassTimer(0.01, 0.0, 7).next_samples() == GROWTH * 7
    assert PassTimer(0.01, 1e-12, 7).next_samples() == GROWTH * 7


@pytest.mark.parametrize("threads", [1, 2])
def test_the_rate_is_that_of_the_kernels_alone(monkeypatch: pytest.MonkeyPatch, threads: int) -> None:
    """As Dr.Jit's history has them, on one thread too, where they run before dr.eval returns: no compiling, no wait."""
    scene = Scene(
        film=Film(width=64, height=64),
        objects={"ball": Sphere()},
        settings=Settings(spp=256),
        camera=Camera(),
        lights={},
    )
    before, made, told = dr.thread_count(), prepare(scene), []
    monkeypatch.setattr(clock, "kernel_seconds", lambda kernels: told.append(list(kernels)) or 3.0)
    dr.set_thread_count(threads)
    try:
        film, found = empty_film(made), PassTimer()
        for count in (1, 2, 3):
            film = exposed_once(made, film, count, found)
            assert found.sample_seconds == pytest.approx(3 / 64**2)
    finally:
        dr.set_thread_count(before)
    # Of each pass its own kernels, the picture's among them, with the time that they ran.
    assert [sum(k["operation_count"] > 100 for k in kernels) for kernels in told] == [1, 1, 1]
    assert all(k["execution_time"] > 0 for kernels in told for k in kernels if k["operation_count"] > 100)
    assert np.isfinite(np.array(film.mean)).all()


def test_threads_do_not_take_each_other_s_kernels() -> None:
    """Dr.Jit's history is one for all threads: each pass of each thread has its own kernel and its seconds."""
    made = [
        prepare(
            Scene(
                film=Film(width=8, height=8),
                objects={"ball": Sphere()},
                settings=Settings(seed=i),
                camera=Camera(),
                lights={},
            )
        )
        for i in (0, 1)
    ]
    seen: list[list[float]] = [[], []]

    def passes(i: int) -> None:
        film = empty_film(made[i])
        for count in range(1, 41):
            timer = PassTimer()
            film = exposed_once(made[i], film, count, timer)
            seen[i].append(timer.sample_seconds)

    threads = [Thread(target=passes, args=(i,)) for i in (0, 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(len(x) == 40 and min(x) > 0 for x in seen)


def test_a_history_that_other_code_has_read_tells_no_rate_of_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    made = prepare(Scene(film=Film(width=8, height=8), objects={"ball": Sphere()}, camera=Camera(), lights={}))
    monkeypatch.setattr(dr, "kernel_history", lambda *_: [])
    timer = PassTimer()
    exposed_once(made, empty_film(made), 2, timer)
    assert timer.sample_seconds > 0


def test_kernels_ran_so_many_seconds() -> None:
    assert (
        clock.kernel_seconds([]) == 0
        and clock.kernel_seconds([{"execution_time": 250.0}, {"execution_time": 1.5}]) == 0.2515
    )


def test_whoever_counts_kernels_has_them_all() -> None:
    scene = Scene(
        film=Film(width=8, height=8), objects={"ball": Sphere()}, settings=Settings(spp=4), camera=Camera(), lights={}
    )
    made = prepare(scene)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        film = empty_film(made)
        for count in (1, 2, 3):
            film = exposed_once(made, film, count, PassTimer())
        kernels = dr.kernel_history([dr.KernelType.JIT])
    assert sum(k["operation_count"] > 100 for k in kernels) == 3
