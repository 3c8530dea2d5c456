"""Draws a legend with matplotlib, as a picture with a transparent background.

matplotlib's global state is neither used nor changed: no pyplot, and no settings but those that are passed.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from visray.legend.boxes import Box, TextLine
from visray.legend.fonts import Pen, fonts_for, quiet
from visray.legend.keys import Key, Shape
from visray.legend.layout import Layout, layout
from visray.legend.parts import LegendContent
from visray.output.curves import LUMINANCE, curve, linear


@dataclass(frozen=True)
class Ink:
    """The colours of a part of the legend: red, green, blue and opacity for a screen, sRGB from 0 to 1."""

    text: tuple[float, float, float, float]
    faint: tuple[float, float, float, float]
    halo: tuple[float, float, float, float]
    panel: tuple[float, float, float, float]
    outline: tuple[float, float, float, float]
    shape: tuple[float, float, float, float]


# On light pictures, and on dark ones.
INKS = {
    "light": Ink(
        text=(0.07, 0.07, 0.09, 1), faint=(0.2, 0.2, 0.22, 1), halo=(1, 1, 1, 0.75), panel=(1, 1, 1, 0.78),
        outline=(0, 0, 0, 0.45), shape=(0.07, 0.07, 0.09, 0.55),
    ),
    "dark": Ink(
        text=(0.97, 0.97, 0.97, 1), faint=(0.82, 0.82, 0.84, 1), halo=(0, 0, 0, 0.7), panel=(0.06, 0.07, 0.09, 0.74),
        outline=(1, 1, 1, 0.5), shape=(0.97, 0.97, 0.97, 0.6),
    ),
}  # fmt: skip
# Width of the halo around letters, in heights of the text; the display luminance from which a picture is light.
HALO, LIGHT = 0.28, 0.45


@dataclass(frozen=True, eq=False)
class Drawn:
    """A legend as a picture.

    pixels: red, green, blue, alpha in linear light, premultiplied by alpha.
    layout: where its parts lie.
    notes: what is left out or cannot be drawn, each a sentence for users.

    Shapes: pixels float32 (H, W, 4).
    """

    pixels: np.ndarray
    layout: Layout
    notes: tuple[str, ...]


def drawn(content: LegendContent, width: int, height: int, below: np.ndarray | None = None) -> Drawn:
    """The picture of a legend, as large as the film.

    below: colour of the picture that the legend is drawn over, in linear light; it chooses light or dark text if the
        theme is "auto". None stands for a light picture.

    matplotlib blends text and panels in the numbers for a screen; the result is then turned into linear light. Drawn
    over a picture in linear light, translucent edges are a little lighter or thinner than in a PNG file.

    Error: colours of colour bars are those of the palette in single precision, others are within 1/255 of sRGB.
    Shapes: below (H, W, 3).
    """
    with quiet():
        fonts = fonts_for(content.texts(), content.font)
        pen = Pen(fonts)
        laid = layout(content, width, height, pen)
        pixels = _premultiplied(_shown(laid, _inks(laid, content.theme, below), pen, width, height))
    for strip in (strip for key in laid.keys for strip in key.strips):
        left, top, right, bottom = map(int, strip.box)
        pixels[top:bottom, left:right, :3] = linear(strip.pixels)
        pixels[top:bottom, left:right, 3] = 1
    return Drawn(pixels, laid, (*content.notes, *fonts.notes, *laid.notes))


def _premultiplied(shown: np.ndarray) -> np.ndarray:
    """Colours in linear light, premultiplied, from 8-bit numbers for a screen. Shapes: (H, W, 4)."""
    pixels = np.zeros(shown.shape, np.float32)
    # Most of a picture is empty, and a power takes long.
    drawn = shown[..., 3] > 0
    found = shown[drawn] / 255
    pixels[drawn] = np.concatenate([linear(found[:, :3]) * found[:, 3:], found[:, 3:]], axis=1)
    return pixels


def _inks(laid: Layout, theme: str, below: np.ndarray | None) -> dict[str, Ink]:
    """The inks of the blocks of a legend by name. All panels have the same."""
    boxes = [(name, (box,)) for name, box in laid.boxes if not name.startswith("panel")]
    boxes += [(label.line.block, (label.box,)) for label in laid.labels] + [("panel", tuple(laid.panels))]
    return {name: INKS[theme if theme != "auto" else _theme(below, areas)] for name, areas in boxes}


def _theme(below: np.ndarray | None, boxes: tuple[Box, ...]) -> str:
    """Whether the picture is "light" or "dark" in some boxes. below: its colour in linear light. Shape: (H, W, 3)."""
    if below is None or not boxes:
        return "light"
    parts = [below[int(top) : int(bottom) + 1, int(left) : int(right) + 1] for left, top, right, bottom in boxes]
    luminance = np.concatenate([part.reshape(-1, 3) for part in parts]) @ LUMINANCE
    return "light" if curve(np.clip(luminance, 0, 1), "srgb").mean() >= LIGHT else "dark"


def _shown(laid: Layout, inks: dict[str, Ink], pen: Pen, width: int, height: int) -> np.ndarray:
    """All but the colour bars, as matplotlib draws it. Shapes: uint8 (H, W, 4), sRGB and alpha."""
    return _drawn(_artists(laid, inks, pen, height), width, height, "none")


def text_picture(lines: Iterable[TextLine], ink: Ink, pen: Pen, width: int, height: int) -> np.ndarray:
    """Lines of text on white. Shape: uint8 (height, width, 3), sRGB."""
    return _drawn((_text(line, ink, pen, height, False) for line in lines), width, height, "white")[..., :3]


def _drawn(artists: Iterable[Any], width: int, height: int, ground: str) -> np.ndarray:
    """matplotlib's artists over a colour, from the back to the front. Shapes: uint8 (H, W, 4), sRGB and alpha."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    # With 72 dots an inch, matplotlib's points are pixels.
    figure = Figure(
        (width / 72, height / 72), dpi=72, facecolor=ground, edgecolor="none", frameon=ground != "none", layout="none"
    )
    canvas = FigureCanvasAgg(figure)
    for order, artist in enumerate(artists):
        artist.set_zorder(order)
        artist.set_snap(False)
        figure.add_artist(artist)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())


def _artists(laid: Layout, inks: dict[str, Ink], pen: Pen, height: int) -> Iterator[Any]:
    """matplotlib's artists, from the back to the front. Its y grows upwards from the bottom edge."""
    from matplotlib.patches import Circle, FancyBboxPatch

    ink = inks["panel"]
    for left, top, right, bottom in laid.panels:
        style = f"round,pad=0,rounding_size={0.4 * laid.em}"
        yield FancyBboxPatch(
            (left, height - bottom), right - left, bottom - top, boxstyle=style, transform=None, **_filled(ink.panel)
        )
    for key in laid.keys:
        yield from _of_key(key, ink, laid.em, height)
        yield from (_text(line, ink, pen, height, False) for line in key.texts)
    for label in laid.labels:
        ink = inks[label.line.block]
        if label.dot is not None:
            x, y, r = label.dot
            yield Circle((x, height - y), r + 1, transform=None, **_filled(ink.halo))
            yield Circle((x, height - y), r, transform=None, **_filled(ink.text))
        yield _text(label.line, ink, pen, height, True)
    yield from (_text(line, inks[line.block], pen, height, True) for line in laid.texts)


def _of_key(key: Key, ink: Ink, em: float, height: int) -> Iterator[Any]:
    """The artists of a key, without its texts."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Rectangle

    for shape in key.shapes:
        yield _patch(shape, ink, height)
    for strip in key.strips:
        # One pixel wider on each side: the strip covers the rest.
        left, top, right, bottom = strip.box
        corner = left - 1, height - bottom - 1
        yield Rectangle(corner, right - left + 2, bottom - top + 2, transform=None, **_filled(ink.outline))
    for x, top, bottom in key.ticks:
        points = [x, x], [height - top - 1, height - bottom]
        yield Line2D(*points, color=ink.text, linewidth=max(1.0, em / 14), transform=None, solid_capstyle="butt")


def _patch(shape: Shape, ink: Ink, height: int) -> Any:
    """The artist of a shape."""
    from matplotlib.patches import Circle, Polygon

    style = _filled(ink.shape)
    if shape.colour is not None:
        style = _filled((*curve(np.clip(shape.colour, 0, 1), "srgb").tolist(), 1.0))
        style |= {"edgecolor": ink.outline, "linewidth": 1.0}
    points = [(x, height - y) for x, y in shape.points]
    if shape.kind == "disk":
        return Circle(points[0], points[1][0] - points[0][0], transform=None, **style)
    return Polygon(points, closed=True, transform=None, **style)


def _filled(colour: tuple[float, ...]) -> dict[str, Any]:
    """The style of an area without an edge."""
    return {"facecolor": colour, "edgecolor": "none", "linewidth": 0, "antialiased": True, "joinstyle": "miter"}


def _text(line: TextLine, ink: Ink, pen: Pen, height: int, haloed: bool) -> Any:
    """The artist of a line of text. haloed: whether its letters have a halo."""
    from matplotlib.patheffects import Normal, Stroke
    from matplotlib.text import Text

    text = Text(
        line.x, height - line.y, pen.fonts.drawable(line.text), color=ink.faint if line.faint else ink.text,
        fontproperties=pen.properties(line.size, line.bold), horizontalalignment=line.align,
        verticalalignment="baseline", parse_math=False, usetex=False, antialiased=True, transform=None, wrap=False,
    )  # fmt: skip
    if haloed:
        halo = Stroke(linewidth=HALO * line.size, foreground=ink.halo, joinstyle="round")
        text.set_path_effects([halo, Normal()])
    return text
