"""Polynomial surfaces f(x, y, z) = 0: from text to what kernels evaluate."""

from visray.polynomials.form import Built, Factor, Form, build, exact, interpret, magnitude, refuse_sizes
from visray.polynomials.tree import evaluate
from visray.polynomials.wrong import Wrong

__all__ = [
    "Built",
    "Factor",
    "Form",
    "Wrong",
    "build",
    "evaluate",
    "exact",
    "interpret",
    "magnitude",
    "refuse_sizes",
]
