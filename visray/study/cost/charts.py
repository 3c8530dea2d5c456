"""The figures of a report of costs.

Only here and in drawing.py is matplotlib imported, and none of its global state is used or left behind: each figure is
an object, in matplotlib's own default style whatever the user's is. Colours are those of Okabe and Ito, which the
colour-blind can tell apart; each knob has its own marker too.
"""

import hashlib
import re
from collections.abc import Sequence
from io import StringIO
from typing import Any

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from visray.output.image import Image
from visray.study.cost.drawing import GREY, INK, Labels, across, blank, legend, logarithmic, reach
from visray.study.cost.records import Band, Curve, Point, Report, Slope
from visray.study.cost.wording import changes, duration, hundredths, is_number, percent, written

BLUE, RED = "#0072B2", "#D55E00"
COLOURS, MARKERS = (BLUE, RED, "#009E73", "#CC79A7", "#E69F00", "#56B4E9"), "os^DvPX<>"
HIGHLIGHT = {"color": "#F0E442", "linewidth": 7, "alpha": 0.8, "solid_capstyle": "round"}
# Names are the user's: a dollar sign in one of them is no formula.
STYLE = ["default", {"text.parse_math": False, "svg.hashsalt": "visray", "font.size": 10, "axes.axisbelow": True}]
MOST = {"marker": "v", "markersize": 6.5, "markerfacecolor": "white", "linestyle": "", "clip_on": False}
LONGEST = 256  # pixels of a thumbnail's longer side, at most


def svg(figure: Figure, alt: str) -> str:
    """The figure as a part of an HTML page, with `alt` for those who do not see it."""
    buffer = StringIO()
    with style.context(STYLE):
        figure.savefig(buffer, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    text = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>", "", buffer.getvalue(), flags=re.DOTALL)
    text = text[text.index("<svg") :]
    # An id holds for the whole page. Those that begin with a tilde are what a mark says when it is pointed at (_mark).
    text = re.sub(r'<g id="~([^"]*)">', r"<g><title>\1</title>", text)
    mine = f"v{hashlib.sha256(text.encode()).hexdigest()[:8]}-"
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{mine}", text)
    hidden = alt.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace('"', "&quot;")
    return text.replace("<svg", f'<svg role="img" aria-label="{hidden}"', 1)


def costs(report: Report) -> Figure:
    """The error against time: a curve for each knob, the frontier, the default, the floors, and compile time."""
    with style.context(STYLE):
        figure, (axes,) = blank(9, 6 + 0.12 * len(report.curves))
        points = [*(p for c in report.curves for p in c.points), *report.joint, *report.frontier, report.default]
        bottom = logarithmic(axes, "y", [p.error.rmse for p in points], percent, report.floors.values())
        logarithmic(axes, "x", [p.seconds for p in points], duration, [report.default.compile_seconds])
        axes.set(xlabel="time for one picture, compiled", ylabel="relative error (RMSE)")
        keys, seen = [], Labels(axes)
        front = sorted((p for p in report.frontier if p.seconds.middle > 0), key=lambda p: p.seconds.middle)
        if front:
            # A staircase: between two choices that were measured nothing was.
            x, y = [p.seconds.middle for p in front], [max(p.error.rmse.middle, bottom) for p in front]
            axes.plot([*x, axes.get_xlim()[1]], [*y, y[-1]], drawstyle="steps-post", zorder=1, **HIGHLIGHT)
            keys.append(Line2D([], [], label="frontier: nothing measured is faster and better", **HIGHLIGHT))
        for i, curve in enumerate(report.curves):
            keys.append(_curve(axes, i, curve, curve.points, [p.seconds for p in curve.points], curve.by_time, seen))
            for p in curve.points:
                _mark(axes, p, bottom, report.default, seen, **_look(i))
        for p in report.joint:
            _mark(axes, p, bottom, report.default, seen, color=GREY, marker="x", markersize=6)
        if report.joint:
            keys.append(Line2D([], [], color=GREY, marker="x", linestyle="", label="several knobs turned"))
        star = {"color": INK, "marker": "*", "markersize": 17, "markeredgecolor": "white", "zorder": 6}
        _mark(axes, report.default, bottom, report.default, seen, **star)
        keys.append(Line2D([], [], linestyle="", **(star | {"markersize": 13}), label="today's default"))
        legend(figure, keys)
        figure.draw_without_rendering()
        seen.at("today's default", report.default, bottom, weight="bold", must=True)
        compiling = report.default.compile_seconds
        across(axes, seen, "x", compiling, f"compiling: {duration(compiling)}")
        for name, floor in report.floors.items():
            across(axes, seen, "y", floor, f"{name}: {percent(floor)}")
        if any(p.error.rmse.middle <= 0 for p in points):
            across(axes, seen, "y", bottom, "no error at all")
        # The ends say most; then every other one, as far as there is room.
        inks = {c.knob: _dark(_look(i)["color"]) for i, c in enumerate(report.curves)}
        for p in [*front[:1], *front[-1:], *front[2:-1:2], *front[1:-1:2]]:
            if not p.same_choice(report.default):
                seen.at(_turned(p, report.default), p, bottom, size=8, color=inks.get(p.knob, INK))
        for text in axes.texts:
            text.set_bbox({"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 1})
        return figure


def counts(report: Report) -> Figure | None:
    """The error against the value of each knob that samples; None where none was turned."""
    found = [(i, c) for i, c in enumerate(report.curves) if c.kind == "sampling" and len(_numbers(c)) > 1]
    if not found:
        return None
    with style.context(STYLE):
        figure, (axes,) = blank(9, 3.8 + 0.12 * len(found))
        bottom = logarithmic(axes, "y", [p.error.rmse for _, c in found for p in c.points], percent)
        logarithmic(axes, "x", [Band(p.value, p.value, p.value) for _, c in found for p in _numbers(c)], written)
        keys = []
        for i, c in found:
            points = _numbers(c)
            keys.append(_curve(axes, i, c, points, [Band(p.value, p.value, p.value) for p in points], c.by_count))
            for p in points:
                _mark(axes, p, bottom, report.default, x=p.value, **_look(i))
        axes.set(xlabel="value of the knob: samples, or rays", ylabel="relative error (RMSE)")
        legend(figure, keys)
        return figure


def parts(report: Report) -> Figure | None:
    """Bias and deviation for each knob; None where no knob has two points. Over the depth of paths, where the axis is
    straight, a bias that falls geometrically is a straight line. What cannot be told from 0 is drawn at the upper
    end of its band: its middle says nothing, and is 0 as often as not."""
    found = [c for c in report.curves if len(c.points) > 1]
    if not found:
        return None
    with style.context(STYLE):
        rows, limits = -(-len(found) // 3), False
        figure, grid = blank(9, 0.5 + 2.5 * rows, (rows, min(3, len(found))))
        errors = [_shown(b) for c in found for p in c.points for b in (p.error.bias, p.error.deviation)]
        for axes, curve in zip(grid, found):
            bottom = logarithmic(axes, "y", errors, percent)
            values = [p.value for p in curve.points]
            numbers = all(map(is_number, values))
            wide = numbers and max(values) > 1000 * min((v for v in values if v > 0), default=1)
            x = values if numbers and (min(values) > 0 or not wide) else range(len(values))
            if x is values and min(values) > 0 and (wide or curve.kind == "sampling"):
                logarithmic(axes, "x", [Band(v, v, v) for v in values], written)
            elif x is not values:
                axes.set_xticks(x, [_short(written(v), 12) for v in values])
            else:
                axes.xaxis.get_major_locator().set_params(integer=True)
            for name, colour, line, marker in (("bias", RED, "-", "o"), ("deviation", BLUE, "--", "s")):
                bands = [getattr(p.error, name) for p in curve.points]
                y = [max(b.middle, bottom) if b.low > 0 else np.nan for b in bands]
                ends = {"y": y, "yerr": reach(bands, bottom)}
                face = colour if name == "bias" else "white"
                form = {"color": colour, "marker": marker, "markersize": 5, "markerfacecolor": face, "capsize": 2}
                axes.errorbar(x, **ends, linestyle=line, linewidth=1.4, elinewidth=1, label=name, **form)
                most = [(at, max(b.high, bottom)) for at, b in zip(x, bands) if not b.low > 0]
                if most:
                    axes.plot(*zip(*most), color=colour, **MOST)
                limits |= bool(most)
            axes.set_title(_short(curve.knob, 34), fontsize=9.5)
            axes.tick_params(labelsize=8.5)
        for axes in grid[len(found) :]:
            axes.set_visible(False)
        figure.supylabel("relative error", fontsize=10)
        figure.supxlabel("value of the knob", fontsize=10)
        keys, labels = grid[0].get_legend_handles_labels()
        named = {"bias": "bias: stays, whatever the seed", "deviation": "deviation: differs from seed to seed"}
        labels = [named[n] for n in labels] + ["at most: may be 0"] * limits
        keys += [Line2D([], [], color=GREY, **MOST)] * limits
        figure.legend(keys, labels, loc="outside upper left", ncols=3, frameon=False)
        return figure


def pictures(report: Report) -> Figure:
    """The cheapest picture of the frontier, the default's, the best and the reference; below each, where it is off."""
    r, shown = report.reference, [("today's default", report.default)]
    front = sorted(report.frontier, key=lambda p: p.seconds.middle)
    for name, at, ends in (("cheapest", 0, front[:1]), ("best", len(shown) + 1, front[-1:])):
        shown[at:at] = [(name, p) for p in ends if not p.same_choice(report.default) and p is not shown[0][1]]
    columns = [
        (f"{n}\n{duration(p.seconds.middle)}, {percent(p.error.rmse.middle)}", p.picture, p.wrong) for n, p in shown
    ]
    noise = np.sqrt(np.maximum(r.variance, 0).mean(2)) / (r.luminance or 1)
    columns.append((f"reference\n{duration(r.seconds)}, {percent(r.error)}", r.picture, noise))
    with style.context(STYLE):
        height, width = r.picture.shape[:2]
        wide, n = width > 1.8 * height, len(columns)
        # Wide pictures lie one below the other, each beside its map.
        size = (9, 0.8 + n * (0.45 + 4.4 * height / width)) if wide else (9, 1.6 + 18 / n * height / width)
        figure, grid = blank(*size, (n, 2) if wide else (2, n), bare=True)
        lights, maps = (grid[0::2], grid[1::2]) if wide else (grid[:n], grid[n:])
        off = [_smaller(np.nan_to_num(w, posinf=0) ** 2) ** 0.5 for *_, w in columns]
        positive = np.concatenate([o[o > 0] for o in off])
        top = float(np.quantile(positive, 0.995)) if positive.size else 1e-2
        low = float(np.clip(np.quantile(positive, 0.05), top / 1e4, top / 10)) if positive.size else top / 100
        for axes, beside, (title, light, _), map_ in zip(lights, maps, columns, off):
            shown_light = Image({"RGB": _smaller(np.nan_to_num(light))}).display()
            axes.imshow(shown_light, interpolation="none")
            norm = LogNorm(low, top, clip=True)
            drawn = beside.imshow(np.maximum(map_, low), norm=norm, cmap="magma", interpolation="none")
            axes.set_title(title.replace("\n", ": ") if wide else title, fontsize=9)
            beside.set_title("its own standard error" if axes is lights[-1] else "where it is off", fontsize=9)
        bar = figure.colorbar(drawn, ax=list(grid), location="bottom", aspect=60, fraction=0.05, extend="both")
        bar.ax.xaxis.set_major_locator(LogLocator(subs=(1,) if top > 99 * low else (1, 2, 5)))
        bar.ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: percent(x)))
        bar.ax.xaxis.set_minor_formatter(NullFormatter())
        bar.set_label("error of a pixel (RMS over seeds and channels), of the reference's mean luminance", fontsize=9)
        return figure


def _dark(colour: str) -> tuple[float, ...]:
    """The colour for text, which is thin."""
    return tuple(0.7 * x for x in to_rgb(colour))


def _shown(b: Band) -> Band:
    """What is drawn of a band: only its upper end, where it reaches down to 0."""
    return b if b.low > 0 else Band(b.high, b.high, b.high)


def _look(i: int) -> dict[str, Any]:
    """Colour and marker of the curve of this number."""
    return {"color": COLOURS[i % len(COLOURS)], "marker": MARKERS[i % len(MARKERS)]}


def _short(text: str, most: int) -> str:
    return text if len(text) <= most else text[: most - 1] + "…"


def _numbers(curve: Curve) -> list[Point]:
    """The points of a curve whose value is a number that a logarithmic axis takes."""
    return [p for p in curve.points if is_number(p.value) and p.value > 0]


def _curve(
    axes: Axes, i: int, curve: Curve, points: Sequence[Point], x: list[Band], slope: Slope | None, seen: Any = None
) -> Line2D:
    """Draws a curve with its bands, without its marks; its line in the legend."""
    bottom, look = axes.get_ylim()[0], _look(i)
    along, up = [b.middle for b in x], [p.error.rmse for p in points]
    y = [max(b.middle, bottom) for b in up]
    line = ":" if curve.kind == "step" else "-"
    form = {"color": look["color"], "linewidth": 1.6, "linestyle": line, "elinewidth": 1, "capsize": 2}
    axes.errorbar(along, y, xerr=reach(x), yerr=reach(up, bottom), **form)
    if seen:
        seen.lines.append((along, y))
    k = f": k = {hundredths(slope.k)} [{hundredths(slope.low)}, {hundredths(slope.high)}]" if slope else ""
    return Line2D([], [], **look, linestyle=line, label=_short(curve.knob, 40) + k)


def _mark(
    axes: Axes, p: Point, bottom: float, default: Point, seen: Any = None, x: float | None = None, **form: Any
) -> None:
    """One point, which says what it is when it is pointed at."""
    x, y = p.seconds.middle if x is None else x, max(p.error.rmse.middle, bottom)
    says = f"{p.knob} {written(p.value)}: {duration(p.seconds.middle)}, {percent(p.error.rmse.middle)}"
    turned = _turned(p, default)
    says += f" ({turned})" if turned else ""
    form = {"markersize": 7, "markeredgecolor": "white", "markeredgewidth": 0.8} | form
    if form["marker"] == "x":
        form["markeredgecolor"], form["markeredgewidth"] = form["color"], 1.5
    axes.plot([x], [y], linestyle="", clip_on=False, **({"zorder": 4} | form), gid=f"~{says}".replace("\n", ", "))
    if seen:
        seen.marks.append((x, y))


def _turned(point: Point, default: Point) -> str:
    """What was turned for a point, a line each, as short as it can be told."""
    told = {" ".join(k.removeprefix("settings.").split(".")[-2:]): v for k, v in changes(point, default).items()}
    told = told or ({} if point.knob == "default" else {point.knob: point.value})
    lines = [_short(f"{k} {written(v)}", 34) for k, v in told.items()]
    return "\n".join(lines if len(lines) < 4 else [*lines[:2], f"and {len(lines) - 2} more"])


def _smaller(values: np.ndarray) -> np.ndarray:
    """Means over blocks of pixels, so that the longer side is at most LONGEST; what fills no block is left out."""
    k = -(-max(values.shape[:2]) // LONGEST)
    h, w = (max(1, n // k) for n in values.shape[:2])
    blocks = values[: h * k, : w * k].reshape(h, -1, w, min(k, values.shape[1]), *values.shape[2:])
    return blocks.mean((1, 3))
