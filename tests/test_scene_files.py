"""A scene reads only below its own folder, and its errors do not tell which other files there are."""

import json
import os
import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow

from visray import public as vr
from visray.cli import main
from visray.errors import UserError
from visray.scene.files import WITH_FILES, OutsideWarning
from visray.scene.load import dump, load

OFF = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
ENTRIES = {
    "textures": lambda file: {"textures": {"x": {"type": "image", "file": file}}, "materials": {"m": {"texture": "x"}}},
    "objects": lambda file: {"objects": {"x": {"type": "mesh", "file": file}}, "camera": {}, "lights": {}},
    "geometries": lambda file: {
        "geometries": {"x": {"type": "mesh", "file": file}}, "objects": {"o": {"type": "instance", "geometry": "x"}},
        "camera": {}, "lights": {},
    },
}  # fmt: skip


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder with a scene's own folder in it, and the same files inside and outside."""
    own = tmp_path / "own"
    (own / "deep").mkdir(parents=True)
    for folder in (tmp_path, own, own / "deep"):
        Pillow.fromarray(np.full((2, 2, 3), 99, np.uint8)).save(folder / "map.png")
        (folder / "mesh.off").write_text(OFF)
    (own / "link").symlink_to(tmp_path)
    (own / "inner").symlink_to(own / "deep")
    for name in ("map.png", "mesh.off"):
        (own / f"linked.{name}").symlink_to(tmp_path / name)
    return own


def scene(place: Path, section: str, file: str) -> Path:
    path = place / "scene.json"
    path.write_text(json.dumps(ENTRIES[section](file) | {"film": {"width": 2, "height": 2}}))
    return path


def test_all_sections_with_files_are_here() -> None:
    assert set(ENTRIES) == set(WITH_FILES)


@pytest.mark.parametrize("section", ENTRIES)
def test_outside_files_are_refused_alike_whether_they_exist_or_not(place: Path, section: str) -> None:
    name = "map.png" if section == "textures" else "mesh.off"
    outside = [f"../{name}", str(place.parent / name), f"link/{name}", f"linked.{name}", f"deep/../../{name}"]
    for file in [*outside, "../nothing", "/nothing", "link/nothing", "/", "..", "a\0b/../../x"]:
        path = scene(place, section, file)
        with pytest.raises(UserError) as caught:
            load(path)
        said = f"{path}: {section}.x.file = {json.dumps(file)}: is outside of the scene's folder; "
        if "\0" not in file:
            advice = "put the file below it, or allow that: --allow-outside, or load(..., allow_outside=True)"
            assert str(caught.value) == said + advice
    for file in outside:
        load(scene(place, section, file), allow_outside=True)
    for file in (name, f"deep/{name}", f"deep/../{name}", f"inner/{name}", str(place / name)):
        load(scene(place, section, file))


TETRAHEDRON = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"


def nested(place: Path, files: list[str]) -> Path:
    """A scene in which operands at several depths are meshes: in a list, by name, and in what is cut away."""
    a, b, c = ({"type": "mesh", "file": file} for file in files)
    body = {"type": "sphere", "cut": [{"type": "csg", "op": "merge", "of": {"x": a, "y": {"type": "box", "cut": [b]}}}]}
    solid = {"type": "csg", "op": "difference", "of": [body, c]}
    path = place / "nested.json"
    path.write_text(
        json.dumps({"objects": {"solid": solid}, "film": {"width": 2, "height": 2}, "camera": {}, "lights": {}})
    )
    return path


def test_files_of_operands_are_read_below_the_folder_alone(place: Path) -> None:
    for folder in (place, place.parent):
        (folder / "solid.off").write_text(TETRAHEDRON)
    addresses = [f"objects.solid.of.{x}" for x in ("0.cut.0.of.x", "0.cut.0.of.y.cut.0", "1")]
    for file in ("../solid.off", "../nothing", "link/solid.off"):
        path = nested(place, [file] * 3)
        with pytest.raises(UserError) as caught:
            load(path)
        assert [line.split(": ")[1] for line in caught.value.lines] == [
            f'{address}.file = "{file}"' for address in addresses
        ]
    load(nested(place, ["../solid.off"] * 3), allow_outside=True)
    load(nested(place, ["solid.off"] * 3))


def test_files_of_operands_are_written_relative_to_the_folder(place: Path) -> None:
    files = ["deep/a.off", "b.off", "deep/c.off"]
    for file in files:
        (place / file).write_text(TETRAHEDRON)
    loaded = load(nested(place, files))
    with pytest.warns(OutsideWarning, match="b.off: is outside of the folder"):
        text = dump(loaded, place / "deep")
    (place / "deep" / "again.json").write_text(text)
    body, c = json.loads(text)["objects"]["solid"]["of"]
    merged = body["cut"][0]["of"]
    found = [merged["x"]["file"], merged["y"]["cut"][0]["file"], c["file"]]
    assert found == ["a.off", "../b.off", "c.off"]
    assert dump(load(place / "deep" / "again.json", allow_outside=True), place) == dump(loaded, place)


def test_the_other_errors_of_the_scene_are_told_too(place: Path) -> None:
    path = scene(place, "objects", "../mesh.off")
    raw = json.loads(path.read_text())
    path.write_text(json.dumps(raw | {"lights": {"l": {"type": "pointt"}}}))
    with pytest.raises(UserError) as caught:
        load(path)
    assert [line.split(": ")[1].split(" = ")[0] for line in caught.value.lines] == ["objects.x.file", "lights.l.type"]


@pytest.mark.parametrize("section", ENTRIES)
def test_a_missing_file_names_no_secret(place: Path, section: str) -> None:
    """A missing picture may name a picture beside it, but no other file."""
    (place / "secret.txt").write_text("x")
    with pytest.raises(UserError) as caught:
        vr.render(scene(place, section, "secret.png"), progress=False)
    assert "secret.txt" not in str(caught.value) and "there is no such file" in str(caught.value)


def test_python_and_the_command_line_can_allow_it(place: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(place)
    path = scene(place, "textures", "../map.png")
    for call in (vr.load, vr.prepare, lambda path, **more: vr.render(path, progress=False, **more)):
        with pytest.raises(UserError, match="is outside of the scene's folder"):
            call(path)
        call(path, allow_outside=True)
    assert main(["render", str(path), "-o", "a.png"]) == 2
    assert main(["render", str(path), "-o", "a.png", "--allow-outside"]) == 0
    # What the user says on the command line is the user's own word.
    assert (
        main(["render", str(scene(place, "textures", "map.png")), "-o", "a.png", "--set", "textures.x.file=../map.png"])
        == 0
    )
    # A scene made in Python is a program of the user; so is the folder it names.
    made = vr.Scene(
        textures={"x": vr.ImageTexture(file="../map.png")},
        materials={"m": vr.Material(texture="x")},
        camera=vr.Camera(),
        lights={},
    )
    vr.render(made, size=(2, 2), progress=False)


def test_a_scene_that_is_written_elsewhere_says_what_it_needs(place: Path) -> None:
    loaded = load(scene(place, "objects", "deep/mesh.off"))
    with pytest.warns(
        OutsideWarning,
        match="mesh.off: is outside of the folder of the scene file that is written; so "
        "the scene is read only with --allow-outside; ",
    ):
        text = dump(loaded, place / "elsewhere")
    assert json.loads(text)["objects"]["x"]["file"] == "../deep/mesh.off"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for folder in (place, place / "deep", None):
            dump(loaded, folder)


def test_scenes_of_the_original_read_below_the_folder_of_its_resources(place: Path) -> None:
    """That is the folder of the scene file, or its parent; what is above does not exist for them."""
    matt = {"type": "materialtextura", "ka": [1, 1, 1], "kd": [1, 1, 1], "ks": [0, 0, 0], "shininess": 1}

    def converted(file: str, **more: bool) -> str:
        ball = {"type": "sphere", "center": [0, 0, 0], "radius": 1, "material": matt | {"textureFile": file}}
        path = place / "deep" / "old.json"
        path.write_text(json.dumps({"typeScene": "VIRTUALWORLD", "objects": [ball | {"name": "b"}]}))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return next(iter(load(path, **more).textures.values())).file

    assert os.path.samefile(converted("map.png"), place / "deep" / "map.png")
    (place / "deep" / "map.png").unlink()
    assert os.path.samefile(converted("://resources/map.png"), place / "map.png")
    (place / "map.png").unlink()
    for file in ("../../map.png", "linked.map.png", "nothing.png"):
        with pytest.raises(UserError, match="there is no such picture; tried "):
            converted(file)
    assert os.path.samefile(converted("../../map.png", allow_outside=True), place.parent / "map.png")
