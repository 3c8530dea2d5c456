"""Derivatives against central differences in double, on views without silhouettes or shadow edges.

Tolerance: a central difference of step s is off by s^2/6 of the third derivative and by u/s of the values; with
s = 1e-6 of the middle both stay under 1e-9 of numbers about 1. ROUNDING is ten times that, for sums over the picture.
"""

import warnings
from dataclasses import replace

import drjit as dr
import numpy as np
import pytest
import trimesh

import visray as vr
from visray.accel import policy
from visray.passes import expose
from visray.setup import prepare

ROUNDING = 1e-8
PAINT = vr.Material(ka=(0.2, 0.1, 0.1), kd=(0.5, 0.2, 0.3), ks=(0.4, 0.5, 0.6), shininess=17.3)
LAMP = vr.PointLight(position=(2.0, 3.0, 5.0), intensity=1.2, Ia=(0.1, 0.2, 0.3), a=0.5, b=0.1, c=0.02)
CLOSE = vr.Scene(
    camera=vr.Camera(origin=(0.0, 0.3, 4.0), target=(0.0, 0.1, 0.0), fov=8.0),
    film=vr.Film(width=24, height=16),
    materials={"paint": PAINT, "other": vr.Material()},
    objects={"ball": vr.Sphere(center=(0.1, 0.0, -0.2), radius=1.1, material="paint")},
    lights={"key": LAMP, "fill": vr.PointLight(position=(-4.0, 2.0, 6.0), intensity=0.3)},
    settings=vr.Settings(spp=4, precision="double"),
)
# Objects that are in the kernel but out of the picture.
AROUND = {f"bead {i}": vr.Sphere(center=(i * 0.3 - 5.0, 8.0, -9.0), radius=0.1, material="other") for i in range(40)}
CROWD = replace(
    CLOSE,
    objects={
        "floor": vr.Plane(point=(0.0, -5.0, 0.0), material="other"),
        **AROUND,
        **CLOSE.objects,
        "crate": vr.Box(min=(3.0, 3.0, -9.0), max=(4.0, 4.0, -8.0), material="other"),
    },
)
ADDRESSES = (
    "materials.paint.ka", "materials.paint.kd", "materials.paint.ks", "materials.paint.shininess",
    "lights.key.intensity", "lights.key.position", "lights.key.Id", "lights.key.Is", "lights.key.Ia",
    "lights.key.a", "lights.key.b", "lights.key.c", "camera.origin", "camera.target", "camera.up", "camera.fov",
    "objects.ball.radius", "objects.ball.center", "ambient",
)  # fmt: skip


@pytest.fixture(autouse=True)
def no_edges():
    """No view here has an edge unless a test says so: a warning is a failure."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", vr.EdgeWarning)
        yield


def parts(scene, address):
    """The single numbers at an address."""
    size = np.size(vr.value(scene, address))
    return [address] if size == 1 else [f"{address}.{i}" for i in range(size)]


@pytest.mark.parametrize("scene", [CLOSE, CROWD], ids=["one object", "many objects of three kinds"])
@pytest.mark.slow
def test_forward_and_reverse_equal_central_differences(scene):
    found = vr.gradient(scene, ADDRESSES)
    for address in ADDRESSES:
        for i, part in enumerate(parts(scene, address)):
            truth = vr.difference(scene, part).mean()
            assert abs(np.ravel(found[address])[i] - truth) <= ROUNDING * max(1.0, abs(truth)), part
            assert abs(vr.derivative(scene, part).mean() - truth) <= ROUNDING * max(1.0, abs(truth)), part


@pytest.mark.parametrize(
    ("name", "thing", "addresses"),
    [
        ("plane", vr.Plane(point=(0.0, 0.0, 0.3), normal=(0.1, 0.2, 1.0), material="paint"), ("point", "normal")),
        (
            "rectangle",
            vr.Rectangle(width=(3.0, 0.2, 0.0), height=(0.0, 3.0, 0.5), material="paint"),
            ("center", "width"),
        ),
        ("disk", vr.Disk(normal=(0.2, 0.1, 1.0), radius=2.0, material="paint"), ("center", "normal")),
        (
            "triangle",
            vr.Triangle(a=(-3.0, -3.0, 0.0), b=(3.0, -3.0, 0.2), c=(0.0, 4.0, 0.1), material="paint"),
            ("a", "b", "c"),
        ),
        (
            "moved sphere",
            vr.Sphere(material="paint", transform=(vr.Scale(scale=(2.0, 1.0, 1.5)), vr.Rotate(rotate=20.0))),
            ("center", "radius"),
        ),
    ],
)
def test_every_smooth_kind(name, thing, addresses):
    scene = replace(CLOSE, objects={"thing": thing})
    for address in (f"objects.thing.{a}" for a in addresses):
        for part in parts(scene, address):
            slope, truth = vr.derivative(scene, part), vr.difference(scene, part)
            # Pixel by pixel: the sum of a pixel's terms, not of the picture's.
            assert np.abs(slope - truth).max() <= 10 * ROUNDING * max(1.0, np.abs(truth).max()), part


@pytest.mark.parametrize(
    ("kind", "thing", "addresses"),
    [
        ("box", vr.Box(min=(-2.0, -2.0, -1.0), max=(2.0, 2.0, 0.5), material="paint"), ("min", "max")),
        ("cylinder", vr.Cylinder(radius=1.0, height=9.0, material="paint"), ("radius", "axis", "center")),
        (
            "cone",
            vr.Cone(base=(0.0, -4.0, 0.0), radius=2.0, height=9.0, material="paint"),
            ("radius", "height", "base"),
        ),
    ],
)
def test_kinds_with_creases_are_right_on_a_face_and_warn_where_two_are_in_view(kind, thing, addresses):
    scene = replace(CLOSE, objects={"thing": thing})
    for address in (f"objects.thing.{a}" for a in addresses):
        for part in parts(scene, address):
            slope, truth = vr.derivative(scene, part), vr.difference(scene, part)
            assert np.abs(slope - truth).max() <= 10 * ROUNDING * max(1.0, np.abs(truth).max()), part
    below = vr.Camera(origin=(7.0, -12.0, 9.0), target=(0.0, 0.0, 0.0), fov=70.0)
    line = (
        r"^the picture has moving edges \(silhouettes of objects.thing; creases of objects.thing\): the derivative "
        r"leaves them out, so it can be wrong by a factor or in its sign, and not only a little; compare with "
        r"vr.difference\(scene, address, step=0.01\)$"
    )
    with pytest.warns(vr.EdgeWarning, match=line):
        vr.gradient(
            replace(scene, camera=below, lights={"key": replace(LAMP, position=(3.0, 3.0, 5.0))}),
            [f"objects.thing.{addresses[0]}"],
        )


WEDGE = ([[-3, -3, 0], [3, -3, 0.2], [0, 4, 0.1], [9, 9, -5]], [[0, 1, 2], [1, 3, 2]])
BALL = trimesh.creation.icosphere(subdivisions=1)
MIRRORED = (vr.Rotate(rotate=20.0), vr.Scale(scale=(-1.0, 1.2, 1.0)))


def mesh_scene(normals, **more):
    """A mesh whose creases and silhouettes are out of view."""
    v, f = (BALL.vertices * 1.1, BALL.faces) if normals == "smooth" else WEDGE
    mesh = vr.Mesh(vertices=v, faces=f, normals=normals, crease=180.0, material="paint", transform=MIRRORED)
    return replace(CLOSE, objects={"thing": replace(mesh, **more)})


def mean_along(scene, address, way, step=1e-6):
    """Slope of the picture's mean as the numbers of a table move along `way`."""
    table = vr.value(scene, address).values
    means = [
        np.mean(np.array(expose(prepare(vr.replaced(scene, address, table + sign * step * way)))[0].mean))
        for sign in (1, -1)
    ]
    return (means[0] - means[1]) / (2 * step)


@pytest.mark.parametrize("normals", ["face", pytest.param("smooth", marks=pytest.mark.slow)])
def test_vertices_of_a_mesh(normals):
    """Normals of a smooth mesh move with the vertices."""
    scene, address = mesh_scene(normals), "objects.thing.vertices"
    # visray does not know whether a mesh of several triangles hides a part of itself.
    hides = r"\(silhouettes of objects.thing\)"
    quiet = warnings.catch_warnings() if normals == "face" else pytest.warns(vr.EdgeWarning, match=hides)
    with quiet:
        slope = vr.derivative(scene, address)
        found = vr.gradient(scene, [address])[address]
    assert np.abs(slope - vr.difference(scene, address)).max() <= 10 * ROUNDING
    way = np.random.default_rng(4).uniform(-1, 1, found.shape)
    assert abs(np.sum(found * way) - mean_along(scene, address, way)) <= ROUNDING


@pytest.mark.slow
def test_vertices_of_a_geometry_are_those_of_all_its_instances():
    mesh = mesh_scene("face").objects["thing"]
    near, far = ((vr.Translate(translate=(0.0, 0.0, z)),) for z in (0.0, -99.0))
    shape, address = replace(mesh, material="default"), "geometries.shape.vertices"
    objects = {"far": vr.Instance(geometry="shape", transform=far)}
    objects["near"] = vr.Instance(geometry="shape", transform=near, material="paint")
    found = vr.gradient(replace(CLOSE, geometries={"shape": shape}, objects=objects), [address])[address]
    alone = vr.gradient(mesh_scene("face"), ["objects.thing.vertices"])["objects.thing.vertices"]
    np.testing.assert_allclose(found, alone, atol=ROUNDING)


def test_faces_of_a_mesh_have_creases_between_them():
    flat = replace(mesh_scene("smooth").objects["thing"], normals="face")
    with pytest.warns(vr.EdgeWarning, match=r"\(silhouettes of objects.thing; creases of objects.thing\)"):
        vr.gradient(replace(CLOSE, objects={"thing": flat}), ["objects.thing.vertices"])


@pytest.mark.parametrize(
    ("more", "path", "line"),
    [
        ({}, "faces", "those of a mesh are vertices"),
        ({}, "transform.0.rotate", "those of a mesh are vertices"),
        ({"fit": 2.0}, "vertices", "fit scales the mesh by the vertices; give fitted vertices, and leave fit out"),
        (
            {"vertices": None, "faces": None, "file": "ball.obj"},
            "vertices",
            "the vertices are in a file; give vertices and faces in the scene",
        ),
    ],
)
def test_what_of_a_mesh_has_no_derivative_says_why(tmp_path, more, path, line):
    if "file" in more:
        BALL.export(tmp_path / "ball.obj")
        more = more | {"file": str(tmp_path / "ball.obj")}
    with pytest.raises(vr.UserError, match=f"^objects.thing.{path}: has no derivative; {line}$"):
        vr.gradient(mesh_scene("face", **more), [f"objects.thing.{path}"])


def test_looped_objects_have_the_derivatives_of_written_out_ones(monkeypatch):
    written = vr.gradient(CROWD, ADDRESSES)
    monkeypatch.setattr(policy, "MAX_UNROLLED", 0)
    monkeypatch.setattr(policy, "MAX_UNROLLED_SHARED", 0)
    looped = vr.gradient(CROWD, ADDRESSES)
    for address in ADDRESSES:
        np.testing.assert_allclose(looped[address], written[address], rtol=ROUNDING, atol=ROUNDING)


def test_a_zero_term_may_have_a_slope():
    """d/d ks at ks = 0: the highlight is not in the kernel until it is asked for."""
    dull = vr.replaced(CLOSE, "materials.paint.ks", (0.0, 0.0, 0.0))
    assert not vr.explain(dull)["specular"]
    slope = vr.gradient(dull, ["materials.paint.ks"])["materials.paint.ks"]
    truth = [vr.difference(CLOSE, p).mean() for p in parts(CLOSE, "materials.paint.ks")]  # linear in ks
    np.testing.assert_allclose(slope, truth, rtol=ROUNDING)
    assert min(slope) > 0.01


def test_loss_sees_the_picture_row_by_row():
    weights = np.random.default_rng(5).uniform(size=(3, 24 * 16))

    def loss(rgb):
        return dr.sum(dr.sum(rgb * type(rgb)(weights), axis=0))

    slope = vr.gradient(CLOSE, ["materials.paint.kd"], loss)["materials.paint.kd"]
    for i in range(3):
        picture = vr.difference(CLOSE, f"materials.paint.kd.{i}").reshape(-1, 3).T
        truth = float((picture * weights).sum())
        assert abs(slope[i] - truth) <= ROUNDING * np.abs(picture * weights).sum()


@pytest.mark.parametrize(
    ("loss", "line"),
    [
        (lambda rgb: float(np.mean(np.array(rgb))), "returned a value of type float, which carries no derivatives"),
        (lambda rgb: np.mean(np.array(rgb)), "returned a value of type float64, which carries no derivatives"),
        (lambda rgb: np.array(rgb).mean(axis=1), "returned a value of type ndarray, which carries no derivatives"),
        (lambda rgb: None, "returned a value of type NoneType, which carries no derivatives"),
        (lambda rgb: type(rgb.x)(float(np.mean(np.array(rgb)))), "its result carries no derivatives"),
        (lambda rgb: dr.detach(dr.mean(rgb.x)), "its result carries no derivatives"),
        (lambda rgb: rgb.x, "returned 384 numbers, not one"),
        (lambda rgb: dr.mean(rgb, axis=1), "returned 3 numbers, not one"),
    ],
    ids=[
        "float",
        "NumPy number",
        "NumPy array",
        "nothing",
        "through NumPy",
        "detached",
        "a number a pixel",
        "a colour",
    ],
)
def test_loss_that_loses_the_derivatives_is_refused(loss, line):
    """Each gave a gradient of 0 or of another loss."""
    with pytest.raises(vr.UserError, match=f"^loss: {line}.*; return one number computed with Dr.Jit"):
        vr.gradient(CLOSE, ["materials.paint.kd"], loss, spp=1)


def test_loss_of_a_picture_that_does_not_depend_on_an_address_is_flat():
    assert vr.gradient(CLOSE, ["background.top.0"], lambda rgb: dr.mean(rgb.x), spp=1) == {"background.top.0": 0}


def test_single_precision_agrees_to_single_precision():
    single = vr.gradient(CLOSE, ADDRESSES, precision="single")
    double = vr.gradient(CLOSE, ADDRESSES)
    for address in ADDRESSES:
        # 2^-24 for each of some hundred operations a sample, over sums of 384 pixels of both signs.
        np.testing.assert_allclose(single[address], double[address], rtol=1e-4, atol=1e-4)


def test_edges_warn_for_what_moves_and_not_for_colours():
    wide = replace(CLOSE, camera=replace(CLOSE.camera, fov=60.0))
    for address in ("objects.ball.radius", "camera.origin"):
        with pytest.warns(vr.EdgeWarning, match="silhouettes of objects.ball"):
            vr.gradient(wide, [address])
    colours = ["materials.paint.kd", "materials.paint.shininess", "lights.key.intensity", "ambient", "background.top"]
    found = vr.gradient(wide, colours)
    for address in colours:
        for i, part in enumerate(parts(wide, address)):
            truth = vr.difference(wide, part).mean()
            assert abs(np.ravel(found[address])[i] - truth) <= ROUNDING * max(1.0, abs(truth)), part


def test_only_edges_that_move_are_named():
    """A light moves no silhouette, and an object none of another; a camera moves all."""
    balls = {f"ball {i}": vr.Sphere(center=(i - 2.0, 0.0, 0.0), radius=0.4, material="paint") for i in range(6)}
    scene = replace(CLOSE, camera=replace(CLOSE.camera, fov=60.0), objects=balls, lights={"key": LAMP})
    scene = replace(scene, settings=replace(scene.settings, shadows=False), materials={"paint": vr.Material()})
    vr.gradient(scene, ["lights.key.position"])
    with pytest.warns(vr.EdgeWarning, match=r"edges \(silhouettes of objects.ball 3\):"):
        vr.gradient(scene, ["objects.ball 3.radius", "lights.key.position"])
    four = ", ".join(f"objects.ball {i}" for i in range(4))
    with pytest.warns(vr.EdgeWarning, match=rf"edges \(silhouettes of {four} and 2 more\):"):
        vr.gradient(scene, ["camera.origin"])


SMOOTH = {
    "ellipsoid": vr.Ellipsoid(radii=(2.0, 1.0, 1.5), transform=(vr.Rotate(rotate=20.0),)),
    "capsule": vr.Capsule(a=(0.0, -0.1, 0.0), b=(0.0, 0.2, 0.0), radius=1.0, transform=(vr.Scale(scale=1.1),)),
    "polynomial": vr.Polynomial(expression="x^2 + 2*y^2 + z^2 - 1", ends="capped", transform=(vr.Scale(scale=1.5),)),
    "instance of one triangle": vr.Instance(geometry="triangle"),
}


@pytest.mark.parametrize("name", SMOOTH)
def test_smooth_surfaces_do_not_warn_of_creases(name):
    """A capsule has three parts, but no crease between them. A polynomial of degree 2 may hide a part of itself."""
    triangle = vr.Mesh(vertices=[[-9, -9, 0], [9, -9, 0], [0, 9, 1]], faces=[[0, 1, 2]], normals="face")
    thing = replace(SMOOTH[name], material="paint")
    geometries = {"triangle": triangle} if isinstance(thing, vr.Instance) else {}
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        vr.gradient(replace(CLOSE, geometries=geometries, objects={"thing": thing}), ["camera.origin"])
    assert not any("crease" in str(w.message) or name != "polynomial" for w in found)


def test_highlights_end_where_a_surface_turns_away_from_the_light():
    """The light from behind is dimmed to nothing there, its highlight is not: n.h is not 0."""
    behind = replace(LAMP, position=(6.0, 0.0, -0.1))
    scene = replace(CLOSE, lights={"key": behind})
    with pytest.warns(vr.EdgeWarning, match=r"edges \(ends of highlights of lights.key\)"):
        vr.gradient(scene, ["lights.key.position"])
    vr.gradient(vr.replaced(scene, "materials.paint.ks", (0.0, 0.0, 0.0)), ["lights.key.position"])


def test_shadow_edges_warn():
    floor = vr.Plane(point=(0.0, -1.0, 0.0), material="paint")
    hidden = vr.Sphere(center=(0.8, 0.6, 1.7), radius=0.2)
    down = vr.Camera(origin=(0.0, 1.0, 3.0), target=(0.0, -1.0, -0.5), fov=30.0)
    scene = replace(CLOSE, camera=down, objects={"floor": floor, "hidden": hidden})
    with pytest.warns(vr.EdgeWarning, match=r"^the picture has moving edges \(shadow edges of lights.key\)"):
        vr.derivative(scene, "lights.key.position.0")


@pytest.mark.parametrize(
    ("address", "line"),
    [
        ("objects.bal.radius", '"ball"'),
        ("objects.ball.size", "radius"),
        ("settings.spp", "smoothly"),
        ("objects.ball.material", "has no derivative"),
    ],
)
def test_what_has_no_derivative_says_so(address, line):
    with pytest.raises(vr.UserError, match=line):
        vr.gradient(CLOSE, [address])


def test_a_difference_over_a_jump_is_told():
    """The square under a pixel's sample changes its colour: the jump, divided by the step, is no derivative."""
    checker = vr.CheckerTexture(a=(1.0, 1.0, 1.0), b=(0.0, 0.0, 0.0), scale=(64.0, 64.0))
    wall = vr.Rectangle(width=(4.0, 0.0, 0.0), height=(0.0, 4.0, 0.0), material="tiles")
    tiled = replace(
        CLOSE,
        film=vr.Film(width=64, height=64),
        textures={"squares": checker},
        materials={"tiles": vr.Material(texture="squares")},
        objects={"wall": wall},
    )
    with pytest.warns(vr.EdgeWarning, match=r"camera.fov: \d+ of 4096 pixels change by up to 0\..*take a larger step"):
        slope = vr.difference(tiled, "camera.fov", step=1e-5)
    # Without edges between pixels the picture changes by about 1 a degree.
    assert np.abs(slope).max() > 1000
    vr.difference(tiled, "camera.fov", step=0.01)
    vr.difference(CLOSE, "camera.fov")
