"""Converts commands of LaTeX in a formula to plain characters: \\frac{a}{b} to ((a)/(b))."""

import re
import unicodedata

from visray.polynomials.everyday_characters import BOTH_SIGNS, ROOT, wrong
from visray.polynomials.literals import CONSTANTS, FUNCTIONS, shortened

_SIGNS = {"cdot": "*", "times": "*", "ast": "*", "div": "/", "pm": BOTH_SIGNS, "{": "(", "}": ")", "sqrt": ROOT}
_WITHOUT_MEANING = set(
    "left right quad qquad displaystyle textstyle big Big bigl bigr Bigl Bigr bigg Bigg rm limits".split()  # noqa: SIM905
)
_WITHOUT_MEANING |= {"", "mathrm", "mathit", *",;:! ()[]"}
_WORDS = {*FUNCTIONS, "ln", "arcsin", "arccos", "arctan"}
_COMMAND = re.compile(r"\\([A-Za-z]+|.)?")
_OPENING = re.compile(r"\s*\{")


def without_latex(text: str, columns: list[int]) -> tuple[str, list[int]]:
    """(text, columns) without commands of LaTeX. columns: for each character, its position in the user's text."""
    if "\\" not in text:
        return text, columns
    braces: dict[int, str] = {}
    characters, places = [], []
    i = 0
    for command in _COMMAND.finditer(text):
        name = command[1] or ""
        if name == "over":
            _open_around(text, command.start(), columns, braces)
        elif name in ("frac", "dfrac", "tfrac"):
            _fraction(text, command, columns, braces)
    while i < len(text):
        command = _COMMAND.match(text, i)
        new = braces.get(i, text[i]) if not command else _meaning(text, command, columns[i])
        characters += new
        places += [columns[i]] * len(new)
        i = command.end() if command else i + 1
    return "".join(characters), places


def _meaning(text: str, command: re.Match, at: int) -> str:
    """The characters that a command stands for. at: its position in the user's text, for errors."""
    name = command[1] or ""
    if name in _SIGNS:
        if name == "sqrt" and re.match(r"\s*\[", text[command.end() :]):
            raise wrong("a root of another degree", at, "write 2^(1/3) for the cube root of 2")
        return _SIGNS[name]
    if name in _WITHOUT_MEANING:
        return " "
    if name == "over":
        return ")/("
    if name in ("frac", "dfrac", "tfrac"):
        return "("
    if name in _WORDS:
        return f" {name}"
    if name in CONSTANTS:
        return f" {name} "
    case, letter = ("CAPITAL" if name[0].isupper() else "SMALL"), name.removeprefix("var").upper()
    try:
        return unicodedata.lookup(f"GREEK {case} LETTER {letter.replace('LAMBDA', 'LAMDA')}")
    except KeyError:
        advice = "write the formula as in x^2 + y^2 = 1"
        raise wrong(f"unknown command \\{shortened(name)}", at, advice) from None


def _fraction(text: str, command: re.Match, columns: list[int], braces: dict[int, str]):
    """Notes what the braces of \\frac{a}{b} stand for. braces: by positions; new ones are added."""
    above = _OPENING.match(text, command.end())
    first = above and _closing(text, above.end() - 1)
    below = first and _OPENING.match(text, first + 1)
    second = below and _closing(text, below.end() - 1)
    if not second:
        raise wrong("a fraction without two pairs of braces", columns[command.start()], "write it as (a)/(b)")
    braces[first] = braces.get(first, ")") + "/"
    braces[second] = braces.get(second, ")") + ")"


def _open_around(text: str, at: int, columns: list[int], braces: dict[int, str]):
    """Notes what the braces of {a \\over b} stand for. at: position of the command in `text`. braces: as above."""
    depth = 1
    for start in range(at - 1, -1, -1):
        depth += (text[start] == "}") - (text[start] == "{")
        if not depth and "((" in braces.get(start, ""):
            raise wrong("a second \\over in the same braces", columns[at], "write it as (a)/(b)")
        if not depth and (end := _closing(text, start)):
            braces[start] = braces.get(start, "(") + "("
            braces[end] = ")" + braces.get(end, ")")
            return
    raise wrong("a fraction without braces", columns[at], "write it as (a)/(b)")


def _closing(text: str, start: int) -> int | None:
    """The position of the brace that closes the one at `start`."""
    depth = 0
    for i in range(start, len(text)):
        depth += (text[i] == "{") - (text[i] == "}")
        if not depth:
            return i
    return None
