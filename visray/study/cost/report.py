"""The report of a study as JSON, as CSV, and as a table for the terminal."""

import csv
from io import StringIO
from math import isfinite
from typing import Any

from visray.study.cost.advice import advice, halving, label, options, present, reason
from visray.study.cost.records import Record, Report
from visray.study.cost.writing import hundredths, percent, times, written
from visray.tables import Table

PICTURES = ("picture", "variance", "error_map")
STOPPED = "stopped before its end: this is what was measured until then"


def as_json(report: Report) -> dict[str, Any]:
    """The report as json.dumps takes it, without pictures; null for an infinite number."""
    return {"advice": advice(report), "options": options(report), "reason": reason(report)} | _plain(report)


def as_csv(report: Report) -> str:
    """A row for each record, the scene as it is first; all settings are columns. Seconds and relative errors."""
    addresses = list(dict.fromkeys(a for p in report.records for a in p.settings))
    ends = [f"{name}{end}" for name in ("seconds", "rmse", "bias", "deviation") for end in ("", "_low", "_high")]
    text = StringIO()
    out = csv.writer(text, lineterminator="\n")
    out.writerow(["setting", "value", *ends, "mrse", "flip", "compile_seconds", "operations", "frontier", *addresses])
    for p in report.records:
        e = p.error
        bands = [x for b in (p.seconds, e.rmse, e.bias, e.deviation) for x in (b.middle, b.low, b.high)]
        facts = [e.mrse, e.flip, p.compile_seconds, p.operations, int(on_frontier(p, report))]
        out.writerow([p.setting, p.value, *bands, *facts, *(p.settings.get(a, "") for a in addresses)])
    return text.getvalue()


def on_frontier(record: Record, report: Report) -> bool:
    """Whether a record is on the frontier. The scene as it is may stand there under the name of a setting."""
    return any(p is record or (record.setting == "scene" and p.same_choice(record)) for p in report.frontier)


def table(report: Report) -> Table:
    """The report for the terminal: what to do and why, what half of the error takes with each setting, and notes."""
    r, slopes = report.reference, {c.setting: c.by_time for c in report.curves}
    lines = ["each setting is changed alone; in brackets: intervals of 95 %"] if report.halvings else []
    if any(h.beyond for h in report.halvings):
        lines.append("*: beyond the measured values, carried on from the measured slope")
    if slopes and any(slopes.values()):
        lines.append("k: with 0.5, half of the error takes 4 times the time; with 1, it takes twice the time")
    floors = {name: percent(x, 2) for name, x in report.floors.items() if x > 0}
    lines += [f"{name}: an error of {x} stays, however many samples are taken" for name, x in floors.items()]
    lines.append(f"errors are differences from a reference, whose own error is {percent(r.error, 2)}")
    lines.append("times are those of the compiled program; starting and compiling come on top")
    notes = "\n".join(f"- {line}" for line in [*lines, *report.notes])
    title = "\n".join(filter(None, (advice(report), reason(report), present(report), halving(report))))
    rows = Table(title=title, title_justify="left", caption=notes, caption_justify="left")
    heads = ("setting", "half of the error takes", "at the value", "least error, of the scene's", "error ~ time^-k, k")
    for name in heads if report.halvings else ("there is no error to halve",):
        rows.add_column(name)
    for h in report.halvings:
        text = times(h.factor) + " *" * h.beyond if isfinite(h.factor.middle) else "not reached"
        k, value = slopes.get(h.setting), "" if h.value is None else written(h.value)
        power = f"{hundredths(k.k)} ± {hundredths((k.high - k.low) / 2)}" if k else ""
        rows.add_row(label(h.setting), text, value, percent(h.least, 2), power)
    return rows


def _plain(x: Any) -> Any:
    """A value as json.dumps takes it: records as dicts without pictures, arrays as lists, None for an infinite
    number."""
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
