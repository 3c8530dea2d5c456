"""Polynomial surfaces: f(x, y, z) = 0 of any degree, within a clip."""

import cmath
import re
from dataclasses import dataclass, field
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
from visray.primitives.primitive import Primitive, scalars
from visray.primitives.sphere import globe
from visray.quantities import Arrays, Name, Real, stacked
from visray.ray import Ray
from visray.roots import Crossing, Ends, Way
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

    def placed(self, outer: Frame | None) -> "Placed":
        """Where they are, and the slots with derivatives by the parameters."""
        slots, o = self.slots, self.clip.frame().o
        for p, slopes in zip(self.parameters, self.slopes):
            if dr.grad_enabled(p):
                # Zero, with the slope that a slot has.
                slots = tuple(x + k * (p - dr.detach(p)) for x, k in zip(slots, slopes))
        inverse = Similarity(0 * o.x + 1, o).then(outer).inverse()
        return Placed(inverse, slots, self.tolerance, tuple(map(dr.rcp, self.clip.half())))

    def sphere(self, outer: Frame | None) -> tuple[Any, Any]:
        """Centre and radius of a sphere in the world that holds the clip."""
        return self.clip.sphere(outer)


@dataclass(frozen=True)
class Placed:
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
class Near:
    """A polynomial as seen from an origin, which is in coordinates about the clip's centre."""

    placed: Placed
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

    def bounds(self) -> tuple[np.ndarray, np.ndarray] | None:
        centre, radius = (np.array(v, float) for v in scalars(self.limits()).sphere(self.outer_numbers()))
        return centre - radius, centre + radius

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
    def gone(inside: Any) -> Any:
        return False

    @staticmethod
    def seen(placed: Placed, o: Any) -> Near:
        return Near(placed, placed.inverse.point(o))

    @classmethod
    def first(cls, seen: Near, ray: Ray, leaving: Any, inside: Any) -> Any:
        near = 0 if ray.start is None else ray.start
        if leaving is not None:
            # On its own surface the ray may be as near as it likes.
            near = dr.select(leaving, 0, near)
        return cls._first(seen, seen.placed.inverse.vector(ray.d), near, dr.inf, Ends(leaving, inside))[0]

    @classmethod
    def unresolved(cls, seen: Near, ray: Ray) -> Any:
        return cls._first(seen, seen.placed.inverse.vector(ray.d), 0, dr.inf, Ends())[1]

    @classmethod
    def blocks(cls, seen: Near, ray: Ray, length: Any, arrives: Any, inward: Any, leaving: Any, inside: Any) -> Any:
        """Looked for from the end that is known to lie on the surface, if there is one."""
        d = seen.placed.inverse.vector(ray.d)
        near = 0 if ray.start is None else ray.start
        if leaving is not None:
            near = dr.select(leaving, 0, near)
        back = arrives & (length < dr.inf)
        o = dr.select(back, seen.o + dr.select(back, length, 0) * d, seen.o)
        low, high = dr.select(back, 0, near), dr.select(back, length - near, length)
        if leaving is None:
            ends = Ends(back, inward)
        else:
            ends = Ends(back | leaving, dr.select(back, inward, inside), back & leaving)
        return cls._first(Near(seen.placed, o), dr.select(back, -d, d), low, high, ends)[0] < high

    @classmethod
    def passage(cls, seen: Near, ray: Ray, length: Any, arrives: Any, leaving: Any) -> tuple[Any, Any]:
        d = seen.placed.inverse.vector(ray.d)
        if not cls.closed:
            return super().passage(seen, ray, length, arrives, leaving)
        (t0, t1), there, begin, end, chord = cls._part(seen, d, 0, length)
        # Where the ray leaves the surface, or comes to it, rounding may add a crossing.
        most = 2 + sum(f.degree for f in cls.form.factors)

        def step(at: Any, negative: Any, inside: Any, count: Any, going: Any) -> tuple:
            ends = Ends(count > 0, negative)
            c = cls._crossing(seen, Way.of(seen.o, d, chord, at, end), going, ends)
            to = dr.select(c.found, c.t, end)
            inside += dr.select(c.negative, to - at, 0)
            return to, c.negative ^ c.found, inside, count + 1, going & c.found & (count < most)

        n = max(dr.width(d), dr.width(length), dr.width(seen.o))
        zero, no = dr.zeros(type(end), n), dr.full(dr.mask_t(end), False, n)
        state = zero + begin, no, zero, dr.zeros(dr.uint32_array_t(type(end)), n), no | there
        _, last, inside, _, _ = dr.while_loop(state, lambda *state: state[-1], step, label="passage")
        entered = (t0 > 0) | ~roots.below(cls.form, seen.placed.slots, seen.o)
        if leaving is not None:
            entered |= leaving
        return entered & (~last | (t1 < length) | arrives), inside

    @classmethod
    def _crossing(cls, seen: Near, way: Way, active: Any, ends: Ends) -> Crossing:
        """The first crossing of a way."""
        return roots.first_crossing(cls.form, seen.placed.slots, way, active, ends, seen.placed.tolerance)

    @classmethod
    def _part(cls, seen: Near, d: Any, near: Any, far: Any) -> tuple:
        """The line's interval in the clip; whether any of it lies between two distances, where that begins and ends,
        and the interval again: lanes that have none take part with one of their own, so that all in them is finite.
        """
        unit = seen.placed.unit(d)
        t0, t1 = cls.solid.interval(seen.placed.unit(seen.o), unit, dr.squared_norm(unit))
        begin, end = dr.select(t0 > near, t0, near), dr.select(t1 < far, t1, far)
        there = (t0 <= t1) & (begin < end)
        begin, end, *chord = (dr.select(there, t, x) for t, x in ((begin, 0), (end, 0), (t0, -1), (t1, 1)))
        return (t0, t1), there, begin, end, chord

    @classmethod
    def _first(cls, seen: Near, d: Any, near: Any, far: Any, ends: Ends) -> tuple[Any, Any]:
        """The first crossing between the distances near and far, inf if there is none; and how many parts of the way
        are unresolved."""
        (t0, t1), there, begin, end, chord = cls._part(seen, d, near, far)
        starts_in = t0 <= near
        if ends.on_start is not None:
            # Who leaves the surface is in the clip, whatever rounding says.
            starts_in |= ends.on_start
            if cls.closed:
                capped = ends.on_start & cls._depths(seen.placed, seen.o)[2]
                # A cap is convex: who leaves it outwards does not come back.
                there &= ~(capped & ~ends.negative)
                ends = Ends(ends.on_start & ~capped, ends.negative, ends.on_end)
        c = cls._crossing(seen, Way.of(seen.o, d, chord, begin, end), there, ends)
        if not cls.closed:
            return c.t, c.unresolved
        # A solid is entered through its cap, or left through it; but not where the way ends on it.
        leaves = t1 < far
        if ends.on_end is not None:
            q = seen.o + dr.select(ends.on_end, far, 0) * d
            leaves &= ~(ends.on_end & cls._depths(seen.placed, q)[2])
        cap = dr.select(starts_in, dr.select(leaves, t1, dr.inf), t0)
        through = there & c.negative & (~starts_in | ~c.found)
        return dr.select(through, cap, c.t), c.unresolved

    @classmethod
    def _depths(cls, placed: Placed, q: Any) -> tuple[Any, Any, Any]:
        """Signed distance and normal of the surface, and whether the clip is nearer: then it is the clip's, which of an
        open surface is no part, so that its points are only as near as the clip."""
        f, g = roots.level(cls.form, placed.slots, q, DIFFERENCE * dr.rcp(placed.scale[0]))
        cap, normal = cls.solid.depth(placed.unit(q))
        normal = placed.unit(normal)
        inverse = dr.rcp(dr.norm(normal))
        cap = cap * inverse
        on = cap > (f if cls.closed else dr.abs(f))
        f = dr.select(on, cap, f)
        return f, dr.select(on, normal * inverse, g) if cls.closed else g, on

    @classmethod
    def level(cls, placed: Placed, p: Any) -> tuple[Any, Any]:
        f, g, _ = cls._depths(placed, placed.inverse.point(p))
        g = placed.inverse.normal(g)
        inverse = dr.rcp(dr.norm(g))
        return f * dr.detach(inverse), g * inverse

    @classmethod
    def sided(cls, placed: Placed, p: Any) -> Any:
        return roots.sided(cls.form, placed.slots, placed.inverse.point(p), dr.rcp(placed.scale[0]))

    @staticmethod
    def uv(placed: Placed, p: Any) -> tuple[Any, Any]:
        return globe(placed.inverse.point(p))

    def mitsuba(self) -> str:
        return "Mitsuba has no polynomial surfaces; `visray stability` compares them with exact arithmetic"


# Differences of this share of the clip stand in for a gradient that is zero: the root of a root of the rounding, as
# where they are needed the surface has a term of third order.
DIFFERENCE = 2.0**-13


@cache
def _kind(form: Form, closed: bool, clip: type[Clip], parameters: int, loose: bool) -> type[Polynomial]:
    """The polynomials that share their code."""
    return type("Polynomial", (Polynomial,), {"form": form, "closed": closed, "solid": clip.solid, "loose": loose})


def _slopes(built: Built, known: dict[str, float], name: str) -> list[float]:
    """The derivatives of the slots by a parameter, exact to rounding: of an analytic function, the imaginary part after
    a step too small to change the real one."""
    tiny = 1e-200
    moved = {k: complex(v, tiny if k == name else 0) for k, v in known.items()}
    return [_moved(c, moved).imag / tiny for c in built.constants]


def _moved(constant: Any, parameters: dict[str, complex]) -> complex:
    return complex(polynomials.evaluate(constant, parameters.__getitem__, lambda x: complex(float(x)), cmath.sqrt))
