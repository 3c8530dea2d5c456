"""Preview: a picture in the terminal. Terminals that can show pixels get them, by sixel or by kitty's protocol. Others
get half blocks: characters whose upper half is one pixel and whose lower half is another.

The only access to textual_image, which asks the terminal what it can do, and draws.
"""

import logging
import os
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from visray import terminal
from visray.errors import UserError
from visray.output.curves import Gamma
from visray.output.system_viewer import has_windows

if TYPE_CHECKING:
    from PIL import Image as Pillow

    from visray.output.image import Image
    from visray.tables import Console, RenderableType

# Rows of the terminal that a picture leaves free: for the command and for the next prompt.
FREE_ROWS = 2
BLOCKS = "\u2580\u2588\u2593\u2592\u2591"


@dataclass(frozen=True)
class Screen:
    """A terminal that shows pictures.

    means: how it shows them: "sixel", "kitty", "half blocks", or "shades", which are characters without colour.
    shape: height of a character over its width.
    """

    means: str
    shape: float


def obstacle() -> tuple[str, str] | None:
    """Why standard output shows no pictures, and what does instead; None if it shows them."""
    from visray import tables

    if not terminal.is_terminal():
        instead = "--show opens a window" if has_windows() else "-o picture.png writes a file"
        return "standard output is not a terminal, so it shows no picture", instead
    if tables.console().color_system is None:
        instead = "--show does" if has_windows() else "-o picture.png writes a file"
        return f"a terminal with TERM={os.environ.get('TERM', '')} shows no picture", instead
    if not terminal.can_write(BLOCKS):
        return "the encoding of standard output has no half blocks", "set it to UTF-8, or use --show"
    return None


def screen() -> Screen:
    """The terminal on standard output. Raises a UserError if it shows no pictures.

    It is asked what it can do, and given a tenth of a second for each answer. Call this before a long render: what the
    user types meanwhile would be taken for an answer.
    """
    if found := obstacle():
        raise UserError("preview: " + "; ".join(found))
    # At its import the library asks the terminal, too, and when an answer is missing, it logs that.
    logging.getLogger("textual_image").addHandler(logging.NullHandler())
    with terminal.as_output(False):
        import textual_image.renderable  # noqa: F401
    asks = terminal.answers()
    with terminal.as_output(asks), terminal.answered() if asks else nullcontext():
        means = _means(asks)
        return Screen(means, _shape(means))


def _means(asks: bool) -> str:
    """How the terminal shows pictures. asks: whether it is asked; else it is one that shows characters."""
    from textual_image.renderable import sixel, tgp

    for means, protocol in (("sixel", sixel), ("kitty", tgp)) if asks else ():
        # Keys that are pressed meanwhile make answers for which the library raises any exception.
        with suppress(Exception):
            if protocol.query_terminal_support():
                return means
    return "shades" if os.environ.get("NO_COLOR") else "half blocks"


def _shape(means: str) -> float:
    """Height of a character over its width. It is 2 if the terminal does not say it."""
    from PIL import Image as Pillow

    from visray import tables

    console = tables.console()
    options = console.options.update(width=10000)
    try:
        # A square of 100 rows has so many columns.
        return console.measure(_drawn(Pillow.new("L", (1, 1)), means, "auto", 100), options=options).maximum / 100
    except Exception:  # as above
        return 2.0


def preview(
    image: "Image", gamma: Gamma = "srgb", exposure: float = 0.0, legend: bool = True, on: Screen | None = None
) -> None:
    """Shows a picture in the terminal, as large as fits, but not larger than it is. What is transparent is black.

    gamma, exposure, legend: as in Image.display. on: the terminal; None: that on standard output.
    Raises a UserError if the terminal shows no pictures.
    """
    from PIL import Image as Pillow

    from visray import tables

    on = on or screen()
    # Without the layer A, the colour is that before black.
    opaque = replace(image, layers={name: values for name, values in image.layers.items() if name != "A"})
    picture = Pillow.fromarray(opaque.display(gamma, exposure, legend))
    # In kitty the colour of text is the number of the picture, to the last bit.
    exact = {"color_system": "truecolor", "no_color": False} if on.means == "kitty" else {}
    console = tables.console(**exact)
    with terminal.as_output(False):
        console.print(_drawn(picture, on.means, *_size(picture, on, console)), crop=False, end="")


def _size(picture: "Pillow.Image", on: Screen, console: "Console") -> tuple[int, int]:
    """Columns and rows of the terminal for a picture: its own size, or less so that it fits."""
    has_pixels = on.means in ("sixel", "kitty")
    own = console.measure(_drawn(picture, on.means)).maximum if has_pixels else picture.width
    columns = min(own, console.width)
    rows = columns * picture.height / picture.width / on.shape
    share = min(1, max(console.height - FREE_ROWS, 1) / rows)
    return max(round(columns * share), 1), max(round(rows * share), 1)


def _drawn(
    picture: "Pillow.Image", means: str, columns: int | str | None = None, rows: int | None = None
) -> "RenderableType":
    """A picture as something that rich prints. means: as in Screen. columns, rows: its size; None: its own."""
    from textual_image import renderable

    kinds = {
        "sixel": renderable.SixelImage,
        "kitty": renderable.TGPImage,
        "half blocks": renderable.HalfcellImage,
        "shades": renderable.UnicodeImage,
    }
    return kinds[means](picture, columns, rows)
