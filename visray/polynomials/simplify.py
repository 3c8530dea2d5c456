"""Functions that rewrite expressions without expanding them: simplification, negation, and a change of origin.

A constant is an expression without x, y and z.
"""

from fractions import Fraction

from visray.polynomials.constants import is_zero
from visray.polynomials.expression import ONE, Axis, Expression, Negative, Number, Power, Product, Sum


def simplify(node: Expression) -> Expression:
    """The expression in a simpler form. Nothing is expanded.

    A sum in a sum becomes a single sum, and a product in a product a single product. Constants are collected, and minus
    signs are moved to the front of products.
    """
    if node.degree == 0:
        return node
    match node:
        case Negative(of):
            return negate(simplify(of))
        case Power(of, exponent=n):
            return _power(simplify(of), n)
        case Sum(parts):
            return _sum([simplify(p) for p in parts])
        case Product(parts):
            return _product([simplify(p) for p in parts])
    return node


def negate(node: Expression) -> Expression:
    """The negative of an expression. The first factor of a product takes the sign if it is a constant."""
    match node:
        case Negative(of):
            return of
        case Product((first, *rest)) if first.degree == 0:
            return Product((negate(first), *rest))
        case Number(value):
            return Number(-value)
    return Negative(node)


def _power(of: Expression, n: int) -> Expression:
    """The power of a simplified expression, in simplified form."""
    if n == 1:
        return of
    match of:
        case Negative(inner):
            return _power(inner, n) if n % 2 == 0 else negate(_power(inner, n))
        case Power(inner, exponent=m):
            return Power(inner, m * n)
    return Power(of, n)


def _sum(parts: list[Expression]) -> Expression:
    """The sum of simplified expressions, in simplified form. All constants are collected in its last term."""
    terms, constants = [], []
    for p in parts:
        inner = [p]
        if isinstance(p, Sum):
            inner = p.parts
        elif isinstance(p, Negative) and isinstance(p.of, Sum):
            inner = [negate(t) for t in p.of.parts]
        for t in inner:
            (terms if t.degree else constants).append(t)
    if constants:
        constant = constants[0] if len(constants) == 1 else Sum(tuple(constants))
        if not terms or not is_zero(constant):
            terms.append(constant)
    return terms[0] if len(terms) == 1 else Sum(tuple(terms))


def _product(parts: list[Expression]) -> Expression:
    """The product of simplified expressions, in simplified form. All constants are collected in its first factor."""
    factors, constants, minus = [], [], False
    for p in parts:
        if isinstance(p, Negative) and p.degree:
            minus, p = not minus, p.of
        for t in p.parts if isinstance(p, Product) else [p]:
            (factors if t.degree else constants).append(t)
    constants = [c for c in constants if c != ONE]
    if constants:
        constant = constants[0] if len(constants) == 1 else Product(tuple(constants))
        if is_zero(constant):
            return Number(Fraction(0))
        return Product((negate(constant) if minus else constant, *factors)) if factors else constant
    product = factors[0] if len(factors) == 1 else Product(tuple(factors))
    return Negative(product) if minus else product


def translate(node: Expression, centre: tuple[Fraction, Fraction, Fraction]) -> Expression:
    """The expression in coordinates q = p - centre.

    x is replaced by (x + c), where c is the x coordinate of the centre, unless c is 0. The same is done for y and z.
    """
    match node:
        case Axis(index) if centre[index]:
            return Sum((node, Number(centre[index])))
        case Sum(parts):
            return Sum(tuple(translate(p, centre) for p in parts))
        case Product(parts):
            return Product(tuple(translate(p, centre) for p in parts))
        case Negative(of):
            return Negative(translate(of, centre))
        case Power(of, exponent=n):
            return Power(translate(of, centre), n)
    return node
