"""Where a polynomial first crosses zero along a chord, with proof.

The chord is l + s e for s from -1 to 1. A polynomial surface is evaluated along it by its written structure, with
polynomials in s for numbers: so the coefficients are as good as the structure, and cost less than samples of it.

The march walks along the chord. On [a, a + w] the coefficients in Bernstein's basis bound the polynomial: if none of
them has the other sign, nothing is crossed there; if their sign changes once and the last is certain, it is crossed
exactly once. A coefficient within `noise` of zero counts as of the sign carried along, which is never computed anew:
so no crossing at the end of an interval is lost or found twice. Source: Collins and Akritas 1976; Lane and Riesenfeld
1981; Eigenwillig et al. 2005. What is isolated is refined on the surface's own structure (Chandrupatla 1997).
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import drjit as dr

from visray.geometry import UNIT_ROUNDOFF
from visray.polynomials import Factor, Form, interpret

# No root is looked for within a narrower part of the chord: there the coefficients are all noise.
NARROWEST = 2.0**-40
# An end that is not confirmed by the surface's structure is moved by at least this part of the chord. Where it is
# needed (a triple root), the two differ by the cube root of the rounding.
WIDENED = 3e-4
# A value along a chord is off by no more than so many roundings of the sizes of all that was added up to it.
NOISE = 4
# A gradient that is shorter has lost its digits to underflow, as at a point of high multiplicity.
SMALLEST = 2.0**-500


class Line:
    """A polynomial in s, the place along a chord: its coefficients from the constant one up."""

    def __init__(self, *c: Any):
        self.c = c

    def __add__(self, other: "Line") -> "Line":
        n = min(len(self.c), len(other.c))
        return Line(*(x + y for x, y in zip(self.c, other.c)), *(self.c[n:] or other.c[n:]))

    def __sub__(self, other: "Line") -> "Line":
        return self + -other

    def __neg__(self) -> "Line":
        return Line(*(-x for x in self.c))

    def __mul__(self, other: "Line") -> "Line":
        if self is other:
            return self._squared()
        found: list[Any] = [None] * (len(self.c) + len(other.c) - 1)
        for i, x in enumerate(self.c):
            for j, y in enumerate(other.c):
                found[i + j] = x * y if found[i + j] is None else dr.fma(x, y, found[i + j])
        return Line(*found)

    def _squared(self) -> "Line":
        c, n, found = self.c, len(self.c), []
        for k in range(2 * n - 1):
            pairs = [(i, k - i) for i in range(max(0, k - n + 1), (k + 1) // 2)]
            total = None
            for i, j in pairs:
                total = c[i] * c[j] if total is None else dr.fma(c[i], c[j], total)
            if total is not None:
                total = total + total
            if k % 2 == 0:
                half = c[k // 2]
                total = half * half if total is None else dr.fma(half, half, total)
            found.append(total)
        return Line(*found)

    def __call__(self, s: Any) -> Any:
        total = self.c[-1]
        for x in self.c[-2::-1]:
            total = dr.fma(total, s, x)
        return total

    def slope(self, s: Any) -> Any:
        """The derivative by s."""
        return Line(*(k * x for k, x in enumerate(self.c[1:], 1)))(s)


class Size:
    """A bound of the sizes of all that is added up to a number: what its rounding is relative to."""

    def __init__(self, x: Any):
        self.x = x

    def __add__(self, other: "Size") -> "Size":
        return Size(self.x + other.x)

    __sub__ = __add__

    def __neg__(self) -> "Size":
        return self

    def __mul__(self, other: "Size") -> "Size":
        return Size(self.x * other.x)


class Slope:
    """A number with its derivatives by x, y and z, None where they are zero by structure."""

    def __init__(self, x: Any, slopes: tuple):
        self.x, self.slopes = x, slopes

    def __add__(self, other: "Slope") -> "Slope":
        return Slope(self.x + other.x, tuple(map(_sum, self.slopes, other.slopes)))

    def __sub__(self, other: "Slope") -> "Slope":
        return Slope(self.x - other.x, tuple(_sum(p, None if q is None else -q) for p, q in self._beside(other)))

    def __neg__(self) -> "Slope":
        return Slope(-self.x, tuple(None if p is None else -p for p in self.slopes))

    def __mul__(self, other: "Slope") -> "Slope":
        if self is other:
            return Slope(self.x * self.x, tuple(None if p is None else 2 * self.x * p for p in self.slopes))
        parts = (_sum(_product(p, other.x), _product(q, self.x)) for p, q in self._beside(other))
        return Slope(self.x * other.x, tuple(parts))

    def _beside(self, other: "Slope") -> zip:
        return zip(self.slopes, other.slopes)


def _sum(p: Any, q: Any) -> Any:
    return q if p is None else p if q is None else p + q


def _product(p: Any, x: Any) -> Any:
    return None if p is None else p * x


@dataclass(frozen=True)
class Isolated:
    """Parts [low, high] of chords in which a polynomial crosses zero exactly once, first of all; `found`: lanes that
    have one. unresolved: how many parts were left, as too narrow, without knowing."""

    low: Any
    high: Any
    found: Any
    unresolved: Any


def roundoff(x: Any) -> float:
    """The unit roundoff of an array's numbers: of double, but on backends that have none."""
    return UNIT_ROUNDOFF["double" if dr.type_v(x) == dr.VarType.Float64 else "single"]


@cache
def conversion(d: int) -> list[list[float]]:
    """The coefficients in Bernstein's basis on [-1, 1] of each power s^k up to degree d. Shape: (d + 1, d + 1)."""
    comb = math.comb

    def entry(i: int, k: int) -> Fraction:
        # s = 2 u - 1 with u from 0 to 1, and u^j has the coefficients C(i, j) / C(d, j).
        return sum(Fraction(comb(k, j) * 2**j * comb(i, j) * (-1) ** (k - j), comb(d, j)) for j in range(k + 1))

    return [[float(entry(i, k)) for k in range(d + 1)] for i in range(d + 1)]


def bernstein(c: tuple, middle: Any, half: Any) -> list[Any]:
    """The coefficients in Bernstein's basis on [middle - half, middle + half] of the polynomial with coefficients `c`.

    Error: some roundings of the sum of the sizes of c, as no entry of `conversion` is above 1 and the interval is in
    [-1, 1] (tests/test_roots.py). From the interval's end, as usual, it would be 3^d times as much.
    """
    d, c = len(c) - 1, list(c)
    for i in range(d):
        for j in range(d - 1, i - 1, -1):
            c[j] = dr.fma(middle, c[j + 1], c[j])
    power = half
    for k in range(1, d + 1):
        c[k] = c[k] * power
        power = power * half
    found: list[Any] = [None] * (d + 1)
    for i in range(d // 2 + 1):
        row = conversion(d)[i]
        even, odd = c[0], row[1] * c[1]
        for k in range(2, d + 1, 2):
            even = dr.fma(row[k], c[k], even) if row[k] else even
        for k in range(3, d + 1, 2):
            odd = dr.fma(row[k], c[k], odd) if row[k] else odd
        # The other half of the rows differs in the sign of the odd powers.
        found[i], found[d - i] = even + odd, even - odd
    return found


def isolated(c: tuple, noise: Callable, first: Any, last: Any, active: Any) -> Isolated:
    """The first crossing from above zero to below on [first, last], for a polynomial that counts as positive at first.

    noise(r): how far off its values are for |s| <= r. Where its sign changes more than once, the first part of the
    interval is left behind, up to which the coefficients' hull stays above zero, and the rest halved. So is an interval
    with coefficients that could be below zero but for the noise, where it is less in the half that is nearer to 0.
    """
    d, n = len(c) - 1, max(map(dr.width, c))
    number, count = type(c[0]), dr.uint32_array_t(type(c[0]))

    def step(a: Any, w: Any, going: Any, found: Any, unresolved: Any) -> tuple:
        half = 0.5 * w
        middle = a + half
        b, off = bernstein(c, middle, half), noise(dr.abs(middle) + half)
        changes, below, least = count(0), type(going)(False), b[0]
        for x in b:
            changed = dr.select(below, x > off, x < -off)
            below ^= changed
            changes += dr.select(changed, count(1), 0)
            least = dr.select(x < least, x, least)
        falls = b[d] < -off
        narrow = w <= NARROWEST
        take = ((changes == 1) | narrow) & falls
        blurred = (changes == 0) & (least < 0) & ~narrow
        blurred = dr.if_stmt(
            (blurred,), blurred, lambda _: (noise(dr.abs(middle)) < 0.5 * off,), lambda same: (same,), label="blurred"
        )[0]
        leave = ((changes == 0) & ~blurred) | (narrow & ~falls)
        steepest = (b[1] - b[0]) * d
        for i in range(2, d + 1):
            slope = (b[i] - b[0]) * (d / i)
            steepest = dr.select(slope < steepest, slope, steepest)
        # Up to there a straight line below all coefficients stays above zero.
        clear = dr.select((b[0] > off) & ~blurred, -b[0] / steepest, 0)
        end = a + w
        nearer = dr.select(leave, end, dr.fma(clear, w, a))
        rest = end - nearer
        left = last - end
        w = dr.select(leave, dr.select(2 * w < left, 2 * w, left), dr.select(take, rest, 0.5 * rest))
        unresolved += dr.select(narrow & (changes > 0) & ~take, count(1), 0)
        return nearer, w, going & ~take & (w > 0), found | take, unresolved

    no = dr.full(dr.mask_t(c[0]), False, n)
    start = first + dr.zeros(number, n), last - first + dr.zeros(number, n), no | active, no, dr.zeros(count, n)
    a, w, _, found, unresolved = dr.while_loop(start, lambda a, w, going, *_: going, step, label="march")
    return Isolated(a, a + w, found, unresolved)


def isolated_by_formula(c: tuple, noise: Any, first: Any, last: Any, active: Any) -> tuple[Isolated, Any]:
    """As isolated, and the crossing itself, for degrees 1 and 2: up to the extremum and beyond it there is one root."""
    zero = 0 * c[0]
    flat = zero if len(c) < 3 else c[2]
    extremum = -0.5 * c[1] / flat
    extremum = dr.select((flat > 0) & (extremum > first) & (extremum < last), extremum, last)
    down, end = Line(*c)(extremum) < -noise, Line(*c)(last) < -noise
    # A parabola that opens downwards falls after its extremum, one that opens upwards before it.
    root = dr.sqrt(dr.maximum(c[1] * c[1] - 4 * flat * c[0], 0))
    q = -0.5 * (c[1] + dr.copysign(root, c[1]))
    one, two = dr.select(q == 0, zero, c[0] / q), dr.select(flat == 0, dr.inf, q / flat)
    low, high = dr.select(one < two, one, two), dr.select(one < two, two, one)
    s = dr.select(flat == 0, one, dr.select(flat > 0, low, high))
    found = active & (down | end)
    s = dr.select(found, dr.maximum(dr.minimum(s, last), first), 0)
    none = dr.zeros(dr.uint32_array_t(type(zero)))
    return Isolated(first + zero, dr.select(down, extremum, last), found, none), s


def refined(f: Callable, part: Isolated, at_low: Any, at_high: Any, bounds: tuple, flat: Any = None) -> Any:
    """Where f, which counts as above zero at the beginning of each part and below at its end, is zero, to the last
    digit of s: by inverse quadratic interpolation where that is certain to be good, by halves elsewhere.

    at_low, at_high: what counts as its values there. f is of order 1 or less. bounds: no end is moved beyond these.
    flat: what is no larger in size, and so of no sign, counts as above zero, as long as nothing larger has been found.
    Source: Chandrupatla 1997, with one division.
    """
    ulp = 2 * roundoff(part.low)

    def step(a: Any, b: Any, fa: Any, fb: Any, x: Any, going: Any) -> tuple:
        # a is the newest point, x the next one; the root lies between a and b.
        fx = f(x)
        if flat is not None:
            above = dr.select(fa > 0, fa, fb)
            fx = dr.select((above <= flat) & (dr.abs(fx) <= flat), flat, fx)
        same = (fx < 0) == (fa < 0)
        c, fc = dr.select(same, a, b), dr.select(same, fa, fb)
        b, fb = dr.select(same, b, a), dr.select(same, fb, fa)
        a, fa = x, fx
        gap, ba, bc, ca = b - a, fb - fa, fb - fc, fc - fa
        least = 0.5 * ulp * (dr.abs(dr.select(dr.abs(fa) < dr.abs(fb), a, b)) + 0.5)
        size, far, square = dr.abs(gap), dr.abs(c - b), bc * bc
        good = (ba * ba * far < size * square) & (ca * ca * far < (far - size) * square) & (ca != 0)
        curve = dr.abs(fa * (fc * ca * gap - (c - a) * fb * ba) / (ba * bc * ca))
        onwards = dr.select(good, curve, 0.5 * size)
        onwards = dr.maximum(least, dr.minimum(size - least, onwards))
        return a, b, fa, fb, a + dr.copysign(onwards, gap), going & (2 * least < size) & (fx != 0)

    def between(low: Any, high: Any, active: Any) -> tuple:
        state = high, low, at_high, at_low, 0.5 * (low + high), active
        return dr.while_loop(state, lambda *state: state[-1], step, label="refine")[:4]

    a, b, fa, fb = between(part.low, part.high, part.found)
    # At an end f's sign is not that of the polynomial that was isolated: then that end is moved.
    first = part.found & (fa != 0) & (b == part.low)
    last = part.found & (fa != 0) & (b == part.high)
    more = dr.maximum(part.high - part.low, WIDENED)
    low = dr.select(first, dr.maximum(part.low - more, bounds[0]), part.low)
    high = dr.select(last, dr.minimum(part.high + more, bounds[1]), part.high)
    again = between(low, high, first | last)
    a, b, fa, fb = (dr.select(first | last, new, old) for new, old in zip(again, (a, b, fa, fb)))
    return dr.select(dr.abs(fa) < dr.abs(fb), a, b)


@dataclass(frozen=True)
class Way:
    """Parts of chords l + s e, s from -1 to 1 at the distance middle + half s: those from s = first to s = last."""

    l: tuple
    e: tuple
    middle: Any
    half: Any
    first: Any
    last: Any

    @staticmethod
    def of(o: Any, d: Any, chord: tuple, begin: Any, end: Any) -> "Way":
        """Rays between the distances begin and end, in the chord of their clip between two others.

        s counts from the middle of the chord, where most surfaces are, and their clips' centres; not from the middle of
        the way: coefficients and rounding are then as small as they can be where it matters.
        """
        middle, half = 0.5 * (chord[0] + chord[1]), 0.5 * (chord[1] - chord[0])
        l, e = tuple(dr.fma(middle, y, x) for x, y in zip(o, d)), tuple(half * y for y in d)
        first, last = ((t - middle) / half for t in (begin, end))
        return Way(l, e, middle, half, dr.maximum(first, -1), dr.minimum(last, 1))

    def at(self, s: Any) -> list[Any]:
        """The coordinates of a point."""
        return [dr.fma(s, y, x) for x, y in zip(self.l, self.e)]

    def distance(self, s: Any) -> Any:
        """How far along the ray a point is."""
        return dr.fma(self.half, s, self.middle)


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


def first_crossing(form: Form, slots: tuple, way: Way, active: Any, ends: Ends = Ends()) -> Crossing:
    """Where the way first crosses the surface of a form, with the values `slots`."""
    paths = [_path(f, slots, way) for f in form.factors]
    active = active & (way.first < way.last)
    at_start, at_end = ([p.value(s) for p in paths] for s in (way.first, way.last))
    # A way that begins within rounding of a zero begins on the side that it runs to.
    near_zero = [dr.abs(x) <= p.off_at_start() for x, p in zip(at_start, paths)]
    signs = [dr.select(zero, p.line.slope(way.first), x) < 0 for zero, x, p in zip(near_zero, at_start, paths)]
    floors = [0 * x for x in at_start]
    if ends.on_start is not None:
        near = _nearest(at_start, paths)
        # All of the value there is rounding, that of the point itself too.
        floors = [dr.select(ends.on_start & n, 2 * dr.abs(x), f) for n, x, f in zip(near, at_start, floors)]
    if ends.on_end is not None:
        last = _nearest(at_end, paths)
        floors = [dr.select(ends.on_end & n, dr.maximum(f, 2 * dr.abs(x)), f) for n, x, f in zip(last, at_end, floors)]
    negative = _odd(signs, form.sign < 0)
    if ends.on_start is not None:
        wrong = ends.on_start & (negative != ends.negative)
        signs = [s ^ (wrong & n) for s, n in zip(signs, near)]
        negative = negative ^ wrong
    found, t, unresolved = active & ~active, dr.inf, 0
    for path, sign, floor in zip(paths, signs, floors):
        there, s, left = path.first(sign, floor, active, ends.on_start)
        distance = dr.select(there, way.distance(s), dr.inf)
        t = distance if len(paths) == 1 else dr.minimum(t, distance)
        found, unresolved = found | there, unresolved + left
    return Crossing(t, found, negative, unresolved)


def value(form: Form, slots: tuple, q: Any) -> Any:
    """The product of a form's factors at a point: below zero inside of it."""
    total = form.sign
    for factor in form.factors:
        total = total * interpret(factor.code, slots, tuple(q))
    return total


def _odd(signs: list, flipped: bool) -> Any:
    """Whether an odd number of signs is set."""
    total = signs[0] ^ flipped
    for sign in signs[1:]:
        total = total ^ sign
    return total


def _nearest(values: list, paths: list) -> list:
    """Which of several factors is the nearest to zero, as measured by its noise."""
    if len(values) == 1:
        return [True]
    sizes = [dr.abs(v) / p.noise(1) for v, p in zip(values, paths)]
    least = sizes[0]
    for size in sizes[1:]:
        least = dr.minimum(least, size)
    found, taken = [], least != least
    for size in sizes:
        found.append((size <= least) & ~taken)
        taken = taken | found[-1]
    return found


@dataclass(frozen=True)
class _Path:
    """A factor of a form along a way."""

    factor: Factor
    slots: tuple
    way: Way
    line: Line

    def noise(self, r: Any) -> Any:
        """How far off its values are for |s| <= r."""
        return self.off(dr.fma(dr.abs(y), r, dr.abs(x)) for x, y in zip(self.way.l, self.way.e))

    def off(self, reach: Iterable) -> Any:
        """How far off its values are where no coordinate is larger."""
        sizes = [Size(dr.abs(x)) for x in self.slots]
        size = interpret(self.factor.code, sizes, tuple(map(Size, reach))).x
        return NOISE * roundoff(size) * size

    def first(self, sign: Any, floor: Any, active: Any, on_start: Any) -> tuple[Any, Any, Any]:
        """Whether it is crossed, where, and how many parts are unresolved. sign: whether it begins below zero; floor:
        what is not above it is noise."""
        # All is relative to the sizes of what is added up, so that products of values stay within a double's range.
        scale = roundoff(floor) / self.noise(1)
        turn = dr.mulsign(scale, dr.select(sign, type(scale)(-1), 1))
        line = Line(*(x * turn for x in self.line.c))

        def f(s: Any) -> Any:
            return self.value(s) * turn

        def noise(r: Any) -> Any:
            return dr.maximum(self.noise(r), floor) * scale

        ends = self.way.first, self.way.last
        if self.factor.degree <= 2:
            part, s = isolated_by_formula(line.c, noise(dr.maximum(dr.abs(ends[0]), dr.abs(ends[1]))), *ends, active)
            return part.found, self._polished(f, line, part, s), part.unresolved
        part = isolated(line.c, noise, *ends, active)
        least = roundoff(floor)
        low, high = dr.maximum(line(part.low), least), dr.minimum(line(part.high), -least)
        if on_start is None:
            return part.found, refined(f, part, low, high, ends), part.unresolved
        # Near a start on the surface what is only noise counts as of the side that the way begins on.
        flat = dr.select(on_start & (part.low == ends[0]), dr.maximum(floor, self.off_at_start()) * scale, 0)
        return part.found, refined(f, part, dr.select(flat > 0, flat, low), high, ends, flat), part.unresolved

    def off_at_start(self) -> Any:
        """How far off the value by structure is where the way begins."""
        return self.off(map(dr.abs, self.way.at(self.way.first)))

    def value(self, s: Any) -> Any:
        """The factor by its structure."""
        return interpret(self.factor.code, self.slots, self.way.at(s))

    @staticmethod
    def _polished(f: Callable, line: Line, part: Isolated, s: Any) -> Any:
        """Two steps of Newton's from a root by formula, which lost digits if the surface is small in its clip."""
        for _ in range(2):
            slope = line.slope(s)
            moved = s - f(s) / dr.select(slope == 0, dr.inf, slope)
            s = dr.select((moved >= part.low) & (moved <= part.high), moved, s)
        return s


def _path(factor: Factor, slots: tuple, way: Way) -> _Path:
    line = interpret(factor.code, tuple(map(Line, slots)), tuple(map(Line, way.l, way.e)))
    return _Path(factor, slots, way, line)


def level(form: Form, slots: tuple, q: Any, step: Any) -> tuple[Any, Any]:
    """(f, g): the signed distance of points to the surface, to first order, and the unit normal g = df/dq there.

    Where all slopes are zero, at a singular point, the normal is that of differences over `step`.
    """
    axes = tuple(Slope(x, tuple(x * 0 + 1 if i == j else None for j in range(3))) for i, x in enumerate(q))
    found = []
    for factor in form.factors:
        s = interpret(factor.code, tuple(Slope(x, (None,) * 3) for x in slots), axes)
        g = type(q)(*(0 * s.x if p is None else p for p in s.slopes))
        found.append(_unit(_Path(factor, slots, None, None), q, step, s.x, g))
    f, g = found[0]
    others = type(f)(-1 if form.sign < 0 else 1)
    for near, normal in found[1:]:
        nearer = dr.abs(near) < dr.abs(f)
        others = dr.mulsign(others, dr.select(nearer, f, near))
        f, g = dr.select(nearer, near, f), dr.select(nearer, normal, g)
    return dr.mulsign(f, others), type(q)(*(dr.mulsign(x, others) for x in g))


def _unit(path: "_Path", q: Any, step: Any, f: Any, g: Any) -> tuple[Any, Any]:
    """A function and its gradient, both over the gradient's length. Where that is none, the function is zero if its
    value is only noise, and else nowhere near zero."""
    length = dr.norm(g)
    flat = ~(dr.detach(length) > SMALLEST)

    def differences(*_: Any) -> tuple:
        p, found = dr.detach(q), []
        for i in range(3):
            sides = [[x + (sign * step if i == j else 0) for j, x in enumerate(p)] for sign in (1, -1)]
            high, low = (interpret(path.factor.code, dr.detach(path.slots), side) for side in sides)
            found.append(high - low)
        longest = dr.maximum(dr.maximum(dr.abs(found[0]), dr.abs(found[1])), dr.abs(found[2]))
        # At a point that is a centre of symmetry they are all zero: then there is no normal, and this is one.
        found = [dr.select(longest > 0, x / longest, other) for x, other in zip(found, (0, 0, 1))]
        far = dr.select(dr.abs(f) <= path.off(map(dr.abs, p)), 0, dr.copysign(dr.inf, f))
        return dr.normalize(type(p)(*found)), dr.detach(far)

    n = max(dr.width(q), dr.width(f))
    none = dr.zeros(type(q), n), dr.zeros(type(f), n)
    normal, far = dr.if_stmt(none, flat, differences, lambda *same: same, label="singular")
    inverse = 1 / dr.select(flat, 1, length)
    return dr.select(flat, far, f * dr.detach(inverse)), dr.select(flat, normal, g * inverse)
