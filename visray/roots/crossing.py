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
    """The first crossing of a segment with the surface f = 0 of a polynomial f.

    The part of the crossing is the number of the factor that is zero there. The field `enters` is true in lanes where f
    is not negative at the start of the segment, and in inactive lanes. If an end of the segment is known to lie on the
    surface, a crossing within rounding of this end is not reported.

    constants: values of the program's constants.
    active: mask of the lanes that search.
    tolerance: greatest allowed error of s; a value below the rounding error has no effect. Factors of degree 1 and 2
        ignore it. None: s is exact to its last digit, and the kernel contains no code for a tolerance.
    """
    factors = [on_chord(f, constants, segment) for f in program.factors]
    active = active & (segment.first < segment.last)
    at_start = [f.value(segment.first) for f in factors]
    errors = [f.error_at(segment.first) for f in factors]
    is_noise, starts_at_root = [dr.abs(x) <= e for x, e in zip(at_start, errors)], [None] * len(factors)
    floors = [0 * x for x in at_start]
    if known.on_start is not None:
        starts_at_root = [known.on_start & nearest for nearest in _nearest(at_start, errors)]
        # The known side replaces the sign of the factor that is zero at the start, so its sign is not needed.
        is_noise = [noise & ~root for noise, root in zip(is_noise, starts_at_root)]
        # On the surface the true value is zero, so the whole computed value is the rounding error of the point and of
        # the evaluation.
        floors = [dr.select(root, dr.abs(x) + e, 0) for root, x, e in zip(starts_at_root, at_start, errors)]
    if known.on_end is not None:
        at_end = [f.value(segment.last) for f in factors]
        end_errors = [f.error_at(segment.last) for f in factors]
        nearest_at_end = _nearest(at_end, end_errors)
        sizes = [dr.select(known.on_end & n, dr.abs(x) + e, 0) for n, x, e in zip(nearest_at_end, at_end, end_errors)]
        floors = [dr.maximum(floor, size) for floor, size in zip(floors, sizes)]
    # If the value at the start is within rounding of zero, the sign just after the start is taken.
    negatives = [f.starts_below(x, noise) for x, noise, f in zip(at_start, is_noise, factors)]
    below = reduce(operator.xor, negatives) ^ (program.sign < 0)
    if known.on_start is not None:
        # If the side on which the ray starts is known, it replaces the computed sign at the start.
        wrong = known.on_start & (below != known.inside)
        negatives = [negative ^ (wrong & root) for negative, root in zip(negatives, starts_at_root)]
        below = below ^ wrong
    t, part, unresolved = dr.inf, None, 0
    for number, (factor, negative, floor, root) in enumerate(zip(factors, negatives, floors, starts_at_root)):
        exists, s, places = factor.first_root(negative, floor, active, known.on_start, root, tolerance)
        distance = dr.select(exists & segment.is_after_begin(s), segment.distance(s), dr.inf)
        if len(factors) > 1:
            u = dr.uint32_array_t(distance)
            part = u(0) if part is None else dr.select(distance < t, u(number), part)
        t, unresolved = distance if number == 0 else dr.minimum(t, distance), unresolved + places
    return Crossing(t < dr.inf, t, part, ~below | ~active, unresolved)


def _nearest(values: list, errors: list) -> list:
    """A list of masks, one per value: whether this value is the nearest to zero, measured in units of its error bound.

    In each lane, exactly one of the masks is true.
    """
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
