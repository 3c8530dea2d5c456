"""Where samples fall: each stratum once, uniform, unrelated from pixel to pixel and seed to seed."""

from dataclasses import dataclass
from itertools import pairwise
from math import comb, gcd, isqrt, sqrt

import drjit as dr
import numpy as np
import pytest

from visray.quantities import Arrays
from visray.sampling import (
    SamplePlan,
    SampleSet,
    SampleState,
    first_stratum,
    hash32,
    jittered,
    next_stratum,
    pascal,
    pixel_key,
    scrambled,
    sobol,
)

A = Arrays.of("llvm", "single")
# Chance of a false alarm of each test below: 1e-6 one-sided is 4.75 standard errors; 5 for two-sided ones.
SIGMA = 5


def chi_square_limit(k: int, z: float = 4.75) -> float:
    """The value a chi-square of k degrees of freedom exceeds with a chance of 1e-6. Source: Wilson, Hilferty 1931."""
    return k * (1 - 2 / (9 * k) + z * sqrt(2 / (9 * k))) ** 3


def plan(seed: int = 0, spp: int = 1, first: int = 0, count: int = 1) -> SamplePlan:
    return SamplePlan.of(A, seed, spp, first, count)


def points(pixels: np.ndarray, seed: int, spp: int, passes: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """The samples of pixels, pass by pass, and the cells visited. Shapes: pixels (N, 2); (spp, N, 2), (spp, N)."""
    x, y = (A.put(A.U, v) for v in pixels.astype(np.uint32).T)
    found, cells, done = [], [], 0
    for count in passes:
        p = plan(seed, spp, done, count)
        key = pixel_key(p, x, y)
        cell = first_stratum(p, key, A.F)
        for i in range(count):
            u, v = SampleState("stratified", A.F, p, key, dr.opaque(A.U, i) + p.first, cell).pixel()
            dr.eval(u, v, cell)
            found.append(np.stack([np.array(u), np.array(v)], 1))
            cells.append(np.array(cell))
            cell = next_stratum(p, cell)
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
    cells, step, start = (int(v[0]) for v in (p.strata, p.step, p.start))
    assert cells == isqrt(spp) ** 2 and gcd(step, cells) == 1 and start == 5 * step % cells
    if cells >= 9:
        # Near the golden ratio, so that a picture stopped early has its samples everywhere.
        assert abs(step / cells - 0.618) < 0.2


@pytest.mark.parametrize("side", [*range(1, 64), 99, 100, 1000, 2047])
def test_a_stratum_is_found_right_up_to_the_promised_size(side: int) -> None:
    """All cells, in single precision, up to k = 2047, the greatest side with k^2 < 2^22."""
    p = plan(0, side * side, 0, 1)
    cell = dr.arange(A.U, side * side)
    u, v = (np.array(w, np.float64) for w in jittered(cell, A.U(0) >= p.strata, p.side, hash32(cell), A.F))
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
    base = np.array(hash32(A.U(x)))
    for bit in range(32):
        changed = base ^ np.array(hash32(A.U(x ^ np.uint32(1 << bit))))
        share = np.unpackbits(changed.view(np.uint8)).reshape(n, 32).mean(0)
        assert np.abs(share - 0.5).max() < SIGMA * 0.5 / sqrt(n)
    assert len(np.unique(np.array(hash32(dr.arange(A.U, 1 << 20))))) == 1 << 20


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
        dr.eval(SampleState("stratified", A.F, p, key, p.first, next_stratum(p, first_stratum(p, key, A.F))).pixel())

    draw(1, 4, 0, 4)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        for numbers in ((2, 4, 0, 4), (2**32 - 1, 17, 3, 9), (0, 4000, 1000, 1)):
            draw(*numbers)
        history = dr.kernel_history([dr.KernelType.JIT])
    assert len(history) == 3 and all(k["cache_hit"] for k in history)


# Sobol's points

SHUFFLED = pytest.mark.parametrize("shuffled", [False, True], ids=["in order", "shuffled"])


def keys(n: int) -> np.ndarray:
    """Seeds of sequences as the kernels have them: hashes of small numbers."""
    return np.array(hash32(dr.arange(A.U, n) + 77))


def sobol_points(index: np.ndarray, seed: np.ndarray, shuffled: bool) -> np.ndarray:
    """Shape: (2, *index.shape), the numbers exactly as integers of 24 bits."""
    i, s = (A.U(np.broadcast_to(v, np.broadcast(index, seed).shape).ravel().astype(np.uint32)) for v in (index, seed))
    found = np.array([np.array(w, np.float64) for w in sobol(i, s, shuffled, A.F)]) * 2.0**24
    assert (found == np.floor(found)).all() and found.min() >= 0 and found.max() < 2**24
    return found.astype(np.int64).reshape(2, *np.broadcast(index, seed).shape)


@SHUFFLED
@pytest.mark.parametrize("k", range(11))
def test_every_aligned_block_is_a_net(shuffled: bool, k: int) -> None:
    """A (0, k, 2)-net in base 2: each of the k + 1 ways to cut the square into 2^k equal boxes has a point in each box.

    For 30 seeds and blocks that start anywhere up to 2^32.
    """
    rng = np.random.default_rng(k)
    first = (rng.integers(0, 2 ** (32 - k), 40) << k)[None, :, None]
    first[:, :2] = [[[0], [1 << k]]]
    x, y = sobol_points(first + np.arange(2**k), keys(30)[:, None, None], shuffled)
    for p in range(k + 1):
        box = ((x >> (24 - p)) << (k - p)) | (y >> (24 - k + p))
        assert np.array_equal(np.sort(box, -1), np.broadcast_to(np.arange(2**k), box.shape))


def test_pascals_triangle_is_that_of_binomials() -> None:
    """Bit i of the result is the sum modulo 2 of C(j, i) over the bits j of x: odd where i has no bit that j lacks."""
    x = np.random.default_rng(1).integers(0, 2**32, 2000, dtype=np.uint64)
    bits = (x[:, None] >> np.arange(32, dtype=np.uint64)) & np.uint64(1)
    matrix = np.array([[comb(j, i) % 2 for i in range(32)] for j in range(32)], np.uint64)
    exact = ((bits @ matrix) & np.uint64(1)) @ (np.uint64(1) << np.arange(32, dtype=np.uint64))
    assert np.array_equal(np.array(pascal(A.U(x.astype(np.uint32)))), exact)


def test_scrambling_flips_each_bit_by_those_below_it_alone() -> None:
    """Owen's: numbers that agree in their lowest k bits still do, and go on to differ where they did."""
    rng = np.random.default_rng(2)
    seed = keys(50_000)
    x, k = rng.integers(0, 2**32, len(seed)), rng.integers(0, 32, len(seed))
    other = x ^ ((rng.integers(0, 2**32, len(seed)) << (k + 1) | (1 << k)) & 0xFFFFFFFF)
    one, two = (np.array(scrambled(A.U(v.astype(np.uint32)), A.U(seed))).astype(np.int64) for v in (x, other))
    apart = one ^ two
    assert np.array_equal(apart & -apart, 1 << k)
    # Not without an effect: over the seeds, each of the bits is flipped half of the time.
    flips = (one ^ x)[:, None] >> np.arange(32) & 1
    assert np.abs(flips.mean(0) - 0.5).max() < SIGMA * 0.5 / sqrt(len(seed))


@SHUFFLED
@pytest.mark.parametrize("index", [0, 1, 2, 5, 63, 1000, 2**31 + 7])
def test_scrambled_points_are_uniform_over_seeds(shuffled: bool, index: int) -> None:
    """Each point of the sequence alone, over a million seeds: anywhere in 16 x 16 boxes, and within a small one."""
    found = sobol_points(np.array(index), keys(1_000_000), shuffled).T / 2.0**24
    for part in (found, found * 16 % 1):
        assert chi_square(part, 16) < chi_square_limit(16 * 16 - 1)


# Streams

SAMPLERS = ("stratified", "sobol", "independent")
EACH = pytest.mark.parametrize("sampler", SAMPLERS)


@dataclass(frozen=True)
class Samples:
    """The random numbers of each sample of some pixels in a row, a lane each."""

    draw: SampleState
    shape: tuple[int, int]
    cell: np.ndarray

    @staticmethod
    def of(sampler: str, pixels: int, spp: int, first: int = 0, count: int | None = None, seed: int = 3) -> "Samples":
        """Of all samples, or of a pass of `count` from the `first` on."""
        count = spp if count is None else count
        p = plan(seed, spp, first, count)
        i, x = A.U(np.repeat(np.arange(count, dtype=np.uint32), pixels)), dr.tile(dr.arange(A.U, pixels), count)
        key = pixel_key(p, x, x * 0 + 9)
        cell = (first_stratum(p, key, A.F) + i * p.step) % int(p.strata[0])
        return Samples(SampleState(sampler, A.F, p, key, i + p.first, cell), (count, pixels), np.array(cell))

    def values(self, pairs: list) -> np.ndarray:
        """Pairs of arrays, evaluated together. Shape: (number of pairs, 2, samples, pixels)."""
        dr.eval(pairs)
        return np.array([[np.array(w, np.float64).reshape(self.shape) for w in p] for p in pairs])

    def lot(self, stream: int, n: int) -> np.ndarray:
        """The n points of a lot. Shape: (n, 2, samples, pixels)."""
        lot = SampleSet.of(A, n)
        return self.values([self.draw.dimension(stream).set_point(A.U(j), lot) for j in range(n)])


def singles(d: SampleState) -> list:
    """Pairs for the purposes of which a path has one each: pixel, lens, lobe, scatter; and those of its next levels."""
    levels = [d, d.derived(A.U(1)), d.derived(A.U(2)), d.derived(A.U(1 | 1 << 16))]
    return [d.pixel(), d.dimension(1).point()] + [level.dimension(n).point() for level in levels for n in (5, 6, 8)]


LOTS = (2, 3, 7, 16, 17, 18)


def lots(d: SampleState) -> list:
    """A pair each of the lots of occlusion, lights and paths."""
    return [d.dimension(n).set_point(A.U(2), SampleSet.of(A, 4)) for n in LOTS]


def place(points: np.ndarray, side: int) -> np.ndarray:
    """The number of the stratum of points (..., 2, samples, pixels)."""
    cells = np.floor(points * side).astype(int)
    return cells[..., 0, :, :] + side * cells[..., 1, :, :]


def each_once(numbers: np.ndarray, axis: int) -> bool:
    """Whether the numbers along an axis are 0 to n - 1 in some order."""
    wanted = np.arange(numbers.shape[axis]).reshape([-1 if i == axis else 1 for i in range(numbers.ndim)])
    return bool((np.sort(numbers, axis) == wanted).all())


@EACH
@pytest.mark.slow
def test_streams_and_levels_are_unrelated_from_pixel_to_pixel(sampler: str) -> None:
    """Any two purposes, over 100 000 pixels: the first sample of 16, and the sixth."""
    n = 100_000
    for number in (0, 5):
        s = Samples.of(sampler, n, 16, number, 1)
        found = s.values(singles(s.draw) + lots(s.draw)).reshape(-1, n)
        for part in (found, np.abs(found - 0.5)):
            related = np.corrcoef(part) * sqrt(n) * (1 - np.eye(len(part)))
            # Some 1000 pairs: 6 standard errors have a chance of 2e-6 among them.
            assert np.abs(related).max() < 6


@EACH
@pytest.mark.parametrize("spp", [16, 25, 256])
def test_streams_and_levels_are_unrelated_within_a_pixel(sampler: str, spp: int) -> None:
    """Rationale: where two purposes are paired alike in all of a pixel's samples, as u and u + constant, no number of
    samples brings the mean of a product to the product of the means. Setup: the squared correlation over a pixel's
    samples, mean over 1000 pixels. Expected: 1 / (spp - 1), as of random pairings of any two sets of numbers, or up to
    twice that where the points of a set keep together by twos, as a net's do.
    """
    n = 1000
    s = Samples.of(sampler, n, spp)
    found = s.values(singles(s.draw)).reshape(-1, spp, n)
    found -= found.mean(1, keepdims=True)
    found /= np.sqrt((found**2).sum(1, keepdims=True))
    squares = (np.einsum("asp,bsp->abp", found, found) ** 2).mean(2)
    pairs = squares[np.triu_indices(len(squares), 1)]
    # The square of a normal number has a deviation of root 2; some 300 pairs, 6 standard errors.
    twos = 1 if sampler == "independent" else 2
    assert pairs.max() <= twos * (1 + 6 * sqrt(2 / n)) / (spp - 1)


@pytest.mark.parametrize("sampler", ["stratified", "sobol"])
@pytest.mark.parametrize("n", [1, 4, 16, 64])
def test_a_lot_is_stratified(sampler: str, n: int) -> None:
    """Points taken together: each of the n squares has one, in each of a pixel's samples."""
    assert each_once(place(Samples.of(sampler, 500, 5).lot(7, n), isqrt(n)), 0)


@EACH
@pytest.mark.parametrize("n", [2, 3, 17])
def test_what_a_lot_has_beyond_its_squares_falls_anywhere(sampler: str, n: int) -> None:
    """Uniform over 20 000 pixels each; of the stratified ones, those within the k x k squares have one each."""
    s, side = Samples.of(sampler, 20_000, 1), isqrt(n)
    found = s.lot(7, n)
    squares = side * side if sampler == "stratified" else 0
    assert each_once(place(found[:squares], side), 0)
    for points in found[squares:]:
        assert chi_square(points.reshape(2, -1).T, 16) < chi_square_limit(16 * 16 - 1)


def test_a_lot_of_independent_points_is_not_stratified() -> None:
    """The share of lots of 4 that have a point in each square by chance: 4!/4^4."""
    n, chance = 20_000, 24 / 256
    full = (np.sort(place(Samples.of("independent", n, 1).lot(7, 4), 2), 0) == np.arange(4)[:, None, None]).all(0)
    assert abs(full.mean() - chance) < SIGMA * sqrt(chance * (1 - chance) / n)


@EACH
def test_passes_do_not_change_streams_and_seeds_do(sampler: str) -> None:
    spp, pixels = 20, 300

    def numbers(first: int, count: int, seed: int = 3) -> np.ndarray:
        s = Samples.of(sampler, pixels, spp, first, count, seed)
        return s.values(singles(s.draw) + lots(s.draw))

    whole = numbers(0, spp)
    for ends in (range(spp + 1), (0, 3, 12, 20)):
        pieces = [numbers(first, last - first) for first, last in pairwise(ends)]
        assert np.array_equal(whole, np.concatenate(pieces, 2))
    other = numbers(0, spp, seed=4)
    # Of 2^16 places in a stratum, the same one by chance.
    assert (whole == other).mean() <= 2.0**-16 + SIGMA * sqrt(2.0**-16 / whole.size)
    # Lots are in the same strata whatever the seed; single pairs are not.
    assert correlation(whole[: -len(LOTS), :, 0], other[: -len(LOTS), :, 0]) < SIGMA
