"""Unlit materials: kd as it is, whatever light falls on it."""

from dataclasses import replace

import numpy as np
import pytest

from visray import modes
from visray.adaptive.brightness import Brightness, rms
from visray.camera import Camera
from visray.dark import DarkWarning
from visray.differences import difference
from visray.edges import EdgeWarning
from visray.errors import UserError
from visray.features import features
from visray.gradients import gradient
from visray.lights import DirectionalLight, PointLight, RectangleLight
from visray.material_report import energy_notes
from visray.materials import Material
from visray.primitives import Box, Plane, Rectangle, Sphere
from visray.renderer import render
from visray.scene.address import replaced
from visray.scene.scene import Film, Occlusion, Scatter, Scene, Settings
from visray.setup import prepare
from visray.study.mitsuba.crosscheck import check
from visray.study.pixel.why import why
from visray.study.timed_picture import UncachedPicture
from visray.textures import CheckerTexture

KD = (0.3, 1.7, 0.05)
SIGN = Material(ka=(0.4, 0.5, 0.6), kd=KD, ks=(0.9, 0.8, 0.7), shininess=3.5, shading="unlit")
LIGHTS = {
    "key": PointLight(position=(2, 5, 4), Ia=(0.2, 0.1, 0.3), a=0.5, b=0.1),
    "sun": DirectionalLight(direction=(-1, -2, -1)),
    "panel": RectangleLight(position=(-2, 4, 3), samples=4),
}
SCENE = Scene(
    camera=Camera(origin=(0.5, 2, 6), target=(0, 0.5, 0), fov=40.0),
    film=Film(width=24, height=16),
    background=(0.1, 0.2, 0.3),
    ambient=(0.3, 0.2, 0.1),
    materials={"sign": SIGN, "wall": Material(kd=(0.6, 0.5, 0.4), ks=(0.2, 0.2, 0.2))},
    lights=LIGHTS,
    objects={
        "floor": Plane(material="wall"),
        "ball": Sphere(center=(0, 1, 0), material="sign"),
        "box": Box(min=(1.2, 0, -1), max=(2, 1, 0), material="wall"),
    },
    settings=Settings(spp=2, seed=3),
)
FACING = Rectangle(center=(0, 0, 0), width=(8, 0, 0), height=(0, 8, 0), material="sign")


def changed(scene: Scene = SCENE, sign: dict | None = None, **more) -> Scene:
    """The scene with other settings, and with other fields of the material `sign`."""
    materials = scene.materials | {"sign": replace(scene.materials["sign"], **(sign or {}))}
    return replace(scene, materials=materials, settings=replace(scene.settings, **more))


def filled(scene: Scene, **objects) -> Scene:
    """The scene with these objects only, and a camera that sees nothing but them."""
    return replace(scene, objects=objects, camera=Camera(origin=(0, 0, 3), target=(0, 0, 0), fov=30.0))


def rgb(scene: Scene) -> np.ndarray:
    """The picture. Shape: (H, W, 3)."""
    return np.array(render(scene)["RGB"])


def shown_by(scene: Scene, name: str) -> np.ndarray:
    """Mask of the pixels that show one object only: so do the centres of all pixels around them."""
    grown = replace(scene, settings=replace(scene.settings, spp=1))
    number = list(scene.objects).index(name) + 1
    ids = np.array(render(grown, layers=("RGB", "id"))["id"]).reshape(scene.film.height, scene.film.width) == number
    for axis in (0, 1):
        ids = ids & np.roll(ids, 1, axis) & np.roll(ids, -1, axis)
    return ids


@pytest.mark.parametrize("mode", [m.name for m in modes.MODES if m.lit])
def test_it_shows_kd_in_every_mode_that_shows_light(mode: str) -> None:
    scene = changed(shading=mode, occlusion=Occlusion(sky=2, near=2), scatter=Scatter(rays=2, depth=2))
    ball = shown_by(scene, "ball")
    assert ball.sum() > 10
    assert (rgb(scene)[ball] == np.array(KD, np.float32)).all()


def test_it_shows_the_colour_of_its_texture() -> None:
    a, b = (0.25, 0.5, 2.0), (0.125, 0.75, 0.0)
    scene = filled(changed(sign={"texture": "t", "ka": (9.0, 9.0, 9.0)}), wall=FACING)
    scene = replace(scene, textures={"t": CheckerTexture(a=a, b=b, scale=(8.0, 8.0))})
    pixels = rgb(changed(scene, spp=1)).reshape(-1, 3)
    assert {tuple(p) for p in pixels.tolist()} == {a, b}


def test_it_casts_shadows() -> None:
    """What lights do to other surfaces is what it is beside a lit ball, bit for bit."""
    lit = changed(sign={"shading": "lit"})
    floor = shown_by(SCENE, "floor")
    assert (rgb(SCENE)[floor] == rgb(lit)[floor]).all()
    without = replace(SCENE, objects={k: x for k, x in SCENE.objects.items() if k != "ball"})
    assert (rgb(without)[floor] > rgb(SCENE)[floor] + 0.01).any()


def test_a_mirror_shows_it_and_glass_lets_it_through() -> None:
    """kr kd of what is mirrored, and (1 - kt) kd + kt times what is behind."""
    kr, kt = (0.5, 0.25, 1.0), (0.25, 0.5, 0.75)
    dark = Material(ka=(0, 0, 0), kd=(0, 0, 0))
    materials = {"sign": SIGN, "mirror": replace(dark, kr=kr), "pane": replace(dark, kt=kt, ior=1.0)}
    behind = replace(FACING, center=(0, 0, 6), width=(80, 0, 0), height=(0, 80, 0))
    scene = replace(filled(SCENE, front=replace(FACING, material="mirror"), sign=behind), materials=materials)
    assert np.allclose(rgb(scene), np.multiply(kr, KD), rtol=1e-6)
    pane = replace(FACING, center=(0, 0, 1), material="pane")
    scene = replace(filled(SCENE, pane=pane, sign=FACING), materials=materials)
    assert np.allclose(rgb(scene), np.multiply(kt, KD), rtol=1e-6)
    other = (0.1, 0.2, 0.3)
    materials = {"sign": replace(SIGN, kt=kt, ior=1.0), "back": replace(SIGN, kd=other)}
    scene = replace(filled(SCENE, pane=replace(pane, material="sign"), back=replace(FACING, material="back")),
                    materials=materials)  # fmt: skip
    expected = (1 - np.array(kt)) * KD + np.multiply(kt, other)
    assert np.allclose(rgb(scene), expected, rtol=1e-6)
    shiny = changed(filled(SCENE, wall=FACING), sign={"kr": kr})
    assert np.allclose(rgb(shiny), KD + np.multiply(kr, shiny.background), rtol=1e-6)


def test_it_scatters_no_light_and_is_a_source_of_scattered_light() -> None:
    """Inside a ball that shows c everywhere, a matte floor shows kd c, and the ball shows c."""
    scene = replace(
        SCENE,
        ambient=(0, 0, 0),
        lights={},
        objects={"floor": Plane(material="wall"), "sky": Sphere(radius=50, material="sign")},
        settings=Settings(spp=1, scatter=Scatter(rays=4, depth=3)),
    )
    kd = np.array(scene.materials["wall"].kd)
    pixels = rgb(scene)
    floor, sky = shown_by(scene, "floor"), shown_by(scene, "sky")
    assert (pixels[sky] == np.array(KD, np.float32)).all() and sky.any() and floor.any()
    assert np.allclose(pixels[floor], kd * KD, rtol=1e-6)


ALL_UNLIT = changed(replace(SCENE, objects={k: replace(x, material="sign") for k, x in SCENE.objects.items()}))


def test_lights_cost_nothing_where_nothing_is_lit() -> None:
    """Its kernel is that of a scene without lights, instruction by instruction, whatever the settings ask for."""
    busy = changed(ALL_UNLIT, occlusion=Occlusion(sky=5, near=5), scatter=Scatter(rays=4, depth=2))
    without = replace(ALL_UNLIT, lights={}, ambient=(0, 0, 0))
    assert set(features(busy).names()) == {"unlit", "background"}
    kernels = [max(UncachedPicture(prepare(s), 7).kernels(), key=lambda k: k["operation_count"])
               for s in (busy, without)]  # fmt: skip
    assert kernels[0]["hash"] == kernels[1]["hash"]
    assert (rgb(busy) == rgb(without)).all()
    asked = features(ALL_UNLIT, ("materials.sign.kd", "lights.key.intensity", "materials.sign.ks"))
    assert asked.names() == features(ALL_UNLIT).names()


def test_an_unlit_material_that_nothing_has_changes_no_kernel() -> None:
    lit = changed(sign={"shading": "lit"})
    more = replace(lit, materials=lit.materials | {"unused": SIGN})
    kernels = [max(UncachedPicture(prepare(s), 7).kernels(), key=lambda k: k["operation_count"]) for s in (lit, more)]
    assert kernels[0]["hash"] == kernels[1]["hash"]


@pytest.mark.parametrize("lights", [LIGHTS, {"sun": LIGHTS["sun"]}], ids=["waves", "loop"])
@pytest.mark.parametrize("address", ["materials.sign.kd", "materials.sign.ka", "materials.sign.ks", "lights.sun.Id"])
def test_derivatives_are_differences(address: str, lights: dict) -> None:
    """The picture is linear in each of these numbers, so that a difference is exact but for rounding."""
    scene = replace(SCENE, lights=lights)
    found = gradient(scene, [address])[address]
    expected = [float(np.mean(difference(scene, f"{address}.{k}", step=0.01))) for k in range(3)]
    assert found.any() == (address in ("materials.sign.kd", "lights.sun.Id"))
    assert np.allclose(found, expected, rtol=1e-9, atol=1e-15)


def test_a_derivative_by_kd_is_the_share_of_pixels_that_show_it() -> None:
    scene = changed(filled(SCENE, wall=FACING), sign={"kt": (0.25, 0.5, 0.0), "ior": 1.0})
    found = gradient(scene, ["materials.sign.kd", "lights.key.intensity", "materials.sign.kt"])
    assert np.allclose(found["materials.sign.kd"], np.array([0.75, 0.5, 1.0]) / 3, rtol=1e-12)
    assert found["lights.key.intensity"] == 0
    assert np.allclose(found["materials.sign.kt"], (np.array(scene.background) - KD) / 3, rtol=1e-12)


def test_kr_and_kt_have_derivatives_while_there_are_scattered_rays() -> None:
    """A matte material that is lit has none there."""
    scene = changed(scatter=Scatter(rays=1, depth=1))
    assert gradient(scene, ["materials.sign.kr"])["materials.sign.kr"].any()
    with pytest.raises(UserError, match=r"materials\.wall\.kr: has no derivative at 0"):
        gradient(scene, ["materials.wall.kr"])


def test_a_shadow_that_nothing_shows_is_no_moving_edge() -> None:
    """A ball beside the view throws its shadow on what is seen. On an unlit surface it is not seen."""
    scene = filled(SCENE, wall=FACING, ball=Sphere(center=(3, 0, 1), radius=0.5, material="sign"))
    scene = replace(scene, lights={"side": PointLight(position=(6, 0, 2))})
    gradient(scene, ["objects.ball.center"])
    with pytest.warns(EdgeWarning, match=r"shadow edges of lights\.side"):
        gradient(changed(scene, sign={"shading": "lit"}), ["objects.ball.center"])


def test_updates_change_it() -> None:
    """`updated` gives what a new scene gives, both where the kernel stays and where it changes."""
    two = replace(SCENE, materials=SCENE.materials | {"other": replace(SIGN, kd=(0.1, 0.9, 0.1))})
    two = replace(two, objects=two.objects | {"box": replace(SCENE.objects["box"], material="other")})
    prepared = prepare(two)
    for values in (
        {"materials.sign.kd": (1.0, 2.0, 3.0)},
        {"materials.sign.shading": "lit", "materials.wall.shading": "unlit"},
        {"materials.sign.shading": "lit", "materials.other.shading": "lit"},
    ):
        expected = two
        for address, new in values.items():
            expected = replaced(expected, address, new)
        assert (np.array(render(prepared.updated(values))["RGB"]) == rgb(expected)).all()


def test_the_story_of_a_pixel_says_it() -> None:
    kt = (0.25, 0.5, 0.75)
    scene = changed(filled(SCENE, wall=FACING), sign={"kt": kt, "ior": 1.0}, spp=1)
    story = why(scene, 3, 4)
    first, behind = story.surfaces
    assert np.allclose(first.own, KD, rtol=1e-6) and np.allclose(first.adds, (1 - np.array(kt)) * KD, rtol=1e-6)
    assert first.unlit and first.ambient is None and not first.lights and not first.notes
    assert np.allclose(story.colour, np.add(first.adds, behind.adds), rtol=1e-6)
    assert np.allclose(story.colour, rgb(scene)[4, 3], rtol=1e-6)
    assert "unlit: it shows kd as it is" in str(story)
    normal = why(changed(scene, shading="normal"), 3, 4)
    assert not normal.surfaces[0].unlit and "unlit" not in str(normal)


def test_it_sends_on_no_light_that_it_gets() -> None:
    """Nothing is said of a kd above 1, but of kr and kt together above 1 as of other materials."""
    assert not energy_notes(changed(filled(SCENE, wall=FACING), sign={"kr": (1.0, 1.0, 1.0)}))
    text = energy_notes(changed(filled(SCENE, wall=FACING), sign={"kr": (0.5, 0.5, 0.5), "kt": (0.75, 0.0, 0.0)}))
    assert text == ["materials.sign: kr + kt = 1.25 is above 1: more light leaves it than arrives"]


def test_bounds_of_brightness_are_what_it_shows() -> None:
    texture = CheckerTexture(a=(4.0, 0.0, 0.0), b=(0.0, 3.0, 0.0))
    found = Brightness.of(prepare(ALL_UNLIT))
    assert found.objects == {"sign": rms(KD)} and found.hidden == 0
    painted = replace(changed(ALL_UNLIT, sign={"texture": "t"}), textures={"t": texture})
    found = Brightness.of(prepare(painted))
    assert found.hidden == rms((4.0, 3.0, 0.0)) and found.cause == "the texture of materials.sign"
    assert found.objects == {"sign": found.hidden}


def test_pictures_of_unlit_surfaces_are_not_dark(recwarn: pytest.WarningsRecorder) -> None:
    for scene in (ALL_UNLIT, replace(ALL_UNLIT, lights={}, ambient=(0, 0, 0), background=(0, 0, 0))):
        render(scene)
    assert not [w for w in recwarn if issubclass(w.category, DarkWarning)]


def test_a_light_that_shines_on_unlit_surfaces_only_is_missed() -> None:
    """The ball lies in the dark beside a wall that shows its own colour."""
    behind = PointLight(position=(0, 0, -30))
    wall = replace(FACING, center=(0, 0, -5), width=(80, 0, 0), height=(0, 80, 0))
    scene = filled(SCENE, wall=wall, ball=Sphere(radius=0.5, material="wall"))
    scene = replace(scene, lights={"lamp": behind}, ambient=(0, 0, 0))
    with pytest.warns(DarkWarning, match=r"no light shines on what is seen: lights\.lamp is "):
        render(scene)
    painted = replace(changed(scene, sign={"texture": "t"}), textures={"t": CheckerTexture()})
    with pytest.warns(DarkWarning, match=r"no light shines on what is seen: lights\.lamp is "):
        render(painted)


def test_black_unlit_surfaces_say_so() -> None:
    scene = filled(changed(sign={"kd": (0.0, 0.0, 0.0)}), wall=FACING)
    with pytest.warns(DarkWarning, match="the picture is black: all that is seen is unlit, and its kd is black"):
        render(scene)


def test_an_unknown_shading_is_refused() -> None:
    with pytest.raises(UserError, match=r"materials\.sign\.shading"):
        replaced(SCENE, "materials.sign.shading", "flat")


@pytest.mark.slow
@pytest.mark.parametrize("scene", [SCENE, ALL_UNLIT], ids=["some", "all"])
def test_mitsuba_agrees(scene: Scene) -> None:
    """The twin shows kd at the points that Mitsuba hits. A twin whose sign is lit does not pass."""
    report = check(replace(scene, film=Film(width=60, height=40)), rays=2000)
    assert report.passed, report.table()
    assert not check(scene, rays=100, other=changed(scene, sign={"shading": "lit"})).passed
