"""The scenes that come with visray, and those of the original program where they are at hand."""

from pathlib import Path

import numpy as np
import pytest

import visray as vr
from visray import primitives
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
    assert shown == set(primitives.KINDS)


@pytest.mark.parametrize("name", PAIRS)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_scene_of_the_original(name):
    if not SEED.exists():
        pytest.skip("the original's files are not at hand")
    scene = vr.load(SEED / f"{name}.json", SEED / f"{PAIRS[name]}.json")
    image = vr.render(small(scene), spp=4)
    assert np.isfinite(image["RGB"]).all()
    assert len(np.unique(image["id"])) > 1
