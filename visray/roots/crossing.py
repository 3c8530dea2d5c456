"""Where rays first cross the surface of a form."""

import operator
from dataclasses import dataclass
from functools import reduce
from typing import Any

import drjit as dr

from visray.polynomials import Form
from visray.roots.along import Way, along


@dataclass(frozen=True)
class Crossing:
    """The first crossing of a way: its distance where it is `found`; negative: whether the surface's function is below
    zero at the beginning; unresolved: as in Isolated."""

    t: Any
    found: Any
    negative: Any
    unresolved: Any


@dataclass(frozen=True)
class Ends:
    """What is known of a way's ends. on_start: it begins on the surface, and runs on where the function is below zero
    (`negative`) or not; on_end: it ends on the surface. Crossings within the rounding of such an end are not met."""

    on_start: Any = None
    negative: Any = None
    on_end: Any = None


def first_crossing(
    form: Form, slots: tuple, way: Way, active: Any, ends: Ends = Ends(), tolerance: Any = None
) -> Crossing:
    """Where the way first crosses the surface of a form, with the values `slots`.

    tolerance: how far off s may be, where it is more than rounding; degrees 1 and 2 are not concerned. None: none,
    and no code for it.
    """
    courses = [along(f, slots, way) for f in form.factors]
    active = active & (way.first < way.last)
    at_start = [p.value(way.first) for p in courses]
    off = [p.off_at(way.first) for p in courses]
    # A way that begins within rounding of a zero begins on the side that it runs to.
    signs = [p.runs_below(x, dr.abs(x) <= o) for x, o, p in zip(at_start, off, courses)]
    floors = [0 * x for x in at_start]
    if ends.on_start is not None:
        near = _nearest(at_start, off)
        # All of the value there is rounding: that of the point, and its own.
        floors = [dr.select(ends.on_start & n, dr.abs(x) + o, 0) for n, x, o in zip(near, at_start, off)]
    if ends.on_end is not None:
        at_end, off = [p.value(way.last) for p in courses], [p.off_at(way.last) for p in courses]
        sizes = [dr.select(ends.on_end & n, dr.abs(x) + o, 0) for n, x, o in zip(_nearest(at_end, off), at_end, off)]
        floors = [dr.maximum(f, size) for f, size in zip(floors, sizes)]
    negative = reduce(operator.xor, signs) ^ (form.sign < 0)
    if ends.on_start is not None:
        wrong = ends.on_start & (negative != ends.negative)
        signs = [s ^ (wrong & n) for s, n in zip(signs, near)]
        negative = negative ^ wrong
    found, t, unresolved = active & ~active, dr.inf, 0
    for course, sign, floor in zip(courses, signs, floors):
        there, s, left = course.first(sign, floor, active, ends.on_start, tolerance)
        there &= way.begun(s)
        distance = dr.select(there, way.distance(s), dr.inf)
        t = distance if len(courses) == 1 else dr.minimum(t, distance)
        found, unresolved = found | there, unresolved + left
    return Crossing(t, found, negative, unresolved)


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
