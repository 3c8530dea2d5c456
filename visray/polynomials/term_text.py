"""The text of a polynomial as a sum of terms, such as "x^2 - 2*a*x*y + 1", for messages."""

from fractions import Fraction

from visray.polynomials.expansion import TooLong
from visray.polynomials.expression import (
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
from visray.polynomials.literals import AXES
from visray.polynomials.symbolic import symbolic_terms

# Greatest numbers of terms, of characters, and of products of an expansion.
MOST_TERMS, MOST_CHARACTERS, BUDGET = 12, 80, 20_000


def term_text(expression: Expression, degree: int) -> str:
    """The expression as a sum of terms whose first one has no minus; words for one that would be long.

    degree: degree of the polynomial, for the words.
    """
    words = f"a polynomial of degree {degree}"
    try:
        terms, atoms = symbolic_terms(expression, BUDGET)
    except TooLong:
        return words
    if len(terms) > MOST_TERMS:
        return words
    names = (*AXES, *map(_constant, atoms))
    order = sorted(terms, key=lambda e: (sum(e[:3]), e[:3], e), reverse=True)
    flip = -1 if terms and terms[order[0]] < 0 else 1
    text = ""
    for e in order:
        c = flip * terms[e]
        sign = ("-" if c < 0 else "") if not text else " - " if c < 0 else " + "
        text += sign + _term(abs(c), [(n, k) for n, k in zip((*names[3:], *names[:3]), (*e[3:], *e[:3])) if k])
    return text if 0 < len(text) <= MOST_CHARACTERS else words


def _term(coefficient: Fraction, powers: list[tuple[str, int]]) -> str:
    """The text of one term. powers: pairs (name, exponent)."""
    parts = [name if n == 1 else f"{name}^{n}" for name, n in powers]
    return "*".join([str(coefficient), *parts] if coefficient != 1 or not parts else parts)


def _constant(node: Expression) -> str:
    """The text of a constant, with brackets wherever they may be needed."""
    match node:
        case Number(value):
            return str(value) if value.denominator == 1 and value >= 0 else f"({value})"
        case NamedConstant(name) | Parameter(name):
            return name
        case Function(written=written):
            return written
        case Root(of):
            text = _constant(of)
            return f"sqrt{text}" if text.startswith("(") and text.endswith(")") else f"sqrt({text})"
        case Negative(of):
            return f"(-{_constant(of)})"
        case Reciprocal(of):
            return f"(1/{_constant(of)})"
        case Power(of, exponent=n):
            return f"{_constant(of)}^{n}"
        case Sum(parts):
            return f"({' + '.join(map(_constant, parts))})"
        case Product(parts):
            return f"({'*'.join(map(_constant, parts)) or 1})"
    return "..."
