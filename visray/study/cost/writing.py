"""A report of costs as JSON, as CSV, and for the terminal."""

import csv
from io import StringIO
from math import isfinite
from typing import Any

from rich.table import Table

from visray.study.cost.frontier import Step, steps
from visray.study.cost.records import Curve, Halving, Report
from visray.study.cost.wording import duration, hundredths, percent

PICTURES = ("picture", "variance", "wrong")
# Marks what no point was as dear as.
BEYOND = "*"


def as_json(report: Report) -> dict[str, Any]:
    """The report as json.dumps takes it, without pictures; null for what is infinite."""
    return _plain(report)


def as_csv(report: Report) -> str:
    """A row for each point, with all settings as columns; the default first. Seconds and relative errors."""
    points = [report.default, *(p for c in report.curves for p in c.points), *report.joint]
    addresses = list(dict.fromkeys(a for p in points for a in p.settings))
    measured = ["seconds", "rmse", "bias", "deviation"]
    ends = [name + end for name in measured for end in ("", "_low", "_high")]
    text = StringIO()
    out = csv.writer(text, lineterminator="\n")
    single = ["mrse", "flip", "compile_seconds", "operations", "frontier"]
    out.writerow(["knob", "value", *ends, *single, *addresses])
    for p in points:
        e = p.error
        bands = [x for b in (p.seconds, e.rmse, e.bias, e.deviation) for x in (b.middle, b.low, b.high)]
        # A knob's point may have the settings of another: the frontier has only one of them.
        best = any(p is other for other in report.frontier)
        facts = [e.mrse, e.flip, p.compile_seconds, p.operations, int(best)]
        out.writerow([p.knob, p.value, *bands, *facts, *(p.settings.get(a, "") for a in addresses)])
    return text.getvalue()


def table(report: Report) -> Table:
    """The report for the terminal: a row a knob, those that halve the error at the least cost first."""
    d, chosen = report.default, steps(report.curves, report.default)
    title = (
        f"error {percent(d.error.rmse.middle)} in {duration(d.seconds.middle)}: "
        f"{report.width} x {report.height} pixels, {report.seeds} seeds"
    )
    rows = Table(title=title, caption=_caption(report, chosen), caption_justify="left")
    rows.add_column("knob", min_width=len("1. samples, independent"), no_wrap=True)
    for name in ("time for half", "least error", "slope"):
        rows.add_column(name, justify="right")
    curves = {c.knob: c for c in report.curves}
    for h in report.halvings:
        rows.add_row(f"{h.rank}. {h.knob}", *_halving(h), _slope(curves[h.knob]))
    rows.add_section()
    for s in chosen:
        rows.add_row(f"{s.knob}: {s.value}", f"(x {s.seconds.middle:.2f})", f"x {s.error.middle:.2f}{_even(s)}", "")
    return rows


def _plain(x: Any) -> Any:
    """As JSON has it."""
    if isinstance(x, float):
        return x if isfinite(x) else None
    if isinstance(x, (list, tuple)):
        return [_plain(v) for v in x]
    if isinstance(x, dict):
        return {k: _plain(v) for k, v in x.items()}
    if hasattr(x, "tolist"):
        return _plain(x.tolist())
    if hasattr(x, "__dataclass_fields__"):
        return {name: _plain(getattr(x, name)) for name in x.__dataclass_fields__ if name not in PICTURES}
    return x


def _halving(h: Halving) -> tuple[str, str]:
    if not isfinite(h.factor.middle):
        return "not reached", f"x {h.least:.2f}"
    f = h.factor
    spread = f"{f.low:.2g} to {f.high:.2g}" if isfinite(f.high) else f"{f.low:.2g} or more"
    return f"x {f.middle:.2g}{BEYOND if h.beyond else ''} ({spread})", f"x {h.least:.2f}"


def _slope(c: Curve) -> str:
    s = c.by_time
    return "" if s is None else f"{hundredths(s.k)} ± {hundredths((s.high - s.low) / 2)}"


def _even(s: Step) -> str:
    return "" if s.changes else " even"


def _caption(report: Report, chosen: tuple[Step, ...]) -> str:
    """What a reader of the columns must know."""
    lines = []
    if report.halvings:
        lines.append("time for half: of today's error, by that knob alone, as a multiple of today's time (95 %)")
        lines.append("knobs of equal number are even")
    if any(h.beyond for h in report.halvings):
        lines.append(f"{BEYOND}: beyond what was measured, by the law of the last points of the knob, carried on")
    if not all(isfinite(h.factor.middle) for h in report.halvings):
        lines.append("not reached: by what was measured; more of the knob may get there, or may not")
    lines.append("least error: the least measured with that knob, as a multiple of today's")
    if report.halvings:
        lines.append("slope: k of error ~ time^-k; with 0.5, half of the error takes 4 times the time")
    if not all(s.changes for s in chosen):
        lines.append("even: an error that cannot be told from today's")
    lines += [f"{name}: {100 * x:.2g} % remain whatever the samples" for name, x in report.floors.items()]
    lines.append(f"reference: off by {100 * report.reference.error:.2g} %, took {duration(report.reference.seconds)}")
    lines += report.notes
    return "\n".join(f"- {line}" for line in lines)
