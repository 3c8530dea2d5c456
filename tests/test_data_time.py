"""Data layers with a time: numbers between dates, places that come and go, the date of the legend, and bad input."""

import json
import re
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import drjit as dr
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import visray as vr
from visray.data import dates
from visray.data.column import row_place
from visray.data.gizmos import GIZMOS
from visray.data.moments import moments_of_numbers
from visray.data.shown_date import MOMENT
from visray.data.timeline import Timeline
from visray.errors import UserError
from visray.legend.content import legend_content
from visray.scene.address import value
from visray.scene.check import checked, examined
from visray.setup import prepare

ROOT = Path(__file__).resolve().parents[1]
# Two places of all dates, a third from March to May, and a fourth without a colour in April.
ROWS = [
    ("Bern", 7.45, 46.95, "2020-01-01", 2.0, 5.0), ("Bern", 7.45, 46.95, "2020-03-01", 8.0, 9.0),
    ("Bern", 7.45, 46.95, "2020-06-01", 4.0, 1.0), ("Oslo", 10.75, 59.9, "2020-01-01", 1.0, 2.0),
    ("Oslo", 10.75, 59.9, "2020-06-01", 3.0, 6.0), ("Paris", 2.35, 48.85, "2020-03-01", 5.0, 4.0),
    ("Paris", 2.35, 48.85, "2020-05-01", 6.0, 3.0), ("Roma", 12.48, 41.89, "2020-01-01", 10.0, 8.0),
    ("Roma", 12.48, 41.89, "2020-04-01", 7.0, None), ("Roma", 12.48, 41.89, "2020-06-01", 9.0, None),
]  # fmt: skip
COLUMNS = ("name", "lon", "lat", "date", "rain", "heat")


def table(rows=ROWS) -> dict:
    return dict(zip(COLUMNS, map(list, zip(*rows))))


def scene(given=ROWS, date=None, legend=None, base=None, **fields) -> vr.Scene:
    own = {"source": table(given), "time": "date", "height": "rain", "color": "heat", "radius": 0.03} | fields
    made = vr.Scene(
        camera=vr.Camera(origin=(3.2, 2.4, -0.9), fov=20),
        film=vr.Film(width=40, height=30),
        lights={"key": vr.DirectionalLight(direction=(-1, -1, 0.2))},
        data=vr.Data(base=base or vr.GlobeBase(), layers={"a": vr.DataLayer(**own)}, date=date, legend=legend),
        settings=vr.Settings(spp=2),
    )
    return checked(made)


def at(s: vr.Scene, date) -> vr.Scene:
    return vr.replaced(s, "data.date", date)


def numbers(s: vr.Scene, name: str = "height") -> list[float]:
    """Numbers of all places, None for those that are not shown."""
    rows = s.data.rows["a"]
    return [None if gone else float(x) for x, gone in zip(rows.values[name], rows.hidden)]


# Dates.


@pytest.mark.parametrize(
    ("text", "days", "unit"),
    [
        ("1970-01-01", 0, "day"), ("2020", 18262, "year"), ("2020-03", 18322, "month"), ("2020-02-29", 18321, "day"),
        ("2000-03-01T06:00", 11017.25, "minute"), ("1969-12-31 12:00:00Z", -0.5, "second"),
        ("1970-01-01T01:00+02:00", -1 / 24, "minute"), ("1970-01-01T00:00:00.5", 0.5 / 86400, "microsecond"),
        ("1900-03-01", -25508, "day"), (" 2020-03 ", 18322, "month"),
    ],
)  # fmt: skip
def test_a_date_is_days_since_1970(text, days, unit):
    assert dates.parsed(text) == (pytest.approx(days, abs=1e-12), unit)


@pytest.mark.parametrize(
    "text", ["", "x", "2021-02-29", "2020-13", "2020-6-1", "15/06/2020", "2020-06-15T25:00", "٢٠٢٠"]
)
def test_what_is_no_date_is_refused(text):
    with pytest.raises(ValueError, match="is no date"):
        dates.parse(text)


@given(st.datetimes(datetime(1, 1, 1), datetime(9999, 12, 30)), st.sampled_from(dates.UNITS))
def test_a_date_is_read_as_it_is_written(moment, unit):
    number = (moment - dates.EPOCH) / timedelta(days=1)
    # Near our time, double precision tells microseconds apart; far from it 100 of them.
    assert abs(dates.moment_of(number) - moment) <= timedelta(microseconds=0 if 1950 < moment.year < 2050 else 100)
    text = dates.text(number, unit)
    begun = dates.parse(text)
    assert dates.text(begun, unit) == text
    assert begun <= number + 100 / dates.DAY and dates.beginning(begun, unit) == begun


@pytest.mark.parametrize(
    ("number", "decimals", "text"),
    [
        (1987.9, 0, "1987"),
        (0.3, 1, "0.3"),
        (-0.5, 1, "-0.5"),
        (1989.9999999999998, 0, "1990"),
        (1e15, 0, "1" + 15 * "0"),
    ],
)
def test_a_number_is_cut_to_the_decimals_of_the_data(number, decimals, text):
    assert dates.text(number, decimals) == text


def test_a_number_is_the_year_of_a_date():
    assert dates.text(dates.of_year(2020.5), "day") == "2020-07-02"  # a leap year has 366 days
    assert dates.of_year(2021.5) == dates.parse("2021-07-02T12:00")


@given(st.datetimes(datetime(1, 1, 1), datetime(9998, 12, 30)), st.sampled_from(dates.UNITS[:-1]))
def test_the_end_of_a_month_is_the_beginning_of_the_next(moment, unit):
    number = (moment - dates.EPOCH) / timedelta(days=1)
    end = dates.end(number, unit)
    assert end > number - 100 / dates.DAY and dates.beginning(end, unit) == end
    assert dates.beginning(end - MOMENT, unit) == dates.beginning(number, unit)


def test_the_last_date_lasts_until_its_end_and_with_it():
    months = [("Bern", 7.45, 46.95, f"2020-{m:02}", float(m), 1.0) for m in range(1, 13)]
    s = scene(months)
    for end in ("2020-12-15", "2021-01", "2021-01-01", 2021, 2021.0):
        assert numbers(at(s, end)) == [12.0]
    for date, written in (("2021-01-02", '"2021-01-02"'), (2021.01, "2021.01"), ("2019-12-31", '"2019-12-31"')):
        text = f"data.date = {written}: is outside of the dates of the data, from 2020-01 to 2020-12; "
        with pytest.raises(UserError) as error:
            at(s, date)
        assert error.value.lines == (text + "write 2020-01 at least and 2021-01, the end of 2020-12, at most",)
    # Plain numbers count anything, and have no end.
    with pytest.raises(UserError, match="from 0 to 3; write 0 at least and 3 at most"):
        scene([("x", 1, 2, 0.0, 0, 0), ("x", 1, 2, 3.0, 2, 1)], 3.5)


# Numbers between dates.


def test_numbers_are_linear_in_days_and_the_29th_of_february_is_one():
    rows = [("x", 1, 2, "2020-02-28", 0, 0), ("x", 1, 2, "2020-03-01", 2, 1)]
    assert value(scene(rows, "2020-02-29"), "data.a.0.height") == 1
    rows = [("x", 1, 2, "2021-02-28", 0, 0), ("x", 1, 2, "2021-03-01", 2, 1)]
    assert value(scene(rows, "2021-02-28T12:00"), "data.a.0.height") == 1


@given(st.lists(st.floats(-5, 5) | st.none(), min_size=1, max_size=7), st.floats(0, 6), st.booleans())
def test_a_series_is_that_of_numpy(given_values, moment, held):
    values = np.array([np.nan if v is None else v for v in given_values])
    moments = moments_of_numbers(np.arange(len(values), dtype=float) ** 1.5, row_place)
    names, nowhere = np.array(["x"] * len(values), object), np.zeros(len(values))
    time = Timeline.of(moments, names, nowhere, nowhere, held, row_place)
    got, known = time.series(values).at(moment)
    x, y = moments.number[~np.isnan(values)], values[~np.isnan(values)]
    if not len(x):
        assert not known[0] and np.isnan(got[0])
        return
    assert known[0] == (x[0] <= moment and (held or moment <= x[-1]))
    expected = y[max(np.searchsorted(x, moment, "right") - 1, 0)] if held else np.interp(moment, x, y)
    assert got[0] == pytest.approx(expected, rel=1e-12, abs=1e-12)
    assert y.min() <= got[0] <= y.max()


def test_a_number_of_the_data_is_exact_at_its_date():
    for name, _, _, date, rain, _ in ROWS:
        s = scene(date=date)
        assert value(s, f"data.a.{s.data.row('a', name)}.height") == rain


@pytest.mark.parametrize(("between", "height"), [("interpolated", 5.0), ("held", 2.0)])
def test_between_says_what_happens_between_dates(between, height):
    # The middle of 60 days.
    assert numbers(scene(date="2020-01-31", between=between))[0] == height


@settings(max_examples=15, deadline=None)
@given(st.permutations(ROWS), st.sampled_from(["2020-01-01", "2020-03-20", "2020-06-01"]))
def test_the_order_of_rows_does_not_matter(rows, date):
    one, other = (scene(x, date).data.rows["a"] for x in (ROWS, rows))
    assert one.texts == other.texts == ("Bern", "Oslo", "Paris", "Roma")
    assert [np.array_equal(one.fields[k], other.fields[k]) for k in one.fields] == [True] * len(one.fields)
    assert np.array_equal(one.color, other.color) and np.array_equal(one.hidden, other.hidden)


@pytest.mark.parametrize("gizmo", [name for name in GIZMOS if name not in ("line", "geometry")])
def test_a_date_is_the_picture_of_its_numbers(gizmo):
    """The same bits as a layer without a time that has the numbers of the date, and the domains of all dates."""
    tall = "height" in GIZMOS[gizmo].sizes
    s = scene(date="2020-03-16", gizmo=gizmo, height="rain" if tall else None, radius=0.03 if tall else "rain")
    share = 15 / 92  # of the way from March to June
    rain = [8 - 4 * share, 1 + 2 * 75 / 152, 5 + 15 / 61, 10 - 3 * 75 / 91]
    heat = [9 - 8 * share, 2 + 4 * 75 / 152, 4 - 15 / 61, None]
    top = {"height": 0.4} if tall else {"radius": 0.05}
    rules = {k: vr.SizeRule(column=k, domain=(0, 10), range=(0, v)) for k, v in top.items()}
    layer = vr.DataLayer(
        source={"lon": [7.45, 10.75, 2.35, 12.48], "lat": [46.95, 59.9, 48.85, 41.89], "color": heat}
        | dict.fromkeys(top, rain),
        gizmo=gizmo, color=vr.ColorRule(column="color", domain=(1, 9)), **({"radius": 0.03} | rules),
    )  # fmt: skip
    plain = checked(
        vr.Scene(camera=s.camera, film=s.film, lights=s.lights, settings=s.settings, data=vr.Data(layers={"a": layer}))
    )
    a, b = (x.data.rows["a"] for x in (s, plain))
    for key in a.fields:
        np.testing.assert_allclose(a.fields[key], b.fields[key], rtol=1e-14, atol=1e-15)
    # Roma had a colour in January only, and has none since: it is grey.
    np.testing.assert_allclose(a.color, b.color, rtol=1e-12)


def test_sizes_have_the_domain_of_all_dates():
    for date, high in (("2020-01-01", 0.2), ("2020-06-01", 0.4)):
        s = scene(date=date)
        # The largest number of all dates is 10, and has 0.2 times the diameter.
        assert s.data.rows["a"].stand.height[0] == pytest.approx(0.4 * high)
        assert s.data.rows["a"].rules["height"].domain == (0, 10)
        assert (s.data.rows["a"].rules["color"].lo, s.data.rows["a"].rules["color"].hi) == (1, 9)


def test_a_ship_goes_the_short_way_over_the_date_line():
    rows = [("ship", 170, 10, "2020-01-01", 1, 1), ("ship", -170, 20, "2020-01-03", 1, 1)]
    rows += [("ship", -160, 20, "2020-01-04", 1, 1)]
    s = scene(rows, radius=0.05)
    days = "2020-01-01", "2020-01-02", "2020-01-03", "2020-01-03T12:00"
    way = [value(at(s, date), f"data.a.0.{key}") for date in days for key in ("lon", "lat")]
    assert way == [170, 10, -180, 15, -170, 20, -165, 20]


def test_places_without_names_are_those_of_one_position():
    rows = [(lon, lat, day, v) for lon, lat in ((3, 4), (3, -4), (-3, 4)) for day, v in ((0, lon), (1, lat))]
    source = dict(zip(("lon", "lat", "day", "rain"), map(list, zip(*rows))))
    s = scene(source=source, time="day", height="rain", color=None, date=0.25)
    found = s.data.rows["a"]
    assert found.texts is None and len(found) == 3
    assert list(zip(found.values["lon"], found.values["lat"])) == [(-3, 4), (3, -4), (3, 4)]
    assert found.values["height"].tolist() == [-3 + 7 / 4, 3 - 7 / 4, 3.25]


@pytest.mark.parametrize(
    "time",
    [
        ["2020-01-01", "2020-01-03"], np.array(["2020-01-01", "2020-01-03"], "M8[D]"),
        np.array(["2020-01-01", "2020-01-03"], "M8[ns]"), [datetime(2020, 1, 1), datetime(2020, 1, 3)],
    ],
)  # fmt: skip
def test_times_may_be_given_as_dates(time, tmp_path):
    s = scene(source=None, lon=[1, 1], lat=[2, 2], name=["x", "x"], time=time, height=[1.0, 3.0], color=None)
    s = checked(vr.replaced(s, "data.date", "2020-01-02"))
    assert numbers(s) == [2.0] and s.data.shown_date.finest.resolution == "day"
    # Texts are written as they are, and read again.
    path = tmp_path / "written.json"
    path.write_text(vr.dump(s))
    again = vr.load(path)
    assert numbers(again) == [2.0] and again.hash() == s.hash()
    times = list(json.loads(path.read_text())["data"]["layers"]["a"]["time"])
    assert [dates.parse(text) for text in times] == [18262, 18264]
    other = vr.replaced(again, "data.layers.a.time", ["2020-01-01", "2020-01-04"])
    assert numbers(other)[0] == pytest.approx(5 / 3) and other.hash() != s.hash()


@pytest.mark.parametrize("date", ["2020-01-02", datetime(2020, 1, 2), np.datetime64("2020-01-02"), 2020 + 1 / 366])
def test_the_date_may_be_given_in_several_ways(date):
    rows = [("x", 1, 2, "2020-01-01", 0, 0), ("x", 1, 2, "2020-01-03", 2, 1)]
    assert numbers(scene(rows, date))[0] == pytest.approx(1, abs=1e-9)


# Places that come and go.


@pytest.mark.parametrize(("between", "gone"), [("interpolated", "2020-05-02"), ("held", "2020-02-29")])
def test_a_place_is_hidden_where_it_is_not_known(between, gone):
    s = scene(date=gone, between=between)
    assert numbers(s)[2] is None and None not in [numbers(s)[i] for i in (0, 1, 3)]
    assert len(s.data.rows["a"]) == 4
    with pytest.raises(UserError, match=f"data.a.2.height: the place is not shown on {gone}; take another date"):
        value(s, "data.a.2.height")
    shown = at(s, "2020-04-01" if between == "interpolated" else "2020-05-31")
    assert numbers(shown)[2] is not None
    shares = [_seen(x, "data.a.2") for x in (shown, s)]
    assert shares[0] > 0 and shares[1] == 0
    # The picture is that of the others alone.
    others = scene([row for row in ROWS if row[0] != "Paris"], date=gone, between=between)
    assert np.array_equal(*(vr.render(x, progress=False)["RGB"] for x in (s, others)))


def _seen(s: vr.Scene, name: str) -> float:
    """Share of the pixels in which an object is seen."""
    image = vr.render(s, layers=["id"], progress=False)
    # Objects that no pixel shows are not in the list.
    return float((image["id"] == image.objects[name]).mean()) if name in image.objects else 0.0


def test_a_hidden_place_gets_no_samples_of_its_own():
    from visray.adaptive.small_objects import small_objects

    hidden, shown = (small_objects(prepare(scene(date=date, radius=0.0001))) for date in ("2020-05-31", "2020-04-01"))
    number = list(scene().all_objects).index("data.a.2")
    for cells, there in ((hidden, False), (shown, True)):
        assert (number in cells.objects or number in cells.missed) == there


@pytest.mark.slow
def test_a_date_compiles_nothing_and_has_the_bits_of_a_new_scene():
    s = scene(date="2020-01-01")
    prepared = prepare(s)
    vr.render(prepared, progress=False)
    vr.render(prepared.updated({"data.date": "2020-01-15"}), progress=False)
    # Paris comes on the first of March, and goes in May.
    for date in ("2020-02-01", "2020-04-15", "2020-05-20", "2020-06-01"):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            updated = vr.render(prepared.updated({"data.date": date}), progress=False)
            made = [kernel for kernel in dr.kernel_history() if kernel["type"] == dr.KernelType.JIT]
        assert made and all(kernel["cache_hit"] for kernel in made)
        assert np.array_equal(updated["RGB"], vr.render(at(s, date), progress=False)["RGB"])


@pytest.mark.slow
def test_a_geometry_changes_in_time():
    """A union of two solids, whose rows are bodies of their own: its pictures, and those of an updated scene."""
    parts = [vr.Sphere(radius=0.4), vr.Box(min=(-0.3, 0, -0.3), max=(0.3, 1, 0.3))]
    for shape in (
        vr.Csg(op="merge", of=parts),
        vr.Mesh(vertices=[[1, 0, 0], [-1, 0, 1], [0, 1, 0]], faces=[[0, 1, 2]]),
    ):
        s = replace(scene(), geometries={"shape": shape})
        layer = replace(s.data.layers["a"], gizmo="geometry", geometry="shape", radius=0.06)
        s = checked(replace(s, data=replace(s.data, layers={"a": layer}, date="2020-05-20")))
        updated = prepare(s).updated({"data.date": "2020-04-10"})
        images = [vr.render(x, progress=False)["RGB"] for x in (updated, at(s, "2020-04-10"), s)]
        assert np.array_equal(images[0], images[1]) and not np.array_equal(images[0], images[2])


@settings(max_examples=30, deadline=None)
@given(
    st.lists(
        st.tuples(st.sampled_from("abc"), st.integers(0, 9), st.floats(-9, 9) | st.none(), st.floats(0, 9) | st.none()),
        min_size=1, max_size=20, unique_by=lambda row: row[:2],
    ),
    st.floats(0, 1), st.booleans(),
)  # fmt: skip
def test_any_table_has_a_scene_or_one_line(rows, share, held):
    """Whatever is missing: what is shown is finite, and between the numbers of its place."""
    columns = dict(zip(("name", "day", "rain", "heat"), map(list, zip(*rows))))
    columns |= {"lon": [ord(name) for name in columns["name"]], "lat": [50] * len(rows)}
    first, last = min(columns["day"]), max(columns["day"])
    s = scene(
        source=columns, time="day", date=first + share * (last - first), between="held" if held else "interpolated"
    )
    found = s.data.rows["a"]
    for i, name in enumerate(found.texts):
        own = [row[2] for row in rows if row[0] == name and row[2] is not None]
        assert min(own) <= found.values["height"][i] <= max(own)
    assert all(np.isfinite(x).all() for x in found.fields.values()) and np.isfinite(found.color).all()
    assert len(found.hidden) == len(found) and s.data.notes() is not None


# What is said.


@pytest.mark.parametrize(
    ("times", "date", "form", "text"),
    [
        (("2020-01", "2020-06"), "2020-03-20", True, "2020-03"),
        (("2020-01", "2020-06"), "2020-06-30", True, "2020-06"),
        (("2020-01", "2020-06"), "2020-07-01", True, "2020-06"),
        (("2020-01-01", "2020-06-01"), "2020-06-02", "%d %B %Y", "01 June 2020"),
        (("2020-01-01", "2020-06-01"), "2020-03-20T15:00", True, "2020-03-20"),
        (("2020-01-01T00:00", "2020-06-01T00:00"), None, True, "2020-01-01"),
        (("2020-01-01T00:00", "2020-06-01T06:00"), "2020-03-20T15:20:30", True, "2020-03-20 15:20"),
        (("2020-01-01", "2020-06-01"), None, "%d %B %Y", "01 January 2020"),
        ((1900, 2000), 1955.9, True, "1955"),
        ((0.25, 3), 1, True, "1.00"),
        (("2020-01", "2020-06"), None, False, ""),
    ],
)  # fmt: skip
def test_the_legend_shows_the_date_as_fine_as_the_data(times, date, form, text):
    rows = [("x", 1, 2, times[0], 0, 0), ("x", 1, 2, times[1], 2, 1)]
    s = scene(rows, date, vr.Legend(date=form))
    assert legend_content(s).date == text
    assert legend_content(scene(rows, date, None)) is None


def test_the_date_stands_below_the_title_and_moves_nothing():
    from visray.legend.drawing import drawn

    s = vr.replaced(scene(date="2020-01-01", legend=vr.Legend(title="Rain", subtitle="by place")), "film.width", 480)
    s = vr.replaced(s, "film.height", 300)
    laid = [drawn(legend_content(at(s, date)), 480, 300).layout for date in ("2020-01-01", "2020-05-20")]
    texts = [[line.text for line in x.texts if line.block == "heading"] for x in laid]
    assert texts == [["Rain", "by place", "2020-01-01"], ["Rain", "by place", "2020-05-20"]]
    assert laid[0].texts[2].y > laid[0].texts[1].y
    # Keys are those of all dates.
    assert [key.texts for key in laid[0].keys] == [key.texts for key in laid[1].keys]
    assert laid[0].panels == laid[1].panels


def test_notes_say_what_is_not_shown():
    rows = [*ROWS, ("", 1, 2, "2020-01-01", 1, 1), ("Wien", 16, 48, "", 1, 1), ("Lyon", 5, 46, "2020-03-01", 1, 1)]
    rows += [
        ("Nice", 7, 44, day, rain, 1) for day, rain in (("2020-01-01", 1), ("2020-03-01", None), ("2020-06-01", 1))
    ]
    rows += [("Bonn", 7, 51, day, None, 1) for day in ("2020-01-01", "2020-06-01")]
    notes = scene(rows, "2020-04-16").data.notes()
    assert notes == [
        "data.layers.a: rows that are not used: 1 without a date, 1 without a name",
        "data.layers.a: height has 1 gap between known numbers; the numbers there are interpolated",
        "data.layers.a: 1 place has one date only, and is shown at that moment alone; to keep such places, write "
        '"between": "held"',
        "data.layers.a: of 6 places, not shown on 2020-04-16: 1 without numbers",
        "data.layers.a: 1 of 6 places has the colour of missing values on 2020-04-16",
        "data.layers.a: 6 places are shown, and not: 1 without a height",
    ]  # fmt: skip


def test_one_date_is_noted():
    rows = [("x", 1, 2, "2020-01", 1, 1), ("y", 4, 2, "2020-01", 2, 3)]
    assert scene(rows).data.notes() == ["data.layers.a: all rows have one date, 2020-01, so nothing changes in time"]


def test_a_place_outside_of_the_map_is_hidden_while_it_is_there():
    rows = [("ship", lon, 5, day, 1, lon) for lon, day in ((0, "2020-01-01"), (40, "2020-01-05"))]
    s = scene(rows, base=vr.MapBase(extent=(0, 20, 0, 10)), date="2020-01-02", radius=0.1)
    assert numbers(s) == [1.0] and numbers(at(s, "2020-01-04")) == [None]


# Numbers by address.


def test_a_number_is_replaced_at_all_dates():
    s = vr.replaced(scene(date="2020-02-01"), "data.a.0.height", 3)
    assert [numbers(at(s, date))[0] for date in ("2020-01-01", "2020-03-01", "2020-05-13")] == [3, 3, 3]
    assert s.data.layers["a"].rows == {"0": vr.data.layer.RowEdit(height=3)}
    assert numbers(s)[1:] == numbers(scene(date="2020-02-01"))[1:]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["height", "color", "lon"])
def test_derivatives_are_those_of_differences(name):
    """By the number of a place at the date. The difference replaces it at all dates, which this picture cannot tell."""
    rules = {"height": vr.SizeRule(column="rain", domain=(0, 10), range=(0.1, 0.6))}
    rules |= {"color": vr.ColorRule(column="heat", domain=(0, 10))}
    s = scene(date="2020-02-01", gizmo="cone", radius=0.1, **rules)
    s = vr.replaced(s, "settings.precision", "double")
    address = f"data.a.0.{name}"
    attached, step = vr.derivative(s, address, progress=False), vr.difference(s, address)
    assert np.abs(step).max() > 0
    assert attached == pytest.approx(step, rel=1e-4, abs=1e-6 * np.abs(step).max())


@pytest.mark.parametrize(
    ("date", "name", "reason"),
    [
        ("2020-02-01", "height", "as the domain of its rule is that of all dates; give the rule a domain"),
        ("2020-02-01", "color", "as the domain of its rule is that of all dates; give the rule a domain"),
        ("2020-05-20", "lon", None),
    ],
)
def test_derivatives_that_do_not_exist_are_refused(date, name, reason):
    rows = scene(date=date).data.rows["a"]
    assert rows.slope_flaw(0, name) == reason
    assert scene(date="2020-05-20").data.rows["a"].slope_flaw(2, "lon") == "as the place has no numbers on 2020-05-20"


# Bad input.

BAD_TIMES = [
    (["2020-01-01", "15/06/2020"], 'row 1 "15/06/2020" is no date; write a date such as 2020-06-15, 2020-06 or'),
    (["2020-01-01", "2020-02-30"], 'row 1 "2020-02-30" is no date of the calendar'),
    (["2020-01", "2020-02-15"], 'its dates have several forms, as row 0 "2020-01" and row 1 "2020-02-15" have'),
    (["2020-01", "1987"], 'row 0 "2020-01" and row 1 "1987" have; write all in one form'),
    ([20200615, 20200616], "has numbers that are dates, such as 20200615; write 2020-06-15"),
    (["2020-01-01", "2020-01-01T00:00"], 'row 0 and row 1 are both "x" on 2020-01-01; a place has one row for each'),
    (["01.2024", "12.2025"], "write 2024-01"),
    (["3.6.2020", "15.06.2020"], 'row 0 "3.6.2020" is no date as it is read here; write 2020-06-03'),
    ([1.2024, 12.202], "has months as 01.2024, which are no numbers; write 2024-01 for 01.2024, and so on"),
    (["", None], "no row has a date and a place; a layer needs one at least"),
]


@pytest.mark.parametrize(("times", "text"), BAD_TIMES)
@pytest.mark.parametrize("own", [False, True])
def test_times_that_are_none_are_refused(times, text, own):
    rows = [("x", 1, 2, time, 1, 1) for time in times]
    with pytest.raises(UserError) as error:
        scene(rows, time=times if own else "date")
    assert len(error.value.lines) == 1
    assert error.value.lines[0].startswith("data.layers.a.time") and text in error.value.lines[0]


@pytest.mark.parametrize("times", [[1.2, 2.2], [1.25, 2.2024], [0.2024, 13.2024], [1.2024, 1.9], [1.20241, 1.2024]])
def test_other_moments_are_no_months(times):
    assert scene([("x", 1, 2, time, 1, 1) for time in times]).data.shown_date.number == min(times)


def test_months_of_a_file_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("name,lon,lat,month,v\nx,1,2,01.2020,3\nx,1,2,02.2020,4\n", encoding="utf-8")
    with pytest.raises(UserError) as error:
        vr.data_scene(path, time_column="month")
    text = "time_column: has months as 01.2024, which are no numbers; write 2020-01 for 01.2020, and so on"
    assert error.value.lines == (text,)


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"time": "dates"}, 'data.layers.a.time = "dates": there is no column "dates"; did you mean "date"?'),
        ({"time": 3}, "DataLayer: time = 3: must be a string or a list of dates or numbers, or null"),
        ({"time": [1, 2]}, "data.layers.a.source: all columns need the same number of rows: lon has 10"),
        ({"time": None, "between": "held"}, 'data.layers.a.between = "held": goes with the field time;'),
        ({"between": "linear"}, 'DataLayer: between = "linear": unknown value; one of interpolated, held'),
        ({"rows": {"4": {"height": 1}}}, "data.layers.a.rows.4: there is no such row; the last one is 3"),
        ({"date": "2020-06-02T00:01"}, 'data.date = "2020-06-02T00:01": is outside of the dates of the data'),
        ({"date": "2019-12-31"}, 'data.date = "2019-12-31": is outside of the dates of the data'),
        ({"date": "June"}, 'data.date = "June": is no date; write a date such as'),
        ({"date": 1e9}, "data.date = 1000000000.0: must be a year from 1 to 9998"),
        ({"date": [2020]}, "Data: date = [2020]: must be a number or a string"),
        ({"date": True}, "Data: date = true: must be a number or a string"),
        ({"legend": {"date": "soon"}}, 'data.legend.date = "soon": has no part of a date; write one, such as "%B %Y"'),
        ({"legend": {"date": "%Q"}}, 'data.legend.date = "%Q": "%Q" is no part of a date; one of %Y, %m'),
        ({"time": list(range(10)), "date": "2020-01-01"}, 'data.date = "2020-01-01": must be a number, as the times'),
        ({"time": list(range(10)), "legend": {"date": "%Y"}}, 'data.legend.date = "%Y": is a format of dates'),
        ({"time": None, "date": 1}, "data.date = 1.0: no layer has a time; give a layer the field time"),
    ],
)  # fmt: skip
def test_fields_that_are_wrong_are_refused_in_one_line(fields, text):
    with pytest.raises(UserError) as error:
        scene(**fields)
    assert len(error.value.lines) == 1
    assert error.value.lines[0].startswith(text), error.value.lines[0]


def test_lines_do_not_change_in_time():
    line = {
        "type": "Feature",
        "properties": {"day": 1},
        "geometry": {"type": "LineString", "coordinates": [[0, 0], [1, 1]]},
    }
    with pytest.raises(UserError, match=r"data\.layers\.a\.time = .*: lines do not change in time"):
        scene(
            source={"type": "FeatureCollection", "features": [line]}, gizmo="line", time="day", height=None, color=None
        )


def test_the_page_has_the_messages_of_visray():
    page = (ROOT / "docs" / "data-in-time.md").read_text(encoding="utf-8")
    written = re.search(r"```text\n(.*?)```", page, re.DOTALL)[1].splitlines()
    source = str(ROOT / "scenes" / "data" / "coastal-months.csv")
    said = []
    for time, date in (("month", "2003-01"), ("name", None)):
        said += examined({"data": {"layers": {"air": {"source": source, "time": time}}, "date": date}})[1]
    assert said == written


# The scene, and the command.


def test_the_year_of_the_scene_closes():
    s = vr.load(ROOT / "scenes" / "data-year.json")
    ends = [at(replace(s, animation=None), date).data.rows["air"] for date in ("2001-01", "2002-01")]
    assert np.array_equal(*(x.values["height"] for x in ends)) and len(ends[0]) == 80
    assert not ends[0].hidden.any()


def test_rows_turn_with_the_globe_in_the_scene_of_a_year():
    s = vr.load(ROOT / "scenes" / "data-year.json")
    start, quarter = (vr.at(s, t).data for t in (0.0, 3.0))
    assert [x.date_text for x in (start, quarter)] == ["January", "April"]
    x, y, z = start.rows["air"].ground.point.T
    np.testing.assert_allclose(quarter.rows["air"].ground.point, np.stack([z, y, -x], axis=1), atol=1e-12)


def test_the_command_shows_a_date(tmp_path, capsys):
    from visray.cli import main

    table, saved = ROOT / "scenes" / "data" / "coastal-months.csv", tmp_path / "saved.json"
    words = [
        "data",
        str(table),
        "--time-column",
        "month",
        "--size",
        "96x64",
        "--spp",
        "1",
        "-o",
        str(tmp_path / "a.png"),
    ]
    assert main([*words, "--date", "2001-07-16", "--held", "--save", str(saved), "--json"]) == 0
    choices = json.loads(capsys.readouterr().out)["choices"]
    assert choices["places"] == "80" and choices["time"] == "month" and choices["color"] == "temperature"
    written = json.loads(saved.read_text())["data"]
    assert written["date"] == "2001-07-16"
    [layer] = written["layers"].values()
    assert (layer["time"], layer["between"]) == ("month", "held")
    python = vr.data_scene(str(table), time_column="month", date="2001-07-16", held=True, size=(96, 64))
    [rows] = python.data.rows.values()
    assert rows.values["color"][rows.texts.index("Shanghai")] == 26.3


@pytest.mark.parametrize(
    ("words", "arguments", "text"),
    [
        (["--time-column", "mont"], {"time_column": "mont"}, 'time_column = "mont": there is no such column in'),
        (["--date", "2001"], {"date": "2001"}, 'date: goes with dates of rows; name their column, as in time_column='),
        (["--held"], {"held": True}, 'held: goes with dates of rows; name their column, as in time_column="date"'),
        (["--time-column", "name"], {"time_column": "name"}, 'time_column: line 2 "Shanghai" is no date; write a date'),
        (["--time-column", "month", "--date", "2003"], {"time_column": "month", "date": 2003}, "date: is outside of"),
        (["--time-column", "month", "--date", "x"], {"time_column": "month", "date": "x"}, "date: is no date; write a"),
    ],
)  # fmt: skip
def test_the_command_refuses_dates_in_one_line(words, arguments, text, capsys):
    from visray.cli import main

    table = str(ROOT / "scenes" / "data" / "coastal-months.csv")
    assert main(["data", table, *words]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    option = text.replace("_column", "-column", 1) if text.startswith("time") else text
    option = re.sub('time_column=("date")?', "--time-column", option)
    assert said[0].startswith(f"visray: --{option}")
    with pytest.raises(UserError) as error:
        vr.data_scene(table, **arguments)
    assert error.value.lines[0].startswith(text)


def test_the_camera_sees_the_largest_sizes_of_all_dates():
    table = {"name": ["a", "a", "b", "b"], "lon": [1, 1, 3, 3], "lat": [50, 50, 51, 51]}
    table |= {"day": [0, 1, 0, 1], "v": [1, 100, 1, 100]}
    first, last = (vr.data_scene(table, time_column="day", height="v", date=day) for day in (0, 1))
    assert first.camera == last.camera
