"""Colour maps of VisRayTrace data scenes as palettes of visray.

VisRayTrace looked a value t from 0 to 1 up in a table of 256 colours, at int(255 t).
"""

from colorsys import hsv_to_rgb
from difflib import get_close_matches

import numpy as np

from visray.data.palette import names, palette_of
from visray.hints import hint
from visray.scene.legacy.entry import Entry
from visray.scene.messages import line

PREFIX = "color_map_type_"
# Names that VisRayTrace had, beside CUSTOM. visray also reads the names of all its palettes.
OWN = ("inferno", "plasma", "magma", "viridis", "parula", "jet")
MOST_NEAR = 3
# Digits after the point of the colours that are written to a scene.
DIGITS = 9
TABLE = 256
# VisRayTrace used this map for names that it did not know.
DEFAULT = "inferno"
# Steps of hue whose fraction of a turn is the golden ratio never come close to an earlier hue.
GOLDEN = 0.6180339887498949
BRIGHTNESS = (0.95, 0.75, 0.55)

Colors = tuple[tuple[float, float, float], ...]


def palette(e: Entry) -> str | Colors:
    """The palette of a property, as a value of visray's field `palette`.

    e: the property.
    """
    written = e.text("colorMap")
    if written is None:
        e.log.warn(f"{e.at('colorMap')}: is missing; {DEFAULT} is used")
        return DEFAULT
    name = written.strip().casefold().removeprefix(PREFIX)
    if name == "custom":
        text = "VisRayTrace had 256 random colours; visray has a fixed list of 256 colours in their place"
        e.log.warn(line(e.at("colorMap"), written, text))
        return custom_colors()
    known = {known.casefold(): known for known in names()}
    if name not in known:
        choices = get_close_matches(name, known, MOST_NEAR) or OWN
        e.log.warn(line(e.at("colorMap"), written, f"unknown colour map, {DEFAULT} is used; {hint(name, choices)}"))
        return DEFAULT
    return known[name]


def inverted(spec: str | Colors) -> Colors:
    """The table of colours that complement those of a palette to white: 1 - red, 1 - green, 1 - blue."""
    colors = palette_of(spec).srgb(np.arange(TABLE) / (TABLE - 1))
    return tuple(tuple(round(x, DIGITS) for x in row) for row in (1 - colors).tolist())


def custom_colors() -> Colors:
    """256 different colours in place of VisRayTrace's random ones. Neighbours differ in hue and in brightness."""
    return tuple(
        tuple(round(x, 3) for x in hsv_to_rgb(i * GOLDEN % 1, 0.75, BRIGHTNESS[i % len(BRIGHTNESS)]))
        for i in range(TABLE)
    )
