"""Divides a formula, as people write it, into tokens: numbers, names, functions, operators and brackets.

Letters that stand together are a product of one-letter names, as xy and ax are, unless they are a known word.
"""

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass

from visray.polynomials.everyday_characters import (
    GREEK_WORDS,
    ROOT,
    SUBSCRIPTS,
    SUPERSCRIPTS,
    greek,
    plain,
    renamed,
    wrong,
)
from visray.polynomials.literals import AXES, CONSTANTS, EULER, FUNCTIONS, LITERAL, shortened

ALIASES = {"ln": "log", "arcsin": "asin", "arccos": "acos", "arctan": "atan"}
# Words that are read as functions so that a message can name them.
UNKNOWN_FUNCTIONS = set(
    "abs min max sinh cosh tanh cot sec csc floor ceil sign sgn mod cbrt root pow sqr atan2 round".split()  # noqa: SIM905
)
_WORDS = {"sqrt", *FUNCTIONS, *ALIASES}
# Greatest number of letters other than x, y and z that stand together. More of them are a word that is not known.
MOST_LETTERS = 3
_SUBSCRIPT = re.compile(r"_\{(\w+)\}|_([A-Za-z]+|\d+)|(\d+)", re.ASCII)
_LATEX_SIGNS = {"cdot": "*", "times": "*", "ast": "*", "div": "/", "left": "", "right": "", "quad": "", "qquad": ""}
_LATEX_SIGNS |= dict.fromkeys(r",;:! ", "") | {"{": "(", "}": ")"}
_CLOSING = {"(": ")", "[": "]", "{": "}"}


@dataclass(frozen=True)
class Token:
    """One sign or word of a formula.

    kind: "number", "name", "function", "exponent" (a number that is written above the line), or the sign itself:
        + - * / ^ ( ) = and the comma. All kinds of brackets are ( and ).
    text: what it is in the strict grammar.
    at, end: positions in the user's text before and behind it.
    """

    kind: str
    text: str
    at: int
    end: int


class Tokens:
    """The tokens of a formula, and notes about how letters were read.

    known: names of parameters that stay whole.
    """

    def __init__(self, text: str, known: Collection[str]):
        self.user, self.known, self.notes = text, sorted(known, key=len, reverse=True), {}
        self.text, self.columns = plain(text)
        self.columns.append(len(text))
        small = any(c in AXES for c in self.text)
        self.capitals = not small and any(c in "XYZ" for c in self.text) and not set("XYZ") & set(known)
        # Signs that \frac puts behind closing brackets.
        self.after: dict[int, str] = {}
        self.tokens = [t for t in self._all() if t.kind]
        if any(re.fullmatch("[lL]am(_.*)?", t.text) for t in self.tokens) and not re.search("[lL]am(?!b|d)", text):
            self.note("lambda is called lam, because lambda has another meaning in Python")
        if self.capitals:
            self.note("capital X, Y and Z are read as x, y and z")

    def note(self, text: str):
        """Adds a sentence to the notes, once."""
        self.notes[text] = None

    def token(self, kind: str, text: str, start: int, end: int) -> Token:
        """A token for the characters from `start` to `end` of the plain text."""
        return Token(kind, text, self.columns[start], self.columns[end - 1] + 1)

    def _all(self) -> Iterator[Token]:
        """Yields all tokens. Those of kind "" have no meaning."""
        i, text = 0, self.text
        while i < len(text):
            c = text[i]
            if c in SUPERSCRIPTS:
                yield from self._raised(i, end := self._run(i, SUPERSCRIPTS))
            elif number := LITERAL.match(text, i):
                end = number.end()
                if re.search(r"e[+-]", number[0], re.IGNORECASE) and "." not in number[0]:
                    self.note(f"{number[0]} is read as one number; write 2*e - 3 for a product with e")
                yield self.token("number", number[0], i, end)
            elif c.isascii() and c.isalpha():
                yield from self._words(i, end := self._run(i, str.isalpha))
                end = self.read_to
            elif name := greek(c):
                constant = name in CONSTANTS
                end = i + 1 if constant else self._after_subscript(i + 1)
                yield self.token("name", name if constant else name + self._subscript(i + 1), i, end)
            elif c == "\\":
                yield from self._latex(i)
                end = self.read_to
            else:
                end = i + 2 if text[i : i + 2] in ("**", "==") else i + 1
                kind = {"**": "^", "==": "=", "[": "(", "{": "(", "]": ")", "}": ")", ROOT: "function"}
                sign = kind.get(text[i:end], text[i:end])
                kept = "" if sign in (" ", "$") else sign
                if sign in SUBSCRIPTS or sign in ("_", "."):
                    raise wrong(f"unexpected {sign!r}", self.columns[i], "a subscript belongs to a letter, as in a_1")
                yield self.token(kept, "sqrt" if c == ROOT else text[i:end], i, end)
                yield from (self.token(s, s, i, end) for s in self.after.get(i, ""))
            i = end

    def _run(self, start: int, kind) -> int:
        """The end of the run of characters of one kind (a function or a collection) that begins at `start`."""
        test = kind if callable(kind) else kind.__contains__
        end = start
        while end < len(self.text) and self.text[end].isascii() == self.text[start].isascii() and test(self.text[end]):
            end += 1
        return end

    def _raised(self, start: int, end: int) -> Iterator[Token]:
        """Yields ^ and what is written above the line."""
        raised = "".join(SUPERSCRIPTS[c] for c in self.text[start:end]).removeprefix("(").removesuffix(")")
        yield self.token("^", "^", start, start + 1)
        yield self.token("exponent", raised, start, end)

    def _subscript(self, start: int) -> str:
        """What a subscript adds to the name before it, as 1 in a1 and _1 in a_1; "" if there is none."""
        if (end := self._run(start, SUBSCRIPTS)) > start:
            return "_" + "".join(SUBSCRIPTS[c] for c in self.text[start:end])
        match = _SUBSCRIPT.match(self.text, start)
        return "" if not match else match[3] or f"_{match[1] or match[2]}"

    def _after_subscript(self, start: int) -> int:
        """The position after the subscript that may begin at `start`."""
        end = self._run(start, SUBSCRIPTS)
        match = _SUBSCRIPT.match(self.text, start)
        return end if end > start else match.end() if match else start

    def _words(self, start: int, end: int) -> Iterator[Token]:
        """Yields the names and functions in a run of letters, and perhaps in a subscript. Sets read_to behind them."""
        i, single, words = start, [], []
        while i < end:
            stop, kind, name = self._word(i, start, end)
            self.read_to = stop
            if kind == "letter":
                kind = "name"
                single += [name] if name not in AXES else []
            words.append(name)
            yield self.token(kind, name, i, stop)
            i = stop
        run = self.text[start:end]
        if len(single) > MOST_LETTERS or len(set(single)) < len(single):
            at, product = self.columns[start], "*".join(run)
            raise wrong(f"unknown name {shortened(run)}", at, f"write {shortened(product)} if it is a product")
        if len(single) > 1:
            run = self.text[start : self.read_to]
            self.note(f"{run} is read as {'*'.join(words)}; a parameter that is given as {run} is one name")

    def _word(self, i: int, start: int, end: int) -> tuple[int, str, str]:
        """(end, kind, text) of the word that begins at i, in the run of letters from `start` to `end`."""
        text = self.text
        known = [n for n in self.known if text.startswith(n, i) and not re.match(r"[0-9_]", text[i + len(n) :][:1])]
        run = text[i:end]
        if i == start and run in GREEK_WORDS and run not in known:
            stop = self._after_subscript(end)
            return stop, "name", renamed(run) + self._subscript(end)
        called = re.match(r"\s*\(", text[end:]) is not None
        words = [w for w in _WORDS if run.startswith(w) and (i == start or len(w) == len(run))]
        words += [run] if run in UNKNOWN_FUNCTIONS and called and run not in known else []
        words += [c for c in CONSTANTS if run.startswith(c)]
        word = max(words, key=len, default="")
        if known and len(known[0]) >= max(len(word), 1) and known[0] not in words:
            return i + len(known[0]), "name", known[0]
        if word:
            kind = "name" if word in CONSTANTS else "function"
            return i + len(word), kind, ALIASES.get(word, word)
        return self._letter(i, end)

    def _letter(self, i: int, end: int) -> tuple[int, str, str]:
        """(end, kind, text) of one letter with its subscript."""
        letter, at = self.text[i], self.columns[i]
        axis = letter in AXES or (self.capitals and letter in "XYZ")
        if letter in "XYZ" and not axis and letter not in self.known:
            raise wrong(f"capital {letter} besides small letters", at, f"write {letter.lower()}")
        stop = self._after_subscript(i + 1)
        subscript = self._subscript(i + 1)
        if axis and subscript:
            shown, number = self.text[i:stop], subscript.strip("_")
            power = f"{letter.lower()}^{number} for the power" if number.isdigit() else f"{letter.lower()}"
            raise wrong(f"unknown name {shown}", at, f"write {power}; the coordinates are x, y and z")
        if letter == EULER and not subscript:
            return i + 1, "name", EULER
        return stop, "letter", letter.lower() if axis else letter + subscript

    def _latex(self, i: int) -> Iterator[Token]:
        """Yields the tokens of a command of LaTeX. Sets read_to behind it."""
        match = re.match(r"\\([A-Za-z]+|.)?", self.text[i:])
        name, self.read_to = match[1] or "", i + match.end()
        at, short = self.columns[i], name.removeprefix("var")
        if name in _LATEX_SIGNS:
            sign = _LATEX_SIGNS[name]
            yield self.token(sign, sign, i, self.read_to)
        elif name in ("frac", "dfrac", "tfrac"):
            yield from self._fraction(i)
        elif name in _WORDS:
            if re.match(r"\s*\[", self.text[self.read_to :]):
                raise wrong("a root of another degree", at, "write 2^(1/3) for the cube root of 2")
            yield self.token("function", ALIASES.get(name, name), i, self.read_to)
        elif short in GREEK_WORDS or short in CONSTANTS:
            subscript = "" if short in CONSTANTS else self._subscript(self.read_to)
            self.read_to = self.read_to if short in CONSTANTS else self._after_subscript(self.read_to)
            yield self.token("name", renamed(short) + subscript, i, self.read_to)
        else:
            raise wrong(f"unknown command \\{shortened(name)}", at, "write the formula as in x^2 + y^2 = 1")

    def _fraction(self, i: int) -> Iterator[Token]:
        """Yields the bracket before a fraction \\frac{a}{b}, and notes the signs that follow its parts."""
        above = re.match(r"\s*\{", self.text[self.read_to :])
        first = above and self._closing(self.read_to + above.end() - 1)
        below = first and re.match(r"\s*\{", self.text[first + 1 :])
        second = below and self._closing(first + below.end())
        if not second:
            raise wrong("a fraction without two pairs of braces", self.columns[i], "write it as (a)/(b)")
        self.after[first] = "/"
        self.after[second] = ")" + self.after.get(second, "")
        yield self.token("(", "(", i, self.read_to)

    def _closing(self, start: int) -> int | None:
        """The position of the bracket that closes the one at `start`."""
        depth = 0
        for i in range(start, len(self.text)):
            depth += (self.text[i] == "{") - (self.text[i] == "}")
            if not depth:
                return i
        return None
