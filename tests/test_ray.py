"""Unit vectors and inverse lengths: bounds in roundings, over all magnitudes they are promised for."""

import numpy as np
import pytest
from samples import array, norm, real

from visray.geometry import gamma
from visray.quantities import Arrays
from visray.ray import NO_ROW, Hit, inverse_length, unit

N = 200_000


def vectors(seed: int, low: float, high: float) -> np.ndarray:
    """Vectors of lengths 10^low to 10^high, a third of them with components of very different sizes."""
    rng = np.random.default_rng(seed)
    v = rng.normal(size=(N, 3))
    v[: N // 3] *= 10 ** rng.uniform(-12, 0, (N // 3, 3))
    v[:6] = np.vstack([np.eye(3), -np.eye(3)])
    return v / np.linalg.norm(v, axis=1, keepdims=True) * 10 ** rng.uniform(low, high, (N, 1))


@pytest.mark.parametrize("fast", [True, False], ids=["from single", "by root and division"])
def test_inverse_length_is_off_by_a_few_roundings(fast: bool) -> None:
    """1e-18 to 1e18, the range in which the square is a normal number in single: within 4 ulp of the true value.

    By root: the square 3 roundings, halved by the root, root and reciprocal one each. From single: the square 3,
    halved; two for e = |v|^2 r^2 - 1, halved; and two more for the step.
    """
    a, v = Arrays.of("llvm", "single"), vectors(1, -18, 18)
    r = np.array(inverse_length(a.put(a.W, v.T), a.F32 if fast else None))
    error = np.abs(real(r) * norm(real(v)) - 1)
    assert error.max() <= gamma(5)
    # 4 ulp of a double is 8 roundings: what ray.py promises for the two of them to differ by.
    other = np.array(inverse_length(a.put(a.W, v.T), None if fast else a.F32))
    assert (np.abs(r - other) <= 4 * np.spacing(np.maximum(r, other))).all()


@pytest.mark.parametrize("fast", [True, False])
def test_inverse_length_of_nothing_is_nothing(fast: bool) -> None:
    a = Arrays.of("llvm", "single")
    for zero in (0.0, -0.0):
        assert inverse_length(a.W(zero, 0, 0), a.F32 if fast else None)[0] == 0


@pytest.mark.parametrize("precision", ["single", "double"])
def test_unit_lengthens_a_rounded_direction_exactly(precision: str) -> None:
    """A direction that is unit to its own precision comes out unit to 2^-52, and parallel to 2^-52."""
    a, v = Arrays.of("llvm", precision), vectors(2, 0, 0)
    rounded = v.astype(np.float32 if precision == "single" else float)
    d = array(unit(a.put(a.V, rounded.T), a.W))
    # e has 3 roundings and is halved; scaling has one, the factor one more.
    assert np.abs(norm(real(d)) - 1).max() <= gamma(4)
    aside = norm(np.cross(real(d), real(rounded))) / norm(real(rounded))
    assert aside.max() <= gamma(1) * np.sqrt(3)


def test_unit_of_the_worst_single_direction() -> None:
    """Every length within 2^-21 of 1 in the direction of one axis, where no error of the parts can cancel."""
    a = Arrays.of("llvm", "single")
    x = (1 + np.arange(-16, 17) * 2.0**-24).astype(np.float32)
    d = np.array(unit(a.V(a.F(x), 0, 0), a.W).x)
    assert np.abs(d - 1).max() <= gamma(4)


def test_hit_is_valid_where_there_is_an_object() -> None:
    a = Arrays.of("llvm", "single")
    hit = Hit(a.D([1, np.inf, 2]), a.U(np.array([0, NO_ROW, 7], np.uint32)))
    assert np.array(hit.valid).tolist() == [True, False, True]
