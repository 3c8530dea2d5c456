"""The button that fits clip, camera and lights to a surface, and command lines of surfaces that were changed."""

import shlex
import warnings
from pathlib import Path
from typing import Any

import pytest

import visray as vr
from visray.cli import main
from visray.errors import UserError
from visray.live.reproducing import Seen, Wish
from visray.live.surface_line import surface_line
from visray.scene.address import changed
from visray.surface_picture.picture import Wishes
from visray.surface_picture.recipe import Recipe, fitted_values, recipe_of

FORMULA = "x^2 + y^2 - z^2 - a"
A = "objects.surface.parameters.a"
TURNED = vr.Camera(origin=(3.1, 1.3, 4.7), target=(0, 0.1 + 0.2, 0), fov=28)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def scene_of(line: str) -> vr.Scene:
    """The scene that a command line renders."""
    words = shlex.split(line)
    assert words[:2] == ["visray", "surface"]
    end = words.index("--") if "--" in words else len(words)
    assert main([*words[1:end], "--save", "made.json", "--quiet", *words[end:]]) == 0
    return vr.load("made.json")


def seen(scene: vr.Scene, edits: dict[str, Any], camera: Any = None) -> Seen:
    scene = changed(scene, edits)
    return Seen(scene, tuple(edits), None, camera or scene.camera, camera is None)


LINES = {
    "as it was": (Recipe(FORMULA, {"a": 0.5}, Wishes((48, 32))), {}, None),
    "slider": (Recipe(FORMULA, {"a": 0.5}, Wishes((48, 32))), {A: -0.9}, None),
    "turned": (Recipe(FORMULA, {"a": 0.5}, Wishes((48, 32))), {A: -0.9, "lights.key.samples": 1}, TURNED),
    "known": (Recipe("kummer", {}, Wishes((48, 32))), {"objects.surface.parameters": {"mu": 1.4}}, None),
    "all options": (
        Recipe(FORMULA, {}, Wishes((48, 32), 3.0, (1, 1, 1), (0.1, 0.5, 0.2), (0, 0, 1)), ("lights.key.samples=2",)),
        {"objects.surface.clip.radius": 2.5, "materials.outside.kd": (0.5, 0.1, 0.1)},
        None,
    ),
    "minus": (Recipe("-x^2 - y^2 + z^2 + a", {"a": 0.5}, Wishes((48, 32))), {A: 0.7}, None),
}


@pytest.mark.parametrize("case", LINES)
def test_the_command_line_makes_the_same_scene(case: str) -> None:
    recipe, edits, camera = LINES[case]
    now = seen(recipe.picture()[0], edits, camera)
    line = surface_line(recipe, now, Wish(spp=1), ["a.png"])
    assert scene_of(line).hash() == now.as_file().hash() and Path("a.png").exists()


def test_a_fitted_surface_has_a_short_command_line() -> None:
    recipe = Recipe(FORMULA, {"a": 0.5})
    scene = recipe.picture()[0]
    bent = changed(scene, {A: -0.9})
    values = fitted_values(bent, recipe.with_values({"a": -0.9}, (640, 640)).picture()[0])
    fitted = changed(bent, values)
    assert fitted.hash() == vr.surface_scene(FORMULA, {"a": -0.9}).hash() != bent.hash()
    now = Seen(fitted, (A, *values), None, fitted.camera, True)
    assert surface_line(recipe, now, Wish()) == f"visray surface '{FORMULA}' --param a=-0.9"


def test_another_size_is_a_picture_of_the_same_camera() -> None:
    now = seen(vr.surface_scene(FORMULA, {"a": 0.5}, size=(48, 32)), {}, TURNED)
    line = surface_line(recipe_of(now.scene), now, Wish((32, 48), spp=1), ["a.png"])
    made = scene_of(line)
    assert (made.film.width, made.film.height) == (32, 48) and made.camera == TURNED


def test_what_no_command_makes_is_said() -> None:
    recipe = Recipe(FORMULA, {"a": 0.5}, Wishes((48, 32)))
    scene = recipe.picture()[0]
    more = vr.Scene(**{**{k: getattr(scene, k) for k in ("camera", "film", "lights", "materials", "background")},
                       "objects": {**scene.objects, "ball": vr.Sphere(material="outside")}})  # fmt: skip
    with pytest.raises(UserError, match="no command line makes this scene; download it"):
        surface_line(recipe, seen(more, {}), Wish())


def test_only_pictures_of_surfaces_have_a_recipe() -> None:
    assert recipe_of(vr.Scene(camera=vr.Camera(), lights={})) is None
    assert recipe_of(vr.surface_scene("heart")) == Recipe("heart")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert recipe_of(vr.surface_scene("xy = a", size=(8, 9))).parameters == {"a": 1.0}


def test_a_page_fits_the_surface() -> None:
    pytest.importorskip("viser")
    from page import Page, eventually
    from page_widgets import look_from, press, told

    recipe = Recipe(FORMULA, {"a": 0.5}, Wishes((64, 64)))
    from visray.live.view import started

    with started(recipe.picture()[0], name="surface", host="127.0.0.1", port=None, error=0.2, recipe=recipe) as shown:
        engine = shown.live.engine
        first, second = Page(shown.url), Page(shown.url)
        look_from(first, shown.live, (0.0, 0.0, 4.5))
        look_from(second, shown.live, (0.0, 4.5, 0.5))
        eventually(lambda: sum(not c.at_home for c in shown.live.clients.values()) == 2)
        engine.assign({A: -0.9})
        eventually(lambda: engine.edits)
        press(first, "Fit to the surface")
        expected = vr.surface_scene(FORMULA, {"a": -0.9}, size=(64, 64))
        eventually(lambda: engine.scene == expected)
        eventually(lambda: sorted(c.at_home for c in shown.live.clients.values()) == [False, True])
        press(first, "Command line")
        eventually(lambda: "--param a=-0.9 --size 64x64 --error 0.01 -o surface.png" in first.html())
        # With other values, the surface has no points.
        engine.assign({"objects.surface.expression": "x^2 + y^2 + z^2 - a"})
        eventually(lambda: "objects.surface.expression" in engine.edits)
        press(first, "Fit to the surface")
        eventually(lambda: "shows nothing" in told(first))
        first.close()
        second.close()
