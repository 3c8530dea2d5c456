"""Jets: numbers with their gradients and their second derivatives by x, y and z."""

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Jet:
    """A function at N points: value (N), gradient (3, N) and Hessian (3, 3, N)."""

    value: np.ndarray
    gradient: np.ndarray
    hessian: np.ndarray

    @staticmethod
    def axes(p: np.ndarray) -> tuple["Jet", "Jet", "Jet"]:
        """The jets of x, y and z at points. Shape: p (N, 3)."""
        n, flat = len(p), np.zeros((3, 3, len(p)))
        return tuple(Jet(p[:, i], np.repeat(np.eye(3)[:, [i]], n, axis=1), flat) for i in range(3))

    def __add__(self, other: Any) -> "Jet":
        if not isinstance(other, Jet):
            return Jet(self.value + other, self.gradient, self.hessian)
        return Jet(self.value + other.value, self.gradient + other.gradient, self.hessian + other.hessian)

    def __neg__(self) -> "Jet":
        return Jet(-self.value, -self.gradient, -self.hessian)

    def __sub__(self, other: Any) -> "Jet":
        return self + -other

    def __rsub__(self, other: float) -> "Jet":
        return -self + other

    def __mul__(self, other: Any) -> "Jet":
        if not isinstance(other, Jet):
            return Jet(self.value * other, self.gradient * other, self.hessian * other)
        a, b = self, other
        crossed = a.gradient[:, None] * b.gradient[None, :]
        return Jet(
            a.value * b.value,
            a.value * b.gradient + b.value * a.gradient,
            a.value * b.hessian + b.value * a.hessian + crossed + crossed.swapaxes(0, 1),
        )

    __radd__, __rmul__ = __add__, __mul__
