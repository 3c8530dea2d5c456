"""Interpolation of numbers between keys: values at increasing times.

Before the first key and after the last one, the value is that of the key. At the time of a key, the value is exactly
that of the key.
"""

import numpy as np


def segment(times: np.ndarray, t: float) -> tuple[int, float]:
    """Number of the key at or before t, and the share of the way from it to the next key: 0 at a key and outside of all
    keys."""
    i = int(np.searchsorted(times, t, side="right")) - 1
    if i < 0:
        return 0, 0.0
    if i + 1 >= len(times):
        return len(times) - 1, 0.0
    return i, float((t - times[i]) / (times[i + 1] - times[i]))


def linear(times: np.ndarray, values: np.ndarray, t: float) -> np.ndarray:
    """Values on straight lines between the keys. Shapes: times (K), values (K, ...)."""
    i, share = segment(times, t)
    return values[i] if share == 0 else (1 - share) * values[i] + share * values[i + 1]


def slopes(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Slopes at the keys of the monotone cubic through them (PCHIP: F. N. Fritsch and J. Butland, A method for
    constructing local monotone piecewise cubic interpolants, 1984). Shapes: times (K), values (K, ...)."""
    h = np.diff(times).reshape(-1, *[1] * (values.ndim - 1))
    rise = np.diff(values, axis=0) / h
    if len(rise) == 1:
        return np.concatenate([rise, rise])
    before, after = rise[:-1], rise[1:]
    first, second = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
    same_way = np.sign(before) * np.sign(after) > 0
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        mean = (first + second) / (first / before + second / after)
    inner = np.where(same_way, mean, 0.0)
    ends = [_end_slope(h[0], h[1], rise[0], rise[1]), _end_slope(h[-1], h[-2], rise[-1], rise[-2])]
    return np.concatenate([ends[0][None], inner, ends[1][None]])


def _end_slope(h: np.ndarray, next_h: np.ndarray, rise: np.ndarray, next_rise: np.ndarray) -> np.ndarray:
    """Slope at the first or last key: that of the parabola through three keys, limited so that the cubic stays
    monotone."""
    slope = ((2 * h + next_h) * rise - h * next_rise) / (h + next_h)
    slope = np.where(np.sign(slope) != np.sign(rise), 0.0, slope)
    turns = np.sign(rise) != np.sign(next_rise)
    return np.where(turns & (np.abs(slope) > 3 * np.abs(rise)), 3 * rise, slope)


def cubic(times: np.ndarray, values: np.ndarray, slopes: np.ndarray, t: float) -> np.ndarray:
    """Values on the cubics that have these slopes at the keys. Between monotone keys they stay between the values of
    the keys. Shapes: times (K), values and slopes (K, ...)."""
    i, s = segment(times, t)
    if s == 0:
        return values[i]
    h = times[i + 1] - times[i]
    rise = values[i + 1] - values[i]
    start = (1 - s) ** 2 * s * h * slopes[i] - s**2 * (1 - s) * h * slopes[i + 1]
    # Rounding may pass the end values by their last digit.
    low, high = np.minimum(values[i], values[i + 1]), np.maximum(values[i], values[i + 1])
    return np.clip(values[i] + s**2 * (3 - 2 * s) * rise + start, low, high)
