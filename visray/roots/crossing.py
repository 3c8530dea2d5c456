"""The first crossing of rays with a polynomial surface."""

import operator
from functools import reduce
from typing import Any

import drjit as dr

from visray.polynomials import Program
from visray.ray import NOTHING_KNOWN, Crossing, KnownEnds
from visray.roots.chord import ChordSegment, on_chord


def first_crossing(
    program: Program,
    constants: tuple,
    segment: ChordSegment,
    active: Any,
    known: KnownEnds = NOTHING_KNOWN,
    tolerance: Any = None,
) -> Crossing:
    """The first crossing of the segment with the surface of a polynomial. Its part is the number of the factor.

    `enters` holds where f is not below zero at the start, and in inactive lanes. A crossing within rounding of an end
    that is known to lie on the surface is not reported.

    constants: values of the program's constants.
    active: lanes that search.
    tolerance: greatest error of s, where that is more than rounding. Degrees 1 and 2 ignore it. None: the last digit,
        and no code for a tolerance.
    """
    factors = [on_chord(f, constants, segment) for f in program.factors]
    active = active & (segment.first < segment.last)
    at_start = [f.value(segment.first) for f in factors]
    errors = [f.error_at(segment.first) for f in factors]
    # Where the value at the start is within rounding of zero, the sign is that of the polynomial just after the start.
    negatives = [f.starts_below(x, dr.abs(x) <= e) for x, e, f in zip(at_start, errors, factors)]
    floors = [0 * x for x in at_start]
    if known.on_start is not None:
        nearest = _nearest(at_start, errors)
        # On the surface the true value is zero, so all of the computed value is rounding of the point and of the value.
        floors = [dr.select(known.on_start & n, dr.abs(x) + e, 0) for n, x, e in zip(nearest, at_start, errors)]
    if known.on_end is not None:
        at_end = [f.value(segment.last) for f in factors]
        end_errors = [f.error_at(segment.last) for f in factors]
        nearest_at_end = _nearest(at_end, end_errors)
        sizes = [dr.select(known.on_end & n, dr.abs(x) + e, 0) for n, x, e in zip(nearest_at_end, at_end, end_errors)]
        floors = [dr.maximum(floor, size) for floor, size in zip(floors, sizes)]
    below = reduce(operator.xor, negatives) ^ (program.sign < 0)
    if known.on_start is not None:
        # The side that is known decides, whatever the computed sign at the start.
        wrong = known.on_start & (below != known.inside)
        negatives = [negative ^ (wrong & n) for negative, n in zip(negatives, nearest)]
        below = below ^ wrong
    t, part, unresolved = dr.inf, None, 0
    for number, (factor, negative, floor) in enumerate(zip(factors, negatives, floors)):
        exists, s, places = factor.first_root(negative, floor, active, known.on_start, tolerance)
        distance = dr.select(exists & segment.is_after_begin(s), segment.distance(s), dr.inf)
        if len(factors) > 1:
            u = dr.uint32_array_t(distance)
            part = u(0) if part is None else dr.select(distance < t, u(number), part)
        t, unresolved = distance if number == 0 else dr.minimum(t, distance), unresolved + places
    return Crossing(t < dr.inf, t, part, ~below | ~active, unresolved)


def _nearest(values: list, errors: list) -> list:
    """For each value, whether it is the nearest to zero in units of its error. Exactly one is, in each lane."""
    if len(values) == 1:
        return [True]
    sizes = [dr.select(e > 0, dr.abs(v) / e, 0) for v, e in zip(values, errors)]
    least = sizes[0]
    for size in sizes[1:]:
        least = dr.minimum(least, size)
    nearest, taken = [], least != least
    for size in sizes:
        nearest.append((size <= least) & ~taken)
        taken = taken | nearest[-1]
    return nearest
