"""The part of the page of a live picture that shows its error against time.

All browsers share the chart. It is about the browser whose picture began last, which is the one that somebody uses.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from visray import clock
from visray.live.client import Client
from visray.live.frame import Frame
from visray.live.live import Live, escaped
from visray.live.tabs import tab

# Seconds between two states of the chart.
PAUSE = 0.2
# Number of points that are kept. If there are more, every second one is dropped.
MOST_POINTS = 400
# Height of the chart in pixels.
HEIGHT = 180


@dataclass
class Course:
    """The course of the error of one picture.

    seconds, errors, samples: of each state whose error is known: seconds since the change, the error, and mean samples
        per pixel
    finished: whether it is finished
    """

    seconds: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    samples: list[float] = field(default_factory=list)
    finished: bool = False

    def add(self, frame: Frame) -> None:
        """Adds a state."""
        self.finished = frame.finished
        if frame.error is None or not (frame.error > 0 and frame.seconds > 0):
            return
        if len(self.seconds) == MOST_POINTS:
            for values in (self.seconds, self.errors, self.samples):
                del values[1::2]
        self.seconds.append(frame.seconds)
        self.errors.append(frame.error)
        self.samples.append(frame.samples)

    def left(self, target: float) -> float | None:
        """About how many seconds it takes until the error is `target`; None if that is not known.

        The error is taken to fall with the square root of the number of samples, and samples to come as fast as between
        the first and the last state.
        """
        if len(self.seconds) < 2 or self.finished:
            return None
        taken, passed = self.samples[-1] - self.samples[0], self.seconds[-1] - self.seconds[0]
        if taken <= 0 or passed <= 0:
            return None
        needed = self.samples[-1] * ((self.errors[-1] / target) ** 2 - 1)
        return max(needed, 0.0) * passed / taken

    def text(self, target: float) -> str:
        """What is known of the error, as a sentence."""
        if not self.seconds:
            return "The error is not known yet."
        now = f"Error {percent(self.errors[-1])} after {duration(self.seconds[-1])}"
        if self.finished:
            return f"{now}; finished."
        left = self.left(target)
        return f"{now}." if left is None else f"{now}; {percent(target)} in about {duration(left)} more."


class ErrorChartPart:
    """A chart of the error against time, both on logarithmic scales, and the same as a sentence."""

    def __init__(self, live: Live):
        self.live = live
        self.courses: dict[int, Course] = {}
        self.last: dict[int, Frame] = {}
        self.active: int | None = None
        self.drawn_at = 0.0
        gui = live.server.gui
        with tab(live.server, "Price"), gui.add_folder("Error against time", order=1):
            self.line = gui.add_html(_line("The error is not known yet."))
            self.chart = gui.add_uplot(height=HEIGHT, visible=False, **chart(Course(), live.engine.target))
        live.on_frame(self.frame)
        live.on_leave(self.left)

    def frame(self, client: Client, frame: Frame) -> None:
        """A browser's picture has a new state. In the thread that renders."""
        number, before = client.number, self.last.get(client.number)
        self.last[number] = frame
        if before is None or begins_anew(before, frame):
            self.courses[number], self.active, self.drawn_at = Course(), number, -math.inf
        self.courses[number].add(frame)
        now = clock.now()
        if number == self.active and (frame.finished or now - self.drawn_at > PAUSE):
            self.drawn_at = now
            self.draw(self.courses[number])

    def left(self, client: Client) -> None:
        """A browser has left."""
        self.last.pop(client.number, None)
        self.courses.pop(client.number, None)
        if self.active == client.number:
            self.active = next(iter(self.courses), None)

    def draw(self, course: Course) -> None:
        """Shows a course."""
        target = self.live.engine.target
        text = _line(course.text(target))
        if self.line.content != text:
            self.line.content = text
        is_drawn = len(course.seconds) > 1
        if is_drawn:
            for name, value in chart(course, target).items():
                if name in ("data", "scales"):
                    setattr(self.chart, name, value)
        if self.chart.visible != is_drawn:
            self.chart.visible = is_drawn


def begins_anew(before: Frame, frame: Frame) -> bool:
    """Whether a state is of another picture than the state before it."""
    return (
        frame.change != before.change
        or frame.seconds < before.seconds
        or frame.grain > before.grain
        # With motion blur, samples are taken anew.
        or (frame.grain == before.grain == 1 and frame.samples < before.samples)
    )


def chart(course: Course, target: float) -> dict[str, Any]:
    """The arguments of viser's chart of a course: data, series, scales and axes."""
    seconds = np.array(course.seconds or [0.1, 1.0])
    errors = 100 * np.array(course.errors or [10.0, 1.0])
    goal = np.full(len(seconds), 100 * target)
    # The line of what is asked for lies within the chart, not on its edge.
    x, y = decades(seconds), ends(np.append(errors, 80 * target))
    blue, grey = "#1c7ed6", "#868e96"
    return {
        "data": (seconds, errors, goal),
        "series": (
            {"label": "seconds"},
            {"label": "error, %", "stroke": blue, "width": 2},
            {"label": "asked for, %", "stroke": grey, "width": 1, "dash": [4, 4], "points": {"show": False}},
        ),
        "scales": {
            "x": {"time": False, "distr": 3, "log": 10, "range": x},
            "y": {"distr": 3, "log": 10, "range": y},
        },
        "axes": (
            {"label": "seconds", "labelSize": 16, "size": 32},
            {"label": "error, %", "labelSize": 16, "size": 40},
        ),
        "legend": {"show": False},
        "padding": (10, 16, 0, 0),
    }


def ends(values: np.ndarray) -> tuple[float, float]:
    """Ends of a logarithmic scale for values greater than 0: each is 1, 2 or 5 times a power of ten."""
    low, high = _step(float(values.min()), down=True), _step(float(values.max()), down=False)
    return low, max(high, 2 * low)


def decades(values: np.ndarray) -> tuple[float, float]:
    """Ends of a logarithmic scale for values greater than 0: powers of ten."""
    low = math.floor(math.log10(values.min()))
    return 10.0**low, 10.0 ** max(math.ceil(math.log10(values.max())), low + 1)


def _step(value: float, down: bool) -> float:
    """The next 1, 2 or 5 times a power of ten: at most the value, or at least."""
    power = 10.0 ** math.floor(math.log10(value))
    steps = [k * power for k in (1, 2, 5, 10)]
    # The logarithm is rounded: a value just below a power of ten may count as this power.
    return max((s for s in steps if s <= value), default=power) if down else min(s for s in steps if s >= value)


def percent(share: float) -> str:
    """A share as a percentage with two digits."""
    return f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.0f} %"


def duration(seconds: float) -> str:
    """A time with two digits, in a unit that suits it."""
    if seconds >= 3600:
        return f"{seconds / 3600:.2g} h"
    if seconds >= 99.5:
        return f"{seconds / 60:.2g} min"
    return f"{seconds:.2g} s"


def _line(text: str) -> str:
    """A sentence as HTML."""
    return f'<div style="padding:0 1em;font-size:0.85em;font-variant-numeric:tabular-nums">{escaped(text)}</div>'
