"""The signed distance of points to a polynomial surface, to first order, and the normal at these points."""

import operator
from functools import reduce
from typing import Any

import drjit as dr

from visray.polynomials import Factor, Program, interpret
from visray.roots.chord import value_error
from visray.roots.number_types import DualNumber

# A gradient shorter than this counts as zero, because underflow may have taken its digits. This happens at singular
# points of high multiplicity.
SMALLEST = 2.0**-500


def has_normal(program: Program, constants: tuple, q: Any, reach: Any) -> Any:
    """Mask of the points q at which the gradients of all factors are certainly not zero.

    A gradient is certainly not zero if, over the distance `reach`, it changes f by more than the rounding error of f.

    constants: values of the program's constants.
    """
    certain = []
    for factor in program.factors:
        length = sum(0 if p is None else dr.abs(p) for p in _with_gradient(factor, constants, q).slopes)
        certain.append(length * reach > value_error(factor, constants, map(dr.abs, q)))
    return reduce(operator.and_, certain)


def _with_gradient(factor: Factor, constants: tuple, q: Any) -> DualNumber:
    """The value of a factor at q, and its gradient as the slopes of the dual number."""
    axes = (DualNumber(x, tuple(x * 0 + 1 if i == j else None for j in range(3))) for i, x in enumerate(q))
    return interpret(factor.code, tuple(DualNumber(x, (None,) * 3) for x in constants), tuple(axes))


def signed_distance(program: Program, constants: tuple, q: Any, step: Any, part: Any = None) -> tuple[Any, Any]:
    """(f, g): signed distance of the point q to the surface, to first order, and the unit normal g = df/dq.

    constants: values of the program's constants.
    step: step of the finite differences that give the normal at a singular point, where the gradient is zero.
    part: number of the factor on whose surface q lies. If it is None, or not the number of a factor, the factor whose
        surface is nearest to q is taken.
    """
    levels = []
    for factor in program.factors:
        x = _with_gradient(factor, constants, q)
        g = type(q)(*(0 * x.x if p is None else p for p in x.slopes))
        levels.append(_normalised(factor, constants, q, step, x.x, g))
    f, g = levels[0]
    # The sign of the product of all other factors.
    sign = type(f)(-1 if program.sign < 0 else 1)
    for number, (distance, normal) in enumerate(levels[1:], 1):
        nearer = dr.abs(distance) < dr.abs(f)
        if part is not None:
            nearer = dr.select(part < len(levels), part == number, nearer)
        sign = dr.mulsign(sign, dr.select(nearer, f, distance))
        f, g = dr.select(nearer, distance, f), dr.select(nearer, normal, g)
    return dr.mulsign(f, sign), type(q)(*(dr.mulsign(x, sign) for x in g))


def _normalised(factor: Factor, constants: tuple, q: Any, step: Any, f: Any, g: Any) -> tuple[Any, Any]:
    """(f, g), both divided by the length of g. f: value of a factor at q. g: its gradient.

    In lanes where g is zero, the normal comes from finite differences with this step, and f becomes 0 if it is within
    rounding of zero, else infinite.
    """
    length = dr.norm(g)
    flat = ~(dr.detach(length) > SMALLEST)

    def differences(*_: Any) -> tuple:
        p, normal = dr.detach(q), []
        for i in range(3):
            sides = [[x + (sign * step if i == j else 0) for j, x in enumerate(p)] for sign in (1, -1)]
            high, low = (interpret(factor.code, dr.detach(constants), side) for side in sides)
            normal.append(high - low)
        longest = dr.maximum(dr.maximum(dr.abs(normal[0]), dr.abs(normal[1])), dr.abs(normal[2]))
        # At a centre of symmetry all differences are zero, and there is no normal. Then the z axis is taken.
        normal = [dr.select(longest > 0, x / longest, default) for x, default in zip(normal, (0, 0, 1))]
        far = dr.select(dr.abs(f) <= value_error(factor, constants, map(dr.abs, p)), 0, dr.copysign(dr.inf, f))
        return dr.normalize(type(p)(*normal)), dr.detach(far)

    n = max(dr.width(q), dr.width(f))
    zeros = dr.zeros(type(q), n), dr.zeros(type(f), n)
    normal, far = dr.if_stmt(zeros, flat, differences, lambda *same: same, label="singular")
    inverse = 1 / dr.select(flat, 1, length)
    return dr.select(flat, far, f * dr.detach(inverse)), dr.select(flat, normal, g * inverse)
