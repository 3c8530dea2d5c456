"""What a study of costs says in sentences: what to do first, then why."""

from dataclasses import replace
from math import isfinite
from shlex import quote
from typing import Any

from visray.study.cost.choices import DEPTH, NEAR, PRECISION, SAMPLER, SCATTER, SKY, SPP, TOGETHER, is_samples
from visray.study.cost.comparing import is_number
from visray.study.cost.records import Price, Record, Report
from visray.study.cost.writing import changes, duration, interval, percent, times, written

BEYOND = " (not measured, but carried on from the measured slope)"
SAME = 0.95  # a larger share of an error or a time is called the same
# What settings are called in tables and figures, where this is not their name.
LABELS = {
    "scene": "the scene as it is",
    "depth": "path depth",
    "roots": "root tolerance",
    "sky rays": "occlusion rays, sky",
    "near rays": "occlusion rays, near",
    TOGETHER: "several together",
}


def label(setting: str) -> str:
    """What a table calls the setting of a record: "samples per pixel, sobol"."""
    sampler = setting.removeprefix("samples, ")
    return f"samples per pixel, {sampler}" if sampler != setting else LABELS.get(setting, setting)


def advice(report: Report) -> str:
    """The headline: what to do, in one sentence."""
    spp = report.default.settings.get(SPP)
    if report.noiseless:
        more = is_number(spp) and spp > 1
        return "Use 1 sample per pixel: this picture has no noise." if more else "Keep the settings: there is no noise."
    best = _best(report)
    if best is None:
        return "Keep the settings: nothing measured is clearly faster at this error, or more accurate in this time."
    error, time = (
        f"the same {name}" if share > SAME else f"{percent(share, 2)} of the {name}"
        for share, name in ((best.share, "error"), (best.factor.middle, "time"))
    )
    return f"Use {_choice(best, report)}: {error} in {time}."


def options(report: Report) -> str:
    """The advice as options of `visray render`; "" where nothing is to be changed, or its settings are not known."""
    if report.noiseless:
        return "--spp 1" if advice(report).startswith("Use") else ""
    chosen = _advised(report) or _between(report)
    return " ".join(_option(a, v) for a, v in changes(chosen, report.default).items()) if chosen else ""


def reason(report: Report) -> str:
    """What the advice rests on, in one sentence: time and error of the advised choice, and of the scene as it is. ""
    where no choice is advised, or its measurement is not known."""
    chosen, own = _advised(report), report.default
    if chosen is None:
        return "This lies between two choices that were measured." if _between(report) else ""
    return (
        f"Measured: {duration(chosen.seconds.middle)} in place of {duration(own.seconds.middle)}, and an error of "
        f"{percent(chosen.error.rmse.middle)} in place of {percent(own.error.rmse.middle)}."
    )


def halving(report: Report) -> str:
    """What to do for half of the error, and what it costs, in one sentence; "" where nothing was to be halved, or the
    advice says it."""
    best = _half(report)
    if best is None:
        return "No single setting halves the error within what was measured." if report.halvings else ""
    if best is _best(report):
        return ""
    beyond, choice = BEYOND if best.beyond else "", _choice(best, report)
    if best.factor.middle < 1 and not (report.savings or report.noiseless):
        # The advice is to keep the settings.
        unsure = "this is too uncertain to advise it"
        return f"For half of the error, try {choice}: it may take {times(best.factor)}{beyond}, but {unsure}."
    return f"For half of the error, use {choice}: it takes {times(best.factor)}{beyond}."


def present(report: Report) -> str:
    """Error and time of the scene as it is, in one sentence."""
    d, size = report.default, f"{report.width} x {report.height} pixels"
    off = d.error.rmse.middle > 0
    error = f"an error of {interval(d.error.rmse, percent)}" if off else "no error that can be measured"
    return f"As it is, the scene takes {duration(d.seconds)} for a picture of {size}, and has {error}."


def _half(report: Report) -> Price | None:
    """The cheapest way to half of the error; None if none is known."""
    return next((h for h in report.halvings if isfinite(h.factor.middle)), None)


def _best(report: Report) -> Price | None:
    """What the advice is about: the best measured choice; where none is better, half of the error, if that surely takes
    less time and lies between measured choices. None: nothing is better."""
    if report.noiseless:
        return None
    if report.savings:
        return report.savings[0]
    half = _half(report)
    return half if half and half.factor.high < 1 and not half.beyond else None


def _between(report: Report) -> Record | None:
    """A record with the settings that the advice is about, where they were not measured, but other numbers of samples
    per pixel with the same settings; else None."""
    best = _best(report)
    if report.savings or best is None or not (is_samples(best.setting) or best.setting == TOGETHER):
        return None
    near = next((p for p in report.records if p.setting == best.setting), None)
    return near and replace(near, settings=near.settings | {SPP: best.value})


def _advised(report: Report) -> Record | None:
    """The record that the advice is about; None if it advises no change, or none of the records."""
    best = _best(report)
    return best and next((p for p in report.records if (p.setting, p.value) == (best.setting, best.value)), None)


def _option(address: str, value: Any) -> str:
    """An assignment as an option of `visray render`."""
    return f"--spp {value}" if address == SPP else f"--set {quote(f'{address}={value}')}"


def _choice(price: Price, report: Report) -> str:
    """The setting and the value of a price in words: "32 sobol samples per pixel"."""
    own, value = report.default.settings, price.value
    if price.setting == TOGETHER:
        changed = {a: v for a, v in report.joint[0].settings.items() if a != SPP and v != own.get(a)}
        sampler = changed.pop(SAMPLER, own.get(SAMPLER))
        *parts, last = _samples(sampler, value), *(_in_words(a, v) for a, v in changed.items())
        return f"{', '.join(parts)} and {last}"
    if is_samples(price.setting):
        return _samples(price.setting.removeprefix("samples, "), value)
    if price.setting.endswith(("samples", "rays")):
        return f"{written(value)} {price.setting}"
    return f"{price.setting} {written(value)}" if is_number(value) else f"{written(value)} {price.setting}"


def _samples(sampler: str, count: Any) -> str:
    """Samples per pixel in words: "32 sobol samples per pixel"."""
    return f"{written(count)} {sampler} {'sample' if count == 1 else 'samples'} per pixel"


def _in_words(address: str, x: Any) -> str:
    """The value of an address in words: "4 light samples"."""
    words = {DEPTH: "a depth of {}", PRECISION: "{} precision", SKY: "{} sky rays"}
    words |= {NEAR: "{} near rays", SCATTER: "{} scatter rays"}
    text = "{} light samples" if address.startswith("lights.") else words.get(address, f"{address} {{}}")
    return (text.replace("samples", "sample").replace("rays", "ray") if x == 1 else text).format(written(x))
