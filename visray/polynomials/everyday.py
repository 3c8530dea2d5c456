"""Formulas as people write them, such as "4x³y = 2(x + 1)", converted to the strict grammar of grammar.py.

The reading is: a product needs no sign; f = g is the surface f - g = 0; single letters other than x, y and z are
parameters. What can be read in two ways, such as x/2y, is an error, with both ways in the message.
"""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from visray.polynomials import grammar
from visray.polynomials.error import PolynomialError
from visray.polynomials.everyday_characters import wrong
from visray.polynomials.everyday_checks import ENDS, OPERATORS, STARTS, check_brackets, check_order
from visray.polynomials.everyday_clearing import cleared, is_sum
from visray.polynomials.everyday_tokens import Token, Tokens
from visray.polynomials.literals import AXES, CONSTANTS, EULER, exact_parameters

# Letters that name a polynomial, as in f = x^2 + y^2 - 1.
_NAMES_OF_F = {"f", "F", "g", "h", "p"}


@dataclass(frozen=True)
class Everyday:
    """A formula in the strict grammar.

    expression: text of f in the strict grammar; the surface is f = 0.
    parameters: names in it other than x, y, z and the constants, in the order in which they appear.
    notes: sentences about how it was read, where that may surprise.
    """

    expression: str
    parameters: tuple[str, ...]
    notes: tuple[str, ...]


def everyday(text: str, known: Collection[str] = ()) -> Everyday:
    """The formula of a surface as people write it, in the strict grammar.

    known: names of parameters that stay whole, as mu does; without it, ab is a*b. It may be a mapping with their
        values; all others count as 1 where a value is needed.

    PolynomialError is raised for a formula that is wrong or can be read in two ways. Its column is that in `text`.
    """
    exact_parameters(dict.fromkeys(known, 1.0))
    if len(text) > grammar.MAX_LENGTH:
        raise PolynomialError(f"it is {len(text)} characters long; at most {grammar.MAX_LENGTH}")
    read = Tokens(_without_frame(text), known)
    if not read.tokens:
        raise PolynomialError(f"it is empty; {grammar.EXAMPLE}")
    check_brackets(read.tokens)
    sides = [_unwrapped(side) for side in _sides(read)]
    clear = [check_order(side, text) for side in sides]
    expression, notes = _difference([_joined(side) for side in sides]), tuple(read.notes)
    if any(clear):
        expression, more = cleared(expression)
        notes += more
    names = dict.fromkeys(re.findall(r"(?<![\w.])[A-Za-z]\w*", expression))
    letters = dict.fromkeys(t.text for side in sides for t in side if t.kind == "name")
    parameters = tuple(n for n in letters if n in names and n not in (*AXES, *CONSTANTS, *({EULER} - {*known})))
    if not names.keys() & set(AXES):
        raise PolynomialError("it has no x, y or z, so it is no surface; " + grammar.EXAMPLE)
    _check(expression, parameters, known)
    return Everyday(expression, parameters, notes)


def _check(expression: str, parameters: tuple[str, ...], known: Collection[str]):
    """Raises PolynomialError if the strict grammar refuses the expression."""
    if len(expression) > grammar.MAX_LENGTH:
        raise PolynomialError(
            f"it is too long: {len(expression)} characters with all signs; at most {grammar.MAX_LENGTH}"
        )
    values = known if isinstance(known, Mapping) else {}
    if known and not values:
        return  # the values are not known yet, and decide about roots and divisors
    try:
        grammar.parse(expression, {name: float(values.get(name, 1.0)) for name in parameters})
    except PolynomialError as error:
        assumed = ", ".join(f"{name} = 1" for name in parameters if name not in values)
        raise PolynomialError(f"{error} (with {assumed})" if assumed else str(error)) from None


def _without_frame(text: str) -> str:
    """The text with spaces in place of what stands around a formula: a name before it, as in "E: x = 1", and a full
    stop behind it."""
    text = re.sub(r"[.,;\s]+$", lambda m: " " * len(m[0]), text.replace(":=", " ="))
    return re.sub(r"^\s*(?![xyz]\s*:)[A-Za-z]\w*\s*:", lambda m: " " * len(m[0]), text)


def _sides(read: Tokens) -> list[list[Token]]:
    """The tokens left and right of the sign =, or all tokens. A side that is 0 is left empty."""
    sides: list[list[Token]] = [[]]
    for token in read.tokens:
        if token.kind == "=":
            sides.append([])
        else:
            sides[-1].append(token)
    signs = [t for t in read.tokens if t.kind == "="]
    heading = _heading(sides[0]) if signs else None
    if heading is not None:
        sides = sides[1:]
        # f(x, y) = g is the graph of a function.
        missing = [a for a in AXES if a not in heading]
        if len(missing) == 1 and len(sides) == 1:
            if any(t.text == missing[0] for t in sides[0]):
                raise wrong(f"{missing[0]} in a function of the others", read.tokens[0].at, "write f(x, y, z) = ...")
            read.note(f"the surface is the graph {missing[0]} = ...")
            sides.insert(0, [Token("name", missing[0], 0, 0)])
    elif (
        len(sides) == 2 and len(sides[0]) == 1 and sides[0][0].text in _NAMES_OF_F and not set(read.known) & _NAMES_OF_F
    ):
        read.note(f"{sides[0][0].text} is read as the name of the polynomial, so the surface is where it is 0")
        sides = sides[1:]
    if len(sides) > 2:
        raise wrong("a second =", signs[-1].at, "a surface is f = g, with one =")
    for side, sign in zip(sides, [*signs[: len(sides) - 1], None]):
        if not side:
            at = sign.at if sign else signs[-1].at
            raise wrong("nothing beside the =", at, "write 0 or a polynomial on both sides")
    zero = [len(side) == 1 and side[0].text in ("0", "0.0", "0.") for side in sides]
    if all(zero) and sides:
        raise PolynomialError("it is 0 everywhere; a surface is where a polynomial that is not 0 everywhere is 0")
    return [side for side, z in zip(sides, zero) if not z]


def _heading(side: list[Token]) -> list[str] | None:
    """The coordinates in a heading such as f(x, y, z); None if the side of an equation is something else."""
    kinds = [t.kind for t in side]
    inside = side[2:-1]
    if kinds[:2] != ["name", "("] or kinds[-1] != ")" or "," not in kinds or side[0].text in AXES[:2]:
        return None
    names = [t.text for t in inside[::2]]
    right = all(n in AXES for n in names) and all(t.kind == "," for t in inside[1::2]) and len(set(names)) == len(names)
    return names if right and len(inside) % 2 else None


def _unwrapped(side: list[Token]) -> list[Token]:
    """The tokens without brackets around a single number or name, as in x^{2}. Brackets of functions stay."""
    kept: list[Token] = []
    for token in side:
        if token.kind == ")" and len(kept) > 1 and kept[-2].kind == "(" and kept[-1].kind in ("number", "name"):
            before = kept[-3].kind if len(kept) > 2 else ""
            # Without its brackets, (2)3 would be another number, and x(2) another name.
            if before not in ("function", *ENDS):
                kept[-2:] = kept[-1:]
                continue
        kept.append(token)
    return kept


def _joined(side: list[Token]) -> str:
    """The text of one side in the strict grammar. Domain: sides that check_order accepts."""
    parts: list[str] = []
    before: Token | None = None
    for token in side:
        ends = before is not None and before.kind in ENDS
        root = before is not None and before.kind == "function" and token.kind != "("
        if ends and token.kind in STARTS:
            parts.append("*")
        text = token.kind if token.kind in (*OPERATORS, "(", ")") else token.text
        if token.kind in "+-" and ends:
            text = f" {text} "
        elif root:
            text = f"({text})"
        parts.append(text)
        before = token
    return "".join(parts)


def _difference(sides: list[str]) -> str:
    """The text of the left side minus the right side."""
    if len(sides) == 1:
        return sides[0]
    left, right = sides
    return f"{left} - ({right})" if is_sum(right) else f"{left} - {right}"
