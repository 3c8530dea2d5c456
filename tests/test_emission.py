"""Emission: light that surfaces send out themselves, and that lights nothing."""

from dataclasses import replace

import numpy as np
import pytest

import visray as vr
from visray.adaptive.brightness import Brightness, rms
from visray.dark import DarkWarning
from visray.features import features
from visray.setup import prepare
from visray.study.mitsuba.crosscheck import check

EMISSION = (0.25, 1.5, 0.0625)
SINGLE = 4 * float(np.finfo(np.float32).eps)
GLOW = vr.Material(ka=(0.1, 0.2, 0.3), kd=(0.5, 0.25, 0.5), emission=EMISSION)
SCENE = vr.Scene(
    camera=vr.Camera(origin=(0.5, 2, 6), target=(0, 0.5, 0), fov=40.0),
    film=vr.Film(width=24, height=16),
    background=(0.0, 0.0, 0.0),
    ambient=(0.5, 0.5, 0.5),
    materials={"glow": GLOW, "wall": vr.Material(ka=(0.1, 0.1, 0.1), kd=(0.6, 0.5, 0.4))},
    lights={"key": vr.PointLight(position=(2, 5, 4))},
    objects={"floor": vr.Plane(material="wall"), "ball": vr.Sphere(center=(0, 1, 0), material="glow")},
    settings=vr.Settings(spp=2, seed=3),
)


def picture(scene):
    return vr.render(scene, progress=False)["RGB"].astype(float)


def changed(scene, **fields):
    return replace(scene, materials=scene.materials | {"glow": replace(scene.materials["glow"], **fields)})


def test_emission_is_added_to_the_colour_of_the_surface_and_to_nothing_else():
    """The share of each pixel that the ball covers is that of a picture in which only it glows."""
    dark = replace(SCENE, lights={}, ambient=(0.0, 0.0, 0.0))
    share = picture(changed(dark, emission=(1.0, 1.0, 1.0)))
    assert share.max() == 1 and (share == 0).any()
    difference = picture(SCENE) - picture(changed(SCENE, emission=(0.0, 0.0, 0.0)))
    assert np.abs(difference - share * EMISSION).max() <= SINGLE * 2


@pytest.mark.parametrize("fields", [{"shading": "unlit"}, {"kt": (0.5, 0.25, 0.75)}, {"texture": "t"}])
def test_emission_beside_other_fields(fields):
    """Unlit surfaces show kd and emission. Glass shows the share 1 - kt of its own colour. A texture changes none."""
    scene = changed(replace(SCENE, textures={"t": vr.CheckerTexture()}), **fields)
    scene = replace(scene, camera=vr.Camera(origin=(0, 1, 6), target=(0, 1, 0), fov=0.1), objects={
        "ball": SCENE.objects["ball"]}, settings=replace(SCENE.settings, depth=0, local="weighted"))  # fmt: skip
    difference = picture(scene) - picture(changed(scene, emission=(0.0, 0.0, 0.0)))
    # Without depth, nothing is refracted and kt weighs nothing.
    assert np.abs(difference - EMISSION).max() <= SINGLE * 2
    deep = replace(scene, settings=replace(scene.settings, depth=1))
    own = np.multiply(EMISSION, np.subtract(1, fields.get("kt", 0)))
    found = picture(deep) - picture(changed(deep, emission=(0.0, 0.0, 0.0)))
    if "kt" in fields:
        # The ray goes on and meets the inside of the back, which glows too.
        own = own + np.multiply(fields["kt"], own)
    assert np.abs(found - own).max() <= SINGLE * 4


def test_mirrors_and_scattered_rays_see_it():
    """A mirror shows the emission times kr. Of a closed room that glows, a matte surface gets the emission from all
    sides, and adds kd times it."""
    mirror = vr.Material(ka=(0.0,) * 3, kd=(0.0,) * 3, kr=(0.5, 0.5, 0.5))
    matte = vr.Material(ka=(0.0,) * 3, kd=(0.5, 0.25, 0.125))
    room = vr.Sphere(radius=9.0, material="glow")
    base = replace(SCENE, camera=vr.Camera(origin=(0, 0, 5), fov=1.0), lights={}, ambient=(0.0,) * 3)
    for name, material, factor in (("mirror", mirror, 0.5), ("matte", matte, np.array(matte.kd))):
        scene = replace(
            changed(base, kd=(0.0,) * 3, ka=(0.0,) * 3),
            materials={"glow": replace(GLOW, kd=(0.0,) * 3, ka=(0.0,) * 3), name: material},
            objects={"room": room, "ball": vr.Sphere(material=name)},
            settings=vr.Settings(spp=1, scatter=vr.Scatter(rays=4)),
        )
        assert np.abs(picture(scene) - np.multiply(EMISSION, factor)).max() <= SINGLE * 2


def test_a_palette_colour_multiplies_it_if_asked():
    material = replace(GLOW, colored=("kd", "emission")).with_color((0.5, 1.0, 2.0))
    assert material.emission == (0.125, 1.5, 0.125) and material.kd == (0.5, 1.0, 2.0)


@pytest.mark.parametrize("component", range(3))
def test_derivative(component):
    """Of the mean of the picture: the mean share of the pixels that the ball covers, over three channels."""
    share = picture(changed(replace(SCENE, lights={}, ambient=(0.0,) * 3), emission=(1.0, 1.0, 1.0)))
    slope = vr.gradient(SCENE, ["materials.glow.emission"], progress=False)["materials.glow.emission"]
    assert abs(slope[component] - share.mean() / 3) <= SINGLE
    address = f"materials.glow.emission.{component}"
    assert np.abs(vr.derivative(SCENE, address, progress=False) - vr.difference(SCENE, address)).max() <= 1e-9
    black = changed(SCENE, emission=(0.0, 0.0, 0.0))
    assert abs(vr.derivative(black, address, progress=False).mean() - share.mean() / 3) <= SINGLE


def test_the_effect_is_needed_by_emission_alone():
    assert features(SCENE)["emission"] and not features(changed(SCENE, emission=(0.0,) * 3))["emission"]
    assert features(changed(SCENE, emission=(0.0,) * 3), wrt=("materials.glow.emission",))["emission"]


def test_a_picture_that_only_glows_is_not_called_dark(recwarn):
    scene = replace(SCENE, lights={}, ambient=(0.0, 0.0, 0.0))
    picture(scene)
    assert not [w for w in recwarn if issubclass(w.category, DarkWarning)]
    with pytest.warns(DarkWarning):
        picture(changed(scene, emission=(0.0, 0.0, 0.0)))


def test_mitsuba_agrees():
    assert check(SCENE).passed


def test_the_story_of_a_pixel_has_it():
    story = vr.why(SCENE, 12, 6)
    assert story.surfaces[0].object == "objects.ball" and "emission 0.25 1.5 0.0625" in str(story)
    without = vr.why(changed(SCENE, emission=(0.0,) * 3), 12, 6)
    assert np.abs(np.subtract(story.colour, without.colour) - EMISSION).max() <= SINGLE * 2


def test_it_counts_as_brightness():
    bright, plain = (Brightness.of(prepare(s)).objects["glow"] for s in (SCENE, changed(SCENE, emission=(0.0,) * 3)))
    assert abs(bright - plain - rms(EMISSION)) <= 1e-12


@pytest.mark.parametrize("value", [(-0.1, 0.0, 0.0), (1e30, 0.0, 0.0), (float("nan"), 0.0, 0.0), (1.0, 1.0)])
def test_wrong_emission(value):
    with pytest.raises(vr.UserError, match=r"materials.glow.emission"):
        vr.replaced(SCENE, "materials.glow.emission", value)
