"""Two-sided materials: which side shows which material, for all kinds and however the side is seen.

A picture in which only one side is seen is compared with that of the scene in which the object has that side's material
alone: bit for bit the same.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow
from samples import NAMES, SAMPLES, aimed, gap, truth

import visray as vr
from visray.accel.policy import MAX_INLINED
from visray.adaptive.brightness import Brightness
from visray.errors import UserError
from visray.feature_rules import used_materials
from visray.features import features
from visray.material_report import energy_notes
from visray.scene.check import checked, examined
from visray.setup import prepare
from visray.study.mitsuba import crosscheck
from visray.written_out import written_out

FRONT = vr.Material(ka=(0.2, 0.1, 0.1), kd=(0.7, 0.2, 0.1), ks=(0.2, 0.2, 0.2), shininess=8.0, back="inner")
INNER = vr.Material(ka=(0.1, 0.1, 0.2), kd=(0.1, 0.3, 0.8), ks=(0.1, 0.3, 0.2), shininess=20.5)
ONE_SIDED = replace(FRONT, back=None)
LIGHTS = {
    "key": vr.PointLight(position=(2.0, 3.0, 4.0), Ia=(0.1, 0.1, 0.1)),
    "far": vr.DirectionalLight(direction=(0.3, 0.1, 1)),
}


def shown(scene: vr.Scene) -> np.ndarray:
    """Colours of the pixels."""
    return vr.render(scene, progress=False, layers=("RGB",))["RGB"]


def albedo(m: vr.Material) -> np.ndarray:
    """kd of a material in the precision of the layer of this name."""
    return np.array(m.kd, np.float32)


def with_material(scene: vr.Scene, front: vr.Material) -> vr.Scene:
    """The scene with another material in place of the two-sided one."""
    return replace(scene, materials=scene.materials | {"sheet": front})


def assert_one_side(scene: vr.Scene, seen: vr.Material, hidden: vr.Material) -> None:
    """The picture is that of the material that is seen, bit for bit, and not that of the other one."""
    picture = shown(scene)
    assert np.array_equal(picture, shown(with_material(scene, seen)))
    assert not np.array_equal(picture, shown(with_material(scene, hidden)))


# All kinds


def point_on(thing: vr.Sphere) -> tuple[np.ndarray, np.ndarray]:
    """A point of an object and the outward normal there, by its twin in NumPy."""
    o, d = aimed(np.random.default_rng(4), thing, 50)
    found = truth(thing, o, d)
    first = np.flatnonzero(found.sure & (found.what == 1) & (found.low < 1e3))[0]
    p = o[first] + found.low[first].astype(float) * d[first]
    return p, gap(thing, p[None])[1][0].astype(float)


@pytest.mark.parametrize("inside", [False, True], ids=["front", "back"])
@pytest.mark.parametrize("name", NAMES)
def test_each_kind_shows_its_front_outside_and_its_back_inside(name: str, inside: bool) -> None:
    """The camera is near the surface, on one side of it. From there, all of a closed or flat object is seen from the
    same side."""
    p, n = point_on(SAMPLES[name].posed)
    origin = p - 0.05 * n if inside else p + 0.05 * n
    scene = vr.Scene(
        camera=vr.Camera(origin=tuple(origin), target=tuple(p), up=tuple(np.roll(n, 1) + (0.1, 0.2, 0.3)), fov=100),
        film=vr.Film(width=12, height=8),
        materials={"sheet": FRONT, "inner": INNER},
        lights={"lamp": vr.PointLight(position=tuple(origin), Ia=(0.2, 0.2, 0.2))},
        objects={"it": replace(SAMPLES[name].posed, material="sheet")},
        settings=vr.Settings(spp=2),
    )
    assert_one_side(checked(scene), *((INNER, ONE_SIDED) if inside else (ONE_SIDED, INNER)))


# Surfaces that are seen from both sides in one picture

BALL = "x^2 + y^2 + z^2 - 1"
# A tetrahedron without one of its faces.
CORNERS = np.array([[1, 0, -0.7], [-1, 0, -0.7], [0, 1, 0.7], [0, -1, 0.7]])
FACES = [[0, 1, 2], [0, 3, 1], [1, 3, 2]]
OPEN_MESH = vr.Mesh(vertices=CORNERS.tolist(), faces=FACES, normals="face")


def triangle_normals(p: np.ndarray) -> np.ndarray:
    """Normals of the triangles of the mesh that points lie on: its corners run counterclockwise around them."""
    a, b, c = CORNERS[FACES].transpose(1, 0, 2)
    n = np.cross(b - a, c - a)
    distance = ((p[:, None] - a) * n).sum(2) / np.linalg.norm(n, axis=1)
    return n[np.abs(distance).argmin(1)]


BOWL = vr.Polynomial(expression=BALL, clip=vr.Block(min=(-2, -2, -2), max=(2, 0.3, 2)))
BOTH_SIDES = {
    "open polynomial": (BOWL, {}, lambda p: p),
    "turned polynomial": (replace(BOWL, expression=f"0 - ({BALL})"), {}, lambda p: -p),
    "open mesh": (OPEN_MESH, {}, triangle_normals),
    "instance of a mesh": (vr.Instance(geometry="shape"), {"shape": OPEN_MESH}, triangle_normals),
}  # fmt: skip


def of_both_sides(thing: vr.Sphere, geometries: dict, **settings) -> vr.Scene:
    return checked(vr.Scene(
        camera=vr.Camera(origin=(0.7, 2.5, 3.0), fov=40),
        film=vr.Film(width=48, height=36),
        materials={"sheet": FRONT, "inner": INNER},
        lights=LIGHTS,
        geometries=geometries,
        objects={"it": replace(thing, material="sheet")},
        settings=vr.Settings(**{"spp": 1} | settings),
    ))  # fmt: skip


@pytest.mark.parametrize("which", BOTH_SIDES)
def test_the_normal_says_which_side_is_seen(which: str) -> None:
    """The albedo at the centre of each pixel, by normals in NumPy; and each sample's colour is that of one side."""
    thing, geometries, normal_at = BOTH_SIDES[which]
    scene = of_both_sides(thing, geometries)
    image = vr.render(scene, progress=False, layers=("RGB", "albedo", "P", "id"))
    hit = image["id"] > 0
    p = image["P"][hit].astype(float)
    behind = (normal_at(p) * (p - np.array(scene.camera.origin))).sum(1) > 0
    assert behind.mean() > 0.1 < (~behind).mean()
    assert np.array_equal(image["albedo"][hit], np.where(behind[:, None], albedo(INNER), albedo(FRONT)))
    front, back = shown(with_material(scene, ONE_SIDED)), shown(with_material(scene, INNER))
    is_front, is_back = ((image["RGB"] == x).all(2) for x in (front, back))
    assert (is_front | is_back)[hit].all()
    # A sample lies beside the centre of its pixel, so at edges it may show the other side.
    assert (is_back | ~is_front)[hit][behind].mean() > 0.9 < (is_front | ~is_back)[hit][~behind].mean()


def test_the_back_of_an_open_shell_that_is_cut_is_its_inside() -> None:
    """A sphere that is cut open and not capped, against the same sphere as an open polynomial."""
    cut = vr.Csg(op="difference", of=[vr.Sphere(), vr.Box(min=(-2, 0.3, -2), max=(2, 2, 2))], ends="open")
    image, twin = (
        vr.render(of_both_sides(x, {}), progress=False, layers=("albedo", "id"))  # the pixels' centres
        for x in (cut, BOWL)
    )
    assert np.array_equal(image["id"], twin["id"])
    assert np.array_equal(image["albedo"], twin["albedo"])
    sides = np.unique(image["albedo"][image["id"] > 0], axis=0)
    assert np.array_equal(sides, np.unique([albedo(FRONT), albedo(INNER)], axis=0))


def flat_scene(count: int, precision: str) -> tuple[vr.Scene, vr.Scene]:
    """Flat objects in all directions, seen along -z, and the same ones with the material of the side that is seen."""
    rng = np.random.default_rng(count)
    fronts = {
        "a": FRONT,
        "b": replace(FRONT, kd=(0.2, 0.6, 0.1), back="lined"),
        "c": replace(FRONT, texture="squares", back="sign"),
        "d": replace(INNER, texture="squares", textured="kd"),
        "e": replace(FRONT, shading="unlit", back="default"),
    }
    backs = {
        "inner": INNER,
        "lined": vr.Material(texture="lines"),
        "sign": vr.Material(kd=(0.9, 0.8, 0.1), shading="unlit"),
    }
    objects, single = {}, {}
    for i in range(count):
        n, at = rng.normal(size=3), (*rng.uniform(-2, 2, 2), float(rng.uniform(-3, 0)))
        name = "abcde"[i % 5]
        side = np.cross(n, rng.normal(size=3))
        side /= 2 * np.linalg.norm(side)
        up = np.cross(n, side) / np.linalg.norm(n)
        corners = np.array(at) + np.stack([-side - up, side - up, up])
        objects[f"{i}"] = (
            vr.Disk(center=at, normal=tuple(n), radius=0.5, material=name),
            vr.Rectangle(center=at, width=tuple(side), height=tuple(up), material=name),
            vr.Triangle(a=tuple(corners[0]), b=tuple(corners[1]), c=tuple(corners[2]), material=name),
        )[(i // 5) % 3]
        seen = name if n[2] > 0 else fronts[name].back or name
        single[f"{i}"] = replace(objects[f"{i}"], material=seen)
    scene = vr.Scene(
        camera=vr.OrthographicCamera(origin=(0, 0, 5), target=(0, 0, 0), height=5),
        film=vr.Film(width=48, height=48),
        textures={
            "squares": vr.CheckerTexture(scale=(3, 3)),
            "lines": vr.CheckerTexture(scale=(5, 0), a=(0.9, 0.1, 0.1)),
        },
        materials=fronts | backs,
        lights=LIGHTS,
        objects=objects,
        settings=vr.Settings(spp=2, precision=precision),
    )
    one_sided = {name: replace(m, back=None) for name, m in scene.materials.items()}
    return checked(scene), checked(replace(scene, materials=one_sided, objects=single))


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("count", [15, 15 * MAX_INLINED])
def test_flat_objects_in_all_directions(count: int, precision: str) -> None:
    """Few objects, whose materials are in the code, and many, whose materials are read from memory."""
    scene, single = flat_scene(count, precision)
    assert features(scene)["two-sided"] and not features(single)["two-sided"]
    assert np.array_equal(shown(scene), shown(single))
    assert not np.array_equal(shown(scene), shown(replace(single, objects=scene.objects)))


# Ways in which a side is seen

ROOM = vr.Scene(
    camera=vr.Camera(origin=(0.3, 1.2, 4.5), target=(0, 0.6, 0), fov=45),
    film=vr.Film(width=32, height=24),
    background=(0.2, 0.3, 0.4),
    materials={
        "sheet": FRONT,
        "inner": INNER,
        "floor": vr.Material(kd=(0.6, 0.6, 0.5)),
        "mirror": vr.Material(kd=(0, 0, 0), ks=(0.5, 0.5, 0.5), kr=(0.9, 0.9, 0.9)),
        "glass": vr.Material(kd=(0, 0, 0), kt=(0.9, 0.9, 0.9), ior=1.3),
    },
    lights={"key": vr.PointLight(position=(1.0, 3.0, 3.0))},
    # All that light can come from lies before the sheet.
    objects={
        "sheet": vr.Disk(center=(0, 0.5, -1), normal=(0, 0, 1), radius=1.5, material="sheet"),
        "floor": vr.Rectangle(center=(0, 0, 1), width=(4, 0, 0), height=(0, 0, -3.9), material="floor"),
        "mirror": vr.Sphere(center=(-0.8, 0.5, 0.3), radius=0.5, material="mirror"),
        "glass": vr.Sphere(center=(0.8, 0.5, 0.3), radius=0.5, material="glass"),
    },
    settings=vr.Settings(spp=2),
)
CHECKER = {"squares": vr.CheckerTexture(scale=(6, 6), a=(0.9, 0.6, 0.1))}


def on_both(**fields) -> Callable[[vr.Scene], vr.Scene]:
    """The front with some fields, and the back with the same ones."""
    return lambda s: replace(
        s, materials=s.materials | {n: replace(s.materials[n], **fields) for n in ("sheet", "inner")}
    )


WAYS = {
    "mirror and glass": lambda s: s,
    "scattered light": lambda s: replace(s, settings=replace(s.settings, scatter=vr.Scatter(rays=4, depth=2))),
    "occlusion": lambda s: replace(s, settings=replace(s.settings, occlusion=vr.Occlusion(sky=2, near=2))),
    "area light": lambda s: replace(s, lights={"key": vr.SphereLight(position=(1, 3, 3), radius=0.5, samples=3)}),
    "mirrors on both sides": on_both(kr=(0.5, 0.4, 0.6)),
    "unlit": on_both(shading="unlit"),
    "texture": lambda s: on_both(texture="squares")(replace(s, textures=CHECKER)),
    "image": lambda s: on_both(texture="image")(replace(s, textures={"image": vr.ImageTexture(file="dots.png")})),
    "phong": lambda s: replace(s, settings=replace(s.settings, shading="phong")),
    "toon": lambda s: replace(s, settings=replace(s.settings, shading="toon")),
    "albedo": lambda s: replace(s, settings=replace(s.settings, shading="albedo")),
    "mesh": lambda s: replace(s, objects=s.objects | {"sheet": vr.Mesh(
        vertices=[[-2, -1, -1], [2, -1, -1], [0, 2, -1]], faces=[[0, 1, 2]], material="sheet")}),
    "turned by a transform": lambda s: replace(s, objects=s.objects | {"sheet": vr.Rectangle(
        width=(3, 0, 0), height=(0, 3, 0), material="sheet",
        transform=(vr.Rotate(rotate=20, axis=(0, 0, 1)), vr.Translate(translate=(0, 0, -1))))}),
}  # fmt: skip


def from_behind(scene: vr.Scene) -> vr.Scene:
    """The scene with the sheet turned around."""
    sheet = scene.objects["sheet"]
    if isinstance(sheet, vr.Disk):
        turned = replace(sheet, normal=(0, 0, -1))
    elif isinstance(sheet, vr.Mesh):
        turned = replace(sheet, faces=[[0, 2, 1]])
    else:
        turned = replace(sheet, width=(-3, 0, 0))
    return replace(scene, objects=scene.objects | {"sheet": turned})


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with a picture for textures, as the current one."""
    Pillow.fromarray(np.random.default_rng(1).integers(0, 256, (5, 7, 3), np.uint8)).save(tmp_path / "dots.png")
    monkeypatch.chdir(tmp_path)


QUICK = ("mirror and glass", "scattered light", "unlit", "texture", "image", "albedo", "mesh")


@pytest.mark.parametrize("way", [x if x in QUICK else pytest.param(x, marks=pytest.mark.slow) for x in WAYS])
def test_a_side_is_seen_in_every_way(way: str, folder: None) -> None:
    """Also in a mirror, through glass and by scattered light."""
    scene = checked(WAYS[way](ROOM))
    seen = replace(scene.materials["sheet"], back=None), scene.materials["inner"]
    if way != "image" and way != "texture":  # else the colours are those of the texture, on both sides
        assert_one_side(scene, *seen)
        assert_one_side(checked(from_behind(scene)), *seen[::-1])
    for view, side in zip((scene, checked(from_behind(scene))), seen):
        assert np.array_equal(shown(view), shown(with_material(view, side)))


def test_a_mirror_shows_the_other_side() -> None:
    """The camera sees the front, and in the mirror behind it the back."""
    scene = checked(vr.Scene(
        camera=vr.OrthographicCamera(origin=(2, 0.5, 5), target=(0, 0, 0), height=4),
        film=vr.Film(width=48, height=36),
        materials={"sheet": FRONT, "inner": INNER, "mirror": ROOM.materials["mirror"]},
        lights={"front": vr.DirectionalLight(direction=(0, 0, -1)), "back": vr.DirectionalLight(direction=(0, 0, 1))},
        objects={
            "sheet": vr.Disk(center=(0, 0, 1), normal=(0, 0, 1), radius=0.8, material="sheet"),
            "mirror": vr.Rectangle(center=(0, 0, -1), width=(8, 0, 0), height=(0, 8, 0), material="mirror"),
        },
        settings=vr.Settings(spp=1, shadows=False),
    ))  # fmt: skip
    picture = vr.render(scene, progress=False, layers=("RGB", "id"))
    front, back = shown(with_material(scene, ONE_SIDED)), shown(with_material(scene, INNER))
    is_front, is_back = ((picture["RGB"] == x).all(2) for x in (front, back))
    assert (is_front | is_back).all()
    direct = picture["id"] == 1
    edge = np.zeros_like(direct)  # pixels whose sample may be beyond the edge of the disk that the centre sees
    for axis in (0, 1):
        for by in (-1, 1):
            edge |= np.roll(direct, by, axis) != direct
    assert is_front[direct & ~edge].all() and not is_back[direct & ~edge].any()
    assert is_back[~direct & ~edge].all()
    assert (is_back & ~is_front & ~edge).sum() > 50  # the mirror image


# What else asks for materials


def test_derivatives_by_both_sides_are_differences() -> None:
    """By every colour of both materials, with paths in waves and without; by differences in double precision."""
    both = replace(
        ROOM,
        objects=ROOM.objects
        | {"turned": vr.Disk(center=(0.5, 1.4, 0), normal=(0, 0.3, -1), radius=0.6, material="sheet")},
        film=vr.Film(width=12, height=9),
    )
    plain = replace(both, objects={n: x for n, x in both.objects.items() if n not in ("mirror", "glass")})
    step = 1e-4
    unshaded = replace(plain, settings=replace(plain.settings, shadows=False))
    for scene, parts in ((both, ("kd.1", "shininess")), (unshaded, ("ka.0", "kd.1", "ks.2", "shininess"))):
        for address in (f"materials.{material}.{part}" for material in ("sheet", "inner") for part in parts):
            slope, truth = vr.derivative(scene, address, progress=False), vr.difference(scene, address, step)
            # Colours enter linearly. A power has the third derivative ln^3 x x^a < 1 at an exponent of 8 and more.
            assert np.abs(slope - truth).max() <= step**2 / 6 + 64 * np.finfo(float).eps / step, address
            assert np.abs(truth).max() > 1e-3


def test_derivatives_by_the_mirror_on_the_back() -> None:
    """In a scene without glass: at glass without kr, ways are chosen otherwise if the derivative by kr is asked for."""
    scene = from_behind(on_both(kr=(0.5, 0.4, 0.6))(ROOM))
    objects = {name: x for name, x in scene.objects.items() if name != "glass"}
    scene = replace(scene, film=vr.Film(width=12, height=9), objects=objects)
    for part in ("sheet", "inner"):
        address, step = f"materials.{part}.kr.0", 1e-4
        slope, truth = vr.derivative(scene, address, progress=False), vr.difference(scene, address, step)
        # The picture is a polynomial in kr; its degree is the depth, 6, and its coefficients are below 1.
        assert np.abs(slope - truth).max() <= 120 * step**2 / 6 + 64 * np.finfo(float).eps / step
        assert (np.abs(truth).max() > 1e-2) == (part == "inner")


@pytest.mark.parametrize("material", ["sheet", "inner"])
def test_opaque_sides_have_no_derivative_by_kt(material: str) -> None:
    with pytest.raises(UserError, match=f"materials.{material}.kt.0: has no derivative as the two sides"):
        vr.derivative(ROOM, f"materials.{material}.kt.0", progress=False)


def test_only_materials_with_a_back_have_code_for_it() -> None:
    """Neither other objects of the scene, nor materials that no object has."""
    kernel = prepare(ROOM).kernel
    assert [batch.back is not None for batch in kernel.batches] == [b.names[0] == "sheet" for b in kernel.batches]
    unused = replace(ROOM, objects={n: x for n, x in ROOM.objects.items() if n != "sheet"})
    assert not features(unused)["two-sided"] and all(b.back is None for b in prepare(unused).kernel.batches)
    named = next(f for f in features(ROOM).listed if f.name == "two-sided")
    assert named.reason == "needed by materials.sheet"


def test_materials_of_backs_are_in_use() -> None:
    """An effect that only a back has is simulated, and what is odd about a back is said."""
    assert set(used_materials(ROOM)) == set(ROOM.materials)
    bright = replace(ROOM, materials=ROOM.materials | {"inner": vr.Material(kr=(0.9, 0.9, 0.9), shininess=3000.5)})
    plain = replace(bright, objects={"sheet": bright.objects["sheet"]})
    assert features(plain)["reflection"] and features(plain).shininess_bits >= 12
    assert [note.split(":")[0] for note in energy_notes(plain)] == ["materials.inner"]


def test_an_object_is_as_bright_as_its_brighter_side() -> None:
    lamp = replace(ROOM, materials=ROOM.materials | {"inner": vr.Material(kd=(9.0, 9.0, 9.0), shading="unlit")})
    found = Brightness.of(prepare(lamp)).objects
    assert found["sheet"] == found["inner"] == pytest.approx(9.0)


def test_a_prepared_scene_follows_its_materials() -> None:
    """Numbers of the back, another back, and another material of an object."""
    made = vr.prepare(from_behind(ROOM))
    for assignments in (
        {"materials.inner.kd": (0.1, 0.9, 0.1)},
        {"materials.sheet.back": "floor"},
        {"objects.sheet.material": "floor"},
        {"objects.sheet.material": "sheet", "materials.sheet.back": None},
        {"materials.sheet.back": "mirror"},
    ):
        made = made.updated(assignments)
        assert np.array_equal(shown(made), shown(made.scene))


def test_the_story_of_a_pixel_names_the_side() -> None:
    for scene, name in ((ROOM, "sheet"), (from_behind(ROOM), "inner")):
        surface = vr.why(scene, 16, 4).surfaces[0]
        assert (surface.object, surface.material["address"]) == ("objects.sheet", f"materials.{name}")
        assert surface.material["kd"] == pytest.approx(ROOM.materials[name].kd)


def test_colours_of_data_are_on_the_front_only() -> None:
    """Triangles from both sides, against the same scene written out, in which each has a material of its own."""
    layer = vr.DataLayer(
        source={"lon": [-60, -20, 20, 60], "lat": [10, 0, 20, -10], "heat": [1, 2, 3, 4]},
        gizmo="triangle", color="heat", height=0.5, radius=0.3, material="sheet",
    )  # fmt: skip
    scene = vr.Scene(
        film=vr.Film(width=48, height=36),
        materials={"sheet": replace(FRONT, colored=("kd",)), "inner": INNER},
        lights={"sun": vr.DirectionalLight(direction=(0, -1, 0)), "other": vr.DirectionalLight(direction=(0, -1, -1))},
        data=vr.Data(base=vr.MapBase(width=3.0), layers={"heat": layer}),
        settings=vr.Settings(spp=1),
        camera=vr.Camera(),
    )
    kinds = {}
    for z in (3.0, -3.0):
        view = checked(replace(scene, camera=vr.Camera(origin=(0, 1.5, z), fov=50)))
        image = vr.render(view, progress=False, layers=("RGB", "albedo", "id"))
        twin = vr.render(written_out(view), progress=False, layers=("RGB", "albedo", "id"))
        for name in ("RGB", "albedo", "id"):
            assert np.array_equal(image[name], twin[name])
        kinds |= dict.fromkeys(tuple(x) for x in image["albedo"][image["id"] > 1].tolist())
    assert tuple(albedo(INNER).tolist()) in kinds and len(kinds) > 2  # the back in its own colour, and fronts in theirs


def test_the_comparison_with_mitsuba_knows_both_sides() -> None:
    scene, _ = flat_scene(30, "single")
    assert crosscheck.check(scene, rays=1000).passed
    without = replace(scene, materials={name: replace(m, back=None) for name, m in scene.materials.items()})
    assert not crosscheck.check(scene, rays=1000, other=without).passed


# Wrong input

GLASS = vr.Material(kt=(0.5, 0.5, 0.5))
WRONG = {
    "unknown": ({"a": vr.Material(back="iner"), "inner": INNER},
                'materials.a.back = "iner": unknown material; did you mean "inner"? (one of default, a, inner)'),
    "itself": ({"a": vr.Material(back="a")},
               'materials.a.back = "a": is the material itself; name another one, or leave the back out'),
    "back of a back": ({"a": vr.Material(back="b"), "b": vr.Material(back="c"), "c": INNER},
                       'materials.a.back = "b": materials.b has a back itself; name a material without one'),
    "back of glass": ({"a": replace(GLASS, back="b"), "b": INNER},
                      "materials.a.kt = [0.5, 0.5, 0.5]: a material with a back is opaque; write the kt [0, 0, 0], or "
                      "leave the back out"),
    "back as glass": ({"a": vr.Material(back="b"), "b": GLASS},
                      'materials.a.back = "b": materials.b has the kt [0.5, 0.5, 0.5]; name an opaque material, whose '
                      "kt is [0, 0, 0]"),
    "default as glass": ({"a": vr.Material(back="default"), "default": GLASS},
                         'materials.a.back = "default": materials.default has the kt [0.5, 0.5, 0.5]; name an opaque '
                         "material, whose kt is [0, 0, 0]"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_back_is_an_error(case: str) -> None:
    materials, message = WRONG[case]
    scene = vr.Scene(materials=materials, objects={"x": vr.Disk(material="a")}, camera=vr.Camera(), lights={})
    with pytest.raises(UserError) as error:
        checked(scene)
    assert str(error.value).splitlines() == [message]


def test_the_default_material_can_be_a_back() -> None:
    scene = vr.Scene(
        materials={"a": vr.Material(back="default")},
        objects={"x": vr.Disk(material="a")},
        camera=vr.Camera(),
        lights={},
    )
    assert set(used_materials(checked(scene))) == {"a", "default"}


def test_a_back_with_a_texture_needs_texture_coordinates(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    raw = {
        "textures": {"t": {"type": "checker"}},
        "materials": {"a": {"back": "b"}, "b": {"texture": "t"}},
        "objects": {"m": {"type": "mesh", "file": str(tmp_path / "a.ply"), "material": "a"}},
        "camera": {},
        "lights": {},
    }
    assert examined(raw)[1] == [
        "objects.m.material = \"a\": has the texture 't' on its back, and the mesh file has no texture coordinates; "
        "take a material without texture"
    ]
