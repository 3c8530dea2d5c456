"""Pictures as functions of numbers of their scenes: values and derivatives are those of vr.render and vr.gradient,
whatever library the numbers come from."""

import warnings

import drjit as dr
import numpy as np
import pytest

import visray as vr
from visray.quantities import Arrays

A = Arrays.of("llvm", "double")
# Rounding of sums in single, whose terms are about 1.
SINGLE = 1e-5
SCENE = vr.Scene(
    camera=vr.Camera(origin=(0.0, 0.3, 4.0), fov=8.0),
    film=vr.Film(width=8, height=6),
    ambient=(0.2, 0.3, 0.4),
    materials={"paint": vr.Material(ka=(0.3, 0.2, 0.1), kd=(0.5, 0.2, 0.3), ks=(0.4, 0.5, 0.6), shininess=17.3)},
    objects={"ball": vr.Sphere(radius=1.1, material="paint")},
    lights={"key": vr.PointLight(position=(2.0, 3.0, 5.0), intensity=1.2)},
    settings=vr.Settings(spp=4),
)
ADDRESSES = ["materials.paint.kd", "lights.key.intensity", "objects.ball.radius"]
GLASS = vr.Scene(
    camera=vr.Camera(origin=(0.0, 0.0, 6.0), fov=8.0),
    film=vr.Film(width=6, height=4),
    background=vr.SkyGradient(top=(1.0, 0.2, 0.1), bottom=(0.1, 0.3, 1.0)),
    materials={"glass": vr.Material(ka=(0.0,) * 3, kd=(0.0,) * 3, kt=(0.9,) * 3, kr=(0.1,) * 3, ior=1.4)},
    objects={"ball": vr.Sphere(radius=1.2, material="glass")},
    lights={},
    settings=vr.Settings(spp=2),
)
MESH = vr.Mesh(vertices=[(-2.0, -2.0, 0.0), (2.0, -2.0, 0.3), (0.0, 3.0, 0.1)], faces=[(0, 1, 2)], material="paint")
OPEN = vr.replaced(SCENE, "objects", {"sheet": MESH})
# Scenes with the addresses of the values: one launch, waves of paths, and a table.
CASES = {
    "ball": (SCENE, ADDRESSES),
    "glass": (GLASS, ["materials.glass.ior", "materials.glass.kt"]),
    "mesh": (OPEN, ["objects.sheet.vertices", "lights.key.position"]),
}


@pytest.fixture(autouse=True)
def no_edges():
    """No view here has an edge: a warning of edges is a failure."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", vr.EdgeWarning)
        yield


def weights(function):
    """Weights of the picture's numbers in a loss."""
    return np.sin(np.arange(np.prod(function.shape))).reshape(function.shape)


def expected(function):
    """Derivatives of the weighted sum of the picture, by vr.gradient."""
    w = A.put(A.V, weights(function).reshape(-1, 3).T)
    slopes = vr.gradient(function.scene, function.addresses, lambda rgb: dr.sum(dr.dot(rgb, w)), progress=False)
    return [np.array(slopes[address]) for address in function.addresses]


def tensor(kind, x):
    return dr.tensor_t(kind)(kind(np.ravel(x)), shape=x.shape)


@pytest.mark.parametrize("case", CASES)
def test_the_picture_is_that_of_render(case):
    function = vr.render_function(*CASES[case], progress=False)
    truth = vr.render(function.scene, precision="double", progress=False)["RGB"]
    # A layer is in single, and waves sum their samples in another order.
    assert np.abs(function(*function.start) - truth).max() <= 2 * np.finfo(np.float32).eps * max(1, truth.max())


@pytest.mark.parametrize("case", CASES)
def test_reverse_mode_of_dr_jit_is_vr_gradient(case):
    function = vr.render_function(*CASES[case], progress=False)
    values = [tensor(A.D, x) for x in function.start]
    dr.enable_grad(*values)
    picture = function(*values)
    assert type(picture) is dr.tensor_t(A.D) and picture.shape == function.shape
    dr.backward(dr.sum(picture * tensor(A.D, weights(function))))
    for found, truth in zip(values, expected(function)):
        slope = np.array(dr.grad(found)).reshape(truth.shape)
        assert np.abs(slope - truth).max() <= 1e-12 * max(1, np.abs(truth).max())


@pytest.mark.parametrize("case", CASES)
def test_forward_mode_of_dr_jit_is_reverse_mode(case):
    """<w, J v> = <J^T w, v>, for directions v of all values together."""
    function = vr.render_function(*CASES[case], progress=False)
    values = [tensor(A.D, x) for x in function.start]
    directions = [np.cos(np.arange(x.size)).reshape(x.shape) for x in function.start]
    for value, direction in zip(values, directions):
        dr.enable_grad(value)
        dr.set_grad(value, tensor(A.D, direction))
    tangent = np.array(dr.forward_to(function(*values)), float).reshape(function.shape)
    truth = sum((x * y).sum() for x, y in zip(expected(function), directions))
    assert abs((tangent * weights(function)).sum() - truth) <= 1e-11 * max(1, abs(truth))


def test_values_of_dr_jit_may_be_numbers_and_triples():
    function = vr.render_function(SCENE, ADDRESSES, progress=False)
    values = A.V32(*map(float, function.start[0])), A.F32(1.2), 1.1
    dr.enable_grad(*values[:2])
    picture = function(*values)
    assert type(picture) is dr.tensor_t(A.F32)
    dr.backward(dr.sum(picture * tensor(A.F32, weights(function))))
    truth = expected(function)
    assert np.abs(np.array(dr.grad(values[0])).ravel() - truth[0]).max() <= SINGLE
    assert abs(dr.grad(values[1])[0] - truth[1]) <= SINGLE


def test_a_seed_gives_other_samples_and_the_same_seed_the_same_bits():
    function = vr.render_function(GLASS, "materials.glass.ior", progress=False)
    pictures = [function(1.4, seed=seed) for seed in (1, 2, 1)]
    assert (pictures[0] == pictures[2]).all() and (pictures[0] != pictures[1]).any()


@pytest.mark.parametrize("case", CASES)
def test_the_second_call_compiles_nothing(case):
    function = vr.render_function(*CASES[case], progress=False)

    def step(scale):
        values = [tensor(A.D, scale * x) for x in function.start]
        dr.enable_grad(*values)
        dr.backward(dr.sum(function(*values)))

    step(1.0)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        step(0.99)
        entries = dr.kernel_history((dr.KernelType.JIT,))
    assert entries and all(entry["cache_hit"] and not entry["cache_disk"] for entry in entries)


@pytest.mark.parametrize("case", CASES)
def test_torch(case):
    torch = pytest.importorskip("torch")
    function = vr.render_function(*CASES[case], progress=False)
    truth = expected(function)
    for kind, bound in ((torch.float32, SINGLE), (torch.float64, 1e-12)):
        values = [torch.tensor(x, dtype=kind, requires_grad=True) for x in function.start]
        picture = function(*values)
        assert picture.dtype == kind and tuple(picture.shape) == function.shape
        loss = (picture * torch.tensor(weights(function), dtype=kind)).sum()
        loss.backward(retain_graph=True)
        loss.backward()  # the sum of both
        for value, slope in zip(values, truth):
            assert np.abs(value.grad.numpy() / 2 - slope).max() <= bound * max(1, np.abs(slope).max()) * slope.size


@pytest.mark.parametrize("library", ["torch", "jax"])
def test_one_picture_has_several_derivatives(library):
    """Those of single pixels, asked for one after the other."""
    module = pytest.importorskip(library)
    function = vr.render_function(SCENE, ["materials.paint.kd"], progress=False)
    truth = [vr.derivative(function.scene, f"materials.paint.kd.{i}", progress=False) for i in range(3)]
    pixels = [(1, 2, 0), (3, 4, 1), (5, 6, 2), (0, 7, 0)]
    if library == "torch":
        kd = module.tensor(function.start[0], dtype=module.float64, requires_grad=True)
        picture = function(kd)
        rows = [module.autograd.grad(picture[at], kd, retain_graph=True)[0].numpy() for at in pixels]
    else:
        picture, pull = module.vjp(function, module.numpy.array(function.start[0]))
        rows = [pull(module.numpy.zeros(picture.shape).at[at].set(1.0))[0] for at in pixels]
    for row, at in zip(rows, pixels):
        assert np.abs(np.asarray(row) - [t[at] for t in truth]).max() <= SINGLE


@pytest.mark.parametrize("case", CASES)
def test_jax(case):
    jax = pytest.importorskip("jax")
    function = vr.render_function(*CASES[case], progress=False)
    w, truth = weights(function), expected(function)
    loss = lambda *values: (function(*values) * w).sum()  # noqa: E731 - short is clear here
    values = [jax.numpy.array(x) for x in function.start]
    slope = jax.grad(loss, tuple(range(len(values))))
    for found in (slope(*values), jax.jit(slope)(*values)):
        for x, y in zip(found, truth):
            assert x.dtype == "float32" and np.abs(np.asarray(x) - y).max() <= SINGLE * max(1, np.abs(y).max()) * y.size
    pictures = jax.vmap(function)(*(jax.numpy.stack([x, 0.9 * x]) for x in values))
    assert np.abs(np.asarray(pictures[0]) - function(*function.start)).max() <= SINGLE


class Elsewhere:
    """A tensor of a module that has the name of a library."""

    __module__ = "torch.elsewhere"


def test_wrong_values():
    function = vr.render_function(SCENE, ADDRESSES[:2], progress=False)
    for values, message in (
        ((), "values: there are 0; give one for each of materials.paint.kd, lights.key.intensity"),
        (((1.0, 2.0), 1.0), r"materials.paint.kd: the value has the shape \(2,\); it must be \(3,\)"),
        (((0.1, 0.2, 0.3), (1.0,)), r"lights.key.intensity: the value has the shape \(1,\); it must be \(\) for a si"),
        ((A.V(1, 2, 3), A.V(1, 2, 3)), r"lights.key.intensity: the value has the shape \(3, 1\); it must be \(\)"),
        (("red", 1.0), "materials.paint.kd = 'red': must be numbers"),
        (((-1.0, 0.0, 0.0), 1.0), "materials.paint.kd.0 = -1.0: must be at least 0"),
        (((0.5, np.nan, 0.0), 1.0), "materials.paint.kd.1 = NaN: must be finite"),
        ((A.V(1, 2, 3), Elsewhere()), "values: are arrays of several libraries"),
    ):
        with pytest.raises(vr.UserError, match=message):
            function(*values)


@pytest.mark.parametrize("library", ["torch", "jax"])
def test_wrong_arrays_of_libraries(library):
    module = pytest.importorskip(library)
    function = vr.render_function(SCENE, ADDRESSES[:2], progress=False)
    ones = module.ones if library == "torch" else module.numpy.ones
    array = module.tensor if library == "torch" else module.numpy.array
    for values, message in (
        ((ones(4), 1.0), r"materials.paint.kd: the value has the shape \(4,\); it must be \(3,\)"),
        ((array([-1.0, 0.0, 0.0]), 1.0), "materials.paint.kd.0 = -1.0: must be at least 0"),
        ((array([1.0, 0.0, 1j]), 1.0), "materials.paint.kd: the (tensor|array) has complex numbers"),
    ):
        with pytest.raises(vr.UserError, match=message):
            function(*values)
    if library == "torch":
        with pytest.raises(vr.UserError, match=r"kd: the tensor is on the device meta.*give value.cpu\(\)"):
            function(ones(3, device="meta"), 1.0)


def test_wrong_addresses():
    for addresses, message in (
        ([], "addresses: there is none"),
        (["ambient", "ambient"], "addresses: ambient is there twice"),
        (["ambient.0", "lights.key.position", "ambient"], "addresses: ambient overlaps ambient.0; name each number"),
        ("materials.paint", "materials.paint: is not one number or three"),
        ("settings.shadows", "settings.shadows: is not one number or three"),
        ("settings.spp", "settings.spp: the picture does not depend on it smoothly"),
        ("materials.clay.kd", "materials has no 'clay'"),
    ):
        with pytest.raises(vr.UserError, match=message):
            vr.render_function(SCENE, addresses)


def test_complex_numbers_are_refused():
    function = vr.render_function(SCENE, ["ambient"])
    with pytest.raises(vr.UserError, match=r"^ambient = .*: must be numbers$"):
        function(np.ones(3, complex))


def test_the_function_says_what_it_takes():
    function = vr.render_function(SCENE, ADDRESSES)
    assert repr(function) == f"PictureFunction({', '.join(ADDRESSES)}) -> picture of 8 x 6 pixels"
