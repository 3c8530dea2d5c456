"""Colours as scenes spell them: the name of a colour, "#rrggbb", a number for grey, or three numbers in linear light.

A text is a colour of a screen, in sRGB. A scene itself holds three numbers of linear light (Rec. 709).
"""

import re
from typing import Any

import numpy as np

from visray.hints import similar
from visray.output.curves import linear

# The named colours of CSS Color Module Level 4, section 6.1, each with its six hexadecimal digits.
_CSS = """
aliceblue f0f8ff  antiquewhite faebd7  aqua 00ffff  aquamarine 7fffd4  azure f0ffff  beige f5f5dc
bisque ffe4c4  black 000000  blanchedalmond ffebcd  blue 0000ff  blueviolet 8a2be2  brown a52a2a
burlywood deb887  cadetblue 5f9ea0  chartreuse 7fff00  chocolate d2691e  coral ff7f50
cornflowerblue 6495ed  cornsilk fff8dc  crimson dc143c  cyan 00ffff  darkblue 00008b  darkcyan 008b8b
darkgoldenrod b8860b  darkgray a9a9a9  darkgreen 006400  darkgrey a9a9a9  darkkhaki bdb76b
darkmagenta 8b008b  darkolivegreen 556b2f  darkorange ff8c00  darkorchid 9932cc  darkred 8b0000
darksalmon e9967a  darkseagreen 8fbc8f  darkslateblue 483d8b  darkslategray 2f4f4f  darkslategrey 2f4f4f
darkturquoise 00ced1  darkviolet 9400d3  deeppink ff1493  deepskyblue 00bfff  dimgray 696969
dimgrey 696969  dodgerblue 1e90ff  firebrick b22222  floralwhite fffaf0  forestgreen 228b22
fuchsia ff00ff  gainsboro dcdcdc  ghostwhite f8f8ff  gold ffd700  goldenrod daa520  gray 808080
green 008000  greenyellow adff2f  grey 808080  honeydew f0fff0  hotpink ff69b4  indianred cd5c5c
indigo 4b0082  ivory fffff0  khaki f0e68c  lavender e6e6fa  lavenderblush fff0f5  lawngreen 7cfc00
lemonchiffon fffacd  lightblue add8e6  lightcoral f08080  lightcyan e0ffff  lightgoldenrodyellow fafad2
lightgray d3d3d3  lightgreen 90ee90  lightgrey d3d3d3  lightpink ffb6c1  lightsalmon ffa07a
lightseagreen 20b2aa  lightskyblue 87cefa  lightslategray 778899  lightslategrey 778899
lightsteelblue b0c4de  lightyellow ffffe0  lime 00ff00  limegreen 32cd32  linen faf0e6  magenta ff00ff
maroon 800000  mediumaquamarine 66cdaa  mediumblue 0000cd  mediumorchid ba55d3  mediumpurple 9370db
mediumseagreen 3cb371  mediumslateblue 7b68ee  mediumspringgreen 00fa9a  mediumturquoise 48d1cc
mediumvioletred c71585  midnightblue 191970  mintcream f5fffa  mistyrose ffe4e1  moccasin ffe4b5
navajowhite ffdead  navy 000080  oldlace fdf5e6  olive 808000  olivedrab 6b8e23  orange ffa500
orangered ff4500  orchid da70d6  palegoldenrod eee8aa  palegreen 98fb98  paleturquoise afeeee
palevioletred db7093  papayawhip ffefd5  peachpuff ffdab9  peru cd853f  pink ffc0cb  plum dda0dd
powderblue b0e0e6  purple 800080  rebeccapurple 663399  red ff0000  rosybrown bc8f8f  royalblue 4169e1
saddlebrown 8b4513  salmon fa8072  sandybrown f4a460  seagreen 2e8b57  seashell fff5ee  sienna a0522d
silver c0c0c0  skyblue 87ceeb  slateblue 6a5acd  slategray 708090  slategrey 708090  snow fffafa
springgreen 00ff7f  steelblue 4682b4  tan d2b48c  teal 008080  thistle d8bfd8  tomato ff6347
turquoise 40e0d0  violet ee82ee  wheat f5deb3  white ffffff  whitesmoke f5f5f5  yellow ffff00
yellowgreen 9acd32
"""
NAMED = dict(zip(_CSS.split()[::2], _CSS.split()[1::2]))
TEXTS = 'a name such as "tomato", "#rrggbb"'
FORMS = f"{TEXTS}, or three numbers in linear light"
# From this number on, a colour is taken for one of a screen, whose numbers go to 255.
LIKE_BYTES = 10
_DIGITS = re.compile("[0-9a-fA-F]{3}|[0-9a-fA-F]{6}")
_WITH_ALPHA = re.compile("[0-9a-fA-F]{4}|[0-9a-fA-F]{8}")
# A function of CSS with three numbers from 0 to 255, such as rgb(204, 51, 51).
_RGB = re.compile(r"rgba?\(\s*(\d+)[\s,]+(\d+)[\s,]+(\d+)\s*\)", re.IGNORECASE)
NO_ALPHA = "a colour has no alpha here; how much light a material lets through is its kt"


def color_of_text(text: str) -> tuple[float, float, float]:
    """The colour that a text spells, in linear light. Raises ValueError if it spells none."""
    return from_bytes(bytes_of_text(text))


def bytes_of_text(text: str) -> tuple[int, int, int]:
    """The red, green and blue of a colour that is spelled as text, from 0 to 255, in sRGB. Raises ValueError if it
    spells none."""
    text = text.strip()
    digits = NAMED.get(text.lower())
    if digits is None:
        if not (text.startswith("#") and _DIGITS.fullmatch(text[1:])):
            raise ValueError(_text_flaw(text))
        digits = text[1:] if len(text) == 7 else "".join(2 * digit for digit in text[1:])
    return tuple(int(digits[i : i + 2], 16) for i in (0, 2, 4))


def from_bytes(color: tuple[float, ...]) -> tuple[float, float, float]:
    """The colour in linear light of three numbers from 0 to 255, in sRGB."""
    return tuple(linear(np.array(color, float) / 255).tolist())


def hexadecimal(color: tuple[float, ...]) -> str:
    """The text "#rrggbb" of three numbers from 0 to 255. They are rounded."""
    return "#" + "".join(f"{round(x):02x}" for x in color)


def looks_like_bytes(color: tuple[float, ...]) -> bool:
    """Whether three numbers in linear light are so large that numbers of a screen, from 0 to 255, must be meant."""
    return LIKE_BYTES <= max(color) <= 255 and min(color) >= 0


def color_as_picked(color: Any) -> tuple[float, float, float]:
    """The colour in linear light of what the field `color` of a material may be: a text, three numbers from 0 to 255 as
    colour pickers give them (sRGB), or one number from 0 to 1, which is grey in linear light. Raises ValueError if it
    is none of these."""
    color = color.tolist() if isinstance(color, np.ndarray) else color
    if isinstance(color, str):
        return color_of_text(color)
    if is_number(color):
        if not 0 <= color <= 1:
            raise ValueError("must be from 0 to 1, as one number is grey in linear light; a screen's numbers are three")
        return (float(color),) * 3
    if not (isinstance(color, (tuple, list)) and len(color) == 3 and all(map(is_number, color))):
        raise ValueError(f"is no colour; write {TEXTS}, three numbers from 0 to 255, or one number from 0 to 1")
    if not all(0 <= x <= 255 for x in color):
        raise ValueError("must be three numbers from 0 to 255")
    if 0 < max(color) <= 1:
        own, screen = ", ".join(f"{x:.6g}" for x in color), [round(255 * x) for x in color]
        ways = f'"kd": [{own}] in linear light, or "color": {screen} for a colour of a screen'
        raise ValueError(f"has three numbers from 0 to 255, and these are not above 1; write {ways}")
    return from_bytes(color)


def _text_flaw(text: str) -> str:
    """What is wrong with a text that spells no colour, and what would be right."""
    if text.startswith("#"):
        if _WITH_ALPHA.fullmatch(text[1:]):
            shorter = text[:-1] if len(text) == 5 else text[:-2]
            return f'{NO_ALPHA}; write "{shorter}"'
        return 'is no colour; after # there are six digits from 0 to f, or three, as in "#cc3333" and "#c33"'
    if _DIGITS.fullmatch(text):
        return f'unknown colour; did you mean "#{text}"?'
    if text.lower() in ("transparent", "none"):
        return NO_ALPHA
    if (found := _RGB.fullmatch(text)) and max(numbers := tuple(map(int, found.groups()))) <= 255:
        return f'is no colour here; write "{hexadecimal(numbers)}"'
    near = similar(re.sub(r"[\s_-]", "", text), [*NAMED])
    return f'unknown colour; did you mean "{near[0]}"?' if near else f"unknown colour; write {FORMS}"


def is_color(text: str) -> bool:
    """Whether a text spells a colour."""
    try:
        color_of_text(text)
    except ValueError:
        return False
    return True


def spelled(color: Any) -> Any:
    """Three numbers in place of a colour that is spelled as text or as one number; anything else unchanged. Raises
    ValueError if a text spells no colour."""
    if isinstance(color, str):
        return color_of_text(color)
    return (color,) * 3 if is_number(color) else color


def is_number(value: Any) -> bool:
    """Whether a value is a real number: no text, and neither true nor false."""
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
