"""All effects at once, and scenes that are wrong, degenerate or unkind: a line that says so, or a picture."""

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Pillow
from test_paths import BLACK, HALF, WHITE, plain
from test_render import compiled

import visray as vr
from visray import passes
from visray.adaptive.dual_buffer import DualBuffer
from visray.cli import main
from visray.feature_rules import RULES
from visray.features import features
from visray.passes import expose
from visray.picture_layers import check_numbers
from visray.setup import prepare

GLASS = vr.Material(
    ka=(0.1, 0.1, 0.1), kd=(0.2, 0.3, 0.2), ks=HALF, shininess=20.5, kt=(0.6, 0.8, 0.7), ior=1.5, dmax=2.0
)
LIGHTS = {
    "point": vr.PointLight(position=(3.0, 5.0, 4.0), Ia=(0.1, 0.1, 0.1), a=1.0, b=0.05, c=0.01),
    "sun": vr.DirectionalLight(direction=(0.3, -1.0, -0.4), intensity=0.3, Ia=(0.05, 0.05, 0.05)),
    "spot": vr.SpotLight(position=(-3.0, 4.0, 3.0), direction=(1.0, -1.2, -1.0), angle=35.0, exponent=1.5),
    "pane": vr.RectangleLight(position=(0.0, 4.0, 1.0), samples=4),
    "disk": vr.DiskLight(position=(2.0, 4.0, -1.0), intensity=0.5, samples=3, visible=True),
    "globe": vr.SphereLight(position=(-2.0, 3.0, 0.0), radius=0.4, intensity=0.5, samples=2),
}
SETTINGS = vr.Settings(
    spp=4, depth=4, occlusion=vr.Occlusion(sky=2, near=2, distance=1.5), scatter=vr.Scatter(rays=2, depth=2)
)


def all_effects(folder: Path) -> vr.Scene:
    """Every effect and every kind of light: a floor, two balls of glass in each other, a mirror and a painted box."""
    Pillow.fromarray(np.random.default_rng(1).integers(0, 256, (5, 6, 3), np.uint8)).save(folder / "small.png")
    Pillow.fromarray(np.random.default_rng(2).integers(0, 256, (31, 17, 3), np.uint8)).save(folder / "other.png")
    sky = np.random.default_rng(3).integers(0, 256, (8, 16, 3), np.uint8)
    Pillow.fromarray(sky).save(folder / "sky.png")
    return vr.Scene(
        camera=vr.Camera(origin=(0.5, 2.0, 6.0), target=(0.0, 0.5, 0.0), aperture=0.1),
        film=vr.Film(width=12, height=8, filter="tent"),
        background=vr.EnvironmentMap(file=str(folder / "sky.png")),
        ambient=(0.3, 0.2, 0.4),
        textures={"squares": vr.CheckerTexture(), "image": vr.ImageTexture(file=str(folder / "small.png"))},
        materials={
            "floor": vr.Material(texture="squares", ks=(0.2, 0.2, 0.2), shininess=9.5),
            "box": vr.Material(texture="image"),
            "glass": replace(GLASS, absorption=(0.1, 0.2, 0.3)),
            "water": replace(GLASS, ior=1.33, kr=(0.2, 0.2, 0.2), fresnel="dielectric"),
            "mirror": replace(plain(kr=(0.9, 0.8, 0.7)), ks=WHITE),
            "sign": vr.Material(kd=(0.6, 0.7, 0.1), shading="unlit", back="box"),
            "glow": vr.Material(emission=(0.2, 0.1, 0.0)),
        },
        lights=LIGHTS,
        objects={
            "floor": vr.Plane(material="floor"),
            "outer": vr.Sphere(center=(0.0, 1.0, 0.0), material="glass"),
            "inner": vr.Sphere(center=(0.2, 1.0, 0.1), radius=0.5, material="water"),
            "ball": vr.Sphere(center=(-1.8, 0.8, -0.5), radius=0.8, material="mirror"),
            "box": vr.Box(min=(1.2, 0.0, -1.0), max=(2.0, 1.0, 0.0), material="box"),
            "ember": vr.Sphere(center=(-0.8, 0.2, 1.0), radius=0.2, material="glow"),
            "sign": vr.Disk(center=(1.5, 1.6, -0.5), normal=(0.0, 0.0, 1.0), radius=0.4, material="sign"),
        },
        settings=SETTINGS,
    )


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> vr.Scene:
    return all_effects(tmp_path_factory.mktemp("all"))


def folder(scene: vr.Scene) -> Path:
    """Where the image lies that the scene shows; a scene file reads only below its own folder."""
    return Path(scene.textures["image"].file).parent


def picture(scene: vr.Scene, **more: Any) -> np.ndarray:
    """Colours by rows; render itself refuses what is not a number."""
    found = vr.render(scene, progress=False, layers=("RGB",), **more)["RGB"]
    assert np.isfinite(found).all() and (found >= 0).all()
    return found


def at(address: str, value: Any) -> Callable[[vr.Scene], vr.Scene]:
    return lambda s: vr.replaced(s, address, value)


# Everything at once


def test_every_effect_is_on(full: vr.Scene) -> None:
    assert set(features(full).names()) == {r.name for r in RULES} - {"coverage"}
    clear = replace(full, film=replace(full.film, transparent=True))
    assert set(features(clear).names()) == {r.name for r in RULES}


def of_the_original(s: vr.Scene) -> vr.Scene:
    """Its own rules, on a transparent film."""
    occlusion = replace(s.settings.occlusion, hemisphere="box")
    rules = {"misses": "ambient", "local": "full", "area": "centre", "sampler": "independent", "occlusion": occlusion}
    return replace(s, settings=replace(s.settings, **rules), film=replace(s.film, transparent=True))


def twice(material: str) -> Callable[[vr.Scene], vr.Scene]:
    """The outer ball a second time in its own place."""
    return lambda s: replace(s, objects=s.objects | {"twin": replace(s.objects["outer"], material=material)})


def settings(**fields: Any) -> Callable[[vr.Scene], vr.Scene]:
    return lambda s: replace(s, settings=replace(s.settings, **fields))


# Each new kernel of all effects takes some seconds to compile, so what needs one is tried together.
UNKIND = {
    "as it is": lambda s: s,
    "in double, Phong's highlights, other random numbers": settings(
        precision="double", shading="phong", sampler="sobol"
    ),
    "as the original did": of_the_original,
    "one pixel of a cartoon without shadows": lambda s: replace(
        settings(shading="toon", shadows=False)(s), film=vr.Film(width=1, height=1)
    ),
    "no objects": at("objects", {}),
    "no objects and one pixel": lambda s: replace(s, objects={}, film=vr.Film(width=1, height=1)),
    "no lights": at("lights", {}),
    "glass in its own place twice": twice("glass"),
    "a mirror in the place of glass": twice("mirror"),
    "a thousand reflections": settings(depth=1000),
    "a sample": settings(spp=1),
    "the eye in glass": at("camera.origin", (0.2, 1.0, 0.1)),
    "the eye on glass": at("camera.origin", (0.0, 1.0, 1.0)),
    "the eye on the floor": at("camera.origin", (0.0, 0.0, 6.0)),
    "a lens as wide as the scene": at("camera.aperture", 50.0),
    "a lens focused on itself": at("camera.focus", 1e-9),
    "a lens focused far away": at("camera.focus", 1e9),
    "glass as dense as can be": at("materials.glass.ior", 100.0),
    "glass as thin as can be": at("materials.glass.ior", 0.01),
    "glass that nothing gets through": at("materials.glass.dmax", 1e-9),
    "a floor cut through glass": at("objects.outer.center", (0.0, 0.0, 0.0)),
}


@pytest.mark.parametrize("name", UNKIND)
def test_every_pixel_is_a_number(name: str, full: vr.Scene) -> None:
    """And not all of them are one: something is seen."""
    found = picture(UNKIND[name](full))
    assert found.size == 3 or np.ptp(found) > 0.01


INSIDE = {"in glass": (0.2, 1.0, 0.1), "in a mirror": (-1.8, 0.8, -0.5), "in the box": (1.5, 0.5, -0.5),
          "in the eye": (0.5, 2.0, 6.0), "below the floor": (0.0, -3.0, 0.0), "far away": (1e8, 1e8, 1e8)}  # fmt: skip
ON = {"floor": (0.5, 0.0, 1.0), "glass": (0.0, 2.0, 0.0), "corner": (1.2, 1.0, 0.0), "mirror": (-1.8, 1.6, -0.5)}


def moved(places: list[tuple]) -> dict[str, Any]:
    """The lights at these places, one after the other; the sun shines from its place."""
    lights = {}
    for (name, light), p in zip(LIGHTS.items(), places):
        away = {"position": p} if light.has_position else {"direction": tuple(-x for x in p)}
        lights[name] = replace(light, **away)
    return lights


@pytest.mark.parametrize("place", INSIDE)
def test_all_lights_may_be_in_one_place(place: str, full: vr.Scene) -> None:
    picture(replace(full, lights=moved([INSIDE[place]] * len(LIGHTS))))


@pytest.mark.parametrize("shift", [0, 1])
def test_lights_may_lie_on_surfaces(shift: int, full: vr.Scene) -> None:
    """Each on another one."""
    spots = list(ON.values())
    picture(replace(full, lights=moved([spots[(i + shift) % len(spots)] for i in range(len(LIGHTS))])))


def test_an_area_light_all_of_whose_points_lie_on_a_surface(full: vr.Scene) -> None:
    """A pane on the floor, and a disk flush with the lid of the box: neither is in its own way."""
    lights = {
        "pane": vr.RectangleLight(position=(0.0, 0.0, 2.5), width=(1.0, 0.0, 0.0), height=(0.0, 0.0, 1.0), samples=9),
        "lid": vr.DiskLight(position=(1.6, 1.0, -0.5), radius=0.3, samples=9),
        "skin": vr.SphereLight(position=(0.0, 1.0, 0.0), radius=1.0, samples=9),
    }
    # An unlit surface is seen without any light.
    lit_objects = {name: x for name, x in full.objects.items() if x.material not in ("sign", "glow")}
    bare = replace(full, objects=lit_objects, ambient=BLACK, background=BLACK)
    lit, dark = (picture(replace(bare, lights=x)) for x in (lights, {}))
    assert (dark == 0).all() and (lit > 0).mean() > 0.2


def forest(scene: vr.Scene) -> vr.Scene:
    """So many balls that they hang in a tree, of all materials, and so many boxes that they are looped over."""
    rng, names = np.random.default_rng(3), list(scene.materials)
    balls = {
        f"b{i}": vr.Sphere(center=tuple(rng.normal(size=3).tolist()), radius=0.3, material=names[i % len(names)])
        for i in range(40)
    }
    boxes = {
        f"c{i}": vr.Box(
            min=(-3.0 + 0.3 * i, 0.0, -2.0), max=(-2.8 + 0.3 * i, 1.0, -1.5), material=names[i % len(names)]
        )
        for i in range(20)
    }
    return replace(scene, objects={"floor": scene.objects["floor"]} | balls | boxes)


def many_lights(scene: vr.Scene) -> vr.Scene:
    """Three of each kind, with other numbers of samples."""
    lights = {f"{name}{i}": replace(light, intensity=0.2, **({"samples": i + 1} if light.has_area else {}))
              for name, light in LIGHTS.items() for i in range(3)}  # fmt: skip
    return replace(scene, lights=lights, objects=forest(scene).objects)


@pytest.mark.parametrize("crowd", [forest, many_lights])
@pytest.mark.slow
def test_crowds(crowd: Callable[[vr.Scene], vr.Scene], full: vr.Scene) -> None:
    scene = crowd(full)
    kernel = prepare(scene).kernel
    assert kernel.geometry.tree is not None and bool(kernel.looped_lights) == (crowd is many_lights)
    assert np.ptp(picture(scene)) > 0.01


def test_the_file_and_the_command_line_take_a_scene_of_all_effects(full: vr.Scene, capsys: Any) -> None:
    path, out = folder(full) / "all.json", folder(full) / "all.exr"
    path.write_text(vr.dump(full, path.parent))
    assert main(["render", str(path), "-o", str(out), "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    direct = vr.render(full, progress=False)
    written = vr.Image.read(out)
    # Half keeps eleven binary digits.
    assert (np.abs(written["RGB"] - direct["RGB"]) <= 2.0**-11 * direct["RGB"]).all()
    assert np.isfinite(written["RGB"]).all()


# Nothing that is a number compiles

CHANGES = {
    "the same again": lambda s: s,
    "more light samples": at("lights.pane.samples", 9),
    "one light sample": at("lights.globe.samples", 1),
    "more rays to the sky": at("settings.occlusion.sky", 5),
    "more rays to what is near": at("settings.occlusion.near", 7),
    "how near that is": at("settings.occlusion.distance", 0.3),
    "more scattered rays": at("settings.scatter.rays", 5),
    "more scatterings": at("settings.scatter.depth", 6),
    "more reflections": at("settings.depth", 9),
    "an index": at("materials.glass.ior", 2.4),
    "an index of 1": at("materials.glass.ior", 1.0),
    "what glass lets through": at("materials.glass.kt", (1.0, 0.0, 1.0)),
    "how deep it does": at("materials.glass.dmax", 1.0),
    "what a mirror reflects": at("materials.mirror.kr", (1.0, 1.0, 1.0)),
    "a wider lens": at("camera.aperture", 1.0),
    "another focus": at("camera.focus", 3.0),
    "a seed": at("settings.seed", 77),
    "more samples": at("settings.spp", 9),
    "one sample": at("settings.spp", 1),
    "a moved light": at("lights.pane.position", (1.0, 3.0, 2.0)),
    "a larger light": at("lights.globe.radius", 1.0),
    "a turned light": at("lights.sun.direction", (1.0, -1.0, 0.0)),
    "a narrower cone": at("lights.spot.angle", 20.0),
    "a moved ball": at("objects.inner.center", (0.0, 1.2, 0.0)),
    "a camera elsewhere": at("camera.origin", (1.0, 3.0, 5.0)),
    "a texture's scale": at("textures.image.scale", (3.0, 2.0)),
    "a texture's edges": at("textures.image.wrap", "mirror"),
    "other textures": lambda s: at("materials.box.texture", "squares")(at("materials.floor.texture", "image")(s)),
    "colours": at("textures.squares.a", (1.0, 0.0, 0.0)),
    "a turned sky": at("background.rotation", 77.0),
    "a brighter sky": at("background.intensity", 2.0),
    "ambient light": at("ambient", (1.0, 1.0, 1.0)),
}


@pytest.fixture(scope="module")
def warm(full: vr.Scene) -> vr.Scene:
    picture(full)
    return full


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.slow
def test_numbers_are_data_not_code(change: str, warm: vr.Scene) -> None:
    changed = CHANGES[change](warm)
    assert compiled(lambda: picture(changed)) == 0
    assert change == "the same again" or not np.array_equal(picture(changed), picture(warm))


def test_an_image_of_another_size_compiles_nothing(warm: vr.Scene) -> None:
    other = vr.replaced(warm, "textures.image.file", warm.textures["image"].file.replace("small", "other"))
    assert compiled(lambda: picture(other)) == 0
    assert not np.array_equal(picture(other), picture(warm))


def test_an_effect_less_does_compile(warm: vr.Scene) -> None:
    """The count above can fail."""
    assert compiled(lambda: picture(vr.replaced(warm, "camera.aperture", 0.0))) >= 1


# Scenes that are wrong

NAN = float("nan")
WRONG = {
    "materials.glass.ior": (0.0, -1.0, 1e-3, 101.0, NAN, "glass"),
    "materials.glass.dmax": (0.0, -1.0, NAN, float("inf")),
    "materials.glass.kt": ((1.5, 0.0, 0.0), (0.0, -0.1, 0.0), (NAN, 0.0, 0.0), 1.5, "clera"),
    "materials.glass.kr": ((0.0, 0.0, 1.0001), (0.0, 0.0)),
    "lights.pane.samples": (0, -1, 2**16 + 1, 1.5),
    "lights.pane.height": ((2.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    "lights.disk.radius": (0.0, -1.0, NAN),
    "lights.disk.normal": ((0.0, 0.0, 0.0),),
    "lights.globe.radius": (0.0,),
    "lights.sun.direction": ((0.0, 0.0, 0.0), (NAN, 0.0, 1.0)),
    "lights.sun.b": (1.0,),
    "lights.spot.angle": (0.0, 180.1, NAN),
    "lights.spot.exponent": (-1.0,),
    "settings.depth": (1001, -1, 2.5),
    "settings.scatter.rays": (-1, 2**16 + 1),
    "settings.scatter.depth": (1001, -1),
    "settings.occlusion.sky": (-1, 0.5),
    "settings.occlusion.near": (2**17,),
    "settings.occlusion.distance": (0.0, -2.0, NAN),
    "settings.occlusion.hemisphere": ("sphere",),
    "settings.misses": ("nothing",),
    "settings.local": ("half",),
    "settings.area": ("middle",),
    "camera.aperture": (-0.1, NAN, 1e10),
    "camera.focus": (-1.0, NAN),
    "materials.box.texture": ("imag",),
    "textures.image.filter": ("cubic",),
    "textures.image.file": ("no such file.png",),
}


def in_place(raw: Any, address: str, value: Any) -> None:
    *way, last = address.split(".")
    for key in way:
        raw = raw[key]
    raw[last] = value


@pytest.mark.parametrize("address", WRONG)
def test_what_is_wrong_gets_a_line_that_names_it(
    address: str, full: vr.Scene, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    """In Python, in a file and on the command line: the address, and never a traceback."""
    path = folder(full) / "wrong.json"
    for value in WRONG[address]:
        raw = json.loads(vr.dump(full, path.parent))
        in_place(raw, address, value)
        path.write_text(json.dumps(raw))
        with pytest.raises(vr.UserError) as caught:
            # What a file names is looked for as it is rendered.
            vr.render(vr.load(path), progress=False)
        assert len(caught.value.lines) == 1 and address in caught.value.lines[0], caught.value.lines
        assert main(["render", str(path), "-o", str(tmp_path / "out.png"), "--quiet"]) == 2
        out, err = capsys.readouterr()
        assert out == "" and err == f"visray: {caught.value.lines[0]}\n"
        with pytest.raises(vr.UserError, match=address.split(".")[-1]):
            vr.render(vr.replaced(full, address, value), progress=False)
    assert not (tmp_path / "out.png").exists()


def test_several_wrong_things_get_a_line_each(full: vr.Scene) -> None:
    raw = asdict(full)
    wrong = {"materials.glass.ior": 0.0, "lights.pane.samples": 0, "settings.depth": -1, "camera.aperture": -1.0}
    for address, value in wrong.items():
        in_place(raw, address, value)
    path = folder(full) / "wrong.json"
    path.write_text(json.dumps(raw))
    with pytest.raises(vr.UserError) as caught:
        vr.load(path)
    assert len(caught.value.lines) == len(wrong)
    for address in wrong:
        assert sum(address in line for line in caught.value.lines) == 1


# Numbers that are none are an error of the program, which names the pixel and what it shows


@pytest.mark.parametrize("value", [NAN, float("inf"), -float("inf")])
def test_a_pixel_that_is_not_a_number_is_named_with_its_object(value: float, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = vr.Scene(
        camera=vr.Camera(origin=(0.0, 0.0, 5.0), target=(0.0, 0.0, 0.0)), film=vr.Film(width=21, height=15),
        objects={"far": vr.Sphere(center=(9.0, 9.0, 0.0)), "ball": vr.Sphere()}, settings=vr.Settings(spp=2), lights={},
    )  # fmt: skip
    once = passes.exposed_once

    def spoilt(*pixels: tuple[int, int]) -> Callable:
        def exposed(made: Any, *rest: Any) -> Any:
            film = once(made, *rest)
            mean = np.array(film.moments.mean)
            for x, y in pixels:
                mean[1, np.flatnonzero(made.order == y * 21 + x)[0]] = value
            return replace(film, moments=replace(film.moments, mean=made.a.W(mean)))

        return exposed

    monkeypatch.setattr(passes, "exposed_once", spoilt((10, 7)))
    with pytest.raises(vr.UserError) as caught:
        vr.render(scene, progress=False)
    assert str(caught.value).startswith("pixel 10, 7, which shows objects.ball: is not a number;")
    monkeypatch.setattr(passes, "exposed_once", spoilt((2, 1)))
    with pytest.raises(vr.UserError, match=r"^pixel 2, 1, which shows nothing: is not"):
        vr.render(scene, progress=False)
    monkeypatch.setattr(passes, "exposed_once", spoilt((10, 7), (11, 7), (3, 14)))
    with pytest.raises(vr.UserError, match="and 2 pixels more: is not a number;"):
        vr.render(scene, progress=False, layers=("RGB",))
    take = DualBuffer.run_pass

    def broken(h: DualBuffer, lanes: np.ndarray, targets: np.ndarray) -> None:
        take(h, lanes, targets)
        mean = np.array(h.film.moments.mean)
        mean[1, np.flatnonzero(made.order == 7 * 21 + 10)[0]] = value
        h.film = replace(h.film, moments=replace(h.film.moments, mean=h.prepared.a.W(mean)))

    made = prepare(scene)
    with monkeypatch.context() as patch:
        patch.setattr(DualBuffer, "run_pass", broken)
        with pytest.raises(vr.UserError, match=r"^pixel 10, 7, which shows objects.ball: is not a number;"):
            vr.render(scene, error=0.05, progress=False)
    # With every number sound, nothing is refused.
    monkeypatch.setattr(passes, "exposed_once", once)
    made = prepare(scene)
    check_numbers(made, np.array(expose(made)[0].mean))
