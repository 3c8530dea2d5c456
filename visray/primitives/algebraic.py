"""Algebraic surfaces: the points of a clip where polynomials are zero. What `polynomial` and the kinds that are defined
by one share."""

import cmath
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import drjit as dr
import numpy as np

from visray import polynomials, roots
from visray.geometry import Frame, Inverse, Similarity, SimilarityInverse
from visray.polynomials import Compiled, Program
from visray.primitives.clips import Clip
from visray.primitives.primitive import Bounds, Primitive
from visray.quantities import Arrays, stacked
from visray.ray import Crossing, KnownEnds, Ray
from visray.roots import ChordSegment


@dataclass(frozen=True)
class PolynomialRows:
    """Polynomials of one form as arrays, an entry each: the form's slots, the parameters, the slopes of the slots by
    each of these, the tolerances (None: of none of them), and the clips."""

    slots: tuple
    parameters: tuple
    slopes: tuple
    tolerance: Any
    clip: Any

    @classmethod
    def of(cls, a: Arrays, things: list) -> "PolynomialRows":
        """The numbers of polynomials (polynomial.py) that share their code."""
        built, known, limits = (
            [x.compiled() for x in things],
            [x.parameters for x in things],
            [x.clip_volume() for x in things],
        )
        slopes = [[_slopes(b, k, name) for name in k] for b, k in zip(built, known)]

        def put(values: list) -> tuple:
            return tuple(a.put(a.D, column) for column in np.array(values, float).T)

        return cls(
            slots=put([b.values for b in built]),
            parameters=put([list(k.values()) for k in known]),
            slopes=tuple(put([s[i] for s in slopes]) for i in range(len(known[0]))),
            tolerance=a.put(a.D, np.array([x.tolerance for x in things], float)) if things[0].kind.loose else None,
            clip=stacked(a, type(limits[0]), limits),
        )

    def placed(self, outer: Frame | None) -> "PlacedPolynomial":
        """Where they are, and the slots with derivatives by the parameters."""
        o = self.clip.frame().o
        return self.within(Similarity(0 * o.x + 1, o).then(outer))

    def within(self, frame: Frame | Similarity, shape: tuple = ()) -> "PlacedPolynomial":
        """As `placed`, in a frame about the clip's centre."""
        slots = self.slots
        for p, slopes in zip(self.parameters, self.slopes):
            if dr.grad_enabled(p):
                # Zero, with the slope that a slot has.
                slots = tuple(x + k * (p - dr.detach(p)) for x, k in zip(slots, slopes))
        return PlacedPolynomial(frame.inverse(), slots, self.tolerance, tuple(map(dr.rcp, self.clip.half())), shape)

    def bounds(self, outer: Frame | None) -> Bounds:
        """A box and a ball in the world that hold the clip."""
        return self.clip.bounds(outer)


@dataclass(frozen=True)
class PlacedPolynomial:
    """A polynomial in the world: the way into coordinates about the clip's centre, the slots, the tolerance, and 1
    over the clip's half extents; shape: as of a kind that is defined by one."""

    inverse: Inverse | SimilarityInverse
    slots: tuple
    tolerance: Any
    scale: tuple
    shape: tuple = ()

    def unit(self, q: Any) -> Any:
        """A vector about the clip's centre in coordinates of the canonical clip."""
        return type(q)(*(x * s for x, s in zip(q, self.scale)))


@dataclass(frozen=True)
class SeenPolynomial:
    """A polynomial as seen from an origin, which is in coordinates about the clip's centre."""

    placed: PlacedPolynomial
    o: Any


class Algebraic(Primitive):
    """A surface whose crossings are searched for, with a certificate.

    Of each kind, whose objects have polynomials of one form and clips of one kind:
    program: what is compiled; solid: the kind of the clip; loose: whether crossings have a tolerance.
    clipped: whether the clip may cut the surface; what is closed then has caps, which are the last of its parts.
    """

    finds_roots = True
    clipped = True
    # Without types: they would be fields.
    program = solid = loose = None

    @classmethod
    def kind_of(
        cls, program: Program, closed: bool, clip: type[Clip], parameters: int, loose: bool
    ) -> type["Algebraic"]:
        """The kind of the objects that share their code: so form, closed, clip and number of parameters."""
        return _kind(cls, program, closed, clip, parameters, loose)

    @staticmethod
    def seen(placed: PlacedPolynomial, o: Any) -> SeenPolynomial:
        return SeenPolynomial(placed, placed.inverse.point(o))

    @classmethod
    def crossing(cls, seen: SeenPolynomial, ray: Ray, begin: Any, end: Any, known: KnownEnds) -> Crossing:
        d, placed, count = seen.placed.inverse.vector(ray.d), seen.placed, len(cls.program.factors)
        # The line in the clip, and what of it lies between the ends. Lanes that have nothing there take part with a
        # piece of their own, so that all in them is finite.
        unit, end = placed.unit(d), dr.inf if end is None else end
        line = cls.solid.interval(placed.unit(seen.o), unit, dr.squared_norm(unit), ())
        first, last = dr.select(line.near > begin, line.near, begin), dr.select(line.far < end, line.far, end)
        there = (line.near <= line.far) & (first < last)
        first, last, *chord = (
            dr.select(there, t, x) for t, x in ((first, 0), (last, 0), (line.near, -1), (line.far, 1))
        )
        starts_in, on_clip, known_sides = line.near <= begin, None, known
        if known.on_start is not None:
            # Who leaves the surface is in the clip, whatever rounding says.
            starts_in |= known.on_start
            if cls.closed and cls.clipped:
                capped = known.on_start & cls._on_cap(placed, seen.o, known.start_part)
                # A cap is convex: who leaves it outwards does not come back.
                there &= ~(capped & ~known.inside)
                known_sides = replace(known, on_start=known.on_start & ~capped)
        way = ChordSegment.of(seen.o, d, chord, first, last)
        c = roots.first_crossing(cls.program, placed.slots, way, there, known_sides, placed.tolerance)
        if not (cls.closed and cls.clipped):
            return c
        # A solid is entered through its cap, or left through it; but not where the way ends on it.
        leaves = line.far < end
        if known.on_end is not None:
            q = seen.o + dr.select(known.on_end, end, 0) * d
            on_clip = known.on_end & cls._on_cap(placed, q, known.end_part)
            leaves &= ~on_clip
        cap = dr.select(starts_in, dr.select(leaves, line.far, dr.inf), line.near)
        through = there & ~c.enters & (~starts_in | ~c.met)
        # Before its cap the ray is outside, and so it is where it runs into nothing.
        enters = dr.select(through, ~starts_in, c.enters)
        u = dr.uint32_array_t(c.t)
        face = u(0) if line.near_part is None else dr.select(starts_in, line.far_part, line.near_part)
        part = dr.select(through, face + count, u(0) if c.part is None else c.part)
        t = dr.select(through, cap, c.t)
        return Crossing(t < dr.inf, t, part, enters, c.unresolved)

    @classmethod
    def _on_cap(cls, placed: PlacedPolynomial, q: Any, part: Any) -> Any:
        """Whether a point of the surface is on a cap: by its part, or where that is not known, by what is nearer."""
        return cls._surface(placed, q, None)[2] if part is None else part >= len(cls.program.factors)

    @classmethod
    def _surface(cls, placed: PlacedPolynomial, q: Any, part: Any) -> tuple[Any, Any, Any]:
        """Signed distance and normal of a part of the surface, or of the nearest; and whether the clip is nearer than
        it, or is that part. Of an open surface the clip is no part; its points are only as near as the clip."""
        count = len(cls.program.factors)
        f, g = roots.signed_distance(
            cls.program, placed.slots, q, DIFFERENCE * dr.rcp(placed.scale[0]), part if count > 1 else None
        )
        if cls.closed and not cls.clipped:
            return f, g, None
        unit = placed.unit(q)
        face = None
        if cls.solid.parts > 1:
            nearest = cls.solid.part_at(unit, ())
            face = nearest if part is None else dr.select(part >= count, part - count, nearest)
        cap, normal = cls.solid.depth(unit, face, ())
        normal = placed.unit(normal)
        inverse = dr.rcp(dr.norm(normal))
        cap = cap * inverse
        on = cap > (f if cls.closed else dr.abs(f))
        if cls.closed and part is not None:
            on = part >= count
        f = dr.select(on, cap, f)
        return f, dr.select(on, normal * inverse, g) if cls.closed else g, on

    @classmethod
    def surface_at(cls, placed: PlacedPolynomial, p: Any, part: Any = None) -> tuple[Any, Any]:
        f, g, _ = cls._surface(placed, placed.inverse.point(p), part)
        g = placed.inverse.normal(g)
        inverse = dr.rcp(dr.norm(g))
        return f * dr.detach(inverse), g * inverse

    @classmethod
    def has_normal(cls, placed: PlacedPolynomial, p: Any) -> Any:
        return roots.has_normal(cls.program, placed.slots, placed.inverse.point(p), dr.rcp(placed.scale[0]))


# Differences of this share of the clip stand in for a gradient that is zero: the root of a root of the rounding, as
# where they are needed the surface has a term of third order.
DIFFERENCE = 2.0**-13


@cache
def _kind(
    base: type[Algebraic], program: Program, closed: bool, clip: type[Clip], parameters: int, loose: bool
) -> type[Algebraic]:
    """The objects of a class that share their code. `parameters`: how many there are is structure."""
    count, caps = len(program.factors), closed and base.clipped
    facts = {
        "program": program,
        "closed": closed,
        "solid": clip.solid,
        "loose": loose,
        "uses_part": caps,
        "parts": count + clip.solid.parts if caps else count,
        "max_crossings": 2 * caps + sum(f.degree for f in program.factors),
    }
    return type(base.__name__, (base,), facts)


def _slopes(built: Compiled, known: dict[str, float], name: str) -> list[float]:
    """The derivatives of the slots by a parameter, exact to rounding: of an analytic function, the imaginary part after
    a step too small to change the real one."""
    tiny = 1e-200
    moved = {k: complex(v, tiny if k == name else 0) for k, v in known.items()}
    return [_moved(c, moved).imag / tiny for c in built.constants]


def _moved(constant: Any, parameters: dict[str, complex]) -> complex:
    return complex(polynomials.evaluate(constant, parameters.__getitem__, lambda x: complex(float(x)), cmath.sqrt))
