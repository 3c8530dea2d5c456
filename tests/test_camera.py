"""Cameras: distances of a perspective camera in single precision. The orthographic camera: rays that are parallel,
start on the camera's plane, and show what closed forms say."""

import json
from dataclasses import replace
from typing import Any, get_args

import drjit as dr
import numpy as np
import pytest
from samples import NAMES, SAMPLES, array
from test_updated import compiled

import visray as vr
from visray import integrator
from visray.accel.intersect import closest
from visray.accel.policy import Accelerator
from visray.address_index import AddressIndex
from visray.camera import ParallelView
from visray.cli import main
from visray.geometry import gamma
from visray.passes import expose
from visray.scene.check import examined
from visray.scene.write import dump
from visray.setup import prepare
from visray.study.mitsuba import crosscheck

# Neither along an axis nor near one.
TILTED = vr.OrthographicCamera(origin=(4.0, 3.0, 5.0), target=(0.1, -0.2, 0.3), up=(0.2, 1.0, 0.1), height=3.0)
FILM = vr.Film(width=60, height=40)
PRECISIONS = pytest.mark.parametrize("precision", ["single", "double"])


def scene_of(camera: Any, objects: dict, **more: Any) -> vr.Scene:
    given = {"camera": camera, "film": FILM, "objects": objects, "settings": vr.Settings(spp=2), "lights": {}}
    return vr.Scene(**given | more)


def layers(scene: vr.Scene, *names: str) -> list[np.ndarray]:
    image = vr.render(scene, spp=1, layers=("RGB", *names), progress=False)
    return [np.array(image[name], float) for name in names]


def axes(camera: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Right, up and forward."""
    view = np.subtract(camera.target, camera.origin)
    forward = view / np.linalg.norm(view)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    return right, np.cross(right, forward), forward


def sheet(camera: Any, film: vr.Film) -> np.ndarray:
    """Where the rays through the pixels' centres start. Shape: (H, W, 3)."""
    right, up, _ = axes(camera)
    size = camera.height / film.height
    x = (np.arange(film.width) + 0.5 - film.width / 2) * size
    y = (film.height / 2 - np.arange(film.height) - 0.5) * size
    return np.array(camera.origin) + x[None, :, None] * right + y[:, None, None] * up


# What is seen


@PRECISIONS
def test_rays_are_parallel_and_start_on_the_sheet(precision: str) -> None:
    made = prepare(scene_of(TILTED, {}, settings=vr.Settings(precision=precision)))
    x, y = (np.array(v, float) for v in (made.x, made.y))
    ray = integrator.camera_ray(made.kernel, made.a.F(x) + 0.5, made.a.F(y) + 0.5)
    dr.eval(ray)
    forward = axes(TILTED)[2]
    assert array(ray.d).shape == (1, 3) and np.abs(array(ray.d) - forward).max() <= gamma(20)
    where = sheet(TILTED, FILM)[y.astype(int), x.astype(int)]
    assert np.abs(array(ray.o) - where).max() <= gamma(40) * 10
    view = made.kernel.view
    assert isinstance(view, ParallelView)
    for ours, truth in zip((view.right, view.up, view.forward), axes(TILTED)):
        assert np.abs(array(ours) - truth).max() <= gamma(20)
    assert abs(view.half_height[0] - 1.5) <= gamma(2) and abs(view.half_width[0] - 2.25) <= gamma(4)


@pytest.mark.parametrize("distance", [2.0, 50.0, 1e6])
def test_a_unit_sphere_covers_the_same_area_at_any_distance(distance: float) -> None:
    """Its disk has the area pi. The edge of a disk of radius r crosses at most 8 r / pixel + 4 pixels."""
    forward = axes(TILTED)[2]
    camera = replace(TILTED, origin=tuple((-distance * forward).tolist()), target=(0.0, 0.0, 0.0))
    (seen,) = layers(scene_of(camera, {"ball": vr.Sphere()}), "id")
    pixel = camera.height / FILM.height
    assert abs((seen > 0).sum() * pixel**2 - np.pi) <= (8 / pixel + 4) * pixel**2


@PRECISIONS
def test_hits_are_where_the_closed_form_says(precision: str) -> None:
    """On a sphere: depth along the view is that of its middle, less the root of r^2 - distance from the axis^2."""
    middle, r = np.array([0.2, -0.1, 0.4]), 1.1
    objects = {"ball": vr.Sphere(center=tuple(middle.tolist()), radius=r)}
    scene = scene_of(TILTED, objects, settings=vr.Settings(precision=precision))
    seen, p, z, distance, n = layers(scene, "id", "P", "Z", "distance", "N")
    o, forward = sheet(TILTED, FILM), axes(TILTED)[2]
    along = (middle - o) @ forward
    aside = np.linalg.norm(middle - o - along[..., None] * forward, axis=-1)
    clear = np.abs(aside - r) > 1e-9  # no centre of a pixel is so near the silhouette
    assert clear.all() and np.array_equal(seen > 0, aside < r)
    t = (along - np.sqrt(np.maximum(r * r - aside**2, 0)))[seen > 0]
    truth = o[seen > 0] + t[:, None] * forward
    # Files have single precision. Near the silhouette the root multiplies rounding of double precision.
    assert np.abs(p[seen > 0] - truth).max() <= gamma(4, "single") * 10
    assert np.abs(n[seen > 0] - (truth - middle) / r).max() <= gamma(20, "single")
    assert np.abs(distance[seen > 0] - t).max() <= gamma(4, "single") * 10
    assert np.array_equal(z, distance) and np.isinf(z[seen == 0]).all()


def test_depth_is_constant_on_a_plane_across_the_view() -> None:
    forward = axes(TILTED)[2]
    point = np.array(TILTED.origin) + 7 * forward
    wall = vr.Plane(point=tuple(point.tolist()), normal=tuple((-forward).tolist()))
    z, distance = layers(scene_of(TILTED, {"wall": wall}), "Z", "distance")
    # To within the last bit of single precision, in which files are.
    assert np.abs(z - 7).max() <= 7 * gamma(1, "single") and np.abs(distance - 7).max() <= 7 * gamma(1, "single")


def test_what_lies_behind_the_camera_is_not_seen() -> None:
    forward = axes(TILTED)[2]
    behind = np.array(TILTED.origin) - 1.2 * forward
    ball = vr.Sphere(center=tuple(behind.tolist()))
    assert not layers(scene_of(TILTED, {"ball": ball}), "id")[0].any()
    # A ball that the camera's plane cuts is seen from inside: the far half of it.
    cut = vr.Sphere(center=tuple((behind + 0.9 * forward).tolist()))
    seen, z, n = layers(scene_of(TILTED, {"ball": cut}), "id", "Z", "N")
    inside = np.linalg.norm(sheet(TILTED, FILM) - np.array(cut.center), axis=-1) < 1
    assert np.array_equal(seen > 0, inside) and (z[inside] <= 0.7).all()
    assert ((n @ forward)[inside] < 0).all()


@pytest.mark.parametrize("at", [(0.0, 0.0, 0.0), (3.0, -7.0, 5.0), (1e6, -2e6, 5e5)])
@pytest.mark.parametrize("tilted", [False, True])
def test_what_lies_in_the_camera_s_plane_is_not_seen(at: tuple, tilted: bool) -> None:
    """A wall, a rectangle, a disk, and a box behind the plane with one face in it. Of a box before it, its far side."""
    view = np.array([-0.3, -0.5, -0.8] if tilted else [0.0, 0.0, -1.0])
    camera = vr.OrthographicCamera(origin=at, target=tuple(np.add(at, 6 * view).tolist()), height=4.0)
    right, up, forward = axes(camera)
    place = lambda *v: tuple(np.add(at, v[0] * right + v[1] * up - v[2] * forward).tolist())  # noqa: E731
    columns = zip(np.array([right, up, -forward]).T.tolist(), at)
    to_view = vr.Matrix(matrix=tuple((*row, float(o)) for row, o in columns))
    flat = {
        "wall": vr.Plane(point=place(0.3, 0.2, 0), normal=tuple((-forward).tolist())),
        "rectangle": vr.Rectangle(center=at, width=tuple(right.tolist()), height=tuple(up.tolist())),
        "disk": vr.Disk(center=at, normal=tuple(forward.tolist())),
        "box": vr.Box(min=(-1, -1, 0), max=(1, 1, 2), transform=(to_view,)),
    }
    for name, shape in flat.items():
        assert not layers(scene_of(camera, {name: shape}), "id")[0].any(), name
    box = vr.Box(min=(-1, -1, -2), max=(1, 1, 0), transform=(to_view,))
    seen, z = layers(scene_of(camera, {"box": box}), "id", "Z")
    assert (seen > 0).sum() == 400
    assert np.abs(z[seen > 0] - 2).max() <= 2 * gamma(4, "single") + gamma(64) * np.abs(at).sum()


def test_parallel_lines_stay_parallel_and_equal_lengths_equal() -> None:
    """Two posts, one far behind the other, are the same pixels, moved."""
    camera = vr.OrthographicCamera(origin=(0, 0, 9), target=(0, 0, 0), height=4.0)
    post = vr.Box(min=(-1.2, -1, 0), max=(-0.8, 1, 0.4))
    far = vr.Box(min=(0.8, -1, -300), max=(1.2, 1, -299.6))
    (seen,) = layers(scene_of(camera, {"near": post, "far": far}), "id")
    assert np.array_equal(seen == 1, np.roll(seen == 2, -20, axis=1)) and (seen == 1).sum() == 4 * 20


def test_it_is_the_limit_of_a_perspective_camera_far_away() -> None:
    """At distance D with the same extent of the target, places differ by at most |depth| |place| / D."""
    objects = {"ball": vr.Sphere(center=(0.3, 0.2, 0.5)), "box": vr.Box(min=(-1.4, -1, -1))}
    fov = 0.1
    distance = 0.5 * TILTED.height / np.tan(np.radians(fov / 2))
    origin = tuple((np.array(TILTED.target) - distance * axes(TILTED)[2]).tolist())
    pinhole = vr.Camera(origin=origin, target=TILTED.target, up=TILTED.up, fov=fov)
    p, seen = layers(scene_of(TILTED, objects), "P", "id")
    q, also = layers(scene_of(pinhole, objects), "P", "id")
    assert (seen != also).mean() < 0.01
    both = (seen == also) & (seen > 0)
    right, up, _ = axes(TILTED)
    moved = np.abs((p - q)[both] @ np.array([right, up]).T)
    # Depths are below 2 and places below 2.7. Directions have a few roundings of single precision.
    assert both.mean() > 0.3 and moved.max() <= 2 * 2.7 / distance + gamma(8, "single") * distance


# Every way to find objects


def first_hits(scene: vr.Scene, accelerator: str, brute_force: bool = False) -> list[bytes]:
    """Numbers of the first hits of a scene whose objects are found in some way."""
    way = replace(scene, settings=replace(scene.settings, accelerator=accelerator))
    made = prepare(way, brute_force=brute_force)
    ray = integrator.camera_ray(made.kernel, made.a.F(made.x) + 0.5, made.a.F(made.y) + 0.5)
    hit = closest(integrator.camera_origin(made.kernel, ray), ray, brute_force)
    dr.eval(hit)
    return [np.array(hit.t).tobytes(), np.array(hit.row).tobytes()]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_every_way_to_find_objects_gives_the_same_hits(name: str) -> None:
    """A few objects of a kind, and more than are unrolled. Bit for bit those of brute force."""
    rng = np.random.default_rng(5)
    for count in (3, 40):
        objects = {}
        for i in range(count):
            angle, *move = (float(x) for x in rng.uniform(-2, 2, 4))
            steps = vr.Scale(scale=0.4), vr.Rotate(rotate=90 * angle, axis=(1, 2, 3)), vr.Translate(translate=move)
            objects[str(i)] = replace(SAMPLES[name].posed, transform=steps)
        scene = scene_of(replace(TILTED, height=6.0), objects)
        truth = first_hits(scene, "auto", brute_force=True)
        assert len(set(np.frombuffer(truth[1], np.uint32))) > 1
        for accelerator in get_args(Accelerator):
            assert first_hits(scene, accelerator) == truth, (count, accelerator)


@pytest.mark.slow
def test_all_effects_forced_give_the_same_bits() -> None:
    scene = scene_of(TILTED, {"ball": vr.Sphere(), "floor": vr.Plane(point=(0, -1, 0))},
                     lights={"key": vr.PointLight(position=(2, 5, 3))})  # fmt: skip
    one, two = (np.array(expose(prepare(scene, everything=forced))[0].mean) for forced in (False, True))
    assert one.tobytes() == two.tobytes()
    defocus = next(f for f in prepare(scene, everything=True).features.listed if f.name == "defocus")
    assert (defocus.on, defocus.reason) == (False, "an orthographic camera has no lens")


@pytest.mark.slow
def test_glass_mirrors_soft_shadows_and_certificates_work() -> None:
    """Through each path of the kernel once. The core is inside the glass: no ray from the camera meets it first."""
    scene = scene_of(
        TILTED,
        {"floor": vr.Plane(point=(0, -1, 0), material="mirror"), "glass": vr.Sphere(radius=0.8, material="glass"),
         "core": vr.Sphere(radius=0.3, material="glass"), "ring": vr.Torus(center=(1, 0, 0), major=0.6, minor=0.2)},
        materials={"mirror": vr.Material(kr=(0.5, 0.5, 0.5)), "glass": vr.Material(kt=(0.9, 0.8, 0.9), ior=1.4)},
        lights={"pane": vr.RectangleLight(position=(1, 4, 2), width=(1, 0, 0), height=(0, 0, 1))},
        settings=vr.Settings(spp=4, depth=3, occlusion=vr.Occlusion(sky=2)),
    )  # fmt: skip
    image = vr.render(scene, layers=("RGB", "unresolved", "residual", "id"), progress=False)
    assert np.isfinite(image["RGB"]).all() and set(np.unique(image["id"])) == {1, 2, 4}
    assert not image["unresolved"].any() and image["residual"][image["id"] == 4].max() < 32


def test_a_picture_to_an_error_states_one() -> None:
    scene = scene_of(TILTED, {"ball": vr.Sphere()}, lights={"key": vr.PointLight(position=(2, 5, 3))})
    image = vr.render(scene, error=0.02, progress=False)
    assert 0 < image.metadata["error"] <= image.metadata["error_high"] <= 0.02


# The witness


def test_mitsubas_own_orthographic_camera_sends_the_same_rays() -> None:
    """Its picture is as wide as the scale of `to_world`, twice; it starts rays at the distance `near_clip`. Positions
    and directions are in single precision."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("llvm_ad_rgb")
    t, wide = mi.ScalarTransform4f, 0.5 * TILTED.height * FILM.width / FILM.height
    to_world = t().look_at(origin=list(TILTED.origin), target=list(TILTED.target), up=list(TILTED.up))
    near, film = 2.0**-10, {"type": "hdrfilm", "width": FILM.width, "height": FILM.height}
    sensor = mi.load_dict(
        {"type": "orthographic", "near_clip": near, "to_world": to_world @ t().scale([wide, wide, 1]), "film": film}
    )
    y, x = np.divmod(np.arange(FILM.width * FILM.height), FILM.width)
    pixels = mi.Point2f((x + 0.5) / FILM.width, (y + 0.5) / FILM.height)
    theirs, _ = sensor.sample_ray(0, 0.5, pixels, mi.Point2f(0.5))
    forward, slack = axes(TILTED)[2], gamma(32, "single")
    assert np.abs(array(theirs.d) - forward).max() <= slack
    assert np.abs(array(theirs.o) - near * forward - sheet(TILTED, FILM).reshape(-1, 3)).max() <= slack * 10


@pytest.mark.slow
def test_mitsuba_agrees() -> None:
    objects = {name: SAMPLES[name].random(np.random.default_rng(i), 1.0) for i, name in enumerate(NAMES)}
    floor = {"floor": vr.Plane(point=(0, -1.5, 0), normal=(0.1, 1, 0))}
    scene = scene_of(replace(TILTED, height=6.0), objects | floor, lights={"key": vr.PointLight(position=(2, 9, 4))})
    report = crosscheck.check(scene, rays=2000)
    assert report.passed, report.as_json()
    assert report.pixels.hits > 0.9 * report.pixels.rays and report.picture.compared > 0.9 * report.picture.pixels


# What is told, written, moved and derived


def test_explain_names_the_family_of_parallel_rays() -> None:
    families = vr.explain(scene_of(TILTED, {"ball": vr.Sphere()})).rays
    assert [f.rays for f in families] == ["camera, parallel"]


def test_the_matrices_of_the_metadata_lead_back_to_the_pixels() -> None:
    scene = scene_of(TILTED, {"ball": vr.Sphere()})
    image = vr.render(scene, spp=1, layers=("RGB", "P", "id", "Z"), progress=False)
    seen = np.array(image["id"]) > 0
    p = np.concatenate([np.array(image["P"], float)[seen], np.ones((seen.sum(), 1))], 1)
    x, y, z, w = (p @ np.array(image.metadata["worldToNDC"])).T
    rows, columns = np.nonzero(seen)
    slack = gamma(16, "single") * 10
    assert np.abs(x / w - (columns + 0.5) / FILM.width).max() <= slack
    assert np.abs(y / w - (rows + 0.5) / FILM.height).max() <= slack
    assert np.abs(z / w - np.array(image["Z"])[seen]).max() <= slack
    assert np.abs((p @ np.array(image.metadata["worldToCamera"]))[:, 2] - z).max() <= slack


def test_a_moved_camera_compiles_nothing() -> None:
    made = vr.prepare(scene_of(TILTED, {"ball": vr.Sphere(), "box": vr.Box(min=(-2, -1, -1), max=(-1, 1, 1))}))
    render = lambda m: vr.render(m, layers=("RGB", "id", "Z"), progress=False)["RGB"]  # noqa: E731
    render(made)
    change = {"camera.origin": (3.0, 3.5, 5.0), "camera.height": 2.5, "camera.up": (0.0, 1.0, 0.1)}
    render(made.updated(change))
    assert compiled(lambda: render(made.updated({"camera.height": 4.5, "camera.target": (0.5, 0.0, 0.0)}))) == 0
    new = made.updated(change)
    assert np.array_equal(render(new), render(new.scene)) and not np.array_equal(render(new), render(made))


def test_another_type_of_camera_is_prepared_anew() -> None:
    pinhole = vr.prepare(scene_of(vr.Camera(), {"ball": vr.Sphere()}))
    parallel = pinhole.updated({"camera.type": "orthographic", "camera.height": 3.0})
    assert parallel.scene.camera == vr.OrthographicCamera(height=3.0)
    for made in (parallel, parallel.updated({"camera.type": "perspective"})):
        again = vr.render(made.scene, progress=False)["RGB"]
        assert np.array_equal(vr.render(made, progress=False)["RGB"], again)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::visray.EdgeWarning")
@pytest.mark.parametrize("address", ["camera.height", "camera.origin", "camera.target", "camera.up"])
def test_derivatives_by_the_camera_are_those_of_differences(address: str) -> None:
    """On one surface that fills the picture, so that no edge moves; forward and reverse."""
    scene = scene_of(
        replace(TILTED, height=0.8),
        {"ball": vr.Sphere(center=(0.1, -0.2, 0.3), radius=1.5, material="shiny")},
        film=vr.Film(width=6, height=4),
        materials={"shiny": vr.Material(ks=(0.5, 0.4, 0.3), shininess=5.0, kr=(0.2, 0.2, 0.2))},
        lights={"key": vr.PointLight(position=(4, 6, 5), b=0.1)},
        background=vr.SkyGradient(top=(0.2, 0.3, 0.9), bottom=(1.0, 0.8, 0.6)),
        settings=vr.Settings(spp=4, depth=1),
    )
    slope, truth = vr.derivative(scene, address), vr.difference(scene, address, step=1e-5)
    # The differences have an error of 1e-10 times the third derivative, and 1e-11 of rounding.
    assert np.abs(truth).max() > 1e-3 and np.abs(slope - truth).max() <= 1e-7 * max(1, np.abs(truth).max())
    mean = np.sum(vr.gradient(scene, address)[address])
    assert abs(mean - slope.mean()) <= gamma(2000) * np.abs(slope).max()


def test_only_its_own_numbers_have_derivatives() -> None:
    made = prepare(scene_of(TILTED, {}))
    index = AddressIndex(made.scene, made.packed)
    assert index.slot("camera.height").arrays[0] is made.packed.camera.height
    with pytest.raises(vr.UserError, match=r"camera.fov: an orthographic camera has none; write height"):
        index.slot("camera.fov")
    with pytest.raises(vr.UserError, match=r"camera.type: has no derivative; those of camera are origin, target, up"):
        index.slot("camera.type")


# Files, and the command line


def test_the_command_line_changes_the_type(tmp_path: Any, capsys: pytest.CaptureFixture) -> None:
    file, written = tmp_path / "scene.json", tmp_path / "a.exr"
    file.write_text(dump(scene_of(vr.Camera(fov=20.0), {"ball": vr.Sphere()})))
    words = ["render", str(file), "-o", str(written), "--quiet", "--set", "camera.type=orthographic"]
    assert main([*words, "--set", "camera.height=3"]) == 0
    expected = vr.render(scene_of(vr.OrthographicCamera(height=3.0), {"ball": vr.Sphere()}), progress=False)
    assert np.array_equal(vr.Image.read(written)["id"], expected["id"])
    capsys.readouterr()
    assert main([*words, "--set", "camera.fov=3"]) == 2
    assert capsys.readouterr().err == f"visray: camera.fov: {WRONG_FOV}\n"


WRONG_FOV = "an orthographic camera has none; write height, the vertical extent of the picture in world units"
WRONG = {
    '{"type": "orthographic", "fov": 30}': f"camera.fov = 30: {WRONG_FOV}",
    '{"type": "orthographic", "aperture": 0.2}': "camera.aperture = 0.2: an orthographic camera has no lens; leave it "
    "out",
    '{"type": "orthographic", "focus": 2}': "camera.focus = 2: an orthographic camera has no lens; leave it out",
    '{"height": 3}': 'camera.height = 3: a perspective camera has none; write fov, or "type": "orthographic"',
    '{"type": "perspective", "height": 3}': "camera.height = 3: a perspective camera has none; write fov, or "
    '"type": "orthographic"',
    '{"type": "orthographic", "height": 0}': "camera.height = 0: must be greater than 0",
    '{"type": "orthographic", "height": 1e-12}': "camera.height = 1e-12: must be at least 1e-09",
    '{"type": "orthographic", "height": 1e12}': "camera.height = 1000000000000.0: must be at most 1e+09",
    '{"type": "orthographic", "height": "tall"}': 'camera.height = "tall": must be a number (world units, > 0)',
    '{"type": "orthographic", "hight": 2}': "camera.hight: unknown key; did you mean 'height'? (one of type, origin, "
    "target, up, shutter, height)",
    '{"type": "orthographic", "origin": [0, 0, 0]}': "camera.target = [0.0, 0.0, 0.0]: must differ from origin",
    '{"type": "orthographic", "up": [0, 1, 6]}': "camera.up = [0.0, 1.0, 6.0]: must not be parallel to the view "
    "direction, target - origin",
    '{"type": "fisheye"}': 'camera.type = "fisheye": unknown type; one of perspective, orthographic',
    '{"type": null}': "camera.type = null: unknown type; one of perspective, orthographic",
    '{"type": ["orthographic"]}': 'camera.type = ["orthographic"]: unknown type; one of perspective, orthographic',
    "7": "camera = 7: must be an object {...} with a type: one of perspective, orthographic, or null",
}


@pytest.mark.parametrize("text", WRONG)
def test_a_wrong_camera_is_told_in_one_line(text: str) -> None:
    assert examined({"camera": json.loads(text)})[1] == [WRONG[text]]


def test_a_camera_without_a_type_is_perspective() -> None:
    for raw in ({}, {"fov": 30}, {"type": "perspective", "aperture": 0.1}):
        scene, flaws = examined({"camera": raw})
        assert not flaws and type(scene.camera) is vr.Camera


@pytest.mark.parametrize("camera", [vr.Camera(), vr.Camera(fov=30.0), vr.OrthographicCamera(), TILTED])
def test_a_written_camera_is_read_back(camera: Any) -> None:
    raw = json.loads(dump(vr.Scene(camera=camera, lights={})))
    assert examined(raw)[0].camera == camera
    # The type is written only if it is not that of a camera without a type.
    assert raw.get("camera", {}).get("type") == (None if type(camera) is vr.Camera else "orthographic")


def test_a_type_that_is_set_keeps_what_both_types_have() -> None:
    scene = vr.Scene(camera=vr.Camera(origin=(1.0, 2.0, 3.0), fov=12.0, aperture=0.5), lights={})
    parallel = vr.replaced(scene, "camera.type", "orthographic").camera
    assert parallel == vr.OrthographicCamera(origin=(1.0, 2.0, 3.0))
    same = vr.replaced(scene, "camera.type", "perspective").camera
    assert same == vr.Camera(origin=(1.0, 2.0, 3.0), fov=12.0, aperture=0.5)
    wrong = {
        "camera.height": (3.0, r"camera.height: a perspective camera has none; write fov"),
        "camera.depth": (3.0, r"camera.depth: camera has no 'depth'; one of "),
        "camera.type": ("fish", r'camera.type = "fish": unknown type; one of perspective, orthographic'),
    }
    for address, (value, says) in wrong.items():
        with pytest.raises(vr.UserError, match=says):
            vr.replaced(scene, address, value)


# A perspective camera in single precision


@pytest.mark.parametrize("fov", [5.0, 40.0, 90.0, 150.0])
def test_the_distance_of_a_floor_seen_at_a_small_angle(fov: float) -> None:
    """docs/exr.md: 8 roundings of the direction in single, so the distance is off by that over the angle's sine."""
    film, height = vr.Film(width=160, height=120), 0.7
    camera = vr.Camera(origin=(0.3, height, 0.7), target=(0.1, height - 0.01, -1.0), fov=fov)
    right, up, forward = axes(camera)
    size = 2 * np.tan(np.radians(fov) / 2) / film.height
    x = (np.arange(film.width) + 0.5 - film.width / 2) * size
    y = (film.height / 2 - np.arange(film.height) - 0.5) * size
    d = forward + x[None, :, None] * right + y[:, None, None] * up
    sine = -d[..., 1] / np.linalg.norm(d, axis=-1)
    for precision, error in (("single", gamma(8, "single")), ("double", gamma(64))):
        scene = scene_of(camera, {"floor": vr.Plane()}, film=film, settings=vr.Settings(spp=1, precision=precision))
        (distance,) = layers(scene, "distance")
        below = np.isfinite(distance)
        assert np.array_equal(below, sine > 0)
        off = np.abs(distance[below] * sine[below] / height - 1)
        assert (off <= error / sine[below] + gamma(1, "single")).all()  # the layer itself is in single
        if precision == "single":
            assert off.max() > gamma(8, "single")  # so the error is there, and worth a sentence
