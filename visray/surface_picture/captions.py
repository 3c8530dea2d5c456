"""Captions: two lines of text under a picture, drawn with the fonts of the legends."""

import numpy as np

from visray.legend.boxes import TextLine
from visray.legend.drawing import INKS, text_picture
from visray.legend.fonts import Pen, fonts_for, quiet

# Heights of both lines, and the heights of their baselines from the top of the caption, as shares of its height.
SIZES, BASELINES = (0.36, 0.28), (0.42, 0.82)
# Share of the width that a line may take.
WIDEST = 0.98


def captioned(picture: np.ndarray, title: str, below: str, height: int) -> np.ndarray:
    """A picture with a white strip under it, in which a bold title and a line below it stand in the middle.

    height: height of the strip in pixels. A line that is too wide is drawn smaller.

    Shapes: picture uint8 (H, W, 3); the result (H + height, W, 3).
    """
    width = picture.shape[1]
    with quiet():
        pen = Pen(fonts_for((title, below)))
        lines = []
        for text, size, baseline in zip((title, below), SIZES, BASELINES):
            bold, em = text is title, size * height
            # Widths of letters are rounded to pixels, so they do not shrink as much as their size.
            while pen.width(text, em, bold) > WIDEST * width and em > 1:
                em *= 0.96
            lines.append(
                TextLine(text, 0.5 * width, baseline * height, em, "caption", bold=bold, faint=not bold, align="center")
            )
        strip = text_picture(lines, INKS["light"], pen, width, height)
    return np.concatenate([picture, strip])
