"""Where rays first cross the surface of a form."""

import operator
from functools import reduce
from typing import Any

import drjit as dr

from visray.polynomials import Program
from visray.ray import NOTHING_KNOWN, Crossing, KnownEnds
from visray.roots.chord import ChordSegment, on_chord


def first_crossing(
    program: Program,
    slots: tuple,
    way: ChordSegment,
    active: Any,
    known: KnownEnds = NOTHING_KNOWN,
    tolerance: Any = None,
) -> Crossing:
    """Where the way first crosses the surface of a form, with the values `slots`; its parts are its factors. It
    enters where the form is not below zero at the beginning, or where nothing is asked. Crossings within the rounding
    of an end that is known to lie on the surface are not met.

    tolerance: how far off s may be, where it is more than rounding; degrees 1 and 2 are not concerned. None: none,
    and no code for it.
    """
    courses = [on_chord(f, slots, way) for f in program.factors]
    active = active & (way.first < way.last)
    at_start = [p.value(way.first) for p in courses]
    off = [p.error_at(way.first) for p in courses]
    # A way that begins within rounding of a zero begins on the side that it runs to.
    signs = [p.starts_below(x, dr.abs(x) <= o) for x, o, p in zip(at_start, off, courses)]
    floors = [0 * x for x in at_start]
    if known.on_start is not None:
        near = _nearest(at_start, off)
        # All of the value there is rounding: that of the point, and its own.
        floors = [dr.select(known.on_start & n, dr.abs(x) + o, 0) for n, x, o in zip(near, at_start, off)]
    if known.on_end is not None:
        at_end, off = [p.value(way.last) for p in courses], [p.error_at(way.last) for p in courses]
        sizes = [dr.select(known.on_end & n, dr.abs(x) + o, 0) for n, x, o in zip(_nearest(at_end, off), at_end, off)]
        floors = [dr.maximum(f, size) for f, size in zip(floors, sizes)]
    negative = reduce(operator.xor, signs) ^ (program.sign < 0)
    if known.on_start is not None:
        wrong = known.on_start & (negative != known.inside)
        signs = [s ^ (wrong & n) for s, n in zip(signs, near)]
        negative = negative ^ wrong
    t, part, unresolved = dr.inf, None, 0
    for number, (course, sign, floor) in enumerate(zip(courses, signs, floors)):
        there, s, left = course.first(sign, floor, active, known.on_start, tolerance)
        distance = dr.select(there & way.is_after_begin(s), way.distance(s), dr.inf)
        if len(courses) > 1:
            u = dr.uint32_array_t(distance)
            part = u(0) if part is None else dr.select(distance < t, u(number), part)
        t, unresolved = distance if number == 0 else dr.minimum(t, distance), unresolved + left
    return Crossing(t < dr.inf, t, part, ~negative | ~active, unresolved)


def _nearest(values: list, off: list) -> list:
    """Which of several values is the nearest to zero, as measured by how far off it may be."""
    if len(values) == 1:
        return [True]
    sizes = [dr.select(o > 0, dr.abs(v) / o, 0) for v, o in zip(values, off)]
    least = sizes[0]
    for size in sizes[1:]:
        least = dr.minimum(least, size)
    found, taken = [], least != least
    for size in sizes:
        found.append((size <= least) & ~taken)
        taken = taken | found[-1]
    return found
