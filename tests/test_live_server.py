"""The server of the live picture, without a browser: who may reach it, cameras, and pages that come and go."""

import io
import math
import signal
import socket
import subprocess
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

import visray as vr
from visray.errors import UserError
from visray.live import guard, sending
from visray.live.client import MOST_PIXELS, picture_size
from visray.live.frame import Frame
from visray.live.handles import places
from visray.live.live import escaped
from visray.live.pixel_part import focused
from visray.live.sending import Sender, encoded
from visray.live.status import errors_text, text_of
from visray.live.story_page import reason, story_page
from visray.live.viewpoint import Pose, Space, camera_at, page_fov, pose_of, widened, widening

pytest.importorskip("viser")
from page import Page, eventually
from websockets.exceptions import InvalidStatus

HOSTILE = "<img src=x onerror=alert(1)>"
BALL = vr.Scene(
    camera=vr.Camera(origin=(0.0, 1.0, 6.0), target=(0.0, 0.5, 0.0), fov=40.0),
    film=vr.Film(width=64, height=48),
    ambient=(0.3, 0.3, 0.3),
    lights={"key": vr.PointLight(position=(3.0, 4.0, 5.0))},
    objects={"ball": vr.Sphere(radius=1.0), "wall": vr.Sphere(center=(0.0, 0.0, -30.0), radius=8.0)},
)
numbers = st.floats(-100, 100)
points = st.tuples(numbers, numbers, numbers)
directions = points.filter(lambda v: math.hypot(*v) > 0.1)


def cameras(target, back, distance, up, parallel, extent):
    """A camera of the scene. back: direction from the target to the camera."""
    back = np.array(back) / math.hypot(*back)
    origin = tuple(float(x) for x in np.array(target) + distance * back)
    if parallel:
        return vr.OrthographicCamera(origin=origin, target=target, up=up, height=extent)
    return vr.Camera(origin=origin, target=target, up=up, fov=extent, aperture=0.25, focus=3.0)


any_camera = st.builds(
    cameras, points, directions, st.floats(0.1, 1000), directions, st.booleans(), st.floats(1, 150)
).filter(lambda c: np.linalg.norm(np.cross(np.subtract(c.origin, c.target), c.up)) > 0.1)


@given(any_camera, any_camera)
def test_a_camera_comes_back_from_its_pose(camera, base):
    """Where the base has the same lens or height, and is elsewhere."""
    space = Space.around(base)
    base = replace(camera, origin=base.origin, target=base.target, up=base.up)
    back = camera_at(base, pose_of(camera, space), space)
    scale = math.dist(camera.origin, camera.target) + 1e3
    np.testing.assert_allclose(back.target, camera.target, atol=1e-9 * scale)
    ups = (np.divide(c.up, math.hypot(*c.up)) for c in (back, camera))
    np.testing.assert_allclose(*ups, atol=2e-6)
    if isinstance(camera, vr.OrthographicCamera):
        assert math.isclose(back.height, camera.height, rel_tol=1e-6)
        # The plane of the camera keeps its distance from the target.
        assert math.isclose(math.dist(back.origin, back.target), math.dist(base.origin, base.target), rel_tol=1e-9)
        view = np.subtract(camera.target, camera.origin)
        new = np.subtract(back.target, back.origin)
        np.testing.assert_allclose(new / np.linalg.norm(new), view / np.linalg.norm(view), atol=1e-6)
    else:
        np.testing.assert_allclose(back.origin, camera.origin, atol=1e-9 * scale)
        assert (back.fov, back.aperture, back.focus) == (camera.fov, camera.aperture, camera.focus)


@given(any_camera)
def test_the_pose_of_the_base_gives_the_base_itself(camera):
    space = Space.around(camera)
    pose = pose_of(camera, space)
    wobbly = replace(pose, position=tuple(x * (1 + 1e-15) for x in pose.position))
    assert camera_at(camera, wobbly, space) is camera


@given(any_camera, st.floats(1.0, 3.0))
def test_an_orthographic_picture_grows_with_the_distance(camera, factor):
    space, home = Space.around(camera), None
    home = pose_of(camera, space)
    farther = np.array(home.look_at) + factor * (np.array(home.position) - home.look_at)
    moved = camera_at(camera, replace(home, position=tuple(farther)), space)
    if isinstance(camera, vr.OrthographicCamera):
        assert math.isclose(moved.height, factor * camera.height, rel_tol=1e-6)
    else:
        distance = math.dist(camera.origin, camera.target)
        assert math.isclose(math.dist(moved.origin, moved.target), factor * distance, rel_tol=1e-6)


def test_poses_that_no_camera_can_have_are_refused():
    good = Pose((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert good.is_valid()
    for bad in (
        replace(good, position=(0.0, 0.0, 0.0)),
        replace(good, position=(0.0, 0.0, 1e-320)),
        replace(good, position=(3.0, 0.0, 1e-7), look_at=(3.0, 0.0, 0.0)),
        replace(good, position=(math.nan, 0.0, 4.0)),
        replace(good, look_at=(math.inf, 0.0, 0.0)),
        replace(good, up=(0.0, 0.0, 0.0)),
    ):
        assert not bad.is_valid()


def test_a_steep_view_gets_an_up_that_it_can_have():
    space = Space.around(BALL.camera)
    pose = Pose((0.0, 4.0, 1e-9), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), true_up=(0.0, 0.0, -1.0))
    camera = camera_at(BALL.camera, pose, space)
    assert camera.up == (0.0, 0.0, -1.0)


def test_a_narrow_window_shows_the_whole_width():
    film = 600, 400
    assert widening(film, (1400, 900)) == 1.0
    factor = widening(film, (390, 844))
    camera = widened(vr.Camera(fov=40.0), factor)
    half_width = math.tan(math.radians(camera.fov) / 2) * 390 / 844
    assert math.isclose(half_width, math.tan(math.radians(20.0)) * 1.5)
    assert page_fov(vr.Camera(fov=40.0), factor) == camera.fov
    assert widened(vr.OrthographicCamera(height=2.0), 3.0).height == 6.0
    assert widened(vr.Camera(fov=170.0), 4.0).fov == 170.0


def test_pictures_have_a_limit():
    assert picture_size((1400, 900)) == (1400, 900)
    width, height = picture_size((3840, 2160))
    assert width * height <= 1.01 * MOST_PIXELS and math.isclose(width / height, 16 / 9, rel_tol=1e-2)


def test_a_taken_port_is_refused_and_a_free_one_is_named():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(
            UserError, match=rf"^--port = {port}: is taken by another program; --port \d+ is free$"
        ) as e:
            guard.chosen_port("127.0.0.1", port)
        free = int(str(e.value).split("--port ")[-1].split()[0])
    assert free != port and guard.chosen_port("127.0.0.1", free) == free


@pytest.mark.parametrize("port", [0, -1, 65536])
def test_a_port_that_is_none(port):
    with pytest.raises(UserError, match=f"--port = {port}: must be a number from 1 to 65535"):
        guard.chosen_port("127.0.0.1", port)


def test_a_host_that_is_none():
    with pytest.raises(UserError, match=r"^--host = 'no\.such\.host\.invalid': .*127\.0\.0\.1 is this machine alone"):
        guard.chosen_port("no.such.host.invalid", 8080)


@pytest.mark.parametrize(
    ("host", "name", "origin", "welcome"),
    [
        ("127.0.0.1", "127.0.0.1:8080", "http://127.0.0.1:8080", True),
        ("127.0.0.1", "localhost:9000", "http://localhost:9000", True),  # through a tunnel
        ("127.0.0.1", "127.0.0.1:8080", None, True),  # no browser
        ("127.0.0.1", "127.0.0.1:8080", "http://evil.example", False),
        ("127.0.0.1", "127.0.0.1:8080", "http://127.0.0.1:9999", False),
        ("127.0.0.1", "evil.example:8080", "http://evil.example:8080", False),  # its name has this machine's address
        ("127.0.0.1", "", None, False),
        ("0.0.0.0", "192.168.1.5:8080", "http://192.168.1.5:8080", True),
        ("0.0.0.0", "192.168.1.5:8080", "http://evil.example", False),
        ("::1", "[::1]:8080", "http://[::1]:8080", True),
    ],
)
def test_pages_of_other_sites_are_not_welcome(host, name, origin, welcome):
    headers = {"Host": name} | ({} if origin is None else {"Origin": origin})
    assert guard.is_welcome(host, headers) is welcome


def test_urls():
    assert guard.url_of("127.0.0.1", 8080) == "http://127.0.0.1:8080"
    assert guard.url_of("0.0.0.0", 81) == "http://localhost:81"
    assert guard.url_of("::1", 8080) == "http://[::1]:8080"


def frame(**more):
    plain = {"rgb": np.zeros((3, 4, 3), np.uint8), "size": (8, 6), "grain": 2, "samples": 0.25, "error": None}
    return Frame(**(plain | {"finished": False} | more))


def test_what_the_line_says():
    assert "coarse: squares of 2 x 2 pixels" in text_of(frame())
    fine = {"grain": 1, "samples": 24.0}
    assert "error 1.3 %" in text_of(frame(**fine, error=0.0131)) and "24 samples" in text_of(frame(**fine))
    assert "✓ error 0.99 %" in text_of(frame(**fine, error=0.0099, finished=True))
    assert "error 250 %" in text_of(frame(**fine, error=2.5))


def test_errors_and_names_are_escaped():
    assert HOSTILE not in errors_text([f"objects.{HOSTILE}: is wrong"]) and errors_text([]) == ""
    assert "line 7" in errors_text([f"line {i}" for i in range(8)])
    many = errors_text([f"line {i}" for i in range(1000)])
    assert "line 7<" in many and "line 8<" not in many and "and 992 more" in many
    assert len(errors_text(["x" * 10**6])) < 2000
    assert escaped(HOSTILE) == "&lt;img src=x onerror=alert(1)&gt;" and escaped('"&') == "&quot;&amp;"
    material = vr.Material(kd=(0.5, 0.1, 0.1), texture=HOSTILE)
    scene = replace(
        BALL, materials={HOSTILE: material}, textures={HOSTILE: vr.CheckerTexture()},
        lights={HOSTILE: BALL.lights["key"]}, objects={HOSTILE: vr.Sphere(material=HOSTILE)},
    )  # fmt: skip
    page = story_page(vr.why(scene, 32, 32))
    assert "<img" not in page and page.count(escaped(HOSTILE)) >= 4


def test_the_story_says_why_it_is_dark():
    shade = {"shade": vr.Sphere(center=(1.5, 2.4, 3.4), radius=0.6)}
    scene = replace(BALL, objects=BALL.objects | shade, camera=replace(BALL.camera, origin=(-3.0, 2.0, 5.0)))
    stories = [vr.why(scene, x, y) for x in range(20, 44, 2) for y in range(14, 40, 2)]
    lights = [s.surfaces[0].lights[0] for s in stories if s.surfaces[0].object == "objects.ball"]
    said = {reason(light) for light in lights}
    assert said == {"", "it is behind the surface", "objects.shade is in the way"}
    for light in lights:
        assert (reason(light) == "") == any(light.diffuse)


def test_coarse_states_are_cut_at_the_edges():
    """The last square of a row reaches over the edge; things keep their place all the same."""
    rgb = np.zeros((4, 4, 3), np.uint8)
    rgb[:, 2:] = 255
    cut = Image.open(io.BytesIO(encoded(frame(rgb=rgb, size=(13, 13), grain=4))))
    # The edge is at 8 of 13 pixels, so beyond the middle of the picture.
    row = np.array(cut.convert("L").resize((130, 4)))[1]
    assert abs(np.argmax(row > 127) - 80) <= 10


def test_only_the_newest_state_is_sent():
    begun, go, shown = threading.Event(), threading.Event(), []

    def show(state):
        shown.append(state.change)
        begun.set()
        assert go.wait(60)

    sender = Sender(show)
    sender.send(frame(change=0))
    assert begun.wait(60)
    for change in range(1, 1001):
        sender.send(frame(change=change))
    begun.clear()
    go.set()
    assert begun.wait(60)
    sender.close()
    assert shown == [0, 1000]


def test_focus_opens_a_lens():
    values = focused(replace(BALL.camera, origin=(0.0, 0.0, 6.0), target=(0.0, 0.0, 0.0)), (1.0, 1.0, 2.0))
    assert values["camera.focus"] == 4.0
    assert math.isclose(values["camera.aperture"], 0.06 * math.tan(math.radians(20)) * 4)
    assert set(focused(replace(BALL.camera, aperture=0.1), (0.0, 0.0, 0.0))) == {"camera.focus"}
    with pytest.raises(UserError, match="behind the camera"):
        focused(BALL.camera, (0.0, 0.0, 20.0))
    with pytest.raises(UserError, match="orthographic camera has no lens"):
        focused(vr.OrthographicCamera(), (0.0, 0.0, 0.0))


def test_what_can_be_dragged():
    spot = vr.SpotLight(position=(0.0, 4.0, 0.0), direction=(0.0, -1.0, 0.0))
    box = vr.Box(transform=(vr.Rotate(rotate=30.0), vr.Translate(translate=(1.0, 2.0, 3.0))))
    scene = replace(BALL, lights=BALL.lights | {"spot": spot}, objects=BALL.objects | {"box": box})
    found = {x.label: x for x in places(scene, "objects.ball")}
    assert list(found) == [
        "lights.key.position",
        "lights.spot.position",
        "lights.spot.direction",
        "objects.ball.center",
    ]
    assert found["lights.key.position"].point == (3.0, 4.0, 5.0)
    assert found["objects.ball.center"].moved((1.0, 0.0, 0.0)) == {"objects.ball.center": (1.0, 0.0, 0.0)}
    assert found["lights.spot.direction"].point == (0.0, 0.5, 0.0)
    assert found["lights.spot.direction"].moved((2.0, 4.0, 0.0)) == {"lights.spot.direction": (2.0, 0.0, 0.0)}
    step = places(scene, "objects.box", (0.5, 0.0, 0.0))[-1]
    assert step.point == (1.5, 2.0, 3.0)
    assert step.moved((1.5, 2.0, 4.0)) == {"objects.box.transform.1.translate": (1.0, 2.0, 4.0)}
    plain = places(replace(scene, objects={"box": vr.Box()}), "objects.box")[-1]
    assert plain.moved((0.0, 1.0, 0.0)) == {"objects.box.min": (-0.5, 0.5, -0.5), "objects.box.max": (0.5, 1.5, 0.5)}
    turned = replace(scene, objects={"box": replace(box, transform=box.transform[:1])})
    new = places(turned, "objects.box", (0.5, 0.0, 0.0))[-1].moved((0.5, 1.0, 0.0))
    moved = vr.replaced(turned, *next(iter(new.items())))
    assert moved.objects["box"].transform == (vr.Rotate(rotate=30.0), vr.Translate(translate=(0.0, 1.0, 0.0)))


def test_without_viser_a_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(UserError, match=r"^the live picture needs viser: pip install 'visray\[view\]'$"):
        vr.view(BALL)


@pytest.fixture(scope="module")
def shown():
    """A live picture."""
    with vr.view(BALL, error=0.05, name=HOSTILE) as shown:
        yield shown


@pytest.fixture
def opened(shown):
    """Opens pages of it, and closes them after the test."""
    pages = []

    def opened(**more):
        pages.append(Page(shown.url, **more))
        if not more.get("origin"):
            # As a page does when it has opened.
            home = pose_of(shown.live.engine.scene.camera, shown.live.space)
            pages[-1].look(home.position, home.look_at)
        return pages[-1]

    yield opened
    for page in pages:
        page.close()
    eventually(lambda: not shown.live.clients)


def newest(shown):
    """The page that came last, as the server knows it."""
    eventually(lambda: shown.live.clients)
    return shown.live.clients[max(shown.live.clients)]


def test_it_shows_the_scene_and_says_how_good_it_is(shown, opened):
    page = opened()
    page.look(position=(9.0, 1.0, 1.0))
    eventually(lambda: "✓ error" in page.html())
    eventually(lambda: page.pictures)
    assert page.pictures[-1].shape == (48, 64, 3) and page.pictures[-1].std() > 5
    assert HOSTILE not in page.html()
    assert shown.url in shown._repr_html_() and "<iframe" in shown._repr_html_()


def test_the_pose_of_a_page_is_that_of_its_picture(shown, opened):
    page = opened()
    space, camera = shown.live.space, replace(BALL.camera, origin=(6.0, 1.0, 0.0))
    page.look(*(lambda p: (p.position, p.look_at))(pose_of(camera, space)))
    client = newest(shown)
    eventually(lambda: not client.at_home)
    np.testing.assert_allclose(client.camera.origin, camera.origin, atol=1e-12)
    assert client.camera.fov == camera.fov
    page.look(*(lambda p: (p.position, p.look_at))(pose_of(BALL.camera, space)))
    eventually(lambda: client.at_home)
    assert client.camera is shown.live.engine.scene.camera


def test_poses_of_a_page_that_opens_are_not_followed(shown):
    page = Page(shown.url)
    page.look(position=(3.0, 3.0, 3.0))
    client = newest(shown)
    page.look(position=(-5.0, 0.0, 0.0))
    eventually(lambda: client.viewer.picture is not None)
    assert client.at_home and client.camera is shown.live.engine.scene.camera
    page.look(position=(3.0, 3.5, 3.0))
    eventually(lambda: not client.at_home)
    page.look(position=(3.0, 3.0, 3.0))
    eventually(lambda: client.camera.origin[1] > 4)
    page.close()
    eventually(lambda: not shown.live.clients)


def test_a_page_that_leaves_and_one_that_does_not_read(shown, opened, monkeypatch):
    monkeypatch.setattr(sending, "PATIENCE", 1000.0)
    silent, leaving, good = opened(answers=False), opened(), opened()
    for number, page in enumerate((silent, leaving, good)):
        page.look(position=(4.0, 1.0 + number, 3.0), window=(320, 240))
    eventually(lambda: leaving.pictures)
    leaving.close()
    eventually(lambda: len(shown.live.clients) == 2)
    good.look(position=(4.0, 1.0, -3.0), window=(320, 240))
    eventually(lambda: "✓ error" in good.html() and good.pictures[-1].shape[:2] == (240, 320))
    # Nothing more goes to a page that does not say that the first picture has arrived.
    assert len(silent.pictures) <= 1
    buffer = shown.live.clients[min(shown.live.clients)].handle._websock_connection.get_message_buffer()
    assert len(buffer.message_from_id) < 20
    assert len(shown.live.engine.viewers) == 2


def test_a_page_of_another_site_is_turned_away(shown, opened):
    with pytest.raises(InvalidStatus) as refused:
        opened(origin="http://evil.example")
    assert refused.value.response.status_code == 403 and not shown.live.clients


def test_a_camera_that_is_set_takes_all_pages_along(shown, opened):
    page = opened()
    page.look(position=(9.0, 1.0, 1.0))
    client = newest(shown)
    eventually(lambda: not client.at_home)
    shown.live.engine.assign({"camera.fov": 30.0})
    eventually(lambda: client.camera.fov == 30.0)
    assert not client.at_home
    shown.live.engine.assign({"camera.origin": (0.0, 2.0, 8.0)})
    eventually(lambda: client.at_home and client.camera.origin == (0.0, 2.0, 8.0))
    placed = eventually(lambda: [x for x in page.of("SetCameraPositionMessage") if not x["initial"]])[-1]
    np.testing.assert_allclose(shown.live.space.to_world(placed["position"]), (0.0, 2.0, 8.0), atol=1e-12)


def test_an_error_is_shown_until_it_is_mended(shown, opened):
    page = opened()
    page.look(position=(9.0, 1.0, 1.0))
    shown.live.engine.assign({"objects.ball.radius": -1.0})
    eventually(lambda: "objects.ball.radius" in page.html() and "The scene has errors" in page.html())
    shown.live.engine.assign({"objects.ball.radius": 0.9})
    eventually(lambda: "The scene has errors" not in page.html())


def test_an_error_of_one_view_is_shown_in_its_page_until_it_is_good(shown, opened):
    other = opened()
    eventually(lambda: other.pictures)
    page = opened()
    eventually(lambda: page.pictures and len(shown.live.clients) == 2)
    viewer = newest(shown).viewer
    viewer.look(camera=vr.Camera(origin=(0.0, 0.0, 1e-320)))
    eventually(lambda: "This view has no picture" in page.html() and "camera.target" in page.html())
    page.look(position=(3.0, 1.0, 2.0))
    eventually(lambda: "This view has no picture" not in page.html())
    assert not any("no picture" in m["updates"].get("content", "") for m in other.of("GuiUpdateMessage"))
    assert not any(shown.live.errors.values())


def test_a_port_that_is_taken_by_it(shown):
    port = int(shown.url.rpartition(":")[2])
    with pytest.raises(UserError, match=rf"--port = {port}: is taken"):
        vr.view(BALL, port=port)
    with vr.view(BALL) as other:
        assert other.url != shown.url
    assert guard.is_free("127.0.0.1", int(other.url.rpartition(":")[2]))


def test_another_program_takes_the_port_in_between(monkeypatch):
    choose, taken = guard.chosen_port, []

    def chosen(host, port):
        found = choose(host, port)
        if not taken:
            taken.append(socket.create_server((host, found)))
        return found

    monkeypatch.setattr(guard, "chosen_port", chosen)
    with vr.view(BALL) as shown, taken[0] as other:
        assert shown.url != guard.url_of(*other.getsockname())


@pytest.mark.slow
def test_the_command_prints_its_address_and_ends_well(tmp_path):
    path = tmp_path / "ball.json"
    path.write_text(vr.dump(BALL))
    port = guard.chosen_port("127.0.0.1", None)
    words = [sys.executable, "-m", "visray", "view", str(path), "--port", str(port), "--no-browser"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == f"ball: http://127.0.0.1:{port} (Ctrl-C ends)\n"
        again = subprocess.run(words, capture_output=True, text=True)
        assert again.returncode == 2 and f"--port = {port}: is taken by another program" in again.stderr
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err) == (0, "", "")
