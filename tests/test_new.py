"""The scene that `visray new` writes."""

import runpy

import numpy as np
import pytest

import visray as vr
from visray.cli import main
from visray.scene.check import checked
from visray.scene.comments import has_comments
from visray.starter import starter


def said(capsys, *words):
    """Exit code, standard output and standard error of a command."""
    code = main(list(words))
    return code, *capsys.readouterr()


def test_the_file_and_the_script_are_one_scene(tmp_path, monkeypatch):
    """The script is run with a small picture in place of its own."""
    file, script = tmp_path / "a.json", tmp_path / "a.py"
    file.write_text(starter("a"))
    script.write_text(starter("a", python=True))
    monkeypatch.chdir(tmp_path)
    seen = []
    monkeypatch.setattr(vr, "render", lambda scene: seen.append(scene) or vr.Image({"RGB": np.zeros((2, 2, 3))}))
    runpy.run_path(str(script))
    assert checked(seen[0]).hash() == vr.load(file).hash()
    assert (tmp_path / "a.png").exists() and has_comments(file.read_text())


def test_everything_in_the_scene_is_seen_and_lit(tmp_path):
    file = tmp_path / "a.json"
    file.write_text(starter("a"))
    scene = vr.load(file)
    image = vr.render(scene, size=(96, 60), spp=4, progress=False)
    assert set(np.unique(image["id"])) >= set(image.objects.values())
    # Neither dark nor washed out: the mean of the picture on a screen, and the share of pixels at its limit.
    shown = image.display()
    assert 90 < shown.mean() < 220 and (shown == 255).all(axis=2).mean() < 0.2
    # Colours stay colours: in the middle of the ball, red is far above blue.
    assert image["RGB"][image["id"] == image.objects["ball"]].mean(0)[[0, 2]] @ [1, -2] > 0


@pytest.mark.parametrize(("words", "name", "after"), [
    (["new"], "scene.json", "visray render scene.json"),
    (["new", "two balls.json"], "two balls.json", "visray render 'two balls.json'"),
    (["new", "cup"], "cup.json", "visray render cup.json"),
    (["new", "--python"], "scene.py", "python scene.py"),
    (["new", "cup.py"], "cup.py", "python cup.py"),
])  # fmt: skip
def test_the_next_command_is_said_and_no_file_is_replaced(words, name, after, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert said(capsys, *words) == (0, f"{name}: written; next: {after}\n", "")
    text = (tmp_path / name).read_text()
    assert "NAME" not in text
    line = f"visray: {name}: exists already, and is not replaced; choose another name\n"
    assert said(capsys, *words) == (2, "", line) and (tmp_path / name).read_text() == text


@pytest.mark.parametrize(("words", "right"), [(["a.png"], "a.json"), (["a.json", "--python"], "a.py")])
def test_another_suffix_is_refused(words, right, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, _, err = said(capsys, "new", *words)
    assert code == 2 and err.endswith(f"; write {right}\n") and not list(tmp_path.iterdir())
