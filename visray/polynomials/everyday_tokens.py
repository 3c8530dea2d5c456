"""Divides a formula, as people write it, into tokens: numbers, names, functions, operators and brackets.

Letters that stand together are a product of one-letter names, as xy and ax are, unless they are a known word.
"""

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass

from visray.polynomials.everyday_characters import (
    BOTH_SIGNS,
    GREEK_WORDS,
    ROOT,
    SUBSCRIPTS,
    SUPERSCRIPTS,
    greek,
    plain,
    renamed,
    wrong,
)
from visray.polynomials.everyday_latex import without_latex
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
        self.text, self.columns = without_latex(*plain(text))
        self.columns.append(len(text))
        small = any(c in AXES for c in self.text)
        self.capitals = not small and any(c in "XYZ" for c in self.text) and not set("XYZ") & set(known)
        self.numbered = not any(c in "yzYZ" for c in self.text)
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
                parts = re.fullmatch(r"(\d+)e([+-])(\d+)", number[0], re.IGNORECASE)
                if parts:
                    product = "{}*e {} {}".format(*parts.groups())
                    self.note(f"{number[0]} is read as one number; write {product} for a product with e")
                yield self.token("number", number[0], i, end)
            elif c.isascii() and c.isalpha():
                yield from self._words(i, end := self._run(i, str.isalpha))
                end = self.read_to
            elif name := greek(c):
                constant = name in CONSTANTS
                end = i + 1 if constant else self._after_subscript(i + 1)
                yield self.token("name", name if constant else name + self._subscript(i + 1), i, end)
            else:
                end = i + 2 if text[i : i + 2] in ("**", "==") else i + 1
                kind = {"**": "^", "==": "=", "[": "(", "{": "(", "]": ")", "}": ")", ROOT: "function", BOTH_SIGNS: "+"}
                sign = kind.get(text[i:end], text[i:end])
                kept = "" if sign in (" ", "$") else sign
                if sign in SUBSCRIPTS or sign in ("_", "."):
                    raise wrong(f"unexpected {sign!r}", self.columns[i], "a subscript belongs to a letter, as in a_1")
                yield self.token(kept, "sqrt" if c == ROOT else text[i:end], i, end)
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
        if letter == "x" and self.numbered and subscript in ("_1", "_2", "_3"):
            self.note("x_1, x_2 and x_3 are read as x, y and z")
            return stop, "letter", AXES[int(subscript[1]) - 1]
        if axis and subscript:
            shown, number = self.text[i:stop], subscript
            power = f"write {letter.lower()}^{number} for the power; " if subscript.isdigit() else ""
            raise wrong(f"unknown name {shown}", at, f"{power}the coordinates are x, y and z")
        if letter == EULER and not subscript:
            if not re.match(r"\s*(\^|\*\*)", self.text[i + 1 :]):
                self.note("e is read as the number 2.718...; it is a parameter if it has a value")
            return i + 1, "name", EULER
        return stop, "letter", letter.lower() if axis else letter + subscript
