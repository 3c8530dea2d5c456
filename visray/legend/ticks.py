"""Round values for colour bars and scales of sizes, and numbers as text."""

from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal
from math import ceil, floor, inf, log10

import numpy as np

from visray.data.norm import LogNorm, QuantileNorm
from visray.data.resolved_colors import ResolvedColors
from visray.legend.parts import Tick

# Largest number of ticks of a linear bar, least number of those of a logarithmic one, and digits of values that are not
# round.
MOST, LEAST, DIGITS = 7, 3, 3
# Digits that show a round value as it is.
EXACT = 12
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# Shares of the data at which a quantile bar has its ticks.
QUARTILES = (0.0, 0.25, 0.5, 0.75, 1.0)


def number_text(value: float, digits: int = EXACT) -> str:
    """A number as text, rounded to `digits` significant digits: 1,500, 2.5M (million), powers of ten from a billion
    on and below 0.0001."""
    sign, size = "\N{MINUS SIGN}" if value < 0 else "", float(f"{abs(value):.{digits}g}")
    if size >= 1e9 or 0 < size < 1e-4:
        power = floor(log10(size))
        # A division would round: 3e23 / 1e23 is not 3.
        mantissa = float(f"{size:.{digits - 1}e}".partition("e")[0])
        front = "" if mantissa == 1 else f"{mantissa:.{digits}g}\N{MULTIPLICATION SIGN}"
        return f"{sign}{front}10{str(power).translate(SUPERSCRIPTS)}"
    scaled, letter = (size / 1e6, "M") if size >= 1e6 else (size, "")
    whole, _, rest = f"{Decimal(f'{scaled:.{digits}g}'):,f}".partition(".")
    return sign + whole + (f".{rest}" if rest.strip("0") else "").rstrip("0") + letter


def round_values(lo: float, hi: float, most: int = MOST) -> list[float]:
    """Multiples of 1, 2 or 5 times a power of ten from lo to hi: the finest ones of which there are at most `most`.
    There are at least two. Domain: lo < hi, most >= 5."""
    # In decimal arithmetic, because 0.3 is no multiple of 0.1 in binary.
    low, high = Decimal(repr(lo)), Decimal(repr(hi))
    power = ((high - low) / most).adjusted()
    for step in (Decimal(factor).scaleb(power + more) for more in (0, 1) for factor in (1, 2, 5)):
        first, last = (low / step).to_integral_value(ROUND_CEILING), (high / step).to_integral_value(ROUND_FLOOR)
        if last - first < most:
            return [float(i * step) for i in range(int(first), int(last) + 1)]
    raise AssertionError("ten times the largest power of ten in a part is longer than the part")


def round_values_of_log(lo: float, hi: float) -> list[float]:
    """Powers of ten from lo to hi; if these are few, 3, or 2 and 5 times powers of ten too. Domain: 0 < lo < hi."""
    powers = range(floor(log10(lo)), ceil(log10(hi)) + 1)
    for factors in ((1,), (1, 3), (1, 2, 5)):
        values = [v for p in powers for f in factors if lo <= (v := float(f"{f}e{p}")) <= hi]
        if len(values) >= LEAST:
            return values
    return round_values(lo, hi)


def ticks_of(resolved: ResolvedColors) -> tuple[Tick, ...]:
    """The ticks of a colour bar: edges of bands, quartiles of a quantile norm, and round values of other norms."""
    lo, hi = resolved.lo, resolved.hi
    if not -inf < lo < hi < inf:
        return (Tick(0.5, number_text(lo)),)
    if resolved.bands is not None:
        last = len(resolved.bands) - 1
        texts = distinct_texts(resolved.bands.tolist())
        return tuple(Tick(i / last, text) for i, text in enumerate(texts))
    if isinstance(resolved.norm, QuantileNorm):
        return tuple(map(Tick, QUARTILES, distinct_texts(resolved.value(np.array(QUARTILES)).tolist())))
    values = round_values_of_log(lo, hi) if isinstance(resolved.norm, LogNorm) else round_values(lo, hi)
    return tuple(map(Tick, resolved.share(np.array(values)).tolist(), distinct_texts(values, EXACT)))


def distinct_texts(values: list[float], least: int = DIGITS) -> list[str]:
    """Numbers as texts, with as few digits as tell different numbers apart, but at least `least` where there are so
    many."""
    for digits in range(least, 18):
        texts = [number_text(v, digits) for v in values]
        if len(set(texts)) == len(set(values)):
            break
    return texts
