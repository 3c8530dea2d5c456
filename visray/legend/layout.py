"""Where everything in a legend lies: the heading at the top, the source line at the bottom, the keys in panels between
them, and the names of places where there is room. Nothing overlaps. Lengths are in pixels."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count, takewhile
from math import ceil

from visray.legend.boxes import ASCENT, LEADING, Box, TextLine, stacked
from visray.legend.fonts import Pen
from visray.legend.keys import Key, key_of, width_of
from visray.legend.parts import ColorBar, LegendContent, SizeScale
from visray.legend.placing import Label, labels_of

# A film with a shorter side has no legend, because its text would be illegible or cover the picture.
LEAST_SIDE = 160
# Height of text: of a film with REFERENCE_PIXELS, the least legible one, and the factor between two attempts.
TEXT, REFERENCE_PIXELS, LEGIBLE, SHRUNK = 11.0, 640 * 360, 7.0, 0.92
# Sizes of title, subtitle and source, margin of the film, padding of panels, gap between keys, usual and least width of
# a key: all in heights of text.
TITLE, SUBTITLE, SOURCE, MARGIN, PADDING, BETWEEN, COLUMN = 1.5, 1.1, 0.82, 0.9, 0.7, 0.7, 13.0
LEAST_COLUMN = 4.0
# Share of the usual size of the text down to which a single column or row of keys is tried first.
ONE_GROUP = 0.7
# Largest share of the film's height for the heading and of its width for panels; largest number of source lines.
HEADING_SHARE, PANEL_SHARE, SOURCE_LINES = 0.3, 0.6, 3


@dataclass(frozen=True)
class Layout:
    """A legend laid out.

    em: height of text in pixels.
    texts: lines of heading and source. keys: keys in place. labels: names of places.
    boxes: by the name of a block, the box that holds it: "heading", "source", "panel 0", "panel 1" and so on.
    notes: what is left out, each a sentence for users.
    """

    em: float
    texts: tuple[TextLine, ...] = ()
    keys: tuple[Key, ...] = ()
    labels: tuple[Label, ...] = ()
    boxes: tuple[tuple[str, Box], ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def panels(self) -> list[Box]:
        return [box for name, box in self.boxes if name.startswith("panel")]


def layout(content: LegendContent, width: int, height: int, pen: Pen) -> Layout:
    """The legend laid out for a film of width x height pixels.

    The text is as large as the size asks for, and smaller if the keys have no room. If there is none even with the
    smallest text, the last keys are left out, with a note.
    """
    em = max(TEXT * (width * height / REFERENCE_PIXELS) ** 0.4, LEGIBLE + 1) * content.size
    if min(width, height) < LEAST_SIDE:
        note = f"legend: left out, because {width} x {height} pixels are too few for text; give {LEAST_SIDE} or more"
        return Layout(em, notes=(note,))
    parts: list[ColorBar | SizeScale] = [*content.bars, *content.sizes]
    sizes = [em, *takewhile(lambda x: x >= min(LEGIBLE, em), (em * SHRUNK**k for k in count(1)))]
    # One column or row with smaller text covers less of the picture than two.
    tries = [(size, 1) for size in sizes if size >= ONE_GROUP * em] + [(size, len(parts)) for size in sizes]
    for kept in range(len(parts), -1, -1):
        for size, groups in tries:
            found = _attempt(content, parts[:kept], width, height, size, groups, pen)
            if found is not None:
                return _with_labels(found, content, width, height, pen, parts[kept:])
    raise AssertionError("without keys a legend always has room")


def _with_labels(
    found: Layout, content: LegendContent, width: int, height: int, pen: Pen, dropped: Sequence[ColorBar | SizeScale]
) -> Layout:
    """The layout with the names of places, and with notes on what is left out. dropped: keys that have no room."""
    notes = list(found.notes)
    if dropped:
        names = ", ".join(dict.fromkeys(part.label or "a layer" for part in dropped))
        notes.append(f"legend: {width} x {height} pixels have no room for the key of {names}; make the film larger")
    taken = [box for _, box in found.boxes]
    labels, left_out = labels_of(content.places, taken, width, height, found.em, pen)
    if left_out:
        have = "has" if len(left_out) == 1 else "have"
        count = f"{len(left_out)} of {len(content.places)} names of places"
        notes.append(f"legend: {count} {have} no room: {_some(left_out)}")
    return replace(found, labels=tuple(labels), notes=tuple(notes))


def _some(names: Sequence[str], most: int = 5) -> str:
    """The first names of a list as text, and how many more there are."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def _attempt(
    content: LegendContent,
    parts: Sequence[ColorBar | SizeScale],
    width: int,
    height: int,
    em: float,
    groups: int,
    pen: Pen,
) -> Layout | None:
    """The legend with text of height `em` and keys in at most so many columns or rows; None if they do not fit."""
    margin, notes = em * MARGIN, []
    texts, top = _heading(content, width, height, em, pen, notes)
    boxes = [("heading", _around(texts, pen))] if texts else []
    lines, cut = pen.wrapped(content.source, SOURCE * em, False, width - 2 * margin, SOURCE_LINES)
    bottom = height - margin - len(lines) * SOURCE * em * LEADING
    if cut:
        notes.append("legend: the source line is too long, and cut; shorten data.legend.source")
    if lines:
        source = stacked(lines, margin, width - margin, bottom, SOURCE * em, "source", faint=True)
        boxes.append(("source", _around(source, pen)))
        texts, bottom = [*texts, *source], bottom - 0.4 * em
    room = Box(margin, top, width - margin, bottom)
    keys = _keys(parts, room, em, pen, content.no_data)
    if keys is None:
        return None
    if content.position == "bottom":
        placed = _rows(keys[0], room, em, groups)
    else:
        placed = _columns(*keys, room, em, groups, content.position == "right")
    if placed is None:
        return None
    in_place, panels = placed
    boxes += [(f"panel {i}", panel) for i, panel in enumerate(panels)]
    return Layout(em, tuple(texts), tuple(in_place), (), tuple(boxes), tuple(notes))


def _heading(
    content: LegendContent, width: int, height: int, em: float, pen: Pen, notes: list[str]
) -> tuple[list[TextLine], float]:
    """The lines of title, subtitle and date, and the height below them. notes: gets a note if they are cut."""
    margin, texts = em * MARGIN, []
    top, end = margin, HEADING_SHARE * height
    for text, size, bold, name in ((content.title, TITLE * em, True, "title"),
                                   (content.subtitle, SUBTITLE * em, False, "subtitle"),
                                   (content.date, TITLE * em, False, "date")):  # fmt: skip
        # A long subtitle leaves room for the date.
        below = TITLE * em * LEADING if content.date and name != "date" else 0.0
        most = max(int((end - top - below) / (size * LEADING)), 1 if bold or name == "date" else 0)
        lines, cut = pen.wrapped(text, size, bold, width - 2 * margin, most) if text.strip() else ([], False)
        if cut:
            notes.append(f"legend: the {name} is too long, and cut; shorten data.legend.{name}")
        texts += stacked(lines, margin, width - margin, top, size, "heading", bold)
        top += len(lines) * size * LEADING
    return texts, top + (0.4 * em if texts else 0)


def _around(texts: Sequence[TextLine], pen: Pen) -> Box:
    """The box around lines, the topmost first, that begin at the left or at the right."""
    ends = [(line.x, line.align, pen.width(line.text, line.size, line.bold)) for line in texts]
    left = min(x - wide if align == "right" else x for x, align, wide in ends)
    right = max(x if align == "right" else x + wide for x, align, wide in ends)
    first, last = texts[0], texts[-1]
    return Box(left, first.y - ASCENT * first.size, right, last.y + (LEADING - ASCENT) * last.size)


def _keys(
    parts: Sequence[ColorBar | SizeScale], room: Box, em: float, pen: Pen, no_data: str
) -> tuple[list[Key], int] | None:
    """The keys, each laid out by itself, and the width of all of them; None if the room is not as wide.

    room: what is left of the film. no_data: text for missing values.
    """
    if not parts:
        return [], 0
    widest = max((width_of(part, em, pen) for part in parts if isinstance(part, SizeScale)), default=0.0)
    width = int(min(max(COLUMN * em, ceil(widest)), room.right - room.left - 2 * PADDING * em))
    if width < max(widest, LEAST_COLUMN * em):
        return None
    return [key_of(part, width, em, pen, no_data) for part in parts], width


def _columns(
    keys: list[Key], width: int, room: Box, em: float, most: int, right: bool
) -> tuple[list[Key], list[Box]] | None:
    """Keys below each other in at most `most` panels at the right or the left edge of a room; None if they do not
    fit."""
    if not keys:
        return [], []
    padding, gap = round(PADDING * em), round(BETWEEN * em)
    columns: list[list[Key]] = [[]]
    for key in keys:
        if columns[-1] and _tall([*columns[-1], key], gap) + 2 * padding > room.bottom - room.top:
            columns.append([])
        columns[-1].append(key)
    outer = width + 2 * padding
    used = len(columns) * outer + (len(columns) - 1) * gap
    too_wide = len(columns) > 1 and used > PANEL_SHARE * (room.right - room.left)
    if len(columns) > most or too_wide or any(_tall(c, gap) + 2 * padding > room.bottom - room.top for c in columns):
        return None
    placed, panels = [], []
    for i, column in enumerate(columns):
        x = int(room.right) - (i + 1) * outer - i * gap if right else int(room.left) + i * (outer + gap)
        tall = _tall(column, gap) + 2 * padding
        y = int(room.bottom - tall)
        panels.append(Box(x, y, x + outer, y + tall))
        at = y + padding
        for key in column:
            placed.append(key.moved(x + padding, at))
            at += round(key.height) + gap
    return placed, panels


def _tall(keys: Sequence[Key], gap: int) -> int:
    """Height of keys below each other."""
    return sum(round(key.height) for key in keys) + gap * (len(keys) - 1)


def _rows(keys: list[Key], room: Box, em: float, most: int) -> tuple[list[Key], list[Box]] | None:
    """Keys side by side in a panel at the bottom of a room, in at most `most` rows; None if they do not fit."""
    if not keys:
        return [], []
    padding, gap = round(PADDING * em), round(2 * BETWEEN * em)
    wide, rows = room.right - room.left - 2 * padding, [[]]
    for key in keys:
        if rows[-1] and _wide([*rows[-1], key], gap) > wide:
            rows.append([])
        rows[-1].append(key)
    tall = sum(max(round(key.height) for key in row) for row in rows) + gap * (len(rows) - 1) + 2 * padding
    if len(rows) > most or tall > room.bottom - room.top:
        return None
    outer = max(_wide(row, gap) for row in rows) + 2 * padding
    x, y = int(room.left + (room.right - room.left - outer) / 2), int(room.bottom - tall)
    placed, top = [], y + padding
    for row in rows:
        left = x + padding
        for key in row:
            placed.append(key.moved(left, top))
            left += ceil(key.width) + gap
        top += max(round(key.height) for key in row) + gap
    return placed, [Box(x, y, x + outer, y + tall)]


def _wide(keys: Sequence[Key], gap: int) -> int:
    """Width of keys side by side."""
    return sum(ceil(key.width) for key in keys) + gap * (len(keys) - 1)
