"""A factor of a form along a way: its values, how far off they are, and its first crossing."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any

import drjit as dr

from visray.polynomials import Factor, interpret
from visray.roots.isolation import IsolatedRoot, isolate, isolate_by_formula, to_bernstein
from visray.roots.number_types import BoundedPolynomial, Magnitude, Univariate, roundoff
from visray.roots.refinement import refine

# A value along a chord is off by no more than so many roundings of the sizes of all that was added up to it
# (tests/test_roots.py): they rarely go the same way.
NOISE = 4


@cache
def rounding_count(code: tuple) -> float:
    """How many roundings a value is off at most; in a power all go the same way, as it is squared again and again."""
    found: list[int] = []
    for name, *at in code:
        inner = 1 if name in ("slot", "axis") else max(found[i] for i in (at[:1] if name in ("pow", "neg") else at))
        found.append(inner * at[1] if name == "pow" else inner)
    return max(NOISE, found[-1] / 2)


def value_error(factor: Factor, slots: tuple, reach: Iterable) -> Any:
    """How far off a factor's values are where no coordinate is larger."""
    size = interpret(factor.code, [Magnitude(dr.abs(x)) for x in slots], tuple(map(Magnitude, reach))).x
    return rounding_count(factor.code) * roundoff(size) * size


@dataclass(frozen=True)
class ChordSegment:
    """Parts of chords l + s e, s from -1 to 1 at the distance middle + half s: those from s = first to s = last."""

    l: tuple
    e: tuple
    middle: Any
    half: Any
    first: Any
    last: Any
    begin: Any

    @staticmethod
    def of(o: Any, d: Any, chord: tuple, begin: Any, end: Any) -> "ChordSegment":
        """Rays between the distances begin and end, in the chord of their clip between two others.

        s counts from the middle of the chord, where most surfaces are, and their clips' centres; not from the middle of
        the way: coefficients and rounding are then as small as they can be where it matters.
        """
        middle, half = 0.5 * (chord[0] + chord[1]), 0.5 * (chord[1] - chord[0])
        l, e = tuple(dr.fma(middle, y, x) for x, y in zip(o, d)), tuple(half * y for y in d)
        first, last = ((t - middle) / half for t in (begin, end))
        return ChordSegment(l, e, middle, half, dr.maximum(first, -1), dr.minimum(last, 1), begin)

    def at(self, s: Any) -> list[Any]:
        """The coordinates of a point."""
        return [dr.fma(s, y, x) for x, y in zip(self.l, self.e)]

    def distance(self, s: Any) -> Any:
        """How far along the ray a point is."""
        return dr.fma(self.half, s, self.middle)

    def is_after_begin(self, s: Any) -> Any:
        """Whether a point lies beyond the beginning of the way."""
        return self.distance(s) > self.begin


@dataclass(frozen=True)
class FactorOnChord:
    """A factor of a form along a way."""

    factor: Factor
    slots: tuple
    way: ChordSegment
    line: Univariate

    def noise(self, r: Any) -> Any:
        """How far off its values are for |s| <= r."""
        reach = (dr.fma(dr.abs(y), r, dr.abs(x)) for x, y in zip(self.way.l, self.way.e))
        return value_error(self.factor, self.slots, reach)

    def first(self, sign: Any, floor: Any, active: Any, on_start: Any, tolerance: Any) -> tuple[Any, Any, Any]:
        """Whether it is crossed, where, and how many parts are unresolved. sign: whether it begins below zero; floor:
        how far off all values are by the rounding of the ends; tolerance: as in first_crossing."""
        # All is relative to the sizes of what is added up, so that products of values stay within a double's range.
        scale = roundoff(floor) / self.noise(1)
        turn = dr.mulsign(scale, dr.select(sign, type(scale)(-1), 1))
        line = Univariate(*(x * turn for x in self.line.c))

        def f(s: Any) -> Any:
            return self.value(s) * turn

        def noise(r: Any) -> Any:
            return (self.noise(r) + floor) * scale

        ends = self.way.first, self.way.last
        if self.factor.degree <= 2:
            part, s = isolate_by_formula(line.c, noise, *ends, active)
            return part.found, self._polished(f, line, part, s), part.unresolved

        def accurate_bernstein(middle: Any, half: Any) -> tuple:
            b, off = self.accurate_bernstein(middle, half)
            return [x * turn for x in b], (off + floor) * scale

        part = isolate(line.c, noise, accurate_bernstein, *ends, active)
        least = roundoff(floor)
        low, high = dr.maximum(line(part.low), least), dr.minimum(line(part.high), -least)
        if on_start is None:
            return part.found, refine(f, part, low, high, ends, None, tolerance), part.unresolved
        # Near a start on the surface what is only noise counts as of the side that the way begins on.
        flat = dr.select(on_start & (part.low == ends[0]), (floor + self.error_at(ends[0])) * scale, 0)
        low = dr.select(flat > 0, flat, low)
        return part.found, refine(f, part, low, high, ends, flat, tolerance), part.unresolved

    def accurate_bernstein(self, middle: Any, half: Any) -> tuple[list[Any], Any]:
        """Bernstein's coefficients on a part of the way and how far off they are, from its structure on that part."""
        sure = self._sure(Univariate(dr.fma(middle, y, x), half * y) for x, y in zip(self.way.l, self.way.e))
        rounds = len(sure.line.c) * roundoff(middle)
        return to_bernstein(sure.line.c), sure.error + rounds * sure.size

    def _sure(self, axes: Iterable) -> BoundedPolynomial:
        """The factor where the coordinates are polynomials in s, with how far off it is: places too are rounded."""
        known = (BoundedPolynomial(line, 0) for line in axes)
        places = tuple(BoundedPolynomial(x.line, 2 * roundoff(x.size) * x.size) for x in known)
        return interpret(self.factor.code, tuple(BoundedPolynomial(Univariate(x), 0) for x in self.slots), places)

    def starts_below(self, x: Any, zero: Any) -> Any:
        """Whether the way begins below zero, with the value x; where that is no more than rounding (`zero`), whether it
        runs there: by the sign of the first derivative that is more."""
        way, c = self.way, list(self.line.c)

        def leading(_: Any) -> tuple:
            d = len(c) - 1
            for i in range(d):
                for j in range(d - 1, i - 1, -1):
                    c[j] = dr.fma(way.first, c[j + 1], c[j])
            off, length, found = self.noise(1), way.last - way.first, x
            for k in range(d, 0, -1):
                found = dr.select(dr.abs(c[k]) * length**k > off, c[k], found)
            return (found,)

        return dr.if_stmt((x,), zero, leading, lambda x: (x,), label="leading")[0] < 0

    def error_at(self, s: Any) -> Any:
        """How far off the value by structure is at a point."""
        return self._sure(Univariate(dr.fma(s, y, x)) for x, y in zip(self.way.l, self.way.e)).error

    def value(self, s: Any) -> Any:
        """The factor by its structure."""
        return interpret(self.factor.code, self.slots, self.way.at(s))

    @staticmethod
    def _polished(f: Callable, line: Univariate, part: IsolatedRoot, s: Any) -> Any:
        """Two steps of Newton's from a root by formula, which lost digits if the surface is small in its clip."""
        for _ in range(2):
            slope = line.slope(s)
            moved = s - f(s) / dr.select(slope == 0, dr.inf, slope)
            s = dr.select((moved >= part.low) & (moved <= part.high), moved, s)
        return s


def on_chord(factor: Factor, slots: tuple, way: ChordSegment) -> FactorOnChord:
    """The factor along the way, with its polynomial in s."""
    line = interpret(factor.code, tuple(map(Univariate, slots)), tuple(map(Univariate, way.l, way.e)))
    return FactorOnChord(factor, slots, way, line)
