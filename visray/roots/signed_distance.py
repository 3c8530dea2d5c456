"""How far points are from the surface of a program, to first order, and on which side."""

import operator
from functools import reduce
from typing import Any

import drjit as dr

from visray.polynomials import Factor, Program, interpret
from visray.roots.chord import value_error
from visray.roots.number_types import DualNumber

# A gradient that is shorter has lost its digits to underflow, as at a point of high multiplicity.
SMALLEST = 2.0**-500


def has_normal(program: Program, slots: tuple, q: Any, reach: Any) -> Any:
    """Whether the slopes of all factors at a point are more, over the distance `reach`, than rounding makes of none."""
    found = []
    for factor in program.factors:
        longest = sum(0 if p is None else dr.abs(p) for p in _sloped(factor, slots, q).slopes)
        found.append(longest * reach > value_error(factor, slots, map(dr.abs, q)))
    return reduce(operator.and_, found)


def _sloped(factor: Factor, slots: tuple, q: Any) -> DualNumber:
    """A factor with its slopes at a point."""
    axes = (DualNumber(x, tuple(x * 0 + 1 if i == j else None for j in range(3))) for i, x in enumerate(q))
    return interpret(factor.code, tuple(DualNumber(x, (None,) * 3) for x in slots), tuple(axes))


def signed_distance(program: Program, slots: tuple, q: Any, step: Any, part: Any = None) -> tuple[Any, Any]:
    """(f, g): the signed distance of points to the surface, to first order, and the unit normal g = df/dq there.

    part: the factor that a point is on; None, or none of them: the nearest one counts. Where all slopes are zero, at a
    singular point, the normal is that of differences over `step`.
    """
    levels = []
    for factor in program.factors:
        s = _sloped(factor, slots, q)
        g = type(q)(*(0 * s.x if p is None else p for p in s.slopes))
        levels.append(_unit(factor, slots, q, step, s.x, g))
    f, g = levels[0]
    others = type(f)(-1 if program.sign < 0 else 1)
    for number, (distance, normal) in enumerate(levels[1:], 1):
        nearer = dr.abs(distance) < dr.abs(f)
        if part is not None:
            nearer = dr.select(part < len(levels), part == number, nearer)
        others = dr.mulsign(others, dr.select(nearer, f, distance))
        f, g = dr.select(nearer, distance, f), dr.select(nearer, normal, g)
    return dr.mulsign(f, others), type(q)(*(dr.mulsign(x, others) for x in g))


def _unit(factor: Factor, slots: tuple, q: Any, step: Any, f: Any, g: Any) -> tuple[Any, Any]:
    """A function and its gradient, both over the gradient's length. Where that is none, the function is zero if its
    value is only noise, and else nowhere near zero."""
    length = dr.norm(g)
    flat = ~(dr.detach(length) > SMALLEST)

    def differences(*_: Any) -> tuple:
        p, found = dr.detach(q), []
        for i in range(3):
            sides = [[x + (sign * step if i == j else 0) for j, x in enumerate(p)] for sign in (1, -1)]
            high, low = (interpret(factor.code, dr.detach(slots), side) for side in sides)
            found.append(high - low)
        longest = dr.maximum(dr.maximum(dr.abs(found[0]), dr.abs(found[1])), dr.abs(found[2]))
        # At a point that is a centre of symmetry they are all zero: then there is no normal, and this is one.
        found = [dr.select(longest > 0, x / longest, other) for x, other in zip(found, (0, 0, 1))]
        far = dr.select(dr.abs(f) <= value_error(factor, slots, map(dr.abs, p)), 0, dr.copysign(dr.inf, f))
        return dr.normalize(type(p)(*found)), dr.detach(far)

    n = max(dr.width(q), dr.width(f))
    none = dr.zeros(type(q), n), dr.zeros(type(f), n)
    normal, far = dr.if_stmt(none, flat, differences, lambda *same: same, label="singular")
    inverse = 1 / dr.select(flat, 1, length)
    return dr.select(flat, far, f * dr.detach(inverse)), dr.select(flat, normal, g * inverse)
