"""Parts that figures are drawn of: axes that can be read, lines across, labels that cover nothing."""

from collections.abc import Iterable, Sequence
from math import isfinite, log10
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from matplotlib.transforms import Bbox

from visray.study.cost.records import Band, Point

INK, GREY = "#222222", "#767676"


def blank(width: float, height: float, shape: tuple[int, int] = (1, 1), bare: bool = False) -> tuple[Figure, Any]:
    """A figure in inches, and its axes, row by row."""
    figure = Figure(figsize=(width, height), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)  # it measures text
    grid = figure.subplots(*shape, squeeze=False).ravel()
    for axes in grid:
        if bare:
            axes.set(xticks=[], yticks=[])
        else:
            axes.grid(True, color="#e4e4e4", linewidth=0.8)
            axes.spines[["top", "right"]].set_visible(False)
    return figure, grid


def logarithmic(axes: Axes, which: str, bands: Iterable[Band], text: Any, also: Iterable[float] = ()) -> float:
    """Makes an axis logarithmic, a decade at least, with ticks that can be read; its lower end, where 0 is drawn."""
    bands = list(bands)
    middles = [b.middle for b in bands if isfinite(b.middle) and b.middle > 0] or [1e-3]
    highs = [b.high for b in bands if isfinite(b.high)]
    # What is close belongs in the picture too; across says where the rest lies.
    near = [x for x in also if min(middles) / 5 < x < max(middles) * 30]
    low, high = min(middles + near) / 1.7, max(middles + near + highs) * 1.7
    if any(not b.middle > 0 for b in bands):
        low /= 2
    if high < 10 * low:
        low, high = (low * high / 10) ** 0.5, (low * high * 10) ** 0.5
    axes.set(**{f"{which}scale": "log", f"{which}lim": (low, high)})
    axis = getattr(axes, f"{which}axis")
    steps = (1,) if log10(high / low) > 3.5 else (1, 3) if log10(high / low) > 2.2 else (1, 2, 5)
    axis.set_major_locator(LogLocator(subs=steps, numticks=99))
    axis.set_major_formatter(FuncFormatter(lambda x, _: text(x)))
    axis.set_minor_locator(NullLocator())
    return low


def reach(bands: Sequence[Band], bottom: float = 0) -> np.ndarray:
    """How far bands reach down and up from their middles, as errorbar takes it: never below the axis."""
    ends = [(max(b.middle, bottom), max(b.low, bottom), max(b.high, bottom)) for b in bands]
    return np.array([(max(m - low, 0), max(high - m, 0)) for m, low, high in ends]).reshape(-1, 2).T


def legend(figure: Figure, keys: list[Line2D]) -> None:
    labels = [str(k.get_label()) for k in keys]
    # What begins with an underscore matplotlib keeps out of a legend.
    labels = [f" {text}" if text.startswith("_") else text for text in labels]
    columns = 2 if max(map(len, labels)) < 56 else 1
    figure.legend(keys, labels, loc="outside lower left", ncols=columns, frameon=False, fontsize=9)


def across(axes: Axes, seen: "Labels", which: str, at: float, text: str) -> None:
    """A line across the figure, and what it is; an arrow at the edge where it lies beyond."""
    low, high = getattr(axes, f"get_{which}lim")()
    if not (isfinite(at) and at > 0):
        return
    vertical = which == "x"
    if low <= at <= high:
        (axes.axvline if vertical else axes.axhline)(at, color=GREY, linewidth=1.1, linestyle=(0, (5, 3)), zorder=1.5)
        seen.lines.append(((at, at), axes.get_ylim()) if vertical else (axes.get_xlim(), (at, at)))
    else:
        text += (" →" if vertical else " ↑") if at > high else (" ←" if vertical else " ↓")
        at = high if at > high else low
    for along in (0.985, 0.015, 0.7, 0.35, 0.5):
        for side in (4, -4):
            if vertical:
                va = "top" if along > 0.9 else "bottom" if along < 0.1 else "center"
                form = {"rotation": 90, "ha": "left" if side > 0 else "right", "va": va}
                place, frame, offset = (at, along), ("data", "axes fraction"), (side, 0)
            else:
                ha = "right" if along > 0.9 else "left" if along < 0.1 else "center"
                form = {"ha": ha, "va": "bottom" if side > 0 else "top"}
                place, frame, offset = (along, at), ("axes fraction", "data"), (0, side)
            if seen.put(text, place, frame, offset, color="#555555", size=8.5, **form):
                return


class Labels:
    """Labels at points, each where it covers neither mark nor line nor label; without room for one it is left out."""

    def __init__(self, axes: Axes):
        self.axes, self.boxes = axes, []
        self.marks: list[tuple[float, float]] = []
        self.lines: list[tuple[Sequence[float], Sequence[float]]] = []

    def at(self, text: str, point: Point, bottom: float, must: bool = False, **form: Any) -> None:
        """A label near a point: the nearest place that is free, else one that only lines run through."""
        place = (point.seconds.middle, max(point.error.rmse.middle, bottom))
        for lines, far in ((True, 12), (True, 20), (False, 12), (False, 20)):
            for right, up in ((1, 1), (1, -1), (-1, -1), (-1, 1), (0, 1), (0, -1), (1, 0), (-1, 0)):
                ends = {"ha": ("center", "left", "right")[right], "va": ("center", "bottom", "top")[up]}
                size = far if 0 in (right, up) else 0.7 * far
                if self.put(text, place, "data", (size * right, size * up), lines, **ends, **form):
                    return
        if must:
            self.axes.annotate(text, place, (8, 8), textcoords="offset points", **form)

    def put(self, text: str, place: tuple, frame: Any, offset: tuple, lines: bool = True, **form: Any) -> bool:
        """Writes a label there, if it is free."""
        made = self.axes.annotate(text, place, offset, frame, "offset points", **({"color": INK, "size": 9} | form))
        made.set(in_layout=False, zorder=7)
        box, room = made.get_window_extent(), self.axes.bbox
        inside = room.x0 <= box.x0 and box.x1 <= room.x1 and room.y0 <= box.y0 and box.y1 <= room.y1
        if inside and not any(box.overlaps(other) for other in self.boxes) and not self._hit(box, lines):
            self.boxes.append(box.padded(2))
            return True
        made.remove()
        return False

    def _hit(self, box: Bbox, lines: bool) -> bool:
        """Whether a mark lies in a box, or a line runs through it."""
        to = self.axes.transData.transform
        marks = to(np.array(self.marks))
        if box.padded(8).count_contains(marks):
            return True
        for x, y in self.lines if lines else []:
            ends = to(np.column_stack([x, y]))
            steps = np.linspace(0, 1, 40)[:, None, None]
            if box.padded(2).count_contains((ends[:-1] + steps * (ends[1:] - ends[:-1])).reshape(-1, 2)):
                return True
        return False
