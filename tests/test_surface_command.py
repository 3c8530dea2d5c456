"""`visray surface`: the files that it writes, what it says, and the one line that bad input gets."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow

import visray as vr
from visray.cli import main

SMALL = ("--size", "48x32", "--spp", "2")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def said(capsys, *words: str) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of the command."""
    code = main(["surface", *words])
    return code, *capsys.readouterr()


def test_a_formula_becomes_a_picture(capsys):
    code, out, err = said(capsys, "x^2 + y^2 - z^2 - a", "--param", "a=0.5", *SMALL)
    # A machine that is busy shows the progress of what takes long.
    assert code == 0 and "visray: " not in err
    assert Pillow.open("surface.png").size == (48, 32)
    assert out.startswith(
        "surface: degree 2; parameters a = 0.5; clip a ball of radius 1.6, which cuts the surface; seen from "
    )


def test_a_known_surface_gives_the_name(capsys):
    assert said(capsys, "heart", *SMALL, "--quiet") == (0, "", "")
    assert [p.name for p in Path().iterdir()] == ["heart.png"]


def test_a_saved_scene_renders_the_same_picture(capsys):
    words = ("xyz = 1", "-o", "a.exr", "--save", "s.json", "--set", "lights.key.samples=1", "--color", "0.1,0.5,0.2")
    assert said(capsys, *words, *SMALL)[0] == 0
    assert main(["render", "s.json", "-o", "b.exr", "--spp", "2"]) == 0
    np.testing.assert_array_equal(vr.Image.read("a.exr")["RGB"], vr.Image.read("b.exr")["RGB"])
    raw = json.loads(Path("s.json").read_text())
    assert raw["lights"]["key"]["samples"] == 1 and raw["materials"]["outside"]["kd"] == [0.1, 0.5, 0.2]


def test_the_default_is_an_error_of_one_percent(capsys):
    code, out, _ = said(capsys, "x + y = z", "--size", "24x24", "--json")
    report = json.loads(out)
    assert code == 0 and report["error_asked"] == 0.01 and report["error"] <= 0.01
    assert report["choices"]["degree"] == "1" and report["outputs"] == ["surface.png"]


def test_a_formula_may_begin_with_a_minus(capsys):
    assert said(capsys, "-x^2 - y^2 - z^2 + 1", *SMALL, "--quiet")[0] == 0
    assert said(capsys, *SMALL, "--quiet", "--", "-x^2 - y^2 - z^2 + 1")[0] == 0


def test_letters_without_a_value_are_noted(capsys):
    code, out, err = said(capsys, "a x^2 + y^2 + z^2 = b", *SMALL, "--json")
    text = "a = b = 1, as no value was given; --param a=2 gives another"
    assert code == 0 and text in json.loads(out)["notes"] and text in err


WRONG = {
    "sign": (["x", "--param", "a"], "--param = 'a': must be NAME=NUMBER, such as a=0.5"),
    "nan": (["x - a", "--param", "a=nan"], "--param = 'a=nan': must be NAME=NUMBER, such as a=0.5"),
    "twice": (["x - a", "--param", "a=1", "--param", "a=2"], "--param: a has two values; give one"),
    "letter": (["x - a", "--param", "b=1"], "b: is no parameter of the formula; one of a"),
    "clip": (["x", "--clip", "0"], "--clip = 0: must be greater than 0, and at most 1e+09"),
    "negative clip": (["x", "--clip", "-1"], "--clip = -1: must be greater than 0, and at most 1e+09"),
    "from": (["x", "--from", "1,2"], "--from = '1,2': must be three numbers with commas between, such as 1,-2,1"),
    "save": (["x", "--save", "s.txt"], "s.txt: a scene is a .json file; end the name so"),
    "view": (["x", "--view", "-o", "a.png"], "--view: shows a live picture, which its page can save; leave out -o"),
    "output": (["x", "-o", "a.jpg"], "a.jpg: "),
    "both": (["x", "--spp", "4", "--error", "0.1"], "spp = 4: goes with neither error nor time"),
    "name": (["barth-sextc"], 'barth-sextc: no surface has this name; did you mean "barth-sextic"?'),
    "no quotes": (["x^2", "+", "y^2", "-", "1"], "x^2: other words stand beside the formula; put it in quotes: "),
    "minus": (["x", "-z"], 'x: other words stand beside the formula; put it in quotes: visray surface "x -z"'),
    "no sign": (["x - a", "--param", "a", "3"], "--param a 3: write it as one word, --param a=3"),
    "gaps": (["x - a", "--param", "a", "=", "3"], "--param a = 3: write it as one word, --param a=3"),
    "option": (["x - a", "--parm", "a=3"], "--parm: no such option; did you mean --param? (see --help)"),
    "short": (["x - a", "-q"], "-q: no such option (see --help)"),
    "word": (["klein"], 'klein: no surface has this name; did you mean "klein-bottle"?'),
    "nothing": (["x^2 + y^2 + z^2 + 1"], "x^2 + y^2 + z^2 + 1: shows nothing: it has no real points"),
}


@pytest.mark.parametrize("case", WRONG)
def test_bad_input_gets_one_line(case, capsys):
    words, text = WRONG[case]
    code, out, err = said(capsys, *words, "--size", "24x24")
    assert code == 2 and out == "" and len(err.splitlines()) == 1
    assert err.startswith(f"visray: {text}")
    assert list(Path().iterdir()) == []


def test_a_live_picture_is_that_of_the_same_scene(capsys, monkeypatch):
    seen = {}

    def shown(load, **options):
        seen.update(options, scene=load())
        return 0

    monkeypatch.setattr("visray.cli.surface.show_live", shown)
    words = ("x^2 + y^2 - z^2 - a", "--param", "a=0.5", "--set", "lights.key.samples=1", "--clip", "2")
    assert said(capsys, *words, "--view", "--port", "9000", "--no-browser", "--error", "2%")[0] == 0
    expected = vr.surface_scene("x^2 + y^2 - z^2 - a", {"a": 0.5}, clip=2)
    assert seen["scene"] == vr.replaced(expected, "lights.key.samples", 1)
    assert seen["port"] == 9000 and seen["error"] == 0.02 and seen["browser"] is False and "file" not in seen
    assert said(capsys, *seen["recipe"].words()[2:], "--save", "again.json", "--spp", "1")[0] == 0
    assert vr.load("again.json").hash() == seen["scene"].hash()
    # A scene that is saved is watched.
    assert said(capsys, "heart", "--view", "--save", "heart.json")[0] == 0 and seen.get("port") is None
    assert seen["file"] == Path("heart.json") and seen["scene"] == vr.load("heart.json")
    assert seen["command"] == ["visray", "view", "heart.json"] and vr.load("heart.json") == vr.surface_scene("heart")


def test_colours_have_names(capsys):
    words = *SMALL, "--quiet", "--color", "tomato", "--inside", "#c33", "--save", "s.json"
    assert said(capsys, "x + y = z", *words)[0] == 0
    saved = vr.load("s.json").materials
    assert saved["outside"].kd == vr.Material(color="tomato").kd and saved["inside"].kd == vr.Material(color="#c33").kd
    made = vr.surface_scene("x + y = z", color="tomato", inside="#c33").materials
    assert (made["outside"].kd, made["inside"].kd) == (saved["outside"].kd, saved["inside"].kd)
    for color, flaw in (
        ("tomto", "--color = 'tomto': unknown colour; did you mean \"tomato\"?"),
        ("200,30,30", "each from 0 to 1; a colour of a screen is written #c81e1e"),
        ("rgb(200,30,30)", 'is no colour here; write "#c81e1e"'),
        ("1,2", "--color = '1,2': must be three numbers"),
    ):
        code, _, err = said(capsys, "x + y = z", *SMALL, "--color", color)
        assert code == 2 and flaw in err and err.count("\n") == 1
    with pytest.raises(vr.UserError, match=r"inside = .#ff6347aa.: a colour has no alpha here"):
        vr.surface_scene("x + y = z", inside="#ff6347aa")
