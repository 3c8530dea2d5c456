"""Polynomial surfaces f(x, y, z) = 0: from text to what kernels evaluate."""

from visray.polynomials.error import PolynomialError
from visray.polynomials.program import Compiled, Factor, Program, build, exact, interpret, magnitude, refuse_sizes
from visray.polynomials.tree import evaluate

__all__ = [
    "Compiled",
    "Factor",
    "PolynomialError",
    "Program",
    "build",
    "evaluate",
    "exact",
    "interpret",
    "magnitude",
    "refuse_sizes",
]
