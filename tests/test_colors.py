"""Colours as text and as one number: names of CSS and #rrggbb against matplotlib and IEC 61966-2-1."""

from dataclasses import fields
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from matplotlib import colors as matplotlib_colors
from pydantic import TypeAdapter, ValidationError

import visray as vr
from visray.colors import FORMS, NAMED, color_of_text, spelled
from visray.lights.light import Light
from visray.quantities import quantities
from visray.scene.check import examined
from visray.scene.write import KINDS


def exact(byte: int) -> float:
    """Linear light of a number from 0 to 255, by IEC 61966-2-1, written once more."""
    x = Fraction(byte, 255)
    return (
        float(x / Fraction("12.92"))
        if x <= Fraction("0.04045")
        else float((x + Fraction("0.055")) / Fraction("1.055")) ** 2.4
    )


def test_names_are_those_of_css() -> None:
    assert {name: "#" + digits for name, digits in NAMED.items()} == {
        name: text.lower() for name, text in matplotlib_colors.CSS4_COLORS.items()
    }


def test_texts_are_srgb() -> None:
    for byte in range(256):
        assert color_of_text(f"#{byte:02x}{255 - byte:02X}00") == pytest.approx(
            (exact(byte), exact(255 - byte), 0), rel=1e-14
        )
    assert color_of_text("#c33") == color_of_text("#cc3333") == color_of_text("#CC3333")
    assert color_of_text("Tomato") == color_of_text(" tomato ") == color_of_text("#ff6347")
    assert color_of_text("white") == (1, 1, 1) and color_of_text("black") == (0, 0, 0)


@pytest.mark.parametrize(
    ("text", "flaw"),
    [
        ("tomto", 'unknown colour; did you mean "tomato"?'),
        ("light blue", 'unknown colour; did you mean "lightblue"?'),
        ("c33333", 'unknown colour; did you mean "#c33333"?'),
        ("qqq", f"unknown colour; write {FORMS}"),
        ("", f"unknown colour; write {FORMS}"),
        ("#c33f", 'a colour has no alpha here; how much light a material lets through is its kt; write "#c33"'),
        ("#cc3333aa", 'a colour has no alpha here; how much light a material lets through is its kt; write "#cc3333"'),
        ("transparent", "a colour has no alpha here; how much light a material lets through is its kt"),
        ("#12345", 'is no colour; after # there are six digits from 0 to f, or three, as in "#cc3333" and "#c33"'),
        ("rgb(1, 2,255)", 'is no colour here; write "#0102ff"'),
        (
            "rgb(1, 2, 256)",
            f"unknown colour; write {FORMS}",
        ),
    ],
)
def test_what_is_no_colour(text: str, flaw: str) -> None:
    assert examined({"ambient": text})[1] == [f'ambient = "{text}": {flaw}']


COLOURS = [
    pytest.param(f.type, id=f"{kind.__name__}.{f.name}")
    for kind in (*KINDS, Light)
    for f in fields(kind)
    if "Rec. 709" in getattr(quantities(kind).get(f.name), "unit", "")
]


@pytest.mark.parametrize("declared", COLOURS)
def test_every_colour_may_be_text_or_a_number(declared: object) -> None:
    adapter = TypeAdapter(declared)
    assert adapter.validate_python("tomato") == color_of_text("tomato")
    assert adapter.validate_python(0.25) == (0.25, 0.25, 0.25)
    assert adapter.validate_python([1, 0.5, 0]) == (1, 0.5, 0)
    forms = [x["type"] for x in adapter.json_schema()["anyOf"]]
    assert {"array", "string", "number"} <= {*forms}
    for wrong in ("tomto", -1, float("inf"), True, [1, 2]):
        with pytest.raises(ValidationError):
            adapter.validate_python(wrong)


def test_colours_of_a_file() -> None:
    tomato = color_of_text("tomato")
    raw = {
        "ambient": "tomato",
        "background": "tomato",
        "materials": {"m": dict.fromkeys(("ka", "kd", "ks", "kr", "kt"), "tomato")},
        "lights": {"l": {"type": "point", "position": [0, 0, 0]} | dict.fromkeys(("Ia", "Id", "Is"), "tomato")},
        "textures": {"t": {"type": "checker", "a": "tomato", "b": 0.25}},
    }
    scene, flaws = examined(raw)
    assert not flaws
    m, light, t = scene.materials["m"], scene.lights["l"], scene.textures["t"]
    assert {m.ka, m.kd, m.ks, m.kr, m.kt, light.Ia, light.Id, light.Is, t.a, scene.ambient, scene.background} == {
        tomato
    }
    assert t.b == (0.25, 0.25, 0.25)
    sky = examined({"background": {"top": "tomato", "bottom": 1}})[0].background
    assert (sky.top, sky.bottom) == (tomato, (1, 1, 1))


@pytest.mark.parametrize("number", [0, 0.5, 1, np.float32(0.5), np.int64(1)])
def test_a_number_is_grey(number: object) -> None:
    scene = vr.replaced(vr.Scene(camera=vr.Camera(), lights={}), "ambient", number)
    assert scene.ambient == (float(number),) * 3
    assert spelled(number) == (number,) * 3


@pytest.mark.parametrize(
    ("material", "flaw"),
    [
        ({"kd": -1}, ".kd = -1: must be at least 0"),
        ({"kd": float("nan")}, ".kd = NaN: must be finite"),
        ({"kd": 2e9}, ".kd = 2000000000.0: must be at most 1e+09"),
        ({"kr": 1.5}, ".kr = 1.5: must be at most 1"),
        (
            {"kr": [200, 30, 30]},
            '.kr = [200, 30, 30]: must be three numbers from 0 to 1; a colour of a screen is written "#c81e1e"',
        ),
        (
            {"kd": True},
            '.kd = true: must be a colour: a name such as "tomato", "#rrggbb", a number, or 3 numbers'
            " (linear Rec. 709, each >= 0)",
        ),
    ],
)
def test_wrong_numbers(material: dict, flaw: str) -> None:
    assert examined({"materials": {"m": material}})[1] == [f"materials.m{flaw}"]


def test_set_takes_names(tmp_path: Path) -> None:
    from visray.scene.address import parse_assignment

    scene = vr.Scene(materials={"m": vr.Material()}, camera=vr.Camera(), lights={})
    for text in ("materials.m.kd=tomato", "materials.m.kd=#ff6347", 'materials.m.kd="tomato"'):
        assert vr.replaced(scene, *parse_assignment(text)).materials["m"].kd == color_of_text("tomato")
    assert vr.replaced(scene, *parse_assignment("materials.m.ks=0.5")).materials["m"].ks == (0.5, 0.5, 0.5)


def test_a_file_is_written_with_the_texts_that_it_had(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text('{"ambient": 0.5, "materials": {"m": {"kd": "Tomato", "ks": "white"}}, "background": "#000"}')
    scene = vr.load(path)
    changed = vr.replaced(scene, "materials.m.ks", (0.5, 0.25, 0.0))
    text = vr.dump(changed, like=path)
    assert '"kd": "Tomato"' in text and '"ks": [0.5, 0.25, 0.0]' in text and '"ambient": 0.5' in text
    assert '"background": "#000"' in text
    path.write_text(text)
    assert vr.load(path) == changed
