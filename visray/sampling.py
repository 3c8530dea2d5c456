"""Where samples fall: one seed, decorrelated from pixel to pixel, stratified within a pixel.

Everything that changes from render to render (seed, sample count, first sample of a pass) is opaque data.
"""

from dataclasses import dataclass
from math import gcd, isqrt
from typing import Any

import drjit as dr

from visray.quantities import Arrays

_ODD = 0x9E3779B9  # 2^32 over the golden ratio: steps through all 32-bit numbers without a short cycle


def mix(x: Any) -> Any:
    """A well mixed 32-bit hash. Source: Wellons' hash-prospector, the function of least bias with two
    multiplications."""
    x = x ^ (x >> 16)
    x = x * 0x21F0AAAD
    x = x ^ (x >> 15)
    x = x * 0xD35A2D97
    return x ^ (x >> 15)


@dataclass(frozen=True)
class Plan:
    """The samples of one pass, as opaque numbers of one entry.

    seed; first and count: which samples this pass takes; cells: the pixel's k x k strata; side: k; step and start: the
    order in which a pixel visits them, start + i step modulo cells, so that a picture stopped early is not shifted.
    """

    seed: Any
    first: Any
    count: Any
    cells: Any
    side: Any
    step: Any
    start: Any

    @staticmethod
    def of(a: Arrays, seed: int, spp: int, first: int, count: int) -> "Plan":
        side = isqrt(spp)
        cells = side * side
        # The step nearest to cells over the golden ratio that has no divisor in common with cells visits each once.
        step = next(s for s in range(max(1, round(cells * 0.618)), 2 * cells + 2) if gcd(s, cells) == 1) % cells or 1
        return Plan(
            *(dr.opaque(a.U, x) for x in (seed, first, count, cells)),
            dr.opaque(a.F, side),
            *(dr.opaque(a.U, x) for x in (step, first * step % cells)),
        )


def pixel_key(plan: Plan, x: Any, y: Any) -> Any:
    """A 32-bit number for each pixel and seed."""
    return mix(x + mix(y + mix(plan.seed)))


def first_cell(plan: Plan, key: Any, real: Any) -> Any:
    """The stratum that the first sample of a pass falls in, from 0 to cells - 1."""
    u = real(key >> 8) * 2.0**-24
    cell = type(key)(u * real(plan.cells)) + plan.start
    return dr.select(cell >= plan.cells, cell - plan.cells, cell)


def next_cell(plan: Plan, cell: Any) -> Any:
    cell = cell + plan.step
    return dr.select(cell >= plan.cells, cell - plan.cells, cell)


def in_pixel(plan: Plan, key: Any, index: Any, cell: Any, real: Any) -> tuple[Any, Any]:
    """A point of the unit square: jittered in its stratum, or anywhere for the samples beyond the k x k.

    Domain: k^2 < 2^22, so that the row of a stratum comes out right in single precision.
    """
    h = mix(key + (index + 1) * _ODD)
    jx, jy = real(h >> 16) * 2.0**-16 + 2.0**-17, real(h & 0xFFFF) * 2.0**-16 + 2.0**-17
    width = dr.rcp(plan.side)
    row = dr.floor((real(cell) + 0.5) * width)
    column = real(cell) - row * plan.side
    spare = index >= plan.cells
    return dr.select(spare, jx, (column + jx) * width), dr.select(spare, jy, (row + jy) * width)
