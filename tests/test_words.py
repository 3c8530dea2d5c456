"""The words of the command line: assignments, numbers with units, and what a stranger is told of a wrong word."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from cyclopts import Token
from PIL import Image as Pillow

import visray as vr
from visray.cli import main
from visray.cli.commands import GROUPS, app
from visray.cli.quantities import parse_integer, parse_seconds, parse_share
from visray.errors import UserError
from visray.scene.address import changed

SPHERE = str(Path(__file__).resolve().parents[1] / "scenes" / "sphere.json")


def said(capsys, *tokens):
    """Exit code, standard output and standard error of a command."""
    code = main(list(tokens))
    out, err = capsys.readouterr()
    return code, out, err


@pytest.mark.parametrize(
    "tokens",
    [
        ["--set", "objects.large.radius=1,objects.large.center.0=2"],
        ["--set", "objects.large.radius=1", "objects.large.center.0=2"],
        ["--set", "objects.large.radius=1", "--set", "objects.large.center.0=2"],
        ["--set=objects.large.radius=1", "objects.large.center.0=2"],
    ],
)
def test_several_assignments(capsys, tokens):
    code, text, _ = said(capsys, "explain", *tokens, SPHERE, "--json")
    scene = changed(vr.load(SPHERE), {"objects.large.radius": 1.0, "objects.large.center.0": 2.0})
    assert code == 0 and json.loads(text)["scene_hash"] == scene.hash()


def test_an_assignment_repairs_what_is_wrong_in_the_file(capsys, tmp_path):
    file = tmp_path / "wrong.json"
    file.write_text('{"objects": {"a": {"type": "sphere", "radius": -1}, "b": {"type": "sphere", "radius": 0}}}')
    whole = ["--set", "objects.a.radius=2", "objects.b.radius=1"]
    assert said(capsys, "explain", str(file), *whole)[0] == 0
    code, _, err = said(capsys, "explain", str(file), "--set", "objects.a.radius=-2")
    assert code == 2 and err.splitlines() == [
        "visray: objects.a.radius = -2: must be greater than 0",
        f"visray: {file}: objects.b.radius = 0: must be greater than 0",
    ]
    assert f"{file}: objects.a.radius = -1" in said(capsys, "explain", str(file), "--set", "camera.fov=30")[2]


@pytest.mark.parametrize(("text", "seconds"), [("20", 20), ("20s", 20), ("2min", 120), ("1 h", 3600), ("500ms", 0.5)])
def test_times(text, seconds):
    assert parse_seconds(float, [Token(keyword="--time", value=text)]) == seconds


@pytest.mark.parametrize(
    ("parse", "text", "line"),
    [
        (parse_share, "5", "--x = 5: would be 500 %, and an error is below 100 %; write 5% or 0.05"),
        (parse_share, "120%", "--x = 120%: would be 120 %, and an error is below 100 %; write 1% or 0.01"),
        (parse_share, "0", "--x = '0': must be an error above 0 and below 100 %, such as 1% or 0.01"),
        (parse_share, "nan", "--x = 'nan': must be an error above 0 and below 100 %, such as 1% or 0.01"),
        (parse_share, "a", "--x = 'a': must be an error above 0 and below 100 %, such as 1% or 0.01"),
        (parse_seconds, "2 parsecs", "--x = '2 parsecs': must be a time, such as 20 or 20s, 2min, 1h"),
        (parse_seconds, "inf", "--x = 'inf': must be a time, such as 20 or 20s, 2min, 1h"),
        (parse_integer, "1.5", "--x = '1.5': must be a whole number, such as 16"),
    ],
)
def test_a_wrong_number_gets_one_line(parse, text, line):
    with pytest.raises(UserError) as caught:
        parse(float, [Token(keyword="--x", value=text)])
    assert caught.value.lines == (line,)


WRONG = {
    "no scene": ("render", "visray render: the scene is missing; visray new ball.json writes one to begin with"),
    "a pipe": ("render -", "-: a scene is read from no pipe; write it to a file first, such as scene.json"),
    "no file": ("render a.json", "a.json: no such file; visray new a.json writes a scene to begin with"),
    "no folder of scenes": ("render .", ".: is a folder; give a scene in it"),
    "near command": ("rendr", "rendr: there is no such command; did you mean visray render? visray --help lists all"),
    "near option": (
        f"render {SPHERE} --tim 1",
        "--tim: there is no such option; did you mean --time? visray render --help lists all",
    ),
    "another word": (
        f"render {SPHERE} --samples 4",
        "--samples: there is no such option; did you mean --spp? visray render --help lists all",
    ),
    "no command": (SPHERE, f"{SPHERE}: is a scene, and no command; visray render {SPHERE} makes its picture"),
    "no value": ("render a --set", "--set: its value is missing; visray render --help says what it takes"),
    "a size below 0": (
        f"render {SPHERE} --size -64x48",
        "--size = '-64x48': must be WIDTHxHEIGHT in whole pixels greater than 0, such as 640x480",
    ),
    "a pixel below 0": (
        f"explain {SPHERE} --why -1,2", "--why = '-1,2': must be X,Y, the column and row of a pixel, such as 320,240"
    ),
    "a time below 0": (f"render {SPHERE} --time -5s", "time = -5.0: must be a finite number above 0, such as 10"),
    "an error below 0": (
        f"render {SPHERE} --error -1%", "--error = '-1%': must be an error above 0 and below 100 %, such as 1% or 0.01"
    ),
    "choice": (f"render {SPHERE} --precision half", "--precision = half: must be one of single, double"),
    "twice": (f"render {SPHERE} --spp 1 --spp 2", "--spp: is given twice; leave one out"),
    "too many": (f"render {SPHERE} b.json", "b.json: is one word too many; visray render --help says what it takes"),
    "no --set": (f"render {SPHERE} camera.fov=3", "camera.fov=3: stands alone; write --set camera.fov=3"),
    "no goal": (
        f"tune {SPHERE}", "visray tune: needs an error or a time to choose for; write --error 1% or --time 10"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_stranger_is_told_what_is_right(name, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words, line = WRONG[name]
    assert said(capsys, *words.split()) == (2, "", f"visray: {line}\n")


def test_samples_are_spp(capsys, tmp_path):
    """In a file, in an assignment, and in Python."""
    path = tmp_path / "ball.json"
    path.write_text('{"settings": {"samples": 4}}')
    assert "settings.samples: unknown key; did you mean 'spp'?" in said(capsys, "explain", str(path))[2]
    code, _, err = said(capsys, "explain", SPHERE, "--set", "settings.samples=4")
    assert code == 2 and "settings has no 'samples'; did you mean \"spp\"?" in err
    with pytest.raises(TypeError, match="did you mean 'spp'"):
        vr.Settings(samples=4)
    with pytest.raises(TypeError, match='did you mean "spp"'):
        vr.render(SPHERE, samples=4)
    assert vr.SphereLight((0, 3, 0), samples=4).samples == 4  # of a light they are called so


@pytest.mark.parametrize(
    ("name", "address"),
    [
        ("spp", "settings.spp"), ("samples", "settings.spp"), ("width", "film.width"), ("height", "film.height"),
        ("fov", "camera.fov"), ("filter.type", "film.filter.type"), ("origin.0", "camera.origin.0"),
    ],
)  # fmt: skip
def test_a_field_of_a_part_of_the_scene_is_looked_for_there(name, address, capsys):
    head = name.split(".")[0]
    line = f"visray: {name}: the scene has no '{head}'; write {address}\n"
    assert said(capsys, "explain", SPHERE, "--set", f"{name}=3") == (2, "", line)
    assert vr.value(vr.load(SPHERE), address) is not None


def test_a_field_of_a_part_of_the_scene_at_the_head_of_a_file(capsys, tmp_path):
    path = tmp_path / "ball.json"
    path.write_text('{"spp": 4, "fov": 30}')
    assert said(capsys, "explain", str(path))[2].splitlines() == [
        f'visray: {path}: spp = 4: is a field of settings; write "settings": {{"spp": ...}}',
        f'visray: {path}: fov = 30: is a field of camera; write "camera": {{"fov": ...}}',
    ]
    with pytest.raises(TypeError, match=r"^Scene\(\) has no 'spp'; write settings=vr\.Settings\(spp=\.\.\.\)$"):
        vr.Scene(spp=4)


def test_a_program_or_a_picture_in_place_of_a_scene(capsys, tmp_path, monkeypatch):
    """Pictures are known by their bytes, whatever they are called."""
    monkeypatch.chdir(tmp_path)
    assert said(capsys, "new", "--python")[0] == 0
    line = "visray: scene.py: is a Python program, not a scene; run it: python scene.py\n"
    assert said(capsys, "render", "scene.py") == (2, "", line)
    line = "visray: scene.py: is a Python program, and no command; run it: python scene.py\n"
    assert said(capsys, "scene.py") == (2, "", line)
    image = vr.Image({"RGB": np.full((8, 8, 3), 0.5, np.float32)})
    for name in ("ball.png", "ball.exr"):
        image.write(name)
        line = f"visray: {name}: is a picture, not a scene; give the .json file of a scene\n"
        assert said(capsys, "explain", name) == (2, "", line)
    for form in ("JPEG", "GIF", "TIFF", "WEBP"):
        Pillow.new("RGB", (8, 8)).save("ball.json", form)
        with pytest.raises(UserError, match=r"^ball\.json: is a picture, not a scene"):
            vr.load("ball.json")
    Path("ball.json").write_text("{}")
    assert said(capsys, "render", "ball.png")[2] == (
        "visray: ball.png: is a picture, not a scene; give its scene, ball.json\n"
    )
    Path("odd.py").write_text("{}")
    assert vr.load("odd.py") == vr.load("ball.json")


def test_files_that_may_be_meant_are_named(capsys, tmp_path, monkeypatch):
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "cup.json").write_text("{}")
    monkeypatch.chdir(tmp_path)
    assert "did you mean 'scenes/cup.json'?" in said(capsys, "render", "cup.json")[2]
    assert "give a scene in it, such as scenes/cup.json" in said(capsys, "render", "scenes")[2]
    assert "write visray render scenes/cup.json" in said(capsys, "render")[2]
    monkeypatch.chdir("scenes")
    assert "did you mean 'cup.json'?" in said(capsys, "render", "cup")[2]
    for other in ("cap.exr", "cups.png"):  # pictures are no scenes
        Path(other).write_text("")
    for wrong in ("cap.json", "cups.json", "cu.json"):
        assert said(capsys, "render", wrong)[2] == f"visray: {wrong}: no such file; did you mean 'cup.json'?\n"


def test_every_command_has_an_example_and_a_short_line(capsys):
    """The example is a command of visray, and its options exist."""
    names = [name for commands in GROUPS.values() for name in commands]
    assert sorted(names) == sorted(name for name in app if not name.startswith("-"))
    for name in names:
        code, text, _ = said(capsys, name, "--help")
        assert code == 0 and "Example: " in text and len(text.split("\n\n")[1].strip()) < 65
        example = next(commands[name] for commands in GROUPS.values() if name in commands)
        words = shlex.split(example.removeprefix('eval "$(').removesuffix(')"'))
        options = {option for argument in app[name].assemble_argument_collection() for option in argument.names}
        assert words[:2] == ["visray", name] and {word for word in words if word[0] == "-"} <= options


@pytest.mark.parametrize("words", [["--why", "23,15"], []])
def test_studies_take_another_size(capsys, words):
    code, text, _ = said(capsys, "explain", SPHERE, "--size", "24x16", "--json", *words)
    assert code == 0 and json.loads(text)
    code, _, err = said(capsys, "explain", SPHERE, "--size", "24x16", "--why", "24,15")
    assert code == 2 and "must be a whole number from 0 to 23, as the film has 24" in err


def test_hints_of_assignments():
    """A parameter of a formula, and two words where a list is meant."""
    scene = vr.Scene(objects={"p": vr.Polynomial(expression="x^2 + y^2 + z^2 - a", parameters={"a": 1.0})})
    with pytest.raises(UserError, match=r"but its formula has; write objects\.p\.parameters\.a$"):
        changed(scene, {"objects.p.a": 1.0})
    scene = vr.load(str(Path(SPHERE).with_name("wrap-and-filter.json")))
    name = next(x for x, y in scene.textures.items() if hasattr(y, "wrap"))
    with pytest.raises(UserError, match=r'several values are a list; write \["repeat", "clamp"\]'):
        changed(scene, {f"textures.{name}.wrap": "repeat,clamp"})


@pytest.mark.parametrize("key", ["color", "colour", "kd", "kr", "texture"])
def test_what_a_material_has_is_looked_for_there(key, tmp_path, capsys):
    """In files, in assignments and in Python."""
    path = tmp_path / "ball.json"
    path.write_text(json.dumps({"objects": {"ball": {"type": "sphere", key: "red"}}}))
    code, _, err = said(capsys, "explain", str(path))
    assert code == 2 and f'objects.ball.{key} = "red": a material has this; write it in materials' in err
    with pytest.raises(TypeError, match=f"no '{key}'; a material has this"):
        vr.Sphere(**{key: "red"})
    scene = vr.Scene(materials={"paint": vr.Material()}, objects={"ball": vr.Sphere(material="paint")})
    with pytest.raises(
        UserError, match=rf"^objects\.ball\.{key}: its material has this; write materials\.paint\.{key}$"
    ):
        changed(scene, {f"objects.ball.{key}": 0.5})
    plain = vr.Scene(objects={"ball": vr.Sphere()})
    with pytest.raises(UserError, match=rf"^objects\.ball\.{key}: a material has this"):
        changed(plain, {f"objects.ball.{key}": 0.5})


@pytest.mark.parametrize(
    ("key", "field", "example"),
    [
        ("color", "Id", 'Id = [1, 0.8, 0.6] or Id = "orange"'),
        ("colour", "Id", 'Id = [1, 0.8, 0.6] or Id = "orange"'),
        ("power", "intensity", "intensity = 2"),
        ("strength", "intensity", "intensity = 2"),
    ],
)
def test_colour_and_power_of_a_light(key, field, example, tmp_path, capsys):
    """In files, in assignments and in Python; and what the example says is right."""
    path = tmp_path / "ball.json"
    path.write_text(json.dumps({"lights": {"key": {"type": "sphere", "position": [0, 3, 0], key: "red"}}}))
    code, _, err = said(capsys, "explain", str(path))
    assert code == 2 and f'lights.key.{key} = "red": ' in err and err.endswith(f"is {field}, as in {example}\n")
    for kind in (vr.SphereLight, vr.PointLight, vr.DirectionalLight):
        with pytest.raises(TypeError, match=rf"^{kind.__name__}\(\) has no '{key}'; .*, as in {re.escape(example)}$"):
            kind((0, 3, 0), **{key: "red"})
    code, _, err = said(capsys, "explain", SPHERE, "--set", f"lights.key.{key}=1")
    assert (code, err) == (2, f"visray: lights.key.{key}: lights.key has no '{key}'; write lights.key.{field}\n")
    light = vr.PointLight((0, 3, 0), Id="orange", intensity=2)
    assert light.Id[0] == 1 and light.Id[2] == 0 and vr.PointLight((0, 3, 0), Id=[1, 0.8, 0.6]).Id == (1, 0.8, 0.6)
