"""The story of a pixel: its numbers, its sum against the renderer, and how it is asked for."""

import json
import random
from dataclasses import replace
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from light_samples import LIGHT_SAMPLES
from samples import SAMPLES
from test_cli import said
from test_features import CASES, FULL, SCENES, folder  # noqa: F401 - the folder with a texture

import visray as vr
from visray import integrator, modes
from visray.camera import OrthographicCamera
from visray.errors import UserError
from visray.geometry import gamma
from visray.lights import KINDS as LIGHTS
from visray.lights import DirectionalLight, PointLight, RectangleLight, SpotLight
from visray.materials import Material
from visray.primitives import KINDS, Box, Csg, Instance, Plane, Rectangle, Sphere
from visray.scene.load import load
from visray.scene.scene import Film, Scene, Settings
from visray.setup import Prepared, prepare
from visray.study.pixel.story import PixelStory
from visray.study.pixel.why import sample_of, why
from visray.transforms import Translate

BLACK = (0.0, 0.0, 0.0)


def rendered(prepared: Prepared, x: int, y: int) -> np.ndarray:
    """The colour of the same sample in a kernel of the renderer."""
    return np.array(integrator.radiance(prepared.kernel, *sample_of(prepared, x, y, 2))[0])[:, 0]


def check(scene: Scene, pixels: list[tuple[int, int]]) -> list[PixelStory]:
    """The stories of some pixels. Their sums are the renderer's colours.

    Error: both add up the same positive terms in another order.
    """
    prepared, stories = prepare(scene), []
    terms = sum(getattr(light, "samples", 1) for light in scene.lights.values()) + scene.settings.scatter.rays
    for x, y in pixels:
        stories.append(why(prepared, x, y))
        expected = rendered(prepared, x, y)
        assert np.isfinite(expected).all()
        error = np.abs(expected - stories[-1].colour)
        assert (error <= gamma(32 * (8 + terms), "single") * np.abs(expected)).all(), (x, y, expected, stories[-1])
        json.dumps(stories[-1].as_json(), allow_nan=False)
        assert str(stories[-1]).startswith(f"pixel {x}, {y}: ")
    return stories


def some_pixels(scene: Scene, count: int, seed: int = 0) -> list[tuple[int, int]]:
    rng = random.Random(seed)
    return [(rng.randrange(scene.film.width), rng.randrange(scene.film.height)) for _ in range(count)]


@pytest.mark.parametrize(
    "path", [pytest.param(p, marks=[] if p.stem == "two-spheres" else pytest.mark.slow, id=p.stem) for p in SCENES]
)
def test_the_sum_is_the_pixel_of_every_scene(path: Path) -> None:
    scene = load(path)
    scene = replace(scene, film=replace(scene.film, width=48, height=32))
    check(scene, [(24, 16), *some_pixels(scene, 4)])


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_sum_is_the_pixel_with_every_effect(case: str) -> None:
    scene = CASES[case][0](FULL)
    check(scene, [(12, 9), *some_pixels(scene, 2)])


@pytest.mark.slow
@pytest.mark.parametrize("kind", LIGHTS, ids=lambda k: k.__name__)
def test_the_sum_is_the_pixel_with_every_kind_of_light(kind: type) -> None:
    scene = replace(FULL, lights={"a": LIGHT_SAMPLES[kind.__name__].posed})
    for story in check(scene, some_pixels(scene, 6)):
        for surface in story.surfaces:
            assert {light.type for light in surface.lights} <= {kind.type}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS, ids=lambda k: k.__name__)
def test_the_sum_is_the_pixel_with_every_kind_of_object(kind: type) -> None:
    """Of glass that is also a mirror, above a floor, so that it is in the way of light too."""
    glass = Material(kr=(0.2, 0.3, 0.1), kt=(0.6, 0.5, 0.7), ior=1.3)
    posed = replace(SAMPLES[kind.__name__].posed, material="glass")
    scene = replace(FULL, materials=FULL.materials | {"glass": glass}, objects={
        "it": posed, "floor": Plane(point=(0, -1, 0), material="wall")
    })  # fmt: skip
    stories = check(scene, [(12, 8), *some_pixels(scene, 6)])
    assert any(surface.object == "objects.it" for story in stories for surface in story.surfaces)


# A floor seen straight from above, at the origin.
FLOOR = Scene(
    camera=vr.Camera(origin=(0, 3, 0), target=(0, 0, 0), up=(0, 0, -1), fov=1.0),
    film=Film(width=3, height=3),
    ambient=(0.5, 0.25, 1.0),
    background=BLACK,
    materials={"m": Material(ka=(0.1, 0.2, 0.3), kd=(0.5, 0.6, 0.7))},
    objects={"floor": Plane(material="m")},
    settings=Settings(precision="double", spp=1),
    lights={},
)


def lit(**lights: Any) -> Scene:
    return replace(FLOOR, lights=lights)


def test_numbers_of_a_point_light() -> None:
    (story,) = check(
        lit(lamp=PointLight(position=(3, 4, 0), intensity=2.0, Id=(1, 0.5, 0.25), a=1.0, c=0.04)), [(1, 1)]
    )
    (surface,) = story.surfaces
    assert (surface.way, surface.object, surface.inside, surface.share) == ("camera", "objects.floor", False, (1, 1, 1))
    assert surface.distance == 3 and surface.point == (0, 0, 0) and surface.normal == (0, 1, 0)
    assert surface.material["address"] == "materials.m" and surface.material["texture"] is None
    np.testing.assert_allclose(surface.ambient, (0.05, 0.05, 0.3))
    (light,) = surface.lights
    assert (light.light, light.type, light.samples, light.falloff, light.in_way) == (
        "lights.lamp",
        "point",
        1,
        None,
        {},
    )
    # Distance 5, cosine 4/5, attenuation 1 / (1 + 0.04 25) = 1/2.
    np.testing.assert_allclose((light.distance, light.cosine, light.attenuation), (5, 0.8, 0.5), rtol=1e-12)
    np.testing.assert_allclose(light.arrives, (1, 0.5, 0.25), rtol=1e-12)
    np.testing.assert_allclose(light.diffuse, (0.4, 0.24, 0.14), rtol=1e-12)
    np.testing.assert_allclose(story.colour, (0.45, 0.29, 0.44), rtol=1e-12)


def test_numbers_of_other_lights() -> None:
    scene = lit(
        sun=DirectionalLight(direction=(0, -1, -1), a=4.0),
        under=PointLight(position=(0, -2, 0)),
        spot=SpotLight(position=(0, 2, 0), direction=(0, -1, 0), angle=60, exponent=2.0),
        away=SpotLight(position=(0, 2, 0), direction=(0, 1, 0)),
    )
    (story,) = check(scene, [(1, 1)])
    sun, under, spot, away = story.surfaces[0].lights
    assert sun.distance is None and sun.attenuation == 0.25
    np.testing.assert_allclose(sun.cosine, 1 / sqrt(2), rtol=1e-12)
    assert under.cosine == -1 and under.diffuse == BLACK and "behind the surface" in under.text()
    assert spot.falloff == 1 and spot.diffuse == pytest.approx((0.5, 0.6, 0.7))
    assert away.falloff == 0 and away.diffuse == BLACK and "outside its cone" in away.text()


def test_what_is_in_the_way() -> None:
    """An opaque ball; glass before it, which lets its kt through; a wall that hides half of a panel."""
    lamp = lit(lamp=PointLight(position=(0, 10, 4)))
    stone = {"stone": Sphere(center=(0, 5, 2), radius=0.5)}
    scene = replace(lamp, materials=FLOOR.materials | {"glass": Material(kt=(0.5, 0.25, 1.0))})
    # Beside the camera's way.
    pane = {"pane": Rectangle(center=(0, 2, 1.05), width=(2, 0, 0), height=(0, 0, 1.5), material="glass")}
    (light,) = check(replace(scene, objects=FLOOR.objects | stone), [(1, 1)])[0].surfaces[0].lights
    assert light.in_way == {"objects.stone": 1.0} and light.arrives == BLACK and light.transmittance == BLACK
    assert "objects.stone is in the way" in light.text()
    (light,) = check(replace(scene, objects=FLOOR.objects | pane), [(1, 1)])[0].surfaces[0].lights
    assert light.in_way == {"objects.pane": 1.0} and light.transmittance == (0.5, 0.25, 1.0)
    (light,) = check(replace(scene, objects=FLOOR.objects | stone | pane), [(1, 1)])[0].surfaces[0].lights
    assert light.in_way == {"objects.pane": 1.0, "objects.stone": 1.0} and light.transmittance == BLACK
    panel = RectangleLight(position=(0, 10, 0), width=(2, 0, 0), height=(0, 0, 2), samples=64)
    wall = Rectangle(center=(2.5, 5, 0), width=(5, 0, 0), height=(0, 0, 10))
    (light,) = check(replace(lit(panel=panel), objects=FLOOR.objects | {"wall": wall}), [(1, 1)])[0].surfaces[0].lights
    # The samples are stratified, in columns of which one half is hidden.
    assert light.samples == 64 and light.in_way == {"objects.wall": 0.5}
    assert "objects.wall is in the way of 32 of 64 samples" in light.text()


def test_a_material_that_reflects_no_light_is_named_as_the_reason() -> None:
    """A mirror: no light is seen on it, wherever the light is. Where only ks is 0, light is seen."""
    mirror = {"m": Material(kd=BLACK, kr=(0.5, 0.5, 0.5)), "other": Material()}
    objects = FLOOR.objects | {"b": Sphere(center=(9, 0, 0), material="other")}
    scene = replace(lit(lamp=PointLight(position=(0, 10, 4))), materials=mirror, objects=objects)
    reason = "nothing of it is seen, as the material's kd and ks are 0"
    (story,) = check(scene, [(1, 1)])
    (light,) = story.surfaces[0].lights
    assert light.diffuse == light.specular == BLACK and light.cosine > 0.9 and not light.in_way
    assert sum(line.endswith(reason) for line in story.lines()) == 1
    (story,) = check(replace(scene, materials=mirror | {"m": Material(kd=(0.0, 0.1, 0.0))}), [(1, 1)])
    assert "nothing of it is seen" not in str(story)
    below = replace(scene, lights={"lamp": PointLight(position=(0, -10, 4))}, materials=FLOOR.materials | mirror)
    assert reason in str(check(below, [(1, 1)])[0])
    below = replace(below, materials=mirror | FLOOR.materials)
    assert str(check(below, [(1, 1)])[0]).count("behind the surface; nothing of it is seen\n") == 1


def test_a_mirror_in_a_mirror() -> None:
    """Reflections down to the depth, with the products of kr as weights; nothing comes after."""
    kr = (0.5, 0.8, 1.0)
    scene = replace(
        lit(lamp=PointLight(position=(0, 1, 0.5))),
        materials={"m": Material(kr=kr, kd=(0.1, 0.1, 0.1))},
        objects=FLOOR.objects | {"top": Plane(point=(0, 4, 0), normal=(0, -1, 0), material="m")},
        settings=replace(FLOOR.settings, depth=3),
    )
    (story,) = check(scene, [(1, 1)])
    assert [s.object for s in story.surfaces] == ["objects.floor", "objects.top"] * 2
    assert [s.way for s in story.surfaces] == ["camera"] + ["reflection"] * 3
    np.testing.assert_allclose([s.weight for s in story.surfaces], [np.power(kr, n) for n in range(4)])
    assert story.surfaces[1].distance == 4
    assert all("may send on 1.1 times" in s.notes[0] for s in story.surfaces)


def test_refraction_and_total_reflection() -> None:
    """Into a ball of glass beside its middle, in it round and round: beyond the critical angle nothing leaves."""
    scene = replace(
        lit(lamp=PointLight(position=(0, 9, 0))),
        camera=replace(FLOOR.camera, origin=(0, 3, 0)),
        materials={"m": Material(kt=(0.9, 0.9, 0.9), ior=1.5)},
        objects={"ball": Sphere(radius=1.0, material="m")},
        background=(0.5, 0.5, 0.5),
    )
    (story,) = check(scene, [(1, 1)])
    assert [s.way for s in story.surfaces] == ["camera", "refraction", "refraction"]
    assert [s.inside for s in story.surfaces] == [False, True, False] and story.surfaces[-1].object is None
    np.testing.assert_allclose(story.surfaces[-1].weight, 0.81)
    np.testing.assert_allclose(story.surfaces[0].share, 0.1)
    inside = replace(scene, camera=replace(FLOOR.camera, origin=(0.9, 0, 0), target=(0.9, -1, 0), fov=1.0))
    (story,) = check(inside, [(1, 1)])
    # The angle to the normal is asin 0.9, more than asin 1/1.5.
    assert [s.way for s in story.surfaces[1:4]] == ["total reflection"] * 3


def test_scattered_rays_say_what_they_meet() -> None:
    wall = Rectangle(center=(0.5, 500, 0), width=(0, 1000, 0), height=(0, 0, 1000), material="m")
    scene = replace(
        lit(lamp=PointLight(position=(-1, 2, 0))),
        objects=FLOOR.objects | {"wall": wall},
        settings=replace(FLOOR.settings, scatter=vr.Scatter(rays=64)),
    )
    (story,) = check(scene, [(1, 1)])
    (surface,) = story.surfaces
    assert surface.scattered == 64 and set(surface.scattered_to) == {"objects.wall", "nothing"}
    # Half the hemisphere: 64 stratified rays are off by less than a row of 8.
    assert abs(surface.scattered_to["objects.wall"] - 0.5) <= 8 / 64
    assert np.all(np.array(surface.scattered_light) > 0)


@pytest.mark.parametrize("mode", [m.name for m in modes.MODES if not m.lit])
def test_modes_that_show_no_light(mode: str) -> None:
    (story,) = check(replace(lit(lamp=PointLight(position=(0, 4, 0))), settings=Settings(shading=mode)), [(1, 1)])
    assert story.shading == mode and story.surfaces[0].lights == () and story.surfaces[0].ambient is None


def test_the_picture_itself() -> None:
    """Of so small an angle that all samples of a pixel see nearly the same point, at most 1e-4 of a unit apart."""
    scene = replace(FULL, camera=replace(FULL.camera, target=(0.2, 1.3, 0.9), fov=0.01), film=Film(width=1, height=1))
    colour = vr.render(scene, spp=1, layers=("RGB",), progress=False)["RGB"][0, 0]
    np.testing.assert_allclose(why(scene, 0, 0).colour, colour, rtol=pi * 1e-3)


def test_looped_lights_are_told_in_order() -> None:
    lights = {f"lamp {i}": PointLight(position=(i - 30, 4, 3), intensity=i / 60) for i in range(60)}
    (story,) = check(replace(FULL, lights=lights), [(12, 12)])
    told = story.surfaces[0].lights
    assert [light.light for light in told] == [f"lights.lamp {i}" for i in range(60)]
    assert "and 48 lights more" in str(story)


@pytest.mark.parametrize(("x", "y"), [(3, 0), (0, 3), (-1, 0), (0.5, 0), (True, 0), ("1", 0)])
def test_pixels_outside(x: Any, y: Any) -> None:
    with pytest.raises(UserError, match="must be a whole number from 0 to 2, as the film has 3"):
        why(FLOOR, x, y)


def test_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    path = tmp_path / "s.json"
    path.write_text(vr.dump(lit(lamp=PointLight(position=(3, 4, 0)))))
    code, out, err = said(capsys, "explain", str(path), "--why", "1,1")
    assert (code, err) == (0, "")
    assert out.splitlines() == list(vr.why(str(path), 1, 1).lines())
    code, out, _ = said(capsys, "explain", str(path), "--why", "1, 1", "--json")
    assert code == 0 and json.loads(out) == json.loads(json.dumps(vr.why(path, 1, 1).as_json()))
    for wrong in ("1", "1,2,3", "a,b", "1.5,2"):
        code, out, err = said(capsys, "explain", str(path), "--why", wrong)
        assert (code, out) == (2, "") and "must be X,Y" in err
    assert said(capsys, "explain", str(path), "--why", "3,0")[0] == 2


DENT, PALE = Sphere(center=(0, 0, 0.5), radius=0.3), "pale"
AWAY = (Translate(translate=(5, 0, 0)),)
# Objects that a ray along -z meets near the origin, each with the address of the operand that it meets, and the name of
# the material there.
MET = {
    "named": (Csg(op="difference", of={"body": Box(), "dent": DENT}, cut_material=PALE), "objects.x.of.dent", PALE),
    "listed": (Csg(op="merge", of=(Sphere(radius=0.2, material=PALE), Box(material="two"))), "objects.x.of.1", "two"),
    "cut": (Box(cut=(replace(DENT, material=PALE),)), "objects.x.cut.0", PALE),
    "uncut": (Box(material=PALE, cut=(replace(DENT, transform=AWAY),)), None, PALE),
    "instance": (Instance(geometry="g", material="glass"), "geometries.g.cut.dent", "glass"),
    "bodies": (Csg(op="union", of=(Sphere(), Box()), material="glass"), "objects.x.of.0", "glass"),
    "back": (Csg(op="difference", ends="open", of=(Box(), DENT), material="two"), "objects.x.of.0", PALE),
}


@pytest.mark.parametrize("case", MET)
def test_the_operand_that_is_met_is_named_with_its_material(case: str) -> None:
    """A second object of the same structure comes first, so that numbers of rows and of leaves differ."""
    obj, operand, material = MET[case]
    scene = Scene(
        camera=OrthographicCamera(origin=(0, 0, 5), height=1.0), film=Film(width=3, height=3),
        materials={PALE: Material(), "two": Material(back=PALE), "glass": Material(kt=(0.5, 0.5, 0.5))},
        geometries={"g": Box(cut={"dent": DENT})}, lights={"sun": DirectionalLight(direction=(0, 0, -1))},
        objects={"other": replace(obj, transform=AWAY), "x": obj},
    )  # fmt: skip
    story = check(scene, [(1, 1)])[0]
    first = story.surfaces[0]
    assert (first.object, first.operand, first.material["address"]) == ("objects.x", operand, f"materials.{material}")
    assert (operand is None) == ("operand" not in str(story).splitlines()[1])
