"""What a palette does to its readers: whether equal steps look equal, and whether the red-green blind can read it."""

from collections.abc import Callable

import numpy as np

from visray.data.vision import BLINDNESS, blind, seen

# About the smallest difference that is seen between two patches which do not touch, as a datum and the colour bar:
# twice that between two patches side by side.
VISIBLE = 2.0
# Five times that: a difference that nobody overlooks.
CLEAR = 5 * VISIBLE
# Steps in which palettes are looked at. Finer ones can hardly be read from a colour bar.
STEPS = 32
# Largest ratio between two steps. The palettes of ColorBrewer, drawn with care for maps, reach 3.6 (but Spectral 4.2,
# Greys 5.9), the grey scale 2.5. Rainbows begin at 4.6 (turbo): there one sees edges that are not in the data.
UNEVEN = 4.0
# Two places at least this far apart count for the red-green blind: an eighth of the palette.
APART = STEPS // 8
# A palette has a middle if that is lighter, or darker, than both ends by this much, and about as grey as this, and the
# ends differ as clearly. The diverging maps of matplotlib have 39 or more, 18 or less (and rainbows 27 or more), and 28
# or more.
PEAK, GREY, ENDS = 25.0, 22.0, 2 * CLEAR
# Palettes that a note recommends; the last one has a middle.
GOOD = ("viridis", "cividis", "RdBu")


def palette_note(name: str, linear: Callable[[np.ndarray], np.ndarray], steps: int) -> str | None:
    """A sentence about what is hard to read in a palette, or None.

    name: name of the palette, or "".
    linear: linear light at places from 0 to 1. Shapes: (N) -> (N, 3)
    steps: number of colours of a qualitative palette; else 0.
    """
    title = f"The palette {name}" if name else "The palette"
    if steps:
        return f"{title} is made for categories: its colours do not show which of two numbers is larger."
    light = linear(np.arange(STEPS + 1) / STEPS)
    found = [*_uneven(seen(light)), *_confused(light)]
    return f"{title} {', and '.join(found)}; take one such as {', '.join(GOOD[:-1])} or {GOOD[-1]}." if found else None


def has_middle(linear: Callable[[np.ndarray], np.ndarray]) -> bool:
    """Whether a palette diverges from its middle, as RdBu does: readers take the middle for zero.

    linear: linear light at places from 0 to 1. Shapes: (N) -> (N, 3)
    """
    colours = seen(linear(np.arange(STEPS + 1) / STEPS))
    lightness, middle = colours[:, 0], STEPS // 2
    sign = np.sign(lightness[middle] - lightness[0])
    peak = int(np.argmax(sign * lightness))
    return bool(
        abs(peak - middle) <= 1
        and min(sign * (lightness[middle] - lightness[[0, -1]])) > PEAK
        and np.hypot(*colours[middle, 1:]) < GREY
        and np.linalg.norm(colours[0] - colours[-1]) > ENDS
    )


def _uneven(colours: np.ndarray) -> list[str]:
    """What is not even along a palette. Shape: (STEPS + 1, 3)."""
    lengths = np.linalg.norm(np.diff(colours, axis=0), axis=1)
    if not lengths.max() > 0:
        return ["has only one colour"]
    # A palette of which a part has one colour is the least even of all.
    ratio = lengths.max() / max(lengths.min(), lengths.max() / 1000)
    found = []
    if ratio > UNEVEN:
        shown = f"{ratio:.1f}" if ratio < 10 else f"{ratio:.0f}"
        found.append(f"is not perceptually uniform: equal steps look up to {shown} times as large in some places")
    if contrary_lightness(colours[:, 0]) > VISIBLE:
        found.append("has a lightness that rises and falls, so that larger is neither lighter nor darker")
    return found


def contrary_lightness(lightness: np.ndarray) -> float:
    """How much the lightness along a palette goes in the wrong direction, at least: it should rise, or fall, or do each
    once. Shape: (N)."""
    wrong = []
    for sign in (1, -1):
        steps, top = np.diff(sign * lightness), int(np.argmax(sign * lightness))
        wrong.append(-np.minimum(steps[:top], 0).sum() + np.maximum(steps[top:], 0).sum())
    return float(min(wrong))


def _confused(light: np.ndarray) -> list[str]:
    """What the red-green blind cannot tell apart in a palette, in linear light. Shape: (STEPS + 1, 3)."""
    first, second = np.triu_indices(len(light), APART)
    clear = _distances(seen(light), first, second) > CLEAR
    for kind in BLINDNESS:
        left = np.where(clear, _distances(seen(blind(light, kind)), first, second), np.inf)
        nearest = int(np.argmin(left))
        if left[nearest] < VISIBLE:
            places = f"{100 * first[nearest] / STEPS:.0f}% and {100 * second[nearest] / STEPS:.0f}%"
            return [f"has colours that the red-green blind cannot tell apart, as at {places} of its length"]
    return []


def _distances(colours: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Distances between pairs of colours, given by their numbers. Shapes: (N, 3), (P), (P) -> (P)."""
    return np.linalg.norm(colours[first] - colours[second], axis=1)
