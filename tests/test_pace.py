"""Passes are long enough that tracing is little of them, and short enough for what is left. The clock is made up."""

from collections.abc import Iterator
from math import inf

import pytest

from visray import pace
from visray.pace import GROWTH, PASS_SECONDS, SURE, TRACED, Pace


def told(monkeypatch: pytest.MonkeyPatch, *passes: tuple[float, float, float, int]) -> Pace:
    """After passes of so many seconds of tracing, compiling and running, and samples."""
    now = [0.0]
    found = Pace()

    def ticks(tracing: float, compiling: float, running: float) -> Iterator[float]:
        for seconds in (tracing, compiling, running):
            now[0] += seconds
            yield now[0]

    monkeypatch.setattr(pace.dr, "eval", lambda *_: None)
    monkeypatch.setattr(pace.dr, "sync_thread", lambda: None)
    for *seconds, samples in passes:
        clock = ticks(*seconds)
        begun = now[0]
        monkeypatch.setattr(pace.time, "perf_counter", lambda clock=clock: next(clock))
        found.evaluated(begun, samples, None)
        # The clock is not looked at where the pass tells nothing.
        now[0] = begun + sum(seconds)
    return found


def test_compiling_counts_for_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    found = told(monkeypatch, (0.01, 5.0, 0.2, 1000))
    assert found.tracing == pytest.approx(0.01) and found.rate == pytest.approx(2e-4)
    assert found.seconds(500) == pytest.approx(0.01 + 0.1)


def test_small_passes_do_not_tell_how_long_samples_take(monkeypatch: pytest.MonkeyPatch) -> None:
    found = told(monkeypatch, (0.01, 0, 0.2, 1000), (0.03, 0, 0.1, 5))
    assert found.rate == pytest.approx(2e-4) and found.tracing == pytest.approx(0.03)
    found = told(monkeypatch, (0.01, 0, 0.2, 1000), (0.03, 0, 0.4, 1000))
    assert found.rate == pytest.approx(4e-4)


@pytest.mark.parametrize(("tracing", "seconds"), [(0.01, PASS_SECONDS), (0.2, TRACED * 0.2)])
def test_passes_run_long_against_their_tracing(tracing: float, seconds: float) -> None:
    found = Pace(tracing, 1e-6, 10**6)
    assert found.room() == pytest.approx(seconds / 1e-6)
    assert found.room(1e3) == found.room(inf)
    # What is left is shared by tracing and samples.
    left = 3 * tracing
    assert found.room(left) == pytest.approx(min(SURE * 2 * tracing, seconds) / 1e-6)
    assert found.room(1.99 * tracing) == found.room(0) == found.room(-1.0) == 0


def test_what_took_no_time_tells_little() -> None:
    assert Pace(0.01, 0.0, 7).room() == GROWTH * 7
    assert Pace(0.01, 1e-12, 7).room() == GROWTH * 7
