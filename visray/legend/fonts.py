"""Fonts for any script: those that matplotlib finds on the machine, and DejaVu Sans, which comes with matplotlib.

matplotlib draws a character with the first font of a list that has it. It also joins Arabic letters and orders lines
that run from right to left.
"""

import logging
import unicodedata
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

from visray.terminal import printable

BASE = "DejaVu Sans"
# Drawn in place of a character that no font has; BASE has it.
UNKNOWN = "\N{WHITE SQUARE}"
# Fonts whose glyphs are not those of the characters: of TeX, and one that shows the name of the script.
_UNFIT = ("cm", "STIXSize", "STIXNonUnicode", "Last Resort")
# Characters of these categories have no glyph: controls, formats, and surrogates.
_WITHOUT_GLYPH = ("Cc", "Cf", "Cs")
# Largest number of characters that a note lists.
LISTED = 20


@dataclass(frozen=True)
class Fonts:
    """Families of fonts for some texts, in the order in which a character is looked up.

    missing: the characters that none of them has. notes: sentences for users.
    """

    families: tuple[str, ...]
    missing: frozenset[str]
    notes: tuple[str, ...]

    def drawable(self, text: str) -> str:
        """The text as one line, with a square for each missing character."""
        line = (" " if c.isspace() else c for c in text)
        return "".join(UNKNOWN if c in self.missing else c for c in line if not _is_unseen(c) or self._has(c))

    def _has(self, c: str) -> bool:
        return any(c in _characters(family) for family in self.families)


def fonts_for(texts: Iterable[str], wanted: str | None = None) -> Fonts:
    """Fonts that together have the characters of all texts, as far as there are any.

    wanted: family that is looked up first, or None.
    """
    found = _families()
    families, notes = [BASE], []
    if wanted in found:
        families.insert(0, wanted)
    elif wanted is not None:
        notes.append(f'legend: there is no font "{printable(wanted)}" on this machine; {BASE} is used')
    needed = {c for text in texts for c in text if not c.isspace() and not _is_unseen(c)}
    missing = needed.difference(*map(_characters, families))
    others = sorted(found - set(families))
    while missing and others:
        # The family that has most of the missing characters; of equals, the first by name.
        best = max(others, key=lambda name: len(missing & _characters(name)))
        if not missing & _characters(best):
            break
        families.append(best)
        others.remove(best)
        missing -= _characters(best)
    if missing:
        notes.append(_note(sorted(missing)))
    return Fonts(tuple(dict.fromkeys(families)), frozenset(missing), tuple(notes))


def _is_unseen(c: str) -> bool:
    """Whether a character has no glyph of its own: controls, joiners, marks of direction, and variation selectors."""
    is_selector = "\N{VARIATION SELECTOR-1}" <= c <= "\N{VARIATION SELECTOR-16}"
    return is_selector or (unicodedata.category(c) in _WITHOUT_GLYPH and not c.isspace())


def _note(missing: list[str]) -> str:
    """The note that names the characters which no font has."""
    more = f" and {len(missing) - LISTED} more" if len(missing) > LISTED else ""
    one = len(missing) == 1
    listed = f"{' '.join(missing[:LISTED])}{more}"
    text = f"legend: no font on this machine has the character{'' if one else 's'} {listed}"
    return f"{text}; a square is drawn for each; install a font of that script, and name it in data.legend.font"


@cache
def _families() -> frozenset[str]:
    """The families of fonts that matplotlib finds and that fit."""
    from matplotlib.font_manager import fontManager

    return frozenset(font.name for font in fontManager.ttflist if not font.name.startswith(_UNFIT))


@cache
def _characters(family: str) -> frozenset[str]:
    """The characters that both the regular and the bold font of a family have."""
    from matplotlib.font_manager import FontProperties, findfont, get_font

    files = {str(findfont(FontProperties(family=[family], weight=weight))) for weight in ("normal", "bold")}
    return frozenset.intersection(*(frozenset(map(chr, get_font(file).get_charmap())) for file in sorted(files)))


class Pen:
    """Measures and wraps text. fonts: the fonts of all texts."""

    def __init__(self, fonts: Fonts):
        from matplotlib.backends.backend_agg import RendererAgg

        self.fonts, self._renderer = fonts, RendererAgg(1, 1, 72)
        self._widths: dict[tuple, float] = {}
        self._wrapped: dict[tuple, tuple[list[str], bool]] = {}

    def properties(self, size: float, bold: bool) -> Any:
        """matplotlib's properties of a font. size: height of the text in pixels."""
        from matplotlib.font_manager import FontProperties

        return FontProperties(
            family=list(self.fonts.families),
            style="normal",
            variant="normal",
            weight="bold" if bold else "normal",
            stretch="normal",
            size=size,
            math_fontfamily="dejavusans",
        )

    def width(self, text: str, size: float, bold: bool = False) -> float:
        """Width of a line in pixels."""
        key = text, size, bold
        if key not in self._widths:
            properties = self.properties(size, bold)
            drawable = self.fonts.drawable(text)
            width = self._renderer.get_text_width_height_descent(drawable, properties, False)[0] if drawable else 0.0
            self._widths[key] = float(width)
        return self._widths[key]

    def wrapped(self, text: str, size: float, bold: bool, width: float, most: int) -> tuple[list[str], bool]:
        """The text as lines, each no wider than `width` pixels, and whether it was cut to at most `most` lines.

        A word that is too wide, or a script without spaces, is broken between any two characters.
        """
        key = text, size, bold, width, most
        if key not in self._wrapped:
            self._wrapped[key] = self._wrap(*key)
        return self._wrapped[key]

    def _wrap(self, text: str, size: float, bold: bool, width: float, most: int) -> tuple[list[str], bool]:
        """As `wrapped`."""
        lines: list[str] = []
        rest = " ".join(text.split())
        while rest and len(lines) < most:
            line, rest = self._first_line(rest, size, bold, width)
            lines.append(line)
        if rest and lines:
            fits = partial(self._fits, size=size, bold=bold, width=width)
            last = lines[-1]
            lines[-1] = last[: _largest(len(last), lambda n: fits(f"{last[:n].rstrip()}…"))].rstrip() + "…"
        return lines, bool(rest)

    def _fits(self, text: str, size: float, bold: bool, width: float) -> bool:
        return self.width(text, size, bold) <= width

    def _first_line(self, text: str, size: float, bold: bool, width: float) -> tuple[str, str]:
        """The first line of a text, which has at least one character, and the rest."""
        words = text.split(" ")
        count = _largest(len(words), lambda n: self._fits(" ".join(words[:n]), size, bold, width))
        if count:
            return " ".join(words[:count]), " ".join(words[count:])
        end = max(1, _largest(len(words[0]), lambda n: self._fits(text[:n], size, bold, width)))
        # A mark stays with the letter before it.
        while end > 1 and end < len(text) and unicodedata.combining(text[end]):
            end -= 1
        return text[:end], text[end:].lstrip()


def _largest(most: int, holds: Callable[[int], bool]) -> int:
    """The largest n, from 0 to `most`, for which `holds` is true. Domain: it holds for 0 and for all smaller n."""
    low, step = 0, 1
    while low + step <= most and holds(low + step):
        low, step = low + step, 2 * step
    high = min(low + step, most + 1)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


@contextmanager
def quiet() -> Iterator[None]:
    """Drops what matplotlib says about fonts in a `with` block: that a family has no bold font, or that it looks for
    fonts for the first time, for example."""
    loggers = [logging.getLogger(name) for name in ("matplotlib", "matplotlib.font_manager")]

    def drop(record: logging.LogRecord) -> bool:
        return False

    for logger in loggers:
        logger.addFilter(drop)
    try:
        yield
    finally:
        for logger in loggers:
            logger.removeFilter(drop)
