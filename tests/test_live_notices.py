"""What the page of a live picture says beside the picture: what is changed, where the camera is, how far a measurement
is. And what words find, and what a window of another shape shows."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from live_support import small_scene

import visray as vr
from visray.live.effects import progress_text
from visray.live.frame import Frame
from visray.live.looks import color_word
from visray.live.lost import behind_plane, has_edges, void_note
from visray.live.notices import changed_addresses, changes_text
from visray.live.reshaping import reshaped
from visray.live.search import Controls, search
from visray.scene.address import changed
from visray.scene.check import checked
from visray.setup import prepare

HOSTILE = "<img src=x>"
RAISED = [vr.Translate(translate=(0.0, 0.5, 0.0))]
SCENE = checked(small_scene(film=vr.Film(width=64, height=48)))


def frame_of(ball: float, size: tuple[int, int], grain: int = 1) -> Frame:
    """A picture of a white ball in its middle. ball: its radius, in pixels"""
    x, y = ((np.arange(-(-n // grain)) + 0.5) * grain - n / 2 for n in size)
    white = np.hypot(x[None], y[:, None]) < ball
    return Frame(np.repeat(255 * white[..., None], 3, 2).astype(np.uint8), size, grain, 1.0, None, False)


@pytest.mark.parametrize("grain", [1, 2])
@pytest.mark.parametrize("window, scale", [
    ((320, 180), 1),
    ((400, 180), 1),
    # Narrower than the film: all of its width is shown, so the ball gets smaller.
    ((240, 180), 0.75),
    ((90, 180), 90 / 320),
])  # fmt: skip
def test_a_ball_stays_round_in_any_window(window, scale, grain):
    given = frame_of(70, (320, 180), grain)
    made = reshaped(given, window, (320, 180))
    assert made.size[0] / made.size[1] == pytest.approx(window[0] / window[1], rel=0.01)
    # In pixels of the window.
    pixel = made.grain * window[1] / made.size[1]
    white = made.rgb[..., 0] > 127
    across, down = white.any(0).sum() * pixel, white.any(1).sum() * pixel
    assert across == pytest.approx(140 * scale, abs=3 * pixel) and down == pytest.approx(140 * scale, abs=3 * pixel)
    assert (made is given) == (window == (320, 180))


def test_a_window_that_is_wider_than_its_picture_goes_on_with_its_edges():
    given = frame_of(400, (320, 180))
    assert reshaped(given, (720, 180), (320, 180)).rgb.min() == 255


@pytest.mark.parametrize("plane, origin, said", [
    (vr.Plane(), (0.0, -0.1, 5.0), "The camera is under objects.floor"),
    (vr.Plane(normal=(0.0, -1.0, 0.0)), (0.0, -0.1, 5.0), "The camera is under objects.floor"),
    (vr.Plane(transform=RAISED), (0.0, 0.4, 5.0), "The camera is under objects.floor"),
    (vr.Plane(point=(0.0, 9.0, 0.0)), (0.0, 9.5, 5.0), "The camera is above objects.floor"),
    (vr.Plane(point=(0.0, 0.0, -3.0), normal=(0.0, 0.0, 1.0)), (0.0, 1.0, -4.0), "The camera is behind objects.floor"),
    (vr.Plane(), (3.0, 0.1, -7.0), ""),
])  # fmt: skip
def test_a_camera_that_has_crossed_a_plane(plane, origin, said):
    scene = checked(small_scene(objects={"floor": plane, "ball": vr.Sphere()}))
    assert behind_plane(scene, replace(scene.camera, origin=origin), scene.camera) == said
    assert behind_plane(scene, scene.camera, scene.camera) == ""


def test_a_picture_without_edges():
    assert not has_edges(np.full((500, 900, 3), 77, np.uint8))
    sky = np.broadcast_to(np.linspace(0, 255, 480)[:, None, None], (480, 640, 3)).astype(np.uint8)
    assert not has_edges(sky) and not has_edges(np.zeros((1, 1, 3), np.uint8))
    assert has_edges(frame_of(30, (400, 300)).rgb)


@pytest.mark.parametrize("origin, target, said", [
    ((0.0, 0.6, 0.1), (0.0, 0.6, 0.0), "The camera is inside objects.ball, or behind it"),
    ((0.0, 3.0, 5.0), (0.0, 9.0, 9.0), "Nothing is seen: the camera looks past objects.ball; camera.target"),
    ((0.0, 1.0, 5.0), (0.0, 0.5, 0.0), ""),
])  # fmt: skip
def test_why_a_picture_shows_nothing(origin, target, said):
    note = void_note(prepare(replace(SCENE, camera=vr.Camera(origin=origin, target=target))))
    assert note.startswith(said) and bool(note) == bool(said)


def test_what_is_changed_is_said():
    assert changes_text((), []) == ""
    assert "switched off: shadows, specular" in changes_text(("shadows", "specular"), [])
    assert "3 values" in changes_text((), ["a.b", "a.c", "a.d"])
    text = changes_text((), [f"objects.{HOSTILE}.radius"])
    assert HOSTILE not in text and "&lt;img" in text
    edits = {"objects.ball.center.1": 2.0, "camera.fov": 30.0, "objects.ball.radius": 0.6}
    scene = changed(SCENE, edits)
    assert changed_addresses(SCENE, scene, tuple(edits)) == ["objects.ball.center.1", "camera.fov"]
    edits = {"objects.ball.center.1": 2.0, "objects.ball.center": (0.0, 1.0, 0.0)}
    assert changed_addresses(SCENE, changed(SCENE, edits), tuple(edits)) == ["objects.ball.center"]


def test_words_find_what_looks_so():
    materials = {"lacquer": vr.Material(kd=(0.66, 0.06, 0.05)), "moss": vr.Material(kd=(0.1, 0.4, 0.1))}
    scene = checked(small_scene(
        materials=materials, lights={"key": vr.PointLight(position=(3.0, 5.0, 4.0))},
        objects={"thing": vr.Sphere(material="lacquer"), "crate": vr.Box(material="moss")},
    ))  # fmt: skip
    controls = Controls(scene)
    found = [c.address for c in search(controls, "red ball", 30).controls]
    assert {"materials.lacquer.kd", "objects.thing.radius"} <= set(found)
    assert {a.split(".")[1] for a in found} == {"lacquer", "thing"}
    assert [c.address for c in search(controls, "lamp position", 9).controls] == ["lights.key.position"]
    # Addresses are found by their own words alone.
    assert search(controls, "objects.ball.radius", 9).controls == ()
    later = controls.with_scene(changed(scene, {"materials.lacquer.kd": (0.05, 0.05, 0.7)}))
    assert search(later, "red ball", 9).controls == () and search(later, "blue ball", 9).controls
    assert controls.names() == (
        "objects.thing", "objects.crate", "materials.lacquer", "materials.moss", "lights.key",
    )  # fmt: skip


@pytest.mark.parametrize("kd, word", [
    ((0.8, 0.8, 0.8), "white"), ((0.2, 0.2, 0.2), "grey gray"), ((0.0, 0.0, 0.0), "black dark"),
    ((0.8, 0.1, 0.05), "red"), ((0.05, 0.1, 0.6), "blue"), ((0.62, 0.42, 0.12), "orange gold"),
    ((0.1, 0.5, 0.1), "green"), ((0.8, 0.8, 0.1), "yellow gold"), ((0.2, 0.1, 0.03), "orange brown"),
])  # fmt: skip
def test_words_for_colours(kd, word):
    assert color_word(vr.Material(kd=kd)) == word


def test_how_far_a_measurement_is():
    measurement = SimpleNamespace(effects=list("abcd"), number=0, doing="compiling", share_done=0.0)
    assert ">compiling<" in progress_text(measurement, [], 5.0)
    measurement = SimpleNamespace(effects=list("abcd"), number=2, doing="measuring b", share_done=0.25)
    assert "effect 2 of 4: measuring b; about 27 s left" in progress_text(measurement, [10.0, 20.0], 23.0)
    # An effect that takes longer than those before.
    assert "about 1 s left" in progress_text(measurement, [10.0, 20.0], 99.0)
    assert "about 5 min left" in progress_text(measurement, [0.0, 100.0], 105.0)


def test_a_page_says_where_it_is_and_what_others_have_changed():
    pytest.importorskip("viser")
    from page import Page, eventually
    from page_widgets import look_from, press, value_of

    with vr.view(SCENE, error=0.5) as shown:
        live = shown.live
        panel = next(part for part in live.parts if hasattr(part, "focus_on"))
        page = Page(shown.url)
        client = look_from(page, live, (0.0, -2.0, 3.0))
        eventually(lambda: "The camera is under objects.floor" in page.html())
        eventually(lambda: value_of(page, "Back to the scene's view", "disabled") is False)
        live.engine.assign({"objects.ball.radius": 0.4})
        live.engine.leave_out(("shadows",))
        eventually(lambda: "switched off: shadows" in page.html() and "changed: objects.ball.radius" in page.html())
        press(page, "Back to the scene's view")
        eventually(lambda: client.at_home and "under objects.floor" not in page.html())
        eventually(lambda: value_of(page, "Back to the scene's view", "disabled"))
        panel.text.value = "ball"
        eventually(lambda: "with ball" in panel.head.content)
        # One who comes later, too, is told; one who comes alone does not find what others searched for.
        second = Page(shown.url)
        second.look()
        eventually(lambda: len(live.clients) == 2)
        eventually(lambda: "switched off: shadows" in second.html())
        assert panel.text.value == "ball"
        page.close()
        second.close()
        eventually(lambda: not live.clients)
        third = Page(shown.url)
        third.look()
        eventually(lambda: panel.text.value == "" and "of the scene" in panel.head.content)
        live.engine.leave_out(())
        live.engine.assign({"objects.ball.radius": 0.6})
        eventually(lambda: "switched off" not in third.html() and "changed:" not in third.html())
        third.close()


def test_a_void_is_explained_in_the_page():
    pytest.importorskip("viser")
    from page import Page, eventually
    from page_widgets import look_from

    with vr.view(SCENE, error=0.5) as shown:
        page, live = Page(shown.url), shown.live
        inside = live.space.to_page((0.0, 0.6, 0.0))
        client = look_from(page, live, (0.0, 0.5, 4.0))
        page.look(position=inside, look_at=(0.0, 0.0, -3.0))
        eventually(lambda: "inside objects.ball" in page.html())
        client.go_home()
        eventually(lambda: "inside objects.ball" not in page.html())
        page.close()


def test_the_first_picture_waits_for_the_window_without_the_panel():
    pytest.importorskip("viser")
    from page import Page, eventually

    from visray.live.viewpoint import pose_of

    with vr.view(SCENE, error=0.5) as shown:
        page, home = Page(shown.url, answers=False), pose_of(SCENE.camera, shown.live.space)
        page.look(home.position, home.look_at, window=(160, 90))
        client = eventually(lambda: next(iter(shown.live.clients.values()), None))
        eventually(lambda: client.frame is not None)
        assert not page.pictures
        page.answers = True
        page.look(home.position, home.look_at, window=(90, 90))
        for message in page.of("LocalStorageGetItemRequestMessage"):
            uuid = message["request_uuid"]
            page.send("LocalStorageGetItemResponseMessage", value=None, error=None, request_uuid=uuid)
        eventually(lambda: page.pictures)
        assert all(x.shape[0] == x.shape[1] for x in page.pictures)
        page.close()


def test_a_browser_assigns_with_enter_and_goes_to_the_story():
    pytest.importorskip("viser")
    from browser import chromium, page_of
    from page import eventually

    with chromium() as browser, vr.view(SCENE, error=0.5, name="balls") as shown:
        page = page_of(browser, shown.url, 800, 480)
        box = page.locator("input:visible").first
        box.click()
        page.keyboard.type("materials.red.kd = 0.1, 0.6, 0.1")
        page.keyboard.press("Enter")
        eventually(lambda: shown.live.engine.scene.materials["red"].kd == (0.1, 0.6, 0.1))
        width, height = next(iter(shown.live.clients.values())).window
        page.mouse.click(width // 2, height // 2)
        page.get_by_role("button", name="Pixel: why objects.ball looks so").click()
        page.wait_for_selector("text=all numbers")
        assert page.get_by_role("tab", name="Pixel").get_attribute("aria-selected") == "true"


def test_a_picture_of_the_old_shape_is_sent_again(monkeypatch):
    pytest.importorskip("viser")
    from page import Page, eventually

    from visray.live.viewpoint import pose_of

    with vr.view(SCENE, error=0.5) as shown:
        page, home = Page(shown.url), pose_of(SCENE.camera, shown.live.space)
        page.look(home.position, home.look_at, window=(160, 90))
        client = eventually(lambda: next(iter(shown.live.clients.values()), None))
        eventually(lambda: page.pictures and client.sender.is_idle)
        assert math.isclose(page.pictures[-1].shape[1] / page.pictures[-1].shape[0], 160 / 90, rel_tol=0.02)
        # No other picture comes.
        monkeypatch.setattr(client.viewer, "look", lambda **more: None)
        page.look(home.position, home.look_at, window=(60, 90))
        eventually(lambda: page.pictures[-1].shape[0] > page.pictures[-1].shape[1])
        height, width, _ = page.pictures[-1].shape
        assert math.isclose(width / height, 60 / 90, rel_tol=0.05)
        page.close()
