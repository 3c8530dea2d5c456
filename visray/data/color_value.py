"""Colours as users write them: "#rrggbb", "#rgb", a name such as "tomato", or three numbers from 0 to 1.

All of them are sRGB, as on a screen.
"""

import re
from typing import Any

import numpy as np

from visray.colors import FORMS as SCENE_FORMS
from visray.colors import bytes_of_text, is_number
from visray.quantities import Real

ColorValue = str | tuple[Real, Real, Real]
_HEX = re.compile(r"#([0-9a-fA-F]{3}|[0-9a-fA-F]{6})")
FORMS = '"#rrggbb", "#rgb", a name such as "tomato", or three numbers from 0 to 1'


def color_numbers(color: Any) -> np.ndarray:
    """The red, green and blue of a colour, from 0 to 1. Raises ValueError if the value is no colour.

    Shape: result (3).
    """
    if isinstance(color, str):
        return np.array(_text_numbers(color))
    if not is_triple(color):
        raise ValueError(f"is no colour; write {FORMS}")
    triple = np.array(color, float)
    if (triple > 1).any() and (triple >= 0).all() and (triple <= 255).all():
        raise ValueError("is beyond 1; divide numbers from 0 to 255 by 255")
    if not ((triple >= 0) & (triple <= 1)).all():
        raise ValueError("must be three numbers from 0 to 1")
    return triple


def color_flaw(color: Any) -> str | None:
    """What is wrong with a colour, or None if it can be used."""
    try:
        color_numbers(color)
    except ValueError as error:
        return str(error)
    return None


def is_hex(text: str) -> bool:
    """Whether a text is a colour such as "#ff6347" or "#f64"."""
    return _HEX.fullmatch(text) is not None


def is_triple(value: Any) -> bool:
    """Whether a value is a list of three numbers."""
    return isinstance(value, list | tuple | np.ndarray) and len(value) == 3 and all(map(is_number, value))


def _text_numbers(text: str) -> tuple[float, float, float]:
    """The numbers of a colour that is written as text."""
    try:
        return tuple(x / 255 for x in bytes_of_text(text))
    except ValueError as error:
        flaw = str(error).replace(SCENE_FORMS, FORMS)
    from matplotlib import colors  # which knows more names, such as tab:blue

    named = colors.get_named_colors_mapping()
    if text.lower() not in named:
        raise ValueError(flaw)
    return colors.to_rgb(named[text.lower()])
