"""Polynomial surfaces f(x, y, z) = 0: from text to what kernels evaluate."""

from visray.polynomials.error import PolynomialError
from visray.polynomials.expression import evaluate
from visray.polynomials.program import (
    Compiled,
    Factor,
    Program,
    build,
    check_sizes,
    exact_terms,
    interpret,
    magnitude_bounds,
)

__all__ = [
    "Compiled",
    "Factor",
    "PolynomialError",
    "Program",
    "build",
    "check_sizes",
    "evaluate",
    "exact_terms",
    "interpret",
    "magnitude_bounds",
]
