"""The check against Mitsuba: it passes right scenes of every kind, and tells each wrong one."""

import io
import json
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from rich.console import Console

from visray.camera import Camera
from visray.errors import UserError
from visray.lights import PointLight
from visray.materials import Material
from visray.primitives import KINDS, Box, Cone, Cylinder, Disk, Plane, Rectangle, Sphere, Triangle
from visray.primitives.primitive import Twin
from visray.scene.address import replaced
from visray.scene.scene import Film, Scene, Settings
from visray.study.answers import Ours
from visray.study.comparison import Comparison
from visray.study.crosscheck import check, random_rays
from visray.study.facets import FINEST, MOST, around, facets
from visray.study.findings import Report
from visray.study.parts import twins
from visray.study.rounding import AXES
from visray.study.twin import Theirs
from visray.transforms import Matrix, Rotate, Scale, Translate

LEAN = Matrix(matrix=((1, 0.4, 0, 0.1), (0, 0.8, 0.2, 0), (0.1, 0, 1.2, 0)))
MIRROR = Scale(scale=(-1.3, 0.7, 1.0))
# One of each kind, near the origin and of size 1.
ONE = {
    "sphere": Sphere(center=(0.1, 0.2, 0), radius=0.8),
    "plane": Plane(point=(0, -0.5, 0), normal=(0.1, 1, 0.2)),
    "rectangle": Rectangle(width=(1.5, 0.1, 0), height=(0.2, 1, 0.4)),
    "disk": Disk(normal=(0.3, 0.4, 1), radius=0.9),
    "triangle": Triangle(a=(-0.8, -0.5, 0), b=(0.9, -0.4, 0.2), c=(0.1, 0.9, -0.3)),
    "box": Box(min=(-0.7, -0.5, -0.4), max=(0.5, 0.6, 0.7)),
    "cylinder": Cylinder(axis=(0.3, 1, 0.2), radius=0.5, height=1.2),
    "cone": Cone(base=(0, -0.5, 0), axis=(0.2, 1, 0.3), radius=0.7, height=1.3),
}
TRANSFORMS = {
    "alone": (),
    "leaning": (LEAN, Rotate(rotate=30.0, axis=(1, 2, 3))),
    "mirrored": (MIRROR, Translate(translate=(0.1, 0.2, 0.3))),
}


def scene(objects: dict, **changes: object) -> Scene:
    """The objects under two lights, with highlights, in a small picture."""
    whole = Scene(
        camera=Camera(origin=(0.7, 1.6, 4.2), target=(0, 0, 0), fov=35.0),
        film=Film(width=96, height=64),
        materials={"shiny": Material(kd=(0.5, 0.6, 0.7), ks=(0.4, 0.4, 0.4), shininess=20.5)},
        objects={name: replace(thing, material="shiny") for name, thing in objects.items()},
        lights={
            "key": PointLight(position=(3, 4, 5), Ia=(0.1, 0.1, 0.1), a=0.5, b=0.1, c=0.01),
            "fill": PointLight(position=(-4, 3, 2), intensity=0.4, Is=(0, 0, 0)),
        },
    )
    return replace(whole, **changes)


def checked(s: Scene, other: Scene | None = None, rays: int = 20_000) -> Report:
    report = check(s, rays=rays, other=other)
    # Numbers that are not finite would pass through comparisons unseen.
    assert all(np.isfinite(t.value) for t in report.tolerances)
    return report


def failures(report: Report) -> set[str]:
    return {t.name for t in report.tolerances if not t.ok}


@pytest.fixture(scope="module")
def all_kinds() -> Scene:
    """Every kind, each with another transform, over a plane, and two boxes that touch it."""
    steps = list(TRANSFORMS.values())
    things = {}
    for i, (name, thing) in enumerate(ONE.items()):
        away = (2.2 * (i % 4) - 3.3, 0.6 + i // 4, -2.5 * (i // 4))
        things[f"{name} {i}/Ä"] = replace(thing, transform=(*steps[i % 3], Translate(translate=away)))
    things["floor"] = Plane(point=(0, -1, 0))
    things["standing"] = Box(min=(1, -1, 1), max=(1.5, -0.3, 1.5))
    camera = Camera(origin=(1, 4, 9), target=(0, 0.5, -1), fov=45.0)
    return scene(things, camera=camera, film=Film(width=160, height=100))


@pytest.mark.parametrize("steps", TRANSFORMS)
@pytest.mark.parametrize("kind", ONE)
def test_every_kind_under_any_transform_passes(kind: str, steps: str) -> None:
    report = checked(scene({"it": replace(ONE[kind], transform=TRANSFORMS[steps])}))
    assert report.passed, failures(report)
    assert report.left_out == {}
    assert report.pixels.hits > 400 and report.random.hits > 1500
    assert report.pixels.near_edge < 10
    assert report.pixels.dt < 1e-3
    assert report.picture.rms < 1e-4


def test_no_kind_is_forgotten() -> None:
    assert {kind.__dataclass_fields__["type"].default for kind in KINDS} == set(ONE)


def test_a_scene_of_every_kind_passes(all_kinds: Scene) -> None:
    report = checked(all_kinds, rays=100_000)
    assert report.passed, failures(report)
    assert report.objects == 10
    assert report.shadows.rays - report.shadows.reached > 500
    # From below, the underside of the box lies in the floor.
    assert report.random.tied > 0
    assert report.examples == ()


def test_settings_without_shadows_are_respected() -> None:
    s = scene({"ball": ONE["sphere"], "floor": Plane(point=(0, -1, 0))})
    report = checked(replace(s, settings=Settings(shadows=False)))
    assert report.passed, failures(report)
    assert report.shadows.rays == 0


def test_double_shading_and_a_transparent_film_pass() -> None:
    s = scene({"ball": ONE["sphere"], "floor": Plane(point=(0, -1, 0))}, settings=Settings(precision="double"))
    report = checked(replace(s, film=Film(transparent=True, width=40, height=40)))
    assert report.passed, failures(report)


# What is changed for Mitsuba, and one of the tolerances that must notice it.
WRONG = {
    "a radius": ("objects.ball.radius", 0.801, "pixel centres: distance"),
    "a place": ("objects.crate.max", (0.4, 0.5, 0.501), "pixel centres: distance"),
    "another normal": ("objects.card.width", (1.0, 0.0, 0.001), "pixel centres: normal"),
    "a light": ("lights.key.position", (3, 4.2, 5), "shadow rays: mismatches"),
    "a dim light": ("lights.key.intensity", 1.01, "picture: difference"),
    "an attenuation": ("lights.key.c", 0.012, "picture: difference"),
    "a material": ("materials.shiny.kd", (0.5, 0.6, 0.71), "picture: difference"),
    "an exponent": ("materials.shiny.shininess", 24.0, "picture: difference"),
    "the ambient light": ("ambient", (1, 1, 1.1), "picture: difference"),
    "the sky": ("background", (0.5, 0.5, 0.5), "picture: difference"),
    "a size": ("objects.crate.max", (0.7, 0.5, 0.5), "pixel centres: hit mismatches"),
}


@pytest.fixture(scope="module")
def few() -> Scene:
    crate = Box(min=(-0.3, -0.5, -0.5), max=(0.4, 0.5, 0.5), transform=(Translate(translate=(1.3, 0, 0)),))
    card = Rectangle(center=(0, -0.9, 0.2), width=(1, 0, 0), height=(0, 0.1, -1))
    floor = Disk(center=(0, -1, 0), radius=1.8)
    return scene({"ball": Sphere(center=(-0.6, 0, 0), radius=0.8), "crate": crate, "card": card, "floor": floor})


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_twin_fails(few: Scene, what: str) -> None:
    address, value, tolerance = WRONG[what]
    report = checked(few, replaced(few, address, value), rays=2000)
    assert tolerance in failures(report)
    assert not report.passed


def test_the_right_twin_of_the_same_scene_passes(few: Scene) -> None:
    assert checked(few).passed


def test_exchanged_objects_are_told_apart(few: Scene) -> None:
    things = few.objects
    swapped = replace(few, objects=things | {"ball": things["crate"], "crate": things["ball"]})
    report = checked(few, swapped, rays=2000)
    assert {"pixel centres: object mismatches", "random rays: object mismatches"} <= failures(report)
    assert report.pixels.tied == 0
    assert "visray ball" in " ".join(report.examples) and "Mitsuba crate" in " ".join(report.examples)


def test_flipped_uv_are_told(few: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    right = Sphere.mitsuba
    monkeypatch.setattr(Sphere, "mitsuba", lambda self: replace(right(self), uv=lambda uv: uv))
    assert failures(checked(few, rays=2000)) == {"pixel centres: uv", "random rays: uv"}


def test_what_has_no_twin_is_left_out_and_named(few: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Box, "mitsuba", lambda self: "Mitsuba has no box today")
    report = checked(few, rays=2000)
    assert report.passed, failures(report)
    assert report.left_out == {"crate": "Mitsuba has no box today"}
    assert report.objects == 3
    with pytest.raises(UserError, match=r"objects\.it: Mitsuba has no box today"):
        check(scene({"it": Box()}))


def test_an_empty_scene_and_no_rays_are_refused(few: Scene) -> None:
    with pytest.raises(UserError, match="it has no objects"):
        check(scene({}))
    with pytest.raises(UserError, match="rays = 0"):
        check(few, rays=0)


def test_a_large_film_is_checked_at_a_smaller_size(few: Scene) -> None:
    report = checked(replace(few, film=Film(width=4000, height=1000)), rays=2000)
    assert (report.width, report.height) == (512, 128)
    assert report.notes == ("checked at 512 x 128 pixels instead of 4000 x 1000",)
    assert report.difference["RGB"].shape == (128, 512, 3)


def test_the_report_is_json_and_a_table(few: Scene) -> None:
    report = checked(few, replaced(few, "objects.ball.radius", 0.9), rays=2000)
    found = json.loads(json.dumps(report.as_json()))
    assert found["passed"] is False
    assert {"name", "value", "limit", "unit", "ok"} == set(found["tolerances"][0])
    assert found["pixels"]["rays"] == 96 * 64 and found["random"]["rays"] == 2000
    assert found["shadows"]["rays"] > 0 and found["picture"]["rms"] > 1e-3
    console = Console(width=160, file=io.StringIO())
    console.print(report.table())
    text = console.file.getvalue()
    assert "FAILED" in text and "random rays" in text


def test_the_difference_can_be_written_and_is_zero_where_the_two_agree(few: Scene, tmp_path) -> None:
    report = checked(few, rays=2000)
    report.difference.write(tmp_path / "difference.exr")
    d = report.difference
    assert np.allclose(d["RGB"], d["visray"] - d["mitsuba"], atol=2**-22)
    assert np.abs(d["RGB"][d["compared"] > 0]).max() < 1e-4
    assert d["compared"].mean() > 0.99


BALL, FLOOR = Sphere(center=(0, 0, 0), radius=2.0), Plane(point=(0, -1, 0))
THIN = {f"b{i}": Box(min=(0.3 * i, 0, 0), max=(0.3 * i + 10.0 ** -(i + 1), 1, 1)) for i in range(4)}
SIZES = {
    "dust": Sphere(center=(0.69, 1.58, 4.1), radius=1e-3),
    "grain": Box(min=(0.7, 1.59, 4.1), max=(0.702, 1.591, 4.101)),
    "hill": Sphere(center=(0, -1001, 0), radius=1e3),
    "wall": Rectangle(center=(0, 0, -50), width=(2e3, 0, 0), height=(0, 2e3, 0)),
}


def many() -> Scene:
    """More spheres than are written out in a kernel."""
    places = np.random.default_rng(5).uniform(-2, 2, (100, 3)).tolist()
    return scene({f"s{i}": Sphere(center=tuple(p), radius=0.25) for i, p in enumerate(places)})


def far_away() -> Scene:
    """A scene moved to where single precision would have steps of an eighth."""
    move = (1e6, -2e6, 3e5)
    things = {"ball": BALL, "floor": FLOOR, "cone": ONE["cone"]}
    s = scene({k: replace(t, transform=(Translate(translate=move),)) for k, t in things.items()})
    lights = {k: replace(l, position=tuple(np.add(l.position, move).tolist())) for k, l in s.lights.items()}
    eye = tuple(np.add(s.camera.origin, move).tolist())
    return replace(s, lights=lights, camera=replace(s.camera, origin=eye, target=move))


HARD = {
    "inside a sphere": lambda: scene({"ball": BALL, "floor": FLOOR}, camera=Camera(origin=(0.3, 0.2, 1.5))),
    "lit from inside": lambda: scene({"ball": BALL}, lights={"in": PointLight(position=(0.1, 0.2, 1.0))}),
    "thin boxes": lambda: scene(THIN | {"floor": FLOOR}),
    "tiny and huge": lambda: scene(SIZES),
    "many": many,
    "far away": far_away,
    "a sun": lambda: scene({"it": ONE["sphere"], "floor": FLOOR}, lights={"sun": PointLight(position=(1e6, 2e6, 1e6))}),
    "no light": lambda: scene({"ball": BALL}, lights={}),
    "in a plane": lambda: scene({"floor": FLOOR, "same": Disk(center=(0, -1, 0), radius=0.7), "it": ONE["sphere"]}),
}


@pytest.mark.parametrize("case", HARD)
def test_hard_scenes_pass(case: str) -> None:
    report = checked(HARD[case]())
    assert report.passed, (failures(report), report.examples)
    assert report.pixels.hits > 0 and report.random.hits > 0


def test_moved_rays_surround_every_error() -> None:
    """In every direction of error, one of the moves goes at least as far as the error."""
    way = np.random.default_rng(0).normal(size=(10_000, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    assert (way @ AXES.T).max(1).min() >= 1


@pytest.mark.parametrize("kind", FINEST)
def test_facets_are_inscribed_and_look_outwards(kind: str) -> None:
    f = facets(kind, 64)
    corners = f.vertices[f.faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    middle = f.normals[f.faces].mean(1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    assert (np.arccos(np.clip((flat * middle).sum(1), -1, 1)) <= 2 * np.pi / 64).all()
    radius, z = np.hypot(f.vertices[:, 0], f.vertices[:, 1]), f.vertices[:, 2]
    whole = {"sphere": radius**2 + z**2, "cone": radius + (z + 1) / 2, "cylinder": radius, "disk": radius}[kind]
    assert whole.max() <= 1 + 4 * np.finfo(float).eps
    if kind != "disk":
        # The divergence theorem: the volume inside, a little less than that of the shape.
        volume = (corners.mean(1) * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])).sum() / 6
        exact = {"sphere": 4 / 3, "cone": 2 / 3, "cylinder": 2.0}[kind] * np.pi
        assert exact * (1 - 3 * f.gap) <= volume <= exact


def test_many_round_shapes_are_coarser() -> None:
    assert around("sphere", 1) == FINEST["sphere"]
    assert 1000 * around("sphere", 1000) ** 2 <= MOST


def test_wrong_kernels_are_told_from_rounding(few: Scene) -> None:
    """A difference of ten times the bound is no rounding, one of a tenth is."""
    ours = Ours(few)
    made = twins(few)[0]
    rays = random_rays(few, ours.centre, 5000, 1)
    shift = Comparison(ours, Theirs(few, ours.names, made, ours.centre), rays).shift
    typical = float(np.median(shift.start(rays.o)))
    for factor, passes in ((0.1, True), (100, False)):
        moved = replace(few, objects={k: _moved(t, factor * typical) for k, t in few.objects.items()})
        assert (not failures(checked(few, moved))) == passes


def _moved(thing: object, by: float) -> object:
    return replace(thing, transform=(*thing.transform, Translate(translate=(0, 0, by))))


def test_twins_are_plain() -> None:
    for thing in ONE.values():
        twin = thing.mitsuba()
        assert isinstance(twin, Twin)
        assert all(isinstance(shape, dict) for shape in twin.shapes)


def test_the_bsdf_is_blinn_phong_and_samples_what_it_evaluates() -> None:
    kd, ks, shininess = np.array([0.5, 0.4, 0.3]), np.array([0.2, 0.3, 0.4]), 12.5
    bsdf = mi.load_dict({"type": "blinn_phong", "kd": kd.tolist(), "ks": ks.tolist(), "shininess": shininess})
    rng = np.random.default_rng(3)
    v, l = (w / np.linalg.norm(w, axis=0) for w in rng.normal(size=(2, 3, 1000)))
    si = dr.zeros(mi.SurfaceInteraction3f, 1000)
    si.wi = mi.Vector3f(v)
    # By the formula, in world terms: the normal is on the viewer's side, and there is no light from below.
    side = np.sign(v[2])
    h = (v + l) / np.linalg.norm(v + l, axis=0)
    cosine, gloss = side * l[2], np.maximum(side * h[2], 0) ** shininess
    expected = np.where(cosine > 0, kd[:, None] * cosine + ks[:, None] * gloss, 0)
    context = mi.BSDFContext()
    assert np.allclose(np.array(bsdf.eval(context, si, mi.Vector3f(l))), expected, atol=1e-5)
    sample, weight = bsdf.sample(context, si, mi.Float(0.5), mi.Point2f(rng.uniform(size=(2, 1000))))
    value = np.array(bsdf.eval(context, si, sample.wo))
    assert np.allclose(np.array(weight) * np.array(sample.pdf), value, atol=1e-5)
    assert np.allclose(np.array(bsdf.pdf(context, si, sample.wo)), np.array(sample.pdf), atol=1e-6)
    assert "BlinnPhong" in str(bsdf)
