"""Frames, their inverses and lengths against NumPy; tangents; the rounding bound itself."""

from fractions import Fraction

import drjit as dr
import numpy as np
import pytest
from drjit.scalar import Array3f64
from hypothesis import given
from hypothesis import strategies as st
from samples import array, inverse, norm, real

from visray.geometry import UNIT_ROUNDOFF, Frame, Similarity, gamma, tangents
from visray.quantities import Arrays

N = 20_000


def double() -> Arrays:
    return Arrays.of("llvm", "double")


def triples(a: Arrays, v: np.ndarray):
    return a.put(a.W, np.atleast_2d(v).T)


def frames(seed: int, decades: float = 2) -> np.ndarray:
    """Columns x, y, z, o of random affine maps, each of its own magnitude. Shape: (N, 3, 4)."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(N, 3, 4)) * 10 ** rng.uniform(-decades, decades, (N, 1, 4))


def framed(a: Arrays, m: np.ndarray) -> Frame:
    return Frame(*(triples(a, m[:, :, i]) for i in range(4)))


def hadamard(m: np.ndarray) -> np.ndarray:
    """|x| |y| |z| / |det|: what the rounding of an inverse by cross products is multiplied by."""
    x, y, z = (real(m[:, :, i]) for i in range(3))
    return norm(x) * norm(y) * norm(z) / np.abs(np.sum(x * np.cross(y, z), axis=1))


@pytest.mark.parametrize("n", [1, 2, 8, 26, 1000])
@pytest.mark.parametrize(("precision", "u"), [("single", Fraction(1, 2**24)), ("double", Fraction(1, 2**53))])
def test_gamma_bounds_n_roundings(n: int, precision: str, u: Fraction) -> None:
    """(1 + u)^n - 1 <= gamma(n), and little more: to second order in n u."""
    assert Fraction(UNIT_ROUNDOFF[precision]) == u
    exact, found = (1 + u) ** n - 1, Fraction(gamma(n, precision))
    assert exact < found * (1 + Fraction(1, 2**50))
    assert found <= n * u * (1 + 2 * n * u)


def test_gamma_bounds_a_sum_in_single() -> None:
    """1 000 sums of 100 numbers in single, added in order: each off by no more than gamma(99) of the sum of sizes."""
    x = np.random.default_rng(1).normal(size=(1000, 100)).astype(np.float32)
    total = np.zeros(1000, np.float32)
    for column in x.T:
        total = total + column
    error = np.abs(total - x.sum(1, dtype=float))
    assert (error <= gamma(99, "single") * np.abs(x).sum(1, dtype=float)).all()
    assert (error > gamma(1, "single") * np.abs(x).sum(1, dtype=float) / 100).any()


unit_parts = st.floats(-1, 1, allow_subnormal=False)


@given(unit_parts, unit_parts, unit_parts)
def test_tangents_are_a_right_handed_upright_frame(x: float, y: float, z: float) -> None:
    """s level, t nearest to +y, s x t = n: within the roundings of normalising (4) and of a cross product (2)."""
    n = real([x, y, z])
    if not norm(n) > 1e-3:
        return
    n = (n / norm(n)).astype(float)
    s, t = (real([*v]) for v in tangents(Array3f64(*n.tolist())))
    assert abs(norm(s) - 1) <= gamma(5) and abs(norm(t) - 1) <= gamma(12)
    assert abs(np.sum(s * t)) <= gamma(12) and abs(np.sum(s * n)) <= gamma(12) and abs(np.sum(t * n)) <= gamma(12)
    assert norm(np.cross(s, t) - n) <= gamma(20)
    assert s[1] == 0 and t[1] >= 0


@pytest.mark.parametrize(
    ("n", "s", "t"),
    [
        ((0, 1, 0), (1, 0, 0), (0, 0, -1)),  # a floor: east and north
        ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
        ((0, 0, 1), (1, 0, 0), (0, 1, 0)),  # a wall: right and up
        ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    ],
)
def test_tangents_by_hand(n: tuple, s: tuple, t: tuple) -> None:
    found = tangents(Array3f64(*map(float, n)))
    assert [tuple(v) for v in found] == [s, t]


def test_tangents_close_to_the_pole_stay_unit() -> None:
    """Normals off +-y by 1e-300 to 1: the tangent keeps its length although its squares vanish."""
    rng, a = np.random.default_rng(2), double()
    off = 10 ** rng.uniform(-300, 0, N)
    turn = rng.uniform(0, 2 * np.pi, N)
    n = np.stack([off * np.cos(turn), rng.choice([-1.0, 1.0], N), off * np.sin(turn)], 1)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    s, t = (real(array(v)) for v in tangents(triples(a, n)))
    assert np.abs(norm(s) - 1).max() <= gamma(6)
    assert np.abs(norm(t) - 1).max() <= gamma(12)


def test_inverse_of_a_frame_undoes_it() -> None:
    """Against an inverse in 80 bits. The bound: 8 roundings times Hadamard's ratio, for products and determinant."""
    a, m = double(), frames(3)
    inv = framed(a, m).inverse()
    found = np.stack([array(r) for r in (inv.x, inv.y, inv.z)], 1)
    exact = np.stack([inverse(x[:, :3]) for x in m[:2000]])
    k = hadamard(m)[:2000, None]
    scale = k * (1 + k) / np.stack([norm(real(m[:2000, :, i])) for i in range(3)], 1)
    assert (norm(found[:2000] - exact) <= gamma(8) * scale).all()


def test_frame_maps_points_vectors_and_normals_as_matrices_do() -> None:
    a, m, rng = double(), frames(4), np.random.default_rng(5)
    v = rng.normal(size=(N, 3))
    f = framed(a, m)
    linear = real(m[:, :, :3])
    exact = np.einsum("nij,nj->ni", linear, real(v))
    size = np.einsum("nij,nj->ni", np.abs(linear), np.abs(real(v)))
    assert (np.abs(array(f.vector(triples(a, v))) - exact) <= gamma(3) * size).all()
    moved = exact + m[:, :, 3]
    assert (np.abs(array(f.point(triples(a, v))) - moved) <= gamma(4) * (size + np.abs(m[:, :, 3]))).all()
    # There and back: the roundings of the way there, seen through the inverse.
    back = array(f.inverse().point(f.point(triples(a, v))))
    k = hadamard(m)
    length = np.stack([norm(real(m[:, :, i])) for i in range(3)], 1)
    far = norm(real(moved)) + norm(real(m[:, :, 3]))
    assert (np.abs(back - v) <= gamma(20) * (k * (1 + k) * far)[:, None] / length).all()
    # A normal stays across every tangent: M^-T n . M w = n . w.
    w = rng.normal(size=(N, 3))
    n = array(f.inverse().normal(triples(a, v)))
    tangent = np.einsum("nij,nj->ni", linear, real(w))
    error = np.abs(np.sum(real(n) * tangent, 1) - np.sum(real(v) * w, 1))
    assert (error <= gamma(20) * k * (1 + k) * 9 * norm(v) * norm(w) * (length.max(1) / length.min(1))).all()


def test_frame_after_frame_is_the_product() -> None:
    a, inner, outer = double(), frames(6), frames(7)
    both = framed(a, inner).then(framed(a, outer))
    found = np.stack([array(c) for c in (both.x, both.y, both.z, both.o)], 2)
    exact = np.einsum("nij,njk->nik", real(outer[:, :, :3]), real(inner))
    exact[:, :, 3] += outer[:, :, 3]
    size = np.einsum("nij,njk->nik", np.abs(outer[:, :, :3]), np.abs(inner))
    size[:, :, 3] += np.abs(outer[:, :, 3])
    assert (np.abs(found - exact) <= gamma(4) * size).all()
    alone = framed(a, inner)
    assert alone.then(None) is alone


def test_similarity_is_the_frame_it_stands_for() -> None:
    a, rng = double(), np.random.default_rng(8)
    scale, o, v = 10 ** rng.uniform(-4, 4, N), rng.normal(size=(N, 3)), rng.normal(size=(N, 3))
    s = Similarity(a.D(scale), triples(a, o))
    eye = np.zeros((N, 3, 4))
    eye[:, range(3), range(3)] = 1
    for map_, frame in ((s, s.then(framed(a, eye))), (s.then(None), s.then(framed(a, eye)))):
        for part in ("vector", "point", "normal"):
            one, two = (array(getattr(f.inverse(), part)(triples(a, v))) for f in (map_, frame))
            # A reciprocal and a product; the frame's has cross products, a determinant and three sums more.
            size = (norm(v) + norm(o))[:, None] / scale[:, None]
            assert (np.abs(one - two) <= gamma(16) * size).all()
    assert np.array_equal(np.array(s.max_stretch()), scale)
    unit = v / np.linalg.norm(v, axis=1, keepdims=True)
    squared = np.array(s.inverse().squared_length(s.inverse().vector(triples(a, unit))))
    assert np.abs(squared * scale**2 - 1).max() <= gamma(8)


def test_longest_bounds_the_stretch_and_is_exact_where_axes_are_orthogonal() -> None:
    a, m = double(), frames(9)
    found = np.array(framed(a, m).max_stretch())
    exact = np.linalg.svd(m[:, :, :3], compute_uv=False)[:, 0]
    # NumPy's singular values are good to a few roundings of the matrix; the square sums here are 8 roundings.
    slack = 1 + gamma(40)
    assert (found * slack >= exact).all()
    # Gershgorin's row sum is at most the dimension times the greatest entry.
    assert (found <= np.sqrt(3) * exact * slack).all()
    q = np.linalg.qr(m[:, :, :3])[0] * 10 ** np.random.default_rng(10).uniform(-2, 2, (N, 1, 3))
    orthogonal = np.array(framed(a, np.dstack([q, m[:, :, 3:]])).max_stretch())
    longest = np.linalg.norm(q, axis=1).max(1)
    # QR leaves angles of order of the roundoff, times the product of the two longest sides at most.
    assert (np.abs(orthogonal - longest) <= gamma(60) * longest).all()


def test_derivatives_flow_through_an_inverse() -> None:
    """d(M^-1)/dM by Dr.Jit against -M^-1 dM M^-1, column by column: the same roundings twice."""
    a, m = double(), frames(11, decades=0)[:200]
    f = framed(a, m)
    dr.enable_grad(f.y)
    inv = f.inverse()
    dr.set_grad(f.y, a.W(1, 2, -1))
    dr.forward_to(inv.x, inv.y, inv.z)
    found = np.stack([array(dr.grad(r)) for r in (inv.x, inv.y, inv.z)], 1)
    change = np.zeros((len(m), 3, 3))
    change[:, :, 1] = (1, 2, -1)
    exact = np.stack([-(inverse(x[:, :3]) @ c @ inverse(x[:, :3])) for x, c in zip(m, change)])
    k = hadamard(m)[:, None, None]
    size = np.linalg.norm(exact.astype(float), axis=(1, 2))[:, None, None]
    assert (np.abs(found - exact) <= gamma(40) * k**2 * (1 + k) * size).all()
