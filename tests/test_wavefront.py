"""Derivatives along paths in waves: what they compile, that they do not depend on how paths are cut into launches, and
that Ctrl-C ends them. That they are right is tested in test_effect_gradients.py."""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np
import pytest
from drjit.llvm.ad import Array3f64, Float64, UInt32

import visray as vr
from visray import attached_picture, wavefront
from visray.geometry import gamma
from visray.jacobian import AttachedArrays, Launches
from visray.progress import Interrupts

GLASS = vr.Material(ka=(0.1, 0.2, 0.1), kd=(0.1, 0.1, 0.1), kr=(0.1, 0.1, 0.1), kt=(0.8, 0.7, 0.8), ior=1.4)
ROOM = vr.Scene(
    camera=vr.Camera(origin=(0.0, 1.0, 6.0), target=(0.0, 0.5, 0.0), fov=30.0),
    film=vr.Film(width=12, height=8),
    background=vr.SkyGradient(top=(0.1, 0.5, 1.0), bottom=(1.0, 0.75, 0.2)),
    materials={"floor": vr.Material(kr=(0.3, 0.3, 0.3)), "glass": GLASS},
    lights={"lamp": vr.SphereLight(position=(2.0, 4.0, 3.0), radius=0.5, samples=2)},
    objects={
        "floor": vr.Plane(material="floor"),
        "ball": vr.Sphere(center=(-0.8, 0.7, 0.0), radius=0.7, material="glass"),
        "bead": vr.Sphere(center=(0.9, 0.5, 0.5), radius=0.5, material="glass"),
    },
    settings=vr.Settings(spp=2, depth=3),
)
ADDRESS = "objects.ball.center"


@pytest.fixture(autouse=True)
def unwarned() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vr.EdgeWarning)
        yield


def with_samples(depth: int, samples: int) -> vr.Scene:
    """The room with other numbers of bounces and of light samples."""
    lamp = replace(ROOM.lights["lamp"], samples=samples)
    return replace(ROOM, lights={"lamp": lamp}, settings=replace(ROOM.settings, depth=depth))


def kernels(scene: vr.Scene) -> list[dict[str, Any]]:
    """The kernels that a derivative and a gradient launch."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        vr.derivative(scene, ADDRESS, progress=False)
        vr.gradient(scene, [ADDRESS], progress=False)
        return dr.kernel_history([dr.KernelType.JIT])


@pytest.mark.slow
def test_kernels_do_not_grow_with_depth_and_samples_and_a_second_gradient_compiles_none() -> None:
    few = kernels(with_samples(2, 1))
    many = kernels(with_samples(7, 16))
    # Each surface is a launch of the same kernels.
    assert {k["hash"] for k in many} == {k["hash"] for k in few}
    assert len(few) < len(many) < len(few) * 8 / 3
    # Paths of other lengths, and other numbers of lanes.
    moved = kernels(vr.replaced(with_samples(7, 16), ADDRESS, (-0.7, 0.7, 0.3)))
    assert all(k["cache_hit"] for k in moved)


@pytest.mark.slow
def test_how_paths_are_cut_into_launches_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """A derivative is the same bit for bit. A gradient is a sum over lanes whose order differs."""
    whole, slope = vr.derivative(ROOM, ADDRESS), vr.gradient(ROOM, [ADDRESS])[ADDRESS]
    monkeypatch.setattr(wavefront, "RAYS", 256)
    assert np.array_equal(vr.derivative(ROOM, ADDRESS), whole)
    assert np.array_equal(vr.derivative(ROOM, ADDRESS), whole)
    assert np.abs(vr.gradient(ROOM, [ADDRESS])[ADDRESS] - slope).max() <= gamma(12 * 8 * 2) * np.abs(whole).max()


@pytest.mark.slow
def test_forward_and_reverse_mode_agree_also_in_a_picture_of_one_pixel() -> None:
    one = replace(ROOM, film=vr.Film(width=1, height=1), settings=replace(ROOM.settings, spp=1))
    for scene in (ROOM, one):
        found = vr.gradient(scene, [ADDRESS])[ADDRESS]
        slopes = [vr.derivative(scene, f"{ADDRESS}.{i}") for i in range(3)]
        for x, slope in zip(found, slopes):
            assert abs(x - slope.mean()) <= gamma(3000) * np.abs(slope).max()


@pytest.mark.slow
def test_single_precision_is_that_of_double_to_rounding() -> None:
    """Both find the same objects, except where rounding decides; a tenth of the picture may differ."""
    double = vr.derivative(ROOM, "materials.glass.kt")
    single = vr.derivative(ROOM, "materials.glass.kt", precision="single")
    assert np.mean(np.abs(single - double) <= 1e-3) >= 0.9
    assert np.abs(double).max() > 0.1


def test_interrupts_end_a_derivative_after_a_launch(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first Ctrl-C is recorded while a launch runs, and ends the work after it."""

    class Pressed(Interrupts):
        def __enter__(self) -> "Interrupts":
            self.requested = True
            return self

        def __exit__(self, *_: object) -> None: ...

    launched = []
    plain, forward = Launches.plain, Launches.forward
    monkeypatch.setattr(Launches, "plain", lambda *x: launched.append("plain") or plain(*x))
    monkeypatch.setattr(Launches, "forward", lambda *x: launched.append("forward") or forward(*x))
    monkeypatch.setattr("visray.gradients.Interrupts", Pressed)
    with pytest.raises(KeyboardInterrupt):
        vr.derivative(ROOM, ADDRESS)
    # Camera rays and their first surfaces.
    assert launched == ["forward", "forward"]


# Launches, on functions whose derivatives are known


@dataclass(frozen=True)
class Table:
    """A record that launches read: a number, numbers, and a triple inside of it."""

    scale: Any
    rows: Any
    inner: tuple
    name: str = "table"


def table(scale: Any, rows: Any, triple: Any) -> Table:
    return Table(scale, rows, (triple, "text", {"rows": rows}))


def cubes(t: Table, x: Any) -> tuple:
    """(scale rows[i mod 3] x^3 + triple.x, x) for lane i."""
    i = dr.arange(UInt32, dr.width(x)) % 3
    return (t.scale * dr.gather(Float64, t.rows, i) * x * x * x + t.inner[0].x, x), i


def made() -> tuple[Table, list[Any]]:
    """A table that depends on a parameter p = 2: scale = p, rows = p (1, 2, 3), triple = (p^2, p, 1)."""
    p = dr.opaque(Float64, 2)
    dr.enable_grad(p)
    rows = p * Float64(1, 2, 3)
    t = table(p * 1, rows, Array3f64(p * p, p, 1))
    dr.eval(t.scale, t.rows, t.inner[0])
    return t, [p]


X = np.linspace(0.1, 1.7, 32)
ROWS = 1.0 + np.arange(32) % 3


def test_attached_arrays_are_found_once_and_replaced_everywhere() -> None:
    t, _ = made()
    found = AttachedArrays((t, t, "text", None, 3))
    assert {id(x) for x in found.arrays} == {id(t.scale), id(t.rows), id(t.inner[0])}
    first, second, *rest = found.replaced([dr.detach(x) for x in found.arrays])
    assert first is second
    assert rest == ["text", None, 3]
    assert first.inner[2]["rows"] is first.rows
    assert not dr.grad_enabled((first.scale, first.rows, first.inner[0]))
    assert dr.grad_enabled(t.rows)


def test_launches_carry_tangents() -> None:
    """d/dp of p (p r) x^3 + p^2 with x = x0 + p - 2: 2 p r x^3 + 3 p^2 r x^2 + 2 p."""
    t, parameters = made()
    dr.set_grad(parameters[0], 1.0)
    launches = Launches(t, parameters)
    for _ in range(2):
        (y, x), (slope, own), others = launches.forward(cubes, (Float64(X),), (Float64(np.ones(32)),))
        np.testing.assert_allclose(y, 4 * ROWS * X**3 + 4, rtol=gamma(8))
        np.testing.assert_allclose(slope, 4 * ROWS * X**3 + 12 * ROWS * X**2 + 4, rtol=gamma(16))
        assert np.array_equal(own, np.ones(32))
        assert np.array_equal(others, np.arange(32) % 3)
        assert not dr.grad_enabled((y, x, slope))


def test_launches_carry_adjoints() -> None:
    """Two launches with the weights w of the results: their adjoints are added, for the parameter in each."""
    t, parameters = made()
    launches, w = Launches(t), np.random.default_rng(3).uniform(size=32)
    for _ in range(2):
        (own,) = launches.reverse(cubes, (Float64(X),), (Float64(w), Float64(np.zeros(32))), 32)
        np.testing.assert_allclose(own, 12 * ROWS * X**2 * w, rtol=gamma(16))
    launches.pull()
    truth = 2 * np.sum(w * (4 * ROWS * X**3 + 4))
    np.testing.assert_allclose(dr.grad(parameters[0]), truth, rtol=gamma(200))


def test_a_picture_that_depends_on_nothing_has_the_gradient_0() -> None:
    scene = vr.replaced(ROOM, "materials.floor.kr", (0.0, 0.0, 0.0))
    unused = replace(scene, materials=scene.materials | {"unused": vr.Material()})
    assert np.array_equal(vr.gradient(unused, ["materials.unused.kd"])["materials.unused.kd"], np.zeros(3))
    assert attached_picture.Sweeps is not None
