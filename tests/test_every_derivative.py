"""Derivatives by every number of every kind of object, light, camera and material and in every shading mode, against
differences: at the default value, at a random one, and at 0.

Default values are where derivatives go wrong in silence: an axis that is upright, a term that is 0 and left out, a
factor whose 0 means something else. Each view is of a small, smooth, lit patch, so that no edge moves in it.

Tolerance: as in test_gradients.py, relative to the largest derivative by the same record.
"""

import warnings
from collections.abc import Callable, Iterable
from dataclasses import MISSING, fields, replace
from typing import Any

import drjit as dr
import numpy as np
import pytest
import trimesh
from light_samples import AREA_NAMES, LIGHT_NAMES, light_sample
from samples import NAMES, SAMPLES, gap, truth, unit
from test_gradients import parts

import visray as vr
from visray import camera as cameras
from visray import modes
from visray.geometry import UPRIGHT, Frame, tangents
from visray.number_table import NumberTable
from visray.primitives.primitive import Primitive, scalars
from visray.quantities import Arrays, quantities
from visray.scene.address import numeric_addresses

TOLERANCE = 1e-7
FILM = vr.Film(width=4, height=3)
PAINT = vr.Material(ka=(0.2, 0.1, 0.1), kd=(0.5, 0.2, 0.3), ks=(0.4, 0.5, 0.6), shininess=7.3)
SKY = vr.SkyGradient(top=(0.1, 0.5, 1.0), bottom=(1.0, 0.75, 0.2))
WEIGHTS = np.random.default_rng(6).uniform(0.5, 1.5, (FILM.height, FILM.width, 3))
VALUES = pytest.mark.parametrize("values", ["default", pytest.param("random", marks=pytest.mark.slow)])


def slow_where(is_slow: Callable[[str], bool], names: Iterable[str]) -> list:
    """Parameters of a test, of which some are slow."""
    return [pytest.param(name, marks=pytest.mark.slow) if is_slow(name) else name for name in names]


@pytest.fixture(autouse=True)
def unwarned():
    """No edge moves in these views; that differences agree shows it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vr.EdgeWarning)
        yield


def scene_of(**changes: Any) -> vr.Scene:
    base = {"film": FILM, "background": SKY, "materials": {"paint": PAINT}, "settings": vr.Settings(spp=1, depth=2)}
    base |= {"camera": vr.Camera(), "lights": {}}
    return vr.Scene(**(base | changes))


def weighted(picture: Any) -> Any:
    """A loss to which all pixels and channels add, each with another weight."""
    return dr.mean(dr.mean(picture * type(picture)(WEIGHTS.reshape(-1, 3).T), axis=1), axis=0)


def moved(record: Any, rng: np.random.Generator) -> Any:
    """The record with each of its numbers a little larger or smaller, by a random amount; those that must not be
    negative, a little larger."""
    changes = {}
    for name, quantity in quantities(type(record)).items():
        value = np.array(getattr(record, name), float)
        low = -np.clip(9 * value, 0, 1) if quantity.precision == "shading" else -1
        new = value + 0.1 * rng.uniform(low, 1, value.shape)
        changes[name] = float(new) if new.ndim == 0 else tuple(new.tolist())
    if isinstance(record, vr.Polynomial):
        changes["parameters"] = {k: v + 0.1 * rng.uniform(0, 1) for k, v in record.parameters.items()}
    if isinstance(record, vr.Csg):
        changes["of"] = tuple(moved(x, rng) for x in record.of)
    if isinstance(getattr(record, "vertices", None), NumberTable):
        changes["vertices"] = record.vertices.values + 0.1 * rng.uniform(-1, 1, record.vertices.values.shape)
    return replace(record, **changes)


def default_of(kind: type, posed: Any) -> Any:
    """The record of this kind whose numbers have their default values; those without one, that of `posed`."""
    required = {f.name for f in fields(kind) if f.default is MISSING and f.default_factory is MISSING}
    record = kind(**{name: getattr(posed, name) for name in required})
    return posed if getattr(record, "flaws", list)() else record


def view_of(thing: Any) -> tuple[vr.Camera, vr.PointLight]:
    """A camera that sees a small patch of an object, far from its edges, and a light that shines on it."""
    rng = np.random.default_rng(7)
    middle, reach = SAMPLES[type(thing).__name__].hull(replace(thing, transform=()))
    reach = max(reach, 0.5)
    for _ in range(200):
        o = middle + 3 * reach * unit(rng.normal(size=3)).astype(float)
        target = middle + 0.5 * reach * rng.uniform(-1, 1, 3)
        d = unit(target - o + 0.03 * reach * np.array([[0, 0, 0], *rng.normal(size=(6, 3))])).astype(float)
        hit = truth(thing, np.tile(o, (7, 1)), d)
        if not (hit.what > 0).all():
            continue
        p = o + np.array(hit.t, float)[:, None] * d
        _, n, _, crease = gap(thing, p)
        cosine = -(n * d).sum(1)
        if (np.abs(cosine) > 0.3).all() and (n @ n[0] > 0.9).all() and (crease > 0.05 * reach).all():
            light = vr.PointLight(position=tuple(o + 0.5 * reach * rng.normal(size=3)))
            return vr.Camera(origin=tuple(o), target=tuple(p[0]), fov=1.0), light
    raise AssertionError(f"no view of {thing}")


def addresses_below(scene: vr.Scene, prefix: str) -> list[str]:
    """All addresses below a prefix on which a picture depends smoothly: not those of a transform or a clip."""
    found = [
        a for a in numeric_addresses(scene) if a.startswith(prefix) and not {"transform", "clip"} & set(a.split("."))
    ]
    record = vr.value(scene, prefix.rstrip("."))
    if isinstance(record, vr.Polynomial):
        found += [f"{prefix}parameters.{name}" for name in record.parameters]
    if isinstance(record, vr.Mesh):
        found.append(f"{prefix}vertices")
    assert found
    return found


def slopes(scene: vr.Scene, addresses: list[str]) -> dict[str, float]:
    """The derivative of `weighted` by each single number, by vr.gradient; the sum of those by a table."""
    found = vr.gradient(scene, addresses, weighted)
    return {
        part: float(x)
        for a in addresses
        for part, x in zip(_parts(scene, a), [found[a].sum()] if _is_table(scene, a) else np.ravel(found[a]))
    }


def _is_table(scene: vr.Scene, address: str) -> bool:
    return isinstance(vr.value(scene, address), NumberTable)


def _parts(scene: vr.Scene, address: str) -> list[str]:
    return [address] if _is_table(scene, address) else parts(scene, address)


def differences(scene: vr.Scene, part: str) -> float:
    return float((vr.difference(scene, part) * WEIGHTS).mean())


def check(scene: vr.Scene, addresses: list[str], forward: bool = False) -> None:
    """Compares the derivatives by all numbers with differences."""
    found = slopes(scene, addresses)
    expected = {part: differences(scene, part) for part in found}
    bound = TOLERANCE * max(1.0, *map(abs, expected.values()))
    wrong = {part: (found[part], x) for part, x in expected.items() if not abs(found[part] - x) <= bound}
    assert not wrong
    for part in found if forward else ():
        assert abs((vr.derivative(scene, part) * WEIGHTS).mean() - expected[part]) <= bound, part


def refused(scene: vr.Scene, address: str, line: str) -> None:
    with pytest.raises(vr.UserError, match=f"^{address}.*: has no derivative {line}"):
        vr.gradient(scene, [address])


# Objects


def object_of(name: str, values: str) -> Any:
    sample = SAMPLES[name]
    thing = default_of(sample.kind, sample.posed)
    if values == "random":
        step = vr.Rotate(rotate=25.0, axis=(1.0, 2.0, 0.5)), vr.Scale(scale=(1.1, 0.9, 1.2))
        thing = replace(moved(sample.posed, np.random.default_rng(8)), transform=step)
    return replace(thing, material="paint")


@VALUES
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if SAMPLES[n].posed.kind.finds_roots else n for n in NAMES]
)
def test_by_every_number_of_every_kind_of_object(name: str, values: str) -> None:
    thing = object_of(name, values)
    camera, light = view_of(thing)
    scene = scene_of(camera=camera, lights={"key": light}, objects={"thing": thing})
    check(scene, addresses_below(scene, "objects.thing."), forward=values == "random")


# Lights


def light_scene(light: Any) -> vr.Scene:
    floor = vr.Plane(normal=(0.2, 1.0, 0.1), material="paint")
    camera = vr.Camera(origin=(0.5, 2.0, 1.5), target=(0.1, 0.0, 0.1), fov=2.0)
    return scene_of(camera=camera, lights={"key": light}, objects={"floor": floor})


def light_of(name: str, values: str) -> Any:
    sample = light_sample(name)
    light = default_of(sample.kind, sample.posed)
    if values == "random":
        light = moved(sample.posed, np.random.default_rng(9))
        if not light.has_position:
            light = replace(light, b=0.0, c=0.0)
    return replace(light, samples=4) if light.has_area else light


def no_attenuation(light: Any) -> set[str]:
    """Fields by which there is no derivative: see test_no_attenuation_is_no_limit_of_attenuations."""
    bad = {"a", "b", "c"} if not (light.a or light.b or light.c) else set()
    return bad if light.has_position else bad | {"b", "c"}


@VALUES
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n in AREA_NAMES else n for n in LIGHT_NAMES]
)
def test_by_every_number_of_every_kind_of_light(name: str, values: str) -> None:
    light = light_of(name, values)
    scene = light_scene(light)
    left_out = no_attenuation(light) | ({"normal"} if is_upright(light) else set())
    addresses = [a for a in addresses_below(scene, "lights.key.") if a.split(".")[2] not in left_out]
    check(scene, addresses, forward=False)
    for field in no_attenuation(light):
        refused(scene, f"lights.key.{field}", "")


def is_upright(light: Any) -> bool:
    """Whether all sample points of a light turn about its axis at once when the axis tilts: a difference is then that
    of two sets of points. See test_by_the_normal_of_an_upright_disk_light."""
    normal = getattr(light, "normal", None)
    return normal is not None and normal[0] == normal[2] == 0


def test_by_the_normal_of_an_upright_disk_light() -> None:
    """Light at a point from the points of a disk, by the derivative of these points. A grid in the unit square is a set
    of points of the disk that stays the same in quarter turns, so differences are exact."""
    a = Arrays.of("llvm", "double")
    u, v = (a.D(x.ravel()) for x in np.meshgrid(*[(np.arange(16) + 0.5) / 16] * 2))
    p, centre = a.W(0.4, 0.3, -0.7), a.W(0.0, 2.0, 0.0)

    def light(normal: Any) -> Any:
        disk = replace(vr.DiskLight(position=(0.0, 0.0, 0.0)), normal=normal, radius=a.D(1.0))
        away = centre + disk.point_offset(a.W, u, v) - p
        return dr.mean(away.z / dr.squared_norm(away))

    for sign in (1.0, -1.0):
        for k in (0, 2):
            normal = a.W(0.0, sign, 0.0)
            dr.enable_grad(normal)
            dr.backward(light(normal))
            step = [1e-5 * (i == k) for i in range(3)]
            ahead, behind = (float(light(a.W(0.0, sign, 0.0) + s * a.W(*step))[0]) for s in (1, -1))
            expected = (ahead - behind) / 2e-5
            assert abs(expected) > 1e-3
            assert abs(float(dr.grad(normal)[k][0]) - expected) < 1e-8


def test_no_attenuation_is_no_limit_of_attenuations() -> None:
    """a = b = c = 0 means a factor of 1; with a = 1e-3 it is 1000. Of a directional light, b and c must be 0."""
    scene = light_scene(vr.PointLight(position=(1.0, 3.0, 2.0)))
    for field in "abc":
        refused(scene, f"lights.key.{field}", "at a = b = c = 0, which means no attenuation")
        assert abs(differences(scene, f"lights.key.{field}")) > 1e3
    check(vr.replaced(scene, "lights.key.a", 1.0), [f"lights.key.{x}" for x in "abc"])


@pytest.mark.parametrize("precision", ["single", "double"])
def test_by_a_normal_that_is_nearly_upright(precision: str) -> None:
    """As for one that is quite upright: what u and v turn by does not matter, and its rounding must not."""
    a = Arrays.of("llvm", precision)
    away = a.V(0.3, -0.4, 0.7)
    for slope in (0.0, 1e-300, 1e-30, 6e-17, 1e-9, 1e-5, 1e-3):
        n = a.V(slope, 1.0, 0.0)
        dr.enable_grad(n)
        s, t = tangents(dr.normalize(n))
        dr.backward(dr.dot(dr.cross(s, t), away))
        # The derivative of n / |n| by n, times `away`.
        unit_n = np.array([slope, 1.0, 0.0]) / np.hypot(slope, 1.0)
        expected = (np.array(away)[:, 0] - unit_n * (unit_n @ np.array(away)[:, 0])) / np.hypot(slope, 1.0)
        bound = 4 * UPRIGHT[precision]
        assert np.abs(np.array(dr.grad(n))[:, 0] - expected).max() <= bound, slope


# Cameras


def camera_of(kind: type, values: str) -> Any:
    if values == "default":
        return kind()
    lens = {"aperture": 0.2, "focus": 5.0} if "focus" in kind.__dataclass_fields__ else {}
    return moved(kind(**lens), np.random.default_rng(10))


def camera_scene(camera: Any, **changes: Any) -> vr.Scene:
    wall = vr.Plane(point=(0.0, 0.0, -1.0), normal=(0.1, 0.2, 1.0), material="paint")
    lamp = vr.PointLight(position=(2.0, 3.0, 5.0))
    return scene_of(camera=camera, lights={"key": lamp}, objects={"wall": wall}, **changes)


@VALUES
@pytest.mark.parametrize("kind", cameras.KINDS, ids=lambda kind: kind.type)
def test_by_every_number_of_every_camera(kind: type, values: str) -> None:
    scene = camera_scene(camera_of(kind, values))
    addresses = addresses_below(scene, "camera.")
    if values == "default" and "camera.focus" in addresses:
        addresses.remove("camera.focus")
    check(scene, addresses)


def test_focus_0_is_no_limit_of_distances() -> None:
    """It means the distance of the target."""
    scene = camera_scene(vr.Camera(aperture=0.1))
    refused(scene, "camera.focus", "at 0, which means the distance of the target")
    assert vr.gradient(camera_scene(vr.Camera()), ["camera.focus"]) == {"camera.focus": 0}


@pytest.mark.parametrize("mode", modes.NAMES)
def test_by_the_camera_in_every_mode(mode: str) -> None:
    """In forward mode too: that of `depth` once ended in an error of Dr.Jit."""
    ball = vr.Ellipsoid(radii=(1.5, 1.2, 1.4), material="paint")
    camera = vr.Camera(origin=(1.0, 1.0, 4.0), target=(0.1, 0.2, 0.0), fov=2.0)
    lamp = vr.PointLight(position=(2.0, 3.0, 5.0))
    scene = scene_of(camera=camera, lights={"key": lamp}, objects={"ball": ball})
    scene = replace(scene, settings=replace(scene.settings, shading=mode))
    check(scene, [a for a in addresses_below(scene, "camera.") if a != "camera.focus"])
    for part in ("camera.origin.2", "camera.target.0", "camera.up.0", "camera.fov"):
        assert abs((vr.derivative(scene, part) * WEIGHTS).mean() - differences(scene, part)) <= TOLERANCE, part


# Materials


def material_scene(material: vr.Material, **settings: Any) -> vr.Scene:
    """A patch of a ball, with the sky in it and behind it, and a patch of the floor in the shadow of a ball."""
    camera = vr.Camera(origin=(0.6, 1.0, 4.0), target=(0.1, 0.1, 0.0), fov=3.0)
    lamp = vr.PointLight(position=(2.0, 3.0, 5.0), Ia=(0.1, 0.2, 0.3))
    ball = vr.Sphere(material="paint")
    return scene_of(
        camera=camera, lights={"key": lamp}, objects={"ball": ball}, materials={"paint": material}, **settings
    )


def in_its_shadow(material: vr.Material) -> vr.Scene:
    scene = material_scene(material)
    floor = vr.Plane(point=(0.0, -1.5, 0.0), material="floor")
    camera = vr.Camera(origin=(-3.0, 1.0, 0.0), target=(-0.8, -1.5, -2.4), fov=1.0)
    lamp = vr.PointLight(position=(0.8, 1.8, 2.4))
    objects, materials = scene.objects | {"floor": floor}, scene.materials | {"floor": PAINT}
    return replace(scene, camera=camera, lights={"key": lamp}, objects=objects, materials=materials)


@VALUES
@pytest.mark.parametrize("bounce", ["kr", "kt"])
@pytest.mark.slow
def test_by_every_number_of_a_material(bounce: str, values: str) -> None:
    """By kr without kt, and by kt without kr: between both, paths choose at random, and a difference would be that of
    other paths."""
    material, rng = vr.Material(), np.random.default_rng(11)
    if values == "random":
        # dmax is moved from a value that is not the largest one.
        paint = moved(replace(PAINT, dmax=5.0), rng)
        material = replace(paint, **{"kr": (0.0,) * 3, "kt": (0.0,) * 3, bounce: (0.4, 0.2, 0.5)}, dmax=5.0)
    other = {"kr": "kt", "kt": "kr"}[bounce]
    for scene in material_scene(material), in_its_shadow(material):
        check(scene, [a for a in addresses_below(scene, "materials.paint.") if not a.endswith(other)])


def zeros() -> list[str]:
    """The numbers of lights and materials, and of the scene, that may be 0."""
    scene = material_scene(PAINT)
    heads = ("materials.paint.", "lights.key.", "ambient", "background.")
    names = [a for a, q in numeric_addresses(scene).items() if a.startswith(heads) and q.precision == "shading"]
    return [a for a in names if not a.startswith("lights.key.") or a.split(".")[2] not in "abc"]


@pytest.mark.parametrize("address", zeros())
@pytest.mark.slow
def test_at_0(address: str) -> None:
    """What is 0 is left out of kernels, but it may have a derivative."""
    bounces = {"kt": {}, "absorption": {"kt": (0.2, 0.3, 0.1)}}.get(address.split(".")[-1], {"kr": (0.2, 0.3, 0.1)})
    scene = material_scene(replace(PAINT, **bounces))
    zero = np.zeros(np.shape(vr.value(scene, address))).tolist()
    scene = vr.replaced(scene, address, tuple(zero) if isinstance(zero, list) else zero)
    assert np.abs(list(slopes(scene, [address]).values())).max() > 1e-3
    check(scene, [address])


@pytest.mark.parametrize("address", ["materials.paint.kr", "materials.paint.kt"])
def test_a_matte_material_that_scatters_has_no_derivative_by_its_share(address: str) -> None:
    """Without kr and kt it scatters; with the least of them, it does not."""
    scene = material_scene(PAINT, settings=vr.Settings(spp=1, scatter=vr.Scatter(rays=1)))
    refused(scene, address, "at 0 while settings.scatter has rays")
    refused(scene, f"{address}.1", "at 0 while settings.scatter has rays")


@pytest.mark.slow
def test_by_kt_of_an_opaque_mesh() -> None:
    """It becomes a body as soon as it is transparent. As single triangles, these were too many for coloured shadows."""
    shape = trimesh.creation.icosphere(subdivisions=1)
    scene = material_scene(vr.Material())
    mesh = vr.Mesh(vertices=shape.vertices, faces=shape.faces, normals="face", material="paint")
    camera = replace(scene.camera, target=(0.11, 0.12, 0.0), fov=0.1)
    check(replace(scene, camera=camera, objects={"ball": mesh}), ["materials.paint.kt", "materials.paint.ior"])


# Structure that a value decides

SADDLES = {
    # A name, a polynomial near y = 0, and the values of its parameters.
    "a term": ("y - a*x^2", {"a": 0.0}),
    "a term of a higher degree": ("y - a*x^3 + b*z", {"a": 0.0, "b": 0.1}),
    "a term that cancels": ("x^2 - a*x^2 + y", {"a": 1.0}),
    "the leading terms": ("(x^2 + y^2 + z^2 - 1)*(1 - a) + a*y", {"a": 1.0}),
    "a factor": ("y*(1 + a*x)", {"a": 0.0}),
    "a square": ("(y - a*x)^2", {"a": 0.0}),
    "one factor of several": ("(y - a*x)*(y + 3)^2", {"a": 0.0}),
    "a factor into which it splits": ("(y + 0.01)*(z + 4) - a", {"a": 0.0}),
    "a reciprocal": ("y/(1 + a) - a*x*z", {"a": 0.0}),
    "a root": ("y - sqrt(a)*x", {"a": 0.25}),
    "powers": ("y - a^(2/2)*x - a^(4/2)*z", {"a": 0.0}),
    "functions": ("y - log(1 + a)*x - sin(a)*z - (1 - a)^(1/3)*x*a", {"a": 0.0}),
}
NO_SLOPE = {
    "a root of 0": ("y - sqrt(a)*x", {"a": 0.0}, "a = 0: a square root is 0 there"),
    "a root of a square": ("y - sqrt(a^2)*x", {"a": 0.0}, "a = 0: a square root is 0 there"),
    "a root of any degree": ("y - a^(1/3)*x", {"a": 0.0}, "a = 0: a square root is 0 there"),
    "sheets that part": ("y^2 - a", {"a": 0.0}, "a = 0: several sheets"),
    "sheets that cross": ("y^2 - a^2*x^2", {"a": 0.0}, "a = 0: several sheets"),
    "a sheet on another": ("y^2*(y - a*x)", {"a": 0.0}, "a = 0: several sheets"),
    "sheets by two values": ("(y - a*x)*(y - b*x)", {"a": 0.5, "b": 0.5}, "a = 0.5, b = 0.5: several sheets"),
}


def saddle(expression: str, parameters: dict[str, float]) -> vr.Scene:
    camera = vr.Camera(origin=(0.4, 1.5, 2.0), target=(0.3, 0.0, 0.2), fov=3.0)
    lamp = vr.PointLight(position=(1.0, 3.0, 2.0))
    thing = vr.Polynomial(expression=expression, parameters=parameters, material="paint")
    return scene_of(camera=camera, lights={"key": lamp}, objects={"k": thing})


@pytest.mark.parametrize("name", slow_where(lambda n: n != "a term", SADDLES))
def test_by_parameters_whose_value_leaves_something_out(name: str) -> None:
    scene = saddle(*SADDLES[name])
    check(scene, addresses_below(scene, "objects.k."))


@pytest.mark.parametrize("name", NO_SLOPE)
def test_by_parameters_where_a_surface_has_no_derivative(name: str) -> None:
    expression, parameters, line = NO_SLOPE[name]
    refused_all(saddle(expression, parameters), [f"objects.k.parameters.{p}" for p in parameters], f"at {line}")


def refused_all(scene: vr.Scene, addresses: list[str], line: str) -> None:
    with pytest.raises(vr.UserError, match=f"^{addresses[0]}: has no derivative {line}"):
        vr.gradient(scene, addresses)


def test_by_the_parameter_of_a_geometry() -> None:
    alone = saddle("y - a*x^2", {"a": 0.0})
    shape = replace(alone.objects["k"], material="default")
    objects = {"k": vr.Instance(geometry="shape", material="paint")}
    found = vr.gradient(replace(alone, geometries={"shape": shape}, objects=objects), "geometries.shape.parameters.a")
    expected = vr.gradient(alone, "objects.k.parameters.a")
    assert found["geometries.shape.parameters.a"] == pytest.approx(expected["objects.k.parameters.a"], abs=1e-12)


AXES = [(name, field) for name in NAMES for field in SAMPLES[name].kind.axis_fields]


@pytest.mark.parametrize(("name", "field"), AXES)
def test_textures_about_an_upright_axis_have_no_derivative(name: str, field: str) -> None:
    """Its u and v jump there. A tilted axis has one, and so have other fields."""
    thing = SAMPLES[name].kind(material="paint")
    camera, light = view_of(thing)
    scene = scene_of(camera=camera, lights={"key": light}, objects={"thing": thing})
    shown = replace(scene, settings=replace(scene.settings, shading="uv"))
    textured = replace(scene, textures={"t": vr.CheckerTexture()}, materials={"paint": replace(PAINT, texture="t")})
    for one in shown, textured:
        refused(one, f"objects.thing.{field}", "where the axis is upright")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.slow
def test_texture_coordinates(name: str) -> None:
    thing = object_of(name, "random")
    camera, light = view_of(thing)
    scene = scene_of(camera=camera, lights={"key": light}, objects={"thing": thing})
    scene = replace(scene, settings=replace(scene.settings, shading="uv"))
    check(scene, addresses_below(scene, "objects.thing."))


def test_kinds_whose_frame_is_about_an_axis_say_by_which_fields() -> None:
    """The x axis of a frame turns by 90 degrees as an upright axis tilts a little: exactly the fields that do so are
    named by the kind."""
    for name in NAMES:
        kind = SAMPLES[name].kind
        thing = default_of(kind, SAMPLES[name].posed)
        turning = set()
        for field, quantity in quantities(kind).items():
            if quantity.size == 3 and kind.frame is not Primitive.frame and isinstance(scalars(thing).frame(), Frame):
                value = np.array(getattr(thing, field), float) + (-1e-9, 0, 0)
                tilted = replace(thing, **{field: tuple(value.tolist())})
                before, after = (np.array(scalars(x).frame().x, float) for x in (thing, tilted))
                if np.abs(unit(before) - unit(after)).max() > 0.5:
                    turning.add(field)
        assert turning == set(kind.axis_fields), name
