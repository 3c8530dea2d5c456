"""Characters of formulas as people write them: which ASCII characters they stand for, and why some stand for none.

Superscripts, subscripts, Greek letters and roots stay as they are. everyday_tokens.py reads them.
"""

import re
import unicodedata

from visray.polynomials.error import PolynomialError

SUPERSCRIPTS = dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻⁽⁾ⁿ", "0123456789+-()n", strict=True))
SUBSCRIPTS = dict(zip("₀₁₂₃₄₅₆₇₈₉", "0123456789", strict=True))
ROOT, BOTH_SIGNS = "√", "±"
# What stands between the numbers of ½, where it is taken apart.
FRACTION_SIGN = "\u2044"
_SIGNS = dict.fromkeys("−–—‐‑‒", "-") | dict.fromkeys("·⋅×∙•∗✕", "*") | dict.fromkeys("∕⁄÷:", "/")  # noqa: RUF001
_GREEK = re.compile(r"GREEK (SMALL|CAPITAL) LETTER (?:FINAL )?([A-Z]+)(?: SYMBOL)?")
# Greek letters that may be written as words. Those with x, y or z in them are read letter by letter.
GREEK_WORDS = set(
    "alpha beta gamma delta epsilon eta theta iota kappa lambda mu nu rho sigma tau upsilon chi psi omega".split()  # noqa: SIM905
)
# `lambda` is a word of Python, and no parameter can have this name.
_RENAMED = {"lambda": "lam", "lamda": "lam", "Lamda": "Lam"}
_COMPARISON = "a surface is where both sides are equal, as in f = g; write ="
_HINTS = dict.fromkeys("<>≤≥≠", _COMPARISON)
_HINTS |= {
    "|": "a size |...| has a corner, and no polynomial has; square it, as in x^2 for |x|",
    "∞": "only finite numbers have a meaning",
    "∛": "write 2^(1/3) for the cube root of 2",
    "∜": "write 2^(1/4) for the fourth root of 2",
    ";": "write one formula",
    "%": "write 0.5 for 50 %",
    "!": "write the number that the factorial is",
    "'": "a polynomial is written without derivatives",
    "&": "write one formula",
}
_MEANT = "only numbers, letters and + - * / ^ ( ) = have a meaning"


def wrong(text: str, at: int, advice: str) -> PolynomialError:
    """The error `text at column ...; advice`. at: position in the user's text, the first is 0."""
    return PolynomialError(f"{text} at column {at + 1}; {advice}")


def plain(text: str) -> tuple[str, list[int]]:
    """(plain text, columns): the text in plain characters, and for each of them its position in `text`."""
    characters, columns = [], []
    for at, c in enumerate(text):
        new = _plain(c, at)
        if "/" in new and len(new) > 1 and characters and characters[-1].isdigit():
            raise wrong(f"{c!r} after a number", at, "write mixed numbers as decimals, as 2.5")
        characters += new
        columns += [at] * len(new)
    return "".join(characters), columns


def _plain(c: str, at: int) -> str:
    """The plain characters for one character: mostly itself. at: its position, for errors."""
    if c.isascii():
        if c in _HINTS or not (c.isalnum() or c.isspace() or c in "+-*/:^()[]{}=.,_\\$"):
            raise wrong(f"unexpected {c!r}", at, _HINTS.get(c, _MEANT))
        return " " if c.isspace() else _SIGNS.get(c, c)
    if c in SUPERSCRIPTS or c in SUBSCRIPTS or c in (ROOT, BOTH_SIGNS):
        return c
    if c in _SIGNS:
        return _SIGNS[c]
    # A formula that was copied from a page has italic letters, narrow spaces, and signs of width 0.
    same = unicodedata.normalize("NFKC", c)
    if unicodedata.category(c) in ("Cf", "Mn") or same.isspace():
        return "" if unicodedata.category(c) in ("Cf", "Mn") else " "
    if FRACTION_SIGN in same:
        return f"({same.replace(FRACTION_SIGN, '/')})"
    if greek(same) or (same.isascii() and same.isalnum()) or same in _SIGNS or same in tuple("+-*/^()[]{}=.,"):
        return _SIGNS.get(same, same)
    if c in _HINTS:
        raise wrong(f"unexpected {c!r}", at, _HINTS[c])
    name = unicodedata.name(c, "")
    if c.isalpha() and (name.startswith("CYRILLIC") or greek(same) is None):
        raise wrong(f"unexpected {c!r} ({name.lower() or 'no letter'})", at, "write letters from a to z, or Greek ones")
    raise wrong(f"unexpected {c!r}", at, _MEANT)


def greek(c: str) -> str | None:
    """The name of a Greek letter, such as "mu" for μ and "Delta" for Δ; None for other characters."""
    match = _GREEK.fullmatch(unicodedata.name(c, "")) if len(c) == 1 else None
    if not match:
        return None
    name = match[2].lower() if match[1] == "SMALL" else match[2].capitalize()
    return _RENAMED.get(name, name)


def renamed(name: str) -> str:
    """The name that a parameter has for visray: `lam` for `lambda`, else the same."""
    return _RENAMED.get(name, name)
