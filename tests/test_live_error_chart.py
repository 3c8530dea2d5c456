"""The error of a live picture against time: what is known of it, and when it will be small enough."""

import numpy as np
import pytest

from visray.live.error_chart import MOST_POINTS, Course, begins_anew, chart, decades, duration, ends, percent
from visray.live.frame import Frame

NOTHING = np.zeros((1, 1, 3), np.uint8)


def frame(seconds: float, error: float | None, samples: float, **more: object) -> Frame:
    """A state of a picture."""
    values = {"grain": 1, "finished": False, "change": 1} | more
    return Frame(NOTHING, (1, 1), samples=samples, error=error, seconds=seconds, **values)


def course(*states: tuple[float, float, float]) -> Course:
    """A course of states, each with its seconds, error and samples."""
    result = Course()
    for state in states:
        result.add(frame(*state))
    return result


def test_the_seconds_that_are_left() -> None:
    """4 samples in 1 s; 16 samples have an error of 2 %, so 1 % needs 48 more, which take 12 s."""
    known = course((1.0, 0.04, 4.0), (4.0, 0.02, 16.0))
    assert known.left(0.01) == pytest.approx(12.0)
    assert known.text(0.01) == "Error 2 % after 4 s; 1 % in about 12 s more."
    assert known.left(0.03) == 0.0


def test_what_is_not_known_is_not_said() -> None:
    assert Course().text(0.01) == "The error is not known yet." and Course().left(0.01) is None
    assert course((0.5, 0.25, 2.0)).text(0.01) == "Error 25 % after 0.5 s."
    same = course((0.5, 0.25, 2.0), (0.7, 0.25, 2.0))
    assert same.left(0.01) is None and same.text(0.01) == "Error 25 % after 0.7 s."
    done = course((1.0, 0.04, 4.0))
    done.add(frame(2.0, 0.009, 80.0, finished=True))
    assert done.text(0.01) == "Error 0.9 % after 2 s; finished." and done.left(0.01) is None


def test_states_without_an_error_are_no_points() -> None:
    known = Course()
    for state in (frame(0.1, None, 0.25, grain=2), frame(0.2, None, 1.0), frame(0.3, 0.0, 2.0), frame(0.4, 0.5, 2.0)):
        known.add(state)
    assert (known.seconds, known.errors, known.samples) == ([0.4], [0.5], [2.0])


def test_points_are_not_more_than_a_chart_needs() -> None:
    known = course(*((1.0 + i, 1 / (1.0 + i), float(i)) for i in range(MOST_POINTS + 1)))
    assert len(known.seconds) == len(known.errors) == len(known.samples) == MOST_POINTS // 2 + 1
    assert known.seconds[:2] == [1.0, 3.0] and known.seconds[-1] == MOST_POINTS + 1


def test_a_new_picture_begins_a_new_course() -> None:
    before = frame(2.0, 0.1, 4.0)
    assert not begins_anew(before, frame(2.5, 0.09, 5.0))
    assert begins_anew(before, frame(0.1, None, 0.25, grain=2))  # the mouse has moved
    assert begins_anew(before, frame(2.5, None, 0.25, grain=2))
    assert begins_anew(before, frame(3.0, 0.1, 4.0, change=2))  # a slider has


@pytest.mark.parametrize(
    ("values", "low", "high"),
    [
        ((0.011, 0.3), 0.01, 0.5),
        ((1.0, 10.0), 1.0, 10.0),
        ((2.0, 5.0), 2.0, 5.0),
        ((999.9999999999999,), 1000.0, 2000.0),
    ],
)
def test_scales_end_at_round_numbers(values: tuple[float, ...], low: float, high: float) -> None:
    assert ends(np.array(values)) == pytest.approx((low, high))


def test_times_have_whole_decades() -> None:
    assert decades(np.array([0.3, 4.0])) == pytest.approx((0.1, 10.0))
    assert decades(np.array([1.0])) == (1.0, 10.0)


def test_the_chart_has_the_line_of_what_is_asked_for() -> None:
    made = chart(course((1.0, 0.04, 4.0), (4.0, 0.02, 16.0)), 0.01)
    seconds, errors, goal = made["data"]
    np.testing.assert_allclose([seconds, errors, goal], [[1, 4], [4, 2], [1, 1]])
    assert made["scales"]["y"]["range"] == pytest.approx((0.5, 5.0))
    assert made["scales"]["x"]["range"] == pytest.approx((1.0, 10.0))
    assert made["scales"]["x"]["distr"] == made["scales"]["y"]["distr"] == 3  # logarithmic


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.0123, "0.012 s"), (7.26, "7.3 s"), (99.4, "99 s"), (150, "2.5 min"), (7300, "2 h")]
)
def test_durations(seconds: float, text: str) -> None:
    assert duration(seconds) == text


@pytest.mark.parametrize(("share", "text"), [(0.0098, "0.98 %"), (0.1234, "12 %"), (1.5, "150 %")])
def test_percentages(share: float, text: str) -> None:
    assert percent(share) == text
