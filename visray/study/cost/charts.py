"""Figures of the page, as SVG and PNG that an HTML page contains: error against time, pictures and error maps.

Colours of curves are those of Okabe and Ito, which colour-blind readers can tell apart; each setting has its own
marker. Text and axes take the colour of the page, light or dark.
"""

import base64
from collections.abc import Iterable
from html import escape
from math import ceil, floor, isfinite, log10

import numpy as np

from visray.output import png
from visray.output.image import Image
from visray.study.cost.advice import label
from visray.study.cost.choices import TOGETHER
from visray.study.cost.records import Band, Record, Report
from visray.study.cost.writing import changes, duration, percent, written

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
# Outlines of markers about the origin, in units of the marker's radius.
MARKERS = (
    "M-.9 0a.9.9 0 1 0 1.8 0a.9.9 0 1 0-1.8 0", "M-.8-.8h1.6v1.6h-1.6z", "M0-1L1 .8H-1z", "M0-1.1L1.1 0L0 1.1L-1.1 0z",
    "M0 1L1-.8H-1z", "M-.35-1h.7v.65H1v.7H.35V1h-.7V.35H-1v-.7h.65z", "M-1 0L.8-1V1z", "M1 0L-.8-1V1z",
)  # fmt: skip
STAR = "M0-2L.5-.65H1.9L.8.25L1.2 1.65L0 .85L-1.2 1.65L-.8.25L-1.9-.65H-.5z"
CROSS = "M-.9-.6L-.3 0L-.9 .6L-.6 .9L0 .3L.6 .9L.9 .6L.3 0L.9-.6L.6-.9L0-.3L-.6-.9z"
LEFT, RIGHT, TOP, BOTTOM = 56, 14, 12, 44  # margins, in pixels
LONGEST = 256  # pixels of the longer side of a thumbnail, at most
# Stops of the colours of error maps, from dark to light (inferno).
STOPS = ("#000004", "#420a68", "#932667", "#dd513a", "#fca50a", "#fcffa4")


class _Axis:
    """A logarithmic axis of at least a decade.

    low, high: its ends in logarithms
    start, end: their places in pixels
    """

    def __init__(self, bands: Iterable[Band], start: float, end: float, also: Iterable[float] = ()):
        values = [x for b in bands for x in (b.low, b.middle, b.high) if isfinite(x) and x > 0] or [1e-3]
        # Floors and compilation are shown where they are near; a lower end of a band may be close to 0.
        low, high = max(min(values), max(values) / 1e5), max(values)
        near = [x for x in also if isfinite(x) and low / 5 < x < 30 * high]
        self.low, self.high = log10(min([low, *near]) / 1.5), log10(max([high, *near]) * 1.5)
        if self.high - self.low < 1:
            middle = (self.low + self.high) / 2
            self.low, self.high = middle - 0.5, middle + 0.5
        self.start, self.end = start, end

    def __call__(self, x: float) -> float:
        """The place of a number; numbers outside, and 0, lie on the edge."""
        at = min(max(log10(x), self.low), self.high) if x > 0 and isfinite(x) else self.low
        return self.start + (at - self.low) / (self.high - self.low) * (self.end - self.start)

    def inside(self, x: float) -> bool:
        return x > 0 and isfinite(x) and self.low <= log10(x) <= self.high

    def ticks(self) -> list[float]:
        """Round numbers, as many as there is room for."""
        for steps in ((1, 2, 5), (1, 3), (1,)):
            decades = range(floor(self.low), ceil(self.high) + 1)
            ticks = [s * 10.0**n for n in decades for s in steps if self.inside(s * 10.0**n)]
            if len(ticks) * 55 <= abs(self.end - self.start) or steps == (1,):
                return ticks
        return []


def costs(report: Report, width: int, height: int) -> str:
    """Error against time as SVG of this size: a curve for each setting, the frontier, the scene as it is, floors."""
    records = report.records
    x = _Axis([p.seconds for p in records], LEFT, width - RIGHT, [report.default.compile_seconds])
    y = _Axis([p.error.rmse for p in records], height - BOTTOM, TOP, report.floors.values())
    parts = [f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="Error against time">']
    for t in x.ticks():
        parts.append(f'<path class="grid" d="M{x(t):.1f} {TOP}V{height - BOTTOM}"/>')
        parts.append(_text(x(t), height - BOTTOM + 16, duration(t), "middle"))
    for t in y.ticks():
        parts.append(f'<path class="grid" d="M{LEFT} {y(t):.1f}H{width - RIGHT}"/>')
        parts.append(_text(LEFT - 6, y(t) + 4, percent(t), "end"))
    parts.append(_text((LEFT + width - RIGHT) / 2, height - 8, "time of one picture, without compiling", "middle"))
    parts.append(
        f'<text transform="translate(12 {(height - BOTTOM) / 2:.0f}) rotate(-90)" text-anchor="middle">error</text>'
    )
    if report.frontier:
        steps = "".join(f"H{x(p.seconds.middle):.1f}V{y(p.error.rmse.middle):.1f}" for p in report.frontier)
        first = report.frontier[0]
        parts.append(f'<path class="front" d="M{x(first.seconds.middle):.1f} {TOP}{steps}H{width - RIGHT}"/>')
    for name, value in report.floors.items():
        if y.inside(value):
            parts.append(f'<path class="floor" d="M{LEFT} {y(value):.1f}H{width - RIGHT}"/>')
            parts.append(_text(width - RIGHT - 4, y(value) - 4, f"{name}: {percent(value, 2)}", "end"))
    for i, curve in enumerate(report.curves):
        line = " ".join(f"{x(p.seconds.middle):.1f},{y(p.error.rmse.middle):.1f}" for p in curve.points)
        parts.append(f'<polyline points="{line}" stroke="{COLOURS[i % len(COLOURS)]}"/>')
    for shape, colour, p in _marks(report):
        parts.append(_mark(p, x, y, shape, colour, report.default))
    return "".join([*parts, "</svg>"])


def legend(report: Report) -> list[tuple[str, str]]:
    """The marker, as SVG, and the name of each curve, of the best choices together, and of the scene as it is."""
    names = [label(c.setting) for c in report.curves] + [label(TOGETHER)] * bool(report.joint) + [label("scene")]
    looks = [(MARKERS[i % len(MARKERS)], COLOURS[i % len(COLOURS)]) for i in range(len(report.curves))]
    looks += [(CROSS, "currentColor")] * bool(report.joint) + [(STAR, "currentColor")]
    icon = '<svg viewBox="-2 -2 4 4" width="18" height="18" aria-hidden="true"><path d="{}" fill="{}"/></svg>'
    return [(icon.format(*look), name) for look, name in zip(looks, names)]


def _marks(report: Report) -> Iterable[tuple[str, str, Record]]:
    """Marker, colour and record of each mark, the scene as it is last, on top."""
    for i, curve in enumerate(report.curves):
        yield from ((MARKERS[i % len(MARKERS)], COLOURS[i % len(COLOURS)], p) for p in curve.points)
    yield from ((CROSS, "currentColor", p) for p in report.joint)
    yield STAR, "currentColor", report.default


def _mark(p: Record, x: _Axis, y: _Axis, shape: str, colour: str, default: Record) -> str:
    """A mark with its intervals; it shows its settings when it is pointed at."""
    t, e = p.seconds, p.error.rmse
    changed = ", ".join(f"{a.removeprefix('settings.')} {written(v)}" for a, v in changes(p, default).items())
    title = escape(f"{changed or 'the scene as it is'}: {duration(t.middle)}, error {percent(e.middle)}")
    bars = f"M{x(t.low):.1f} {y(e.middle):.1f}H{x(t.high):.1f}M{x(t.middle):.1f} {y(e.low):.1f}V{y(e.high):.1f}"
    place = f"translate({x(t.middle):.1f} {y(e.middle):.1f}) scale(4.5)"
    mark = f'<path class="mark" d="{shape}" fill="{colour}" transform="{place}"/>'
    return f'<g><title>{title}</title><path d="{bars}" stroke="{colour}"/>{mark}</g>'


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def picture(pixels: np.ndarray) -> str:
    """A picture in linear light as the address of a PNG image. Shape: (H, W, 3)."""
    return _address(Image({"RGB": thumbnail(np.nan_to_num(pixels))}).display())


def error_maps(maps: list[np.ndarray]) -> tuple[list[str], float, float]:
    """Error maps on one logarithmic scale as addresses of PNG images, and the ends of the scale. Shapes: (H, W)."""
    small = [thumbnail(np.nan_to_num(m, posinf=0) ** 2) ** 0.5 for m in maps]
    positive = np.concatenate([m[m > 0] for m in small])
    top = float(np.quantile(positive, 0.995)) if positive.size else 1e-2
    low = float(np.clip(np.quantile(positive, 0.05), top / 1e4, top / 10)) if positive.size else top / 100
    stops = np.array([[int(s[i : i + 2], 16) for i in (1, 3, 5)] for s in STOPS])
    along = np.linspace(0, 1, len(STOPS))
    addresses = []
    for m in small:
        part = np.clip(np.log(np.maximum(m, low) / low) / np.log(top / low), 0, 1)
        colours = [np.interp(part, along, stops[:, i]) for i in range(3)]
        addresses.append(_address(np.stack(colours, -1).round().astype(np.uint8)))
    return addresses, low, top


def thumbnail(values: np.ndarray) -> np.ndarray:
    """Means over blocks of pixels, the longer side at most LONGEST; an incomplete block at the end is left out."""
    k = -(-max(values.shape[:2]) // LONGEST)
    h, w = (max(1, n // k) for n in values.shape[:2])
    blocks = values[: h * k, : w * k].reshape(h, -1, w, min(k, values.shape[1]), *values.shape[2:])
    return blocks.mean((1, 3))


def _address(pixels: np.ndarray) -> str:
    """Pixels as an address that contains the whole PNG image. Shape: (H, W, 3), 8 bits."""
    return "data:image/png;base64," + base64.b64encode(png.encode(pixels, {}, True)).decode()
