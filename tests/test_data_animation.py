"""Animations of `visray data` and `vr.data_scene`: what moves, that all of it is in the picture, and that names do not
flicker."""

import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow

import visray as vr
from visray.cli import main
from visray.data_picture import Wishes, data_picture
from visray.errors import UserError
from visray.legend.content import legend_content
from visray.legend.drawing import drawn
from visray.projection import projected

MONTHS = Path(__file__).resolve().parents[1] / "scenes" / "data" / "coastal-months.csv"
# Three places; the second one comes later, and goes earlier.
TABLE = {
    "name": ["Bern", "Bern", "Oslo", "Oslo", "Roma", "Roma"],
    "lon": [7.4, 7.4, 10.8, 10.8, 12.5, 12.5],
    "lat": [46.9, 46.9, 59.9, 59.9, 41.9, 41.9],
    "month": ["2024-01", "2024-06", "2024-02", "2024-05", "2024-01", "2024-06"],
    "rain": [1.0, 5.0, 2.0, 3.0, 7.0, 1.0],
}


def made(table=TABLE, **words) -> vr.Scene:
    """The scene of a table, without notes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return vr.data_scene(table, **({"time_column": "month", "animate": 4.0} | words))


def tracks(s: vr.Scene) -> dict:
    return s.animation.tracks


def rows_at(s: vr.Scene, t: float):
    return next(iter(vr.at(s, t).data.rows.values()))


# What moves.


def test_the_date_goes_from_the_first_to_the_last_and_the_globe_turns_once():
    s = made(base="globe")
    assert s.animation.duration == 4 and set(tracks(s)) == {"dates", "turn"}
    dates, turn = tracks(s)["dates"], tracks(s)["turn"]
    assert (dates.address, dates.times, dates.values) == ("data.date", (0.0, 4.0), ("2024-01", "2024-06"))
    assert (turn.of, turn.turns, turn.axis) == ("data.base", 1.0, (0.0, 1.0, 0.0))
    assert tracks(made(base="globe", turns=-2))["turn"].turns == -2
    assert set(tracks(made())) == set(tracks(made(base="globe", turns=0))) == {"dates"}
    assert vr.data_scene(TABLE, time_column="month").animation is None


def test_numbers_that_are_held_are_shown_until_the_end_of_the_last_month():
    s = made(held=True)
    assert tracks(s)["dates"].values == ("2024-01", "2024-07")
    assert [vr.at(s, t).data.date_text for t in (0.0, 3.99, 4.0)] == ["2024-01", "2024-06", "2024-06"]


def test_plain_numbers_are_dates_too_and_one_date_leaves_the_turn():
    years = TABLE | {"month": [1990, 2000, 1990, 2000, 1990, 2000]}
    assert tracks(made(years))["dates"].values == (1990.0, 2000.0)
    one = {name: values[::2] for name, values in TABLE.items()} | {"month": ["2024-01"] * 3}
    assert set(tracks(made(one, base="globe"))) == {"turn"}
    with pytest.raises(UserError, match="animate: all rows have one date, 2024-01, so nothing moves; leave it out"):
        made(one)


# The camera.


def seen(s: vr.Scene, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Pixels of the feet and the tops of all gizmos at a time."""
    rows, moment = rows_at(s, t), vr.at(s, t)
    stand = rows.stand
    tops = (stand.foot + stand.up * stand.height * ("height" in rows.gizmo.sizes)).T[~rows.hidden]
    found = projected(moment, np.concatenate([rows.ground.point[~rows.hidden], tops]))
    return found.x, found.y


def check_inside(s: vr.Scene) -> None:
    """All gizmos are in the picture and not under the legend, at all times."""
    width, height = s.film.width, s.film.height
    boxes = [box for _, box in drawn(legend_content(vr.at(s, 0)), width, height).layout.boxes]
    for t in np.linspace(0, s.animation.duration, 9).tolist():
        x, y = seen(s, t)
        assert len(x) and x.min() >= 0 and x.max() <= width and y.min() >= 0 and y.max() <= height
        for left, top, right, bottom in boxes:
            assert not ((left <= x) & (x <= right) & (top <= y) & (y <= bottom)).any()


@pytest.mark.slow
@pytest.mark.parametrize("base", ["map", "globe"])
@pytest.mark.parametrize("size", [(480, 270), (300, 400)])
def test_nothing_is_cut_at_any_date_and_turn(base, size):
    check_inside(made(str(MONTHS), base=base, size=size, height="temperature", title="Air"))


def test_a_bar_is_not_cut_when_the_globe_turns_it_to_the_edge():
    table = {"name": ["a", "a"], "lon": [0.0, 0.0], "lat": [10.0, 10.0], "month": ["2024-01", "2024-02"]}
    table |= {"rain": [1.0, 10.0]}
    words = {"base": "globe", "height": "rain", "size": (300, 600)}
    s = made(table, **words)
    check_inside(s)
    # Without the animation, the bar points at the camera, which is so near that it would be cut.
    still = vr.data_scene(table, time_column="month", **words)
    with pytest.raises(AssertionError):
        check_inside(vr.replaced(s, "camera", still.camera))


def test_a_ship_stays_in_the_picture():
    table = {"name": ["a"] * 3, "lon": [0.0, 20.0, 1.0], "lat": [50.0, 58.0, 50.0]}
    table |= {"month": ["2024-01", "2024-02", "2024-03"], "rain": [1.0, 10.0, 1.0]}
    check_inside(made(table, height="rain"))
    check_inside(made(table, height="rain", base="globe", turns=0))


def test_a_draft_leaves_room_for_the_legend_of_a_larger_picture():
    draft, large = (made(base="globe", size=size, title="Rain") for size in ((240, 135), (640, 360)))
    assert draft.camera == large.camera and draft.data.legend.position == large.data.legend.position
    notes = data_notes(size=(240, 135))
    assert "240 x 135 pixels are too few for a legend; its place is left free for larger pictures of the scene" in notes
    assert not [text for text in data_notes() if "too few" in text]
    still = [vr.data_scene(TABLE, base="globe", size=size, time_column="month") for size in ((240, 135), (640, 360))]
    assert still[0].camera != still[1].camera


# Names.


def data_notes(**wishes) -> list[str]:
    """Notes on the table of months."""
    own = {"time_column": "month", "animate": 4.0, "height": "temperature"} | wishes
    return data_picture(str(MONTHS), Wishes(**own), "map.png").notes


def names(s: vr.Scene, t: float) -> list[str]:
    return [place.name for place in legend_content(vr.at(s, t)).places]


def test_names_do_not_flicker():
    with pytest.warns(UserWarning, match="1 of 3 places have no name, as they are not shown at all dates; places all"):
        s = vr.data_scene(TABLE, time_column="month", animate=4.0)
    assert [names(s, t) for t in (0, 1, 2, 3.9)] == [["Bern", "Roma"]] * 4
    assert set(names(made(places="all"), 2)) == {"Bern", "Oslo", "Roma"}
    with pytest.warns(UserWarning, match="the places have no names, which would jump while the globe turns"):
        assert names(vr.data_scene(TABLE, time_column="month", animate=4.0, base="globe"), 0) == []
    assert names(made(base="globe", places=["Bern"]), 0) == ["Bern"]
    ships = TABLE | {"lon": [7.4, 9.4, 10.8, 10.8, 12.5, 12.5]}
    with pytest.warns(UserWarning, match="which would jump while the places move"):
        assert names(vr.data_scene(ships, time_column="month", animate=4.0), 0) == []


def test_names_stay_where_they_are_while_disks_grow():
    s = made(radius="rain", gizmo="sphere", places=["Roma", "Bern"])
    places = [legend_content(vr.at(s, t)).places for t in (0.0, 1.7, 3.9)]
    assert places[0] == places[1] == places[2]
    assert len({rows_at(s, t).stand.radius[2] for t in (0.0, 1.7, 3.9)}) == 3


# The command.


@pytest.fixture
def table(tmp_path, monkeypatch) -> str:
    monkeypatch.chdir(tmp_path)
    lines = [",".join(map(str, row)) for row in zip(*TABLE.values())]
    Path("rain.csv").write_text("\n".join([",".join(TABLE), *lines]) + "\n", encoding="utf-8")
    return "rain.csv"


WORDS = ("--time-column", "month", "--animate", "0.12", "--size", "96x64", "--spp", "1")


@pytest.mark.slow
def test_a_movie_comes_at_once_or_from_the_saved_scene(table, capsys):
    assert main(["data", table, *WORDS, "-o", "rain.webp", "-o", "shots", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["choices"]["animation"] == "0.12 s" and "scene" not in report
    assert [path.name for path in sorted(Path("shots").glob("*.png"))] == [f"rain.000{k}.png" for k in range(3)]
    with Pillow.open("rain.webp") as movie:
        assert movie.n_frames == 3 and movie.size == (96, 64)
    before = Path("rain.webp").read_bytes()
    assert main(["data", table, *WORDS, "-o", "rain.webp"]) == 2
    assert "rain.webp: exists already" in capsys.readouterr().err and Path("rain.webp").read_bytes() == before
    assert main(["data", table, *WORDS, "-o", "rain.webp", "--overwrite", "--quiet"]) == 0
    capsys.readouterr()
    assert main(["data", table, *WORDS, "--save", "scene.json"]) == 0
    text = "the picture shows the beginning; visray animate scene.json -o scene.mp4 makes the movie"
    assert text in capsys.readouterr().out.splitlines() and Path("rain.png").exists()
    assert main(["animate", "scene.json", "-o", "again", "--quiet"]) == 0
    pictures = [np.asarray(Pillow.open(f"{name}.0001.png")) for name in ("shots/rain", "again/scene")]
    np.testing.assert_array_equal(*pictures)


@pytest.mark.parametrize(
    ("words", "arguments", "text"),
    [
        (["--animate", "5"], {"animate": 5}, "animate: goes with dates of rows; name their column, as in time_column="),
        (["--time-column", "month", "--animate", "0"], {"animate": 0}, "animate = 0: must be a number of seconds"),
        (["--time-column", "month", "--animate", "nan"], {"animate": np.nan}, "animate = nan: must be a number of sec"),
        (["--time-column", "month", "--animate", "1e9"], {"animate": 1e9}, "animate = 1e+09: must be a number of sec"),
        (["--turns", "2"], {"turns": 2}, "turns: goes with animate, the length of the animation in seconds"),
        (["--time-column", "month", "--animate", "5", "--turns", "1"], {"animate": 5, "turns": 1},
         "turns: a map does not turn; leave it out, or write "),
        (["--time-column", "month", "--animate", "5", "--turns", "inf", "--base", "globe"],
         {"animate": 5, "turns": np.inf, "base": "globe"}, "turns = inf: must be a number of turns"),
        (["--time-column", "month", "--animate", "5", "--date", "2024-02"], {"animate": 5, "date": "2024-02"},
         "date: changes during "),
    ],
)  # fmt: skip
def test_wrong_animations_are_refused_in_one_line(words, arguments, text, table, capsys):
    assert main(["data", table, *words]) == 2
    [line] = capsys.readouterr().err.splitlines()
    said = f"visray: --{text}".replace("with animate", "with --animate").split(" time_column=")[0]
    if "nan" in words:  # which the command does not take for a number
        said = "visray: --animate = 'nan': must be a time, such as 20 or 20s"
    assert line.startswith(said)
    column = {"time_column": "month"} if "--time-column" in words else {}
    with pytest.raises(UserError) as error:
        vr.data_scene(TABLE, **arguments, **column)
    assert error.value.lines[0].startswith(text)
    assert not list(Path().glob("*.png"))


def test_a_picture_of_the_beginning_needs_no_frames_and_a_picture_among_frames_is_refused(table, capsys):
    assert main(["data", table, *WORDS, "-o", "rain.webp", "-o", "rain.png"]) == 2
    assert "rain.png: is one file, and each frame needs its own; write rain.####.png" in capsys.readouterr().err
    assert main(["data", table, "-o", "rain.webp"]) == 2
    assert not Path("rain.webp").exists()


@pytest.mark.parametrize("value", ["5", True, [1], vr.Sphere()])
def test_an_argument_that_is_no_number_is_refused(value):
    for name in ("animate", "turns"):
        with pytest.raises(UserError, match=name):
            vr.data_scene(TABLE, time_column="month", **{"animate": 5} | {name: value})
