"""The page of a study of costs: it opens alone, holds all numbers, and stands what a report may hold."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from visray.study.cost import charts
from visray.study.cost.advice import advice, halving, label, options, reason
from visray.study.cost.page import display, page
from visray.study.cost.records import Band, Curve, Error, Geometry, Price, Record, Reference, Report, Slope
from visray.study.cost.report import STOPPED
from visray.study.cost.writing import changes, duration, hundredths, number, percent, times

H, W = 24, 32
RNG = np.random.default_rng(1)
LIGHT = RNG.uniform(0.1, 0.9, (H, W, 3))


def band(x: float, off: float = 0.05) -> Band:
    return Band(x, x * (1 - off), x * (1 + off))


def point(setting: str, value: object, seconds: float, bias: float, deviation: float, **more: object) -> Record:
    """A point as a study makes it: of one setting, with pictures that are as far off as it says."""
    rmse = (bias**2 + deviation**2) ** 0.5
    error = Error(band(rmse), band(bias, 0.2), band(deviation), 2 * rmse**2, rmse / 3)
    wrong = rmse * RNG.exponential(1, (H, W))
    settings = {"settings.spp": 16, "settings.depth": 6, "lights.lamp.samples": 4, "settings.sampler": "sobol"}
    settings |= more.pop("settings", {})
    picture = LIGHT + rmse * RNG.normal(0, 0.5, LIGHT.shape)
    arrays = (np.full(7, seconds), np.full(16, rmse**2), picture, wrong)
    return Record(setting, value, settings, band(seconds), 2.5, 41_234, error, *arrays, **more)


def study() -> Report:
    """As of a scene of glass: samples fall, depth stays as bias, and a few percent are left at the floors."""
    default = point("scene", "as it is", 0.52, 0.004, 0.021)
    samples = [
        point("samples, sobol", n, 0.033 * n**0.98, 0.004, 0.17 * n**-0.75, settings={"settings.spp": n})
        for n in (1, 4, 16, 64, 256, 1024)
    ]
    plain = [
        point(
            "samples, independent", n, 0.031 * n, 0.004, 0.2 * n**-0.5,
            settings={"settings.spp": n, "settings.sampler": "independent"},
        )
        for n in (1, 4, 16, 64, 256)
    ]  # fmt: skip
    light = [
        point(
            "lamp samples",
            n,
            0.4 + 0.03 * n,
            0.004,
            (0.013**2 + 0.0014 / n) ** 0.5,
            settings={"lights.lamp.samples": n},
        )
        for n in (1, 2, 4, 8, 16, 32)
    ]
    depth = [
        point("depth", n, 0.2 + 0.055 * n, 0.5 * 0.45**n, 0.021, settings={"settings.depth": n}, geometry=geometry(n))
        for n in (0, 1, 2, 3, 4, 6, 8, 12)
    ]
    precision = [
        point("precision", p, s, 0.004, 0.021, settings={"settings.precision": p})
        for p, s in (("single", 0.52), ("double", 0.71))
    ]
    joint = [
        point("together", n, s, b, d, settings={"settings.spp": n, "settings.depth": k, "lights.lamp.samples": m})
        for s, b, d, n, k, m in ((0.02, 0.1, 0.15, 1, 9, 8), (0.2, 0.02, 0.02, 9, 9, 8), (3.1, 0.001, 0.004, 100, 9, 8))
    ]
    curves = (
        Curve("samples, sobol", "sampling", tuple(samples), Slope(0.74, 0.70, 0.79, 6), Slope(0.75, 0.71, 0.8, 6)),
        Curve("samples, independent", "sampling", tuple(plain), Slope(0.5, 0.47, 0.53, 5), Slope(0.5, 0.47, 0.53, 5)),
        Curve("lamp samples", "sampling", tuple(light), Slope(0.31, 0.2, 0.4, 6), Slope(0.2, 0.1, 0.3, 6)),
        Curve("depth", "bias", tuple(depth)),
        Curve("precision", "step", tuple(precision)),
    )
    none = Band(np.inf, np.inf, np.inf)
    halvings = (
        Price("samples, sobol", 0.5, Band(2.6, 2.4, 2.8), 0.19, 41),
        Price("samples, independent", 0.5, Band(5.2, 2.6, 6), 0.35, 290, beyond=True),
        Price("lamp samples", 0.5, none, 0.64, None),
        Price("depth", 0.5, none, 0.97, None),
    )
    savings = (Price("together", 1.0, Band(0.6, 0.5, 0.7), 0.1, 12),)
    every = [default, *samples, *plain, *light, *depth, *precision, *joint]
    front, least = [], np.inf
    for p in sorted(every, key=lambda p: p.seconds.middle):
        if p.error.rmse.middle < least:
            front.append(p)
            least = p.error.rmse.middle
    settings = {"settings.spp": 16384, "settings.depth": 24, "settings.precision": "double"}
    truth = Reference(settings, 0.0003, float(LIGHT.mean()), 412.0, LIGHT, np.full(LIGHT.shape, 1e-8))
    floors = {"8-bit output": 0.0021, "single precision": 3.1e-7, "depth 6": 0.0041}
    machine = {"date": "2026-11-22", "processor": "a processor", "threads": 2, "versions": {"drjit": "1.5.0"}}
    notes = ("The lamp's samples were measured with the default's samples of a pixel.",)
    return Report(
        "glass-heart.json", "0123abcd" * 8, W, H, 16, False, default, curves, tuple(joint), tuple(front), savings,
        halvings, floors, truth, False, False, 754.0, machine, notes,
    )  # fmt: skip


def geometry(n: int) -> Geometry:
    return Geometry(65536, n, 0, 1, 12.0, 1.5e-7, 4096, 2)


def noiseless() -> Report:
    """As of a scene without lights that have a width, in pictures that are exact from some depth on."""
    r = study()
    still = [replace(p, error=exact(p.error.bias.middle if p.value != 12 else 0.0)) for p in r.curves[3].points]
    default = replace(r.default, error=exact(0.004))
    curves = (Curve("depth", "bias", tuple(still)), Curve("samples, sobol", "sampling", (default,)))
    halvings = (Price("depth", 0.5, Band(1.1, 1.0, 1.2), 0.0, 7),)
    return replace(
        r, default=default, curves=curves, joint=(), frontier=(still[0], default, still[-1]), halvings=halvings,
        savings=(), floors={}, noiseless=True,
    )  # fmt: skip


def exact(error: float) -> Error:
    return Error(Band(error, error, error), Band(error, error, error), Band(0.0, 0.0, 0.0), error**2, error)


def perfect() -> Report:
    """Nothing is off anywhere."""
    r = noiseless()
    default = replace(r.default, error=exact(0.0), error_map=np.zeros((H, W)))
    return replace(r, default=default, curves=(), frontier=(default,), savings=(), halvings=())


def stopped() -> Report:
    """After the first few points; some numbers are not known."""
    r = study()
    none = Band(np.nan, np.nan, np.nan)
    lost = replace(r.curves[0].points[1], seconds=none, error=replace(r.default.error, rmse=none, flip=np.nan))
    curves = (
        Curve("samples, sobol", "sampling", (r.curves[0].points[0], lost)),
        Curve("depth", "bias", r.curves[3].points[:1]),
    )
    return replace(
        r, curves=curves, joint=(), frontier=(), savings=(), halvings=(), floors={"8-bit output": np.nan}, stopped=True
    )


EVIL = ("<script>alert(1)</script>", "$\\frac{$ & \"quoted'", "_hidden --> ]]>", "{x} %s <b>" + "long " * 30)


def hostile() -> Report:
    """Names are the user's, and none of them is to be believed."""
    r = study()
    curves = []
    for c, name in zip(r.curves, EVIL):
        more = {f"lights.{name}.samples": name}
        points = tuple(replace(p, setting=name, settings=p.settings | more) for p in c.points)
        curves.append(replace(c, setting=name, points=points))
    front = tuple(p for c in curves for p in c.points[:2])
    halvings = tuple(replace(h, setting=name) for h, name in zip(r.halvings, EVIL))
    return replace(
        r, scene=EVIL[0], curves=tuple(curves), frontier=front, halvings=halvings, floors={EVIL[0]: 0.003},
        machine={EVIL[0]: EVIL[0]}, notes=EVIL,
    )  # fmt: skip


def wide() -> Report:
    """Pictures larger than are shown, three times as wide as high; many settings."""
    r, shape = study(), (200, 600)
    grown = lambda a: np.resize(a, (*shape, *a.shape[2:]))  # noqa: E731 - a name for a row
    every = {
        id(p): replace(p, picture=grown(p.picture), error_map=grown(p.error_map)) for p in (r.default, *r.frontier)
    }
    curves = tuple(
        replace(c, setting=f"{c.setting} of the lamp {i} in the hall") for i in range(3) for c in r.curves[:4]
    )
    truth = replace(r.reference, picture=grown(LIGHT), variance=grown(r.reference.variance))
    return replace(
        r, width=600, height=200, curves=curves, default=every[id(r.default)],
        frontier=tuple(every[id(p)] for p in r.frontier), reference=truth, quick=True,
    )  # fmt: skip


REPORTS = {f.__name__: f for f in (study, noiseless, perfect, stopped, hostile, wide)}


class Outline(HTMLParser):
    """What a page holds: its text, its tags and what they refer to; fails where tags are not closed in order."""

    VOID = frozenset({"meta", "br", "img", "link", "input", "hr"})

    def __init__(self, text: str):
        super().__init__()
        self.open, self.tags, self.attributes, self.rows, self.text = [], [], [], [], []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list) -> None:
        self.tags.append(tag)
        self.attributes += [(tag, *pair) for pair in attrs]
        if tag not in self.VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th") and self.rows:
            self.rows[-1].append("")

    def handle_startendtag(self, tag: str, attrs: list) -> None:
        self.attributes += [(tag, *pair) for pair in attrs]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data
        if not {"script", "style"} & set(self.open):
            self.text.append(data)


class Pages(dict):
    """The pages by the names of their reports, each made when it is first asked for."""

    def __missing__(self, name: str) -> str:
        self[name] = page(REPORTS[name]())
        return self[name]


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    return Pages()


@pytest.mark.parametrize(
    "name", [x if x in ("study", "hostile") else pytest.param(x, marks=pytest.mark.slow) for x in REPORTS]
)
def test_a_page_opens_alone(pages: dict[str, str], name: str) -> None:
    """Its tags are balanced, it asks no network for anything, and no number in it is none."""
    text = pages[name]
    found = Outline(text)
    assert len(text) < 3e6
    assert not {"link", "iframe", "object", "base", "script"} & set(found.tags)
    for tag, attribute, value in found.attributes:
        if attribute.startswith("xmlns"):
            continue
        assert "//" not in (value or "").removeprefix("data:") or value.startswith("data:image/png;base64,"), tag
        if attribute in ("src", "href", "xlink:href"):
            assert value.startswith(("#", "data:image/png;base64,"))
        assert not attribute.startswith("on"), "names must not become code"
    assert not re.search(r"@import|url\((?!#)", text)
    bare = re.sub(r"base64,[^\"]*", "", text)
    assert not re.search(r"\b(nan|inf|NaN|Infinity)\b", bare)
    ids = [value for _, attribute, value in found.attributes if attribute == "id"]
    assert len(ids) == len(set(ids))
    told = {value[1:] for _, attribute, value in found.attributes if attribute.endswith("href") and value[0] == "#"}
    assert told <= set(ids), "a figure is without a part of it"


def test_it_holds_all_records_and_figures(pages: dict[str, str]) -> None:
    r, found = study(), Outline(pages["study"])
    rows = [row for row in found.rows if len(row) == 10 and row[4] != "hits lost"][1:][: len(r.records)]
    assert [row[:2] for row in rows] == [[label(p.setting), str(p.value)] for p in r.records]
    for p, row in zip(r.records, rows):
        e, b = p.error, p.error.rmse
        assert row[2] == duration(p.seconds.middle)
        assert row[3] == percent(p.seconds.middle / 0.52, 2)
        assert row[4] == f"{100 * b.middle:.3g} ({100 * b.low:.3g} to {100 * b.high:.3g})"
        assert row[7:9] == [f"{e.mrse:.2g}", f"{e.flip:.2g}"]
    hits = [row[2:6] for row in found.rows if row[0] == label("depth") and row[2:3] == ["65,536"]]
    assert hits == [["65,536", str(p.geometry.lost), "0", "1"] for p in r.records if p.geometry]
    text = " ".join(found.text)
    for part in (
        "8-bit output: 0.21 %",
        "0.03 %",
        "16 pictures of each choice",
        "drjit 1.5.0",
        *r.notes,
        advice(r),
        halving(r),
    ):
        assert part in text
    # A chart for wide windows and one for narrow ones; pictures with their error maps.
    assert sum(tag == "svg" and value == "Error against time" for tag, _, value in found.attributes) == 2
    assert found.tags.count("img") == 8


def test_marks_say_what_they_are(pages: dict[str, str]) -> None:
    assert "<title>depth 12: 860 ms, error 2.1 %</title>" in pages["study"]


def test_it_speaks_plain_english(pages: dict[str, str]) -> None:
    """The headline says what to do; shares of time are percent."""
    r = study()
    assert advice(r) == (
        "Use 12 sobol samples per pixel, a depth of 9 and 8 light samples: the same error in 60 % of the time."
    )
    assert halving(r) == (
        "For half of the error, use 41 sobol samples per pixel: it takes 2.6 times the time (2.4 to 2.8)."
    )
    only = lambda setting, value: advice(replace(r, savings=(Price(setting, 1.0, Band(0.6, 0.5, 0.7), 0.1, value),)))  # noqa: E731
    assert only("samples, sobol", 39).startswith("Use 39 sobol samples per pixel: the same")
    assert only("light samples", 4).startswith("Use 4 light samples: the same")
    assert only("precision", "single").startswith("Use single precision: the same")
    assert only("depth", 2).startswith("Use depth 2: the same")
    assert advice(replace(r, savings=())).startswith("Keep the settings: ")
    assert advice(noiseless()) == "Use 1 sample per pixel: this picture has no noise."
    never = tuple(h for h in r.halvings if h.value is None)
    assert halving(replace(r, halvings=never)) == "No single setting halves the error within what was measured."
    assert times(Band(1.004, 0.94, 1.1)) == "the same time (0.94 to 1.1 times)"
    assert times(Band(0.6, 0.5, 1.2)) == "60 % of the time (50 to 120)"
    assert times(Band(3.79, 3.1, np.inf)) == "3.8 times the time (at least 3.1)"
    for text in pages.values():
        assert not re.search(r"today's default|of the time it|[01](\.\d+)? of (the|its) time|are even", text)


def test_the_advice_is_followed_by_options_and_what_was_measured(pages: dict[str, str]) -> None:
    """Options and numbers are those of the advised record. Where none of the records is advised, there are none."""
    r = study()
    (chosen,) = (p for p in r.joint if p.value == 9)
    advised = replace(r, savings=(Price("together", 0.1, Band(0.4, 0.3, 0.5), 0.1, 9),))
    changed = changes(chosen, r.default)
    assert [w.removeprefix("--set ") for w in options(advised).replace("--spp ", "settings.spp=").split(" --set ")] == [
        f"{a}={v}" for a, v in changed.items()
    ]
    assert reason(advised) == "Measured: 200 ms in place of 520 ms, and an error of 2.83 % in place of 2.14 %."
    text = " ".join(Outline(page(advised)).text)
    assert f"visray render SCENE {options(advised)}" in text and reason(advised) in text
    assert options(r) == reason(r) == "" and "visray render" not in pages["study"]
    assert options(noiseless()) == "--spp 1" and reason(noiseless()) == ""


def test_advice_and_half_of_the_error_do_not_contradict_each_other() -> None:
    """Where no measured choice is better, half of the error takes more time, or surely less, or that is not sure."""

    def said(setting: str, value: int, *factor: float, beyond: bool = False) -> tuple[str, str, str, str]:
        r = replace(study(), savings=(), halvings=(Price(setting, 0.5, Band(*factor), 0.2, value, beyond),))
        return advice(r), reason(r), halving(r), options(r)

    keep = "Keep the settings: nothing measured is clearly faster at this error, or more accurate in this time."
    assert said("samples, sobol", 27, 1.4, 1.3, 1.5) == (
        keep, "", "For half of the error, use 27 sobol samples per pixel: it takes 1.4 times the time (1.3 to 1.5).", ""
    )  # fmt: skip
    unsure = (
        "For half of the error, try 27 sobol samples per pixel: it may take 80 % of the time (50 to 120), but this is "
    )
    assert said("samples, sobol", 27, 0.8, 0.5, 1.2) == (keep, "", unsure + "too uncertain to advise it.", "")
    between = "This lies between two choices that were measured."
    found = said("samples, independent", 27, 0.6, 0.5, 0.7)
    assert found[:3] == (
        "Use 27 independent samples per pixel: 50 % of the error in 60 % of the time.", between, ""
    )  # fmt: skip
    assert set(found[3].split(" --set ")) == {"--spp 27", "settings.sampler=independent"}
    found = said("together", 12, 0.6, 0.5, 0.7)
    assert found[0].startswith("Use 12 sobol samples per pixel, a depth of 9 and 8 light samples: 50 % of the error in")
    assert found[1:3] == (between, "") and "--spp 12 " in found[3] and "settings.depth=9" in found[3]
    # One that was measured says so.
    assert said("samples, sobol", 64, 0.6, 0.5, 0.7)[1].startswith("Measured: ")
    # What is carried on beyond the measured values is no advice.
    carried = said("samples, sobol", 2000, 0.6, 0.5, 0.7, beyond=True)
    assert carried[0] == keep and "it may take 60 % of the time (50 to 70) (not measured" in carried[2]
    # Where there is an advice, half of the error is an offer beside it.
    r = replace(study(), halvings=(Price("samples, sobol", 0.5, Band(0.8, 0.5, 1.2), 0.2, 27),))
    assert advice(r).startswith("Use 12 sobol") and halving(r).startswith("For half of the error, use 27 sobol samples")


def test_settings_have_plain_names(pages: dict[str, str]) -> None:
    """Words for them inside the program are on no page."""
    assert label("samples, sobol") == "samples per pixel, sobol" and label("lamp samples") == "lamp samples"
    assert label("scene") == "the scene as it is" and "together" in label("together")
    assert not any(
        re.search(r"(knob|record|varied|turned)\b", " ".join(Outline(pages[name]).text), re.I)
        for name in ("study", "wide")
    )


def test_what_is_not_reached_or_not_measured_is_told(pages: dict[str, str]) -> None:
    rows = {row[0]: row[1:] for row in Outline(pages["study"]).rows if len(row) == 5}
    assert rows[label("samples, sobol")] == [
        "2.6 times the time (2.4 to 2.8)",
        "41",
        "19 %",
        "time^-0.74 (0.70 to 0.79)",
    ]
    assert rows[label("samples, independent")][1] == "290 (not measured)"
    assert rows["lamp samples"][:3] == ["not reached", "-", "64 %"]


def test_a_bias_that_may_be_nothing_has_only_an_upper_end() -> None:
    r = study()
    unsure = replace(r.default, error=replace(r.default.error, bias=Band(1e-6, 0.0, 0.02)))
    assert "at most 2" in page(replace(r, default=unsure)) and "at most 2" not in page(r)


def test_durations_are_in_units_that_can_be_read() -> None:
    texts = ["33.9 ms", "999 ms", "1 s", "12.3 s", "754 s"]
    assert [duration(x) for x in (0.0339, 0.9994, 0.9996, 12.34, 754.0)] == texts
    assert duration(Band(0.9, 0.8, 1.2)) == "900 ms (800 to 1,200)" and duration(None) == "-"
    assert number(999.7) == "1,000" and number(0.9997) == "1"
    assert [hundredths(x) for x in (-0.004, 0.004, -0.0, -0.006, 0.5)] == ["0.00", "0.00", "0.00", "-0.01", "0.50"]


def test_what_is_wider_than_the_window_scrolls(pages: dict[str, str]) -> None:
    """Tables scroll, and can be reached by keyboard; charts and type have a form for narrow windows."""
    found, css = Outline(pages["study"]), pages["study"].split("<style>")[1].split("</style>")[0]
    assert ".scroll { overflow-x: auto" in css and css.count("@media (max-width: 640px)") == 2
    regions = [value for _, attribute, value in found.attributes if attribute == "tabindex"]
    assert len(regions) == found.tags.count("table") == 3


def test_stopped_and_without_noise_it_says_so(pages: dict[str, str]) -> None:
    assert "Ctrl-C ended this study early" in pages["stopped"] and "Ctrl-C" not in pages["study"]
    r = study()
    text = " ".join(Outline(page(replace(r, notes=(*r.notes, STOPPED), stopped=True))).text)
    assert STOPPED not in text and r.notes[0] in text
    assert "this picture has no noise" in pages["noiseless"]


def test_names_are_text(pages: dict[str, str]) -> None:
    found = Outline(pages["hostile"])
    assert not {"script", "b"} & set(found.tags)
    text = "".join(found.text)
    assert all(name in text for name in EVIL)


def test_a_notebook_shows_the_advice_and_the_chart() -> None:
    found = Outline(display(study()))
    assert {"svg", "figure"} <= set(found.tags) and not {"script", "table"} & set(found.tags)
    assert "60 % of the time" in " ".join(found.text)


def test_the_same_report_makes_the_same_page() -> None:
    r = perfect()
    assert page(r) == page(r)


def test_axes_hold_all_numbers_and_zero_lies_on_their_edge() -> None:
    axis = charts._Axis([Band(1.0, 0.9, 1.2), Band(0.0, 0.0, 0.0), Band(np.nan, np.nan, np.nan)], 50, 450)
    assert axis(0.0) == axis(-1.0) == 50 and 50 < axis(0.9) < axis(1.2) < 450
    assert all(50 <= axis(t) <= 450 for t in axis.ticks()) and axis.ticks()
    assert axis(axis_end := 10**axis.high) == 450 and axis_end >= 10 * 10**axis.low * (1 - 1e-9)


def test_thumbnails_are_means_of_whole_blocks() -> None:
    large = np.arange(515 * 300.0).reshape(515, 300)
    small = charts.thumbnail(large)
    assert small.shape == (171, 100) and small[0, 0] == large[:3, :3].mean()
    assert np.array_equal(charts.thumbnail(LIGHT), LIGHT)
