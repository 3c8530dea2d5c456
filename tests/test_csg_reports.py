"""Studies and reports of scenes with CSG: the check beside Mitsuba, what accuracy costs, and pictures to an error."""

from dataclasses import replace

import numpy as np
import pytest

import visray as vr
from visray.adaptive.small_objects import small_objects
from visray.setup import prepare
from visray.study.ablation import cost as cost_of_effects
from visray.study.cost.choices import TOLERANCES, varied_settings
from visray.study.cost.hits import geometry
from visray.study.mitsuba.crosscheck import check
from visray.study.mitsuba.report import MOST_LEFT_OUT
from visray.tables import show

HEART = vr.Polynomial(surface="heart", ends="capped", transform=(vr.Rotate(rotate=-90, axis=(1, 0, 0)),))
QUARTER = vr.Box(min=(0, 0, 0), max=(2, 2, 2), material="inner")
CUT = vr.Csg(op="difference", of={"heart": HEART, "quarter": QUARTER}, material="red")
FRAME = vr.Csg(
    op="difference",
    of={
        "block": vr.Box(min=(-1, -1, -0.1), max=(1, 1, 0.1)),
        "window": vr.Box(min=(-0.5, -0.4, -1), max=(0.5, 0.4, 1)),
    },
)
SCENE = vr.Scene(
    camera=vr.Camera(origin=(2.5, 2.0, 3.5), fov=40),
    film=vr.Film(width=64, height=48),
    materials={"red": vr.Material(kd=(0.8, 0.1, 0.1), ks=(0.3, 0.3, 0.3)), "inner": vr.Material(kd=(0.2, 0.3, 0.8))},
    lights={"key": vr.PointLight(position=(4, 5, 3))},
    objects={"c": CUT, "floor": vr.Plane(point=(0, -1.2, 0)), "ball": vr.Sphere(center=(1.5, -0.8, -0.5), radius=0.4)},
)


def test_the_check_beside_mitsuba_leaves_csg_out_and_compares_the_rest() -> None:
    report = check(SCENE, rays=5_000)
    assert report.left_out == {"c": "Mitsuba has no CSG"} and report.passed
    assert report.pixels.hits > 1000 and report.shadows.rays > 500
    # Without the CSG, more of the floor and of the ball is lit.
    alone = check(replace(SCENE, objects={n: x for n, x in SCENE.objects.items() if n != "c"}), rays=5_000)
    assert alone.pixels == report.pixels and alone.shadows == report.shadows and not alone.left_out


def test_of_many_objects_that_are_left_out_the_table_shows_some(capsys: pytest.CaptureFixture) -> None:
    many = {f"c{i}": replace(FRAME, transform=(vr.Translate(translate=(0, 0, -i)),)) for i in range(MOST_LEFT_OUT + 3)}
    report = check(replace(SCENE, objects=many | {"floor": SCENE.objects["floor"]}), rays=1_000)
    show(report.table())
    shown = [line.split() for line in capsys.readouterr().out.splitlines() if "left out" in line]
    assert len(report.left_out) == MOST_LEFT_OUT + 3 and len(shown) == MOST_LEFT_OUT + 1
    assert shown[0] == ["left", "out:", "c0", "Mitsuba", "has", "no", "CSG"]
    assert shown[-1] == ["left", "out:", "3", "more", "Mitsuba", "has", "no", "CSG", "(--json", "has", "all)"]


def test_varied_settings_of_a_scene_know_its_operands() -> None:
    (roots,) = [s for s in varied_settings(SCENE) if s.name == "roots"]
    settings = [choice.settings for choice in roots.all]
    assert settings == [{"objects.c.of.heart.tolerance": x} for x in TOLERANCES[1]]


def test_first_hits_of_csg_are_those_of_double_in_single_too() -> None:
    """And a looser operand moves hits, but no ray is lost."""

    def made(precision: str, tolerance: float = 0.0) -> vr.Prepared:
        scene = vr.replaced(SCENE, "objects.c.of.heart.tolerance", tolerance)
        return prepare(replace(scene, settings=vr.Settings(precision=precision)))

    truth = made("double")
    found = geometry(made("single"), truth)
    assert (found.lost, found.added, found.other, found.ulps, found.self_shadows) == (0, 0, 0, 0, 0)
    assert found.leaving > 2000
    loose = geometry(made("double", 1e-3), truth)
    assert loose.ulps > 1000 and loose.lost + loose.added + loose.other < 0.01 * loose.rays


@pytest.mark.slow
def test_the_cost_of_each_effect_is_measured_with_csg() -> None:
    costs = cost_of_effects(replace(SCENE, film=vr.Film(width=24, height=18)), spp=1, progress=False).costs
    assert {"diffuse", "specular", "shadows", "ambient", "background"} <= set(costs)
    # A shadow ray walks through the object; ambient light adds few operations.
    assert costs["shadows"].operations > 10 * costs["ambient"].operations > 0


@pytest.mark.slow
def test_an_effect_that_the_scene_does_not_need_changes_no_bit() -> None:
    scene = replace(SCENE, film=vr.Film(width=24, height=18), settings=vr.Settings(spp=1))
    mine, everything = (vr.render(prepare(scene, everything=x), progress=False) for x in (False, True))
    assert np.array_equal(mine["RGB"], everything["RGB"])


SPARK = {
    "hot": vr.Material(kd=(50.0, 50.0, 50.0), shading="unlit"),
    "grey": vr.Material(kd=(0.2,) * 3, shading="unlit"),
}
WIDTH = 16


def spark(size: float) -> vr.Scene:
    """A frame, seen from the front, of so many pixels in width, before a wall; a pixel is one unit wide."""
    place = (vr.Scale(scale=0.5 * size), vr.Translate(translate=(2.37, 1.41, 0)))
    return vr.Scene(
        camera=vr.OrthographicCamera(origin=(0, 0, 9), height=float(WIDTH)),
        film=vr.Film(width=WIDTH, height=WIDTH),
        materials=SPARK,
        objects={
            "wall": vr.Plane(point=(0, 0, -2), normal=(0, 0, 1), material="grey"),
            "frame": replace(FRAME, material="hot", transform=place),
        },
        settings=vr.Settings(sampler="sobol"),
        lights={},
    )


def brightness(size: float) -> float:
    """Sum of all pixels: the share of the frame is 1 - 0.5 * 0.4 of its square."""
    return 0.2 * WIDTH**2 + 49.8 * 0.8 * size**2


@pytest.mark.parametrize("size", [0.1, 0.4])
def test_csg_that_is_smaller_than_a_pixel_is_in_a_picture_to_an_error(size: float) -> None:
    image = vr.render(spark(size), error=0.02, progress=False)
    assert image.metadata["small_object_pixels"] == 1
    found, true = image["RGB"].astype(float).mean(-1).sum(), brightness(size)
    # Of the error that was asked for, in units of the mean, five standard deviations of the sum of the pixels.
    assert abs(found - true) < 5 * image.metadata["error_high"] * true / WIDTH


def test_cells_contain_small_csg() -> None:
    size = 0.3
    cells = small_objects(prepare(spark(size)))
    (pixel,) = cells.pixels
    left, top = WIDTH / 2 + 2.37 - size / 2, WIDTH / 2 - 1.41 - size / 2
    assert pixel == int(top) * WIDTH + int(left) and not len(cells.missed)
    low, high = np.array([left % 1, top % 1]), np.array([left % 1, top % 1]) + size
    corners, sides = cells.windows[:, :2], cells.windows[:, 2:]
    (inner,) = np.flatnonzero(((corners <= low) & (corners + sides >= high)).all(1))
    assert cells.areas[inner] < 1.01 * size**2 and cells.areas.sum() == pytest.approx(1)
