"""Environment maps: the lookup against the same in NumPy, mirrors, the background as ambient light against closed
forms, derivatives, kinds of files, and what is refused."""

import json
import math
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import drjit as dr
import mitsuba as mi
import numpy as np
import OpenEXR
import pytest
from PIL import Image as Pillow

from visray.background import background
from visray.cluster.scene_package import ScenePackage
from visray.environment_report import LARGE, EnvironmentWarning, environment_notes, unlit_notes
from visray.features import features
from visray.images import environment
from visray.live.controls import control
from visray.live.file_watch import FileWatch
from visray.scene.write import files_of
from visray.setup import prepare
from visray.study.mitsuba.mitsuba_environment import environment_light, rows_at_poles

BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
ROOM = "room.exr"


def write_exr(path: str, pixels: np.ndarray) -> str:
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, {"RGB": pixels}).write(path)
    return path


def some(height: int = 8) -> np.ndarray:
    return np.random.default_rng(height).random((height, 2 * height, 3)).astype(np.float32)


@pytest.fixture(autouse=True)
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> np.ndarray:
    """A folder with a map, as the current one."""
    monkeypatch.chdir(tmp_path)
    write_exr(ROOM, some())
    return some()


def directions(n: int, seed: int = 0) -> np.ndarray:
    d = np.random.default_rng(seed).normal(size=(n, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def twin(pixels: np.ndarray, d: np.ndarray, rotation: float = 0.0) -> np.ndarray:
    """The light from directions, in double. The map is turned by turning the directions back."""
    height, width = pixels.shape[:2]
    angle = math.radians(rotation)
    x = math.cos(angle) * d[:, 0] - math.sin(angle) * d[:, 2]
    z = math.cos(angle) * d[:, 2] + math.sin(angle) * d[:, 0]
    u = 0.5 + np.arctan2(x, -z) / (2 * math.pi)
    v = np.arctan2(np.hypot(x, z), d[:, 1]) / math.pi
    i, j = u * width - 0.5, v * height - 0.5
    left, above = np.floor(i).astype(int), np.floor(j).astype(int)
    s, t = (i - left)[:, None], (j - above)[:, None]
    at = lambda row, column: pixels[np.clip(row, 0, height - 1), column % width].astype(float)  # noqa: E731
    high, low = ((1 - s) * at(row, left) + s * at(row, left + 1) for row in (above, above + 1))
    return (1 - t) * high + t * low


def sky_scene(rotation: float = 0.0, intensity: float = 1.0, **more: Any) -> vr.Scene:
    fields = {"ambient": BLACK, "lights": {}, "objects": {"far": vr.Sphere(center=(0, -900, 0))}} | more
    return vr.Scene(background=vr.EnvironmentMap(ROOM, rotation, intensity), camera=vr.Camera(), **fields)


def looked_up(scene: vr.Scene, d: np.ndarray) -> np.ndarray:
    s = prepare(scene).kernel
    found = background(s, s.a.W(*np.array(d, float).T))
    return np.array(found).T


@pytest.mark.parametrize("precision, error", [("single", 2**-20), ("double", 2**-49)])
@pytest.mark.parametrize("rotation", [0.0, 90.0, -180.0, 360.0, 1234.5])
def test_the_light_from_directions_is_that_of_the_twin(room, precision, error, rotation) -> None:
    """A place that is wrong by a share of the map gives a colour that is wrong by at most the slope times this."""
    d = np.concatenate([directions(4000), np.eye(3)[::2], -np.eye(3)[::2]])
    scene = sky_scene(rotation, 2.0, settings=vr.Settings(precision=precision))
    slope = 2 * (16 + 8)
    assert np.abs(looked_up(scene, d) - 2 * twin(room, d, rotation)).max() <= slope * error


def test_the_middle_is_towards_minus_z_the_right_half_towards_x_and_the_top_up(room) -> None:
    room[:] = 0
    room[3:5, 7:9, 0] = 1  # the middle
    room[3:5, 11:13, 1] = 1  # three quarters to the right
    room[0, :, 2] = 1  # the upper edge
    write_exr(ROOM, room)
    assert np.allclose(looked_up(sky_scene(), [[0, 0, -1], [1, 0, 0], [0, 1, 0], [-1, 0, 0]]), [*np.eye(3), BLACK])
    assert np.allclose(looked_up(sky_scene(90.0), [[-1, 0, 0], [0, 0, -1], [0, 1, 0], [0, 0, 1]]), [*np.eye(3), BLACK])


def test_a_turn_of_half_the_columns_is_the_map_with_its_halves_exchanged(room) -> None:
    d = directions(500)
    turned = looked_up(sky_scene(180.0), d)
    write_exr(ROOM, np.roll(room, 8, 1))
    assert np.allclose(turned, looked_up(sky_scene(), d), atol=1e-5)
    assert np.allclose(looked_up(sky_scene(360.0), d), looked_up(sky_scene(), d), atol=1e-5)


def test_no_line_is_seen_where_the_edges_meet_and_none_at_the_poles(room) -> None:
    """Across the edge, straight behind, the colour changes by at most the slope; at a pole it is that of the row."""
    angle = np.linspace(-1e-3, 1e-3, 201)
    for latitude in (0.0, 0.7, -1.2):
        y, r = math.sin(latitude), math.cos(latitude)
        d = np.stack([r * np.sin(angle), np.full(201, y), r * np.cos(angle)], 1)
        steps = np.abs(np.diff(looked_up(sky_scene(), d), axis=0))
        assert steps.max() <= 16 / (2 * math.pi) * 1e-5 + 1e-5
    write_exr(ROOM, np.repeat(room[:, :1], 16, 1))
    tilt = np.outer(np.geomspace(1e-9, 1e-3, 20), [1, 0, 1]) + [0, 1, 0]
    assert np.allclose(looked_up(sky_scene(), tilt), room[0, 0], atol=1e-6)
    assert np.allclose(looked_up(sky_scene(), -tilt), room[-1, 0], atol=1e-6)


def test_lanes_without_a_direction_read_some_pixel() -> None:
    wrong = [[math.nan] * 3, [math.inf, 0, 0], [0, 0, 0], [math.inf, -math.inf, math.nan]]
    assert np.isfinite(looked_up(sky_scene(), wrong)).all()


def seen(scene: vr.Scene, size: tuple[int, int] = (24, 18), spp: int = 1) -> np.ndarray:
    return vr.render(scene, size=size, spp=spp, progress=False).layers["RGB"]


def test_a_camera_sees_the_map_and_a_transparent_film_does_not(room) -> None:
    scene = sky_scene(30.0, 1.5, film=vr.Film(width=9, height=7))
    story = vr.why(scene, 2, 3)
    x, y = (2.5 - 4.5), -(3.5 - 3.5)
    camera = scene.camera
    forward = np.subtract(camera.target, camera.origin) / np.linalg.norm(np.subtract(camera.target, camera.origin))
    right = np.cross(forward, camera.up) / np.linalg.norm(np.cross(forward, camera.up))
    pixel = 2 * math.tan(math.radians(camera.fov) / 2) / 7
    d = forward + pixel * (x * right + y * np.cross(right, forward))
    assert np.allclose(story.colour, 1.5 * twin(room, d[None], 30.0)[0], atol=1e-5)
    clear = vr.render(replace(scene, film=vr.Film(width=9, height=7, transparent=True)), spp=1, progress=False)
    assert (clear.layers["A"] == 0).all() and (clear.layers["RGB"] == 0).all()


MIRROR = vr.Material(kd=BLACK, ka=BLACK, kr=WHITE)


@pytest.mark.parametrize("misses", ["background", "ambient"])
def test_a_mirror_ball_shows_the_right_pixel(room, misses) -> None:
    scene = sky_scene(
        70.0,
        materials={"m": MIRROR},
        objects={"ball": vr.Sphere(center=(0, 0, 0), radius=2.0, material="m")},
        ambient=(0.25, 0.5, 0.75),
        film=vr.Film(width=16, height=12),
        settings=vr.Settings(misses=misses),
    )
    for x, y in ((8, 6), (5, 4), (10, 7)):
        story = vr.why(scene, x, y)
        first = story.surfaces[0]
        n, p = np.array(first.normal), np.array(first.point)
        d = (p - scene.camera.origin) / np.linalg.norm(p - scene.camera.origin)
        d = d - 2 * (d @ n) * n
        expected = twin(room, d[None], 70.0)[0] if misses == "background" else scene.ambient
        assert np.allclose(story.colour, expected, atol=1e-4)


def test_it_is_seen_through_glass_that_bends_nothing() -> None:
    pane = vr.Material(kd=BLACK, ka=BLACK, kt=WHITE, ior=1.0)
    behind = sky_scene(materials={"g": pane}, objects={"pane": vr.Sphere(center=(0, 0, 0), material="g")})
    assert np.allclose(seen(behind), seen(sky_scene()), atol=1e-5)


def floor(settings: vr.Settings, normal: tuple = (0, 1, 0), **more: Any) -> vr.Scene:
    """A white floor, seen from near, lit by ambient light alone."""
    n = np.array(normal, float)
    return vr.Scene(
        camera=vr.Camera(origin=tuple((n + 0.01).tolist()), target=BLACK, fov=5.0, up=(0.3, 0.2, 0.9)),
        lights={},
        materials={"white": vr.Material(ka=WHITE, kd=BLACK)},
        objects={"floor": vr.Plane(point=BLACK, normal=normal, material="white")},
        settings=settings,
        **more,
    )


def occlusion(sky: int = 256, light: str = "background", **more: Any) -> vr.Settings:
    return vr.Settings(occlusion=vr.Occlusion(sky=sky, light=light), **more)


def test_a_constant_background_is_the_same_as_ambient_light() -> None:
    grey, lid = (0.25, 0.5, 0.125), {"lid": vr.Sphere(center=(0.5, 1.5, 0), radius=0.4)}
    pair = []
    for settings, more in (
        (occlusion(16), {"background": grey, "ambient": (9.0, 9.0, 9.0)}),
        (occlusion(16, "ambient"), {"background": grey, "ambient": grey}),
    ):
        scene = floor(settings, **more)
        pair.append(seen(replace(scene, objects=scene.objects | lid), (8, 6), spp=2))
    assert np.allclose(*pair, rtol=1e-6) and pair[0].std() > 0
    write_exr(ROOM, np.tile(np.float32(grey), (2, 4, 1)))
    of_map = floor(occlusion(16), background=vr.EnvironmentMap(ROOM), ambient=BLACK)
    of_map = seen(replace(of_map, objects=of_map.objects | lid), (8, 6), spp=2)
    assert np.allclose(pair[0], of_map, rtol=1e-6)


@pytest.mark.parametrize("sampler", ["stratified", "sobol"])
def test_the_mean_over_rays_is_the_irradiance_divided_by_pi(sampler) -> None:
    """A floor under a gradient: the integral of (0.5 + 0.5 y) y / pi over the hemisphere is 1/2 + 1/3. A wall that
    faces the white half of a map gets 1, the wall behind it 0, and a floor between them 1/2."""
    sky = vr.SkyGradient(top=WHITE, bottom=BLACK)
    assert seen(floor(occlusion(sampler=sampler), background=sky), (4, 3)).mean() == pytest.approx(5 / 6, abs=2e-3)
    half = np.zeros((64, 128, 3), np.float32)
    half[:, 64:] = 1  # towards +x
    write_exr(ROOM, half)
    for normal, expected in (((0, 1, 0), 0.5), ((1, 0, 0), 1.0), ((-1, 0, 0), 0.0), ((0, 0, 1), 0.5)):
        scene = floor(occlusion(sampler=sampler), normal, background=vr.EnvironmentMap(ROOM))
        assert seen(scene, (4, 3)).mean() == pytest.approx(expected, abs=4e-3)


def test_rows_of_a_map_light_a_floor_by_their_solid_angle(room) -> None:
    """The irradiance of a map is the sum over a fine grid of directions."""
    d = directions(200_000)
    d[:, 1] = np.abs(d[:, 1])
    expected = (2 * d[:, 1:2] * twin(room, d)).mean(0)
    found = seen(floor(occlusion(1024), background=vr.EnvironmentMap(ROOM)), (4, 3)).reshape(-1, 3).mean(0)
    assert np.allclose(found, expected, atol=5e-3)


SLOW = pytest.mark.slow


@pytest.mark.parametrize("address", ["background.rotation", "background.intensity"])
@pytest.mark.parametrize("case", ["seen", pytest.param("mirrored", marks=SLOW), pytest.param("ambient", marks=SLOW)])
def test_derivatives_are_those_of_differences(room, address, case) -> None:
    """Pixels at whose samples the blend has no kink within the step."""
    ball = {"ball": vr.Sphere(center=(0, 0, 0), radius=1.5, material="m")}
    settings = occlusion(4, precision="double", spp=2) if case == "ambient" else vr.Settings(precision="double", spp=2)
    scene = sky_scene(
        20.0,
        1.25,
        film=vr.Film(width=8, height=6),
        materials={"m": vr.Material(ka=WHITE, kd=BLACK) if case == "ambient" else MIRROR},
        objects={} if case == "seen" else ball,
        settings=settings,
    )
    exact, step = vr.derivative(scene, address), 1e-4
    near = vr.difference(scene, address, step=step)
    agrees = np.abs(exact - near) <= 1e-6 * max(1, np.abs(exact).max())
    assert agrees.mean() > 0.99 and np.abs(exact).max() > 1e-4
    whole = vr.gradient(scene, address)[address]
    assert whole == pytest.approx(exact.mean(), rel=1e-9)


def test_a_dark_map_has_a_derivative_by_its_intensity() -> None:
    scene = sky_scene(0.0, 0.0, film=vr.Film(width=4, height=3), settings=vr.Settings(spp=1, precision="double"))
    bright = replace(scene, background=replace(scene.background, intensity=1.0))
    assert np.allclose(vr.derivative(scene, "background.intensity"), seen(replace(bright), (4, 3)), atol=1e-12)


def test_new_numbers_compile_no_new_kernel() -> None:
    prepared = prepare(sky_scene(settings=occlusion(2), materials={"default": vr.Material(ka=WHITE)}))
    vr.render(prepared, size=(8, 6), spp=1, progress=False)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        for rotation, intensity in ((10.0, 1.0), (0.0, 2.0), (-720.25, 1e-3)):
            prepared = prepared.updated({"background.rotation": rotation, "background.intensity": intensity})
            again = vr.render(prepared, size=(8, 6), spp=1, progress=False).layers["RGB"]
        history = dr.kernel_history([dr.KernelType.JIT])
    assert history and all(kernel["cache_hit"] for kernel in history)
    fresh = vr.render(prepared.scene, size=(8, 6), spp=1, progress=False).layers["RGB"]
    assert (again == fresh).all()


def test_another_file_is_another_picture() -> None:
    write_exr("other.exr", 1 - some())
    prepared = prepare(sky_scene())
    other = prepared.updated({"background.file": "other.exr"})
    fresh = sky_scene()
    fresh = replace(fresh, background=vr.EnvironmentMap("other.exr"))
    assert (
        vr.render(other, size=(8, 6), spp=1).layers["RGB"] == vr.render(fresh, size=(8, 6), spp=1).layers["RGB"]
    ).all()


def test_kinds_of_files_are_read_by_their_content(room) -> None:
    levels = (255 * room).astype(np.uint8)
    Pillow.fromarray(levels).save("sky.png")
    shutil.copy("sky.png", "sky.exr")
    Pillow.fromarray(np.full((8, 16, 3), 128, np.uint8)).save("grey.jpg", quality=100)
    (Path("sky.hdr")).write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n" + bytes([128, 64, 32, 128] * 2))
    linear = lambda c: np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)  # noqa: E731
    maps = {
        name: environment.read_map(vr.EnvironmentMap(name)) for name in ("sky.png", "sky.exr", "grey.jpg", "sky.hdr")
    }
    assert np.allclose(maps["sky.png"], linear(levels / 255), atol=1e-6)
    assert (maps["sky.exr"] == maps["sky.png"]).all()
    assert np.allclose(maps["grey.jpg"], linear(np.array(128 / 255)), atol=5e-3)
    assert np.allclose(maps["sky.hdr"], np.array([128, 64, 32]) / 256)


def refused(scene: vr.Scene) -> str:
    with pytest.raises(vr.UserError) as caught:
        prepare(scene)
    assert len(caught.value.lines) == 1
    return str(caught.value)


def test_what_is_wrong_with_a_file_is_said(room) -> None:
    assert "there is no such file; did you mean" in refused(
        replace(sky_scene(), background=vr.EnvironmentMap("rooms.exr"))
    )
    Path("folder.exr").mkdir()
    assert "is a folder" in refused(replace(sky_scene(), background=vr.EnvironmentMap("folder.exr")))
    Path("text.hdr").write_text("no picture")
    said = refused(replace(sky_scene(), background=vr.EnvironmentMap("text.hdr")))
    assert said.endswith("is not a PNG, JPEG, EXR or HDR picture; save it as one of them")
    for bad, shown in ((-0.5, "-0.5"), (math.nan, "nan"), (math.inf, "inf")):
        wrong = room.copy()
        wrong[2, 3, 1] = wrong[5, 6, 0] = wrong[5, 6, 2] = bad
        write_exr(ROOM, wrong)
        said = refused(sky_scene())
        assert said.startswith(f'background.file = "{ROOM}": is {shown} at pixel (x 3, y 2) and wrong at 1 more; ')
    half = room.astype(np.float16)
    half[0, 0] = np.inf
    write_exr(ROOM, half)
    assert "is inf at pixel (x 0, y 0); a colour is a number from 0 to 1e+09" in refused(sky_scene())


@pytest.mark.parametrize(
    "shape, right", [((8, 8), "8 x 4"), ((4, 9), "8 x 4"), ((2, 3), "4 x 2"), ((1, 1), "2 x 1"), ((3, 3), "4 x 2")]
)
def test_a_map_that_is_not_twice_as_wide_as_high_is_refused(shape, right) -> None:
    write_exr(ROOM, np.ones((*shape, 3), np.float32))
    said = refused(sky_scene())
    assert f"has {shape[1]} x {shape[0]} pixels, and an equirectangular map is twice as wide as high; " in said
    assert said.endswith(f"convert it, to {right} for example")


def test_maps_that_are_a_part_of_a_picture_or_have_no_colour_are_refused() -> None:
    corners = {"dataWindow": ((0, 2), (7, 5)), "displayWindow": ((0, 0), (15, 7))}
    windows = {key: tuple(np.array(x, np.int32) for x in window) for key, window in corners.items()}
    OpenEXR.File({"type": OpenEXR.scanlineimage} | windows, {"RGB": np.ones((4, 8, 3), np.float32)}).write(ROOM)
    assert refused(sky_scene()).endswith(
        "has the data window [0, 2, 7, 5] in the display window [0, 0, 15, 7]; save the whole picture"
    )
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Z": np.ones((4, 8), np.float32)}).write(ROOM)
    assert refused(sky_scene()).endswith("has no layer RGB but Z; save the colour as R, G and B")


def flawed(tmp_path: Path, **fields: Any) -> list[str]:
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(fields))
    with pytest.raises(vr.UserError) as caught:
        vr.load(path)
    return [text.removeprefix(f"{path}: ") for text in caught.value.lines]


def test_wrong_fields_are_said_in_one_line_each(tmp_path) -> None:
    assert flawed(tmp_path, background={"file": ROOM, "intensity": 1e30}) == [
        "background.intensity = 1e+30: must be at most 1e+09"
    ]
    assert flawed(tmp_path, background={"file": ROOM, "rotation": "x"}) == [
        'background.rotation = "x": must be a number (degrees about y)'
    ]
    assert flawed(tmp_path, background={"file": ROOM, "intensty": 2}) == [
        "background.intensty: unknown key; did you mean 'intensity'? (one of file, rotation, intensity)"
    ]
    assert flawed(tmp_path, background={"rotation": 2}) == ["background: the key 'file' is missing; it is a string"]
    assert flawed(tmp_path, background={"top": [1, 1, 1]})[0].startswith("background: the key 'bottom' is missing")
    assert len(flawed(tmp_path, background=[1, 2])) == 1
    right = 'background = "a/Sky.PNG": is no colour; write {"file": "a/Sky.PNG"} for an environment map'
    assert flawed(tmp_path, background="a/Sky.PNG") == [right]
    with pytest.raises(vr.UserError, match=f"^Scene: {re.escape(right)}$"):
        vr.Scene(background="a/Sky.PNG")
    assert vr.Scene(background="tomato").background == "tomato"
    assert flawed(tmp_path, settings={"occlusion": {"light": "background"}}) == [
        'settings.occlusion.light = "background": needs rays that bring it; set settings.occlusion.sky, to 16 say'
    ]


def test_a_scene_reads_maps_below_its_folder_only(tmp_path, room) -> None:
    (tmp_path / "inner").mkdir()
    shutil.copy(ROOM, tmp_path / "inner" / ROOM)
    path = tmp_path / "inner" / "scene.json"
    path.write_text(json.dumps({"background": {"file": ROOM}}))
    assert Path(vr.load(path).background.file).resolve() == (tmp_path / "inner" / ROOM).resolve()
    path.write_text(json.dumps({"background": {"file": f"../{ROOM}"}}))
    with pytest.raises(vr.UserError, match="is outside of the scene's folder"):
        vr.load(path)
    outside = vr.load(path, allow_outside=True)
    assert files_of(outside) and vr.dump(outside, tmp_path).count(f'"file": "{ROOM}"') == 1


def test_the_content_of_the_map_counts_for_the_hash_and_for_whoever_watches(room, tmp_path) -> None:
    path = tmp_path / "scene.json"
    path.write_text(json.dumps({"background": {"file": ROOM, "rotation": 5}}))
    scene = vr.load(path)
    before, watch = scene.hash(), FileWatch(path, lambda: vr.load(path), scene)
    write_exr(ROOM, 1 - room)
    assert vr.load(path).hash() != before
    assert watch.look() is None and watch.look() is not None
    write_exr(ROOM, -room)
    assert watch.look() is None and watch.look() is None
    assert watch.lines[0].startswith("background.file = ")


def test_a_scene_travels_with_its_map(tmp_path) -> None:
    scene = sky_scene(12.0)
    there = ScenePackage.of(scene).unpacked(tmp_path / "there")
    assert Path(there.background.file).read_bytes() == Path(ROOM).read_bytes()
    assert (seen(there) == seen(scene)).all()


def test_sliders_move_rotation_and_intensity() -> None:
    turn, light = (control(sky_scene(30.0), f"background.{name}", 5.0) for name in ("rotation", "intensity"))
    assert (turn.kind, turn.low, turn.high, turn.value) == ("angle", -180.0, 180.0, 30.0)
    assert (light.kind, light.low, light.value) == ("number", 0.0, 1.0) and light.high >= 2


def test_what_costs_memory_and_what_counts_twice_is_said(monkeypatch) -> None:
    assert environment_notes(sky_scene()) == []
    monkeypatch.setattr("visray.environment_report.LARGE", 100)
    assert LARGE == 8192 * 4096
    assert environment_notes(sky_scene())[0].startswith(f'background.file = "{ROOM}": 16 x 8 pixels take 0.0 GiB')
    monkeypatch.undo()
    twice = floor(replace(occlusion(4), scatter=vr.Scatter(rays=2)), background=WHITE)
    twice = replace(twice, materials={"white": vr.Material(ka=WHITE, kd=WHITE)})
    with pytest.warns(EnvironmentWarning, match="materials.white gets the background twice"):
        prepare(twice)


def test_what_lights_nothing_is_said(room) -> None:
    """Not if there is a light, or if the settings bring the light, or if nothing could be lit."""
    glowing = {"m": vr.Material(), "lamp": vr.Material(emission=2.0)}
    objects = {"floor": vr.Plane(material="m"), "lamp": vr.Sphere((0, 1, 0), material="lamp")}
    lone = vr.Scene(camera=vr.Camera(), lights={}, materials=glowing, objects=objects)
    mapped = replace(lone, background=vr.EnvironmentMap(ROOM))
    assert unlit_notes(lone)[0].startswith("materials.lamp: emission lights nothing")
    (text,) = unlit_notes(mapped)
    assert text.startswith("the environment map lights nothing by itself") and text in vr.explain(mapped).notes
    for scene in (lone, mapped):
        dark = {"off": vr.PointLight((0, 5, 0), intensity=0.0)}
        assert unlit_notes(replace(scene, lights=dark)) == unlit_notes(scene)
        scattering = vr.Settings(scatter=vr.Scatter(rays=1))
        changes = [
            {"lights": {"key": vr.PointLight((0, 5, 0))}}, {"settings": scattering}, {"settings": occlusion()},
            {"settings": vr.Settings(shading="normal")}, {"objects": {"lamp": objects["lamp"]}},
        ]  # fmt: skip
        assert not any(unlit_notes(replace(scene, **change)) for change in changes)
    assert not unlit_notes(replace(lone, materials=glowing | {"lamp": vr.Material()}))


def test_a_left_out_map_is_white() -> None:
    prepared = prepare(sky_scene(0.0, 0.5), without=("environment map",))
    assert not prepared.features["environment map"] and features(sky_scene())["environment map"]
    assert np.allclose(vr.render(prepared, size=(8, 6), spp=1).layers["RGB"], 0.5)


def test_mitsuba_gets_rows_at_the_poles(room) -> None:
    """Blended along a meridian, the rows that Mitsuba gets are those of the map."""
    rows = rows_at_poles(room)
    assert rows.shape == (17, 16, 3)
    latitude = np.random.default_rng(3).uniform(0, 1, 300)
    d = np.stack([0 * latitude, np.cos(math.pi * latitude), -np.sin(math.pi * latitude)], 1)
    j = np.minimum((latitude * 16).astype(int), 15)
    t = (latitude * 16 - j)[:, None]
    middle = (rows[:, 7] + rows[:, 8]) / 2
    assert np.allclose((1 - t) * middle[j] + t * middle[j + 1], twin(room, d), atol=1e-6)


@pytest.mark.parametrize("rotation", [0.0, 37.0])
def test_mitsuba_sees_the_same_light(room, rotation) -> None:
    mi.set_variant("llvm_ad_rgb")
    d = directions(2000, 4)
    assert np.allclose(
        environment_light(vr.EnvironmentMap(ROOM, rotation, 2.0), d), 2 * twin(room, d, rotation), atol=2e-4
    )
