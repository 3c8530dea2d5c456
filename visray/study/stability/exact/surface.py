"""A polynomial surface, and rays that are intersected with it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from visray.study.stability.exact.double_double import DoubleDouble, Magnitude
from visray.study.stability.exact.expressions import degree, flint, parsed, value


@dataclass(frozen=True)
class RayBundle:
    """Rays that are intersected with a surface.

    o: origins, (N, 3)
    d: unit directions, (N, 3)
    low: the exact origins are o + low, double-double numbers, (N, 3); None: low is 0
    side: for rays that start on the surface, the sign of f on the side to which they start, (N); None: the rays start
        anywhere
    noise: for rays that start on the surface, the uncertainty of f at the start, which may be larger than tau (see
        truth.py), (N)
    """

    o: np.ndarray
    d: np.ndarray
    low: np.ndarray | None = None
    side: np.ndarray | None = None
    noise: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.d)

    def points(self, t: np.ndarray, low: Any = 0.0, slope: bool = False, limit: int = 1) -> list[DoubleDouble]:
        """The points o + (t + low) d: a list of x, y and z in double-double.

        slope: whether the coordinates are polynomials in a variable that is added to t, to differentiate f by t
        limit: largest number of coefficients of these polynomials
        """
        coordinates = []
        for i in range(3):
            o = DoubleDouble(self.o[:, i], 0.0 if self.low is None else self.low[:, i], limit)
            d = DoubleDouble(self.d[:, i], 0.0, limit)
            p = o + DoubleDouble(t, low, limit) * d
            if slope:
                p = p + DoubleDouble(np.stack([0 * d.hi[0], d.hi[0]]), 0.0, limit)
            coordinates.append(p)
        return coordinates

    def select(self, lanes: Any) -> "RayBundle":
        """Chosen rays. lanes: indices or mask of the rays."""
        return RayBundle(*(None if v is None else v[lanes] for v in vars(self).values()))

    @staticmethod
    def joined(a: "RayBundle", b: "RayBundle") -> "RayBundle":
        """The rays of both bundles. Domain: rays without low, side and noise."""
        return RayBundle(np.concatenate([a.o, b.o]), np.concatenate([a.d, b.d]))


@dataclass(frozen=True)
class Surface:
    """A polynomial surface f = 0 within a sphere, the clip.

    expression: f, a polynomial in x, y and z
    radius, centre: radius and centre of the clip
    parameters: values of the other names in the expression
    """

    expression: str
    radius: float
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    parameters: dict[str, float] = field(default_factory=dict)

    @cached_property
    def written(self) -> Any:
        """The tree of f as it is written in `expression`."""
        return parsed(self.expression, self.parameters)

    @cached_property
    def tree(self) -> Any:
        """The tree of the squarefree part of f, in which each factor of f occurs only once. It has the same zeros as
        f."""
        return _squarefree(self.written)

    @cached_property
    def has_multiple_factors(self) -> bool:
        """Whether a factor of f occurs more than once. Then the sign of the squarefree part is arbitrary."""
        return self.tree != self.written

    @cached_property
    def degree(self) -> int:
        return degree(self.tree)

    def double_double(self, p: Sequence[DoubleDouble]) -> DoubleDouble:
        """f at points, in double-double. p: x, y and z of the points."""
        return value(self.tree, *p, DoubleDouble.number)

    def magnitude(self, p: Sequence[np.ndarray]) -> np.ndarray:
        """The sum of the absolute values of the terms of f at points. Shapes: (N)."""
        return value(self.tree, *(Magnitude(np.abs(c)) for c in p), lambda q: Magnitude(abs(float(q)))).v

    def gradient(self, p: Sequence[DoubleDouble]) -> np.ndarray:
        """The gradient of f at points. Shapes: (N, 3)."""
        derivatives = []
        for i in range(3):
            moved = [DoubleDouble(c.hi, c.lo, 2) for c in p]
            one = DoubleDouble(np.stack([0 * p[i].hi[0], 1 + 0 * p[i].hi[0]]), 0.0, 2)
            moved[i] = moved[i] + one
            f = self.double_double(moved)
            derivatives.append(f.hi[1] + f.lo[1] if len(f.hi) > 1 else 0 * p[i].hi[0])
        return np.stack(np.broadcast_arrays(*derivatives), 1)


def certain_value(surface: Surface, rays: RayBundle, t: DoubleDouble) -> np.ndarray:
    """f at distances t along rays, or 0 in lanes where rounding makes the sign of f uncertain. Shapes: (N)."""
    p = rays.points(t.hi[0], t.lo[0])
    f = np.broadcast_to(surface.double_double(p).hi[0], t.hi[0].shape)
    return np.where(np.abs(f) > 2.0**-94 * surface.magnitude([c.hi[0] for c in p]), f, 0)


def _squarefree(tree: Any) -> Any:
    """The tree of the squarefree part of a polynomial.

    A power is replaced by its base. Any other polynomial is factored by python-flint if its coefficients have at most
    64 bits; otherwise it is returned unchanged.
    """
    if isinstance(tree, tuple) and tree[0] == "^" and tree[2] > 1:
        return _squarefree(tree[1])
    library = flint()
    ring = library.fmpq_mpoly_ctx.get(("x", "y", "z"), "lex")
    f = value(tree, *ring.gens(), lambda q: ring.constant(library.fmpq(q.numerator, q.denominator)))
    if any(c.height_bits() > 64 for c in f.coeffs()):
        return tree  # such coefficients contain rounded square roots of numbers, so f has no exact multiple factor
    factors = f.factor_squarefree()[1]
    if all(m == 1 for _, m in factors):
        return tree
    product = None
    for factor, _ in factors:
        terms = [_monomial(powers, Fraction(int(c.p), int(c.q))) for powers, c in factor.terms()]
        total = terms[0]
        for term in terms[1:]:
            total = ("+", total, term)
        product = total if product is None else ("*", product, total)
    return product


def _monomial(powers: Sequence[int], c: Fraction) -> Any:
    """The tree of c x^i y^j z^k for powers (i, j, k)."""
    term: Any = c
    for name, n in zip("xyz", powers):
        if n:
            term = ("*", term, ("^", (name,), int(n)))
    return term
