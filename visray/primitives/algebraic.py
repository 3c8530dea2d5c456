"""Algebraic surfaces: the points inside a clip at which a polynomial f is zero.

This module has the base class of the kind `polynomial`, and of kinds that are defined by a polynomial, such as the
torus (polynomial_solid.py).

The clip is a ball or a box that bounds the surface. The chord of a ray is the part of its line inside the clip. The
parts of the surface are numbered: first the factors of f, and then, in a capped solid, the faces of the clip (the
caps). The canonical clip is the unit ball, or the cube from -1 to 1. The polynomial takes coordinates about the clip's
centre.
"""

import cmath
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import drjit as dr
import numpy as np

from visray import polynomials, roots
from visray.geometry import Frame, Inverse, Similarity, SimilarityInverse
from visray.polynomials import Compiled, Program
from visray.polynomials.volume import enclosed_volume
from visray.primitives.clips import Clip
from visray.primitives.primitive import Bounds, Primitive
from visray.quantities import Arrays, stacked
from visray.ray import Crossing, KnownEnds, Ray
from visray.roots import ChordSegment


@dataclass(frozen=True)
class PolynomialRows:
    """Polynomials that share one program, as arrays with one entry per object.

    constants: values of the program's constants, one array per constant.
    parameters: values of the named parameters, one array per parameter.
    slopes: for each parameter, the derivatives of all constants by that parameter, one array per constant.
    tolerance: tolerance of the crossings; None if no object has a tolerance.
    clip: the clips, as arrays of their fields.
    """

    constants: tuple
    parameters: tuple
    slopes: tuple
    tolerance: Any
    clip: Any

    @classmethod
    def of(cls, a: Arrays, polynomials: list) -> "PolynomialRows":
        """The arrays of several `Polynomial` objects of one kind."""
        compiled, parameters = [x.compiled() for x in polynomials], [x.parameters for x in polynomials]
        clips = [x.clip_volume() for x in polynomials]
        slopes = [[_constant_slopes(c, p, name) for name in p] for c, p in zip(compiled, parameters)]
        loose = polynomials[0].kind.loose

        def put(values: list) -> tuple:
            return tuple(a.put(a.D, column) for column in np.array(values, float).T)

        return cls(
            constants=put([c.values for c in compiled]),
            parameters=put([list(p.values()) for p in parameters]),
            slopes=tuple(put([s[i] for s in slopes]) for i in range(len(parameters[0]))),
            tolerance=a.put(a.D, np.array([x.tolerance for x in polynomials], float)) if loose else None,
            clip=stacked(a, type(clips[0]), clips),
        )

    def local_volumes(self, program: Program, ball: bool) -> np.ndarray:
        """(volume, bound on its error) of each solid f < 0 in its clip, before transforms. Shape: (rows, 2).

        program: the program of all rows; ball: whether the clips are balls.
        """
        columns = [np.array(x, float) for x in (*self.constants, *self.clip.half_sides())]
        rows = np.stack(np.broadcast_arrays(*columns), axis=1).tolist()
        return np.array([enclosed_volume(program, tuple(row[:-3]), tuple(row[-3:]), ball) for row in rows])

    def placed(self, outer: Frame | None) -> "PlacedPolynomial":
        """The polynomials in the world. Their constants carry derivatives by the parameters, if any are asked for.

        outer: the objects' transforms, or None.
        """
        o = self.clip.frame().o
        return self.placed_in(Similarity(0 * o.x + 1, o).then(outer))

    def placed_in(self, frame: Frame | Similarity, shape: tuple = ()) -> "PlacedPolynomial":
        """The polynomials in the world.

        frame: map to the world from the coordinates that the polynomials take; its origin is the clip's centre.
        shape: parameters of the canonical shape, which are stored in the result.
        """
        constants = self.constants
        for p, slopes in zip(self.parameters, self.slopes):
            if dr.grad_enabled(p):
                # The added term is zero, and its derivative by p is the slope of the constant x.
                constants = tuple(x + k * (p - dr.detach(p)) for x, k in zip(constants, slopes))
        scale = tuple(map(dr.rcp, self.clip.half_sides()))
        return PlacedPolynomial(frame.inverse(), constants, self.tolerance, scale, shape)

    def bounds(self, outer: Frame | None) -> Bounds:
        """Bounding box and ball of the clip in world space."""
        return self.clip.bounds(outer)


@dataclass(frozen=True)
class PlacedPolynomial:
    """A polynomial in the world.

    inverse: map from world coordinates to the coordinates of the polynomial, whose origin is the clip's centre.
    constants, tolerance: as in PolynomialRows.
    scale: 1 / (half the side of the clip), one entry per axis.
    shape: parameters of the canonical shape, as Primitive.shape returns them.
    """

    inverse: Inverse | SimilarityInverse
    constants: tuple
    tolerance: Any
    scale: tuple
    shape: tuple = ()

    def to_unit_clip(self, q: Any) -> Any:
        """The vector or point q, converted from coordinates about the clip's centre to those of the canonical clip."""
        return type(q)(*(x * s for x, s in zip(q, self.scale)))


@dataclass(frozen=True)
class SeenPolynomial:
    """A polynomial, and a ray origin o in coordinates about the clip's centre."""

    placed: PlacedPolynomial
    o: Any


class Algebraic(Primitive):
    """A surface whose crossings are roots of a polynomial along a ray. The roots are isolated with a certificate.

    All objects of one kind have the same program and the same kind of clip.

    Facts about a kind, besides those of Primitive:
    program: operations that evaluate the polynomial; see polynomials/program.py.
    solid: the class of the clip's shape, Sphere or Box.
    loose: whether crossings are computed with a tolerance.
    clipped: whether the clip may cut the surface. A closed surface then has caps on the faces of the clip.
    """

    finds_roots = True
    turns_at_end = True
    clipped = True
    # They have no type annotations, because an annotation would make them fields of the scene.
    program = solid = loose = None

    @classmethod
    def kind_of(
        cls, program: Program, closed: bool, clip: type[Clip], parameters: int, loose: bool
    ) -> type["Algebraic"]:
        """The subclass that serves all objects with this structure.

        program, closed, loose: the facts about the kind with these names.
        clip: the class of the clip.
        parameters: number of named parameters.
        """
        return _kind(cls, program, closed, clip, parameters, loose)

    @classmethod
    def volumes(cls, table: PolynomialRows, outer: Frame | None) -> tuple[Any, Any]:
        """As Primitive.volumes. The volume of each polynomial is computed in NumPy, with a bound on its error."""
        of_rows = table.local_volumes(cls.program, cls.solid.fills_ball)
        o = table.clip.frame().o
        factor = Similarity(0 * o.x + 1, o).then(outer).volume_factor()
        return tuple(factor * type(factor)(x) for x in of_rows.T)

    @staticmethod
    def seen(placed: PlacedPolynomial, o: Any) -> SeenPolynomial:
        return SeenPolynomial(placed, placed.inverse.point(o))

    @classmethod
    def crossing(cls, seen: SeenPolynomial, ray: Ray, begin: Any, end: Any, known: KnownEnds) -> Crossing:
        d, placed, count = seen.placed.inverse.vector(ray.d), seen.placed, len(cls.program.factors)
        # The chord, and the piece of it between the ends of the ray. Lanes without such a piece get an arbitrary finite
        # chord, so that all their numbers are finite.
        unit, end = placed.to_unit_clip(d), dr.inf if end is None else end
        line = cls.solid.interval(placed.to_unit_clip(seen.o), unit, dr.squared_norm(unit), ())
        first, last = dr.select(line.near > begin, line.near, begin), dr.select(line.far < end, line.far, end)
        active = (line.near <= line.far) & (first < last)
        first, last, *chord = (
            dr.select(active, t, x) for t, x in ((first, 0), (last, 0), (line.near, -1), (line.far, 1))
        )
        starts_in_clip, on_clip, known_sides = line.near <= begin, None, known
        if known.on_start is not None:
            # A ray that starts on the surface starts in the clip, even if rounding puts its origin outside.
            starts_in_clip |= known.on_start
            if cls.closed and cls.clipped:
                capped = known.on_start & cls._on_cap(placed, seen.o, known.start_part)
                # The clip is convex, so a ray that starts on a cap and leaves the clip does not return to it.
                active &= ~(capped & ~known.inside)
                known_sides = replace(known, on_start=known.on_start & ~capped)
        segment = ChordSegment.of(seen.o, d, chord, first, last)
        c = roots.first_crossing(cls.program, placed.constants, segment, active, known_sides, placed.tolerance)
        if not (cls.closed and cls.clipped):
            return c
        # A ray may enter or leave a capped solid through a cap. A crossing of the cap on which the ray ends does not
        # count.
        leaves = line.far < end
        if known.on_end is not None:
            q = seen.o + dr.select(known.on_end, end, 0) * d
            on_clip = known.on_end & cls._on_cap(placed, q, known.end_part)
            leaves &= ~on_clip
        cap = dr.select(starts_in_clip, dr.select(leaves, line.far, dr.inf), line.near)
        through_cap = active & ~c.enters & (~starts_in_clip | ~c.met)
        # A ray that enters through a cap is outside before. A ray without a crossing stays on the side where it starts.
        enters = dr.select(through_cap, ~starts_in_clip, c.enters)
        u = dr.uint32_array_t(c.t)
        face = u(0) if line.near_part is None else dr.select(starts_in_clip, line.far_part, line.near_part)
        part = dr.select(through_cap, face + count, u(0) if c.part is None else c.part)
        t = dr.select(through_cap, cap, c.t)
        return Crossing(t < dr.inf, t, part, enters, c.unresolved)

    @classmethod
    def _on_cap(cls, placed: PlacedPolynomial, q: Any, part: Any) -> Any:
        """Mask of the surface points q that lie on a cap.

        part: number of the part on which q lies. If it is None, the nearer of the clip and the polynomial's surface
            decides.
        """
        return cls._surface(placed, q, None)[2] if part is None else part >= len(cls.program.factors)

    @classmethod
    def _surface(cls, placed: PlacedPolynomial, q: Any, part: Any) -> tuple[Any, Any, Any]:
        """(f, g, on_clip) at a point q in coordinates about the clip's centre.

        f: signed distance of q to the part of the surface, to first order.
        g: unit normal of the part.
        on_clip: mask of the points whose part is a cap. If the surface is open, it has no caps; then the mask says
            whether the clip is nearer than the polynomial's surface. None for kinds whose clip never cuts the surface.

        part: number of the part; None for the nearest part.
        """
        count, reach = len(cls.program.factors), dr.rcp(placed.scale[0])
        own_part = part if count > 1 else None
        f, g = roots.signed_distance(cls.program, placed.constants, q, DIFFERENCE * reach, own_part)
        if cls.closed and not cls.clipped:
            return f, g, None
        unit = placed.to_unit_clip(q)
        face = None
        if cls.solid.parts > 1:
            nearest = cls.solid.part_at(unit, ())
            face = nearest if part is None else dr.select(part >= count, part - count, nearest)
        cap, normal = cls.solid.depth(unit, face, ())
        normal = placed.to_unit_clip(normal)
        inverse = dr.rcp(dr.norm(normal))
        cap = cap * inverse
        on_clip = cap > (f if cls.closed else dr.abs(f))
        if cls.closed and part is not None:
            on_clip = part >= count
        f = dr.select(on_clip, cap, f)
        return f, dr.select(on_clip, normal * inverse, g) if cls.closed else g, on_clip

    @classmethod
    def surface_at(cls, placed: PlacedPolynomial, p: Any, part: Any = None) -> tuple[Any, Any]:
        f, g, _ = cls._surface(placed, placed.inverse.point(p), part)
        g = placed.inverse.normal(g)
        inverse = dr.rcp(dr.norm(g))
        return f * dr.detach(inverse), g * inverse

    @classmethod
    def nearest_part(cls, placed: PlacedPolynomial, p: Any) -> Any:
        """A number for the part nearest to a point p: the number of factors on a cap, and 0 elsewhere, because a search
        that starts at p needs no more. Domain: kinds that use parts."""
        cap = cls._on_cap(placed, placed.inverse.point(p), None)
        u = dr.uint32_array_t(p.x)
        return dr.select(cap, u(len(cls.program.factors)), u(0))

    @classmethod
    def has_normal(cls, placed: PlacedPolynomial, p: Any) -> Any:
        return roots.has_normal(cls.program, placed.constants, placed.inverse.point(p), dr.rcp(placed.scale[0]))


# Step of the finite differences that replace a gradient of zero, in units of the clip's size. It is about the fourth
# root of the unit roundoff, because the polynomial may begin with a term of third order at such a point.
DIFFERENCE = 2.0**-13


@cache
def _kind(
    base: type[Algebraic], program: Program, closed: bool, clip: type[Clip], parameters: int, loose: bool
) -> type[Algebraic]:
    """The subclass of `base` that serves all objects with this structure; see Algebraic.kind_of."""
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


def _constant_slopes(compiled: Compiled, parameters: dict[str, float], name: str) -> list[float]:
    """Derivatives of all constants by the parameter `name`, exact to within rounding.

    Complex-step differentiation: the parameter gets a tiny imaginary part, which does not change real parts. Then the
    derivative of a constant is its imaginary part divided by that of the parameter.
    """
    step = 1e-200
    stepped = {k: complex(v, step if k == name else 0) for k, v in parameters.items()}
    return [_complex_value(c, stepped).imag / step for c in compiled.constants]


def _complex_value(constant: Any, parameters: dict[str, complex]) -> complex:
    """The value of a constant at complex parameters."""
    return complex(polynomials.evaluate(constant, parameters.__getitem__, lambda x: complex(float(x)), cmath))
