"""The whole product on one page: a scene in Python, its picture, and the checks that visray offers."""

from fractions import Fraction

import numpy as np
import pytest

import visray as vr
from visray.study.mitsuba import crosscheck

PAINT = vr.Material(ka=(0.2, 0.1, 0.0), kd=(0.5, 0.4, 0.3), ks=(0, 0, 0))
SCENE = vr.Scene(
    camera=vr.Camera(origin=(0, 0, 5), target=(0, 0, 0), fov=30),
    film=vr.Film(width=31, height=21),
    ambient=(1.0, 0.5, 0.25),
    lights={"sun": vr.DirectionalLight(direction=(-3, 0, -4))},
    materials={"paint": PAINT},
    objects={"ball": vr.Sphere(radius=1, material="paint")},
    settings=vr.Settings(spp=4),
)


@pytest.fixture(scope="module")
def image() -> vr.Image:
    return vr.render(SCENE)


def test_the_middle_of_the_ball_has_the_colour_of_the_closed_form(image):
    """Ambient plus kd n.l. The normal at the middle is +z and l is (3, 0, 4)/5, so n.l = 4/5; across a pixel of a ball
    n.l changes by less than the pixel's width over the radius, 0.13."""
    colour = np.array(SCENE.ambient) * PAINT.ka + np.array(PAINT.kd) * 4 / 5
    assert np.allclose(image["RGB"][10, 15], colour, atol=0.13 * max(PAINT.kd))
    assert image["id"][10, 15] == 1 and image["id"][0, 0] == 0 and image["N"][10, 15, 2] == 1


def test_an_exr_file_holds_the_picture(image, tmp_path):
    """Colours are written as halves, which have 11 digits; depths as they are."""
    image.write(tmp_path / "ball.exr")
    again = vr.Image.read(tmp_path / "ball.exr")
    assert np.allclose(again["RGB"], image["RGB"], rtol=2**-11) and np.array_equal(again["Z"], image["Z"])


def test_the_derivative_of_the_picture_is_the_finite_difference():
    """Central differences of a picture that is linear in kd: rounding is all that differs."""
    exact = vr.difference(SCENE, "materials.paint.kd.0")
    assert np.abs(exact).max() > 0.5 and np.allclose(vr.derivative(SCENE, "materials.paint.kd.0"), exact, atol=1e-3)


def test_mitsuba_sees_the_same():
    """Hits, distances, normals and colours of 2,000 rays."""
    assert crosscheck.check(SCENE, rays=2_000).passed


def test_a_polynomial_surface_is_where_exact_arithmetic_says():
    """The middle ray meets x^4 + y^4 + z^4 = 2 at z = 2^(1/4), to the rounding of the single precision of the layer."""
    shape = vr.Polynomial(expression="x^4 + y^4 + z^4 - 2", clip=vr.Ball(radius=2), material="paint")
    z = Fraction(5) - Fraction(float(vr.render(vr.replaced(SCENE, "objects", {"it": shape}))["distance"][10, 15]))
    error = Fraction(5, 2**24)
    assert (z - error) ** 4 < 2 < (z + error) ** 4


def test_only_what_the_scene_calls_for_is_simulated():
    """A matte ball has no highlights; a mirror brings reflections, and nothing else."""
    simulated = vr.explain(SCENE).names()
    assert simulated == ["ambient", "diffuse", "shadows", "background"]
    mirror = vr.replaced(SCENE, "materials.paint.kr", (0.5, 0.5, 0.5))
    assert set(vr.explain(mirror).names()) == {*simulated, "reflection"}


def test_a_picture_is_as_good_as_was_asked_for():
    facts = vr.render(SCENE, error=0.02).metadata
    assert facts["error"] <= 0.02 and facts["spp"] >= 1
