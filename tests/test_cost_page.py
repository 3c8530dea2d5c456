"""The page of a study of costs: it opens alone, holds all numbers, and stands what a report may hold."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from visray.study.cost import charts
from visray.study.cost.frontier import frontier
from visray.study.cost.page import display, page
from visray.study.cost.records import Band, Curve, Error, Geometry, Halving, Point, Reference, Report, Slope
from visray.study.cost.standing import standing
from visray.study.cost.wording import STOPPED, duration, hundredths, number

# One worker makes what its tests share.
pytestmark = pytest.mark.xdist_group("pages")

H, W = 24, 32
RNG = np.random.default_rng(1)
LIGHT = RNG.uniform(0.1, 0.9, (H, W, 3))


def band(x: float, off: float = 0.05) -> Band:
    return Band(x, x * (1 - off), x * (1 + off))


def point(knob: str, value: object, seconds: float, bias: float, deviation: float, **more: object) -> Point:
    """A point as a study makes it: of one knob, with pictures that are as far off as it says."""
    rmse = (bias**2 + deviation**2) ** 0.5
    error = Error(band(rmse), band(bias, 0.2), band(deviation), 2 * rmse**2, rmse / 3)
    wrong = rmse * RNG.exponential(1, (H, W))
    settings = {"settings.spp": 16, "settings.depth": 6, "lights.lamp.samples": 4, "settings.sampler": "sobol"}
    settings |= more.pop("settings", {})
    picture = LIGHT + rmse * RNG.normal(0, 0.5, LIGHT.shape)
    arrays = (np.full(7, seconds), np.full(16, rmse**2), picture, wrong)
    return Point(knob, value, settings, band(seconds), 2.5, 41_234, error, *arrays, **more)


def study() -> Report:
    """As of a scene of glass: samples fall, depth stays as bias, and a few percent are left at the floors."""
    default = point("default", None, 0.52, 0.004, 0.021)
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
        point("joint", None, s, b, d, settings={"settings.spp": n, "settings.depth": k, "lights.lamp.samples": m})
        for s, b, d, n, k, m in ((0.02, 0.1, 0.15, 1, 2, 1), (0.2, 0.02, 0.02, 9, 4, 8), (3.1, 0.001, 0.004, 100, 9, 4))
    ]
    curves = (
        Curve("samples, sobol", "sampling", tuple(samples), Slope(0.74, 0.70, 0.79, 6), Slope(0.75, 0.71, 0.8, 6)),
        Curve("samples, independent", "sampling", tuple(plain), Slope(0.5, 0.47, 0.53, 5), Slope(0.5, 0.47, 0.53, 5)),
        Curve("lamp samples", "sampling", tuple(light), Slope(0.31, 0.2, 0.4, 6), Slope(0.2, 0.1, 0.3, 6)),
        Curve("depth", "bias", tuple(depth)),
        Curve("precision", "step", tuple(precision)),
    )
    halvings = (
        Halving("samples, sobol", Band(2.6, 2.4, 2.8), 0.19, 41, 1),
        Halving("samples, independent", Band(5.2, 2.6, 6), 0.35, 290.5, 1, beyond=True),
        Halving("lamp samples", Band(np.inf, np.inf, np.inf), 0.64, None, 3),
        Halving("depth", Band(np.inf, np.inf, np.inf), 0.97, None, 3),
    )
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
        "glass-heart.json", "0123abcd" * 8, W, H, 16, False, default, curves, tuple(joint), tuple(front), halvings,
        floors, truth, False, False, 754.0, machine, notes,
    )  # fmt: skip


def geometry(n: int) -> Geometry:
    return Geometry(65536, n, 0, 1, 12.0, 1.5e-7, 4096, 2)


def noiseless() -> Report:
    """As of a scene without lights that have a width, in pictures that are exact from some depth on."""
    r = study()
    still = [replace(p, error=exact(p.error.bias.middle if p.value != 12 else 0.0)) for p in r.curves[3].points]
    default = replace(r.default, error=exact(0.004))
    curves = (Curve("depth", "bias", tuple(still)), Curve("samples, sobol", "sampling", (default,)))
    halvings = (Halving("depth", Band(1.1, 1.0, 1.2), 0.0, 7, 1),)
    return replace(
        r, default=default, curves=curves, joint=(), frontier=(still[0], default, still[-1]), halvings=halvings,
        floors={}, noiseless=True,
    )  # fmt: skip


def exact(error: float) -> Error:
    return Error(Band(error, error, error), Band(error, error, error), Band(0.0, 0.0, 0.0), error**2, error)


def perfect() -> Report:
    """Nothing is off anywhere."""
    r = noiseless()
    default = replace(r.default, error=exact(0.0), wrong=np.zeros((H, W)))
    return replace(r, default=default, curves=(), frontier=(default,), halvings=())


def stopped() -> Report:
    """After the first few points; some numbers are not known."""
    r = study()
    none = Band(np.nan, np.nan, np.nan)
    lost = replace(r.curves[0].points[1], seconds=none, error=replace(r.default.error, rmse=none, flip=np.nan))
    curves = (
        Curve("samples, sobol", "sampling", (r.curves[0].points[0], lost)),
        Curve("depth", "bias", r.curves[3].points[:1]),
    )
    return replace(r, curves=curves, joint=(), frontier=(), halvings=(), floors={"8-bit output": np.nan}, stopped=True)


EVIL = ("<script>alert(1)</script>", "$\\frac{$ & \"quoted'", "_hidden --> ]]>", "{x} %s <b>" + "long " * 30)


def hostile() -> Report:
    """Names are the user's, and none of them is to be believed."""
    r = study()
    curves = []
    for c, name in zip(r.curves, EVIL):
        points = tuple(replace(p, knob=name, settings=p.settings | {f"lights.{name}.samples": name}) for p in c.points)
        curves.append(replace(c, knob=name, points=points))
    front = tuple(p for c in curves for p in c.points[:2])
    halvings = tuple(replace(h, knob=name) for h, name in zip(r.halvings, EVIL))
    return replace(
        r, scene=EVIL[0], curves=tuple(curves), frontier=front, halvings=halvings, floors={EVIL[0]: 0.003},
        machine={EVIL[0]: EVIL[0]}, notes=EVIL,
    )  # fmt: skip


def wide() -> Report:
    """Pictures larger than are shown, three times as wide as high; many knobs."""
    r, shape = study(), (200, 600)
    grown = lambda a: np.resize(a, (*shape, *a.shape[2:]))  # noqa: E731 - a name for a row
    every = {id(p): replace(p, picture=grown(p.picture), wrong=grown(p.wrong)) for p in (r.default, *r.frontier)}
    curves = tuple(replace(c, knob=f"{c.knob} of the lamp {i} in the hall") for i in range(3) for c in r.curves[:4])
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
    assert not {"link", "img", "iframe", "object", "base"} & set(found.tags)
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


def test_it_holds_all_points_and_figures(pages: dict[str, str]) -> None:
    r, found = study(), Outline(pages["study"])
    assert found.tags.count("svg") == 4
    assert sum(tag == "svg" and attribute == "aria-label" and bool(v) for tag, attribute, v in found.attributes) == 4
    rows = [row for row in found.rows if len(row) == 18][1:]
    every = [r.default, *(p for c in r.curves for p in c.points), *r.joint]
    assert len(rows) == len(every)
    for p, row in zip(every, rows):
        e, b = p.error, p.error.rmse
        assert row[0] == p.knob
        assert row[2:4] == [duration(p.seconds), "2.5 s"]
        assert row[5] == f"{100 * b.middle:.3g} [{100 * b.low:.3g}, {100 * b.high:.3g}]"
        assert [row[4], row[8], row[9]] == ["41,234", f"{e.mrse:.3g}", f"{e.flip:.3g}"]
        assert row[10] == (str(p.geometry.lost) if p.geometry else "-")
    text = " ".join(found.text)
    for told in ("8-bit output: 0.21 %", "0.03 %", "16 seeds", "drjit 1.5.0", *r.notes):
        assert told in text


def test_marks_say_what_they_are(pages: dict[str, str]) -> None:
    assert "<title>depth 12: 860 ms, 2.1 % (depth 12)</title>" in pages["study"]


def test_the_halving_is_told_in_sentences(pages: dict[str, str]) -> None:
    """With what is turned from where to where; where a knob was not enough, how far it came; equal ranks as equal."""
    rows = {row[1]: row for row in Outline(pages["study"]).rows if len(row) == 5}
    assert rows["samples, sobol"][2] == "41 Sobol samples per pixel instead of 16: 2.6 times the time."
    independent = "290.5 independent samples per pixel (today 16 Sobol): 5.2 times the time, beyond what was measured."
    assert rows["samples, independent"][2] == independent
    assert rows["lamp samples"][2] == "not reached by what was measured: at best 64 % of today's error."
    assert [rows[k][0] for k in ("samples, sobol", "samples, independent", "depth")] == ["1 =", "1 =", "3 ="]
    assert rows["samples, independent"][3] == "2.6 to 6" and rows["depth"][3] == "-"
    assert "Beyond what was measured: by the law of the last points of a knob, carried on." in pages["study"]
    assert "Beyond what was measured" not in pages["noiseless"]


def test_the_lead_is_plain() -> None:
    """Of which picture, in units that can be read; what is as good; and no more than what was measured."""
    r = study()
    assert "On a picture of 32 x 24 pixels, today's default takes 520 [494, 546] ms and is off by 2.14 %" in told(r)
    assert "Just as good, as far as measurement can tell: independent samples." in told(r)
    other = replace(r, halvings=(replace(r.halvings[0], knob="lamp samples", value=8), replace(r.halvings[2], rank=1)))
    assert "costs least with 2 times the lamp samples (4 → 8): 2.6 times the time." in told(other)
    assert "Just as good" not in told(other)
    none = replace(r, halvings=r.halvings[2:])
    assert "No knob alone halves that error within what was measured." in told(none)
    assert "None of the knobs measured so far halves that error." in told(replace(none, stopped=True))
    assert "Of what was measured so far, half of that error" in told(replace(r, stopped=True))


def test_the_lead_is_by_the_best_knob_that_gets_there() -> None:
    """Whatever comes before it in its rank: never that none does, where the table has one."""
    r = study()
    never = Halving("depth", Band(np.inf, 2.0, np.inf), 0.6, None, 1)
    dear, best, later = (
        Halving(name, Band(x, 2.0, 9.0), 0.3, 41, rank)
        for name, x, rank in (("lamp samples", 4.1, 1), ("samples, sobol", 2.65, 1), ("samples, independent", 2.5, 2))
    )
    for stopped in (True, False):
        text = told(replace(r, halvings=(never, dear, best, later), stopped=stopped))
        assert "costs least with 41 Sobol samples per pixel instead of 16: 2.65 times the time." in text
        assert "Just as good, as far as measurement can tell: lamp samples." in text
        assert "halves that error" not in text


def test_durations_are_in_units_that_can_be_read() -> None:
    assert [duration(x) for x in (0.0339, 0.9994, 0.9996, 12.34, 754.0)] == [
        "33.9 ms",
        "999 ms",
        "1 s",
        "12.3 s",
        "754 s",
    ]
    assert duration(Band(0.9, 0.8, 1.2)) == "900 [800, 1,200] ms" and duration(None) == "-"
    assert number(999.7) == "1,000" and number(0.9997) == "1"


def test_what_a_table_says_is_above_what_scrolls(pages: dict[str, str]) -> None:
    found = Outline(pages["study"])
    notes = {value for _, attribute, value in found.attributes if attribute == "id"}
    tied = [value for tag, attribute, value in found.attributes if (tag, attribute) == ("table", "aria-describedby")]
    assert len(tied) == len(set(tied)) == 3 and set(tied) <= notes and "caption" not in found.tags


def test_what_may_be_nothing_is_drawn_as_at_most_so_much() -> None:
    """Of a bias whose band reaches 0 only the upper end is drawn."""
    r = study()
    unsure = Band(1e-6, 0.0, 0.02)
    points = [replace(p, error=replace(p.error, bias=unsure)) for p in r.curves[3].points[:3]]
    curve = replace(r.curves[3], points=(*points, *r.curves[3].points[3:]))
    for curves, arrows in (((r.curves[3],), []), ((curve,), [0.02] * 3)):
        figure = charts.parts(replace(r, curves=curves))
        lines = [line for line in figure.axes[0].lines if line.get_marker() == "v"]
        assert [y for line in lines for y in line.get_ydata()] == arrows
        assert any("at most" in text.get_text() for text in figure.legends[0].texts) == bool(arrows)


def test_the_default_is_told_against_the_frontier() -> None:
    def among(*points: Point) -> Report:
        """Where these were measured, and the default."""
        front = frontier([r.default, *points])
        return replace(r, curves=(Curve("depth", "bias", points),), joint=(), frontier=front, halvings=())

    r = study()
    nothing = "Nothing that was measured is both faster and more accurate than the scene as it is"
    ends = [
        point("depth", n, s, 0.001, e, settings={"settings.depth": n}) for n, s, e in ((2, 0.1, 0.04), (9, 0.9, 0.01))
    ]
    assert f"{nothing}: it is on the frontier." in told(among(ends[0]))
    between = "interpolating between the two points beside it on the frontier, (depth 2) and (depth 9), its error would"
    assert f"{nothing}; but {between} take 0.52 of its time." in told(among(*ends))
    better = point("depth", 5, 0.208, 0.001, 0.004, settings={"settings.depth": 5})
    assert "The same error could be had in 0.4 of the time by depth 5." in told(among(better))
    assert "today's default, not on it" in told(among(better))
    near = replace(better, seconds=Band(0.5, 0.4, 0.6))
    assert "by depth 5; the bands of the two overlap: it may be chance." in told(among(near))


def test_what_stands_above_is_no_note_again() -> None:
    """As a study notes it: the terminal and the page say the same of the frontier, each once."""
    r = study()
    stands = standing([*(p for c in r.curves for p in c.points), *r.joint], r.default)
    noted = replace(r, notes=(*r.notes, stands, STOPPED), stopped=True)
    text = told(noted)
    assert text.count(stands[1:]) == 1 and STOPPED not in text and r.notes[0] in text
    assert text.count("stopped before its end") == 1


def test_what_rounds_to_nothing_has_no_sign() -> None:
    assert [hundredths(x) for x in (-0.004, 0.004, -0.0, -0.006, 0.5)] == ["0.00", "0.00", "0.00", "-0.01", "0.50"]
    r = study()
    flat = replace(r.curves[0], by_time=Slope(-0.001, -0.004, 0.01, 5))
    labels = [t.get_text() for t in charts.costs(replace(r, curves=(flat,))).legends[0].texts]
    assert "samples, sobol: k = 0.00 [0.00, 0.01]" in labels


def test_what_is_wider_than_the_page_scrolls_and_shows_it(pages: dict[str, str]) -> None:
    """A bar that is always there, and a shadow at the side where more of the table is."""
    css = pages["study"].split("<style>")[1].split("</style>")[0]
    for told in (
        ".scroll { overflow: auto",
        ".scroll::-webkit-scrollbar { width: 10px",
        "local, local, scroll, scroll",
    ):
        assert told in css


def told(r: Report) -> str:
    """The words of a page, without those in its figures, which take most of the time to draw."""
    with pytest.MonkeyPatch.context() as patch:
        for figure in ("costs", "pictures", "counts", "parts"):
            patch.setattr(charts, figure, lambda report: None)
        patch.setattr(charts, "svg", lambda figure, caption: "")
        return " ".join(Outline(page(r)).text)


def test_without_noise_it_says_so(pages: dict[str, str]) -> None:
    assert "There is no noise" in pages["noiseless"] and "There is no noise" not in pages["study"]
    assert "There is no error to halve" in pages["perfect"]
    r = noiseless()
    assert "There is no noise that samples could halve." in told(replace(r, halvings=()))
    assert "half of the error by samples" not in told(replace(r, stopped=True))


def test_stopped_it_says_what_is_missing(pages: dict[str, str]) -> None:
    missing = "Missing: more than one value of depth; half of the error by samples, sobol; half of the error by depth; "
    assert missing + "points where several knobs are turned." in pages["stopped"]
    assert "stopped" not in " ".join(Outline(pages["study"]).text)


def test_names_are_text(pages: dict[str, str]) -> None:
    found = Outline(pages["hostile"])
    assert found.tags.count("script") == 1 and "b" not in found.tags
    text = "".join(found.text)
    assert all(name in text for name in EVIL)


def test_a_notebook_shows_the_figure_and_the_halvings() -> None:
    found = Outline(display(study()))
    assert found.tags.count("svg") == 1 and found.tags.count("table") == 1 and "script" not in found.tags


def test_figures_leave_nothing_behind() -> None:
    """Neither settings of matplotlib nor an open figure; the same report makes the same page."""
    import matplotlib

    r, before = perfect(), dict(matplotlib.rcParams)
    with matplotlib.rc_context({"figure.facecolor": "black", "text.color": "white", "text.usetex": True}):
        dark = page(r)
    assert dark == page(r)
    assert dict(matplotlib.rcParams) == before


def test_thumbnails_are_means_of_whole_blocks() -> None:
    large = np.arange(515 * 300.0).reshape(515, 300)
    small = charts._smaller(large)
    assert small.shape == (171, 100) and small[0, 0] == large[:3, :3].mean()
    assert np.array_equal(charts._smaller(LIGHT), LIGHT)
