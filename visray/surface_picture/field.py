"""The polynomial of a surface as a function of NumPy arrays of points: values, signs and derivatives."""

from dataclasses import dataclass
from functools import reduce
from operator import mul

import numpy as np

from visray.clip_report import signs_of
from visray.polynomials import Compiled, interpret
from visray.surface_picture.jet import Jet

# Halvings of the way between two places with different signs.
HALVINGS = 30


@dataclass(frozen=True)
class Field:
    """A polynomial f in which each factor is taken once: it is 0 on the same surface, and changes its sign there.

    compiled: the polynomial, in coordinates about the origin.
    """

    compiled: Compiled

    def values(self, p: np.ndarray) -> np.ndarray:
        """Values at points. Shapes: p (..., 3); result (...)."""
        axes, constants = tuple(np.moveaxis(p, -1, 0)), self.compiled.values
        parts = (interpret(f.code, constants, axes) for f in self.compiled.program.factors)
        return np.broadcast_to(reduce(mul, parts), p.shape[:-1])

    def signs(self, p: np.ndarray) -> np.ndarray:
        """-1 or 1 at each point, or 0 where the value is within its rounding error. Shapes: as `values`."""
        return reduce(mul, (signs_of(f, self.compiled.values, p) for f in self.compiled.program.factors))

    def front(self, p: np.ndarray) -> np.ndarray:
        """The sign of the polynomial itself at each point: 1 in front of the surface. Shapes: as `values`."""
        odd = [f for f in self.compiled.program.factors if not f.even]
        signs = (signs_of(f, self.compiled.values, p) for f in odd)
        return reduce(mul, signs, self.compiled.program.sign * np.ones(p.shape[:-1]))

    def slope(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values and gradients at points. Shapes: p (N, 3); results (N), (3, N)."""
        # With a step along i, the imaginary part of a polynomial is its derivative, without cancellation.
        step = 1e-30 * np.maximum(np.linalg.norm(p, axis=1), 1e-30)
        parts = [self.values(p + 1j * step[:, None] * axis) for axis in np.eye(3)]
        return parts[0].real, np.stack([part.imag / step for part in parts])

    def jet(self, p: np.ndarray) -> Jet:
        """Values, gradients and Hessians at points. Shape: p (N, 3)."""
        axes, n = Jet.axes(p), len(p)
        parts = (interpret(f.code, self.compiled.values, axes) for f in self.compiled.program.factors)
        found = reduce(mul, parts)
        return Jet(*(np.broadcast_to(x, (*x.shape[:-1], n)) for x in (found.value, found.gradient, found.hessian)))

    def first_crossings(self, o: np.ndarray, d: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances of the first changes of the sign along lines o + t d, and the numbers of these lines.

        t: places on each line at which signs are compared, in rising order.
        Shapes: o, d (N, 3), t (N, T); results (M).
        """
        above = self.values(o[:, None, :] + t[..., None] * d[:, None, :]) > 0
        change = above[:, 1:] != above[:, :-1]
        lines = np.flatnonzero(change.any(1))
        at = change[lines].argmax(1)
        return self._bisected(o[lines], d[lines], t[lines, at], t[lines, at + 1]), lines

    def all_crossings(self, o: np.ndarray, d: np.ndarray, t: np.ndarray, sure: bool = False) -> np.ndarray:
        """Points of all changes of the sign along lines o + t d. Shape: result (M, 3).

        o, d, t: as above. sure: whether only signs count that rounding does not change.
        """
        p = o[:, None, :] + t[..., None] * d[:, None, :]
        signs = self.signs(p) if sure else np.where(self.values(p) > 0, 1, -1)
        lines, at = np.nonzero(signs[:, 1:] * signs[:, :-1] < 0)
        found = self._bisected(o[lines], d[lines], t[lines, at], t[lines, at + 1])
        return o[lines] + found[:, None] * d[lines]

    def _bisected(self, o: np.ndarray, d: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """The places between `low` and `high` at which the sign changes."""
        before = self.values(o + low[:, None] * d) > 0
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            same = (self.values(o + middle[:, None] * d) > 0) == before
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return 0.5 * (low + high)
