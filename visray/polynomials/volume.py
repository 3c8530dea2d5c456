"""The volume of the solid f < 0 inside a clip, with a bound on its error.

The clip's box is divided into cells. In each cell, f is enclosed by affine arithmetic: f = c + a . s + r with |r| <= e,
where s are the cell's coordinates from -1 to 1. Cells in which f has one sign are counted at once. All others are
divided into eight, until the error is small or there are too many. Of a cell that is left, the share in which c + a . s
is below a number has a closed form. The bound e on the rest gives a lower and an upper bound of the cell's share.

Source for affine arithmetic: Stolfi and de Figueiredo, Self-Validated Numerical Methods, 1997.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np

from visray.polynomials.program import Program, interpret

# Cells are divided until the error is at most this share of the volume, or until there are this many.
SHARE, MOST_CELLS = 2.0**-8, 2**16
# Each operation rounds its numbers a few times: at most 16 units of the last place of all of them together.
ROUNDING = 16 * 2.0**-53
# The closed form of a share divides by the product of the three slopes. A slope that is smaller than this part of the
# largest one is made larger, and the difference is counted as error.
LEAST_SLOPE = 2.0**-10


@dataclass(frozen=True)
class Affine:
    """Numbers c + a . s + r with |r| <= e, for all s with coordinates from -1 to 1. Shapes: c, e (N), a (3, N)."""

    c: np.ndarray
    a: np.ndarray
    e: np.ndarray

    @property
    def spread(self) -> np.ndarray:
        """The largest |a . s + r|."""
        return np.abs(self.a).sum(0) + self.e

    def rounded(self) -> "Affine":
        """The same numbers, with the rounding of one operation counted as error."""
        return Affine(self.c, self.a, self.e + ROUNDING * (np.abs(self.c) + self.spread))

    def __add__(self, other: Any) -> "Affine":
        if not isinstance(other, Affine):
            return Affine(self.c + other, self.a, self.e).rounded()
        return Affine(self.c + other.c, self.a + other.a, self.e + other.e).rounded()

    def __neg__(self) -> "Affine":
        return Affine(-self.c, -self.a, self.e)

    def __sub__(self, other: Any) -> "Affine":
        return self + -other

    def __rsub__(self, other: float) -> "Affine":
        return -self + other

    def __mul__(self, other: Any) -> "Affine":
        if not isinstance(other, Affine):
            return Affine(self.c * other, self.a * other, self.e * abs(other)).rounded()
        e = np.abs(self.c) * other.e + np.abs(other.c) * self.e + self.spread * other.spread
        return Affine(self.c * other.c, self.c * other.a + other.c * self.a, e).rounded()

    __radd__, __rmul__ = __add__, __mul__

    def square(self) -> "Affine":
        """The squares. The square of a . s + r is not negative, which halves the error of the product."""
        half = 0.5 * self.spread**2
        return Affine(self.c**2 + half, 2 * self.c * self.a, 2 * np.abs(self.c) * self.e + half).rounded()

    def signs(self) -> np.ndarray:
        """-1 or 1 where the sign of all numbers is known, else 0."""
        return np.where(np.abs(self.c) > self.spread, np.sign(self.c), 0)

    def share_below_zero(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bound of the share of all s with a negative number. Shapes: (N), (N)."""
        w = np.abs(self.a)
        wide = np.maximum(w, LEAST_SLOPE * w.max(0))
        flat = w.max(0) == 0
        e, wide = self.e + (wide - w).sum(0), np.where(flat, 1, wide)
        low, high = (np.where(flat, k, _share_below(wide, x - self.c)) for k, x in enumerate((-e, e)))
        return np.where(flat & (self.c < -self.e), 1, low), np.where(flat & (self.c > self.e), 0, high)


def _share_below(w: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Share of all s, with coordinates from -1 to 1, such that w . s < x. Domain: w > 0. Shapes: (3, N), (N)."""
    total = 0
    for signs in product((-1, 1), repeat=3):
        total = total + np.prod(signs) * np.maximum(x + np.array(signs) @ w, 0) ** 3
    return np.clip(total / (48 * w.prod(0)), 0, 1)


def affine_power(value: Any, n: int) -> Any:
    """value^n. Domain: n >= 1."""
    if not isinstance(value, Affine):
        return value**n
    if n == 1:
        return value
    root = affine_power(value, n // 2).square()
    return root * value if n % 2 else root


def _shares(
    program: Program, constants: tuple, half: tuple, ball: bool, centre: np.ndarray, size: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lower bound, estimate and upper bound of the share of each cell that is inside the solid.

    half, ball: as in enclosed_volume
    centre, size: centres and half side of the cells, in coordinates in which the clip's box goes from -1 to 1; (3, N)
    """
    n = centre.shape[1]
    axes = [Affine(centre[i], np.repeat(size * np.eye(3)[:, [i]], n, axis=1), np.zeros(n)) for i in range(3)]
    point = [axis * h for axis, h in zip(axes, half)]
    forms = [interpret(f.code, constants, point, affine_power) for f in program.factors if not f.even]
    signs = [form.signs() for form in forms]
    total = np.prod([np.full(n, float(program.sign)), *signs], axis=0)
    unknown = np.sum([np.zeros(n), *(sign == 0 for sign in signs)], axis=0)
    low, high = (total < 0).astype(float), ((total < 0) | (unknown > 0)).astype(float)
    for k, form in enumerate(forms):
        # The product of all other signs decides on which side of this factor the solid is.
        others = np.prod([np.full(n, float(program.sign)), *signs[:k], *signs[k + 1 :]], axis=0)
        below, alone = form.share_below_zero(), (unknown == 1) & (signs[k] == 0)
        low = np.where(alone, np.where(others > 0, below[0], 1 - below[1]), low)
        high = np.where(alone, np.where(others > 0, below[1], 1 - below[0]), high)
    # Where the bounds say little, the centre of the cell is taken for all of it.
    middle = np.prod([np.full(n, float(program.sign)), *(np.sign(form.c) for form in forms)], axis=0) < 0
    if not ball:
        return low, np.where(high - low < 0.5, 0.5 * (low + high), middle), high
    form = axes[0].square() + axes[1].square() + axes[2].square() - 1
    in_ball = [np.where(form.signs() == 0, share, form.signs() < 0) for share in form.share_below_zero()]
    # The share of an intersection is at least the sum of both shares less 1, and at most each of them.
    low, high = np.maximum(low + in_ball[0] - 1, 0), np.minimum(high, in_ball[1])
    return low, np.where(high - low < 0.5, 0.5 * (low + high), middle & (form.c < 0)), high


@lru_cache(maxsize=256)
def enclosed_volume(
    program: Program, constants: tuple[float, ...], half: tuple[float, float, float], ball: bool
) -> tuple[float, float]:
    """(volume, bound on its error) of the solid f < 0 inside a clip. Units: those of the polynomial's coordinates.

    constants: values of the program's constants
    half: half sides of the clip's box, whose centre is the origin
    ball: whether the clip is the ball (or ellipsoid) that fills this box; else it is the whole box
    """
    centre, size, counted, box = np.zeros((3, 1)), 1.0, 0.0, 8 * float(np.prod(half))
    while True:
        low, middle, high = _shares(program, constants, half, ball, centre, size)
        cell, left = box * size**3, high > low
        volume = counted + cell * float(middle.sum())
        error = cell * float(np.maximum(high - middle, middle - low).sum())
        if error <= SHARE * volume or 8 * left.sum() > MOST_CELLS:
            return volume, error
        counted += cell * float(low[~left].sum())
        size *= 0.5
        steps = size * np.array(list(product((-1, 1), repeat=3))).T
        centre = (centre[:, left, None] + steps[:, None, :]).reshape(3, -1)
