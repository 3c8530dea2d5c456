"""The scenes that come with visray, and those of the original program where they are at hand."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

import visray as vr
from visray import primitives
from visray.meshes.reading import read
from visray.study.mitsuba import crosscheck

SCENES = sorted(p for p in (Path(__file__).resolve().parents[1] / "scenes").glob("*.json") if p.name != "schema.json")
SEED = Path(__file__).resolve().parents[2] / "shared" / "seed-scenes"
PAIRS = {
    "twoSpheres": "setupRenderTwoSpheres",
    "oneBox": "setupRenderOneBox",
    "oneCylinder": "setupRenderOneCylinder",
    "ambientOcclusion": "setupAmbientOcclusion",
    "penombres": "setupPenombres",
    "cornell_box_geometry": "cornell_box_config_vis",
    "tests": "setupPoly",
    "teapot": "setupRenderTeapot",
}


def small(scene):
    """The scene at about 96 pixels across."""
    height = max(1, round(96 * scene.film.height / scene.film.width))
    return vr.replaced(vr.replaced(scene, "film.width", 96), "film.height", height)


@pytest.mark.parametrize(
    "path", [pytest.param(p, marks=[] if i % 10 == 9 else pytest.mark.slow, id=p.stem) for i, p in enumerate(SCENES)]
)
def test_scene_renders_and_agrees_with_mitsuba(path):
    scene = small(vr.load(path))
    image = vr.render(scene, spp=4)
    assert np.isfinite(image["RGB"]).all() and 0.02 < image["RGB"].mean() < 1.5
    assert len(np.unique(image["id"])) > 1
    report = crosscheck.check(scene, rays=20_000)
    assert report.passed, report.as_json()


def test_there_is_a_scene_for_every_kind():
    shown = {type(o) for p in SCENES for o in vr.load(p).objects.values()}
    assert shown == set(primitives.OBJECTS)


def script(name: str) -> dict:
    """The names that a script of scenes/ defines."""
    return runpy.run_path(str(SCENES[0].parent / f"{name}.py"))


@pytest.mark.parametrize("file", sorted(p.name for p in (SCENES[0].parent / "meshes").iterdir()))
def test_mesh_files_are_what_their_script_writes(file, tmp_path, monkeypatch):
    """To within the rounding of the file: other processors may round other last digits."""
    made = script("make_meshes")
    monkeypatch.setattr("sys.argv", ["make_meshes", file.split(".")[0], "-o", str(tmp_path)])
    made["main"]()
    ours, theirs = (read(str(folder / file)) for folder in (tmp_path, SCENES[0].parent / "meshes"))
    assert np.array_equal(ours.faces, theirs.faces) and ours.parts == theirs.parts
    assert np.allclose(ours.vertices, theirs.vertices, rtol=0, atol=2e-4) and ours.notes == ()
    assert (SCENES[0].parent / "meshes" / file).stat().st_size < 300_000


def test_the_parts_of_the_teapot_and_the_knot_are_closed():
    meshes = SCENES[0].parent / "meshes"
    parts = [(meshes / "teapot.obj", name) for name in ("body", "lid", "spout", "handle")]
    for file, name in (*parts, (meshes / "knot.ply", None)):
        shape = vr.Mesh(file=str(file), part=name).shape_of_file()
        assert shape.topology.closed and shape.topology.volume > 0 and shape.turned == 0, name


def test_no_ball_in_the_bowl_overlaps_another_or_the_bowl():
    made, scene = script("make_bowl"), vr.load(SCENES[0].parent / "bowl.json")
    balls = [o for o in scene.objects.values() if isinstance(o, vr.Sphere)]
    p, r = (np.array([getattr(ball, field) for ball in balls]) for field in ("center", "radius"))
    assert len(balls) == 10_000
    assert len(made["overlaps"](p, r, made["near_pairs"](p))[0]) == 0
    assert (np.linalg.norm(p, axis=1) + r).max() < 1 and p[:, 1].max() < 0.02
    first = [([0.1, -0.2, 0.3], 0.03, "red")]
    assert set(json.loads(made["text"](first))["objects"]) == {"table", "bowl", "ball 0"}


def test_the_field_is_what_its_script_writes():
    made = script("make_field")
    assert json.loads(made["text"](made["plants"]())) == json.loads((SCENES[0].parent / "field.json").read_text())


@pytest.mark.parametrize("name", PAIRS)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_scene_of_the_original(name):
    if not SEED.exists():
        pytest.skip("the original's files are not at hand")
    scene = vr.load(SEED / f"{name}.json", SEED / f"{PAIRS[name]}.json")
    image = vr.render(small(scene), spp=4)
    assert np.isfinite(image["RGB"]).all()
    assert len(np.unique(image["id"])) > 1
