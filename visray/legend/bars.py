"""Colour bars from colour rules."""

from collections.abc import Iterable, Iterator

import numpy as np

from visray.data.resolved_colors import ResolvedColors
from visray.legend.parts import ColorBar
from visray.legend.ticks import ticks_of
from visray.output.curves import linear

# Number of colours in the strip of a palette that changes continuously.
COLOURS = 1024


def bar_of(label: str, resolved: ResolvedColors, values: np.ndarray) -> ColorBar:
    """The colour bar of a rule. values: the values that it colours. Shape: (N)."""
    steps = resolved.palette.steps if resolved.bands is None else len(resolved.bands) - 1
    if resolved.bands is not None:
        colours = resolved.colours(0.5 * (resolved.bands[:-1] + resolved.bands[1:])).linear
    else:
        colours = resolved.palette.linear((np.arange(steps or COLOURS) + 0.5) / (steps or COLOURS))
    counted = resolved.colours(values)
    names = ("under", "over", "missing")
    # They have a place on the bar only if there are such values.
    beyond = {n: tuple(linear(getattr(resolved, n)).tolist()) for n in names if getattr(counted, n)}
    return ColorBar(label, colours, bool(steps), ticks_of(resolved), **beyond)


def different(bars: Iterable[ColorBar]) -> Iterator[ColorBar]:
    """The bars that differ from those before them: two layers may have the same rule and the same column."""
    seen = set()
    for bar in bars:
        key = bar.label, bar.colours.tobytes(), bar.stepped, bar.ticks, bar.under, bar.over, bar.missing
        if key not in seen:
            seen.add(key)
            yield bar
