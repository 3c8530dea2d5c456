"""The light that an absorbing medium lets through.

Source: the law of Bouguer, Lambert and Beer; Pharr, Jakob and Humphreys, Physically Based Rendering, 11.2.
"""

from typing import Any

import drjit as dr


def let_through(absorption: Any, length: Any) -> Any:
    """exp(-absorption length) for each of three channels: the share of light that is left after a way of this length in
    a medium. It is exactly 1 where the absorption is 0, also for an infinite length.

    absorption: colour, per world unit, >= 0
    length: length of the way in the medium, >= 0, in world units, in double
    Error: relative, at most gamma(4) (1 + x) for the exponent x, in the precision of the colour
        (tests/test_absorption.py).
    """
    number, endless = type(absorption.x), length == dr.inf
    way = dr.select(endless, 0, length)
    # A colour of 0 is not left out here, because the derivative by it is not 0.
    left = (dr.exp(-number(c * way)) for c in absorption)
    return type(absorption)(*(dr.select(endless & (c > 0), 0, x) for c, x in zip(absorption, left)))
