"""Errors that more samples do not get below: of the output, of the precision, of what a depth leaves out.

Of two choices, the pictures of a seed have the same samples: by what they differ is no noise, or little.
"""

import numpy as np

from visray.output.rounding import rounding
from visray.study.cost.errors import split
from visray.study.cost.knobs import DEPTH
from visray.study.cost.measuring import Taken
from visray.study.cost.records import Reference


def floors(taken: list[Taken], reference: Reference) -> dict[str, float]:
    """The floors by name, relative root mean squares; those that are not in the noise.

    taken: the default and all choices of the knobs, with pictures of the same seeds each.
    """
    found = {"8-bit output": output(reference)}
    by = {(t.choice.knob, t.choice.value): t for t in taken}
    default = by["default", "as it is"]
    single, double = (by.get(("precision", x), default) for x in ("single", "double"))
    if (bias := between(single, double, reference)) is not None:
        found["single precision"] = bias
    depths = {t.choice.value: t for t in taken if t.choice.knob == "depth"}
    own = default.prepared.scene.settings.depth
    if depths and max(depths) > own and (bias := between(default, depths[max(depths)], reference)) is not None:
        found[f"depth {default.choice.settings[DEPTH]}"] = bias
    return found


def output(reference: Reference) -> float:
    """What rounding the reference to 8 bits in sRGB changes, where it can be displayed."""
    return rounding(reference.picture, ".png") / reference.luminance


def between(one: Taken, better: Taken, reference: Reference) -> float | None:
    """By how much the means over all seeds differ, relative; None where that may be noise."""
    difference = one.pictures.astype(float) - better.pictures
    none = np.zeros_like(reference.picture)
    bias = split(difference, none, none, reference.luminance).bias
    return bias.middle if bias.low > 0 else None
