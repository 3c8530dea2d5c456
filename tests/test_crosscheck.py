"""The check against Mitsuba: it passes right scenes of every kind, and tells each wrong one."""

import io
import json
from dataclasses import replace
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from light_samples import LIGHT_NAMES, light_sample
from rich.console import Console
from samples import SAMPLES
from solids import ring

from visray import modes
from visray.camera import Camera
from visray.errors import UserError
from visray.lights import DirectionalLight, PointLight, RectangleLight, SphereLight, SpotLight
from visray.materials import Material
from visray.primitives import (
    KINDS,
    Box,
    Cone,
    Csg,
    Disk,
    Mesh,
    Plane,
    Polynomial,
    Rectangle,
    Sphere,
    Torus,
)
from visray.primitives.primitive import MitsubaShapes
from visray.scene.address import replaced
from visray.scene.scene import Film, Occlusion, Scatter, Scene, Settings
from visray.study.mitsuba import visray_lighting
from visray.study.mitsuba.crosscheck import check
from visray.study.mitsuba.mitsuba_scene import MitsubaScene
from visray.study.mitsuba.omitted_effects import MOST_TRANSPARENT
from visray.study.mitsuba.placed_shapes import mitsuba_shapes
from visray.study.mitsuba.random_rays import random_rays
from visray.study.mitsuba.ray_comparison import RayComparison
from visray.study.mitsuba.report import Report
from visray.study.mitsuba.rounding import AXES
from visray.study.mitsuba.surface_colours import SurfaceColours
from visray.study.mitsuba.tessellation import MOST_FACETS, MOST_TRIANGLES, facets_around, tessellate
from visray.study.mitsuba.visray_scene import VisrayScene
from visray.textures import CheckerTexture, ImageTexture
from visray.transforms import Matrix, Rotate, Scale, Translate

KNOT = Path(__file__).resolve().parents[1] / "scenes" / "meshes" / "knot.ply"
LEAN = Matrix(matrix=((1, 0.4, 0, 0.1), (0, 0.8, 0.2, 0), (0.1, 0, 1.2, 0)))
MIRROR = Scale(scale=(-1.3, 0.7, 1.0))
# One of each kind that Mitsuba has, by its type.
ONE = {s.posed.type: s.posed for s in SAMPLES.values() if not isinstance(s.posed.mitsuba(), str)}
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


@pytest.mark.parametrize(
    "steps", ["alone", *(pytest.param(x, marks=pytest.mark.slow) for x in TRANSFORMS if x != "alone")]
)
@pytest.mark.parametrize("kind", ONE)
def test_every_kind_under_any_transform_passes(kind: str, steps: str) -> None:
    report = checked(scene({"it": replace(ONE[kind], transform=TRANSFORMS[steps])}))
    assert report.passed, failures(report)
    assert report.left_out == {}
    assert report.pixels.hits > 400 and report.random.hits > 1500
    assert report.pixels.near_edge < 10
    assert report.pixels.dt < 1e-3
    assert report.picture.rms < 1e-4


def test_only_polynomials_and_csg_have_no_twin_in_mitsuba() -> None:
    assert {kind for kind in KINDS if SAMPLES[kind.__name__].posed.type not in ONE} == {Polynomial, Csg}


@pytest.mark.parametrize("steps", [(), (Scale(scale=(1.0, -0.5, 2.0)), Rotate(rotate=20, axis=(1, 2, 0)))])
def test_a_smooth_mesh_with_a_texture_passes(steps: tuple) -> None:
    """Normals for shading and texture coordinates are those of the file, also if the transform mirrors the mesh."""
    knot = Mesh(file=str(KNOT), material="painted", transform=steps)
    s = scene({"knot": knot, "floor": Plane(point=(0, -1.5, 0))})
    textures = {"squares": CheckerTexture(scale=(30.0, 2.0))}
    painted = Material(texture="squares", ks=(0.5, 0.5, 0.5), shininess=60.0)
    objects = s.objects | {"knot": knot}
    report = checked(replace(s, textures=textures, materials={"painted": painted} | s.materials, objects=objects))
    assert report.passed, failures(report)
    assert report.objects == 2 and report.random.hits > 1500
    assert report.picture.rms < 1e-4 and report.picture.compared > 0.9 * report.picture.pixels


def test_an_open_mesh_is_dark_on_the_side_that_its_triangles_turn_from_the_light() -> None:
    """Close to the edge of the shadow, normals for shading face the light and the triangle does not. Nothing else is in
    the way there: behind a thin sheet it is free."""
    steps = Translate(translate=(0.0, -1.15, 0.0)), Scale(scale=6)
    cup = Mesh(file=str(KNOT.parent / "tulip.obj"), part="blossom", transform=steps)
    sun = DirectionalLight(direction=(-0.6, -1.0, -0.35))
    report = checked(scene({"cup": cup}, lights={"sun": sun}))
    assert report.passed, failures(report)
    assert report.pixels.hits > 1000 and report.shadows.rays > 400


def test_a_light_beside_a_mesh_touches_none_of_its_planes() -> None:
    """Each triangle ends at its bounding ball: the planes of thousands of triangles pass near any point."""
    ours = VisrayScene(scene({"knot": Mesh(file=str(KNOT), normals="face")}))
    assert ours.names == ("knot",) and set(ours.object_of_row[:-1]) == {0} and len(ours.object_of_row) == 12481
    corner = ours.prepared.scene.objects["knot"].shape_of_file().mesh.vertices[0]
    for p, touching in ((corner, {0}), (1.2 * corner, set())):
        found, normals = visray_lighting.objects_touching(ours, p - ours.centre, np.array([1e-6]))
        assert set(found) == touching and np.allclose(np.linalg.norm(normals, axis=1), 1)


def test_a_polynomial_surface_is_left_out_and_said_to_be() -> None:
    heart = Polynomial(surface="heart", transform=(Translate(translate=(0.0, 0.0, 50.0)),))
    report = checked(scene({"ball": ONE["sphere"], "heart": heart}), rays=2000)
    assert report.passed, failures(report)
    assert report.left_out == {"heart": heart.mitsuba()} and "no polynomial" in heart.mitsuba()


@pytest.mark.slow
def test_a_scene_of_every_kind_passes(all_kinds: Scene) -> None:
    report = checked(all_kinds, rays=100_000)
    assert report.passed, failures(report)
    assert report.objects == len(all_kinds.objects)
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


@pytest.mark.parametrize("kind", MOST_FACETS)
def test_facets_are_inscribed_and_look_outwards(kind: str) -> None:
    shape = {"capsule": 0.7, "torus": 0.4}.get(kind)
    f = tessellate(kind, 64, shape)
    corners = f.vertices[f.faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    middle = f.normals[f.faces].mean(1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    assert (np.arccos(np.clip((flat * middle).sum(1), -1, 1)) <= 2 * np.pi / 64).all()
    radius, z = np.hypot(f.vertices[:, 0], f.vertices[:, 1]), f.vertices[:, 2]
    whole = {
        "sphere": radius**2 + z**2,
        "cone": radius + (z + 1) / 2,
        "cylinder": radius,
        "disk": radius,
        "capsule": radius**2 + np.maximum(np.abs(z) - 0.7, 0) ** 2,
        "torus": ((radius - 1) ** 2 + z**2) / 0.4**2,
    }[kind]
    # Of a torus the difference from its circle is of numbers 1 / 0.4 as great, and squared.
    assert whole.max() <= 1 + {"torus": 2 * 4 / 0.4}.get(kind, 4) * np.finfo(float).eps
    if kind != "disk":
        # The divergence theorem: the volume inside, a little less than that of the shape.
        volume = (corners.mean(1) * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])).sum() / 6
        sizes = {"sphere": 4 / 3, "cone": 2 / 3, "cylinder": 2.0, "capsule": 4 / 3 + 1.4, "torus": 2 * np.pi * 0.4**2}
        exact = sizes[kind] * np.pi
        assert exact * (1 - 3 * f.gap) <= volume <= exact


def test_many_round_shapes_are_coarser() -> None:
    assert facets_around("sphere", 1) == MOST_FACETS["sphere"]
    assert 1000 * facets_around("sphere", 1000) ** 2 <= MOST_TRIANGLES


def test_wrong_kernels_are_told_from_rounding(few: Scene) -> None:
    """A difference of ten times the bound is no rounding, one of a tenth is."""
    ours = VisrayScene(few)
    made = mitsuba_shapes(few)[0]
    rays = random_rays(few, ours.centre, 5000, 1)
    error = RayComparison(ours, MitsubaScene(few, ours.names, made, ours.centre), rays).ray_error
    typical = float(np.median(error.start(rays.o)))
    for factor, passes in ((0.1, True), (100, False)):
        moved = replace(few, objects={k: _moved(t, factor * typical) for k, t in few.objects.items()})
        assert (not failures(checked(few, moved))) == passes


def _moved(thing: object, by: float) -> object:
    return replace(thing, transform=(*thing.transform, Translate(translate=(0, 0, by))))


def test_twins_are_plain() -> None:
    for thing in ONE.values():
        twin = thing.mitsuba()
        assert isinstance(twin, MitsubaShapes)
        assert all(isinstance(shape, dict) for shape in twin.shapes)


def test_the_bsdf_is_blinn_phong_and_samples_what_it_evaluates() -> None:
    kd, front, back = np.array([0.5, 0.4, 0.3]), ([0.2, 0.3, 0.4], 12.5), ([0.5, 0.1, 0.2], 30.5)
    names = "ks", "shininess", "back_ks", "back_shininess"
    bsdf = mi.load_dict({"type": "blinn_phong", "kd": kd.tolist()} | dict(zip(names, front + back)))
    rng = np.random.default_rng(3)
    v, l = (w / np.linalg.norm(w, axis=0) for w in rng.normal(size=(2, 3, 1000)))
    si = dr.zeros(mi.SurfaceInteraction3f, 1000)
    si.wi, si.n, si.sh_frame = mi.Vector3f(v), mi.Normal3f(0, 0, 1), mi.Frame3f(mi.Vector3f(0, 0, 1))
    # By the formula, in world terms: the normal is on the viewer's side, and there is no light from below.
    side = np.sign(v[2])
    h = (v + l) / np.linalg.norm(v + l, axis=0)
    ks, shininess = (np.where(side > 0, np.array([x]).T, np.array([y]).T) for x, y in zip(front, back))
    cosine, gloss = side * l[2], np.maximum(side * h[2], 0) ** shininess
    expected = np.where(cosine > 0, kd[:, None] * cosine + ks * gloss, 0)
    context = mi.BSDFContext()
    assert np.allclose(np.array(bsdf.eval(context, si, mi.Vector3f(l))), expected, atol=1e-5)
    sample, weight = bsdf.sample(context, si, mi.Float(0.5), mi.Point2f(rng.uniform(size=(2, 1000))))
    value = np.array(bsdf.eval(context, si, sample.wo))
    assert np.allclose(np.array(weight) * np.array(sample.pdf), value, atol=1e-5)
    assert np.allclose(np.array(bsdf.pdf(context, si, sample.wo)), np.array(sample.pdf), atol=1e-6)
    assert "BlinnPhong" in str(bsdf)


# One of each kind of light, above the same four objects.
LAMPS = {light_sample(name).posed.type: light_sample(name).posed for name in LIGHT_NAMES}
SOFT = replace(LAMPS["spot"], angle=35.0, exponent=1.7, b=0.1)
GROUND = {
    "ball": Sphere(center=(0.1, 0.2, 0), radius=0.8),
    "crate": Box(min=(-1.6, -1, -0.9), max=(-0.9, -0.2, -0.2)),
    "cone": Cone(base=(1.3, -1, 0.3), radius=0.4, height=0.9),
    "floor": Plane(point=(0, -1, 0)),
}
GLASS = Material(kd=(0.1, 0.1, 0.1), kt=(0.9, 0.7, 0.5), dmax=3.0)


def painted(s: Scene, materials: dict[str, Material], **of: str) -> Scene:
    """The scene with some objects of other materials."""
    things = {name: replace(thing, material=of.get(name, thing.material)) for name, thing in s.objects.items()}
    return replace(s, materials=s.materials | materials, objects=things)


@pytest.fixture(scope="module")
def ground() -> Scene:
    return scene(GROUND, lights=LAMPS)


@pytest.mark.parametrize("name", [*LAMPS, "soft"])
def test_every_light_passes(ground: Scene, name: str) -> None:
    lamp = (LAMPS | {"soft": SOFT})[name]
    report = checked(replace(ground, lights={"it": lamp}), rays=2000)
    assert report.passed, (failures(report), report.examples)
    assert 500 < report.shadows.reached < report.shadows.rays - 200
    assert report.shadows.near_edge < 10
    assert report.picture.rms < 1e-4 and report.picture.compared > 6100
    assert bool(report.notes) == lamp.has_area
    assert (report.penumbras.rays > 80_000) == lamp.has_area
    assert report.penumbras.near_edge < 20 and report.penumbras.difference == 0


@pytest.mark.slow
def test_all_lights_together_pass(ground: Scene) -> None:
    report = checked(ground, rays=2000)
    assert report.passed, (failures(report), report.examples)
    assert report.penumbras.lights == 3 and report.penumbras.points == 16
    assert report.penumbras.compared > 15_000


# What of the light is changed for Mitsuba, and one of the tolerances that must notice it.
WRONG_LIGHT = {
    "a direction": ("directional.direction", (-0.6, -1, -0.41), "shadow rays: mismatches"),
    "what is left of the sun": ("directional.a", 2.01, "picture: difference"),
    "a cone": ("spot.angle", 24.3, "shadow rays: mismatches"),
    "an axis": ("spot.direction", (-0.5, -1, -0.72), "shadow rays: mismatches"),
    "a falling off": ("spot.exponent", 0.01, "picture: difference"),
    "a side": ("rectangle.width", (1.02, 0, 0.2), "area lights: mismatches"),
    "another side": ("rectangle.height", (0, 0.32, 1), "area lights: mismatches"),
    "a radius": ("disk.radius", 0.82, "area lights: mismatches"),
    "a normal": ("disk.normal", (0.25, -1, 0), "area lights: mismatches"),
    "a bulb": ("sphere.radius", 0.52, "area lights: mismatches"),
}


@pytest.mark.parametrize("what", WRONG_LIGHT)
@pytest.mark.slow
def test_a_wrong_light_fails(ground: Scene, what: str) -> None:
    field, value, tolerance = WRONG_LIGHT[what]
    s = replace(ground, lights={field.split(".")[0]: LAMPS[field.split(".")[0]]})
    report = checked(s, replaced(s, f"lights.{field}", value), rays=1000)
    assert tolerance in failures(report)
    if tolerance == "area lights: mismatches":
        assert report.penumbras.difference > 0 and "area lights: penumbra" in failures(report)
        assert any(line.startswith(f"light {field.split('.')[0]}") for line in report.examples)


@pytest.mark.parametrize("name", ["point", "directional", "spot", "disk"])
def test_a_kernel_that_is_wrong_of_one_pixel_fails(ground: Scene, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is not excused as near an edge: only rays beside it are asked for that, by another search."""

    def flipped(arrival: visray_lighting.LightArrival) -> visray_lighting.LightArrival:
        lane = np.flatnonzero(arrival.reached)[300]
        return replace(arrival, reached=arrival.reached ^ (np.arange(len(arrival.reached)) == lane))

    right, of_point = visray_lighting.arriving_light, visray_lighting.arriving_light_of_point
    monkeypatch.setattr(visray_lighting, "arriving_light", lambda *args: map(flipped, right(*args)))
    monkeypatch.setattr(visray_lighting, "arriving_light_of_point", lambda *args: flipped(of_point(*args)))
    report = checked(replace(ground, lights={"it": LAMPS[name]}), rays=1000)
    assert report.shadows.mismatches == 1
    assert report.penumbras.mismatches == (16 if LAMPS[name].has_area else 0)
    assert "visray dark, Mitsuba lit" in report.examples[0]


ROOM = {"floor": Plane(point=(0, 0, 0)), "crate": Box(min=(-0.5, 0, -0.5), max=(0.2, 0.8, 0.3))}
CEILINGS = {
    "a slab": Box(min=(-2, 2.3, -2), max=(2, 2.5, 2)),
    "a card": Rectangle(center=(0, 2.3, 0), width=(4, 0, 0), height=(0, 0, 4)),
    "a plane": Plane(point=(0, 2.3, 0)),
    "a ball": Sphere(center=(0.1, 2.6, 0.3), radius=0.3),
}


@pytest.mark.parametrize("ceiling", CEILINGS)
@pytest.mark.slow
def test_lights_that_lie_on_a_surface_are_decided(ceiling: str) -> None:
    place = (0.1, 2.3, 0.3)
    lamps = {
        "point": PointLight(position=place),
        "spot": SpotLight(position=place, direction=(0, -1, 0.1), angle=50.0),
        "card": RectangleLight(position=place, width=(0.7, 0, 0), height=(0, 0, 0.7)),
        "bulb": SphereLight(position=(0.1, 2.6, 0.3), radius=0.3),
    }
    camera = Camera(origin=(0, 1, 4), target=(0, 0.9, 0))
    report = checked(scene(ROOM | {"ceiling": CEILINGS[ceiling]}, camera=camera, lights=lamps), rays=2000)
    assert report.passed, (failures(report), report.examples)
    assert report.shadows.near_edge < 0.05 * report.shadows.rays
    assert report.penumbras.near_edge < 0.05 * report.penumbras.rays
    assert report.shadows.reached > 3000 and report.penumbras.reached > 30_000


def test_a_light_along_a_plane_is_decided() -> None:
    """Moved by rounding, any ray that is parallel to a plane would meet it somewhere."""
    sun = {"sun": DirectionalLight(direction=(0, 0, -1))}
    wall = Rectangle(center=(0, 0, -3), width=(6, 0, 0), height=(0, 6, 0))
    report = checked(scene({"floor": FLOOR, "wall": wall, "ball": ONE["sphere"]}, lights=sun), rays=2000)
    assert report.passed, failures(report)
    assert report.shadows.near_edge < 0.05 * report.shadows.rays
    assert 500 < report.shadows.reached < report.shadows.rays - 100


@pytest.mark.slow
def test_many_lights_in_a_loop_pass() -> None:
    turns = np.linspace(0, 2 * np.pi, 26, endpoint=False)
    ring = [(3 * np.cos(t), 3.0, 3 * np.sin(t)) for t in turns]
    lamps = {f"p{i}": PointLight(position=tuple(map(float, p)), intensity=0.1) for i, p in enumerate(ring)}
    s = scene(GROUND, lights=lamps)
    assert VisrayScene(s).kernel.looped_lights
    report = checked(s, rays=1000)
    assert report.passed, (failures(report), report.examples)
    assert report.shadows.rays > 26 * 4000
    assert not checked(s, replaced(s, "lights.p25.position", (3.2, 3.0, -0.7)), rays=1000).passed


def test_lights_without_intensity_have_no_shadows(ground: Scene) -> None:
    report = checked(replace(ground, lights={"off": replace(LAMPS["point"], intensity=0.0)}), rays=1000)
    assert report.passed, failures(report)
    assert report.shadows.rays == 0


GLASSES = {
    "a ball": {"ball": "glass"},
    "a box on a card": {"crate": "glass", "floor": "glass"},
    "all but the floor": {"ball": "glass", "crate": "red", "cone": "glass"},
    "everything": {"ball": "glass", "crate": "red", "cone": "glass", "floor": "red"},
}


@pytest.mark.parametrize(("case", "precision"), [*((case, "single") for case in GLASSES), ("everything", "double")])
@pytest.mark.slow
def test_coloured_shadows_pass(ground: Scene, case: str, precision: str) -> None:
    red = Material(kt=(0.8, 0.2, 0.2), kr=(0.1, 0.1, 0.1), ks=(0.3, 0.3, 0.3))
    lamps = {name: LAMPS[name] for name in ("point", "directional", "spot", "disk")}
    s = painted(replace(ground, lights=lamps), {"glass": GLASS, "red": red}, **GLASSES[case])
    report = checked(replace(s, settings=Settings(precision=precision)), rays=1000)
    assert report.passed, (failures(report), report.examples)
    assert report.tints.rays > 500 and report.tints.near_edge < 20
    assert report.tints.difference < 1e-4 and report.tints.bound > 0
    assert report.picture.rms < 1e-4 and report.picture.compared > 6000
    assert "not compared: refraction" in " ".join(report.notes) or "reflection" in " ".join(report.notes)


@pytest.mark.parametrize(("field", "value"), [("kt", (0.9, 0.7, 0.501)), ("dmax", 3.01)])
def test_wrong_glass_fails(ground: Scene, field: str, value: object) -> None:
    s = painted(replace(ground, lights={"key": LAMPS["point"]}), {"glass": GLASS}, ball="glass", crate="glass")
    report = checked(s, replaced(s, f"materials.glass.{field}", value), rays=1000)
    assert "coloured shadows: transmittance" in failures(report)
    assert checked(s, rays=1000).passed


def test_glass_from_within_passes(ground: Scene) -> None:
    """The camera, and so every surface it sees from within, is in the glass; one light is in it as well."""
    lamps = {"in": PointLight(position=(0.4, 0.3, 0.1)), "out": LAMPS["point"], "sun": LAMPS["directional"]}
    s = painted(replace(ground, lights=lamps), {"glass": GLASS}, ball="glass")
    report = checked(replace(s, camera=Camera(origin=(0.1, 0.2, 0.1), target=(0, 0, 0))), rays=1000)
    assert report.passed, (failures(report), report.examples)
    assert report.tints.rays > 6000 and report.shadows.reached > 6000


def test_lights_that_lie_on_glass_pass(ground: Scene) -> None:
    """Shadow rays that start on glass and run through it are inside it from the start."""
    lamp = PointLight(position=(0.1, 1.0, 0))
    s = painted(replace(ground, lights={"lamp": lamp}), {"glass": GLASS}, ball="glass", crate="glass")
    report = checked(s, rays=1000)
    assert report.passed, failures(report)
    assert report.tints.near_edge < 0.1 * report.tints.rays and report.tints.rays > 2000
    assert report.tints.difference < 1e-4 and report.picture.rms < 1e-4


RINGS = {
    "a torus": Torus(axis=(0.1, 0.2, 1), major=1.0, minor=0.35),
    "a mirrored torus": Torus(axis=(0.1, 0.2, 1), minor=0.3, transform=(Scale(scale=(1.0, -1.2, 1.0)),)),
    "a mesh": Mesh(vertices=ring()[0], faces=ring()[1], transform=(Rotate(rotate=80.0, axis=(1, 0, 0)),)),
}


@pytest.mark.parametrize("name", RINGS)
def test_glass_that_a_ray_enters_twice_passes(name: str) -> None:
    """A ring between the wall and lights: in front of it, in its hole, and in its tube; and the sun."""
    lamps = {
        "front": PointLight(position=(4, 0.2, 0.1)), "hole": PointLight(position=(0.1, 0, 0.05)),
        "tube": PointLight(position=(1.02, 0, 0.05)), "sun": DirectionalLight(direction=(-1, -0.1, -0.1)),
    }  # fmt: skip
    s = scene({"wall": Plane(point=(-2.5, 0, 0), normal=(1, 0, 0.2)), "ring": RINGS[name]}, lights=lamps)
    s = painted(s, {"glass": replace(GLASS, dmax=3.0)}, ring="glass")
    s = replace(s, film=Film(width=64, height=48), camera=Camera(origin=(0.3, 0.8, 6), target=(-1.2, 0, 0), fov=40.0))
    report = checked(s, rays=1000)
    assert report.passed, (failures(report), report.examples)
    assert report.tints.rays > 2000 and report.tints.near_edge < 0.01 * report.tints.rays
    assert "coloured shadows: transmittance" in failures(
        checked(s, replaced(s, "materials.glass.dmax", 3.03), rays=1000)
    )


def test_more_glass_than_can_be_checked_counts_as_opaque() -> None:
    places = np.random.default_rng(5).uniform(-2, 2, (MOST_TRANSPARENT + 1, 3)).tolist()
    s = scene({f"s{i}": Sphere(center=tuple(p), radius=0.2) for i, p in enumerate(places)})
    s = painted(s, {"glass": GLASS}, **dict.fromkeys(s.objects, "glass"))
    report = checked(s, rays=1000)
    assert report.passed, failures(report)
    assert report.tints.rays == 0 and report.shadows.rays > 0
    assert any(f"{MOST_TRANSPARENT + 1} transparent objects count as opaque" in note for note in report.notes)


@pytest.mark.slow
def test_what_is_not_compared_is_switched_off_and_named(ground: Scene) -> None:
    mirror = Material(kr=(0.8, 0.8, 0.8))
    s = painted(
        replace(ground, lights={"wide": replace(LAMPS["disk"], Ia=(0.1, 0.1, 0.1))}),
        {"glass": GLASS, "mirror": mirror},
        ball="glass",
    )
    s = painted(s, {}, crate="mirror", cone="glass")
    s = replace(
        s,
        camera=replace(s.camera, aperture=0.3),
        settings=Settings(
            shading="toon", area="centre", occlusion=Occlusion(sky=4, near=4), scatter=Scatter(rays=3, depth=2)
        ),
    )
    report = checked(s, rays=1000)
    assert report.passed, failures(report)
    assert report.notes == (
        "not compared: the shading toon (settings.shading is blinn-phong)",
        "not compared: sky occlusion, near occlusion (all ambient light arrives)",
        "not compared: reflection, refraction, nested media (settings.depth is 0)",
        "not compared: scatter (settings.scatter.rays is 0)",
        "not compared: defocus (camera.aperture is 0)",
        "not compared: area lights (point lights in their middles instead; "
        "shadows are compared from a grid of points on each)",
    )
    assert report.picture.rms < 1e-4 and report.penumbras.compared > 4000


@pytest.mark.parametrize("shading", [name for name in modes.NAMES if name != "blinn-phong"])
def test_other_shadings_are_compared_as_blinn_phong(few: Scene, shading: str) -> None:
    report = checked(replace(few, settings=Settings(shading=shading)), rays=1000)
    assert report.passed, failures(report)
    assert report.notes == (f"not compared: the shading {shading} (settings.shading is blinn-phong)",)
    assert report.shadows.rays > 0 and report.picture.compared > 6000


TEXTURES = {
    "squares": CheckerTexture(a=(0.9, 0.8, 0.7), b=(0.1, 0.2, 0.3), scale=(0.8, 0.6), offset=(0.1, -0.2)),
    **{
        f"{wrap} {filter}": ImageTexture(
            file="none.png", filter=filter, wrap=wrap, scale=(1.7, -1.3), offset=(0.3, 0.1)
        )
        for wrap in ("repeat", "clamp", "mirror")
        for filter in ("nearest", "bilinear")
    },
    "globe": ImageTexture(file="none.png", wrap=("repeat", "clamp")),
}


@pytest.fixture(scope="module")
def picture(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A picture of 7 x 5 coloured pixels."""
    from PIL import Image

    file = tmp_path_factory.mktemp("textures") / "pixels.png"
    Image.fromarray(np.random.default_rng(8).integers(0, 256, (5, 7, 3), dtype=np.uint8)).save(file)
    return str(file)


@pytest.mark.parametrize("name", TEXTURES)
@pytest.mark.slow
def test_textures_pass_and_wrong_ones_fail(ground: Scene, name: str, picture: str) -> None:
    texture = TEXTURES[name]
    if isinstance(texture, ImageTexture):
        texture = replace(texture, file=picture)
    materials = {"paint": Material(texture="it"), "lit paint": Material(texture="it", textured="kd")}
    on = painted(replace(ground, lights={"key": LAMPS["point"]}), materials, floor="paint")
    s = replace(painted(on, {}, ball="paint", crate="lit paint", cone="paint"), textures={"it": texture})
    report = checked(s, rays=1000)
    assert report.passed, failures(report)
    assert report.picture.rms < 1e-4 and report.picture.compared > 6100
    for field, value in (("offset", (0.13, 0.1)), ("scale", (1.75, 1.3))):
        assert "picture: difference" in failures(checked(s, replaced(s, f"textures.it.{field}", value), rays=1000))
    for name, value in (("paint", "kd"), ("lit paint", "ka and kd")):
        changed = replaced(s, f"materials.{name}.textured", value)
        assert "picture: difference" in failures(checked(s, changed, rays=1000))


def test_paintings_show_pixels_where_they_are(picture: str) -> None:
    """The middle of each pixel has its colour; between two middles it is their mean, and the first row is at v = 1."""
    from PIL import Image

    from visray.output.curves import linear

    pixels = linear(np.array(Image.open(picture)) / 255)
    s = replace(few_colours(picture), objects={"card": Rectangle(material="paint")})
    painting = SurfaceColours(s, ("card",))
    rows, columns = np.mgrid[:5, :7].reshape(2, -1)
    uv = np.stack([(columns + 0.5) / 7, 1 - (rows + 0.5) / 5], 1)
    index = np.zeros(len(uv), int)
    assert np.allclose(painting.diffuse(index, uv), pixels.reshape(-1, 3), atol=2**-22)
    inner = columns < 6
    between = (pixels[:, :-1] + pixels[:, 1:]).reshape(-1, 3) / 2
    assert np.allclose(painting.diffuse(index, uv + (0.5 / 7, 0))[inner], between, atol=2**-22)
    assert not painting.uncertain(index, uv, np.full(len(uv), 1e-6)).any()
    assert (painting.diffuse(np.array([-1]), np.array([[np.nan, np.nan]])) == 0).all()


def few_colours(picture: str) -> Scene:
    return Scene(
        textures={"it": ImageTexture(file=picture)},
        materials={"paint": Material(texture="it")},
        camera=Camera(),
        lights={},
    )
