"""A polynomial as terms over x, y, z and its irrational constants and parameters, as if these were variables."""

from fractions import Fraction

from visray.polynomials.error import PolynomialError
from visray.polynomials.expansion import Coefficients, Terms, TooLong, expand, horner
from visray.polynomials.expression import (
    ONE,
    Expression,
    NamedConstant,
    Negative,
    Number,
    Parameter,
    Power,
    Product,
    Reciprocal,
    Root,
    Sum,
    negate,
    rational,
    simplify,
)

# What an expansion may take, and the terms that it may have: about a second.
MAX_PRODUCTS = 200_000
MOST_TERMS = 600


def _atoms(tree: Expression) -> list[Expression]:
    """The constants in a tree that are not rational numbers, and what is divided by them."""
    match tree:
        case NamedConstant() | Parameter() | Root():
            return [tree]
        case Reciprocal(of) if of.irrational or of.parametric:
            return [tree]
        case Negative(of) | Reciprocal(of) | Power(of):
            return _atoms(of)
        case Sum(parts) | Product(parts):
            return list(dict.fromkeys(a for p in parts for a in _atoms(p)))
    return []


def symbolic_terms(tree: Expression, budget: int = MAX_PRODUCTS) -> tuple[Terms, list[Expression]]:
    """The terms of a tree over x, y, z and its irrational constants and parameters, as if these were variables."""
    atoms = _atoms(tree)
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
                found: Terms = {}
                for p in parts:
                    for e, c in constant(p).items():
                        found[e] = found.get(e, 0) + c
                return found
            case Power(of, exponent=n):
                parts = (of,) * n
            case Product(parts):
                pass
        found = {zero: Fraction(1)}
        for p in parts:
            terms = constant(p)
            product: Terms = {}
            for i, c in found.items():
                for j, d in terms.items():
                    e = tuple(map(int.__add__, i, j))
                    product[e] = product.get(e, 0) + c * d
            found = product
            if len(found) > MOST_TERMS:
                raise TooLong
        return found

    return expand(tree, constant, size, budget), atoms


def _coefficients(terms: Terms, atoms: list[Expression]) -> Coefficients:
    """The terms over x, y and z, their coefficients as trees; 1 and -1 are not written."""
    found: dict[tuple[int, int, int], list[Expression]] = {}
    for e, c in terms.items():
        powers = tuple(Power(a, n) if n > 1 else a for a, n in zip(atoms, e[3:]) if n)
        if abs(c) == 1:
            part = Product(powers) if c > 0 else Negative(Product(powers))
        else:
            part = Product((Number(c), *powers)) if powers else Number(c)
        found.setdefault(e[:3], []).append(part)
    return {e: _coefficient(parts) for e, parts in found.items()}


def _coefficient(parts: list[Expression]) -> Expression:
    if len(parts) > 1:
        return Sum(tuple(parts))
    return parts[0] if parts[0] in (ONE, negate(ONE)) else simplify(parts[0])


def drop_cancelled_terms(tree: Expression, parameters: dict[str, Fraction], degree: int) -> Expression:
    """A tree whose highest terms cancel, without them."""
    try:
        terms, atoms = symbolic_terms(tree)
    except TooLong:
        raise PolynomialError(
            f"its degree is {degree}, not {tree.degree} as written, and it is too long to be written anew; "
            "leave out what cancels"
        ) from None
    return from_terms({e: c for e, c in terms.items() if sum(e[:3]) <= degree}, atoms)


def from_terms(terms: Terms, atoms: list[Expression]) -> Expression:
    return simplify(horner(_coefficients(terms, atoms)))
