"""The command line: what it writes, what it prints, and the one line that bad input gets."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from PIL import Image as Pillow

import visray as vr
from visray.cli import main, rendering
from visray.modes import MODES
from visray.output.layers import LAYERS
from visray.quantities import BACKENDS

SCENES = Path(__file__).resolve().parents[1] / "scenes"
SPHERE = str(SCENES / "sphere.json")
SMALL = ["--size", "48x32", "--spp", "4"]


def said(capsys, *tokens):
    """Exit code, standard output and standard error of a command."""
    code = main(list(tokens))
    out, err = capsys.readouterr()
    return code, out, err


def test_render_writes_exr_and_png(tmp_path, capsys):
    exr, png = tmp_path / "a.exr", tmp_path / "a.png"
    code, out, err = said(capsys, "render", SPHERE, "-o", str(exr), "-o", str(png), *SMALL, "--seed", "3")
    assert (code, err) == (0, "")
    assert f"{exr}, {png}: 48 x 32 pixels in " in out and out.endswith(" %, 4 samples per pixel\n")
    image = vr.Image.read(exr)
    direct = vr.render(SPHERE, size=(48, 32), spp=4, seed=3)
    # Half keeps eleven binary digits.
    np.testing.assert_allclose(image["RGB"], direct["RGB"], rtol=2.0**-11)
    for name in ("Z", "N", "P", "UV", "id", "variance"):
        np.testing.assert_array_equal(image[name], direct[name].astype(image[name].dtype))
    assert image.metadata["seed"] == 3 and image.metadata["scene_hash"] == direct.metadata["scene_hash"]
    assert Pillow.open(png).size == (48, 32)


def test_render_without_output_names_the_picture_after_the_scene(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert said(capsys, "render", SPHERE, *SMALL, "--quiet") == (0, "", "")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["sphere.exr", "sphere.png"]


def test_render_json_and_set(tmp_path, capsys):
    out = str(tmp_path / "a.exr")
    code, text, _ = said(
        capsys, "render", SPHERE, "-o", out, *SMALL, "--json", "--precision", "double", "--threads", "1",
        "--set", "objects.large.radius=0.5", "--set", "lights.key.Id=[0,0,0]", "--layers", "z,id",
    )  # fmt: skip
    report = json.loads(text)
    assert code == 0 and report["precision"] == "double" and report["spp"] == 4 and report["threads"] == 1
    assert report["layers"] == ["RGB", "A", "Z", "id"] and not report["stopped"]
    scene = vr.replaced(vr.load(SPHERE), "objects.large.radius", 0.5)
    same = vr.replaced(scene, "lights.key.Id", (0.0, 0.0, 0.0))
    np.testing.assert_array_equal(
        vr.Image.read(out)["id"], vr.render(same, size=(48, 32), spp=1, precision="double")["id"]
    )


def test_layers_without_an_exr_file_are_noted(tmp_path, capsys):
    out = str(tmp_path / "a.png")
    code, _, errors = said(capsys, "render", SPHERE, "-o", out, *SMALL, "--layers", "N,Z")
    assert code == 0 and "--layers: only an EXR file has layers, and none is written" in errors
    assert "--layers" not in said(capsys, "render", SPHERE, "-o", out, *SMALL, "--layers", "RGB")[2]


def test_gamma_and_exposure(tmp_path, capsys):
    paths = [str(tmp_path / f"{i}.png") for i in range(3)]
    for path, extra in zip(paths, ([], ["--gamma", "2"], ["--exposure", "-1"])):
        assert said(capsys, "render", SPHERE, "-o", path, *SMALL, *extra)[0] == 0
    linear = vr.render(SPHERE, size=(48, 32), spp=4)["RGB"].astype(float)
    expected = np.floor(255 * np.sqrt(np.clip(linear, 0, 1)) + 0.5)
    np.testing.assert_array_equal(np.array(Pillow.open(paths[1])), expected)
    assert np.array(Pillow.open(paths[2])).mean() < np.array(Pillow.open(paths[0])).mean()


def test_explain(capsys):
    code, out, _ = said(capsys, "explain", SPHERE)
    assert code == 0 and "attenuation" in out and "no light has a, b or c" in out
    code, out, _ = said(capsys, "explain", SPHERE, "--json", "--set", "settings.shadows=false")
    listed = {f["name"]: f for f in json.loads(out)["features"]}
    assert not listed["shadows"]["on"] and listed["shadows"]["reason"] == "settings.shadows is false"


def test_explain_lists_which_of_two_solids_counts(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    code, out, _ = said(capsys, "explain", str(SCENES / "everything.json"))
    rows = [[cell.strip() for cell in re.split("[┃│]", line)[1:-1]] for line in out.splitlines()]
    start = rows.index(["where both overlap, this counts", "not this", "why"])
    assert code == 0 and rows[start + 2] == ["objects.wine", "objects.tumbler", "volume 0.0746 is smaller than 0.1832"]


def test_check(tmp_path, capsys):
    out = tmp_path / "difference.exr"
    small = ["--set", "film.width=64", "--set", "film.height=40", "--rays", "2000"]
    code, text, _ = said(capsys, "check", SPHERE, *small, "-o", str(out), "--json")
    assert code == 0 and json.loads(text)["passed"]
    assert np.abs(vr.Image.read(out)["RGB"]).max() < 0.5


def test_schema_and_import(tmp_path, capsys):
    code, text, _ = said(capsys, "schema")
    assert code == 0 and json.loads(text) == json.loads((SCENES / "schema.json").read_text())
    seed = {"scene": "s", "typeScene": "VIRTUAL", "objects": [{"name": "b", "type": "sphere", "radius": 2}]}
    (tmp_path / "seed.json").write_text(json.dumps(seed))
    out = tmp_path / "native.json"
    assert said(capsys, "import", str(tmp_path / "seed.json"), "-o", str(out))[0] == 0
    assert vr.load(out).objects["b"] == vr.load(tmp_path / "seed.json").objects["b"]
    assert vr.load(out).objects["b"].radius == 2


def test_help_names_layers_and_modes(capsys):
    """The help of render has a line for each layer and each shading mode."""
    code, text, _ = said(capsys, "render", "--help")
    assert code == 0
    for record in (*LAYERS, *MODES):
        assert f"{record.name}: " in text


def test_doctor(capsys):
    code, text, _ = said(capsys, "doctor", "--json")
    assert code == 0 and json.loads(text)["verdict"] == "ready"
    assert "verdict" in said(capsys, "doctor")[1]


BAD = {
    "missing file": (["render", "nowhere.json"], "nowhere.json"),
    "folder": (["render", "."], "folder"),
    "wrong suffix": (["render", SPHERE, "-o", "a.jpg"], ".exr or .png"),
    "no such folder": (["render", SPHERE, "-o", "nowhere/a.exr"], "does not exist"),
    "zero size": (["render", SPHERE, "--size", "0x4"], "--size"),
    "negative size": (["render", SPHERE, "--size", "-3x4"], "size"),
    "zero spp": (["render", SPHERE, "--spp", "0"], "settings.spp"),
    "negative seed": (["render", SPHERE, "--seed", "-1"], "settings.seed"),
    "word for a number": (["render", SPHERE, "--spp", "many"], "many"),
    "zero threads": (["render", SPHERE, "--threads", "0"], "threads"),
    "no such precision": (["render", SPHERE, "--precision", "half"], "half"),
    "no such layer": (["render", SPHERE, "--layers", "depth"], "Z"),
    "no such gamma": (["render", SPHERE, "--gamma", "rec"], "gamma"),
    "negative gamma": (["render", SPHERE, "--gamma", "-2"], "gamma"),
    "no device": (["render", SPHERE, "--backend", "metal"], "metal"),
    "negative radius": (["render", SPHERE, "--set", "objects.large.radius=-1"], "objects.large.radius = -1"),
    "nan": (["render", SPHERE, "--set", "objects.large.radius=NaN"], "objects.large.radius"),
    "unknown address": (["render", SPHERE, "--set", "objects.lrge.radius=1"], '"large"'),
    "no assignment": (["render", SPHERE, "--set", "objects.large.radius"], "="),
    "unknown material": (["render", SPHERE, "--set", "objects.large.material=clya"], "clay"),
    "eye at target": (["render", SPHERE, "--set", "camera.target=[0,2.2,7]"], "camera"),
    "up along view": (["render", SPHERE, "--set", "camera.up=[0,-1.4,-7]"], "camera.up"),
    "huge film": (["render", SPHERE, "--size", "900000x900000"], "GiB"),
    "unknown command": (["rendr"], "render"),
    "unknown option": (["render", SPHERE, "--sice", "3"], "--size"),
    "check without scene": (["check"], "scene"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_gets_one_line(name, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tokens, hint = BAD[name]
    code, out, err = said(capsys, *tokens)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1 and hint.lower() in err.lower() and "Traceback" not in err
    assert not list(tmp_path.iterdir())


def test_all_errors_of_a_file_at_once(tmp_path, capsys):
    broken = tmp_path / "broken.json"
    broken.write_text('{"objects": {"a": {"type": "sphere", "radius": -1}, "b": {"type": "sphre"}}, "camra": {}}')
    code, _, err = said(capsys, "render", str(broken), "-o", str(tmp_path / "a.exr"))
    assert code == 2 and err.count("\n") == 3
    for part in ("objects.a.radius = -1", '"sphere"', "camera"):
        assert part in err
    broken.write_text('{"objects": \n  {"a" {}}}')
    assert "line 2, column 8" in said(capsys, "explain", str(broken))[2]


# The command line, which says when it has made a pass.
TELLING = """
import sys
import visray.passes as passes
from visray.cli import main

whole = passes.exposed_once

def telling(*given):
    film = whole(*given)
    print("a pass", flush=True)
    return film

passes.exposed_once = telling
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_ctrl_c_and_sigterm_keep_the_partial_picture(tmp_path, number, code):
    """A long render is interrupted as a terminal does it; the file holds the passes that were done."""
    out = tmp_path / "partial.exr"
    tokens = ["render", str(SCENES / "showcase.json"), "-o", str(out), "--spp", "100000"]
    process = subprocess.Popen(
        [sys.executable, "-c", TELLING, *tokens], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "a pass\n"
    os.kill(process.pid, number)
    text, err = process.communicate(timeout=120)
    assert process.returncode == code, err
    assert os.listdir(tmp_path) == ["partial.exr"]
    assert "stopped" in text
    image = vr.Image.read(out)
    assert 0 < image.metadata["spp"] < image.metadata["spp_asked"] == 100000
    assert np.isfinite(image["RGB"]).all() and image["RGB"].mean() > 0.1


def test_a_word_of_the_command_line_is_no_json(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("[a].exr", '["b"].exr', "{c}.exr"):
        assert main(["render", str(SCENES / "sphere.json"), "-o", name, "--size", "4x3", "--spp", "1", "--quiet"]) == 0
    assert sorted(os.listdir()) == sorted(["[a].exr", '["b"].exr', "{c}.exr"])


# The command line, which then says what was imported.
IMPORTED = """
import sys
from visray.cli import main
code = main(sys.argv[1:])
print(*sys.modules, file=sys.stderr)
sys.exit(code)
"""


def imported(*tokens):
    """Exit code of a command, and the modules that were imported for it."""
    done = subprocess.run([sys.executable, "-c", IMPORTED, *tokens], capture_output=True, text=True, cwd=SCENES)
    return done.returncode, set(done.stderr.splitlines()[-1].split())


@pytest.mark.parametrize(
    "tokens", [["--version"], ["--help"], ["render", "--help"], ["render", "nowhere.json"], ["rendr"]]
)
def test_what_needs_no_scene_imports_no_libraries(tokens):
    code, modules = imported(*tokens)
    assert code == (0 if tokens[-1].startswith("--") else 2)
    assert modules & {"numpy", "pydantic", "drjit._drjit_ext", "visray.llvm", "visray.scene.scene"} == set()


@pytest.mark.parametrize(
    "text", ['{"objects": {', '{"objects": {"a": {"type": "sphere", "radius": -1}}}', '{"camra": {}}']
)
def test_a_wrong_scene_is_refused_before_drjit_is_loaded(text, tmp_path):
    path = tmp_path / "wrong.json"
    path.write_text(text)
    for command in ("render", "explain", "check", "cost", "tune", "import"):
        code, modules = imported(command, str(path))
        assert code == 2 and "drjit._drjit_ext" not in modules, command
    assert imported("explain", "sphere.json", "--set", "objects.large.radius=-1")[0] == 2


def test_backends_of_the_option_are_those_of_the_arrays():
    assert get_args(get_args(rendering.render_command.__annotations__["backend"])[0]) == tuple(BACKENDS)


def test_one_surface_and_a_similar_name(capsys):
    code, out, _ = said(capsys, "surfaces", "heart")
    assert code == 0 and "heart" in out and "x^2" in out and "barth" not in out
    assert list(json.loads(said(capsys, "surfaces", "heart", "--json")[1])) == ["heart"]
    code, _, err = said(capsys, "surfaces", "togliati")
    assert code == 2 and 'did you mean "togliatti"?' in err


def test_an_error_may_be_a_percentage(capsys, tmp_path):
    out = str(tmp_path / "a.exr")
    code, text, _ = said(capsys, "render", SPHERE, *SMALL[:2], "-o", out, "--error", "20%", "--json")
    assert code == 0 and json.loads(text)["error_asked"] == 0.2
    assert said(capsys, "render", SPHERE, "--error", "1 percent")[0] == 2
