"""A factor of a polynomial along a chord: its values, their error bounds, and its first root."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any

import drjit as dr

from visray.polynomials import Factor, interpret
from visray.roots.isolation import IsolatedRoot, isolate, isolate_by_formula, to_bernstein
from visray.roots.number_types import BoundedPolynomial, Magnitude, Univariate, roundoff
from visray.roots.refinement import refine

# The error of a value along a chord is at most this many roundings of the sum of the sizes of its terms
# (tests/test_roots.py). It is a small number because roundings rarely all have the same sign.
NOISE = 4


@cache
def rounding_count(code: tuple) -> float:
    """Bound on the error of a program's value, in roundings of the sum of the sizes of its terms.

    It grows in powers, because repeated squaring gives all their roundings the same sign.
    """
    counts: list[int] = []
    for name, *at in code:
        inner = (
            1 if name in ("constant", "axis") else max(counts[i] for i in (at[:1] if name in ("pow", "neg") else at))
        )
        counts.append(inner * at[1] if name == "pow" else inner)
    return max(NOISE, counts[-1] / 2)


def value_error(factor: Factor, constants: tuple, reach: Iterable) -> Any:
    """Error bound of a factor's values at points whose coordinates are at most `reach` in size, an entry per axis."""
    size = interpret(factor.code, [Magnitude(dr.abs(x)) for x in constants], tuple(map(Magnitude, reach))).x
    return rounding_count(factor.code) * roundoff(size) * size


@dataclass(frozen=True)
class ChordSegment:
    """A segment of a chord: the points centre + s axis for s from `first` to `last`, within -1 <= s <= 1.

    centre, axis: coordinates of the middle of the chord and of half its vector, an array per coordinate.
    middle, half: the point at s has the distance middle + half s along the ray.
    first, last: ends of the segment.
    begin: distance of the first end along the ray.
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
        """The segment of a ray between the distances begin and end. chord: distances where the ray meets its clip.

        s = 0 is the middle of the chord and not that of the segment. Most surfaces, and the centres of their clips, are
        near it, so coefficients and rounding are smallest where it matters.
        """
        middle, half = 0.5 * (chord[0] + chord[1]), 0.5 * (chord[1] - chord[0])
        centre, axis = tuple(dr.fma(middle, y, x) for x, y in zip(o, d)), tuple(half * y for y in d)
        first, last = ((t - middle) / half for t in (begin, end))
        return ChordSegment(centre, axis, middle, half, dr.maximum(first, -1), dr.minimum(last, 1), begin)

    def at(self, s: Any) -> list[Any]:
        """Coordinates of the point at s."""
        return [dr.fma(s, y, x) for x, y in zip(self.centre, self.axis)]

    def distance(self, s: Any) -> Any:
        """Distance of the point at s along the ray."""
        return dr.fma(self.half, s, self.middle)

    def is_after_begin(self, s: Any) -> Any:
        """Whether the point at s lies beyond the first end of the segment."""
        return self.distance(s) > self.begin


@dataclass(frozen=True)
class FactorOnChord:
    """A factor of a polynomial along a chord.

    constants: values of the program's constants.
    polynomial: the factor as a polynomial in s.
    """

    factor: Factor
    constants: tuple
    segment: ChordSegment
    polynomial: Univariate

    def noise(self, r: Any) -> Any:
        """Error bound of the values of `polynomial` for |s| <= r."""
        reach = (dr.fma(dr.abs(y), r, dr.abs(x)) for x, y in zip(self.segment.centre, self.segment.axis))
        return value_error(self.factor, self.constants, reach)

    def first_root(self, negative: Any, floor: Any, active: Any, on_start: Any, tolerance: Any) -> tuple[Any, Any, Any]:
        """The first root on the segment: (whether there is one, s, number of unresolved places).

        negative: the factor is below zero at the first end.
        floor: additional error bound of all values, from the rounding of the segment's ends.
        on_start: the segment begins on the surface, or None.
        tolerance: as in first_crossing.
        """
        # Values are divided by their rounding noise, so that products of them stay in the range of a double.
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

        root = isolate(polynomial.c, noise, accurate_bernstein, *ends, active)
        least = roundoff(floor)
        low, high = dr.maximum(polynomial(root.low), least), dr.minimum(polynomial(root.high), -least)
        if on_start is None:
            return root.exists, refine(f, root, low, high, ends, None, tolerance), root.unresolved
        # Near a start on the surface, a value within noise counts as positive: it has the sign that the segment starts
        # with.
        flat = dr.select(on_start & (root.low == ends[0]), (floor + self.error_at(ends[0])) * scale, 0)
        low = dr.select(flat > 0, flat, low)
        return root.exists, refine(f, root, low, high, ends, flat, tolerance), root.unresolved

    def accurate_bernstein(self, middle: Any, half: Any) -> tuple[list[Any], Any]:
        """Bernstein coefficients on [middle - half, middle + half] and their error bound, by running the program on
        that interval."""
        bounded = self._bounded(Univariate(dr.fma(middle, y, x), half * y) for x, y in self._lines())
        rounds = len(bounded.polynomial.c) * roundoff(middle)
        return to_bernstein(bounded.polynomial.c), bounded.error + rounds * bounded.size

    def error_at(self, s: Any) -> Any:
        """Error bound of `value(s)`."""
        return self._bounded(Univariate(dr.fma(s, y, x)) for x, y in self._lines()).error

    def _lines(self) -> Iterable:
        """Pairs (centre, axis), one per coordinate."""
        return zip(self.segment.centre, self.segment.axis)

    def _bounded(self, axes: Iterable) -> BoundedPolynomial:
        """The factor with its error bound, where the coordinates are polynomials in s. The coordinates are rounded
        too."""
        exact = (BoundedPolynomial(axis, 0) for axis in axes)
        rounded = tuple(BoundedPolynomial(x.polynomial, 2 * roundoff(x.size) * x.size) for x in exact)
        return interpret(self.factor.code, tuple(BoundedPolynomial(Univariate(x), 0) for x in self.constants), rounded)

    def starts_below(self, value: Any, is_noise: Any) -> Any:
        """Whether the factor is below zero at the start of the segment.

        value: its value there.
        is_noise: the value is within rounding of zero. Then the sign is that of the first derivative that is not.
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
        """The value at s by the factor's program, as the polynomial was written."""
        return interpret(self.factor.code, self.constants, self.segment.at(s))

    @staticmethod
    def _polish(f: Callable, polynomial: Univariate, root: IsolatedRoot, s: Any) -> Any:
        """Two Newton steps from a root by formula, which has lost digits if the surface is small in its clip."""
        for _ in range(2):
            slope = polynomial.slope(s)
            stepped = s - f(s) / dr.select(slope == 0, dr.inf, slope)
            s = dr.select((stepped >= root.low) & (stepped <= root.high), stepped, s)
        return s


def on_chord(factor: Factor, constants: tuple, segment: ChordSegment) -> FactorOnChord:
    """The factor along the chord, with its polynomial in s."""
    axes = tuple(map(Univariate, segment.centre, segment.axis))
    return FactorOnChord(factor, constants, segment, interpret(factor.code, tuple(map(Univariate, constants)), axes))
