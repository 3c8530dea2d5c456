"""The live picture in a real browser."""

import math
from dataclasses import replace

import numpy as np
import pytest
from browser import chromium, drag, page_of, seen

import visray as vr

pytest.importorskip("viser")
from page import eventually

SCENE = vr.Scene(
    camera=vr.Camera(origin=(0.0, 1.5, 7.0), target=(0.0, 0.5, 0.0), fov=35.0),
    film=vr.Film(width=64, height=48),
    background=(0.2, 0.3, 0.5),
    ambient=(0.5, 0.5, 0.5),
    materials={
        "red": vr.Material(kd=(0.8, 0.05, 0.05)),
        "green": vr.Material(kd=(0.05, 0.6, 0.05)),
        "grey": vr.Material(kd=(0.5, 0.5, 0.5)),
    },
    lights={"key": vr.PointLight(position=(4.0, 6.0, 5.0)), "back": vr.PointLight(position=(0.0, 2.0, -9.0))},
    objects={
        "floor": vr.Plane(material="grey"),
        "left": vr.Sphere(center=(-1.2, 0.8, 0.0), radius=0.8, material="red"),
        "right": vr.Sphere(center=(0.6, 0.5, 1.0), radius=0.5, material="green"),
    },
)


@pytest.fixture(scope="module")
def browser():
    with chromium() as browser:
        yield browser


@pytest.fixture
def shown(browser):
    with vr.view(SCENE, error=0.02, name="balls") as shown:
        yield shown
    for context in browser.contexts:
        context.close()


def client_of(shown):
    """The newest browser, as the server knows it."""
    return shown.live.clients[max(shown.live.clients)]


def settled(page, client):
    """Waits until the newest picture of a browser is as good as was asked for, and there."""
    page.wait_for_timeout(500)
    viewer = client.viewer
    eventually(lambda: viewer.shown == viewer.wanted and viewer.picture.finished and client.sender.is_idle)
    page.wait_for_timeout(300)


def screen(client, point):
    """Where a browser shows a point of the scene, in pixels from the top left."""
    camera, (width, height) = client.viewer.wanted
    forward = np.subtract(camera.target, camera.origin) / math.dist(camera.target, camera.origin)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    away = np.subtract(point, camera.origin)
    scale = height / 2 / math.tan(math.radians(camera.fov) / 2) / (away @ forward)
    return round(width / 2 + scale * (away @ right)), round(height / 2 - scale * (away @ np.cross(right, forward)))


def rendered(client):
    """What a browser should show: its camera, widened to its window."""
    camera, size = client.viewer.wanted
    film = replace(SCENE.film, width=size[0], height=size[1])
    return vr.render(replace(SCENE, camera=camera, film=film), spp=32).display().astype(float)


def difference(a, b):
    """Mean difference of two pictures, in levels of 255."""
    return float(np.abs(a - b).mean())


def test_the_picture_turns_under_the_mouse(browser, shown):
    page = page_of(browser, shown.url, 480, 360)
    client = client_of(shown)
    settled(page, client)
    assert client.at_home and "balls" in page.inner_text("body")
    first = seen(page, client.window)
    assert difference(first, rendered(client)) < 2
    drag(page, (200, 250), (320, 270))
    settled(page, client)
    turned = seen(page, client.window)
    assert not client.at_home
    camera = client.camera
    assert math.isclose(math.dist(camera.origin, camera.target), math.dist(SCENE.camera.origin, SCENE.camera.target))
    np.testing.assert_allclose(camera.target, SCENE.camera.target, atol=1e-9)
    assert difference(turned, first) > 10
    assert difference(turned, rendered(client)) < 2


@pytest.mark.slow
def test_the_wheel_zooms(browser, shown):
    page = page_of(browser, shown.url, 800, 480)
    client = client_of(shown)
    page.mouse.move(200, 300)
    page.mouse.wheel(0, -400)
    settled(page, client)
    far, near = (math.dist(c.origin, c.target) for c in (SCENE.camera, client.camera))
    assert near < 0.95 * far and client.camera.fov == SCENE.camera.fov
    assert difference(seen(page, client.window), rendered(client)) < 2


@pytest.mark.slow
def test_keys_fly(browser, shown):
    page = page_of(browser, shown.url, 800, 480)
    client = client_of(shown)
    page.mouse.click(320, 100)
    page.keyboard.down("w")
    page.wait_for_timeout(600)
    page.keyboard.up("w")
    page.wait_for_timeout(500)
    moved = np.subtract(client.camera.origin, SCENE.camera.origin)
    view = np.subtract(SCENE.camera.target, SCENE.camera.origin)
    assert moved @ view > 0.2 * np.linalg.norm(view)


@pytest.mark.slow
def test_a_click_tells_the_story(browser, shown):
    page = page_of(browser, shown.url, 1000, 600)
    client, picked = client_of(shown), []
    shown.live.on_pick(picked.append)
    page.get_by_role("tab", name="Pixel").click()
    x, y = screen(client, SCENE.objects["right"].center)
    page.mouse.click(x, y)
    page.wait_for_selector("text=all numbers")
    camera, (width, height) = client.viewer.wanted
    film = replace(SCENE.film, width=width, height=height)
    story = vr.why(replace(SCENE, film=film, camera=camera), x, y)
    assert story.surfaces[0].object == "objects.right"
    assert [p.address for p in picked] == ["objects.right"] and picked[0].pixel == (x, y)
    text = page.inner_text("body")
    assert "objects.right" in text and "it is behind the surface" in text and "lights.key" in text
    assert str(story).splitlines()[0] in page.text_content("body")
    page.get_by_role("button", name="Focus here").click()
    page.wait_for_selector("text=In focus")
    eventually(lambda: shown.live.engine.scene.camera.focus)
    camera = shown.live.engine.scene.camera
    forward = np.subtract(camera.target, camera.origin) / math.dist(camera.target, camera.origin)
    depth = np.subtract(story.surfaces[0].point, camera.origin) @ forward
    assert math.isclose(camera.focus, depth, rel_tol=1e-6) and camera.aperture > 0
    page.get_by_role("button", name="Turn around this point").click()
    page.wait_for_timeout(1000)
    np.testing.assert_allclose(client_of(shown).camera.target, story.surfaces[0].point, atol=1e-6)
    np.testing.assert_allclose(client_of(shown).camera.origin, camera.origin, atol=1e-6)
    # The background has no point.
    page.mouse.click(500, 60)
    page.wait_for_selector("b:text-is('the background')")
    assert not page.get_by_role("button", name="Focus here").is_visible()


@pytest.mark.slow
def test_two_browsers_and_one_that_leaves(browser, shown):
    one, two = page_of(browser, shown.url, 800, 480), page_of(browser, shown.url, 400, 300)
    first, second = (shown.live.clients[n] for n in sorted(shown.live.clients))
    settled(two, second)
    drag(one, (150, 250), (250, 260))
    settled(one, first)
    assert not first.at_home and second.at_home
    assert difference(seen(two, second.window), rendered(second)) < 2
    assert difference(seen(one, first.window), rendered(first)) < 2
    # It leaves while its picture turns.
    one.mouse.move(200, 300)
    one.mouse.down()
    one.mouse.move(250, 300)
    one.close()
    drag(two, (150, 150), (200, 160))
    settled(two, second)
    assert list(shown.live.clients.values()) == [second] and shown.live.engine.viewers == [second.viewer]
    assert difference(seen(two, second.window), rendered(second)) < 2


@pytest.mark.slow
def test_handles_drag_what_was_clicked(browser, shown):
    page = page_of(browser, shown.url, 1000, 600)
    client = client_of(shown)
    page.get_by_role("tab", name="Pixel").click()
    x, y = screen(client, SCENE.objects["right"].center)
    page.mouse.click(x, y)
    page.wait_for_selector("text=all numbers")
    page.get_by_text("Handles", exact=True).click()
    page.wait_for_timeout(1500)
    # The arrow along x.
    page.mouse.move(x + 50, y)
    page.wait_for_timeout(500)
    drag(page, (x + 50, y), (x + 110, y))
    page.wait_for_timeout(1500)
    center = shown.live.engine.scene.objects["right"].center
    assert center[0] > 0.9 and center[1:] == pytest.approx((0.5, 1.0), abs=1e-6)


@pytest.mark.slow
def test_a_phone(browser, shown):
    page = page_of(browser, shown.url, 390, 844)
    # The panel is folded, but for its title.
    assert page.get_by_text("balls · ✓").is_visible()
    assert not page.get_by_role("tab", name="Pixel").is_visible()
    client = client_of(shown)
    settled(page, client)
    camera = client.viewer.wanted[0]
    assert math.isclose(
        math.tan(math.radians(camera.fov) / 2) * 390 / 844,
        math.tan(math.radians(SCENE.camera.fov) / 2) * 64 / 48,
    )
    assert difference(seen(page, client.window), rendered(client)) < 2


@pytest.mark.slow
def test_names_are_no_html(browser):
    name = '<img src="x" onerror="alert(1)">'
    scene = replace(
        SCENE,
        objects={name: vr.Sphere(material=name)},
        materials={name: vr.Material()},
        lights={name: SCENE.lights["key"]},
    )
    with vr.view(scene, name=name, error=0.05) as shown:
        page = page_of(browser, shown.url, 1000, 600)
        client = client_of(shown)
        page.get_by_role("tab", name="Pixel").click()
        page.get_by_text("Handles", exact=True).click()
        page.mouse.click(*screen(client, (0.0, 0.0, 0.0)))
        page.wait_for_selector("text=all numbers")
        for tab in ("Scene", "Price", "Save", "Pixel"):
            page.get_by_role("tab", name=tab).click()
            page.wait_for_timeout(300)
        shown.live.engine.assign({f"objects.{name}.radius": -1.0})
        page.wait_for_selector("text=The scene has errors")
        assert page.locator("img[src=x]").count() == 0 and page.title() == f"{name} - visray"
        assert page.get_by_text(f"objects.{name}", exact=True).first.is_visible()
        page.context.close()
