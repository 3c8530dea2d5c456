"""Pictures: nothing compiles twice, passes add up, layers are what they say, and what cannot be done is said."""

import json
import signal
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np
import pytest
from samples import polynomial_sphere

from visray import film as films
from visray import integrator, memory, passes
from visray import pass_timer as pace
from visray.animation.animation import Animation
from visray.animation.spin import SpinTrack
from visray.camera import Camera
from visray.data.base import GlobeBase
from visray.data.data_scene import Data
from visray.data.legend import Legend
from visray.errors import UserError
from visray.film import Film as Exposure
from visray.film import check_memory, tile_order
from visray.geometry import UNIT_ROUNDOFF, gamma
from visray.lights import PointLight
from visray.materials import Material
from visray.moments import BLOCK, Moments
from visray.output.layers import LAYERS, NAMES, names_from
from visray.passes import empty_film, expose, exposed_once
from visray.primitives import Box, Cone, Cylinder, Disk, Plane, Rectangle, Sphere, Triangle
from visray.quantities import Arrays
from visray.renderer import render
from visray.sampling import SamplePlan
from visray.scene.address import replaced
from visray.scene.scene import Film, Scene, Settings
from visray.setup import prepare
from visray.transforms import Rotate

BLACK = (0.0, 0.0, 0.0)
SHOW = Scene(
    camera=Camera(origin=(0, 2, 8), target=(0, 0.5, 0), fov=40.0),
    film=Film(width=40, height=30),
    materials={
        "red": Material(kd=(0.7, 0.2, 0.1), ks=(0.3, 0.3, 0.3), shininess=20.0),
        "blue": Material(kd=(0.1, 0.2, 0.7), shininess=5.0),
    },
    lights={"key": PointLight(position=(3, 6, 5)), "fill": PointLight(position=(-4, 3, 4), intensity=0.3)},
    objects={
        "floor": Plane(material="blue"),
        "ball": Sphere(center=(0, 1, 0), material="red"),
        "other": Sphere(center=(1.6, 0.5, 0.7), radius=0.5, material="blue"),
        "box": Box(min=(-2, 0, -1), max=(-1, 1, 0), material="red", transform=(Rotate(rotate=15.0),)),
        "leaf": Triangle(a=(-1, 0, 1.5), b=(0.3, 0.1, 1.6), c=(-0.5, 1, 1.2), material="red"),
        "can": Cylinder(center=(2.5, 0.5, -0.5), material="blue"),
    },
    settings=Settings(spp=4),
)


def picture(scene: Scene, **more: Any) -> np.ndarray:
    return render(scene, progress=False, layers=("RGB",), **more)["RGB"]


def at(address: str, value: Any) -> Callable[[Scene], Scene]:
    return lambda s: replaced(s, address, value)


# Nothing that is a number compiles


def many(scene: Scene) -> Scene:
    """So many balls that they hang in a tree, and so many planes that they are looped over."""
    rng = np.random.default_rng(1)
    balls = {f"b{i}": Sphere(center=tuple(rng.normal(size=3).tolist()), radius=0.1, material="red") for i in range(70)}
    walls = {f"w{i}": Plane(point=(0, -1.0 - i, 0), material="blue") for i in range(40)}
    return replace(scene, objects=balls | walls)


CHANGES = {
    "the same again": lambda s: s,
    "a moved object": at("objects.ball.center", (0.3, 1.2, -0.4)),
    "an object at the origin": at("objects.ball.center", (0.0, 0.0, 0.0)),
    "a size of 1": at("objects.other.radius", 1.0),
    "another turn": at("objects.box.transform", (Rotate(rotate=80.0, axis=(0.0, 0.0, 1.0)),)),
    "a colour": at("materials.red.kd", (0.0, 1.0, 0.5)),
    "another material": at("objects.ball.material", "blue"),
    "a seed": at("settings.seed", 12345),
    "more samples": at("settings.spp", 9),
    "one sample": at("settings.spp", 1),
    "a light elsewhere": at("lights.key.position", (0.0, 9.0, 0.0)),
    "a brighter light": at("lights.fill.intensity", 1.0),
    "a camera elsewhere": at("camera.origin", (3.0, 3.0, 7.0)),
    "a view": at("camera.fov", 55.0),
    "an exponent": at("materials.red.shininess", 200.0),
    "a sky": at("background", (0.1, 0.0, 0.3)),
    "ambient light": at("ambient", (0.5, 0.5, 0.5)),
}


def compiled(work: Callable[[], object]) -> int:
    """How many kernels are compiled, or read from the disk, for a piece of work."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        work()
        kernels = dr.kernel_history([dr.KernelType.JIT])
    assert kernels
    return sum(not k["cache_hit"] or bool(k["cache_disk"]) for k in kernels)


@pytest.mark.parametrize("change", CHANGES)
def test_numbers_are_data_not_code(change: str) -> None:
    picture(SHOW)
    assert compiled(lambda: picture(CHANGES[change](SHOW))) == 0


def test_frames_of_a_tree_and_of_loops_compile_once() -> None:
    """Where every frame rebuilds the tree."""
    scene = many(SHOW)
    picture(scene)
    for step in range(3):
        moved = replaced(scene, "objects.b0.center", (0.1 * step, 0.0, 1.0))
        assert compiled(lambda moved=moved: picture(moved)) == 0


def test_all_layers_compile_once() -> None:
    render(SHOW, progress=False)
    assert compiled(lambda: render(CHANGES["a moved object"](SHOW), progress=False)) == 0


def test_a_new_effect_does_compile() -> None:
    """The count above can fail."""
    picture(SHOW)
    assert compiled(lambda: picture(at("lights.key.a", 1.0)(SHOW))) >= 1
    more = replace(SHOW, objects=SHOW.objects | {"extra": Disk(center=(0, 3, 0))})
    assert compiled(lambda: picture(more)) >= 1


# Passes


def in_passes(scene: Scene, counts: list[int]) -> tuple[Exposure, Any]:
    made = prepare(scene)
    film = empty_film(made)
    for count in np.cumsum(counts):
        film = exposed_once(made, film, int(count))
    return film, made


@pytest.mark.parametrize("precision", ["single", "double"])
def test_one_pass_and_many_make_the_same_picture(precision: str) -> None:
    """Bit for bit (test_same_bits.py has more)."""
    scene = replace(SHOW, settings=Settings(spp=24, precision=precision))
    whole, _ = in_passes(scene, [24])
    for counts in ([1] * 24, [5, 1, 7, 11], [12, 12]):
        parts, _ = in_passes(scene, counts)
        for name in ("mean", "squares", "coverage"):
            assert np.array_equal(np.array(getattr(parts, name)), np.array(getattr(whole, name))), name


def test_passes_chosen_by_the_clock_make_the_same_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = picture(SHOW, spp=24)
    monkeypatch.setattr(passes, "first_pass_samples", lambda made: 5 * len(made.order))
    monkeypatch.setattr(pace, "PASS_SECONDS", 1e-9)
    monkeypatch.setattr(pace, "RUN_PER_TRACE", 0)
    ends = []
    once = passes.exposed_once
    monkeypatch.setattr(passes, "exposed_once", lambda *a: ends.append(int(a[2].max())) or once(*a))
    parts = picture(SHOW, spp=24)
    assert len(ends) > 3 and ends[-1] == 24
    assert np.array_equal(whole, parts)


@pytest.mark.parametrize("precision", ["single", "double"])
def test_mean_and_variance_are_those_of_the_samples(precision: str) -> None:
    """Against NumPy over 16 pictures of one sample each: the same samples one by one."""
    spp, made = 16, prepare(replace(SHOW, settings=Settings(spp=16, precision=precision)))
    single = []
    for i in range(spp):
        colour = integrator.attached_mean(made.kernel, SamplePlan.of(made.a, 0, spp, i, 1), made.x, made.y)
        single.append(np.array(colour, float))
    samples, first = np.array(single), exposed_once(made, empty_film(made), 1)
    assert np.array_equal(np.array(first.mean), samples[0]) and not np.array(first.squares).any()
    film, _ = expose(made)
    # Sums of 16 differences and of their squares, in the shading precision, of numbers up to the greatest.
    most = samples.max() + 1
    bound = gamma(2 * spp + 4, precision) * most
    assert np.abs(np.array(film.mean) - samples.mean(0)).max() <= bound
    assert np.abs(np.array(film.squares) - spp * samples.var(0)).max() <= 4 * spp * bound * most
    layers = render(made.scene, progress=False, layers=("RGB", "variance"))
    by_rows = np.empty((spp, len(made.order), 3))
    by_rows[:, made.order] = samples.transpose(0, 2, 1)
    variance = by_rows.var(0, ddof=1).reshape(layers["variance"].shape)
    assert np.abs(layers["variance"] - variance).max() <= 8 * bound * most + UNIT_ROUNDOFF["single"] * variance.max()


def test_a_constant_pixel_has_no_variance_at_all() -> None:
    """Exactly zero, with numbers that no precision holds, in one pass and in many; and its mean is the number."""
    scene = Scene(
        background=(0.1, 0.7, 1 / 3),
        film=Film(width=8, height=4),
        settings=Settings(spp=25),
        camera=Camera(),
        lights={},
    )
    for counts in ([25], [3, 1, 21], [1] * 25):
        film, _ = in_passes(scene, counts)
        assert not np.array(film.squares).any()
        assert np.array_equal(np.array(film.mean), np.broadcast_to(np.float32([[0.1], [0.7], [1 / 3]]), (3, 32)))
    assert not render(scene, progress=False)["variance"].any()


def test_film_joins_moments_as_numpy_does() -> None:
    """Random samples of any size and offset, in eleven blocks and a part of one: mean and squares against 80 bits."""
    a, rng, n, count = Arrays.of("llvm", "double"), np.random.default_rng(2), 500, 11 * BLOCK + 7
    for offset in (0.0, 1.0, 1e6):
        x = offset + 10 ** rng.uniform(-3, 0, (1, 1, n)) * rng.normal(size=(count, 3, n))
        moments = Moments.empty(a, n)
        for i, sample in enumerate(x):
            moments = moments.with_sample(a.B(i % BLOCK == 0), a.W(sample.copy()), 1)
            moments = moments.block_joined(a, a.B(i % BLOCK == BLOCK - 1), i + 1 - BLOCK, BLOCK)
            dr.eval(moments)
        found = moments.closed(a, a.U(count))
        exact = x.astype(np.longdouble)
        mean, squares = exact.mean(0), exact.var(0) * count
        spread = np.sqrt(squares / count).astype(float)
        # The mean: its own roundings, 12 joins; the squares: each block's sums, of spread^2 and of the rounding of the
        # mean times the spread.
        assert (np.abs(np.array(found.mean) - mean) <= gamma(4 * 12) * (np.abs(mean) + spread)).all()
        slack = gamma(2 * BLOCK) * 3 * squares + count * spread * gamma(48) * (np.abs(mean) + spread)
        assert (np.abs(np.array(found.squares) - squares) <= slack).all()
        assert np.array_equal(np.array(found.coverage), np.full(n, float(count)))


def test_ctrl_c_keeps_the_passes_that_are_done(monkeypatch: pytest.MonkeyPatch) -> None:
    """An interrupt in the second pass: that pass is finished, the next is not begun, and the picture says so."""
    monkeypatch.setattr(passes, "first_pass_samples", lambda made: 2 * len(made.order))
    once, counts = passes.exposed_once, []

    def interrupted(made, film, targets, pace):
        counts.append(int((targets - film.counts)[0]))
        if len(counts) == 2:
            signal.raise_signal(signal.SIGINT)
        return once(made, film, targets, pace)

    monkeypatch.setattr(passes, "exposed_once", interrupted)
    image = render(SHOW, spp=1000, progress=False, layers=("RGB",))
    assert len(counts) == 2
    assert image.metadata["spp"] == sum(counts) < 1000 and image.metadata["spp_asked"] == 1000
    monkeypatch.setattr(passes, "exposed_once", once)
    # The same samples as those of a render that is cut there.
    film, made = in_passes(replace(SHOW, settings=Settings(spp=1000)), counts)
    kept = np.empty((len(made.order), 3))
    kept[made.order] = np.array(film.mean).T
    assert np.array_equal(image["RGB"].reshape(-1, 3), kept.astype(np.float32))


def test_second_ctrl_c_ends_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_):
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(passes, "exposed_once", interrupted)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        render(SHOW, progress=False)
    assert signal.getsignal(signal.SIGINT) is before


# Order and size


@pytest.mark.parametrize(("width", "height"), [(1, 1), (1, 9), (9, 1), (4, 4), (5, 7), (64, 48), (33, 130)])
def test_tiles_are_a_permutation(width: int, height: int) -> None:
    order = tile_order(width, height)
    assert np.array_equal(np.sort(order), np.arange(width * height))
    if width % 4 == 0 and height % 4 == 0:
        y, x = np.divmod(order.reshape(-1, 16), width)
        # Sixteen neighbours are one square.
        assert (np.ptp(x, axis=1) == 3).all() and (np.ptp(y, axis=1) == 3).all()


def test_rows_are_in_the_order_of_the_picture() -> None:
    """A ball in the upper left quarter of the view is in the upper left quarter of the picture."""
    ball = Sphere(center=(-1, 1, 0), radius=0.8)
    scene = Scene(camera=Camera(origin=(0, 0, 5)), film=Film(width=21, height=14), objects={"ball": ball}, lights={})
    found = render(scene, progress=False)["id"]
    assert found[:7, :10].any() and not found[7:].any() and not found[:, 11:].any()


@pytest.mark.parametrize("size", [(1, 1), (3, 1), (1, 2)])
def test_smallest_pictures(size: tuple[int, int]) -> None:
    image = render(SHOW, size=size, spp=3, progress=False)
    # No roots are searched for, and no error is asked for.
    assert list(image.layers) == list(names_from("film", "first hit"))
    for layer in image.layers.values():
        assert layer.shape[:2] == (size[1], size[0]) and np.isfinite(layer[image["id"] > 0]).all()
    one = render(SHOW, size=size, spp=1, progress=False)
    assert "variance" not in one.layers  # of one sample there is none


def test_a_film_too_large_is_refused_with_the_estimate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "free", lambda: memory.Free(2**30, "are left of `ulimit -v`"))
    most = 2**30 // films.BYTES_PER_PIXEL
    check_memory(most, 1)
    with pytest.raises(UserError) as caught:
        check_memory(most + 1, 1)
    assert str(caught.value).startswith(f"film = {most + 1} x 1: needs about 1.0 GiB, 1.0 GiB are left of `ulimit -v`")
    with pytest.raises(UserError, match="100000 x 100000: needs about"):
        render(SHOW, size=(100_000, 100_000), progress=False)
    monkeypatch.setattr(memory, "free", lambda: None)
    check_memory(10**6, 10**6)  # a system that does not say is not second-guessed


@pytest.mark.parametrize(
    ("arguments", "text"), [({"threads": 0}, "threads = 0"), ({"backend": "opengl"}, "is none of llvm, cuda, metal")]
)
def test_what_cannot_be_done_is_said_in_one_line(arguments: dict, text: str) -> None:
    with pytest.raises(UserError, match=text) as caught:
        render(SHOW, progress=False, **arguments)
    assert len(caught.value.lines) == 1


# Layers


def test_data_layers_by_hand() -> None:
    """A camera at (0, 0, 5) that looks down -z at a ball of radius 1, before a wall at z = -3.

    5 x 5 pixels and a view of 2 atan(1/2), so 0.2 of slope a pixel: pixel (row 2, column 2) looks straight ahead, and
    (2, 4) at a slope of 0.4, past the ball, to meet the wall 8 away at x = 3.2.
    """
    fov = float(np.degrees(2 * np.arctan(0.5)))
    scene = Scene(
        camera=Camera(origin=(0, 0, 5), target=(0, 0, 0), fov=fov),
        film=Film(width=5, height=5),
        materials={"m": Material(kd=(0.25, 0.5, 0.75)), "w": Material(kd=(0.5, 0.5, 0.5))},
        # The families of the kernel are in another order than the objects of the file.
        objects={
            "behind": Sphere(center=(0, 0, 9), material="m"),
            "wall": Rectangle(center=(0, 0, -3), width=(100, 0, 0), height=(0, 100, 0), material="w"),
            "ball": Sphere(material="m"),
        },
        settings=Settings(spp=1, precision="double"),
        lights={},
    )
    image = render(scene, progress=False)
    u = 2.0**-24
    assert image["id"][2, 2] == 3 and image["id"][2, 4] == 2
    assert json.loads(image.metadata["objects"]) == {"behind": 1, "wall": 2, "ball": 3}
    assert image["id"].dtype == np.uint32
    slant = np.sqrt(1 + 0.4**2)
    for name, ball, wall in (
        ("Z", 4, 8),
        ("distance", 4, 8 * slant),
        ("P", (0, 0, 1), (3.2, 0, -3)),
        ("N", (0, 0, 1), (0, 0, 1)),
        ("albedo", (0.25, 0.5, 0.75), (0.5, 0.5, 0.5)),
        # The ball's +z is a quarter of the way west of its +x; the wall has its middle at 0.5.
        ("UV", (0.25, 0.5), (0.532, 0.5)),
        ("A", 1, 1),
    ):
        for value, pixel in ((ball, (2, 2)), (wall, (2, 4))):
            # One rounding to the single precision of the layers; before it, double.
            assert np.abs(image[name][pixel] - value).max() <= 2 * u * np.abs(value).max() + 1e2 * u * 2.0**-24, name


def test_layers_where_nothing_is_hit() -> None:
    scene = Scene(film=Film(width=3, height=2), settings=Settings(spp=2), camera=Camera(), lights={})
    image = render(scene, progress=False)
    assert np.isinf(image["Z"]).all() and np.isinf(image["distance"]).all()
    for name in ("N", "P", "UV", "albedo", "id", "variance"):
        assert name == "variance" or not image[name].any()
    assert (image["A"] == 1).all()


def test_ids_follow_the_file_whatever_the_families() -> None:
    """Each object alone in its column: its id is its place in the file, for kinds in any order."""
    kinds = [Sphere, Disk, Sphere, Box, Cone, Disk, Cylinder, Sphere]
    objects = {}
    for i, kind in enumerate(kinds):
        x = float(2 * i)
        objects[f"o{i}"] = {
            Sphere: lambda x: Sphere(center=(x, 0, 0), radius=0.6),
            Disk: lambda x: Disk(center=(x, 0, 0), normal=(0, 0, 1), radius=0.6),
            Box: lambda x: Box(min=(x - 0.6, -0.6, -0.6), max=(x + 0.6, 0.6, 0.6)),
            Cone: lambda x: Cone(base=(x, -0.6, 0), radius=0.6, height=1.2),
            Cylinder: lambda x: Cylinder(center=(x, 0, 0), radius=0.6, height=1.2),
        }[kind](x)
    # From far away, so that the columns are parallel.
    camera = Camera(origin=(7, 0, 1000), target=(7, 0, 0), fov=float(np.degrees(2 * np.arctan(1 / 1000))))
    scene = Scene(camera=camera, film=Film(width=8, height=1), objects=objects, settings=Settings(spp=1), lights={})
    assert render(scene, progress=False)["id"].tolist() == [[1, 2, 3, 4, 5, 6, 7, 8]]


def test_every_layer_is_made_as_its_record_says() -> None:
    """A polynomial surface that turns and a legend, to an error: all layers there are, with their types and numbers."""
    ball = polynomial_sphere((0.0, 0.0, 0.0), 1.0)
    data = Data(base=GlobeBase(center=(0.0, -3.0, 0.0)), legend=Legend(title="A ball"))
    film = Film(width=180, height=160)
    moves = Animation(duration=1, tracks={"turn": SpinTrack(of="objects.ball")})
    scene = Scene(
        camera=Camera(origin=(0, 0, 5)), film=film, objects={"ball": ball}, data=data, animation=moves, lights={}
    )
    image = render(scene, error=0.5, progress=False)
    assert tuple(image.layers) == NAMES
    for layer in LAYERS:
        values = image[layer.name]
        assert values.dtype == layer.memory_dtype
        assert (1 if values.ndim == 2 else values.shape[2]) == len(layer.channels)


def test_layers_not_asked_for_are_not_made() -> None:
    assert list(render(SHOW, progress=False, layers=("RGB",)).layers) == ["RGB"]
    assert list(render(SHOW, progress=False, layers=("id", "A")).layers) == ["A", "id"]


def test_transparent_film_keeps_coverage_and_premultiplied_colour() -> None:
    """A wall that ends in the middle of the middle pixel: A is the share of samples that met it."""
    wall = Rectangle(center=(-5, 0, 0), width=(10, 0, 0), height=(0, 10, 0))
    camera = Camera(origin=(0, 0, 1), fov=float(np.degrees(2 * np.arctan(1 / 3))))
    glow = {"m": Material(ka=(1, 0.5, 0.25), kd=BLACK)}
    scene = Scene(
        camera=camera, film=Film(width=3, height=1, transparent=True), materials=glow, background=(9.0, 9.0, 9.0),
        ambient=(1.0, 1.0, 1.0),
        objects={"wall": replace(wall, material="m")}, settings=Settings(spp=64), lights={},
    )  # fmt: skip
    image = render(scene, progress=False)
    assert image["A"].tolist() == [[1, 0.5, 0]]
    # 64 samples in 8 columns of strata, four of them on the wall: exactly half.
    expected = np.array([1, 0.5, 0.25]) * np.array([[[1], [0.5], [0]]])
    assert np.abs(image["RGB"] - expected).max() <= gamma(64, "single")
    opaque = render(replace(scene, film=replace(scene.film, transparent=False)), progress=False)
    assert (opaque["A"] == 1).all() and opaque["RGB"][0, 2].tolist() == [9, 9, 9]


# Scenes with little in them


def test_scene_without_objects_is_its_sky() -> None:
    scene = Scene(background=(0.25, 0.5, 1.0), film=Film(width=6, height=4), lights=SHOW.lights, camera=Camera())
    assert (picture(scene) == [0.25, 0.5, 1.0]).all()


def test_scene_without_lights_is_ambient() -> None:
    scene = replace(SHOW, lights={}, objects={"ball": Sphere(material="red", radius=3.0)}, ambient=(1.0, 0.5, 0.25))
    found = picture(replace(scene, camera=Camera(origin=(0, 0, 8), fov=20.0)))
    # The material has no ka, so that it reflects ambient light by its kd.
    expected = np.multiply(scene.ambient, SHOW.materials["red"].kd)
    assert SHOW.materials["red"].ka is None and (np.abs(found - expected) <= gamma(4, "single") * expected).all()


def test_the_same_seed_gives_the_same_picture_and_another_one_another() -> None:
    assert picture(SHOW).tobytes() == picture(SHOW).tobytes()
    assert (picture(SHOW) != picture(SHOW, seed=7)).any()


def test_single_and_double_agree_where_no_edge_is() -> None:
    """The same samples up to the rounding of where they fall; pixels whose samples differ by an edge are few."""
    single, double = picture(SHOW, spp=1), picture(SHOW, spp=1, precision="double")
    # A sample falls within 2^-16 of a pixel of where the other precision puts it, highlights are of exponent 20, and a
    # pixel of the ball spans 0.1 of its radius: 20 x 0.1 x 2^-16 and the roundings of the shading.
    close = np.abs(single - double).max(2) <= 4 * 20 * 0.1 * 2.0**-16 + gamma(100, "single") * 2
    assert close.mean() > 0.99


def test_metadata_say_how_the_picture_was_made() -> None:
    image = render(SHOW, progress=False, seed=3, spp=2, size=(4, 3))
    assert image.metadata["seed"] == 3 and image.metadata["spp"] == 2 and image.metadata["spp_asked"] == 2
    assert image.metadata["precision"] == "single" and image.metadata["backend"] == "llvm"
    assert "shadows" in image.metadata["features"] and "attenuation" not in image.metadata["features"]
    # Row vectors: the target is straight ahead, 8.14 away; and in the middle of the picture.
    to_camera, to_ndc = (np.array(image.metadata[k]) for k in ("worldToCamera", "worldToNDC"))
    target = np.array([0, 0.5, 0, 1])
    assert np.abs(target @ to_camera - [0, 0, np.hypot(8, 1.5), 1]).max() <= gamma(20) * 10
    ndc = target @ to_ndc
    assert np.abs(ndc[:2] / ndc[3] - 0.5).max() <= gamma(20) * 10


def test_world_to_ndc_puts_hit_points_into_their_pixels() -> None:
    image = render(SHOW, progress=False, spp=1, precision="double")
    hit = image["id"] > 0
    p = np.c_[image["P"][hit], np.ones(hit.sum())] @ np.array(image.metadata["worldToNDC"])
    row, column = np.nonzero(hit)
    x, y = p[:, 0] / p[:, 3] * 40, p[:, 1] / p[:, 3] * 30
    # P is rounded to single: 2^-24 of 300, which is how far the floor is seen, at 300 from the eye.
    slack = 2.0**-24 * 300 * 40
    assert np.abs(x - column - 0.5).max() <= slack and np.abs(y - row - 0.5).max() <= slack
