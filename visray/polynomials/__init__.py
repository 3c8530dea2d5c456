"""Polynomials f(x, y, z): from text to programs that kernels evaluate.

The steps are: text is parsed into an expression (a tree); the expression is divided into square-free factors; each
factor is compiled into a list of operations, its code. A polynomial is square-free if no factor occurs in it twice. A
constant is an expression without x, y and z.
"""

from visray.polynomials.constants import evaluate, inexact
from visray.polynomials.error import PolynomialError
from visray.polynomials.program import (
    Compiled,
    Factor,
    Program,
    build,
    check_sizes,
    exact_terms,
    interpret,
    magnitude_bounds,
    slope_flaw,
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
    "inexact",
    "interpret",
    "magnitude_bounds",
    "slope_flaw",
]
