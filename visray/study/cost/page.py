"""The page of a report of costs: one HTML file that opens without a network, and the part of it that a notebook shows.

It takes matplotlib (visray.study.cost.charts): import this module where a page is asked for, and not before.
"""

from html import escape
from math import isfinite
from typing import Any

from visray.study.cost import charts
from visray.study.cost.knobs import SAMPLER, SPP
from visray.study.cost.looks import cell, document, table
from visray.study.cost.records import Halving, Point, Report
from visray.study.cost.standing import standing
from visray.study.cost.wording import STOPPED, band, changes, duration, is_number, number, percent, sampler, written

PARTS = """Bias and deviation, relative, in percent, against the value of each knob. Hollow arrowheads: what cannot be
told from 0, at the most that it may be. On the lower edge it is 0."""
JOINT = "joint: points where several knobs were turned."
BLUE = f"Blue: today's default. {JOINT}"
FRONT = "The frontier: the points that no other point measured beats in both time and error."
MAIN = """Relative error against time, both logarithmic. Each curve is a knob, a setting that trades time for accuracy,
with all others as in the scene. RMSE: root mean square error, in percent of the reference's mean luminance. spp:
samples per pixel. Bars: bands of 95 %. The yellow steps are the frontier, below which nothing was measured; the star
is the scene as it is. k: the error falls as time^-k, so that with k = 0.5 half of the error takes 4 times the time; in
brackets its interval of 95 %. Dashed: errors that more samples do not get below, and the time that compiling takes
once. Point at a mark to read its settings."""
BANDS = """Between the two numbers in brackets the true one lies with a chance of 95 %. rmse: the root mean square over
pixels and channels of the difference from the reference, in linear light, divided by the reference's mean luminance;
rmse² = bias² + deviation². Bias stays whatever the seed, deviation is noise. MRSE: mean of (x - r)² / (r + 0.01)².
FLIP: mean of that measure of visible differences, 0 to 1, of the pictures as displayed, at 67 pixels per degree."""


def page(report: Report) -> str:
    """The report as an HTML page."""
    r, date = report, report.machine.get("date", "")
    title = f"What accuracy costs: {r.scene}"
    facts = [f"{r.width} x {r.height} pixels", f"{r.seeds} seeds", f"{date}", "quick study" if r.quick else ""]
    parts = [
        f'<h1>{escape(title)}</h1><p class="soft">{escape(" · ".join(filter(None, facts)))}</p>',
        *(f'<p class="warn">{escape(text)}</p>' for text in _warnings(r)),
        f'<p class="lead">{escape(_lead(r))}</p>',
        _figure(charts.costs(r), MAIN),
        _halvings(r),
        _frontier(r),
        "<h2>What it looks like</h2>",
        _figure(
            charts.pictures(r), "Pictures as displayed (sRGB), and the error of each pixel in percent, on one scale."
        ),
        "<h2>Error by knob</h2>",
        _figure(
            charts.counts(r), "Relative error against the number of samples or rays: k is that of error ~ number^-k."
        ),
        _figure(charts.parts(r), PARTS),
        _points(r),
        _measured(r),
    ]
    return document(title, "".join(parts))


def display(report: Report) -> str:
    """The main figure and what the next halving costs, for a notebook."""
    wide = '<div style="max-width: 900px">'
    return f"{wide}{_figure(charts.costs(report), MAIN)}{_halvings(report)}</div>"


def _figure(figure: Any, caption: str) -> str:
    """A figure with its caption; nothing where there is none."""
    if figure is None:
        return ""
    return f"<figure>{charts.svg(figure, caption)}<figcaption>{escape(caption)}</figcaption></figure>"


def _warnings(r: Report) -> list[str]:
    """What a reader must know before all else."""
    found = []
    if r.noiseless:
        found.append(
            "There is no noise: all seeds give the same picture, so there is nothing to buy with samples. "
            "What is off is off in the same way every time."
        )
    if r.stopped:
        few, ranked = [c.knob for c in r.curves if len(c.points) < 2], {h.knob for h in r.halvings}
        missing = [f"more than one value of {', '.join(few)}"] if few else []
        halved = [c.knob for c in r.curves if c.kind == "bias" or (c.kind == "sampling" and not r.noiseless)]
        missing += [f"half of the error by {knob}" for knob in halved if knob not in ranked]
        missing += [] if r.curves else ["all knobs"]
        missing += [] if r.joint else ["points where several knobs are turned"]
        found.append("The study was stopped before its end. Missing: " + ("; ".join(missing) or "later points") + ".")
    if r.quick:
        found.append("This was the quick study: its bands are wider than those of the full one.")
    return found


def _lead(r: Report) -> str:
    """The report in a few sentences."""
    d, there = r.default, [h for h in r.halvings if isfinite(h.factor.middle)]
    error = band(d.error.rmse, percent) if d.error.rmse.middle > 0 else "nothing that could be measured"
    text = f"On a picture of {r.width} x {r.height} pixels, today's default takes {duration(d.seconds)} "
    text += f"and is off by {error}; in brackets: where the true number lies, with a chance of 95 %. "
    if there:
        best = min(there, key=lambda h: (h.rank, h.factor.middle))
        least = "Of what was measured so far, half of that error" if r.stopped else "Half of that error"
        text += f"{least} costs least with {_halved(best, r)}"
        equals = [h for h in there if h.rank == best.rank and h is not best]
        names = ", ".join(f"{sampler(h.knob)} samples" if sampler(h.knob) else h.knob for h in equals)
        text += f" Just as good, as far as measurement can tell: {names}." if equals else ""
    elif r.halvings and r.stopped:
        text += "None of the knobs measured so far halves that error."
    elif r.halvings:
        text += "No knob alone halves that error within what was measured."
    return text


def _start(h: Halving, r: Report) -> Any:
    """The default's value of a knob; None where its curve does not say."""
    points = [p for c in r.curves if c.knob == h.knob for p in c.points]
    return next((p.value for p in points if p.same_choice(r.default)), r.default.settings.get(h.knob))


def _halved(h: Halving, r: Report) -> str:
    """What half of the error costs by a knob, as a sentence."""
    if not isfinite(h.factor.middle):
        return f"not reached by what was measured: at best {percent(h.least)} of today's error."
    start, text = _start(h, r), f"{h.knob} at {written(h.value)}"
    if sampler(h.knob):
        text = f"{written(h.value)} {sampler(h.knob)} samples per pixel{_instead(sampler(h.knob), r)}"
    elif is_number(start) and is_number(h.value) and h.value > start > 0:
        text = f"{number(h.value / start)} times the {h.knob} ({written(start)} → {written(h.value)})"
    elif start is not None:
        text += f" (today {written(start)})"
    return f"{text}: {number(h.factor.middle)} times the time{', beyond what was measured' if h.beyond else ''}."


def _instead(name: str, r: Report) -> str:
    """How many samples the default takes, where it says so, and of which sampler, where that is another."""
    count, own = (r.default.settings.get(a) for a in (SPP, SAMPLER))
    if count is None or own is None:
        return ""
    own = sampler(f"samples, {own}")
    return f" instead of {written(count)}" if own == name else f" (today {written(count)} {own})"


def _halvings(r: Report) -> str:
    """What half of the default's error costs, knob by knob."""
    head = "<h2>What the next halving of the error costs, and by which knob</h2>"
    if not r.halvings:
        why = "There is no noise that samples could halve." if r.noiseless else "It was not measured."
        why = why if r.default.error.rmse.middle > 0 else "There is no error to halve."
        return f"{head}<p>{why}</p>"
    rows, ranks = [], [h.rank for h in r.halvings]
    for h in sorted(r.halvings, key=lambda h: h.rank):
        rank = f"{h.rank} =" if ranks.count(h.rank) > 1 else str(h.rank)
        low, high = number(h.factor.low), number(h.factor.high)
        spread = f"{low} to {high}" if isfinite(h.factor.high) else f"at least {low}" if isfinite(h.factor.low) else "-"
        cells = [
            cell(rank, head=True),
            cell(h.knob),
            cell(_halved(h, r)),
            cell(spread),
            cell(percent(h.least)),
        ]
        rows.append((cells, False))
    names = ("rank", "knob", "half of the error", "times the time, 95 %", "least error measured with it, of today's")
    note = "Each knob alone, cheapest first; time as a multiple of the default's. "
    note += "Knobs with the same rank (=) cannot be told apart."
    if any(h.beyond for h in r.halvings):
        note += " Beyond what was measured: by the law of the last points of a knob, carried on."
    return head + table(note, names, rows)


def _every(r: Report) -> list[Point]:
    """All points, the default first, each once."""
    found: list[Point] = []
    for p in (r.default, *(p for c in r.curves for p in c.points), *r.joint, *r.frontier):
        if not any(p is other for other in found):
            found.append(p)
    return found


def _standing(r: Report) -> str:
    return standing(_every(r), r.default)


def _frontier(r: Report) -> str:
    """The frontier with the settings of each of its points, and the default among them."""
    d, on = r.default, any(p.same_choice(r.default) for p in r.frontier)
    shown = sorted([*(p for p in r.frontier if not p.same_choice(d)), d], key=lambda p: p.seconds.middle)
    each = [d.settings | p.settings for p in shown]
    names = list(dict.fromkeys(k for settings in each for k in settings))
    vary = [k for k in names if any(s.get(k) != each[0].get(k) for s in each)]
    rows = []
    for p, settings in zip(shown, each):
        turned, error, base = changes(p, d), p.error.rmse.middle, d.error.rmse.middle
        name = p.knob if p is not d else "today's default" if on else "today's default, not on it"
        texts = duration(p.seconds.middle), number(p.seconds.middle / d.seconds.middle), percent(error)
        cells = [cell(name, head=True), *(cell(t) for t in (*texts, number(error / base if base > 0 else None)))]
        rows.append(([*cells, *(cell(written(settings.get(k)), turned=k in turned) for k in vary)], p is d))
    heads = ("point", "time", "times the default's", "error", "times the default's", *vary)
    note = f"In the order of time; error: relative RMSE. Yellow: settings that are not the default's. {BLUE}"
    rest = ", ".join(f"{k} = {written(d.settings[k])}" for k in names if k not in vary and k in d.settings)
    rest = f'<p class="soft">The same everywhere: {escape(rest)}.</p>' if rest else ""
    stands = _standing(r)
    stands = f"{stands[0].upper()}{stands[1:]}."
    return f"<h2>The frontier</h2><p>{FRONT} {escape(stands)}</p>{table(note, heads, rows)}{rest}"


def _points(r: Report) -> str:
    """All that was measured, one row for each point."""
    every = _every(r)
    heads = [
        "knob",
        "value",
        "time",
        "compile",
        "operations",
        "rmse, %",
        "bias, %",
        "deviation, %",
        "MRSE",
        "FLIP",
    ]
    geometry = any(p.geometry for p in every)
    if geometry:
        heads += ["first hits lost", "added", "other object", "of rays", "distance, ulps", "normal, rad"]
        heads += ["self-shadows", "of leaving rays"]
    rows = []
    for p in every:
        turned = ", ".join(f"{k} = {written(v)}" for k, v in changes(p, r.default).items())
        value = turned if p.knob == "joint" and turned else written(p.value)
        e = p.error
        cells = [cell(p.knob, head=True), cell(value, p.value if is_number(p.value) else None)]
        cells += [cell(duration(p.seconds), p.seconds.middle), cell(duration(p.compile_seconds), p.compile_seconds)]
        cells += [cell(f"{p.operations:,}", p.operations)]
        cells += [cell(band(b, lambda x: number(100 * x)), b.middle) for b in (e.rmse, e.bias, e.deviation)]
        cells += [cell(number(x), x) for x in (e.mrse, e.flip)]
        if geometry:
            g = p.geometry
            found = (g.lost, g.added, g.other, g.rays, g.ulps, g.angle, g.self_shadows, g.leaving) if g else (None,) * 8
            cells += [cell(f"{x:,}" if isinstance(x, int) else number(x), x) for x in found]
        rows.append((cells, p.same_choice(r.default)))
    note = f"Press the head of a column to sort by it. In brackets: bands of 95 %. {BLUE}"
    note += " What rmse, MRSE and FLIP are is told below, at Errors."
    return f"<h2>All points</h2>{table(note, heads, rows, 'sortable')}"


def _measured(r: Report) -> str:
    """How it was measured, and what else a reader must know."""
    t = r.reference
    truth = ", ".join(f"{k} = {written(v)}" for k, v in t.settings.items())
    bands = f"{r.seeds} seeds for each error: pictures that differ in their random numbers only."
    bands = "There is no noise, so one seed is as good as all." if r.noiseless else bands
    facts = {
        "Scene": f"{r.scene}, {r.width} x {r.height} pixels; SHA-256 {r.scene_hash}",
        "Reference": f"{truth}; its own standard error is {percent(t.error)} (relative); it took {duration(t.seconds)}",
        "Errors": f"{bands} {BANDS}",
        "Time": "That of the kernel once compiled; compiling comes on top of it, once. "
        f"Each time was measured {len(r.default.times)} times. The study took {number(r.seconds / 60, 2)} minutes.",
        "Floors": "; ".join(f"{name}: {percent(x)}" for name, x in r.floors.items()) or "none",
    } | {k: written(v) for k, v in r.machine.items()}
    told = "".join(f"<dt>{escape(str(k))}</dt><dd>{escape(v)}</dd>" for k, v in facts.items())
    # What stands above is not said again.
    above = STOPPED, _standing(r)
    notes = "".join(f"<li>{escape(n)}</li>" for n in r.notes if n not in above)
    notes = f"<h2>Notes</h2><ul>{notes}</ul>" if notes else ""
    return f"{notes}<h2>How it was measured</h2><dl>{told}</dl>"
