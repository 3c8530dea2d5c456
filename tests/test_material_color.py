"""The input `color` of a material: kd as people pick colours, in files, in Python and in assignments."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import visray as vr
from visray.colors import color_of_text
from visray.errors import UserError
from visray.features import features
from visray.scene.address import numeric_addresses, parse_assignment
from visray.scene.check import examined

TOMATO = color_of_text("tomato")
BALL = vr.Scene(
    camera=vr.Camera(origin=(0, 0, 5), fov=30.0),
    film=vr.Film(width=12, height=10),
    materials={"m": vr.Material(ka=(0.1, 0.1, 0.1), ks=(0.5, 0.5, 0.5)), "n": vr.Material(color="navy")},
    lights={"key": vr.PointLight(position=(2, 3, 4))},
    objects={"wall": vr.Rectangle(width=(8, 0, 0), height=(0, 8, 0), material="n")},
    settings=vr.Settings(spp=1),
)


@pytest.mark.parametrize(
    ("color", "kd"),
    [
        ("tomato", TOMATO),
        ("#ff6347", TOMATO),
        ([255, 99, 71], TOMATO),
        ((255.0, 99.0, 71.0), TOMATO),
        (np.array([255, 99, 71]), TOMATO),
        ([0, 0, 0], (0, 0, 0)),
        ([0, 0, 1.5], (0, 0, 1.5 / 255 / 12.92)),
        (0.5, (0.5, 0.5, 0.5)),
        (1, (1, 1, 1)),
        (0, (0, 0, 0)),
    ],
)
def test_it_is_kd(color: object, kd: tuple) -> None:
    made = vr.Material(color=color)
    assert made.kd == pytest.approx(kd, rel=1e-14) and made.ka is None
    assert vr.replaced(BALL, "materials.m.color", color).materials["m"] == replace(made, ks=(0.5, 0.5, 0.5))
    if not isinstance(color, np.ndarray):
        assert examined({"materials": {"m": {"color": color}}})[0].materials["m"] == made
    # It is an input: what is kept is kd.
    assert "color" not in {f.name for f in fields(vr.Material)} and replace(made, kd=(0, 0, 0)).kd == (0, 0, 0)


def test_beside_other_fields() -> None:
    made = examined({"materials": {"m": {"color": "tomato", "ka": "white", "ks": 0.3}}})[0].materials["m"]
    assert made == vr.Material(kd=TOMATO, ka=(1, 1, 1), ks=(0.3, 0.3, 0.3))
    assert examined({"materials": {"m": {"color": None, "kd": 0.5}}})[0].materials["m"].kd == (0.5, 0.5, 0.5)


FLAWS = {
    "tomto": 'unknown colour; did you mean "tomato"?',
    "#ff634780": "a colour has no alpha here; how much light a material lets through is its kt",
    (0.8, 0.2, 0.1): (
        'has three numbers from 0 to 255, and these are not above 1; write "kd": [0.8, 0.2, 0.1] in linear light, '
        'or "color": [204, 51, 26] for a colour of a screen'
    ),
    (1, 1, 0): 'write "kd": [1, 1, 0] in linear light, or "color": [255, 255, 0] for a colour of a screen',
    (300, 0, 0): "must be three numbers from 0 to 255",
    (-1, 0, 0): "must be three numbers from 0 to 255",
    200: "must be from 0 to 1, as one number is grey in linear light; a screen's numbers are three",
    float("nan"): "must be from 0 to 1",
    True: "is no colour; write a name such as",
    (1, 2): "is no colour; write a name such as",
}


@pytest.mark.parametrize("color", FLAWS)
def test_what_is_no_colour(color: object) -> None:
    flaw = FLAWS[color]
    (line,) = examined({"materials": {"m": {"color": list(color) if isinstance(color, tuple) else color}}})[1]
    assert line.startswith("materials.m.color = ") and flaw in line
    with pytest.raises(UserError) as caught:
        vr.Material(color=color)
    in_python = flaw.replace('"kd": [', "kd=[").replace('"color": [', "color=[")
    assert str(caught.value).startswith("Material: color = ") and in_python in str(caught.value)
    with pytest.raises(UserError) as caught:
        vr.replaced(BALL, "materials.m.color", color)
    assert str(caught.value).startswith("materials.m.color = ") and flaw in str(caught.value)


def test_color_and_kd_are_one_too_many() -> None:
    (line,) = examined({"materials": {"m": {"color": "red", "kd": [0.7, 0.7, 0.7]}}})[1]
    assert line.endswith(": color sets kd; write only one of the two")
    with pytest.raises(UserError, match="color sets kd; write only one of the two"):
        vr.Material(color="red", kd=(0.5, 0.5, 0.5))
    with pytest.raises(UserError, match=r"^Material: color sets kd; .*vr\.replaced does not"):
        replace(vr.Material(color="red"), color="blue")
    assert examined({"materials": {"m": {"colour": "red"}}})[1][0].startswith(
        "materials.m.colour: unknown key; did you mean 'color'?"
    )
    with pytest.raises(UserError, match=r"materials\.m\.color = None: is no colour"):
        vr.replaced(BALL, "materials.m.color", None)


def test_an_assignment_lets_ka_follow_again() -> None:
    for text in ("tomato", "#ff6347", "255,99,71", "[255, 99, 71]"):
        made = vr.replaced(BALL, *parse_assignment(f"materials.m.color={text}")).materials["m"]
        assert made == vr.Material(kd=TOMATO, ks=(0.5, 0.5, 0.5))
    assert vr.value(BALL, "materials.m.color") == (0.7, 0.7, 0.7)
    right = r"write materials\.m\.color as a whole, or materials\.m\.kd\.1 in linear light"
    with pytest.raises(UserError, match=rf"materials\.m\.color\.1 = 255: color has no numbers of its own; {right}"):
        vr.replaced(BALL, "materials.m.color.1", 255)
    with pytest.raises(UserError, match=r"materials\.m\.kd has no '3'"):
        vr.value(BALL, "materials.m.color.3")
    prepared = vr.prepare(BALL).updated({"materials.n.color": "gold"})
    assert prepared.scene.materials["n"] == vr.Material(color="gold")


def test_derivatives_are_those_of_kd() -> None:
    by = {a: vr.derivative(BALL, a, progress=False) for a in ("materials.n.color", "materials.n.kd")}
    assert np.array_equal(by["materials.n.color"], by["materials.n.kd"])
    expected = vr.difference(BALL, "materials.n.color")
    assert np.allclose(by["materials.n.color"], expected, rtol=1e-6, atol=1e-8) and expected.max() > 0.1
    assert np.array_equal(expected, vr.difference(BALL, "materials.n.kd"))
    gradient = vr.gradient(BALL, ["materials.n.color.2"], progress=False)["materials.n.color.2"]
    assert gradient == vr.gradient(BALL, ["materials.n.kd.2"], progress=False)["materials.n.kd.2"]
    dark = replace(BALL, lights={}, materials={"n": vr.Material(color="black")})
    assert features(dark, ("materials.n.color",))["ambient"] and not features(dark)["ambient"]
    assert "materials.n.color" not in numeric_addresses(BALL)
    for refused in (lambda a: vr.gradient(BALL, [a], progress=False), lambda a: vr.difference(BALL, a)):
        with pytest.raises(UserError, match="has no derivative, as it also sets ka, which is written here; name kd"):
            refused("materials.m.color")


def test_a_picture_as_a_function_takes_it_in_linear_light() -> None:
    by = [vr.render_function(BALL, [f"materials.n.{name}"], spp=1, progress=False) for name in ("color", "kd")]
    color = (0.3, 0.6, 0.2)
    assert np.array_equal(by[0](color), by[1](color)) and np.array_equal(by[0].start, by[1].start)


def test_a_misspelled_color_is_answered_with_color() -> None:
    with pytest.raises(UserError, match=r"materials\.m has no 'colr'; did you mean \"color\"\? \(one of color, ka"):
        vr.replaced(BALL, "materials.m.colr", "gold")


def test_a_track_moves_kd() -> None:
    track = {"address": "materials.m.color", "times": [0, 1], "values": [0, 1]}
    raw = {
        "materials": {"m": {"color": "red"}},
        "objects": {"ball": {"type": "sphere", "material": "m"}},
        "animation": {"duration": 1, "tracks": {"t": track}},
        "camera": {},
        "lights": {},
    }
    (line,) = examined(raw)[1]
    assert "materials.m.color" in line and "is another name of materials.m.kd; move that" in line


def test_a_file_keeps_its_color(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text('{"materials": {"m": {"ks": 0.3, "color": [255, 99, 71]}, "n": {"color": "red"}}}')
    scene = vr.load(path)
    text = vr.dump(vr.replaced(scene, "materials.n.color", "blue"), like=path)
    assert '"color": [255, 99, 71]' in text and '"kd": [0.0, 0.0, 1.0]' in text and text.count("color") == 1
    path.write_text(text)
    assert vr.load(path).materials == {"m": scene.materials["m"], "n": vr.Material(color="blue")}
