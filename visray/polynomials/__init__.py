"""Polynomials f(x, y, z): from text to programs that kernels evaluate.

Text is parsed into an expression, factorized into square-free factors, and compiled into one program per factor.
"""

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
