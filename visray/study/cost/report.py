"""The report of a study in words: its advice, JSON, CSV, the table for the terminal, and how numbers are written."""

import csv
from collections.abc import Callable
from io import StringIO
from math import isfinite
from typing import Any

from visray.study.cost.comparing import is_number
from visray.study.cost.knobs import DEPTH, NEAR, PRECISION, SAMPLER, SCATTER, SKY, SPP, TOGETHER, is_samples
from visray.study.cost.records import Band, Price, Record, Report
from visray.tables import Table

PICTURES = ("picture", "variance", "error_map")
BEYOND = " (carried on from the measured slope)"
SAME = 0.95  # a larger share of an error or a time is called the same
STOPPED = "stopped before its end: this is what was measured until then"


def as_json(report: Report) -> dict[str, Any]:
    """The report as json.dumps takes it, without pictures; null for an infinite number."""
    return {"advice": advice(report)} | _plain(report)


def as_csv(report: Report) -> str:
    """A row for each record, the scene as it is first; all settings are columns. Seconds and relative errors."""
    addresses = list(dict.fromkeys(a for p in report.records for a in p.settings))
    ends = [f"{name}{end}" for name in ("seconds", "rmse", "bias", "deviation") for end in ("", "_low", "_high")]
    text = StringIO()
    out = csv.writer(text, lineterminator="\n")
    out.writerow(["knob", "value", *ends, "mrse", "flip", "compile_seconds", "operations", "frontier", *addresses])
    for p in report.records:
        e = p.error
        bands = [x for b in (p.seconds, e.rmse, e.bias, e.deviation) for x in (b.middle, b.low, b.high)]
        facts = [e.mrse, e.flip, p.compile_seconds, p.operations, int(on_frontier(p, report))]
        out.writerow([p.knob, p.value, *bands, *facts, *(p.settings.get(a, "") for a in addresses)])
    return text.getvalue()


def on_frontier(record: Record, report: Report) -> bool:
    """Whether a record is on the frontier. The scene as it is may stand there under the name of a knob."""
    return any(p is record or (record.knob == "scene" and p.same_choice(record)) for p in report.frontier)


def advice(report: Report) -> str:
    """The headline: what to do, in one sentence."""
    spp = report.default.settings.get(SPP)
    if report.noiseless:
        more = is_number(spp) and spp > 1
        return "Use 1 sample per pixel: this picture has no noise." if more else "Keep the settings: there is no noise."
    if not report.savings:
        return "Keep the settings: nothing measured is clearly faster or more accurate at no cost."
    best = report.savings[0]
    error, time = (
        f"the same {name}" if share > SAME else f"{percent(share, 2)} of the {name}"
        for share, name in ((best.share, "error"), (best.factor.middle, "time"))
    )
    return f"Use {_choice(best, report)}: {error} in {time}."


def halving(report: Report) -> str:
    """What half of the error takes at least, in one sentence; "" where nothing was to be halved."""
    best = next((h for h in report.halvings if isfinite(h.factor.middle)), None)
    if best is None:
        return "No single knob halves the error within what was measured." if report.halvings else ""
    beyond = BEYOND if best.beyond else ""
    return f"Half of the error takes {times(best.factor)}, with {_choice(best, report)}{beyond}."


def present(report: Report) -> str:
    """Error and time of the scene as it is, in one sentence."""
    d, size = report.default, f"{report.width} x {report.height} pixels"
    off = d.error.rmse.middle > 0
    error = f"an error of {interval(d.error.rmse, percent)}" if off else "no error that can be measured"
    return f"As it is, the scene takes {duration(d.seconds)} for a picture of {size}, and has {error}."


def _choice(price: Price, report: Report) -> str:
    """What to use for a price, in words."""
    own, value = report.default.settings, price.value
    if price.knob == TOGETHER:
        turned = {a: v for a, v in report.joint[0].settings.items() if a != SPP and v != own.get(a)}
        sampler = turned.pop(SAMPLER, own.get(SAMPLER))
        *parts, last = _samples(sampler, value), *(_setting(a, v) for a, v in turned.items())
        return f"{', '.join(parts)} and {last}"
    if is_samples(price.knob):
        return _samples(price.knob.removeprefix("samples, "), value)
    if price.knob.endswith(("samples", "rays")):
        return f"{written(value)} {price.knob}"
    return f"{price.knob} {written(value)}" if is_number(value) else f"{written(value)} {price.knob}"


def _samples(sampler: str, count: Any) -> str:
    return f"{written(count)} {sampler} {'sample' if count == 1 else 'samples'} per pixel"


def _setting(address: str, x: Any) -> str:
    """A setting in words: "4 light samples"."""
    words = {DEPTH: "a depth of {}", PRECISION: "{} precision", SKY: "{} sky rays"}
    words |= {NEAR: "{} near rays", SCATTER: "{} scatter rays"}
    text = "{} light samples" if address.startswith("lights.") else words.get(address, f"{address} {{}}")
    return (text.replace("samples", "sample").replace("rays", "ray") if x == 1 else text).format(written(x))


def table(report: Report) -> Table:
    """The report for the terminal: advice, the price of half the error by each knob, and notes."""
    r, slopes = report.reference, {c.knob: c.by_time for c in report.curves}
    lines = ["each knob is turned alone; in brackets: intervals of 95 %"] if report.halvings else []
    if any(h.beyond for h in report.halvings):
        lines.append("*: beyond the measured values, carried on from the measured slope")
    floors = {name: percent(x, 2) for name, x in report.floors.items() if x > 0}
    lines += [f"{name}: an error of {x} stays, whatever the samples" for name, x in floors.items()]
    lines.append(f"the reference has an error of {percent(r.error, 2)}, and took {duration(r.seconds)}")
    lines.append("times are those of compiled kernels, without tracing in Python")
    notes = "\n".join(f"- {line}" for line in [*lines, *report.notes])
    title = f"{advice(report)}\n{present(report)}"
    rows = Table(title=title, title_justify="left", caption=notes, caption_justify="left")
    heads = ("knob", "half of the error takes", "with", "least error, of the scene's", "error ~ time^-k")
    for name in heads if report.halvings else ("nothing to halve",):
        rows.add_column(name)
    for h in report.halvings:
        text = times(h.factor) + " *" * h.beyond if isfinite(h.factor.middle) else "not reached"
        k, value = slopes.get(h.knob), "" if h.value is None else written(h.value)
        power = f"{hundredths(k.k)} ± {hundredths((k.high - k.low) / 2)}" if k else ""
        rows.add_row(h.knob, text, value, percent(h.least, 2), power)
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


def number(x: float | None, digits: int = 3) -> str:
    """A number as text; a dash for none. Large numbers have no exponent."""
    if x is None or not isfinite(x):
        return "-"
    # 999.7 rounds to 1,000, not to 1e+03.
    return f"{x:,.0f}" if abs(float(f"{x:.{digits}g}")) >= 10**digits else f"{x:.{digits}g}"


def hundredths(x: float) -> str:
    """With two decimals; what rounds to 0 has no sign."""
    return f"{round(x, 2) + 0.0:.2f}"


def percent(x: float, digits: int = 3) -> str:
    """A share in percent."""
    return f"{number(100 * x, digits)} %"


def times(factor: Band) -> str:
    """A multiple of the time with its interval: "3.8 times the time (3.1 to 4.7)"; in percent below 1."""
    if number(factor.middle, 2) == "1" and isfinite(factor.high):
        return f"the same time ({number(factor.low, 2)} to {number(factor.high, 2)} times)"
    write: Callable[[float], str] = (lambda x: number(100 * x, 2)) if factor.middle < 1 else (lambda x: number(x, 2))
    text = f"{write(factor.middle)} % of the time" if factor.middle < 1 else f"{write(factor.middle)} times the time"
    ends = f"{write(factor.low)} to {write(factor.high)}" if isfinite(factor.high) else f"at least {write(factor.low)}"
    return f"{text} ({ends})"


def interval(b: Band, write: Callable[[float], str] = number) -> str:
    """A number with its interval."""
    return f"{write(b.middle)} ({write(b.low).removesuffix(' %')} to {write(b.high)})"


def duration(seconds: float | Band | None) -> str:
    """Seconds as text, with their interval where they have one; in milliseconds below one second."""
    middle = seconds.middle if isinstance(seconds, Band) else seconds
    if middle is None or not isfinite(middle):
        return "-"
    factor, unit = (1e3, "ms") if float(f"{middle:.3g}") < 1 else (1, "s")
    scaled = lambda x: number(factor * x)  # noqa: E731 - a name for a row
    if isinstance(seconds, Band):
        return f"{scaled(middle)} {unit} ({scaled(seconds.low)} to {scaled(seconds.high)})"
    return f"{scaled(middle)} {unit}"


def written(value: Any) -> str:
    """A knob's value, or a setting, as text."""
    if isinstance(value, bool) or value is None:
        return {True: "on", False: "off", None: "-"}[value]
    if isinstance(value, dict):
        return ", ".join(f"{k} {written(v)}" for k, v in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(written, value))
    return number(value, 6) if is_number(value) else str(value)


def changes(record: Record, default: Record) -> dict[str, Any]:
    """The settings that differ from the scene's, by address."""
    before = default.settings
    return {a: v for a, v in record.settings.items() if a not in before or before[a] != v}
