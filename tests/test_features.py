"""What is simulated and why; that leaving the rest out changes no bit; and no derivative that was asked for."""

import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
import pytest
from PIL import Image as Pillow

from visray import direct, fresnel, indirect, integrator, interaction, media, occlusion, shading, warp
from visray.accel import tint
from visray.camera import Camera
from visray.environment_map import EnvironmentMap
from visray.feature_rules import RULES
from visray.features import features
from visray.filters import TentFilter
from visray.gradients import gradient
from visray.images import environment
from visray.images import lookup as texturing
from visray.lights import DiskLight, PointLight, RectangleLight, SphereLight
from visray.lights import disk as disk_light
from visray.lights import sphere as sphere_light
from visray.materials import Material
from visray.passes import empty_film, expose
from visray.picture_layers import developed, rasters
from visray.primitives import Box, Cylinder, Plane, Rectangle, Sphere, Triangle
from visray.sampling import SamplePlan
from visray.scene.address import replaced, value
from visray.scene.load import load
from visray.scene.scene import Film, Occlusion, Scatter, Scene, Settings, SkyGradient
from visray.setup import Prepared, prepare
from visray.textures import CheckerTexture, ImageTexture
from visray.transforms import Rotate

SCENES = sorted(p for p in (Path(__file__).resolve().parents[1] / "scenes").glob("*.json") if p.name != "schema.json")
BLACK = (0.0, 0.0, 0.0)
DOTS, ROOM = "dots.png", "room.png"  # in the folder where each test runs
FULL = Scene(
    camera=Camera(origin=(0.5, 2, 6), target=(0, 0.5, 0), fov=40.0),
    film=Film(width=24, height=16, transparent=False),
    background=SkyGradient(top=(0.2, 0.4, 0.8), bottom=(0.9, 0.8, 0.7)),
    ambient=(0.3, 0.2, 0.1),
    materials={
        "gloss": Material(ka=(0.2, 0.1, 0.1), kd=(0.5, 0.4, 0.3), ks=(0.3, 0.4, 0.5), shininess=17.5),
        "wall": Material(ka=(0.1, 0.1, 0.1), kd=(0.6, 0.6, 0.7), ks=(0.1, 0.1, 0.1), shininess=4.0),
    },
    lights={
        "key": PointLight(position=(3, 5, 4), Ia=(0.1, 0.1, 0.1), a=0.5, b=0.1, c=0.01),
        "fill": PointLight(position=(-4, 2, 3), intensity=0.4, Is=(0.5, 0.2, 0.2)),
    },
    objects={
        "floor": Plane(material="wall"),
        "ball": Sphere(center=(0, 1, 0), material="gloss"),
        "box": Box(min=(1.2, 0, -1), max=(2, 1, 0), material="gloss", transform=(Rotate(rotate=20.0),)),
        "can": Cylinder(center=(-1.7, 0.5, 0.5), material="wall"),
        "leaf": Triangle(a=(-1, 0, 1.5), b=(0.3, 0.1, 1.6), c=(-0.5, 1, 1.2), material="gloss"),
    },
    settings=Settings(spp=3, seed=5),
)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with a picture for textures and one for the background, as the current one."""
    Pillow.fromarray(np.random.default_rng(1).integers(0, 256, (5, 7, 3), np.uint8)).save(tmp_path / DOTS)
    Pillow.fromarray(np.random.default_rng(2).integers(0, 256, (4, 8, 3), np.uint8)).save(tmp_path / ROOM)
    monkeypatch.chdir(tmp_path)


def both(*changes: Callable[[Scene], Scene]) -> Callable[[Scene], Scene]:
    """All changes, the first one first."""

    def change(s: Scene) -> Scene:
        for c in changes:
            s = c(s)
        return s

    return change


def material(*names: str, **fields: Any) -> Callable[[Scene], Scene]:
    """Those materials with other fields, or all of them."""
    return lambda s: replace(
        s, materials={k: replace(m, **fields) if k in names or not names else m for k, m in s.materials.items()}
    )


def light(**fields: Any) -> Callable[[Scene], Scene]:
    return lambda s: replace(s, lights={k: replace(l, **fields) for k, l in s.lights.items()})


def whole(**fields: Any) -> Callable[[Scene], Scene]:
    return lambda s: replace(s, **fields)


def film(**fields: Any) -> Callable[[Scene], Scene]:
    return lambda s: replace(s, film=replace(s.film, **fields))


def settings(**fields: Any) -> Callable[[Scene], Scene]:
    return lambda s: replace(s, settings=replace(s.settings, **fields))


def lens(aperture: float) -> Callable[[Scene], Scene]:
    return lambda s: replace(s, camera=replace(s.camera, aperture=aperture, focus=5.0))


def lit_by(**lights: Any) -> Callable[[Scene], Scene]:
    return whole(lights=lights)


def painted(name: str, texture: Any) -> Callable[[Scene], Scene]:
    return both(whole(textures={"t": texture}), material(name, texture="t"))


def lone(thing: Any) -> Callable[[Scene], Scene]:
    return lambda s: replace(s, objects={"lone": replace(thing, material="gloss")})


GLASS = material("gloss", kt=(0.5, 0.7, 0.3), dmax=2.0, ior=1.4)


def ball_on_floor(s: Scene) -> Scene:
    """Only the ball and the floor, of what the scene has of them."""
    return replace(s, objects={k: x for k, x in s.objects.items() if k in ("floor", "ball")} or s.objects)


PANEL = RectangleLight(position=(2, 5, 4), samples=5)
DISK = DiskLight(position=(3, 5, 4), normal=(-1, -1, -1), samples=4)
SKY_LIGHT = settings(occlusion=Occlusion(sky=4, light="background"))
GLOBE = SphereLight(position=(-3, 4, 3), radius=0.5, samples=3)
# Every effect but coverage, on top of those that the full scene has.
ALL = both(
    GLASS,
    material("gloss", kr=(0.3, 0.2, 0.1), fresnel="dielectric", absorption=(0.3, 0.1, 0.2), emission=(0.1, 0.2, 0.1)),
    whole(background=EnvironmentMap(ROOM, rotation=40.0, intensity=0.5)),
    painted("wall", ImageTexture(file=DOTS)),
    lambda s: replace(s, lights=s.lights | {"panel": replace(PANEL, visible=True)}),
    settings(occlusion=Occlusion(sky=3, near=2), scatter=Scatter(rays=2, depth=2)),
    lens(0.2),
    film(filter=TentFilter()),
    lambda s: replace(s, materials=s.materials | {"lamp": Material(kd=(2.0, 1.5, 1.0), shading="unlit", back="wall")}),
    lambda s: replace(s, objects=s.objects | {"leaf": replace(FULL.objects["leaf"], material="lamp")}),
)

# Changes of the full scene: which effect they take away (or add), and the reason that is given.
CASES = {
    "ambient 0": (whole(ambient=BLACK), "ambient", True, "needed by materials.gloss and 1 more"),
    "no Ia": (lambda s: light(Ia=BLACK)(whole(ambient=BLACK)(s)), "ambient", False,
              "no ambient light falls on a material with ka"),
    "no ka": (material(ka=BLACK), "ambient", False, "no ambient light falls on a material with ka"),
    "no kd": (material(kd=BLACK), "diffuse", False, "no light with Id falls on a material with kd"),
    "no Id": (light(Id=BLACK), "diffuse", False, "no light with Id falls on a material with kd"),
    "no ks": (material(ks=BLACK), "specular", False, "no light with Is falls on a material with ks"),
    "no Is": (light(Is=BLACK), "specular", False, "no light with Is falls on a material with ks"),
    "whole shininess": (material(shininess=301.0), "fractional shininess", False, "every shininess is a whole number"),
    "no attenuation": (light(a=0.0, b=0.0, c=0.0), "attenuation", False, "no light has a, b or c"),
    "one flat thing": (lone(Rectangle(width=(3, 0, 0), height=(0, 3, 0))), "shadows", False,
                       "no object can occlude a light"),
    "one solid thing": (lone(Sphere()), "shadows", True, "needed by lights.key and 1 more"),
    "shadows off": (settings(shadows=False), "shadows", False, "settings.shadows is false"),
    "no objects": (whole(objects={}), "shadows", False, "no object can occlude a light"),
    "no lights": (whole(lights={}), "shadows", False, "no object can occlude a light"),
    "lights off": (light(intensity=0.0), "diffuse", False, "no light with Id falls on a material with kd"),
    "black sky": (whole(background=BLACK), "background", False, "the background is black"),
    "plain sky": (whole(background=(0.0, 0.0, 0.1)), "background", True, "needed by background"),
    "map": (whole(background=EnvironmentMap(ROOM, rotation=40.0)), "environment map", True, "needed by background"),
    "black map": (whole(background=EnvironmentMap(ROOM, intensity=0.0)), "environment map", False,
                  "the environment map is black"),
    "no map": (whole(), "environment map", False, "the background is no environment map"),
    "map behind a transparent film": (both(whole(background=EnvironmentMap(ROOM)), film(transparent=True)),
                                      "environment map", False, "film.transparent is true"),
    "ambient map": (both(whole(background=EnvironmentMap(ROOM), ambient=BLACK), film(transparent=True), SKY_LIGHT),
                    "environment map", True, "needed by background"),
    "ambient sky": (both(whole(ambient=BLACK), SKY_LIGHT), "sky occlusion", True, "needed by settings.occlusion.sky"),
    "ambient night": (both(whole(background=BLACK), SKY_LIGHT), "sky occlusion", False,
                      "settings.occlusion.sky is 0, or no ambient light falls on a material with ka"),
    "transparent": (film(transparent=True), "background", False, "film.transparent is true"),
    "opaque": (film(transparent=False), "coverage", False, "film.transparent is false: A is 1"),
    "covering": (film(transparent=True), "coverage", True, "needed by film.transparent"),
    "tinted shadows": (both(GLASS, settings(depth=0)), "coloured shadows", True, "needed by materials.gloss"),
    "glass in the dark": (both(GLASS, whole(lights={})), "coloured shadows", False,
                          "no object that casts a shadow is transparent"),
    "glass without shadows": (both(GLASS, settings(shadows=False)), "coloured shadows", False,
                              "settings.shadows is false"),
    "panel": (lit_by(key=PANEL), "area lights", True, "needed by lights.key"),
    "disk and globe": (lit_by(a=DISK, b=GLOBE), "area lights", True, "needed by lights.a and 1 more"),
    "panel without shadows": (both(lit_by(key=PANEL), settings(shadows=False)), "shadows", False,
                              "settings.shadows is false"),
    "panel off": (lit_by(key=replace(PANEL, intensity=0.0)), "area lights", False, "no light has an area"),
    "sky": (settings(occlusion=Occlusion(sky=5)), "sky occlusion", True, "needed by settings.occlusion.sky"),
    "sky above black": (both(material(ka=BLACK), settings(occlusion=Occlusion(sky=5))), "sky occlusion", False,
                        "settings.occlusion.sky is 0, or no ambient light falls on a material with ka"),
    "near": (settings(occlusion=Occlusion(near=5, distance=2.0)), "near occlusion", True,
             "needed by settings.occlusion.near"),
    "near without Ia": (both(light(Ia=BLACK), settings(occlusion=Occlusion(near=5))), "near occlusion", False,
                        "settings.occlusion.near is 0, or no Ia falls on a material with ka"),
    "mirror": (material("gloss", kr=(0.5, 0.6, 0.7)), "reflection", True, "needed by materials.gloss"),
    "no mirror": (settings(scatter=Scatter(rays=2)), "reflection", False, "no material has kr"),
    "mirror at depth 0": (both(material(kr=(0.5, 0.6, 0.7)), settings(depth=0)), "reflection", False,
                          "settings.depth is 0"),
    "glass": (both(GLASS, settings(shadows=False)), "refraction", True, "needed by materials.gloss"),
    "no glass": (material(kr=(0.1, 0.2, 0.3)), "refraction", False, "no material has kt"),
    "glass and mirror": (both(GLASS, material(kr=(0.2, 0.1, 0.3))), "refraction", True,
                         "needed by materials.gloss"),
    "two glasses": (GLASS, "nested media", True, "needed by objects.ball and 2 more"),
    "one glass": (both(GLASS, ball_on_floor),
                  "nested media", False, "no transparent solid is beside another transparent object"),
    "coat": (material("gloss", kr=(0.9, 0.8, 0.7), fresnel="dielectric"), "fresnel", True, "needed by materials.gloss"),
    "glass by the angle": (both(GLASS, material("gloss", kr=(0.5, 0.4, 0.9), fresnel="dielectric")), "fresnel", True,
                           "needed by materials.gloss"),
    "metal": (material("wall", kr=(0.9, 0.6, 0.2), fresnel="metal"), "fresnel", True, "needed by materials.wall"),
    "coat that reflects nothing": (material(fresnel="dielectric"), "fresnel", False,
                                   "no material with kr or kt has fresnel"),
    "coat at depth 0": (both(material(kr=(0.5, 0.6, 0.7), fresnel="dielectric"), settings(depth=0)), "fresnel", False,
                        "settings.depth is 0"),
    "bottle glass": (both(GLASS, material("gloss", absorption=(0.4, 0.1, 0.3))), "absorption", True,
                     "needed by materials.gloss"),
    "bottle on a wall": (both(ball_on_floor, GLASS,
                              material("gloss", absorption=(0.4, 0.1, 0.3))), "nested media", True,
                         "needed by objects.ball"),
    "coat in a bottle": (both(ball_on_floor, GLASS,
                              material("wall", kr=(0.4, 0.1, 0.3), fresnel="dielectric")), "nested media", True,
                         "needed by objects.ball"),
    "bottle that only tints": (both(GLASS, material("gloss", absorption=(0.4, 0.1, 0.3)), settings(depth=0)),
                               "absorption", True, "needed by materials.gloss"),
    "bottle that tints nothing": (both(GLASS, settings(depth=0, shadows=False)), "absorption", False,
                                  "settings.depth is 0, and settings.shadows is false"),
    "opaque bottle": (material(absorption=(0.4, 0.1, 0.3)), "absorption", False,
                      "no transparent material has absorption"),
    "scatter": (settings(scatter=Scatter(rays=2, depth=2)), "scatter", True,
                "needed by materials.gloss and 1 more"),
    "scatter of mirrors": (both(material(kr=(0.5, 0.6, 0.7)), settings(scatter=Scatter(rays=2, depth=2))), "scatter",
                           False, "settings.scatter has no rays, or no material is matte"),
    "unlit": (both(material("gloss", shading="unlit"), settings(occlusion=Occlusion(sky=3, near=2))), "unlit", True,
              "needed by materials.gloss"),
    "unlit panel": (both(lit_by(key=PANEL), material("wall", shading="unlit")), "unlit", True,
                    "needed by materials.wall"),
    "unlit mirror and scatter": (both(material("gloss", shading="unlit", kr=(0.5, 0.6, 0.7)),
                                      settings(scatter=Scatter(rays=2, depth=2))), "unlit", True,
                                 "needed by materials.gloss"),
    "unlit pictures": (both(painted("wall", CheckerTexture()), material("wall", shading="unlit")), "unlit", True,
                       "needed by materials.wall"),
    "glow": (material("gloss", emission=(0.5, 0.1, 1.5)), "emission", True, "needed by materials.gloss"),
    "glow of pictures": (both(painted("wall", CheckerTexture()), material("wall", emission=(0.5, 0.1, 1.5)), GLASS),
                         "emission", True, "needed by materials.wall"),
    "no glow": (whole(), "emission", False, "no material has emission"),
    "visible panel": (lit_by(key=replace(PANEL, visible=True)), "visible lights", True, "needed by lights.key"),
    "visible lamps": (both(lit_by(key=replace(PANEL, visible=True), disk=replace(DISK, visible=True),
                                  globe=replace(GLOBE, visible=True)), GLASS, material("gloss", kr=(0.5, 0.6, 0.7)),
                           settings(scatter=Scatter(rays=2, depth=2))), "visible lights", True,
                      "needed by lights.key and 2 more"),
    "unseen panel": (lit_by(key=PANEL), "visible lights", False, "no area light is visible"),
    "all lit": (whole(), "unlit", False, "no material is unlit"),
    "all unlit": (material(shading="unlit"), "specular", False, "no light with Is falls on a material with ks"),
    "unlit at dawn": (material(shading="unlit"), "ambient", False, "no ambient light falls on a material with ka"),
    "unlit matte": (both(material(shading="unlit"), settings(scatter=Scatter(rays=2, depth=2))), "scatter", False,
                    "settings.scatter has no rays, or no material is matte"),
    "leaf with a back": (both(lambda s: replace(s, materials=s.materials | {"leaf": Material(back="wall")}),
                              lambda s: replace(s, objects=s.objects | {"leaf": Triangle(
                                  a=(-1, 0, 1.5), b=(-0.5, 1, 1.2), c=(0.3, 0.1, 1.6), material="leaf")})),
                         "two-sided", True, "needed by materials.leaf"),
    "backs of mirrors": (both(material("gloss", kr=(0.5, 0.6, 0.7)), material("wall", back="gloss")), "two-sided", True,
                         "needed by materials.wall"),
    "no backs": (whole(), "two-sided", False, "no material has a back"),
    "squares": (painted("wall", CheckerTexture()), "textures", True, "needed by materials.wall"),
    "no textures": (lens(0.2), "textures", False, "the scene has no textures"),
    "textures that nothing has": (whole(textures={"t": CheckerTexture()}), "textures", False,
                                  "no material has a texture"),
    "blend": (painted("wall", ImageTexture(file=DOTS)), "bilinear", True, "needed by textures.t"),
    "nearest": (painted("wall", ImageTexture(file=DOTS, filter="nearest")), "bilinear", False,
                "no texture blends its pixels"),
    "lens": (lens(0.3), "defocus", True, "needed by camera.aperture"),
    "tent": (film(filter=TentFilter()), "filter", True, "needed by film.filter"),
    "square": (whole(), "filter", False, "film.filter is a box of radius 0.5: a pixel is the light on its square"),
    "pinhole": (whole(), "defocus", False, "camera.aperture is 0"),
    "all": (ALL, "refraction", True, "needed by materials.gloss"),
    "normals": (both(ALL, settings(shading="normal")), "diffuse", False, "settings.shading is normal"),
}  # fmt: skip
# Of these cases, the scene itself rules the effect out: it is not forced.
FORBIDDEN = (
    "shadows off", "panel without shadows", "glass without shadows", "transparent", "mirror at depth 0", "no textures",
    "normals", "coat at depth 0", "bottle that tints nothing", "no map", "map behind a transparent film",
)  # fmt: skip
EACH = pytest.mark.parametrize("case", CASES)


def exposed(scene: Scene, everything: bool) -> dict[str, np.ndarray]:
    made = prepare(scene, everything=everything)
    film, done = expose(made)
    assert done == scene.settings.spp
    return rasters(made, developed(made, film)[0], ("RGB", "A", "variance"))


def kernel(made: Prepared) -> dict[str, Any]:
    """What Dr.Jit says of the kernel that renders the samples: the greatest there is."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        expose(made)
        return max(dr.kernel_history([dr.KernelType.JIT]), key=lambda k: k["operation_count"])


def operations(scene: Scene, everything: bool = False) -> int:
    return kernel(prepare(scene, everything=everything))["operation_count"]


@EACH
def test_reason(case: str) -> None:
    change, name, on, reason = CASES[case]
    found = {f.name: f for f in features(change(FULL)).listed}
    assert list(found) == [r.name for r in RULES]
    assert (found[name].on, found[name].reason) == (on, reason)
    forced = {f.name: f for f in features(change(FULL), everything=True).listed}
    assert forced[name].on != (case in FORBIDDEN)
    # An effect that lacks only the effect that it refines is needed by the scene.
    if not reason.startswith("without"):
        assert forced[name].reason == (reason if on or case in FORBIDDEN else "forced")


def test_what_only_refines_an_effect_is_off_with_it() -> None:
    scene = both(GLASS, light(intensity=0.0))(FULL)
    for everything, on, reason in (
        (False, False, "without shadows it changes nothing"),
        (True, True, "needed by materials.gloss"),
    ):
        found = next(f for f in features(scene, everything=everything).listed if f.name == "coloured shadows")
        assert (found.on, found.reason) == (on, reason)


def test_every_rule_is_on_in_one_case_and_off_in_another() -> None:
    every = {r.name for r in RULES}
    assert {*features(FULL).names(), *(name for _, name, on, _ in CASES.values() if on)} == every
    assert {name for _, name, on, _ in CASES.values() if not on} == every
    assert features(ALL(FULL)).names() == [r.name for r in RULES if r.name != "coverage"]


@EACH
@pytest.mark.parametrize("precision", ["single", "double"])
def test_everything_is_the_same_bit_for_bit(case: str, precision: str) -> None:
    """Colour, coverage and variance, with what the scene does not call for left out and forced in."""
    scene = CASES[case][0](FULL)
    scene = replace(scene, settings=replace(scene.settings, precision=precision))
    without, forced = exposed(scene, False), exposed(scene, True)
    assert list(without) == ["RGB", "A", "variance"]
    for name in without:
        assert without[name].tobytes() == forced[name].tobytes()


@pytest.mark.parametrize("seed", range(6))
def test_everything_is_the_same_bit_for_bit_in_mixtures(seed: int) -> None:
    """Effects that meet by chance: four cases one on top of the other."""
    mixed = random.Random(seed).sample(list(CASES.values()), 4)
    scene = both(*(change for change, *_ in mixed))(FULL)
    without, forced = exposed(scene, False), exposed(scene, True)
    for name in without:
        assert without[name].tobytes() == forced[name].tobytes()


@pytest.mark.parametrize(
    "path", [pytest.param(p, marks=[] if i % 10 == 8 else pytest.mark.slow, id=p.stem) for i, p in enumerate(SCENES)]
)
def test_everything_is_the_same_bit_for_bit_in_every_scene(path: Path) -> None:
    scene = load(path)
    height = max(1, round(64 * scene.film.height / scene.film.width))
    scene = both(film(width=64, height=height), settings(spp=3, precision="single"))(scene)
    without, forced = exposed(scene, False), exposed(scene, True)
    for name in without:
        assert without[name].tobytes() == forced[name].tobytes()


@pytest.mark.parametrize(
    "case", ["no ka", "no kd", "no ks", "whole shininess", "no attenuation", "shadows off", "black sky", "no lights"]
)
def test_what_is_not_called_for_is_not_in_the_kernel(case: str) -> None:
    scene = CASES[case][0](FULL)
    assert operations(scene) < operations(FULL)
    assert operations(scene) < operations(scene, everything=True)


# A matte scene, lit by a point without shadows, and for each effect how it and the same scene without it come about.
MATTE = Scene(
    camera=FULL.camera,
    film=FULL.film,
    background=BLACK,
    ambient=BLACK,
    materials={name: Material(ka=BLACK, kd=(0.5, 0.4, 0.3)) for name in ("floor", "one", "two")},
    lights={"key": PointLight(position=(3, 5, 4))},
    objects={
        "floor": Plane(material="floor"),
        "one": Sphere(center=(0, 1, 0), material="one"),
        "two": Sphere(center=(1.5, 0.5, 1), radius=0.5, material="two"),
    },
    settings=Settings(spp=2, shadows=False),
)
WIDE = {"panel": PANEL, "disk": DISK, "globe": GLOBE}
AMBIENT = both(whole(ambient=(0.5, 0.5, 0.5)), material(ka=(0.1, 0.2, 0.3)))
STEPS = {
    "ambient": (whole(), AMBIENT),
    "diffuse": (material(kd=BLACK), whole()),
    "specular": (whole(), material(ks=(0.5, 0.5, 0.5), shininess=8.0)),
    "fractional shininess": (material(ks=(0.5, 0.5, 0.5), shininess=8.0), material(ks=(0.5, 0.5, 0.5), shininess=8.5)),
    "attenuation": (whole(), light(a=0.5, c=0.1)),
    "shadows": (whole(), settings(shadows=True)),
    "coloured shadows": (settings(shadows=True, depth=0),
                         both(settings(shadows=True, depth=0), material("one", kt=(0.5, 0.7, 0.9)))),
    "area lights": (lit_by(**{name: PointLight(position=l.position) for name, l in WIDE.items()}), lit_by(**WIDE)),
    "sky occlusion": (AMBIENT, both(AMBIENT, settings(occlusion=Occlusion(sky=4, hemisphere="box")))),
    "near occlusion": (both(AMBIENT, light(Ia=(0.1, 0.1, 0.1))),
                       both(AMBIENT, light(Ia=(0.1, 0.1, 0.1)), settings(occlusion=Occlusion(near=4)))),
    "reflection": (whole(), material("one", kr=(0.5, 0.7, 0.9))),
    "refraction": (whole(), material("one", kt=(0.5, 0.7, 0.9))),
    "nested media": (material("one", kt=(0.5, 0.7, 0.9)), material("one", "two", kt=(0.5, 0.7, 0.9))),
    "fresnel": (material("one", kr=(0.5, 0.7, 0.9)), material("one", kr=(0.5, 0.7, 0.9), fresnel="dielectric")),
    "absorption": (both(settings(shadows=True), material("one", "two", kt=(0.5, 0.7, 0.9))),
                   both(settings(shadows=True),
                        material("one", "two", kt=(0.5, 0.7, 0.9), absorption=(0.1, 0.2, 0.3)))),
    "scatter": (whole(), settings(scatter=Scatter(rays=2, depth=2))),
    "unlit": (whole(), material("one", shading="unlit")),
    "emission": (whole(), material("one", emission=(0.1, 0.2, 0.3))),
    "visible lights": (lit_by(key=PANEL), lit_by(key=replace(PANEL, visible=True))),
    "two-sided": (whole(), material("one", back="two")),
    "textures": (whole(), painted("one", CheckerTexture())),
    "bilinear": (painted("one", ImageTexture(file=DOTS, filter="nearest")), painted("one", ImageTexture(file=DOTS))),
    "defocus": (whole(), lens(0.2)),
    "background": (whole(), whole(background=(0.1, 0.2, 0.3))),
    "environment map": (whole(background=(0.1, 0.2, 0.3)), whole(background=EnvironmentMap(ROOM))),
    "filter": (whole(), film(filter=TentFilter())),
    "coverage": (whole(), film(transparent=True)),
}  # fmt: skip


@pytest.mark.parametrize("effect", STEPS)
def test_each_effect_makes_the_kernel_of_a_matte_scene_grow(effect: str) -> None:
    before, after = (change(MATTE) for change in STEPS[effect])
    assert features(MATTE).names() == ["diffuse"]
    assert set(features(after).names()) - set(features(before).names()) == {effect}
    assert operations(before) < operations(after)


def traced(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How often the body of each loop of the kernel is traced."""
    whole, times = dr.while_loop, []

    def counted(state: tuple, condition: Callable, body: Callable, **more: Any) -> tuple:
        mine = len(times)
        times.append(0)

        def once_more(*state: Any) -> tuple:
            times[mine] += 1
            return body(*state)

        return whole(state, condition, once_more, **more)

    made = prepare(scene)
    with monkeypatch.context() as patch:
        patch.setattr(dr, "while_loop", counted)
        integrator.sample(made.kernel, SamplePlan.of(made.a, 0, 4, 0, 4), made.x, made.y, empty_film(made).moments)
    return times


@pytest.mark.parametrize("effect", STEPS)
def test_loops_are_traced_once(effect: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """And those in them too. Dr.Jit traces a loop again where something in its state never changes."""
    for change in STEPS[effect]:
        assert set(traced(change(MATTE), monkeypatch)) == {1}


@pytest.mark.parametrize("path", SCENES, ids=lambda p: p.stem)
def test_loops_of_every_scene_are_traced_once(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert set(traced(film(width=16, height=16)(load(path)), monkeypatch)) == {1}


def test_there_is_a_step_for_every_rule() -> None:
    assert list(STEPS) == [r.name for r in RULES]


# The functions that only some effects need.
PATHS, DOMES = {"reflection", "refraction", "scatter"}, {"sky occlusion", "near occlusion"}
PARTS = {
    (occlusion, "sky"): {"sky occlusion"},
    (occlusion, "near"): {"near occlusion"},
    (occlusion, "sky_light"): set(),
    (indirect, "indirect"): PATHS,
    (media, "interface_at"): PATHS,
    (indirect, "interface_at"): PATHS,
    (indirect, "bounce"): PATHS,
    (indirect, "scattered"): {"scatter"},
    (media, "_nested_media"): {"nested media"},
    (media, "_fresnel_share"): {"fresnel"},
    (media, "let_through"): {"absorption"},
    (fresnel, "dielectric"): {"fresnel"},
    (tint, "let_through"): {"absorption"},
    (indirect, "nearest_light"): {"visible lights"},
    (direct, "area_light"): {"area lights"},
    (direct, "to_area"): {"area lights"},
    (direct, "_from_area"): {"area lights"},
    (direct, "to_far"): set(),
    (direct, "_from_far"): set(),
    (direct, "_shadowed"): {"shadows"},
    (direct, "occluded"): {"shadows"},
    (direct, "transmittance"): {"coloured shadows"},
    (shading, "power"): {"specular"},
    (shading, "receiving"): {"unlit"},
    (interaction, "_seen_side"): {"two-sided"},
    (texturing, "colour"): {"textures"},
    (texturing, "around"): {"bilinear"},
    (environment, "light"): {"environment map"},
    (integrator, "lens_ray"): {"defocus"},
    (warp, "disk"): {"defocus", "scatter", *DOMES},
    (warp, "sphere"): set(),
    (warp, "cosine"): {"scatter", *DOMES},
    (warp, "box"): DOMES,
    (disk_light, "disk"): {"area lights"},
    (sphere_light, "sphere"): {"area lights"},
}


@pytest.mark.parametrize("effect", ["none", *STEPS])
def test_what_is_absent_is_out_of_reach(effect: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernel is the same, instruction by instruction, where the functions of all absent effects are no more."""
    scene = STEPS[effect][1](MATTE) if effect in STEPS else MATTE
    found, on = kernel(prepare(scene))["hash"], set(features(scene).names())
    for (module, name), effects in PARTS.items():
        if not effects & on:
            monkeypatch.delattr(module, name)
    assert kernel(prepare(scene))["hash"] == found


def test_what_is_present_is_reached(monkeypatch: pytest.MonkeyPatch) -> None:
    """The functions that the test above takes away are those that the effects run through."""
    reached = set()

    def watched(part: tuple, work: Callable) -> Callable:
        return lambda *given: (reached.add(part), work(*given))[1]

    for part in PARTS:
        monkeypatch.setattr(*part, watched(part, getattr(*part)))
    for _, change in STEPS.values():
        expose(prepare(change(MATTE)))
    assert reached == {part for part, effects in PARTS.items() if effects}


def test_matte_costs_less_than_glossy_and_glossy_less_than_a_broken_exponent() -> None:
    matte, glossy = material(ks=BLACK)(FULL), material(shininess=4.0)(FULL)
    assert operations(matte) < operations(glossy) < operations(FULL)


def test_only_materials_in_use_count() -> None:
    """A shiny material that no object has changes neither the features nor the kernel's size."""
    matte = material(ks=BLACK)(FULL)
    more = replace(matte, materials=matte.materials | {"unused": Material(ks=(1, 1, 1), shininess=1000.5)})
    assert features(more) == features(matte)
    assert operations(more) == operations(matte)


@pytest.mark.parametrize(
    ("shininess", "bits"), [(0.0, 8), (32.0, 8), (255.9, 8), (256.0, 12), (5000.0, 16), (2.0**20, 24)]
)
def test_digits_of_exponents(shininess: float, bits: int) -> None:
    """Enough for the greatest whole exponent, in steps of four so that a small change compiles nothing."""
    found = features(material(shininess=shininess)(FULL)).shininess_bits
    assert found == bits and 2**found > shininess


# Terms that are zero and whose slopes are not. The lights have no fall-off to 0, for there a slope does not exist.

SLOPES = {
    "materials.gloss.ks": material(ks=BLACK, shininess=8.0),
    "materials.gloss.kd": material(kd=BLACK),
    "materials.gloss.ka": material(ka=BLACK),
    "materials.gloss.shininess": material(shininess=8.0),
    "lights.key.Is": light(Is=BLACK),
    "lights.key.Id": light(Id=BLACK),
    "lights.key.Ia": light(Ia=BLACK),
    "lights.key.intensity": light(intensity=0.0),
    "lights.key.b": lambda s: light(a=1.0, b=0.0, c=0.0)(lone(Sphere())(s)),
    "ambient": lambda s: light(Ia=BLACK)(whole(ambient=BLACK)(s)),
    "background.top": whole(background=SkyGradient(top=BLACK, bottom=BLACK)),
}


def plus(scene: Scene, address: str, step: float) -> Scene:
    """The scene with the number at an address grown by a step, or its three numbers by one, two and three steps."""
    before = np.array(value(scene, address), float)
    moved = before + step * (np.array([1, 2, 3]) if before.ndim else 1)
    return replaced(scene, address, tuple(moved.tolist()) if moved.ndim else float(moved))


def mean_after(scene: Scene, address: str, step: float) -> float:
    moved = plus(scene, address, step)
    moved = replace(moved, settings=replace(moved.settings, precision="double"))
    return float(np.array(expose(prepare(moved, everything=True))[0].mean).mean())


@pytest.mark.parametrize("address", SLOPES)
def test_a_term_that_is_zero_keeps_its_slope(address: str) -> None:
    """Against one-sided differences of the picture with everything forced, at the border of the domain.

    Extrapolated from h and h/2, the error is h^2 / 12 of the third derivative: none for the linear terms; 6 distance^2
    of the slope for b, the lamp being nearer than 8; and ln^2 cos for an exponent, less.
    """
    scene = SLOPES[address](FULL)
    slope = gradient(scene, [address])[address]
    expected = float(np.sum(np.array(slope) * ([1, 2, 3] if np.ndim(slope) else 1)))
    assert abs(expected) > 1e-4
    h = 1e-3
    base, one, half = (mean_after(scene, address, s) for s in (0.0, h, h / 2))
    difference = 2 * (half - base) / (h / 2) - (one - base) / h
    # And the rounding of a mean of some 1 000 sums over a step.
    assert abs(expected - difference) <= h * h / 12 * 6 * 64 * abs(difference) + 4e3 * 2.0**-53 / (h / 2)


def test_a_highlight_that_is_zero_keeps_the_slope_of_its_broken_exponent() -> None:
    """ks = 0 with a shininess of 17.5: the slope by ks is that of cos^17.5, not of cos^17."""
    scene = material(ks=BLACK, shininess=17.5)(FULL)
    found = gradient(scene, ["materials.gloss.ks"])["materials.gloss.ks"]
    h = 1e-3
    exact = (mean_after(scene, "materials.gloss.ks", h) - mean_after(scene, "materials.gloss.ks", 0.0)) / h
    # Linear in ks: only rounding, of some 1 000 sums.
    assert abs(float(np.sum(found * [1, 2, 3])) - exact) <= 1e3 * 2.0**-53 / h
    assert features(scene, ("materials.gloss.ks",))["fractional shininess"]
