"""Boxes of pixels that do not overlap, and the lines of text in them. x grows to the right, y downwards."""

import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

# Distance of the baselines of two lines, and of the first baseline from the top of a block, in heights of text.
LEADING, ASCENT = 1.3, 1.0


class Box(NamedTuple):
    """A rectangle of the picture, in pixels."""

    left: float
    top: float
    right: float
    bottom: float

    def overlaps(self, other: "Box") -> bool:
        return (
            self.left < other.right
            and other.left < self.right
            and self.top < other.bottom
            and other.top < self.bottom
        )  # fmt: skip

    def inside(self, width: float, height: float) -> bool:
        """Whether the box lies in a picture of this size."""
        return self.left >= 0 and self.top >= 0 and self.right <= width and self.bottom <= height


@dataclass(frozen=True)
class TextLine:
    """One line of text.

    x, y: the point of the baseline that `align` says.
    size: height of the text in pixels.
    block: name of the block of the legend that the line belongs to; the lines of a block have the same colours.
    """

    text: str
    x: float
    y: float
    size: float
    block: str
    bold: bool = False
    faint: bool = False
    align: Literal["left", "center", "right"] = "left"


def runs_leftwards(text: str) -> bool:
    """Whether a text runs from right to left, as Arabic and Hebrew do: its first letter does."""
    directions = (unicodedata.bidirectional(c) for c in text)
    return next((d for d in directions if d in ("L", "R", "AL")), "L") != "L"


def stacked(
    lines: Sequence[str],
    left: float,
    right: float,
    top: float,
    size: float,
    block: str,
    bold: bool = False,
    faint: bool = False,
) -> list[TextLine]:
    """Lines of a text below each other, from the height `top` down. They begin at x = `left`, or at `right` if the text
    runs from right to left."""
    x, align = (right, "right") if runs_leftwards(" ".join(lines)) else (left, "left")
    at = (top + size * (ASCENT + i * LEADING) for i in range(len(lines)))
    return [TextLine(line, x, y, size, block, bold, faint, align) for line, y in zip(lines, at)]
