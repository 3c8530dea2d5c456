"""The page of a report: one HTML file that opens without a network, and the part of it that a notebook shows."""

import hashlib
from collections.abc import Iterable, Sequence
from html import escape
from math import isfinite

import numpy as np

from visray.study.cost import charts
from visray.study.cost.advice import advice, halving, label, options, present, reason
from visray.study.cost.choices import SPP
from visray.study.cost.records import Band, Report
from visray.study.cost.report import STOPPED, on_frontier
from visray.study.cost.writing import changes, duration, interval, number, percent, times, written

CSS = """
:root { color-scheme: light dark; --ink: #1d2127; --soft: #59626d; --paper: #fff; --line: #dfe3e8; --own: #dcebfa;
  --front: #f0e442 }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e8eb; --soft: #a8b1bb; --paper: #16191d; --line: #363c44; --own: #17324d; --front: #7d7420 }
}
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); margin: 2rem auto 4rem;
  max-width: 1280px; padding: 0 1rem; overflow-wrap: anywhere }
h1 { font-size: 1.1rem; font-weight: 600; color: var(--soft); margin: 0 }
h2 { font-size: 1.25rem; margin: 2.5rem 0 .5rem }
.lead { font-size: 1.6rem; font-weight: 650; line-height: 1.25; margin: .4rem 0 1rem }
.soft, figcaption { color: var(--soft); font-size: .9rem }
.warn { border-left: 4px solid #d55e00; padding: .3rem 1rem }
.scroll { overflow-x: auto; border-bottom: 1px solid var(--line) }
table { border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums; overflow-wrap: normal }
th, td { text-align: left; vertical-align: top; padding: .3rem .6rem; border-bottom: 1px solid var(--line) }
td { white-space: nowrap } .note { margin: 0 0 .4rem }
tbody th { position: sticky; left: 0; background: var(--paper); white-space: nowrap }
@media (max-width: 640px) { tbody th { white-space: normal } th, td { padding: .3rem } .lead { font-size: 1.3rem } }
tr.own > * { background: var(--own) }
dt { font-weight: 600 } dd { margin: 0 0 .6rem }
figure { margin: 0 } figure img { width: 100%; image-rendering: pixelated; display: block }
.pictures { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 240px), 1fr)); gap: 1rem }
code { font-size: 1rem }
.scale { height: .8rem; max-width: 30rem; display: block }
"""
OWN = ' class="own"'
# Of the chart, on the page and in a notebook.
CHART_CSS = """
.chart div svg { width: 100%; height: auto; font: 13px system-ui, sans-serif } .chart text { fill: currentColor }
.chart .grid { stroke: currentColor; opacity: .13 } .chart polyline, .chart .front { fill: none }
.chart .front { stroke: var(--front, #f0e442); stroke-width: 7; opacity: .8; stroke-linejoin: round }
.chart .floor { stroke: currentColor; stroke-dasharray: 5 4; opacity: .6 } .chart polyline { stroke-width: 1.6 }
.chart ul { list-style: none; padding: 0; display: flex; flex-wrap: wrap; gap: .1rem 1.2rem; font-size: .9rem }
.chart li { display: flex; align-items: center; gap: .3rem }
.chart .narrow { display: none }
@media (max-width: 640px) { .chart .wide { display: none } .chart .narrow { display: block } }
"""
CHART = """Error against time; further left is faster, further down is more accurate. Each curve changes one setting and
leaves all others as in the scene. Yellow: the frontier, the choices that nothing measured beats in both time and error.
Bars: intervals of 95 %. Dashed: errors that stay, however many samples are taken. Point at a mark to read its
settings."""
HALVINGS = """Each setting changed alone, cheapest first. The last column says how the error falls with the time:
time^-0.5 takes four times the time for half of the error, time^-1 twice the time."""
RECORDS = """One row for each measured choice. Errors are in percent of the mean luminance of the picture. Blue: the
scene as it is. ●: on the frontier. In brackets: intervals of 95 %. Noise differs from seed to seed, and more samples
reduce it; bias is the same with every seed. error² = bias² + noise²."""
GEOMETRY = """What the rays through all pixel centres hit first, and what random rays that leave these hits meet,
compared with the reference in double precision. Distance: the largest difference, in units of the last binary digit
(ulp). Normal: the largest angle. Self-shadows: leaving rays that are blocked where those of the reference are not."""
MEASURES = """How far the pixels are from those of the reference: root mean square over pixels and channels, in linear
light, over the mean luminance of the reference (relative RMSE). MRSE: mean of (x - r)² / (r + 0.01)², for a pixel x and
its reference r. FLIP: mean visible difference, from 0 to 1, of the pictures as displayed, at 67 pixels per degree."""
PICTURES = """Above: each picture as displayed (sRGB). Below: the error of each pixel (root mean square over seeds), on
one logarithmic scale from {} (dark) to {} (light) of the mean luminance. The map of the reference is its own standard
error."""


def page(report: Report) -> str:
    """The report as an HTML page."""
    r, title = report, f"What accuracy costs: {report.scene}"
    seeds = f"{r.seeds} pictures of each choice"
    facts = [title, f"{r.width} x {r.height} pixels", seeds, str(r.machine.get("date", ""))]
    lines = [reason(r), present(r), halving(r)]
    parts = [
        f"<h1>{escape(' · '.join(filter(None, facts)))}</h1>",
        f'<p class="lead">{escape(advice(r))}</p>',
        f"<p><code>visray render SCENE {escape(options(r))}</code></p>" if options(r) else "",
        *(f"<p>{escape(line)}</p>" for line in lines if line),
        *(f'<p class="warn">{escape(line)}</p>' for line in _warnings(r)),
        _chart(r), _halvings(r), _records(r), _pictures(r), _geometry(r), _measured(r),
    ]  # fmt: skip
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{escape(title)}</title>'
    body = f"<body><main>{''.join(parts)}</main></body>"
    return f'<!DOCTYPE html>\n<html lang="en"><head>{head}<style>{CSS}{CHART_CSS}</style></head>{body}</html>\n'


def display(report: Report) -> str:
    """The advice and the chart, for a notebook."""
    lead = f"<p><b>{escape(advice(report))}</b> {escape(halving(report))}</p>"
    return f'<div style="max-width: 900px"><style>{CHART_CSS}</style>{lead}{_chart(report)}</div>'


def _warnings(r: Report) -> Iterable[str]:
    if r.stopped:
        yield "Ctrl-C ended this study early: it has fewer pictures than asked for, or fewer choices."
    if r.quick:
        yield "This is the quick study: its pictures are small, and its intervals are wide."


def _chart(r: Report) -> str:
    """The chart, for wide and for narrow windows, and its legend."""
    wide, narrow = charts.costs(r, 1060, 560), charts.costs(r, 380, 420)
    items = "".join(f"<li>{icon}{escape(name)}</li>" for icon, name in charts.legend(r))
    figures = f'<div class="wide">{wide}</div><div class="narrow">{narrow}</div>'
    return f'<figure class="chart">{figures}<ul>{items}</ul><figcaption>{escape(CHART)}</figcaption></figure>'


def _halvings(r: Report) -> str:
    """The price of half of the error, setting by setting."""
    if not r.halvings:
        return ""
    rows, slopes = [], {c.setting: c.by_time for c in r.curves}
    for h in r.halvings:
        text = times(h.factor) if isfinite(h.factor.middle) else "not reached"
        value = "-" if h.value is None else written(h.value) + (" (not measured)" if h.beyond else "")
        k = slopes.get(h.setting)
        power = f"time^-{k.k:.2f} ({k.low:.2f} to {k.high:.2f})" if k else "-"
        rows.append(((label(h.setting), text, value, percent(h.least, 2), power), False))
    beyond = ' "(not measured)": carried on from the measured slope.' if any(h.beyond for h in r.halvings) else ""
    note = f"{HALVINGS}{beyond}{_together(r)}"
    heads = ("setting", "half of the error takes", "at the value", "least error, of the scene's", "error falls as")
    return f"<h2>What half of the error costs</h2>{_table(note, heads, rows)}"


def _together(r: Report) -> str:
    """Which settings "several together" means."""
    if not r.joint:
        return ""
    changed = (f"{a} = {written(v)}" for a, v in changes(r.joint[0], r.default).items() if a != SPP)
    return f" Several together: samples per pixel with {', '.join(changed)}."


def _records(r: Report) -> str:
    """All records, one row each."""
    heads = ("setting", "value", "time", "of the scene's time", "error (RMSE), %", "bias, %", "noise, %")
    rows = []
    for p in r.records:
        e, seconds, base = p.error, p.seconds.middle, r.default.seconds.middle
        texts = [label(p.setting), written(p.value), duration(seconds), percent(seconds / base, 2)]
        texts += [_percents(b) for b in (e.rmse, e.bias, e.deviation)] + [number(e.mrse, 2), number(e.flip, 2)]
        rows.append(([*texts, "●" if on_frontier(p, r) else ""], p is r.default))
    table = _table(RECORDS + _together(r), (*heads, "MRSE", "FLIP", "●"), rows)
    return f"<h2>All that was measured</h2>{table}"


def _percents(b: Band) -> str:
    """A share with its interval in percent; where it may be 0, only how large it may be."""
    if b.low <= 0:
        return f"at most {number(100 * b.high, 2)}" if b.high > 0 else "0"
    return interval(b, lambda x: number(100 * x))


def _pictures(r: Report) -> str:
    """Pictures and error maps of the scene, of both ends of the frontier, and of the reference."""
    ends = [p for p in (*r.frontier[:1], *r.frontier[-1:]) if not p.same_choice(r.default)]
    named = list(zip(("fastest", "best")[2 - len(ends) :], ends)) if len(r.frontier) > 1 else []
    chosen = [("the scene as it is", r.default), *named]
    noise = np.sqrt(np.maximum(r.reference.variance, 0).mean(2)) / (r.reference.luminance or 1)
    maps, low, top = charts.error_maps([*(p.error_map for _, p in chosen), noise])
    items = [(name, p.picture, p.seconds.middle, p.error.rmse.middle) for name, p in chosen]
    items.append(("reference", r.reference.picture, r.reference.seconds, r.reference.error))
    shown = []
    for (name, pixels, seconds, error), address in zip(items, maps):
        text = f"{name}: {duration(seconds)}, error {percent(error)}"
        images = "".join(
            f'<img src="{src}" alt="{escape(alt)}">'
            for src, alt in ((charts.picture(pixels), name), (address, "error"))
        )
        shown.append(f"<figure>{images}<figcaption>{escape(text)}</figcaption></figure>")
    scale = f'<div class="scale" style="background: linear-gradient(to right, {", ".join(charts.STOPS)})"></div>'
    note = escape(PICTURES.format(percent(low, 2), percent(top, 2)))
    grid = f'<div class="pictures">{"".join(shown)}</div>'
    return f'<h2>Pictures and their errors</h2><p class="soft note">{note}</p>{scale}{grid}'


def _geometry(r: Report) -> str:
    """Hits of the records whose settings may change them."""
    rows = []
    for p in r.records:
        if g := p.geometry:
            counts = (f"{x:,}" for x in (g.rays, g.lost, g.added, g.other))
            last = number(g.ulps), number(g.angle), f"{g.leaving:,}", f"{g.self_shadows:,}"
            rows.append(((label(p.setting), written(p.value), *counts, *last), p is r.default))
    heads = ("setting", "value", "rays", "hits lost", "hits added", "other object", "distance, ulps", "normal, rad")
    title = "<h2>Geometry: hits that are lost or wrong</h2>"
    return f"{title}{_table(GEOMETRY, (*heads, 'leaving rays', 'self-shadows'), rows)}" if rows else ""


def _measured(r: Report) -> str:
    """How it was measured, and notes."""
    t = r.reference
    truth = ", ".join(f"{a.removeprefix('settings.')} {written(v)}" for a, v in t.settings.items())
    facts = {
        "Error": MEASURES,
        "Reference": f"{truth}; its own standard error is {percent(t.error, 2)}; it took {duration(t.seconds)}",
        "Time": f"Of one picture, without starting and compiling, measured {len(r.default.times)} times; compiling "
        f"took {duration(r.default.compile_seconds)} once. The study took {number(r.seconds / 60, 2)} minutes.",
        "Errors that stay": "; ".join(f"{name}: {percent(x, 2)}" for name, x in r.floors.items()),
        "Scene": f"{r.scene}, SHA-256 {r.scene_hash}",
        "Notes": "; ".join(n for n in r.notes if n != STOPPED),
    } | {k: written(v) for k, v in r.machine.items()}
    items = "".join(f"<dt>{escape(str(k))}</dt><dd>{escape(v)}</dd>" for k, v in facts.items() if v)
    return f"<h2>How it was measured</h2><dl>{items}</dl>"


def _table(note: str, heads: Iterable[str], rows: Iterable[tuple[Sequence[str], bool]]) -> str:
    """A table that scrolls sideways where it is too wide. rows: their cells, and whether it is the scene as it is."""
    top, body = "".join(f'<th scope="col">{escape(h)}</th>' for h in heads), []
    for (first, *cells), own in rows:
        rest = "".join(f"<td>{escape(c)}</td>" for c in cells)
        body.append(f'<tr{OWN if own else ""}><th scope="row">{escape(first)}</th>{rest}</tr>')
    name = f"t{hashlib.sha256(note.encode()).hexdigest()[:8]}"
    # A region that scrolls must be reachable by keyboard.
    start = f'<p class="soft note" id="{name}">{escape(note)}</p>'
    start += f'<div class="scroll" role="region" aria-labelledby="{name}" tabindex="0">'
    return f"{start}<table><thead><tr>{top}</tr></thead><tbody>{''.join(body)}</tbody></table></div>"
