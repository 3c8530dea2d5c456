"""Rays, and a polynomial surface that they are sent to."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from visray.study.stability.exact.formulas import degree, flint, parsed, value
from visray.study.stability.exact.twofold import Size, Twofold


@dataclass(frozen=True)
class Bundle:
    """Rays that a surface is asked about: origins o (double-double: o + low) and unit directions d. Shapes: (N, 3).

    side: None for rays that start anywhere; for rays that leave the surface, the sign of f on the side they run on,
    and then `noise` is how much f is uncertain there beyond tau. Shapes: (N).
    """

    o: np.ndarray
    d: np.ndarray
    low: np.ndarray | None = None
    side: np.ndarray | None = None
    noise: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.d)

    def at(self, t: np.ndarray, low: Any = 0.0, slope: bool = False, limit: int = 1) -> list[Twofold]:
        """The points o + t d; with `slope`, as polynomials in what is added to t."""
        found = []
        for i in range(3):
            o = Twofold(self.o[:, i], 0.0 if self.low is None else self.low[:, i], limit)
            d = Twofold(self.d[:, i], 0.0, limit)
            p = o + Twofold(t, low, limit) * d
            if slope:
                p = p + Twofold(np.stack([0 * d.hi[0], d.hi[0]]), 0.0, limit)
            found.append(p)
        return found

    def part(self, keep: Any) -> "Bundle":
        """Some of the rays."""
        return Bundle(*(None if v is None else v[keep] for v in vars(self).values()))

    @staticmethod
    def joined(a: "Bundle", b: "Bundle") -> "Bundle":
        """Rays that start anywhere, of both."""
        return Bundle(np.concatenate([a.o, b.o]), np.concatenate([a.d, b.d]))


@dataclass(frozen=True)
class Surface:
    """A polynomial surface f = 0 in a sphere of `radius` about `centre`."""

    expression: str
    radius: float
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    parameters: dict[str, float] = field(default_factory=dict)

    @cached_property
    def written(self) -> Any:
        return parsed(self.expression, self.parameters)

    @cached_property
    def tree(self) -> Any:
        """f, or where it has multiple factors, the product of them once each: the same surface."""
        return _radical(self.written)

    @cached_property
    def radical(self) -> bool:
        """Whether f has multiple factors: the sign of what is left is then a matter of taste."""
        return self.tree != self.written

    @cached_property
    def degree(self) -> int:
        return degree(self.tree)

    def twofold(self, p: Sequence[Twofold]) -> Twofold:
        return value(self.tree, *p, Twofold.number)

    def size(self, p: Sequence[np.ndarray]) -> np.ndarray:
        """A bound of the terms of f at points."""
        return value(self.tree, *(Size(np.abs(c)) for c in p), lambda q: Size(abs(float(q)))).v

    def gradient(self, p: Sequence[Twofold]) -> np.ndarray:
        """Of f at points. Shapes: (N, 3)."""
        found = []
        for i in range(3):
            moved = [Twofold(c.hi, c.lo, 2) for c in p]
            one = Twofold(np.stack([0 * p[i].hi[0], 1 + 0 * p[i].hi[0]]), 0.0, 2)
            moved[i] = moved[i] + one
            f = self.twofold(moved)
            found.append(f.hi[1] + f.lo[1] if len(f.hi) > 1 else 0 * p[i].hi[0])
        return np.stack(np.broadcast_arrays(*found), 1)


def certain_value(surface: Surface, rays: Bundle, t: Twofold) -> np.ndarray:
    """f at t, 0 where its sign is not certain."""
    p = rays.at(t.hi[0], t.lo[0])
    f = np.broadcast_to(surface.twofold(p).hi[0], t.hi[0].shape)
    return np.where(np.abs(f) > 2.0**-94 * surface.size([c.hi[0] for c in p]), f, 0)


def _radical(tree: Any) -> Any:
    """The product of the distinct factors of a power or product, as far as one sees them; else by python-flint, where
    all coefficients are short."""
    if isinstance(tree, tuple) and tree[0] == "^" and tree[2] > 1:
        return _radical(tree[1])
    library = flint()
    ring = library.fmpq_mpoly_ctx.get(("x", "y", "z"), "lex")
    f = value(tree, *ring.gens(), lambda q: ring.constant(library.fmpq(q.numerator, q.denominator)))
    if any(c.height_bits() > 64 for c in f.coeffs()):
        return tree  # roots of numbers: cut off somewhere, they leave no multiple factor
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
    term: Any = c
    for name, n in zip("xyz", powers):
        if n:
            term = ("*", term, ("^", (name,), int(n)))
    return term
