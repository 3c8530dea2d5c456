"""Polynomial surfaces: f(x, y, z) = 0 of any degree, within a clip."""

import cmath
import re
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cache
from typing import Annotated, Any, Literal

import drjit as dr
import numpy as np
from pydantic import Field

from visray import polynomials, roots
from visray.geometry import Frame, Inverse, Similarity, SimilarityInverse
from visray.polynomials import Built, Form, Wrong
from visray.primitives.clips import Ball, Block, Clip
from visray.primitives.primitive import Bounds, Primitive, scalars
from visray.primitives.sphere import globe
from visray.quantities import Arrays, Name, Real, stacked
from visray.ray import Crossing, KnownEnds, Ray
from visray.roots import Way
from visray.surfaces import CLASSICS


@dataclass(frozen=True)
class Rows:
    """Polynomials of one form as arrays, an entry each: the form's slots, the parameters, the slopes of the slots by
    each of these, the tolerances (None: of none of them), and the clips."""

    slots: tuple
    parameters: tuple
    slopes: tuple
    tolerance: Any
    clip: Any

    def placed(self, outer: Frame | None) -> "PlacedPolynomial":
        """Where they are, and the slots with derivatives by the parameters."""
        slots, o = self.slots, self.clip.frame().o
        for p, slopes in zip(self.parameters, self.slopes):
            if dr.grad_enabled(p):
                # Zero, with the slope that a slot has.
                slots = tuple(x + k * (p - dr.detach(p)) for x, k in zip(slots, slopes))
        inverse = Similarity(0 * o.x + 1, o).then(outer).inverse()
        return PlacedPolynomial(inverse, slots, self.tolerance, tuple(map(dr.rcp, self.clip.half())))

    def bounds(self, outer: Frame | None) -> Bounds:
        """A box and a ball in the world that hold the clip."""
        return self.clip.bounds(outer)


@dataclass(frozen=True)
class PlacedPolynomial:
    """A polynomial in the world: the way into coordinates about the clip's centre, the slots, the tolerance, and 1
    over the clip's half extents."""

    inverse: Inverse | SimilarityInverse
    slots: tuple
    tolerance: Any
    scale: tuple

    def unit(self, q: Any) -> Any:
        """A vector about the clip's centre in coordinates of the canonical clip."""
        return type(q)(*(x * s for x, s in zip(q, self.scale)))


@dataclass(frozen=True)
class SeenPolynomial:
    """A polynomial as seen from an origin, which is in coordinates about the clip's centre."""

    placed: PlacedPolynomial
    o: Any


@dataclass(frozen=True, kw_only=True)
class Polynomial(Primitive):
    """All points with f(x, y, z) = 0 in the clip. Written in one of three ways: an `expression` such as
    "x^2 + y^2 - z^2 - 1", with + - * / ^, numbers, pi, phi, sqrt(number) and the `parameters`; the list `monomis` of
    the original VisRayTrace; or the name of a known `surface`.

    `ends` says whether the surface is open where it is cut by the clip, or capped: a closed solid of all points of
    the clip where f < 0, as glass should be. Multiple factors count once.
    `tolerance`: how far off a crossing may be along its ray, as a share of half the ray's chord in the clip: so by no
    more than so many radii of the clip. 0: to the last digit. Degrees 1 and 2 have formulas, and no tolerance. It is
    for studies of what accuracy costs: it saves next to nothing.
    uv: as on a globe about the clip's centre.
    """

    type: Literal["polynomial"] = "polynomial"
    expression: Annotated[str, Field(strict=True)] | None = None
    monomis: tuple[Annotated[str, Field(strict=True)], ...] | None = None
    surface: Annotated[str, Field(strict=True)] | None = None
    parameters: dict[Name, Real] = field(default_factory=dict)
    clip: Annotated[Ball | Block, Field(discriminator="type")] | None = None
    ends: Literal["open", "capped"] = "open"
    tolerance: Annotated[Real, Field(ge=0, le=1)] = 0.0

    searched = True
    # Those of a kind, whose objects have one form and clips of one kind. Without types: they would be fields.
    form = solid = loose = None

    def __post_init__(self):
        if self.surface in CLASSICS:
            # Written out, so that each has an address.
            object.__setattr__(self, "parameters", CLASSICS[self.surface].parameters | self.parameters)

    @property
    def closed(self) -> bool:
        """Whether it is the surface of a solid."""
        return self.ends == "capped"

    @property
    def kind(self) -> Any:
        form = self.built().form
        # That there is a tolerance is structure, as code for it costs time even where it is 0; what it is is data.
        loose = self.tolerance > 0 and any(f.degree > 2 for f in form.factors)
        return _kind(form, self.closed, type(self.limits()), len(self.parameters), loose)

    def limits(self) -> Clip:
        """The clip, by default the named surface's own, or a ball of radius 5."""
        if self.clip is None and self.surface:
            classic = CLASSICS[self.surface]
            return Ball(center=classic.centre, radius=classic.radius)
        return self.clip or Ball()

    def written(self) -> str | tuple[str, ...]:
        """The polynomial as text."""
        if self.surface is not None:
            return CLASSICS[self.surface].expression
        return self.monomis if self.expression is None else self.expression

    def built(self) -> Built:
        """The polynomial, ready for kernels, in coordinates about the clip's centre."""
        o = scalars(self.limits()).frame().o
        return polynomials.build(self.written(), self.parameters, tuple(map(float, o)))

    def flaws(self) -> list[tuple[str, str]]:
        ways = [name for name in ("expression", "monomis", "surface") if getattr(self, name) is not None]
        if len(ways) != 1:
            several = f"{' and '.join(ways)} are written; keep one"
            return [(ways[-1] if ways else "expression", several if ways else "is missing; or monomis, or surface")]
        if self.surface is not None and self.surface not in CLASSICS:
            near = get_close_matches(self.surface, CLASSICS, 1)
            hint = f'did you mean "{near[0]}"? ' if near else ""
            return [("surface", f"unknown surface; {hint}(one of {', '.join(CLASSICS)})")]
        if wrong := [("clip", text) for _, text in self.limits().flaws()] + self._unused():
            return wrong
        try:
            polynomials.refuse_sizes(self.built(), max(map(float, scalars(self.limits()).half())))
        except Wrong as error:
            part = "" if error.part is None else f".{error.part}"
            return [(f"{ways[0]}{part}", str(error))]
        return []

    def _unused(self) -> list[tuple[str, str]]:
        """Parameters that nothing depends on."""
        if self.surface is not None:
            there, of = CLASSICS[self.surface].parameters, f"the surface {self.surface}"
        elif self.expression is not None:
            there, of = re.findall(r"\w+", self.expression), "the expression"
        else:
            there, of = (), "monomis, which have none"
        wrong = [name for name in self.parameters if name not in there and (there or self.expression is None)]
        return [("parameters", f"{wrong[0]} is not in {of}; leave it out")] if wrong else []

    def bounds(self, outer: Frame | None) -> Bounds:
        # Of the host, as box_of asks; kernels have Rows.
        return scalars(self.limits()).bounds(outer)

    @classmethod
    def table(cls, a: Arrays, things: list["Polynomial"]) -> Rows:
        built, known = [x.built() for x in things], [x.parameters for x in things]
        slopes = [[_slopes(b, k, name) for name in k] for b, k in zip(built, known)]
        limits = [x.limits() for x in things]

        def put(values: list) -> tuple:
            return tuple(a.put(a.D, column) for column in np.array(values, float).T)

        return Rows(
            slots=put([b.values for b in built]),
            parameters=put([list(k.values()) for k in known]),
            slopes=tuple(put([s[i] for s in slopes]) for i in range(len(known[0]))),
            tolerance=a.put(a.D, np.array([x.tolerance for x in things], float)) if things[0].kind.loose else None,
            clip=stacked(a, type(limits[0]), limits),
        )

    @classmethod
    def columns(cls, thing: "Polynomial", table: Rows) -> dict[str, Any]:
        return {f"parameters.{name}": column for name, column in zip(thing.parameters, table.parameters)}

    @staticmethod
    def seen(placed: PlacedPolynomial, o: Any) -> SeenPolynomial:
        return SeenPolynomial(placed, placed.inverse.point(o))

    @classmethod
    def crossing(cls, seen: SeenPolynomial, ray: Ray, begin: Any, end: Any, known: KnownEnds) -> Crossing:
        d, placed, count = seen.placed.inverse.vector(ray.d), seen.placed, len(cls.form.factors)
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
            if cls.closed:
                capped = known.on_start & cls._on_cap(placed, seen.o, known.start_part)
                # A cap is convex: who leaves it outwards does not come back.
                there &= ~(capped & ~known.inside)
                known_sides = replace(known, on_start=known.on_start & ~capped)
        way = Way.of(seen.o, d, chord, first, last)
        c = roots.first_crossing(cls.form, placed.slots, way, there, known_sides, placed.tolerance)
        if not cls.closed:
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
        enters = dr.select(through, ~starts_in, c.enters | ~there)
        u = dr.uint32_array_t(c.t)
        face = u(0) if line.near_part is None else dr.select(starts_in, line.far_part, line.near_part)
        part = dr.select(through, face + count, u(0) if c.part is None else c.part)
        t = dr.select(through, cap, c.t)
        return Crossing(t < dr.inf, t, part, enters, c.unresolved)

    @classmethod
    def _on_cap(cls, placed: PlacedPolynomial, q: Any, part: Any) -> Any:
        """Whether a point of the surface is on a cap: by its part, or where that is not known, by what is nearer."""
        return cls._surface(placed, q, None)[2] if part is None else part >= len(cls.form.factors)

    @classmethod
    def _surface(cls, placed: PlacedPolynomial, q: Any, part: Any) -> tuple[Any, Any, Any]:
        """Signed distance and normal of a part of the surface, or of the nearest; and whether the clip is nearer than
        it, or is that part. Of an open surface the clip is no part; its points are only as near as the clip."""
        count = len(cls.form.factors)
        f, g = roots.level(cls.form, placed.slots, q, DIFFERENCE * dr.rcp(placed.scale[0]), part if count > 1 else None)
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
    def has_sides(cls, placed: PlacedPolynomial, p: Any) -> Any:
        return roots.has_sides(cls.form, placed.slots, placed.inverse.point(p), dr.rcp(placed.scale[0]))

    @staticmethod
    def uv(placed: PlacedPolynomial, p: Any, part: Any = None) -> tuple[Any, Any]:
        return globe(placed.inverse.point(p))

    def mitsuba(self) -> str:
        return "Mitsuba has no polynomial surfaces; `visray stability` compares them with exact arithmetic"


# Differences of this share of the clip stand in for a gradient that is zero: the root of a root of the rounding, as
# where they are needed the surface has a term of third order.
DIFFERENCE = 2.0**-13


@cache
def _kind(form: Form, closed: bool, clip: type[Clip], parameters: int, loose: bool) -> type[Polynomial]:
    """The polynomials that share their code."""
    count = len(form.factors)
    facts = {
        "form": form,
        "closed": closed,
        "solid": clip.solid,
        "loose": loose,
        "uses_part": closed,
        "parts": count + clip.solid.parts if closed else count,
        "crossings": 2 * closed + sum(f.degree for f in form.factors),
    }
    return type("Polynomial", (Polynomial,), facts)


def _slopes(built: Built, known: dict[str, float], name: str) -> list[float]:
    """The derivatives of the slots by a parameter, exact to rounding: of an analytic function, the imaginary part after
    a step too small to change the real one."""
    tiny = 1e-200
    moved = {k: complex(v, tiny if k == name else 0) for k, v in known.items()}
    return [_moved(c, moved).imag / tiny for c in built.constants]


def _moved(constant: Any, parameters: dict[str, complex]) -> complex:
    return complex(polynomials.evaluate(constant, parameters.__getitem__, lambda x: complex(float(x)), cmath.sqrt))
