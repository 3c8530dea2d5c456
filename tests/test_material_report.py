"""What is said of materials: glass on surfaces that are open, and shares of light above 1."""

import json
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from samples import NAMES, SAMPLES
from solids import CUBE

import visray as vr
from visray.cli import main
from visray.features import features
from visray.material_report import MaterialWarning, color_notes, energy_notes, sheet_notes
from visray.primitives import Polynomial

GLASS = vr.Material(kt=(0.9, 0.9, 0.9), kd=(0.0, 0.0, 0.0), ior=1.5)
LAMP = {"lamp": vr.PointLight(position=(0, 5, 5))}


def scene_of(objects: dict, **materials: vr.Material) -> vr.Scene:
    return vr.Scene(film=vr.Film(width=4, height=3), objects=objects, materials=materials, lights=LAMP,
                    settings=vr.Settings(spp=1), camera=vr.Camera())  # fmt: skip


def notes(scene: vr.Scene) -> list[str]:
    return sheet_notes(scene, features(scene))


@pytest.mark.parametrize("name", NAMES)
def test_glass_on_each_open_kind_is_noted_and_on_no_solid(name: str) -> None:
    thing = replace(SAMPLES[name].posed, material="glass")
    found = notes(scene_of({"x": thing}, glass=GLASS))
    assert len(found) == (not thing.closed)
    assert all(text.startswith(f"objects.x: a {thing.type} that is open bends no light") for text in found)
    for quiet in (replace(GLASS, ior=1.0), replace(GLASS, kt=(0.0, 0.0, 0.0))):
        assert not notes(scene_of({"x": thing}, glass=quiet))


def test_the_note_says_what_would_be_right() -> None:
    vertices, faces = CUBE
    things = {
        "cup": Polynomial(surface="heart", material="glass"),
        "jar": vr.Mesh(vertices=vertices, faces=faces[1:], material="glass"),
        "sheet": vr.Mesh(vertices=vertices, faces=faces, solid=False, material="glass"),
        "pane": vr.Instance(geometry="pane", material="glass"),
        "another pane": vr.Instance(geometry="pane", material="glass"),
    }
    scene = replace(scene_of(things, glass=GLASS), geometries={"pane": vr.Disk()})
    cup, jar, sheet, pane = notes(scene)
    assert cup == (
        "objects.cup: a polynomial that is open bends no light, although materials.glass has kt and the ior 1.5; "
        'write "ends": "capped", or write the ior 1 if light shall go straight through'
    )
    assert "close it: it has 3 open edges around 1 hole" in jar and 'leave "solid" out' in sheet
    assert pane.startswith("objects.pane and 1 more: a disk") and "use a solid, such as a thin cylinder" in pane
    cut = {"cut": replace(vr.Disk(), cut=(vr.Sphere(radius=0.3),), material="glass")}
    assert notes(scene_of(cut, glass=GLASS))[0].startswith("objects.cut: a disk that is open")
    shell = vr.Csg(op="difference", ends="open", of=(vr.Csg(op="merge", of=(vr.Box(), vr.Sphere())), vr.Sphere()))
    shell = {"shell": replace(shell, material="glass")}
    assert "a csg that is open bends no light" in notes(scene_of(shell, glass=GLASS))[0]
    capped = replace(things["cup"], ends="capped")
    assert not notes(scene_of({"cup": capped}, glass=GLASS))


def test_the_note_is_given_once_when_a_scene_is_rendered() -> None:
    scene = scene_of({"cup": Polynomial(expression="x^2+y^2-z", material="glass")}, glass=GLASS)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        for _ in range(2):
            vr.render(scene, progress=False)
    assert [w.category for w in caught if w.category is MaterialWarning] == [MaterialWarning]
    assert str(caught[0].message).startswith("objects.cup: ")


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"kr": (0.9, 0.8, 0.5)},
         "kr + kd = 1.6 is above 1: more light leaves it than arrives; kd is 0.7 unless it is written, and a mirror "
         "or glass has about 0"),
        ({"kr": (0.9, 0.9, 0.9), "kd": (0.2, 0.0, 0.0)}, "kr + kd = 1.1 is above 1: more light leaves it than arrives"),
        ({"kr": (0.5, 0.5, 0.5), "kd": (0.3, 0.3, 0.3), "ks": (0.8, 0.8, 0.8)},
         "kr + kd + ks = 1.6 is above 1: its highlights are brighter than the light that makes them"),
        ({"kd": (1.5, 0.0, 0.0)}, "kd = 1.5 is above 1: more light leaves it than arrives"),
        ({"kr": (0.2, 0.2, 0.2), "kt": (0.9, 0.9, 0.9), "kd": (0.0, 0.0, 0.0)},
         "kr + kt = 1.1 is above 1: more light leaves it than arrives"),
        ({"kt": (0.5, 0.5, 0.5), "kd": (0.8, 0.8, 0.8), "ks": (1.4, 1.4, 1.4)},
         "kt + (1 - kt) (kd + ks) = 1.6 is above 1: its highlights are brighter than the light that makes them"),
        ({"kr": (0.5, 0.5, 0.5), "texture": "tiles"}, "kr + kd = 1.3 is above 1: more light leaves it than arrives"),
    ],
)  # fmt: skip
def test_shares_above_1_are_said_with_their_sum(fields: dict, says: str) -> None:
    scene = scene_of({"x": vr.Sphere(material="m")}, m=vr.Material(**fields), unused=vr.Material(kd=(9.0, 9.0, 9.0)))
    scene = replace(scene, textures={"tiles": vr.CheckerTexture(a=(0.1, 0.8, 0.1), b=(0.2, 0.2, 0.2))})
    assert energy_notes(scene) == [f"materials.m: {says}"]
    assert list(vr.explain(scene).notes) == [f"materials.m: {says}"]


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"kd": (0.7, 0.1, 0.2), "ks": (0.3, 0.9, 0.7), "kr": (0.0, 0.0, 0.1)},
        {"kt": (1.0, 1.0, 1.0)},
        {"kd": (0.6, 0.0, 0.0), "kr": (0.0, 0.9, 0.9)},
        {"ka": (5.0, 5.0, 5.0)},
        {"color": "crimson", "ks": 0.5, "shininess": 80},
        {"kd": (0.8, 0.8, 0.8), "ks": (0.7, 0.7, 0.7)},
        {"color": "wheat", "kr": 0.1},
    ],
)
def test_shares_of_1_and_usual_highlights_are_not(fields: dict) -> None:
    assert energy_notes(scene_of({"x": vr.Sphere(material="m")}, m=vr.Material(**fields))) == []


def test_materials_with_one_sentence_share_it() -> None:
    balls = {f"b{i}": vr.Sphere(material=f"m{i}") for i in range(3)}
    mirrors = {f"m{i}": vr.Material(kr=(0.4, 0.4, 0.4)) for i in range(3)}
    (text,) = energy_notes(scene_of(balls, **mirrors))
    assert text.startswith("materials.m0 and 2 more: kr + kd = 1.1 is above 1")


def test_a_full_own_colour_counts_in_full() -> None:
    scene = scene_of({"x": vr.Sphere(material="m")}, m=vr.Material(kt=(0.5, 0.5, 0.5), kd=(0.6, 0.6, 0.6)))
    assert energy_notes(scene) == []
    full = replace(scene, settings=replace(scene.settings, local="full"))
    assert energy_notes(full) == ["materials.m: kt + kd = 1.1 is above 1: more light leaves it than arrives"]


def test_the_picture_of_a_mirror_has_the_surplus_that_explain_says() -> None:
    """A mirror lit frontally under a white sky: kr from the sky and kd from the lamp."""
    lamp = {"lamp": vr.DirectionalLight(direction=(0, 0, -1))}
    mirror = vr.Material(kr=(0.5, 0.5, 0.5), ka=(0.0, 0.0, 0.0))
    scene = replace(
        scene_of({"x": vr.Plane(normal=(0, 0, 1), material="m")}, m=mirror), lights=lamp, background=(1.0, 1.0, 1.0),
        camera=vr.Camera(origin=(0, 0, 5), fov=1.0),
    )  # fmt: skip
    assert np.allclose(vr.render(scene, progress=False)["RGB"], 1.2, rtol=1e-6)
    assert "kr + kd = 1.2 is above 1" in energy_notes(scene)[0]


def test_the_command_line_says_both(tmp_path: Any, capsys: Any) -> None:
    raw = {
        "materials": {"glass": {"kt": [1, 1, 1], "kd": [0, 0, 0]}, "mirror": {"kr": [0.9, 0.9, 0.9]}},
        "objects": {
            "water": {"type": "sphere", "material": "glass"},
            "rod": {"type": "cylinder", "radius": 0.1, "height": 4, "material": "glass"},
            "cup": {"type": "disk", "material": "glass"},
            "ball": {"type": "sphere", "center": [3, 0, 0], "material": "mirror"},
        },
        "camera": {},
        "lights": {},
    }
    path = tmp_path / "a.json"
    path.write_text(json.dumps(raw))
    assert main(["explain", str(path), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["overlaps"] == [
        {"counts": "objects.rod", "hidden": "objects.water", "reason": "volume 0.1257 is smaller than 4.189"}
    ]
    assert report["overlap_count"] == 1 and [text.split(":")[0] for text in report["notes"]] == [
        "objects.cup", "materials.mirror",
    ]  # fmt: skip
    assert main(["explain", str(path)]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "objects.rod" in out and "kr + kd = 1.6 is above 1" in out


def test_a_colour_of_a_screen_that_is_written_as_light_is_noted() -> None:
    """Lights may be bright, and what is below 10 is taken as it is."""
    materials = {"m": vr.Material(kd=(200, 30, 30), ka=(0, 12.5, 0), ks=(9.9, 0, 0)), "n": vr.Material(ks=(300, 0, 0))}
    made = replace(
        scene_of({"x": vr.Sphere(material="m")}, **materials),
        textures={"t": vr.CheckerTexture(a=(255, 255, 255))},
        background=vr.SkyGradient(top=(0, 0, 128), bottom=(1, 1, 1)),
        lights={"lamp": vr.PointLight(position=(0, 5, 5), Id=(100, 100, 100))},
    )
    found = color_notes(made)
    assert found[1] == (
        "materials.m.kd = [200, 30, 30]: is up to 200 times as bright as white; a colour of a screen, whose numbers go "
        'to 255, is written "#c81e1e"'
    )
    addresses = ["materials.m.ka", "materials.m.kd", "textures.t.a", "background.top"]
    assert [text.split(" = ")[0] for text in found] == addresses
    with pytest.warns(MaterialWarning, match=r"materials\.m\.kd = \[200, 30, 30\]: is up to 200 times"):
        vr.prepare(made)
    assert set(found) <= set(vr.explain(made).notes)
    assert [x.split(" = ")[0] for x in color_notes(vr.Scene(background=(70, 80, 90), ambient=(50, 50, 50)))] == [
        "background",
        "ambient",
    ]


def test_a_priority_of_an_opaque_material_is_noted() -> None:
    """Glass may have one, and 0 is what every material has."""
    glass, paint = vr.Material(kt=(0.5, 0.0, 0.0), priority=2), vr.Material(priority=-3)
    balls = {name: vr.Sphere(material=name) for name in ("glass", "paint", "plain")}
    made = scene_of(balls, glass=glass, paint=paint, plain=vr.Material(priority=0))
    (text,) = (note for note in vr.explain(made).notes if "priority" in note)
    assert text.startswith("materials.paint: priority changes nothing, as kt is 0") and "write a kt" in text
    with pytest.warns(MaterialWarning, match=r"materials\.paint: priority changes nothing"):
        vr.prepare(made)
