"""The panel of the live picture: its widgets change the scene, and show what others change. No browser is needed."""

import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

import visray as vr
from visray.live.panel import MOST, PanelPart, back, field_changed
from visray.live.widgets import ControlWidget, rounded, short
from visray.scene.address import changed, value
from visray.scene.check import checked

pytest.importorskip("viser")

TAG = "<b onclick=alert(1)>&"
SCENE = checked(vr.Scene(
    materials={"red": vr.Material(kd=(0.8, 0.1, 0.1)), TAG: vr.Material()},
    lights={"lamp": vr.PointLight(position=(3, 5, 4), Id=(4.0, 4.0, 2.0))},
    objects={
        "ball": vr.Sphere(radius=0.7, material="red"),
        "crate": vr.Box(min=(-1, -1, -1), max=(1, 1, 1), material=TAG),
        TAG: vr.Sphere(material=TAG),
    }, camera=vr.Camera(),
))  # fmt: skip
UP = vr.KeysTrack(address="objects.ball.center", times=(0.0, 4.0), values=((0.0, 0.0, 0.0), (0.0, 4.0, 0.0)))
TABLE = {"lon": [0.0, 10.0, 20.0], "lat": [50.0, 51.0, 52.0], "rain": [3.0, 1.0, 2.0]}
CHROMIUM = shutil.which("chromium")
# Seconds until a test gives up.
LIMIT = 20.0


@pytest.fixture
def panel_of() -> Iterator[Callable[[vr.Scene], PanelPart]]:
    """Starts a live picture of a scene, and returns its panel."""
    from visray.live import guard
    from visray.live.server import serve, stop

    started = []

    def start(scene: vr.Scene) -> PanelPart:
        host = guard.LOCAL
        live = serve(scene, name="scene", host=host, port=guard.chosen_port(host, None), target=0.1)
        started.append(live)
        return next(part for part in live.parts if isinstance(part, PanelPart))

    yield start
    for live in started:
        stop(live)
        live.engine.stop()


@pytest.fixture
def panel(panel_of: Callable) -> PanelPart:
    """The panel of SCENE."""
    return panel_of(SCENE)


def until(condition: Callable[[], bool]) -> bool:
    """Waits for a condition. Returns whether it has come true."""
    end = time.monotonic() + LIMIT
    while not condition() and time.monotonic() < end:
        time.sleep(0.01)
    return condition()


def of(panel: PanelPart, address: str) -> ControlWidget:
    """The widget of an address. It is searched for."""
    panel.text.value = address
    assert until(lambda: panel.widgets and panel.widgets[0].control.address == address)
    return panel.widgets[0]


def now(panel: PanelPart, address: str) -> object:
    """The value of the scene at an address."""
    return value(panel.engine.scene, address)


def test_what_is_changed_most_is_shown_first(panel):
    addresses = [w.control.address for w in panel.widgets]
    assert len(addresses) == MOST
    assert {"materials.red.kd", "lights.lamp.intensity", "camera.fov", "ambient"} <= set(addresses)
    assert f"and {len(panel.controls) - MOST} more" in panel.head.content


@pytest.mark.parametrize("address, shown, expected", [
    ("objects.ball.radius", 0.31, 0.31),
    ("objects.ball.radius", 0.1 + 0.2, 0.3),
    ("objects.ball.center", (1.0, 2.0, 3.0), (1.0, 2.0, 3.0)),
    ("materials.red.kr", (255, 0, 255), (1.0, 0.0, 1.0)),
    ("lights.lamp.Id", (255, 255, 255), (4.0, 4.0, 4.0)),
    ("materials.red.dmax", 25.0, 25.0),
])  # fmt: skip
def test_a_widget_changes_the_scene(panel, address, shown, expected):
    of(panel, address).handle.value = shown
    assert until(lambda: now(panel, address) == pytest.approx(expected, abs=1e-12))
    assert panel.engine.edits == {address: expected}


def test_a_widget_shows_what_others_change(panel):
    radius = of(panel, "objects.ball.radius")
    told = []
    panel.engine.on_scene(told.append)
    panel.engine.assign({"objects.ball.radius": 0.4})
    assert until(lambda: radius.handle.value == 0.4)
    # Beyond the slider, which gets longer.
    panel.engine.assign({"objects.ball.radius": 77.0})
    assert until(lambda: radius.handle.value == 77.0)
    assert radius.handle.max >= 77
    # What a widget is told, it does not tell the engine.
    panel.engine.assign({"materials.red.kd": (0.1, 0.2, 0.3)})
    assert until(lambda: len(told) == 3)
    time.sleep(0.2)
    assert len(told) == 3 and panel.engine.edits["materials.red.kd"] == (0.1, 0.2, 0.3)


def test_a_part_of_a_vector_that_another_changes_is_shown(panel):
    center = of(panel, "objects.ball.center")
    panel.engine.assign({"objects.ball.center.1": 2.5})
    assert until(lambda: center.handle.value == (0.0, 2.5, 0.0))


def test_of_a_thousand_values_the_newest_wins(panel):
    radius = of(panel, "objects.ball.radius")
    seen = []
    panel.engine.on_scene(lambda change: seen.append(radius.handle.value))
    for i in range(1, 1001):
        radius.handle.value = i / 1000
    assert until(lambda: now(panel, "objects.ball.radius") == 1.0)
    assert radius.handle.value == 1.0
    # The slider was never put back to an older value, and not each value was a change.
    assert seen == sorted(seen) and len(seen) <= 1000


def test_a_value_that_the_engine_has_not_seen_yet_is_not_put_back(panel):
    radius = of(panel, "objects.ball.radius")
    radius.handle._impl.value = 0.9  # as viser does before it calls back
    panel.engine.assign({"objects.ball.radius": 0.2})
    assert until(lambda: now(panel, "objects.ball.radius") == 0.2)
    time.sleep(0.1)
    assert radius.handle.value == 0.9 and radius.moved


def test_a_refused_value_is_said_beside_its_widget(panel):
    most = of(panel, "objects.crate.max")
    most.handle.value = (-2.0, 1.0, 1.0)
    assert until(lambda: most._error is not None and most._error.visible)
    assert "must be greater than min in x" in most._error.content
    assert now(panel, "objects.crate.max") == (1.0, 1.0, 1.0)
    most.handle.value = (2.0, 1.0, 1.0)
    assert until(lambda: not most._error.visible)
    assert now(panel, "objects.crate.max") == (2.0, 1.0, 1.0)


def test_names_are_escaped(panel):
    panel.focus_on(f"objects.{TAG}")
    assert panel.widgets[0].control.owner == f"objects.{TAG}"
    assert "<b" not in panel.head.content and "&lt;b" in panel.head.content
    radius = of(panel, f"objects.{TAG}.radius")
    # Labels and titles of viser are plain text, so they have the name as it is; an error is HTML.
    radius.say(f"objects.{TAG}.radius = 0: must be greater than 0")
    assert "<b" not in radius._error.content and "&lt;b" in radius._error.content


def test_a_clicked_object_comes_first(panel):
    panel.focus_on("objects.ball")
    assert [w.control.owner for w in panel.widgets][:2] == ["objects.ball", "objects.ball"]
    assert {w.control.owner for w in panel.widgets} == {"objects.ball", "materials.red"}
    assert "ball" in panel.head.content
    panel.focus_on("")
    assert len(panel.widgets) == MOST


def test_search(panel):
    panel.text.value = "RED k"
    assert until(lambda: {w.control.owner for w in panel.widgets} == {"materials.red"})
    # ka is not written, so it follows kd and has no control.
    assert {w.control.label for w in panel.widgets} >= {"kd", "kr", "ks", "kt"}
    assert "ka" not in {w.control.label for w in panel.widgets}
    panel.text.value = "nothing like that"
    assert until(lambda: not panel.widgets)
    assert "nothing with nothing like that" in panel.head.content
    panel.text.value = ""
    assert until(lambda: len(panel.widgets) == MOST)


def test_an_assignment_in_the_search_box(panel):
    panel.text.value = "materials.red.kd = 0.1, 0.2, 0.3"
    assert until(lambda: panel.assign.visible)
    panel.assign.value = True
    assert until(lambda: now(panel, "materials.red.kd") == (0.1, 0.2, 0.3))
    # Words, too: what is no slider.
    panel.text.value = "objects.ball.material = default"
    panel.assign.value = True
    assert until(lambda: now(panel, "objects.ball.material") == "default")
    panel.text.value = "red"
    assert until(lambda: not panel.assign.visible)


def test_back_to_the_file(panel):
    radius = of(panel, "objects.ball.radius")
    radius.handle.value = 0.2
    assert until(lambda: radius._button is not None and radius._button.visible)
    assert radius._button.label == "radius: back to 0.7"
    radius._button.value = True
    assert until(lambda: now(panel, "objects.ball.radius") == 0.7)
    assert until(lambda: radius.handle.value == 0.7 and not radius._button.visible)
    radius.handle.value = 0.3
    panel.engine.assign({"camera.fov": 20.0, "objects.ball.material": "default"})
    assert until(lambda: now(panel, "camera.fov") == 20 and panel.back.visible)
    panel.back.value = True
    assert until(lambda: panel.engine.scene == SCENE)
    assert until(lambda: not panel.back.visible) and panel.engine.edits == {}
    assert until(lambda: of(panel, "objects.ball.radius").handle.value == 0.7)


def test_the_file_has_changed(panel):
    of(panel, "objects.ball.radius")
    other = replace(SCENE, objects={"ball": vr.Torus(major=2.0, minor=0.25), "new": vr.Sphere(radius=0.1)})
    panel.engine.show(checked(other))
    assert until(lambda: panel.file is panel.engine.scene and not panel.widgets)
    minor = of(panel, "objects.ball.minor")
    minor.handle.value = 0.5
    assert until(lambda: minor._button is not None and minor._button.label == "minor: back to 0.25")


def test_a_scene_that_stands_still_has_no_time(panel, panel_of):
    assert not panel.playing.slider.visible and not panel.playing.button.visible
    panel.engine.show(replace(SCENE, animation=vr.Animation(duration=4.0, tracks={"up": UP})))
    assert until(lambda: panel.playing.slider.visible and panel.playing.slider.max == 4)


def test_time(panel_of):
    panel = panel_of(replace(SCENE, animation=vr.Animation(duration=4.0, tracks={"up": UP})))
    center = of(panel, "objects.ball.center")
    # A track moves it, so nobody else can.
    assert center.handle.disabled and "animation.tracks.up" in center.handle.hint
    panel.playing.slider.value = 1.0
    assert until(lambda: panel.engine.time == 1.0)
    assert until(lambda: center.handle.value == (0.0, 1.0, 0.0))
    assert center._button is None
    panel.engine.seek(3.0)
    assert until(lambda: panel.playing.slider.value == 3.0)


def test_play_and_pause(panel_of):
    panel = panel_of(replace(SCENE, animation=vr.Animation(duration=4.0, tracks={"up": UP})))
    panel.playing.button.value = True
    assert until(lambda: panel.engine.time > 0) and panel.playing.button.label == "Pause"
    panel.playing.button.value = True
    assert until(lambda: not panel.playing.plays) and panel.playing.button.label == "Play"
    assert until(lambda: not panel.engine.seeks)
    stands = panel.engine.time
    time.sleep(0.3)
    assert panel.engine.time == stands
    assert panel.playing.slider.value == pytest.approx(stands, abs=0.2)


def test_the_range_of_a_palette(panel_of):
    layer = vr.DataLayer(source=TABLE, value="rain", color="rain", gizmo="cylinder", radius=0.1)
    panel = panel_of(checked(vr.Scene(data=vr.Data(layers={"rain": layer}), camera=vr.Camera(), lights={})))
    widget = next(w for w in panel.widgets if w.control.address == "data.layers.rain.color.domain")
    assert widget.handle.value == (1.0, 3.0)
    widget.handle.value = (0.5, 3.0)
    assert until(lambda: "data.layers.rain.color" in panel.engine.edits)
    assert until(lambda: widget.control.rule is None)
    # The widget under the mouse is still the same one, although the scene has a rule now and had a word before.
    assert widget in panel.widgets
    widget.handle.value = (0.5, 2.5)
    assert until(lambda: panel.engine.scene.data.rows["rain"].rules["color"].hi == 2.5)
    widget._button.value = True
    assert until(lambda: now(panel, "data.layers.rain.color") == "rain")
    assert until(lambda: widget.handle.value == (1.0, 3.0))


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium")
def test_two_browsers_agree(panel):
    api = pytest.importorskip("playwright.sync_api")
    options = ["--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader"]
    size = {"width": 900, "height": 700}
    with api.sync_playwright() as play, play.chromium.launch(executable_path=CHROMIUM, args=options) as browser:
        pages = [browser.new_page(viewport=size) for _ in range(2)]
        for page in pages:
            page.goto(f"http://127.0.0.1:{panel.live.server.get_port()}")
            page.get_by_text("search", exact=True).wait_for()
        search = pages[0].locator("input:visible").first
        search.fill("ball radius")
        assert until(lambda: [w.control.address for w in panel.widgets][:1] == ["objects.ball.radius"])
        for page in pages:
            page.locator("input[value='0.7']:visible").first.wait_for()
        track = pages[0].locator(".mantine-Slider-track:visible").first.bounding_box()
        x, y = track["x"], track["y"] + track["height"] / 2
        pages[0].mouse.move(x + 0.2 * track["width"], y)
        pages[0].mouse.down()
        for i in range(50):
            pages[0].mouse.move(x + (0.2 + 0.012 * i) * track["width"], y)
        pages[0].mouse.up()
        shown = panel.widgets[0].handle
        assert until(lambda: now(panel, "objects.ball.radius") == rounded(shown.value) and shown.value > 0.9)
        # The number beside the slider of the other browser.
        pages[1].locator(f"input[value='{rounded(shown.value):g}']:visible").first.wait_for()
        # A name with HTML in it is text.
        search.fill("onclick kd")
        for page in pages:
            page.get_by_text(f"material {TAG}").wait_for()


def test_a_number_of_a_row(panel_of):
    layer = vr.DataLayer(source=TABLE, value="rain", gizmo="cylinder", radius=0.1)
    panel = panel_of(checked(vr.Scene(data=vr.Data(layers={"rain": layer}), camera=vr.Camera(), lights={})))
    panel.focus_on("data.rain.1")
    height = next(w for w in panel.widgets if w.control.address == "data.rain.1.height")
    height.handle.value = 2.5
    panel.engine.assign({"data.rain.2.height": 1.5})
    assert until(lambda: now(panel, "data.rain.1.height") == 2.5 and now(panel, "data.rain.2.height") == 1.5)
    assert until(lambda: height._button is not None and height._button.visible)
    height._button.value = True
    # The other row keeps its number.
    assert until(lambda: now(panel, "data.rain.1.height") == 1.0)
    assert now(panel, "data.rain.2.height") == 1.5
    panel.back.value = True
    assert until(lambda: now(panel, "data.rain.2.height") == 2.0 and not panel.back.visible)


def test_what_the_file_says():
    assert back(SCENE, "objects.ball.radius") == ("objects.ball.radius", 0.7)
    assert back(SCENE, "objects.ball.material.no") == ("objects.ball.material", "red")


def test_other_kinds_of_things_have_other_controls():
    torus = changed(SCENE, {"objects.ball": {"type": "torus"}})
    assert field_changed(SCENE, torus, "objects.ball")
    assert not field_changed(SCENE, changed(SCENE, {"objects.ball.radius": 2.0}), "objects.ball.radius")
    assert not field_changed(SCENE, SCENE, "data.rain.0.height")


def test_short_texts():
    assert short((0.25, 1 / 3, 2.0)) == "0.25, 0.3333, 2" and short("rain") == "rain"
    assert rounded(0.1 + 0.2) == 0.3 and rounded(1 / 3) == pytest.approx(1 / 3, rel=1e-11)
