"""The points of every area light lie on its surface, and are uniform in its area."""

from typing import Any

import numpy as np
import pytest
from light_samples import AREA_NAMES, LIGHT_NAMES, LIGHT_SAMPLES, LightSurface, light_sample
from samples import array, unit
from test_sampling import A, Samples, chi_square, chi_square_limit

from visray.geometry import gamma
from visray.quantities import Arrays, stacked
from visray.sampling import SampleSet

DOUBLE = Arrays.of("llvm", "double")
EACH = pytest.mark.parametrize("name", AREA_NAMES)
SETS, TAKEN = 2**13, 16  # of points that are taken together, and how many these are


def test_every_kind_of_light_has_a_sample() -> None:
    assert [light_sample(name).kind.__name__ for name in LIGHT_NAMES] == LIGHT_NAMES
    assert set(LIGHT_SAMPLES) == set(LIGHT_NAMES)


def lights(name: str) -> list:
    """Lights of a kind, of three sizes: 0.01, 1 and 100."""
    rng, sample = np.random.default_rng(3), light_sample(name)
    return [sample.kind(position=(1.0, 2.0, 3.0), **sample.random(rng, size)) for size in (0.01, 1.0, 100.0)]


def points(a: Arrays, light: Any, u: Any, v: Any) -> np.ndarray:
    """The points of a light for numbers from the unit square, from the middle of the light, as kernels have them."""
    row, w = stacked(a, type(light), [light]), a.W if a.precision == "double" else a.V
    return array(row.point_offset(w, *(a.put(a.F, np.ascontiguousarray(x)) for x in (u, v)))).astype(float)


def frame(rng: np.random.Generator) -> np.ndarray:
    """Three orthonormal rows, right-handed."""
    x, y = unit(rng.normal(size=(2, 3))).astype(float)
    z = np.cross(x, y)
    return unit(np.array([x, np.cross(z, x), z])).astype(float)


def surface_of(name: str) -> LightSurface:
    return light_sample(name).surface


@pytest.mark.parametrize("sampler", ["stratified", "sobol", "independent"])
@EACH
def test_points_are_uniform_in_area(name: str, sampler: str) -> None:
    """Rationale: the mean over the samples of an area light is the light's only if equal areas get equally many.

    Setup: 131,072 points of the kernel's own samplers, 16 taken together, on lights of three sizes. A map of the
        surface that keeps areas, by formulas and axes that are not the light's, puts them into 12 x 12 cells.
    Expected: the chi-square of their counts is below what uniform points exceed with a chance of 1e-6. Points in strata
        have less of it.
    """
    rng = np.random.default_rng(4)
    draw = Samples.of(sampler, SETS, 1).draw
    taken, dimension = SampleSet.of(A, TAKEN), draw.dimension(7)
    u, v = np.hstack([np.array(dimension.set_point(A.U(j), taken)) for j in range(TAKEN)])
    for light in lights(name):
        square = surface_of(name).square(light, points(A, light, u, v), frame(rng))
        assert chi_square(np.stack(square, 1), 12) < chi_square_limit(12 * 12 - 1)


@EACH
def test_every_part_of_the_unit_square_is_given_its_share_of_the_area(name: str) -> None:
    """The area element |dp/du x dp/dv| is the area of the whole surface, everywhere on the unit square.

    By central differences over 2e-5 in double: off by 1e-4 of it where a map bends as within 1e-3 of a pole, or where
    they span a crease of the map, on a strip as wide as they are.
    """
    rng, step = np.random.default_rng(5), 1e-5
    u, v = rng.uniform(1e-4, 1 - 1e-4, (2, 20_000))
    for light in lights(name):
        along = points(DOUBLE, light, u + step, v) - points(DOUBLE, light, u - step, v)
        across = points(DOUBLE, light, u, v + step) - points(DOUBLE, light, u, v - step)
        element = np.linalg.norm(np.cross(along, across), axis=1) / (2 * step) ** 2
        assert (np.abs(element / surface_of(name).area(light) - 1) > 1e-4).mean() < 0.004


@pytest.mark.parametrize("a", [A, DOUBLE], ids=["single", "double"])
@EACH
def test_points_are_on_the_surface_and_within_its_reach(name: str, a: Arrays) -> None:
    """To 16 roundings of the size of the light; the borders of the unit square included."""
    rng = np.random.default_rng(6)
    edges = np.array([0.0, np.nextafter(1.0, 0.0, dtype=np.float32)])
    u, v = np.hstack([rng.uniform(size=(2, 5000)), np.array(np.meshgrid(edges, edges)).reshape(2, -1)])
    for light in lights(name):
        p = points(a, light, u, v)
        reach = float(np.array(stacked(DOUBLE, type(light), [light]).radius_bound()).item())
        assert (surface_of(name).away(light, p) <= gamma(16, a.precision) * reach).all()
        assert (np.linalg.norm(p, axis=1) <= (1 + gamma(16, a.precision)) * reach).all()
