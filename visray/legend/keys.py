"""The keys of a legend: a colour bar or a scale of sizes, laid out in a column. Lengths are in pixels."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from visray.legend.boxes import LEADING, Box, TextLine, stacked
from visray.legend.fonts import Pen
from visray.legend.parts import ColorBar, SizeScale

# Name of the block that all keys are: they have the same colours.
BLOCK = "panel"
# Height of a colour bar, length of a tick and gaps, in heights of text.
STRIP, TICK, GAP = 0.9, 0.3, 0.35
# Text of ticks, in heights of the other text; distance that the texts of ticks keep from each other.
SMALL, APART = 0.88, 0.5


@dataclass(frozen=True, eq=False)
class Strip:
    """A colour bar in whole pixels. pixels: its colours from left to right, sRGB from 0 to 1.

    Shapes: pixels (right - left, 3).
    """

    box: Box
    pixels: np.ndarray


@dataclass(frozen=True)
class Shape:
    """A filled outline. points: its corners; for a disk, its centre and a point of its edge.

    colour: linear Rec. 709, or None: the colour of the text, translucent.
    """

    kind: Literal["polygon", "disk"]
    points: tuple[tuple[float, float], ...]
    colour: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Key:
    """A key laid out. width, height: of what it covers, from the point that it was laid out from."""

    width: float
    height: float
    texts: tuple[TextLine, ...]
    strips: tuple[Strip, ...] = ()
    shapes: tuple[Shape, ...] = ()
    ticks: tuple[tuple[float, float, float], ...] = ()

    def moved(self, x: float, y: float) -> "Key":
        """The key elsewhere: x and y are whole numbers of pixels, and are added to its positions."""
        return Key(
            self.width,
            self.height,
            tuple(replace(t, x=t.x + x, y=t.y + y) for t in self.texts),
            tuple(Strip(Box(b.left + x, b.top + y, b.right + x, b.bottom + y), s.pixels)
                  for s in self.strips for b in (s.box,)),
            tuple(replace(s, points=tuple((a + x, b + y) for a, b in s.points)) for s in self.shapes),
            tuple((at + x, top + y, bottom + y) for at, top, bottom in self.ticks),
        )  # fmt: skip


def key_of(part: ColorBar | SizeScale, width: int, em: float, pen: Pen, no_data: str) -> Key:
    """The key of a colour bar or of a scale, laid out from (0, 0) in a column of `width` pixels.

    em: height of text. no_data: text for missing values.
    """
    lines, _ = pen.wrapped(part.label, em, False, width, 3)
    top = round(em * (len(lines) * LEADING + (GAP if lines else 0)))
    rest = _bar(part, width, top, em, pen, no_data) if isinstance(part, ColorBar) else _scale(part, top, em, pen)
    wide = max([rest.width, *(pen.width(line, em) for line in lines)])
    return replace(rest, width=wide, texts=(*stacked(lines, 0, wide, 0, em, BLOCK), *rest.texts))


def _bar(bar: ColorBar, width: int, top: int, em: float, pen: Pen, no_data: str) -> Key:
    """A colour bar below its label, with triangles for what is beyond its ends."""
    height, small = max(4, round(STRIP * em)), SMALL * em
    end = round(0.8 * height)
    left, right = (end if bar.under else 0), width - (end if bar.over else 0)
    bottom, middle = top + height, top + height / 2
    shapes = []
    if bar.under:
        shapes.append(Shape("polygon", ((left - 1, top), (left - 1, bottom), (0, middle)), bar.under))
    if bar.over:
        shapes.append(Shape("polygon", ((right + 1, top), (right + 1, bottom), (width, middle)), bar.over))
    strip = Strip(Box(left, top, right, bottom), bar.strip(right - left))
    y = bottom + em * TICK + small
    shown = _readable([(left + t.position * (right - left), t.text) for t in bar.ticks], width, small, pen)
    texts = [TextLine(text, x, y, small, BLOCK, align="center") for x, _, text in shown]
    marks = tuple((at, bottom, bottom + em * TICK) for _, at, _ in shown)
    used = bottom + (em * TICK + small * LEADING if shown else 0)
    if bar.missing:
        used, side = round(used + em * GAP), round(small)
        corners = ((0, used), (side, used), (side, used + side), (0, used + side))
        shapes.append(Shape("polygon", corners, bar.missing))
        lines, _ = pen.wrapped(no_data, small, False, width - side - em * GAP, 1)
        texts += [TextLine(line, side + em * GAP, used + 0.85 * small, small, BLOCK) for line in lines]
        used += side + em * 0.2
    return Key(width, used, tuple(texts), (strip,), tuple(shapes), marks)


def _readable(ticks: list[tuple[float, str]], width: float, size: float, pen: Pen) -> list[tuple[float, float, str]]:
    """The ticks whose texts have room, as (centre of the text, position, text). Texts at the ends are moved inwards.

    ticks: positions and texts, from left to right. width: width of the column.

    If there is no room for all, every second tick is tried, then every third, and so on.
    """
    halves = [pen.width(text, size) / 2 for _, text in ticks]
    placed = [(min(max(at, half), width - half), at, text) for (at, text), half in zip(ticks, halves)]
    for step in range(1, len(ticks) + 1):
        kept = list(range(0, len(ticks), step))
        if all(placed[j][0] - halves[j] - placed[i][0] - halves[i] >= APART * size for i, j in pairwise(kept)) and all(
            2 * halves[i] <= width for i in kept
        ):
            return [placed[i] for i in kept]
    return []


def _scale(scale: SizeScale, top: int, em: float, pen: Pen) -> Key:
    """Gizmos side by side on one line, each with its value below."""
    small, x = SMALL * em, 0.0
    tallest = max(size for _, size in scale.entries)
    base = top + max(tallest, 2)
    texts, shapes = [], []
    for text, size in scale.entries:
        across = min(0.6 * em, 8.0) if scale.shape == "bar" else size
        column = max(across, pen.width(text, small))
        middle = x + column / 2
        if scale.shape == "disk":
            shapes.append(Shape("disk", ((middle, base - size / 2), (middle + size / 2, base - size / 2))))
        else:
            a, b, high = middle - across / 2, middle + across / 2, base - size
            shapes.append(Shape("polygon", ((a, high), (b, high), (b, base), (a, base))))
        texts.append(TextLine(text, middle, base + em * 0.2 + small, small, BLOCK, align="center"))
        x += column + em
    return Key(x - em, base + em * 0.2 + small * LEADING, tuple(texts), shapes=tuple(shapes))


def width_of(scale: SizeScale, em: float, pen: Pen) -> float:
    """Width of a scale of sizes, without its label."""
    across = (min(0.6 * em, 8.0) if scale.shape == "bar" else size for _, size in scale.entries)
    columns = [max(a, pen.width(text, SMALL * em)) for a, (text, _) in zip(across, scale.entries)]
    return sum(columns) + em * (len(columns) - 1)
