"""Black and empty pictures name their cause, other pictures have no note, and looking compiles nothing."""

import json
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import drjit as dr
import pytest
from light_samples import LIGHT_SAMPLES
from test_cli import said
from test_features import CASES, FULL, SCENES, folder  # noqa: F401 - the folder with a texture

import visray as vr
from visray import dark
from visray.dark import DarkWarning, dark_notes
from visray.dark.evidence import is_lit, may_be_unlit, shows_only_background
from visray.lights import KINDS, DirectionalLight, PointLight, SpotLight
from visray.materials import Material
from visray.passes import expose
from visray.picture_layers import developed
from visray.primitives import Plane, Polynomial, Sphere
from visray.primitives.clips import Ball
from visray.scene.load import load
from visray.scene.scene import Film, Scene, Settings
from visray.setup import prepare

BLACK = (0.0, 0.0, 0.0)
SUN = PointLight(position=(4, 6, 5))
SHOW = Scene(
    camera=vr.Camera(origin=(0, 2, 8), target=(0, 1, 0), fov=35.0),
    film=Film(width=48, height=30),
    background=(0.5, 0.7, 1.0),
    ambient=BLACK,
    materials={
        "matte": Material(kd=(0.6, 0.6, 0.6)),
        "red": Material(kd=(0.8, 0.1, 0.1), ks=(0.5, 0.5, 0.5)),
        "mirror": Material(kr=(0.9, 0.9, 0.9)),
        "glass": Material(kt=(0.95, 0.95, 0.95)),
        "black": Material(kd=BLACK),
    },
    lights={"sun": SUN},
    objects={
        "floor": Plane(material="matte"),
        "a": Sphere(center=(-2, 1, 0), material="red"),
        "b": Sphere(center=(0, 1, 0), material="mirror"),
        "c": Sphere(center=(2, 1, 1), material="glass"),
    },
    settings=Settings(spp=2),
)
Change = Callable[[Scene], Scene]


def lamp(light: Any) -> Change:
    return lambda s: replace(s, lights={"sun": light})


def seen(**camera: Any) -> Change:
    return lambda s: replace(s, camera=replace(s.camera, **camera))


def things(*names: str, **more: Any) -> Change:
    """Only these objects of the scene, and others."""
    return lambda s: replace(s, objects={name: s.objects[name] for name in names} | more)


def fields(**values: Any) -> Change:
    return lambda s: replace(s, **values)


def changed(*changes: Change) -> Scene:
    scene = SHOW
    for change in changes:
        scene = change(scene)
    return scene


NIGHT, OUTSIDE = fields(background=BLACK), things("a", "b", "c")
SHELL = Polynomial(expression="x^2 + y^2 + z^2 - 100", clip=Ball(radius=11))
WALL = Plane(point=(0, 0, -4), normal=(0, 0, 1))
SLAB = vr.Rectangle(width=(9, 0, 0), height=(0, 0, -9), material="matte")
ROOF = vr.Rectangle(center=(0, 20, 0), width=(60, 0, 0), height=(0, 0, 60))
# Causes: what is changed in a scene that is fine, and what the note must contain.
CAUSES: dict[str, tuple[list[Change], list[str]]] = {
    "light inside a ball": ([lamp(replace(SUN, position=(0, 1, 0)))], ["lights.sun lies inside objects.b", "move it"]),
    "light under the floor": ([lamp(replace(SUN, position=(4, -6, 5)))], ["lights.sun is behind objects.floor"]),
    "sun from below": ([lamp(DirectionalLight(direction=(0, 1, 0.1)))], ["lights.sun is behind objects.floor"]),
    "spot turned away": ([lamp(SpotLight(position=(4, 6, 5), direction=(0, 1, 0)))],
                         ["lights.sun points past all that is seen", "direction = [-"]),
    "attenuated": ([lamp(replace(SUN, c=1e7))], ["lights.sun is attenuated to ", "lower its a, b or c"]),
    "nearly black": ([lamp(replace(SUN, intensity=1e-6)), NIGHT],
                     ["the picture is black", "lights.sun has intensity 1e-06"]),
    "intensity 0": ([lamp(replace(SUN, intensity=0.0))], ["lights.sun has intensity 0"]),
    "no colours": ([lamp(replace(SUN, Id=BLACK, Is=BLACK))], ["lights.sun has neither Id nor Is"]),
    "no light": ([fields(lights={})], ["the scene has no lights, and ambient is black"]),
    "no light at night": ([fields(lights={}), NIGHT], ["the picture is black: the scene has no lights"]),
    "black things": ([things(a=Sphere(material="black"))], ["materials.black has neither kd nor ks"]),
    "black beside others": ([things(a=Sphere(material="black"), far=Sphere(center=(0, 0, 99), material="red"))],
                            ["lights.sun arrives, but materials.black reflects none of it"]),
    "only ambient": ([lamp(replace(SUN, position=(0, 1, 0))), fields(ambient=(1.0, 1.0, 1.0))],
                     ["no light shines on what is seen: lights.sun lies inside objects.b"]),
    "camera in a mirror ball": ([seen(origin=(0, 1, 0), target=(1, 1, 1))],
                                ["camera.origin lies inside or behind objects.b"]),
    "camera in an opaque ball": ([seen(origin=(-2, 1, 0), target=(1, 1, 1))],
                                 ["camera.origin lies inside or behind objects.a"]),
    "camera in a polynomial": ([lamp(replace(SUN, position=(9, 16, 9))), things(shell=SHELL)],
                               ["camera.origin lies inside or behind objects.shell"]),
    "behind a wall": ([lamp(replace(SUN, position=(0, 3, -9))), things("a", wall=WALL)],
                      ["lights.sun is behind all surfaces that are seen, such as objects.wall"]),
    "hidden by a roof": ([lamp(replace(SUN, position=(0, 30, 0))), things("a", slab=SLAB, roof=ROOF)],
                         ["lights.sun is hidden by objects.roof"]),
    "all behind": ([OUTSIDE, seen(target=(0, 2, 20))], ["nothing is seen: all objects are behind the camera",
                                                        "camera.target = [0, 1, 0.3333]"]),
    "all beside": ([OUTSIDE, seen(target=(20, 2, 0))], ["all objects are beside the picture", "degrees off the view"]),
    "past a floor": ([things("floor"), seen(target=(0, 9, 0))], ["the camera looks past objects.floor"]),
    "past a ball on a floor": ([things("floor", "a"), seen(target=(0, 9, 0))],
                               ["the camera looks past objects.a; camera.target = [-2, 1, 0] looks at it"]),
    "too small": ([things(a=Sphere(center=(0.0013, 1.003, 0), radius=1e-3))], ["objects.a is only ", "pixels wide"]),
    "no objects": ([things()], ["the scene has no objects"]),
    "a polynomial beyond its clip": ([things(p=Polynomial(expression="x^2 + y^2 + z^2 - 36"))],
                                     ["rays pass objects.p", "without meeting its surface"]),
}  # fmt: skip


def notes_of(scene: Scene) -> list[str]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        prepared = prepare(scene)
        layers, _ = developed(prepared, expose(prepared)[0])
        return dark_notes(prepared, layers["RGB"], layers["A"])


@pytest.mark.parametrize("case", CAUSES)
def test_the_cause_is_named(case: str) -> None:
    changes, parts = CAUSES[case]
    (note,) = notes_of(changed(*changes))
    assert all(part in note for part in parts), note
    assert "\n" not in note


@pytest.mark.parametrize("case", ["all behind", "all beside"])
def test_the_advice_helps(case: str) -> None:
    """The target that the note gives shows the objects."""
    scene = changed(*CAUSES[case][0])
    (note,) = notes_of(scene)
    target = tuple(json.loads(note[note.index("camera.target = ") + 16 :].split("]")[0] + "]"))
    assert not notes_of(replace(scene, camera=replace(scene.camera, target=target)))


def test_the_direction_that_is_advised_lights_the_scene() -> None:
    scene = changed(*CAUSES["spot turned away"][0])
    (note,) = notes_of(scene)
    direction = tuple(json.loads(note[note.index("direction = ") + 12 :].split("]")[0] + "]"))
    assert not notes_of(lamp(replace(scene.lights["sun"], direction=direction))(scene))


@pytest.mark.parametrize("kind", KINDS, ids=lambda k: k.__name__)
def test_each_kind_of_light_is_seen_or_missed(kind: type) -> None:
    """Above the floor there is no note; inside a ball, or from below, there is one."""
    sample = LIGHT_SAMPLES[kind.__name__]
    assert not notes_of(changed(lamp(sample.above((0.0, 6.0, 4.0), 0.5))))
    wrong = replace(sample.above((0.0, 1.0, 0.0), 0.5), **({} if kind.has_position else {"direction": (0.0, 1.0, 0.0)}))
    (note,) = notes_of(changed(lamp(wrong)))
    assert ("lies inside objects.b" if kind.has_position else "is behind objects.floor") in note


@pytest.mark.parametrize(
    "changes",
    [
        [],
        [NIGHT],
        [fields(ambient=(1.0, 1.0, 1.0))],
        [fields(film=Film(width=48, height=30, transparent=True))],
        [things("b"), fields(lights={})],  # a mirror that shows the background
        [fields(lights={}, ambient=(1.0, 1.0, 1.0))],
        [fields(settings=Settings(spp=1, shading="normal"))],
        [fields(lights={}, settings=Settings(spp=1, scatter=vr.Scatter(rays=2)))],
    ],
)
def test_pictures_that_are_fine_have_no_note(changes: list[Change]) -> None:
    assert not notes_of(changed(*changes))


@pytest.mark.slow
@pytest.mark.parametrize("path", SCENES, ids=lambda p: p.stem)
def test_no_scene_has_a_note(path: Path) -> None:
    scene = load(path)
    scene = replace(scene, film=replace(scene.film, width=48, height=32), settings=replace(scene.settings, spp=1))
    assert not notes_of(scene)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_evidence_of_light_is_never_wrong(case: str) -> None:
    """Where the colours say that a scene is not unlit, samples without all else show light."""
    scene = CASES[case][0](FULL)
    prepared = prepare(scene)
    rgb = developed(prepared, expose(prepared)[0])[0]["RGB"]
    assert not scene.objects or may_be_unlit(prepared, rgb) or is_lit(prepared)


def test_the_background_is_recognised_and_nothing_else_is_taken_for_it() -> None:
    for scene in (changed(OUTSIDE, seen(target=(0, 2, 20))), changed(OUTSIDE)):
        for sky in (scene.background, vr.SkyGradient(top=(0.2, 0.4, 0.9), bottom=(1.0, 0.9, 0.8))):
            prepared = prepare(replace(scene, background=sky))
            rgb = developed(prepared, expose(prepared)[0])[0]["RGB"]
            assert shows_only_background(prepared, rgb) == (scene.camera.target == (0, 2, 20))


def test_looking_compiles_no_kernel_of_the_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples without ambient light and background are those of the same kernel, and they are taken once."""
    scene = changed(fields(background=vr.SkyGradient(top=(0.2, 0.4, 0.9), bottom=(1.0, 0.9, 0.8))))
    prepared, looks = prepare(scene), []
    expose(prepared)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        assert is_lit(prepared)
        history = dr.kernel_history([dr.KernelType.JIT])
    assert max(history, key=lambda k: k["operation_count"])["cache_hit"]
    monkeypatch.setattr(dark, "is_lit", lambda *_: looks.append(1) or True)
    vr.render(prepared, layers=("RGB",), progress=False)
    moved = prepared.updated({"objects.a.center.1": 1.1})
    vr.render(moved, layers=("RGB",), progress=False)
    assert len(looks) == 1


def test_pictures_warn_after_their_first_pass() -> None:
    scene = changed(*CAUSES["no light at night"][0])
    with pytest.warns(DarkWarning, match="the picture is black: the scene has no lights"):
        image = vr.render(scene, layers=("RGB",), progress=False)
    assert not image["RGB"].any()
    with pytest.warns(DarkWarning, match="the scene has no lights"):
        vr.render(scene, error=0.5, layers=("RGB",), progress=False)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        vr.render(scene, layers=("RGB",), progress=False)
        vr.render(scene, error=0.5, layers=("RGB",), progress=False)
    assert {w.filename for w in caught if w.category is DarkWarning} == {__file__}


def test_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    path, out = tmp_path / "s.json", str(tmp_path / "a.png")
    path.write_text(vr.dump(changed(*CAUSES["light inside a ball"][0])))
    code, _, err = said(capsys, "render", str(path), "-o", out)
    line = "no light shines on what is seen: lights.sun lies inside objects.b, which lets no light out; move it"
    assert code == 0 and err.splitlines() == [f"visray: note: {line}"]
    code, text, _ = said(capsys, "render", str(path), "-o", out, "--json")
    assert code == 0 and json.loads(text)["notes"] == [line]
    path.write_text(vr.dump(SHOW))
    assert json.loads(said(capsys, "render", str(path), "-o", out, "--json")[1])["notes"] == []
