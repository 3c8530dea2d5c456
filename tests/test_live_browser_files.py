"""Files of the live picture in a real browser: errors of the scene file are seen until they are mended, what is saved
arrives, and the price is shown."""

import json
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import chromium, drag, finished, page_of
from PIL import Image as Pillow

import visray as vr
from visray.cli import main
from visray.live.view import LiveView
from visray.scene.load import dump, load

pytest.importorskip("viser")
from page import eventually

HOSTILE = "<img src=x onerror=alert(1)>"
SCENE = vr.Scene(
    camera=vr.Camera(origin=(0.0, 1.5, 7.0), target=(0.0, 0.5, 0.0), fov=35.0),
    film=vr.Film(width=64, height=48),
    ambient=(0.5, 0.5, 0.5),
    materials={HOSTILE: vr.Material(kd=(0.8, 0.05, 0.05))},
    lights={"key": vr.PointLight(position=(4.0, 6.0, 5.0))},
    objects={
        "floor": vr.Plane(material=HOSTILE),
        "ball": vr.Sphere(center=(0.0, 0.8, 0.0), radius=0.8, material=HOSTILE),
    },
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as browser:
        yield browser


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = Path("balls.json")
    path.write_text(dump(SCENE))
    return path


@pytest.fixture
def shown(browser: Any, file: Path) -> Iterator[LiveView]:
    with vr.view(file, error=0.1) as shown:
        yield shown
    for context in browser.contexts:
        context.close()


def test_errors_of_the_file_are_seen_until_they_are_mended(browser: Any, shown: LiveView, file: Path) -> None:
    page = page_of(browser, shown.url)
    alerts = []
    page.on("dialog", lambda dialog: (alerts.append(dialog.message), dialog.dismiss()))
    good = file.read_text()
    raw = json.loads(good)
    raw["objects"]["ball"] |= {"radius": -1, HOSTILE: 2}
    file.write_text(json.dumps(raw))
    page.wait_for_selector("text=The scene has errors")
    text = page.locator("body").inner_text()
    assert "balls.json: objects.ball.radius" in text and HOSTILE in text
    file.unlink()
    page.wait_for_selector("text=has been deleted or renamed")
    raw["objects"]["ball"] = json.loads(good)["objects"]["ball"] | {"radius": 0.4}
    file.write_text(json.dumps(raw))
    page.wait_for_selector("text=balls.json has changed and was read again")
    page.wait_for_selector("text=The scene has errors", state="detached")
    finished(page)
    assert shown.live.engine.scene.objects["ball"].radius == 0.4 and alerts == []


@pytest.mark.slow
def test_what_is_saved_arrives(browser: Any, shown: LiveView, file: Path) -> None:
    """The scene, the picture, and the command line that makes the same picture again."""
    page = page_of(browser, shown.url)
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    drag(page, (200, 200), (300, 240))
    client = next(iter(shown.live.clients.values()))
    eventually(lambda: not client.at_home)
    finished(page)
    page.get_by_role("tab", name="Save").click()
    with page.expect_download() as download:
        page.get_by_role("button", name="Download the scene").click()
    Path("again.json").write_bytes(Path(download.value.path()).read_bytes())
    again = load("again.json")
    assert download.value.suggested_filename == "balls.json" and again.camera == client.camera != SCENE.camera
    page.locator("input[value='1 %']").fill("3 spp")
    page.locator("input[value='64x48']").fill("40x30")
    page.wait_for_timeout(500)
    with page.expect_download() as download:
        page.get_by_role("button", name="Make the picture").click()
    saved = np.array(Pillow.open(download.value.path()))
    assert download.value.suggested_filename == "balls.png"
    page.get_by_role("button", name="Command line").click()
    page.get_by_role("button", name="Copy").click()
    page.wait_for_timeout(300)
    words = shlex.split(page.evaluate("navigator.clipboard.readText()"))
    page.get_by_role("button", name="Close").click()
    assert words[:2] == ["visray", "render"] and "--spp" in words and main([*words[1:], "--quiet"]) == 0
    np.testing.assert_array_equal(np.array(Pillow.open("balls.png")), saved)
    np.testing.assert_array_equal(vr.render(again, size=(40, 30), spp=3, progress=False).display(), saved)


@pytest.mark.slow
def test_the_price_is_shown(browser: Any, shown: LiveView) -> None:
    """The error falls in the chart; an effect is switched off; costs are measured while the picture goes on."""
    page = page_of(browser, shown.url)
    page.get_by_role("tab", name="Price").click()
    page.wait_for_selector("text=/Error .* %.*finished/")
    assert page.locator("canvas").count() >= 2  # that of the picture, and that of the chart
    assert f"needed by materials.{HOSTILE}" in page.locator("body").inner_text()
    page.get_by_role("button", name="Measure what each costs").click()
    page.wait_for_selector("text=/One sample of each of .* pixels took/")
    known = page.locator("text=/in the noise|of the picture/").count()
    assert known == len(vr.explain(SCENE).names())
    shadows = page.get_by_role("checkbox").nth(vr.explain(SCENE).names().index("shadows"))
    shadows.click()
    eventually(lambda: shown.live.engine.left_out == ("shadows",))
    finished(page)
    assert not shadows.is_checked()
