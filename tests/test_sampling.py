"""Where samples fall: each stratum once, uniform, unrelated from pixel to pixel and seed to seed."""

from math import gcd, isqrt, sqrt

import drjit as dr
import numpy as np
import pytest

from visray.quantities import Arrays
from visray.sampling import Draw, Plan, first_cell, in_cell, mix, next_cell, pixel_key

A = Arrays.of("llvm", "single")
# Chance of a false alarm of each test below: 1e-6 one-sided is 4.75 standard errors; 5 for two-sided ones.
SIGMA = 5


def chi_square_limit(k: int, z: float = 4.75) -> float:
    """The value a chi-square of k degrees of freedom exceeds with a chance of 1e-6. Source: Wilson, Hilferty 1931."""
    return k * (1 - 2 / (9 * k) + z * sqrt(2 / (9 * k))) ** 3


def plan(seed: int = 0, spp: int = 1, first: int = 0, count: int = 1) -> Plan:
    return Plan.of(A, seed, spp, first, count)


def points(pixels: np.ndarray, seed: int, spp: int, passes: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """The samples of pixels, pass by pass, and the cells visited. Shapes: pixels (N, 2); (spp, N, 2), (spp, N)."""
    x, y = (A.U(np.ascontiguousarray(v)) for v in pixels.astype(np.uint32).T)
    found, cells, done = [], [], 0
    for count in passes:
        p = plan(seed, spp, done, count)
        key = pixel_key(p, x, y)
        cell = first_cell(p, key, A.F)
        for i in range(count):
            u, v = Draw("stratified", A.F, p, key, dr.opaque(A.U, i) + p.first, cell).pixel()
            dr.eval(u, v, cell)
            found.append(np.stack([np.array(u), np.array(v)], 1))
            cells.append(np.array(cell))
            cell = next_cell(p, cell)
        done += count
    return np.array(found), np.array(cells)


def some_pixels(n: int) -> np.ndarray:
    side = isqrt(n)
    return np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), -1).reshape(-1, 2)


@pytest.mark.parametrize("spp", [1, 2, 3, 4, 5, 8, 9, 16, 17, 25, 35, 36, 64, 100, 144])
def test_each_stratum_gets_one_sample_whatever_the_passes(spp: int) -> None:
    rng, pixels, side = np.random.default_rng(spp), some_pixels(64), isqrt(spp)
    whole, cells = points(pixels, 3, spp, [spp])
    cut = np.sort(rng.choice(np.arange(1, spp), min(3, spp - 1), replace=False)) if spp > 1 else np.array([], int)
    pieces = np.diff([0, *cut, spp]).tolist()
    for passes in ([1] * spp, pieces):
        again, _ = points(pixels, 3, spp, passes)
        assert np.array_equal(whole, again)
    # The cell says which stratum a sample is in, and the sample is in it.
    strata = np.floor(whole[: side * side] * side).astype(int)
    assert np.array_equal(strata[..., 0] + side * strata[..., 1], cells[: side * side])
    for pixel in range(len(pixels)):
        assert sorted(cells[: side * side, pixel]) == list(range(side * side))
    assert (whole > 0).all() and (whole < 1).all()


def test_pixels_begin_in_different_strata() -> None:
    """4096 pixels over 64 first cells: as even as chance would have it."""
    _, cells = points(some_pixels(4096), 1, 64, [1, 63])
    for at in (0, 20, 63):
        count = np.bincount(cells[at], minlength=64)
        assert ((count - 64) ** 2 / 64).sum() < chi_square_limit(63)


@pytest.mark.parametrize("spp", [*range(1, 40), 1000, 1023, 1024, 4096, 10**6])
def test_steps_visit_all_cells_and_stray_far(spp: int) -> None:
    p = plan(0, spp, 5, 1)
    cells, step, start = (int(v[0]) for v in (p.cells, p.step, p.start))
    assert cells == isqrt(spp) ** 2 and gcd(step, cells) == 1 and start == 5 * step % cells
    if cells >= 9:
        # Near the golden ratio, so that a picture stopped early has its samples everywhere.
        assert abs(step / cells - 0.618) < 0.2


@pytest.mark.parametrize("side", [*range(1, 64), 99, 100, 1000, 2047])
def test_a_stratum_is_found_right_up_to_the_promised_size(side: int) -> None:
    """All cells, in single precision, up to k = 2047, the greatest side with k^2 < 2^22."""
    p = plan(0, side * side, 0, 1)
    cell = dr.arange(A.U, side * side)
    u, v = (np.array(w, np.float64) for w in in_cell(cell, A.U(0) >= p.cells, p.side, mix(cell), A.F))
    number = np.arange(side * side)
    # The sum, the reciprocal and the product are rounded: a jitter may come out at the border itself, or beyond it.
    slack = 2.0**-23 * side
    for w, place in ((u, number % side), (v, number // side)):
        assert (w * side >= place - slack).all() and (w * side <= place + 1 + slack).all()
    assert u.max() <= 1 and v.max() <= 1


@pytest.mark.parametrize("spp", [2, 3, 8, 15])
def test_spare_samples_fall_anywhere_in_the_pixel(spp: int) -> None:
    """Those beyond the k x k: uniform over the whole pixel, not over a stratum."""
    side = isqrt(spp)
    samples, _ = points(some_pixels(10_000), 9, spp, [spp])
    spare = samples[side * side :].reshape(-1, 2)
    assert len(spare) == (spp - side * side) * 10_000
    cells = np.concatenate(points(some_pixels(10_000), 9, spp, [spp])[1][side * side :])
    inside = np.mean(np.floor(spare * side) @ [1, side] == cells)
    # In the stratum that the walk has come to, by chance: a binomial share.
    assert abs(inside - 1 / side**2) <= SIGMA * sqrt((1 - 1 / side**2) / side**2 / len(spare))
    assert chi_square(spare, 8) < chi_square_limit(63)


def chi_square(p: np.ndarray, bins: int) -> float:
    count = np.histogram2d(p[:, 0], p[:, 1], bins=bins, range=[[0, 1], [0, 1]])[0]
    expected = len(p) / bins**2
    return float(((count - expected) ** 2 / expected).sum())


@pytest.mark.parametrize("seed", [0, 1, 2**31, 2**32 - 1])
def test_samples_are_uniform(seed: int) -> None:
    """A million single samples in 32 x 32 bins; and where they fall within their stratum of 16."""
    pixels = some_pixels(1_000_000)
    alone, _ = points(pixels, seed, 1, [1])
    assert chi_square(alone[0], 32) < chi_square_limit(32 * 32 - 1)
    strata, _ = points(pixels[:60_000], seed, 16, [16])
    assert chi_square(strata.reshape(-1, 2) * 4 % 1, 32) < chi_square_limit(32 * 32 - 1)


def correlation(a: np.ndarray, b: np.ndarray) -> float:
    """In standard errors: for independent numbers the coefficient has a deviation of 1 / sqrt(n)."""
    return abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) * sqrt(a.size)


def test_pixels_samples_and_seeds_are_unrelated() -> None:
    side = 512
    here = points(some_pixels(side * side), 5, 2, [2])[0].reshape(2, side, side, 2)
    other = points(some_pixels(side * side), 6, 2, [2])[0].reshape(2, side, side, 2)
    pairs = [(here[..., 0], here[..., 1]), (here[0], here[1]), (here, other)]
    for shift in (1, 2, 4, 8, 64):
        pairs += [(here[:, shift:], here[:, :-shift]), (here[:, :, shift:], here[:, :, :-shift])]
    pairs += [(here[:, 1:, 1:], here[:, :-1, :-1]), (here[:, :, 1:], other[:, :, :-1]), (here[:, 1:], other[:, :-1])]
    for a, b in pairs:
        assert correlation(a, b) < SIGMA
        # Not even after turning each into its distance from the middle: no mirrored copies either.
        assert correlation(np.abs(a - 0.5), np.abs(b - 0.5)) < SIGMA


def test_mixing_changes_half_the_bits() -> None:
    """Flipping any one of 32 bits of 10^5 numbers flips each bit of the hash half of the time."""
    rng, n = np.random.default_rng(1), 100_000
    x = rng.integers(0, 2**32, n, dtype=np.uint32)
    base = np.array(mix(A.U(x)))
    for bit in range(32):
        changed = base ^ np.array(mix(A.U(x ^ np.uint32(1 << bit))))
        share = np.unpackbits(changed.view(np.uint8)).reshape(n, 32).mean(0)
        assert np.abs(share - 0.5).max() < SIGMA * 0.5 / sqrt(n)
    assert len(np.unique(np.array(mix(dr.arange(A.U, 1 << 20))))) == 1 << 20


@pytest.mark.parametrize("spp", [1, 4, 16, 100])
def test_mean_of_a_linear_function_is_its_middle_with_the_error_of_strata(spp: int) -> None:
    """The mean of 3 x + y over a pixel is 2; the variance of k x k strata is (9 + 1) / 12 / k^4, not / k^2."""
    n = 10_000
    samples, _ = points(some_pixels(n), 2, spp, [spp])
    means = (samples @ np.array([3.0, 1.0])).mean(0)
    variance = 10 / 12 / spp**2
    assert abs(means.mean() - 2) < SIGMA * sqrt(variance / n)
    # The variance of a variance of n near-normal numbers is 2 / n of its square; a sum of two uniform ones has less.
    assert abs(means.var() / variance - 1) < SIGMA * sqrt(2 / n)


def test_half_of_the_strata_are_spread_over_the_pixel() -> None:
    """Stopped after half of 64 samples, the mean position is not shifted: within the error of 32 random strata."""
    samples, _ = points(some_pixels(10_000), 4, 64, [32])
    shift = samples.mean((0, 1)) - 0.5
    assert np.abs(shift).max() < SIGMA * sqrt(1 / 12 / 32 / 10_000)
    # In each pixel alone: 32 cells of the walk lie apart, so that their mean is nearer than that of random points.
    assert (samples.mean(0) - 0.5).std() < sqrt(1 / 12 / 32)


def test_a_seed_and_a_sample_count_are_data_not_code() -> None:
    x, y = (A.U(np.arange(64, dtype=np.uint32)) for _ in range(2))

    def draw(seed: int, spp: int, first: int, count: int) -> None:
        p = plan(seed, spp, first, count)
        key = pixel_key(p, x, y)
        dr.eval(Draw("stratified", A.F, p, key, p.first, next_cell(p, first_cell(p, key, A.F))).pixel())

    draw(1, 4, 0, 4)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        for numbers in ((2, 4, 0, 4), (2**32 - 1, 17, 3, 9), (0, 4000, 1000, 1)):
            draw(*numbers)
        history = dr.kernel_history([dr.KernelType.JIT])
    assert len(history) == 3 and all(k["cache_hit"] for k in history)
