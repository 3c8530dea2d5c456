"""What is said of fresnel and absorption that change nothing, or all: once each, with what would be right."""

from dataclasses import replace
from typing import Any

import pytest
from test_material_report import scene_of

import visray as vr
from visray.features import features
from visray.glass_report import glass_notes
from visray.material_report import MaterialWarning, energy_notes, sheet_notes

BLACK, WHITE, HALF = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.5, 0.5, 0.5)
CLEAR = vr.Material(kd=BLACK, kr=WHITE, kt=WHITE, fresnel="dielectric")
BALL = vr.Sphere(material="m")
PRISM = vr.Csg(
    op="intersection", of=(vr.Plane(normal=(1.0, 1.0, 0.0)), vr.Plane(normal=(-1.0, 1.0, 0.0))), material="m"
)


def notes(m: vr.Material, **objects: Any) -> list[str]:
    scene = scene_of(objects or {"b": BALL}, m=m)
    return glass_notes(scene, features(scene))


@pytest.mark.parametrize(
    ("material", "objects", "says"),
    [
        (vr.Material(absorption=HALF), {}, "materials.m: absorption changes nothing, as kt is 0: no light passes"),
        (vr.Material(fresnel="dielectric"), {}, 'm: fresnel "dielectric" changes nothing, as kr and kt are 0'),
        (vr.Material(fresnel="metal"), {}, "as kr and kt are 0; write the colour of the metal as kr"),
        (replace(CLEAR, kr=BLACK), {}, "total reflection is black; write the kr [1, 1, 1]"),
        (replace(CLEAR, absorption=HALF), {"d": vr.Disk(material="m"), "b": BALL},
         "objects.d: a disk that is open has no inside, so materials.m.absorption changes nothing"),
        (replace(CLEAR, absorption=HALF), {"p": PRISM}, "objects.p: the object has no end, and light that runs in it"),
        (replace(CLEAR, absorption=(0.5, 1.0, 2.0)), {"b": replace(BALL, radius=500.0)},
         "objects.b: 1e+03 units of materials.m let 7e-218 of the light through at most: it is black; absorption is "
         "per world unit, and 0.001 would leave 37 %"),
    ],
)  # fmt: skip
def test_a_sentence_says_what_does_not_do_what_it_says(material: vr.Material, objects: dict, says: str) -> None:
    (text,) = notes(material, **objects)
    assert says in text


@pytest.mark.parametrize(
    "material",
    [CLEAR, replace(CLEAR, absorption=HALF), replace(CLEAR, kt=BLACK), vr.Material(kr=HALF, fresnel="metal"),
     replace(CLEAR, absorption=(0.0, 1e6, 1e6))],
)  # fmt: skip
def test_nothing_is_said_of_what_is_right(material: vr.Material) -> None:
    assert not notes(material)
    scene = scene_of({"b": BALL}, m=material)
    assert not [x for x in energy_notes(scene) if "kr" in x and not any(material.kd)]


def test_rendering_warns_and_other_shading_does_not() -> None:
    scene = scene_of({"b": BALL}, m=vr.Material(absorption=HALF))
    with pytest.warns(MaterialWarning, match="absorption changes nothing"):
        vr.render(replace(scene, film=vr.Film(width=4, height=4)), progress=False)
    normals = replace(scene, settings=replace(scene.settings, shading="normal"))
    assert not glass_notes(normals, features(normals))


def test_energy_of_fresnel_is_that_of_the_worst_angle() -> None:
    """kr and kt of 1 make no light, however F shares it out; what a coat covers may still be too bright."""
    for m, count in (
        (CLEAR, 0),
        (replace(CLEAR, fresnel="none"), 1),
        (replace(CLEAR, kt=BLACK, kd=(0.9, 0.9, 0.9)), 0),
        (replace(CLEAR, kt=BLACK, kd=(0.9, 0.9, 0.9), ks=(0.7, 0.7, 0.7)), 1),
        (vr.Material(kd=HALF, kr=HALF, fresnel="metal"), 0),
        (vr.Material(kd=(0.6, 0.6, 0.6), kr=HALF, fresnel="metal"), 1),
    ):
        assert len(energy_notes(scene_of({"b": BALL}, m=m))) == count
        full = scene_of({"b": BALL}, m=m)
        full = replace(full, settings=replace(full.settings, local="full"))
        assert len(energy_notes(full)) == (0 if m is CLEAR or (count == 0 and not any(m.kd)) else 1)


def test_a_pane_by_the_angle_is_called_a_thin_pane() -> None:
    scene = scene_of({"d": vr.Disk(material="m")}, m=CLEAR)
    (text,) = sheet_notes(scene, features(scene))
    assert "it is a thin pane" in text and "ior 1 " not in text


def test_a_metal_that_light_passes_through_is_refused() -> None:
    with pytest.raises(vr.UserError, match=r"materials\.m\.kt .*a metal is opaque"):
        vr.render(scene_of({"b": BALL}, m=vr.Material(kr=HALF, kt=HALF, fresnel="metal")), progress=False)
    with pytest.raises(vr.UserError, match="has no derivative as a metal is opaque"):
        vr.gradient(scene_of({"b": BALL}, m=vr.Material(kr=HALF, fresnel="metal")), "materials.m.kt")
