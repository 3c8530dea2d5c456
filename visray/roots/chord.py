"""A factor of a polynomial along a chord: its values, their error bounds, and its first root.

The chord is the part of a ray's line inside the clip, which is the ball or box that bounds a polynomial surface. Points
of the chord have the coordinate s, from -1 to 1. A factor is a square-free factor of the polynomial; its program is the
list of operations that evaluate it (polynomials/program.py).
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any

import drjit as dr

from visray.polynomials import Factor, interpret
from visray.roots.isolation import IsolatedRoot, isolate, isolate_by_formula, to_bernstein
from visray.roots.number_types import BoundedPolynomial, Magnitude, Univariate, roundoff
from visray.roots.refinement import refine

# The error of a factor's value is at most this many unit roundoffs times the sum of the absolute values of its terms
# (tests/test_roots.py). The number is small because rounding errors rarely all have the same sign.
NOISE = 4


@cache
def rounding_count(code: tuple) -> float:
    """Bound on the error of a program's value, in units of unit roundoff times the sum of the terms' absolute values.

    A power multiplies the bound by its exponent, because repeated squaring gives all rounding errors the same sign.
    """
    counts: list[int] = []
    for name, *at in code:
        inner = (
            1 if name in ("constant", "axis") else max(counts[i] for i in (at[:1] if name in ("pow", "neg") else at))
        )
        counts.append(inner * at[1] if name == "pow" else inner)
    return max(NOISE, counts[-1] / 2)


def value_error(factor: Factor, constants: tuple, reach: Iterable) -> Any:
    """Error bound of a factor's values at all points with |x|, |y|, |z| at most the three entries of `reach`.

    constants: values of the program's constants.
    """
    size = interpret(factor.code, [Magnitude(dr.abs(x)) for x in constants], tuple(map(Magnitude, reach))).x
    return rounding_count(factor.code) * roundoff(size) * size


@dataclass(frozen=True)
class ChordSegment:
    """A segment of a chord: the points centre + s axis for s from `first` to `last`, within -1 <= s <= 1.

    centre: the middle of the chord, one array per coordinate.
    axis: the vector from the middle to the end of the chord, one array per coordinate.
    middle, half: numbers such that the point at s has the distance middle + half s along the ray.
    first, last: values of s at the ends of the segment.
    begin: distance along the ray of the first end. Crossings up to there do not count.
    """

    centre: tuple
    axis: tuple
    middle: Any
    half: Any
    first: Any
    last: Any
    begin: Any

    @staticmethod
    def of(o: Any, d: Any, chord: tuple, begin: Any, end: Any) -> "ChordSegment":
        """The segment of the ray o + t d from t = begin to t = end.

        chord: the distances at which the ray's line enters and leaves the clip.

        s = 0 is the middle of the chord, not of the segment. Most surfaces are near the centre of their clip, and so
        near the middle of the chord. There, coefficients and rounding errors are smallest.
        """
        middle, half = 0.5 * (chord[0] + chord[1]), 0.5 * (chord[1] - chord[0])
        centre, axis = tuple(dr.fma(middle, y, x) for x, y in zip(o, d)), tuple(half * y for y in d)
        first, last = ((t - middle) / half for t in (begin, end))
        return ChordSegment(centre, axis, middle, half, dr.maximum(first, -1), dr.minimum(last, 1), begin)

    def at(self, s: Any) -> list[Any]:
        """Coordinates of the point at s."""
        return [dr.fma(s, y, x) for x, y in zip(self.centre, self.axis)]

    def distance(self, s: Any) -> Any:
        """Distance along the ray to the point at s."""
        return dr.fma(self.half, s, self.middle)

    def is_after_begin(self, s: Any) -> Any:
        """Whether the point at s lies beyond the distance `begin`."""
        return self.distance(s) > self.begin


@dataclass(frozen=True)
class FactorOnChord:
    """A factor of a polynomial along a chord.

    factor: the factor, with its program.
    constants: values of the program's constants.
    segment: the segment of the chord in which roots are searched.
    polynomial: the factor as a polynomial in s.
    """

    factor: Factor
    constants: tuple
    segment: ChordSegment
    polynomial: Univariate

    def noise(self, r: Any) -> Any:
        """Bound on the errors of the values of `polynomial` for |s| <= r."""
        reach = (dr.fma(dr.abs(y), r, dr.abs(x)) for x, y in zip(self.segment.centre, self.segment.axis))
        return value_error(self.factor, self.constants, reach)

    def first_root(
        self, negative: Any, floor: Any, active: Any, on_start: Any, starts_at_root: Any, tolerance: Any
    ) -> tuple[Any, Any, Any]:
        """The first root on the segment: (whether there is a root, s, number of unresolved places).

        At an unresolved place, rounding hides whether there is a root.

        negative: mask of the lanes in which the factor is below zero at the first end of the segment.
        floor: bound that is added to the error bounds of all values. It comes from the rounding of the segment's ends.
        active: mask of the lanes that search.
        on_start: mask of the lanes whose segment begins on the surface; None if there is no such lane.
        starts_at_root: mask of those among them in which this factor is the one that is zero there; None if on_start
            is None.
        tolerance: as in first_crossing.
        """
        # Values are divided by their error bound, in units of the unit roundoff, so that no product of values overflows
        # or underflows. `turn` also makes the polynomial positive at the first end.
        scale = roundoff(floor) / self.noise(1)
        turn = dr.mulsign(scale, dr.select(negative, type(scale)(-1), 1))
        polynomial = Univariate(*(x * turn for x in self.polynomial.c))

        def f(s: Any) -> Any:
            return self.value(s) * turn

        def noise(r: Any) -> Any:
            return (self.noise(r) + floor) * scale

        ends = self.segment.first, self.segment.last
        if self.factor.degree <= 2:
            root, s = isolate_by_formula(polynomial.c, noise, *ends, active)
            return root.exists, self._polish(f, polynomial, root, s), root.unresolved

        def accurate_bernstein(middle: Any, half: Any) -> tuple:
            b, error = self.accurate_bernstein(middle, half)
            return [x * turn for x in b], (error + floor) * scale

        root = isolate(polynomial.c, noise, accurate_bernstein, *ends, active, starts_at_root)
        least = roundoff(floor)
        low, high = dr.maximum(polynomial(root.low), least), dr.minimum(polynomial(root.high), -least)
        if on_start is None:
            return root.exists, refine(f, root, low, high, ends, None, tolerance), root.unresolved
        # If the segment starts on the surface, values near the start that are within rounding of zero count as
        # positive, because f counts as positive at the start.
        flat = dr.select(on_start & (root.low == ends[0]), (floor + self.error_at(ends[0])) * scale, 0)
        low = dr.select(flat > 0, flat, low)
        return root.exists, refine(f, root, low, high, ends, flat, tolerance), root.unresolved

    def accurate_bernstein(self, middle: Any, half: Any) -> tuple[list[Any], Any]:
        """(Bernstein coefficients on the interval [middle - half, middle + half], their error bound).

        The program itself is run on the interval, with running error analysis. So the bound is usually smaller than
        that of `noise`.
        """
        bounded = self._bounded(Univariate(dr.fma(middle, y, x), half * y) for x, y in self._lines())
        rounds = len(bounded.polynomial.c) * roundoff(middle)
        return to_bernstein(bounded.polynomial.c), bounded.error + rounds * bounded.size

    def error_at(self, s: Any) -> Any:
        """Error bound of `value(s)`."""
        return self._bounded(Univariate(dr.fma(s, y, x)) for x, y in self._lines()).error

    def _lines(self) -> Iterable:
        """Pairs (centre, axis) of arrays, one pair per coordinate."""
        return zip(self.segment.centre, self.segment.axis)

    def _bounded(self, axes: Iterable) -> BoundedPolynomial:
        """The factor as a polynomial in s, with its error bound.

        axes: the coordinates x, y, z as polynomials in s. The bound includes the rounding errors of the coordinates.
        """
        exact = (BoundedPolynomial(axis, 0) for axis in axes)
        rounded = tuple(BoundedPolynomial(x.polynomial, 2 * roundoff(x.size) * x.size) for x in exact)
        return interpret(self.factor.code, tuple(BoundedPolynomial(Univariate(x), 0) for x in self.constants), rounded)

    def starts_below(self, value: Any, is_noise: Any) -> Any:
        """Mask of the lanes in which the factor is below zero at the start of the segment, or just after the start.

        value: value of the factor at the start.
        is_noise: mask of the lanes in which the value is within rounding of zero. There, the sign of the first
            derivative that is not within rounding of zero decides.
        """
        segment, c = self.segment, list(self.polynomial.c)

        def leading(_: Any) -> tuple:
            d = len(c) - 1
            for i in range(d):
                for j in range(d - 1, i - 1, -1):
                    c[j] = dr.fma(segment.first, c[j + 1], c[j])
            error, length, first_certain = self.noise(1), segment.last - segment.first, value
            for k in range(d, 0, -1):
                first_certain = dr.select(dr.abs(c[k]) * length**k > error, c[k], first_certain)
            return (first_certain,)

        return dr.if_stmt((value,), is_noise, leading, lambda x: (x,), label="leading")[0] < 0

    def value(self, s: Any) -> Any:
        """The value of the factor at s, computed by its program from the coordinates of the point at s."""
        return interpret(self.factor.code, self.constants, self.segment.at(s))

    @staticmethod
    def _polish(f: Callable, polynomial: Univariate, root: IsolatedRoot, s: Any) -> Any:
        """The root s, improved by two Newton steps. A step that leaves the isolating interval is not taken.

        The formula for s loses digits if the surface is much smaller than its clip.
        """
        for _ in range(2):
            slope = polynomial.slope(s)
            stepped = s - f(s) / dr.select(slope == 0, dr.inf, slope)
            s = dr.select((stepped >= root.low) & (stepped <= root.high), stepped, s)
        return s


def on_chord(factor: Factor, constants: tuple, segment: ChordSegment) -> FactorOnChord:
    """The factor along the chord, with its polynomial in s."""
    axes = tuple(map(Univariate, segment.centre, segment.axis))
    return FactorOnChord(factor, constants, segment, interpret(factor.code, tuple(map(Univariate, constants)), axes))
