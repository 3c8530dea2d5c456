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
    "path", [pytest.param(p, marks=[] if i % 10 == 8 else pytest.mark.slow, id=p.stem) for i, p in enumerate(SCENES)]
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


def test_the_bouncing_balls_are_what_their_script_writes():
    assert script("make_bouncing")["text"]() == (SCENES[0].parent / "bouncing-balls.json").read_text()


@pytest.mark.parametrize("name", script("make_csg")["SCENES"])
def test_the_scenes_of_many_operands_are_what_their_script_writes(name):
    assert script("make_csg")["text"](name) == (SCENES[0].parent / f"csg-{name}.json").read_text()


@pytest.mark.slow
def test_the_lens_shows_the_sun_where_the_formula_of_thin_lenses_puts_it():
    """Turned over and smaller: 1/f = 1/s + 1/s', and the image is s'/s times as large. The formula leaves out the
    thickness of the lens and rays far from its axis, so the centre of the image is within the image of the sun."""
    scene, (width, height) = vr.load(SCENES[0].parent / "csg-lens.json"), (192, 144)
    lens, painting = scene.objects["lens"], scene.objects["painting"]
    centre = np.array(lens.transform[0].translate)
    focal_length = lens.of["front"].radius / (2 * (scene.materials["glass"].ior - 1))
    # Centre and radius of the sun in painting.png, which has 480 x 600 pixels.
    u, v, radius = 314 / 480, 1 - 202 / 600, 80 / 480 * painting.width[0]
    sun = np.add(painting.center, [(u - 0.5) * painting.width[0], (v - 0.5) * painting.height[1], 0])
    distance = centre[2] - sun[2]
    shrinks = 1 / (distance / focal_length - 1)
    image = centre - shrinks * (sun - centre)

    forward = np.subtract(scene.camera.target, scene.camera.origin)
    right = np.cross(forward, scene.camera.up)
    forward, right, up = (a / np.linalg.norm(a) for a in (forward, right, np.cross(right, forward)))
    depth = (image - scene.camera.origin) @ forward
    pixel = 2 * np.tan(np.radians(scene.camera.fov) / 2) / height * depth
    x = 0.5 * (width - 1) + (image - scene.camera.origin) @ right / pixel
    y = 0.5 * (height - 1) - (image - scene.camera.origin) @ up / pixel

    seen = vr.render(scene, size=(width, height), spp=9)
    red, green, _ = np.moveaxis(seen["RGB"], -1, 0)
    rows, columns = np.nonzero((seen["id"] == 1 + list(scene.objects).index("lens")) & (red > 4 * green) & (red > 0.1))
    assert len(rows) > 9 and np.hypot(columns.mean() - x, rows.mean() - y) < radius * shrinks / pixel


@pytest.mark.parametrize("name", PAIRS)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_scene_of_the_original(name):
    if not SEED.exists():
        pytest.skip("the original's files are not at hand")
    scene = vr.load(SEED / f"{name}.json", SEED / f"{PAIRS[name]}.json")
    image = vr.render(small(scene), spp=4)
    assert np.isfinite(image["RGB"]).all()
    assert len(np.unique(image["id"])) > 1
