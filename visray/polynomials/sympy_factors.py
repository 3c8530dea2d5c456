"""Factors of polynomials and their multiplicities, found by sympy.

sympy is imported only when it is needed, because its import takes 0.4 s.
"""

from collections import Counter
from fractions import Fraction

from visray.polynomials.constants import BITS
from visray.polynomials.error import PolynomialError
from visray.polynomials.expansion import Terms, TooLong
from visray.polynomials.expression import Expression, Function, NamedConstant, outermost
from visray.polynomials.symbolic import MOST_TERMS, from_terms, symbolic_terms
from visray.polynomials.sympy_constants import to_sympy

# Greatest number of terms of a polynomial that is factored. True: factoring is necessary, because a factor is repeated.
# False: factoring only makes rendering faster.
MAX_TERMS = {True: MOST_TERMS, False: 300}
MAX_ALGEBRAIC_TERMS = 60
# Greatest number of bits of the coefficients of a polynomial that is factored only to be rendered faster.
MAX_BITS = 600


def repeated_factor_error() -> PolynomialError:
    """The error for a polynomial with a repeated factor that would take too long to find."""
    return PolynomialError("a factor in it is repeated, and it is too long to find which; write it as a power, (...)^2")


def rational_factors(
    expression: Expression, parameters: dict[str, Fraction], needed: bool
) -> list[tuple[Expression, int]]:
    """Pairs (factor, multiplicity) of the expression over the rational numbers.

    Parameters and irrational constants are treated as variables. TooLong is raised if there are too many terms.

    needed: whether factoring is necessary, because a factor is repeated; see MAX_TERMS.
    """
    terms, atoms = symbolic_terms(expression)
    longest = max(max(map(int.bit_length, c.as_integer_ratio())) for c in terms.values())
    if len(terms) > MAX_TERMS[needed] or (longest > MAX_BITS and not needed):
        raise TooLong
    from sympy import QQ, Poly, symbols

    used = [k for k in range(3 + len(atoms)) if any(e[k] for e in terms)]
    names = symbols(f"v:{3 + len(atoms)}")
    poly = Poly.from_dict(
        {tuple(e[k] for k in used): QQ(c.numerator, c.denominator) for e, c in terms.items()},
        *(names[k] for k in used),
        domain=QQ,
    )
    factors = []
    for factor, n in poly.factor_list()[1]:
        inner = {}
        for e, c in factor.terms():
            full = [0] * (3 + len(atoms))
            for k, i in zip(used, e):
                full[k] = i
            inner[tuple(full)] = Fraction(int(c.p), int(c.q))
        if any(any(e[:3]) for e in inner):
            # The factor is scaled so that its most frequent coefficient becomes 1, because a product with 1 is free.
            often = Counter(map(abs, inner.values())).most_common(1)[0][0]
            factors.append(({e: c / often for e, c in inner.items()}, n))
    factors.sort(key=lambda f: (max(sum(e[:3]) for e in f[0]), len(f[0]), sorted(f[0].items())))
    return [(from_terms(inner, atoms), n) for inner, n in factors]


def multiplicity_parts(expression: Expression, parameters: dict[str, Fraction]) -> list[tuple[Expression, int]]:
    """Pairs (square-free factor, multiplicity) of the expression, with the actual values of its constants.

    Each multiplicity has one factor, the product of all irreducible factors with this multiplicity. Square roots are
    exact algebraic numbers here, parameters are rational numbers, and pi and functions are variables.
    """
    try:
        terms, atoms = symbolic_terms(expression)
    except TooLong:
        raise repeated_factor_error() from None
    if len(terms) > MAX_ALGEBRAIC_TERMS:
        raise repeated_factor_error()
    import sympy

    # pi and functions are variables. A function of a variable is another variable.
    variables = {node: sympy.Symbol(f"v{k}") for k, node in enumerate(_transcendental(atoms))}
    axes = sympy.symbols("x y z")
    values = [to_sympy(a, parameters, variables.get) for a in atoms]
    polynomial = sympy.Add(
        *(
            sympy.Rational(c.numerator, c.denominator) * sympy.Mul(*(b**n for b, n in zip((*axes, *values), e)))
            for e, c in terms.items()
        )
    )
    roots = [v for v in values if v.has(sympy.Pow) and not v.free_symbols]
    options = {"extension": roots} if roots else {"domain": sympy.QQ}
    try:
        parts = sympy.Poly(polynomial, *axes, *variables.values(), **options).sqf_list()[1]
    except (sympy.PolynomialError, NotImplementedError):
        raise repeated_factor_error() from None
    square_free = []
    for part, n in parts:
        inner: Terms = {e: _number(c) for e, c in part.terms()}
        if any(any(e[:3]) for e in inner):
            square_free.append((from_terms(inner, list(variables)), n))
    return square_free


def _transcendental(atoms: list[Expression]) -> list[Expression]:
    """pi and the functions in the atoms, each once. Functions are not searched for others inside them."""
    parts = outermost(atoms, lambda node: node == NamedConstant("pi") or isinstance(node, Function))
    return list(dict.fromkeys(parts))


def _number(c) -> Fraction:
    """A real number of sympy as a rational number. An irrational number is correct to about BITS bits."""
    if c.is_Rational:
        return Fraction(int(c.p), int(c.q))
    return Fraction(str(c.evalf(BITS * 3 // 10)))
