"""Expansion of expressions into terms, in which constants that are not rational are treated as variables.

Such a constant is called an atom. It is a parameter, pi, phi (the golden ratio), a square root, a function, or the
reciprocal of an expression that contains one of these. So the variables of a term are x, y, z and the atoms.
"""

from fractions import Fraction

from visray.polynomials.constants import rational
from visray.polynomials.error import PolynomialError
from visray.polynomials.expansion import Coefficients, Terms, TooLong, expand, horner
from visray.polynomials.expression import (
    ONE,
    Expression,
    Function,
    NamedConstant,
    Negative,
    Number,
    Parameter,
    Power,
    Product,
    Reciprocal,
    Root,
    Sum,
)
from visray.polynomials.simplify import negate, simplify

# Greatest number of products that an expansion may take, and of terms that it may have. So an expansion takes at most
# about a second.
MAX_PRODUCTS = 200_000
MOST_TERMS = 600


def _atoms(expression: Expression) -> list[Expression]:
    """The atoms in an expression, each once: parameters, pi, phi, roots, functions, and reciprocals of these."""
    match expression:
        case NamedConstant() | Parameter() | Root() | Function():
            return [expression]
        case Reciprocal(of) if of.irrational or of.parametric:
            return [expression]
        case Negative(of) | Reciprocal(of) | Power(of):
            return _atoms(of)
        case Sum(parts) | Product(parts):
            return list(dict.fromkeys(a for p in parts for a in _atoms(p)))
    return []


def symbolic_terms(expression: Expression, budget: int = MAX_PRODUCTS) -> tuple[Terms, list[Expression]]:
    """(terms, atoms): a dict from exponents to rational coefficients, and the list of atoms.

    The exponents of a term are those of x, y, z and then of each atom.

    budget: greatest number of products of two terms. If more are needed, TooLong is raised.
    """
    atoms = _atoms(expression)
    size = 3 + len(atoms)
    zero = (0,) * size

    def constant(node: Expression) -> Terms:
        if node in atoms:
            e = [0] * size
            e[3 + atoms.index(node)] = 1
            return {tuple(e): Fraction(1)}
        if not node.irrational and not node.parametric:
            return {zero: rational(node, {})}
        match node:
            case Negative(of):
                return {e: -c for e, c in constant(of).items()}
            case Sum(parts):
                total: Terms = {}
                for p in parts:
                    for e, c in constant(p).items():
                        total[e] = total.get(e, 0) + c
                return total
            case Power(of, exponent=n):
                parts = (of,) * n
            case Product(parts):
                pass
        product = {zero: Fraction(1)}
        for p in parts:
            terms = constant(p)
            longer: Terms = {}
            for i, c in product.items():
                for j, d in terms.items():
                    e = tuple(map(int.__add__, i, j))
                    longer[e] = longer.get(e, 0) + c * d
            product = longer
            if len(product) > MOST_TERMS:
                raise TooLong
        return product

    return expand(expression, constant, size, budget), atoms


def _coefficients(terms: Terms, atoms: list[Expression]) -> Coefficients:
    """The terms of the same polynomial in x, y and z only. Their coefficients are expressions of the atoms."""
    summands: dict[tuple[int, int, int], list[Expression]] = {}
    for e, c in terms.items():
        powers = tuple(Power(a, n) if n > 1 else a for a, n in zip(atoms, e[3:]) if n)
        if abs(c) == 1:
            part = Product(powers) if c > 0 else Negative(Product(powers))
        else:
            part = Product((Number(c), *powers)) if powers else Number(c)
        summands.setdefault(e[:3], []).append(part)
    return {e: _coefficient(parts) for e, parts in summands.items()}


def _coefficient(parts: list[Expression]) -> Expression:
    """The sum of the parts, as one expression. A single part is simplified, unless it is 1 or -1."""
    if len(parts) > 1:
        return Sum(tuple(parts))
    return parts[0] if parts[0] in (ONE, negate(ONE)) else simplify(parts[0])


def drop_cancelled_terms(expression: Expression, parameters: dict[str, Fraction], degree: int) -> Expression:
    """The expression, written anew without its terms of the highest degrees, which cancel.

    degree: degree of the polynomial without these terms.
    """
    try:
        terms, atoms = symbolic_terms(expression)
    except TooLong:
        raise PolynomialError(
            f"its degree is {degree}, not {expression.degree} as written, and it is too long to be written anew; "
            "leave out what cancels"
        ) from None
    return from_terms({e: c for e, c in terms.items() if sum(e[:3]) <= degree}, atoms)


def from_terms(terms: Terms, atoms: list[Expression]) -> Expression:
    """The sum of the terms as an expression in Horner's scheme. terms, atoms: as symbolic_terms returns them."""
    return simplify(horner(_coefficients(terms, atoms)))
