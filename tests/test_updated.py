"""A prepared scene with other values at some addresses: what it shows, what it keeps, what is compiled."""

from typing import Any

import drjit as dr
import numpy as np
import pytest
import trimesh
from samples import NAMES, SAMPLES

import visray as vr
from visray.columns import Names
from visray.number_table import NumberTable
from visray.pytree import Shared, detached, evaluated, leaves, mapped, rebuilt, rows
from visray.quantities import Arrays
from visray.scene.address import numeric_addresses, value

SCENE = vr.Scene(
    film=vr.Film(width=32, height=24),
    materials={
        "red": vr.Material(kd=(0.8, 0.1, 0.1), ks=(0.3, 0.3, 0.3), shininess=8.0),
        "clear": vr.Material(kt=(0.5, 0.6, 0.7)),
    },
    lights={
        "key": vr.PointLight(position=(3, 5, 4)),
        "sun": vr.DirectionalLight(direction=(-1, -2, -1), intensity=0.4),
    },
    objects={
        "floor": vr.Plane(point=(0, -1, 0)),
        "ball": vr.Sphere(radius=0.7, material="red"),
        "other": vr.Sphere(center=(1.2, 0, 0), radius=0.3, material="clear"),
        "turned": vr.Box(min=(-2, -0.5, -0.5), max=(-1.2, 0.5, 0.5), transform=(vr.Rotate(rotate=20.0),)),
        "ring": vr.Torus(center=(0, 0.9, 0), major=0.5, minor=0.1),
    },
    settings=vr.Settings(spp=2, depth=2), camera=vr.Camera(),
)  # fmt: skip
CHANGES = {
    "a place": {"objects.ball.center.0": 0.4},
    "a size and a colour": {"objects.other.radius": 0.5, "materials.red.kd": (0.1, 0.7, 0.2)},
    "a step of a transform": {"objects.turned.transform.0.rotate": -35.0},
    "a field that a polynomial depends on": {"objects.ring.minor": 0.2},
    "a light": {"lights.key.position": (-3.0, 4.0, 5.0), "lights.sun.intensity": 0.9},
    "the camera": {"camera.origin": (0.5, 1.5, 6.0), "camera.fov": 33.0},
    "sky, ambient light and seed": {"background.top": (0.2, 0.1, 0.4), "ambient": (0.5, 0.4, 0.3), "settings.seed": 7},
    "samples": {"settings.spp": 5},
    "nothing": {},
}


def picture(prepared: Any, **more: Any) -> np.ndarray:
    return vr.render(prepared, progress=False, layers=("RGB", "id"), **more)["RGB"]


def compiled(work: Any) -> int:
    """How many kernels are compiled, or fetched from a cache, that this process has not run before."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        work()
        return sum(not k["cache_hit"] or k["cache_disk"] for k in dr.kernel_history([dr.KernelType.JIT]))


@pytest.mark.parametrize("what", CHANGES)
@pytest.mark.slow
def test_it_shows_what_a_scene_with_these_values_does_and_compiles_nothing(what: str) -> None:
    prepared = vr.prepare(SCENE)
    picture(prepared)
    new = prepared.updated(CHANGES[what])
    # Compiled once by any update: what puts rows into columns.
    assert compiled(lambda: picture(prepared.updated(CHANGES[what]))) == 0
    scene = SCENE
    for address, to in CHANGES[what].items():
        scene = vr.replaced(scene, address, to)
    assert np.array_equal(picture(new), picture(scene))
    assert new.scene == scene and (what == "nothing") == np.array_equal(picture(new), picture(prepared))
    assert prepared.scene is not new.scene or what == "nothing"


def test_only_what_moves_is_packed_and_placed_anew() -> None:
    prepared = vr.prepare(SCENE)
    new = prepared.updated({"objects.ball.center.1": 0.25})
    moved = [old is not last for old, last in zip(prepared.packed.batches, new.packed.batches)]
    names = [list(b.names) for b, m in zip(new.packed.batches, moved) if m]
    assert names == [["ball", "other"]]
    for old, last, m in zip(prepared.kernel.batches, new.kernel.batches, moved):
        assert (old.placed is last.placed) == (not m)
    assert new.packed.materials is prepared.packed.materials and new.packed.camera is prepared.packed.camera
    lit = prepared.updated({"lights.key.intensity": 2.0})
    assert lit.kernel.geometry is prepared.kernel.geometry or all(
        a.placed is b.placed for a, b in zip(lit.kernel.batches, prepared.kernel.batches)
    )
    assert lit.kernel.geometry.tree is prepared.kernel.geometry.tree


@pytest.mark.parametrize(
    "change",
    [
        {"materials.clear.kt": (0.0, 0.0, 0.0)},
        {"settings.precision": "double"},
        {"objects.ball": vr.Box()},
        {"objects.ball.transform": (vr.Scale(scale=2.0),)},
        {"film.width": 40},
        {"settings.accelerator": "tree"},
        {"settings.shadows": False},
        {"objects": {"lone": vr.Sphere()}, "camera": {}, "lights": {}},
    ],
    ids=lambda c: next(iter(c)),
)
def test_where_more_than_numbers_changes_all_is_prepared_anew(change: dict) -> None:
    new = vr.prepare(SCENE).updated(change)
    assert np.array_equal(picture(new), picture(new.scene))


def test_a_tree_follows_what_moves() -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform(-2, 2, (200, 3))
    scene = vr.Scene(
        film=SCENE.film,
        objects={f"b{i}": vr.Sphere(center=tuple(map(float, p)), radius=0.2) for i, p in enumerate(places)},
        settings=vr.Settings(spp=1),
        camera=vr.Camera(),
        lights={},
    )
    prepared = vr.prepare(scene)
    assert prepared.kernel.geometry.tree is not None
    picture(prepared)
    change = {f"objects.b{i}.center": tuple(map(float, -places[i])) for i in range(0, 200, 7)}
    picture(prepared.updated(change))
    assert compiled(lambda: picture(prepared.updated(change))) == 0
    new = prepared.updated(change)
    assert np.array_equal(picture(new), picture(new.scene))


@pytest.mark.parametrize("name", NAMES)
def test_every_number_of_every_kind_can_be_moved(name: str) -> None:
    """To that of another object of the kind, address by address of all numbers and tables that kernels read."""
    rng = np.random.default_rng(3)
    one, two = (SAMPLES[name].random(rng, 1.0) for _ in range(2))
    scene = vr.Scene(
        film=vr.Film(width=8, height=6),
        objects={"x": one, "y": one},
        settings=vr.Settings(spp=1),
        camera=vr.Camera(),
        lights={},
    )
    other = vr.Scene(objects={"x": two}, camera=vr.Camera(), lights={})
    change = {a: value(other, a) for a in numeric_addresses(other) if a.startswith("objects.x.")}
    change |= {f"objects.x.{k}": x.values for k, x in vars(two).items() if isinstance(x, NumberTable)}
    prepared = vr.prepare(scene)
    new = prepared.updated(change)
    fresh = vr.prepare(new.scene)
    for ours, theirs in zip(*(leaves(p.packed.batches, shared=True) for p in (new, fresh))):
        assert np.array_equal(np.array(ours), np.array(theirs))
    assert len(prepared.packed.batches) != 1 or new.packed.batches[0] is not prepared.packed.batches[0]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"objects.ball.radius": -1.0}, "objects.ball.radius = -1.0"),
        ({"objects.bal.radius": 1.0}, "ball"),
        ({"objects.ring.minor": 3.0}, "must be less than major"),
        ({"objects.ball.material": "blue"}, "unknown material"),
        ({"camera.target": (0.0, 1.0, 6.0)}, "must differ from origin"),
    ],
)
def test_what_is_wrong_is_told_and_changes_nothing(change: dict, says: str) -> None:
    prepared = vr.prepare(SCENE)
    before = picture(prepared)
    with pytest.raises(vr.UserError, match=says):
        prepared.updated(change)
    assert np.array_equal(picture(prepared), before)


def test_a_prepared_scene_takes_the_settings_of_a_render() -> None:
    prepared = vr.prepare(SCENE)
    for more in ({"spp": 3}, {"seed": 4}, {"size": (20, 10)}, {"precision": "double"}):
        assert np.array_equal(picture(prepared, **more), picture(SCENE, **more))


# Names, and what rows have in common


def test_names_are_listed_or_numbered() -> None:
    listed, numbered = Names(("a", "b.c")), Names(prefix="rain.", numbers=np.array([0, 2, 5]))
    assert list(listed) == ["a", "b.c"] and [listed.row(n) for n in ("a", "b.c", "d")] == [0, 1, None]
    assert list(numbered) == ["rain.0", "rain.2", "rain.5"] and len(numbered) == 3
    wrong = ("rain.3", "rain.6", "rain.02", "rain.", "snow.2", "rain.-1")
    assert [numbered.row(n) for n in ("rain.5", *wrong)] == [2, *6 * [None]]


def test_names_of_several_rows_each() -> None:
    names = Names(("a", "b"), counts=(2, 3))
    assert list(names) == ["a", "a", "b", "b", "b"] and len(names) == 5
    assert [names.row(n) for n in ("a", "b", "c")] == [0, 2, None]


def mesh_scene(normals: str) -> vr.Scene:
    """A lit ball of 320 triangles before a floor, and another mesh in the same batch."""
    ball = trimesh.creation.icosphere(subdivisions=2)
    mesh = vr.Mesh(vertices=ball.vertices, faces=ball.faces, normals=normals)
    turned = (vr.Rotate(rotate=30.0), vr.Translate(translate=(1.5, 0.2, 0.0)))
    box = trimesh.creation.box()
    other = vr.Mesh(vertices=box.vertices, faces=box.faces, normals=normals, transform=turned)
    objects = {"floor": vr.Plane(point=(0, -1, 0)), "m": mesh, "box": other}
    return vr.Scene(
        film=SCENE.film, lights=SCENE.lights, objects=objects, settings=vr.Settings(spp=2), camera=vr.Camera()
    )


@pytest.mark.parametrize("normals", ["face", "smooth"])
def test_a_mesh_with_other_vertices_is_that_of_a_fresh_scene_and_compiles_nothing(normals: str) -> None:
    """As long as its sizes stay. Another number of triangles is prepared anew, and is as good."""
    prepared = vr.prepare(mesh_scene(normals))
    old = prepared.scene.objects["m"]
    v = old.vertices.values
    waves = v * (1 + 0.05 * np.sin(7 * v.sum(1, keepdims=True)))
    picture(prepared)
    # In the first change, small kernels place the batch of meshes alone.
    picture(prepared.updated({"objects.m.vertices": waves}))
    assert compiled(lambda: picture(prepared.updated({"objects.m.vertices": 0.98 * waves}))) == 0
    new = prepared.updated({"objects.m.vertices": 0.98 * waves})
    assert np.array_equal(picture(new), picture(vr.prepare(new.scene)))
    assert not np.array_equal(picture(new), picture(prepared))
    assert old.vertices.values is v
    # The other mesh follows its transform.
    turned = prepared.updated({"objects.box.transform.0.rotate": 70.0})
    picture(turned)
    assert compiled(lambda: picture(prepared.updated({"objects.box.transform.0.rotate": 71.0}))) == 0
    assert np.array_equal(picture(turned), picture(vr.prepare(turned.scene)))
    half = prepared.updated({"objects.m.faces": old.faces.values[::2]})
    assert np.array_equal(picture(half), picture(vr.prepare(half.scene)))


def test_what_is_shared_is_left_whole() -> None:
    a = Arrays.of()
    record = (a.F([1, 2, 3]), Shared((a.F([5, 6]), None)))
    one = rows(record, a.U(2))
    assert one[0].numpy().tolist() == [3] and one[1] is record[1]
    assert len(leaves(record)) == 1 and len(leaves(record, shared=True)) == 2
    assert rebuilt(record, (a.F(9),))[1] is record[1]
    dr.enable_grad(record[1].value[0])
    assert not dr.grad_enabled(detached(record)[1].value[0])
    assert mapped(lambda x: x + 1, ("name", int, None, 3)) == ("name", int, None, 3)
    assert evaluated(record) is record


def test_so_many_rows_at_once_are_moved_by_one_kernel() -> None:
    """However many: their number is no code."""
    places = np.random.default_rng(1).uniform(-2, 2, (60, 3))
    things = {f"b{i}": vr.Sphere(center=tuple(map(float, p)), radius=0.2) for i, p in enumerate(places)}
    prepared = vr.prepare(
        vr.Scene(film=SCENE.film, objects=things, settings=vr.Settings(spp=1), camera=vr.Camera(), lights={})
    )

    def moved(count: int) -> None:
        picture(prepared.updated({f"objects.b{i}.radius": 0.1 for i in range(count)}))

    moved(7)
    assert [compiled(lambda n=n: moved(n)) for n in (8, 9, 23, 59)] == [0, 0, 0, 0]


@pytest.mark.parametrize("given", [None, "objects.ball.radius=1", [("objects.ball.radius", 1.0)]])
def test_what_is_no_dict_is_refused(given: Any) -> None:
    with pytest.raises(vr.UserError, match=r"^assignments = .*: must be a dict$"):
        vr.prepare(SCENE).updated(given)


@pytest.mark.parametrize("given", [{3: 1.0}, {"": 1.0}])
def test_what_is_no_assignment_is_refused(given: Any) -> None:
    with pytest.raises(vr.UserError, match="takes a dict from addresses to values"):
        vr.prepare(SCENE).updated(given)


def test_a_prepared_scene_that_was_changed_in_place_is_refused() -> None:
    for change in (lambda o: o.update(new=vr.Sphere()), lambda o: o.pop("ball"), lambda o: o.update(ball=vr.Sphere())):
        prepared = vr.prepare(SCENE)
        change(prepared.scene.objects)
        with pytest.raises(vr.UserError, match="changed in place"):
            prepared.updated({"ambient": (1.0, 1.0, 1.0)})
