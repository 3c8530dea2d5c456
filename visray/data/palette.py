"""Palettes: colours as functions of a number t from 0 to 1.

A palette is a name, a list of colours, or stops. Names are those of matplotlib's colour maps, and parula.
Between two stops the colour is blended in the palette's own numbers (sRGB, as matplotlib does), and then converted to
linear light by the exact sRGB curve.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache, cached_property
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator

from visray.colors import is_number
from visray.data.color_value import ColorValue, color_flaw, color_numbers, is_triple
from visray.data.palette_note import has_middle, palette_note
from visray.output.curves import curve, linear, linear_slope
from visray.quantities import Real

Encoding = Literal["srgb", "linear"]
# Knots of a map that matplotlib computes by a formula. It shows 256 colours; with 32 intervals between two of them, the
# fastest map (flag, 32 waves that are cut off at 0 and 1) is followed to within 1/255, and those 256 places are knots.
_FINE = 255 * 32 + 1
# A list of fewer colours than this is shown in steps: matplotlib's own continuous lists have at least as many.
_CONTINUOUS = 256
# Number of entries of the original program's tables.
TABLE = 256
# A few roundings: a value between two entries of a table has the upper one, whatever the rounding of t.
_ROUNDING = 8 * np.finfo(float).eps
_PREFIX = "color_map_type_"
# From blue over green to yellow, as MATLAB's parula. The two ends are published; the colours between are our own, by
# eye, so the palette is near parula but not equal to it.
_PARULA = (
    (0.208, 0.166, 0.529), (0.110, 0.330, 0.800), (0.070, 0.460, 0.850), (0.050, 0.580, 0.800), (0.100, 0.660, 0.690),
    (0.280, 0.720, 0.560), (0.520, 0.750, 0.450), (0.740, 0.750, 0.370), (0.960, 0.760, 0.230), (0.976, 0.983, 0.054),
)  # fmt: skip
_EXAMPLES = '["#000080", "white", "tomato"], or stops, such as [[0, "navy"], [0.2, "white"], [1, "tomato"]]'


def _structured(spec: Any) -> Any:
    """The spec of a palette with tuples in place of lists. Raises ValueError if it is neither a name nor a list of
    colours or stops. Whether names and numbers are right is said later, by `palette_flaw`."""
    if isinstance(spec, str):
        return spec
    if not isinstance(spec, list | tuple):
        raise ValueError(f"must be the name of a palette, a list of colours, such as {_EXAMPLES}")
    return tuple(_structured_entry(entry) for entry in spec)


def _structured_entry(entry: Any) -> Any:
    """A colour or a stop with tuples in place of lists. Raises ValueError if it is neither."""
    if isinstance(entry, str):
        return entry
    if is_triple(entry):
        return tuple(entry)
    if _is_stop(entry):
        return entry[0], entry[1] if isinstance(entry[1], str) else tuple(entry[1])
    raise ValueError(f"each entry of a palette is a colour or a stop (position, colour); write {_EXAMPLES}")


def _is_stop(entry: Any) -> bool:
    """Whether an entry of a palette is a pair of a number and a colour."""
    is_pair = isinstance(entry, list | tuple) and len(entry) == 2 and is_number(entry[0])
    return is_pair and (isinstance(entry[1], str) or is_triple(entry[1]))


PaletteSpec = Annotated[
    str | tuple[ColorValue, ...] | tuple[tuple[Real, ColorValue], ...], BeforeValidator(_structured)
]


@dataclass(frozen=True, eq=False)
class Palette:
    """Colours as a function of t, linear between knots. At two knots with the same position the colour jumps; there,
    the colour is the right one.

    name: name of the palette; "" for a list of colours and for stops.
    knots: ascending positions from 0 to 1. Shape: (K)
    numbers: colour at each knot, from 0 to 1, in the encoding. Shape: (K, 3)
    encoding: whether the numbers are sRGB or linear light.
    steps: number of colours if the palette has only these and blends none (a qualitative map); else 0.
    table: whether only the TABLE colours at t = i / (TABLE - 1) are used; t has the one with i = int((TABLE - 1) t).
    """

    name: str
    knots: np.ndarray
    numbers: np.ndarray
    encoding: Encoding = "srgb"
    steps: int = 0
    table: bool = False

    def srgb(self, t: np.ndarray) -> np.ndarray:
        """Colours as on a screen, from 0 to 1. t is clipped to [0, 1]. Shapes: t (N), result (N, 3)."""
        numbers = self._blended(t)[0]
        return numbers if self.encoding == "srgb" else curve(numbers, "srgb")

    def linear(self, t: np.ndarray) -> np.ndarray:
        """Colours in linear light (Rec. 709). Shapes: t (N), result (N, 3)."""
        numbers = self._blended(t)[0]
        return linear(numbers) if self.encoding == "srgb" else numbers

    def slope(self, t: np.ndarray) -> np.ndarray:
        """Derivative of `linear` by t; at a knot that of the interval on the right. Shapes: t (N), result (N, 3)."""
        numbers, slope = self._blended(t)
        return slope * linear_slope(numbers) if self.encoding == "srgb" else slope

    @cached_property
    def note(self) -> str | None:
        """A sentence about what readers find hard in the palette (palette_note), or None."""
        return palette_note(self.name, self.linear, self.steps)

    @cached_property
    def diverging(self) -> bool:
        """Whether readers take the palette's middle for zero (palette_note)."""
        return not self.steps and has_middle(self.linear)

    def _blended(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(numbers at t, their derivative by t). Shapes: t (N), results (N, 3)."""
        t = np.clip(np.asarray(t, float), 0.0, 1.0)
        if self.table:
            t = np.minimum(np.floor((TABLE - 1) * t * (1 + _ROUNDING)) / (TABLE - 1), 1.0)
        i = np.clip(np.searchsorted(self.knots, t, "right") - 1, 0, len(self.knots) - 2)
        width = (self.knots[i + 1] - self.knots[i])[:, None]
        low, high = self.numbers[i], self.numbers[i + 1]
        w = (t - self.knots[i])[:, None] / width
        slope = 0 * (high - low) if self.table else (high - low) / width
        # Seen from the nearer knot: exact at both, and where both have one colour.
        return np.where(w < 0.5, low + w * (high - low), high - (1 - w) * (high - low)), slope


def palette_of(spec: Any, reversed: bool = False, encoding: Encoding = "srgb", table: bool = False) -> Palette:
    """The palette of a spec. Raises ValueError if the spec has a flaw (palette_flaw).

    spec: a name, or a sequence of colours or of stops (position, colour).
    reversed: whether t = 0 has the last colour.
    encoding, table: as in Palette.
    """
    if flaw := palette_flaw(spec):
        raise ValueError(": ".join(filter(None, flaw)))
    name = _full_name(spec) if isinstance(spec, str) else ""
    knots, numbers, steps = _named(name) if name else _listed(spec)
    if reversed:
        knots, numbers = 1 - knots[::-1], numbers[::-1]
    return Palette(name, knots, numbers, encoding, steps, table)


def palette_flaw(spec: Any) -> tuple[str, str] | None:
    """(part, message) of an error in the spec of a palette, or None. part: number of the wrong entry, or ""."""
    try:
        spec = _structured(spec)
    except ValueError as error:
        return "", str(error)
    if isinstance(spec, str):
        text = None if _full_name(spec) else _name_flaw(spec)
        return ("", text) if text else None
    if len(spec) < 2:
        return "", f"has fewer than two colours; write {_EXAMPLES}"
    stops = [_is_stop(entry) for entry in spec]
    if any(stops) and not all(stops):
        return str(stops.index(not stops[0])), "is one of colours and stops; write one kind, with or without positions"
    for i, entry in enumerate(spec):
        if flaw := color_flaw(entry[1] if stops[0] else entry):
            return str(i), flaw
    return _position_flaw([position for position, _ in spec]) if stops[0] else None


def names() -> list[str]:
    """The names of all palettes, without the reversed ones (`_r`): those of matplotlib, and parula."""
    return [name for name in _registered() if not name.endswith("_r") or name.removesuffix("_r") not in _registered()]


def _position_flaw(positions: list[float]) -> tuple[str, str] | None:
    """(number of the stop, message) of an error in the positions of stops, or None."""
    if positions[0] != 0 or positions[-1] != 1:
        wrong = 0 if positions[0] != 0 else len(positions) - 1
        return str(wrong), "the positions of the stops go from 0 to 1; the first is 0 and the last is 1"
    for i in range(1, len(positions)):
        if not positions[i] >= positions[i - 1]:
            return str(i), "the positions of the stops must not fall"
        # Two stops at one place are a jump. A third one, or a jump at an end, would never be seen.
        if positions[i] == positions[i - 1] and (positions[i] in (0, 1) or positions[i] == positions[max(i - 2, 0)]):
            return str(i), "too many stops have this position; two are a jump, and the ends have one"
    return None


@cache
def _registered() -> dict[str, None]:
    """The names of palettes, in matplotlib's order: the keys of a dict."""
    from matplotlib import colormaps

    return dict.fromkeys([*colormaps, "parula", "parula_r"])


def _full_name(text: str) -> str | None:
    """The name of the palette that a text means, in any case and also with the original program's prefix, or None."""
    word = text.casefold().removeprefix(_PREFIX)
    if text in _registered():
        return text
    return next((name for name in _registered() if name.casefold() == word), None)


def _name_flaw(text: str) -> str:
    """Message about a name that no palette has."""
    if text.casefold().removeprefix(_PREFIX) == "custom":
        return f"a custom palette needs its colours; write them in place of the name: {_EXAMPLES}"
    if not text.strip() or color_flaw(text) is None:
        return f"is no palette; write a name such as viridis, or at least two colours: {_EXAMPLES}"
    word = text.casefold().removeprefix(_PREFIX)
    known = {name.casefold(): name for name in _registered() if name.endswith("_r") == word.endswith("_r")}
    near = get_close_matches(word, known, 3, 0.7)
    hint = " or ".join(f'"{known[n]}"' for n in near)
    return (
        f"unknown palette; {f'did you mean {hint}?' if hint else 'take one such as viridis, cividis, RdBu or parula'}"
    )


def _named(name: str) -> tuple[np.ndarray, np.ndarray, int]:
    """(knots, numbers, number of steps) of a palette with a name."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    if name.startswith("parula"):
        return _listed(_PARULA if name == "parula" else _PARULA[::-1])
    found = colormaps[name]
    if not isinstance(found, ListedColormap):
        found = found.resampled(_FINE)
    numbers = np.clip(found(np.arange(found.N))[:, :3], 0, 1)
    if found.N >= _CONTINUOUS:
        return np.arange(found.N) / (found.N - 1), numbers, 0
    edges = np.arange(found.N + 1) / found.N
    return np.repeat(edges, 2)[1:-1], np.repeat(numbers, 2, axis=0), found.N


def _listed(spec: Sequence) -> tuple[np.ndarray, np.ndarray, int]:
    """(knots, numbers, 0) of a list of colours, which are equally spaced, or of stops."""
    if _is_stop(spec[0]):
        return np.array([p for p, _ in spec], float), np.array([color_numbers(c) for _, c in spec]), 0
    return np.arange(len(spec)) / (len(spec) - 1), np.array([color_numbers(c) for c in spec]), 0
