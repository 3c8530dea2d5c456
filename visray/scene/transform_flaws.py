"""Flaws of transforms: steps that together have no inverse, or that leave the limits of a scene."""

import sys
from dataclasses import asdict
from typing import Any

import numpy as np

from visray.geometry import gamma
from visray.quantities import FARTHEST
from visray.scene.messages import line
from visray.transforms import Transform, bounds, compose


def transform_flaw(steps: tuple[Transform, ...]) -> str | None:
    """Reason why all steps together are no valid transform, or None if they are.

    A valid transform has an inverse in double precision, and does not scale or move beyond the limits of a scene.
    """
    if not steps or _clearly_invertible(steps):
        return None
    matrix = compose(steps)
    if not np.isfinite(matrix).all():
        return "the steps together overflow double precision"
    x, y, z = matrix[:, :3].T
    lengths = np.linalg.norm(matrix, axis=0)
    if lengths.max() > FARTHEST or lengths[:3].min() < 1 / FARTHEST:
        return f"the steps together scale below {1 / FARTHEST:g} or reach beyond {FARTHEST:g}"
    volume = abs(x @ np.cross(y, z))
    # Each step adds at most 4 roundings to each entry, and the triple product adds 6. If the product is smaller than
    # this error, its sign is unknown.
    uncertain = gamma(4 * len(steps) + 6) * np.linalg.norm(x) * np.linalg.norm(y) * np.linalg.norm(z)
    if not (volume > uncertain and sys.float_info.min <= volume <= sys.float_info.max):
        return "the steps together have no inverse in double precision; they flatten the object"
    return None


def _clearly_invertible(steps: tuple[Transform, ...]) -> bool:
    """Whether simple bounds prove that all steps together pass the tests of transform_flaw.

    Error: the margins of the bounds are much wider than rounding errors. With n steps, rounding changes an entry of the
    matrix by at most gamma(4 n + 6) times the largest scale factor.
    """
    return clearly_valid(bounds(steps), len(steps))


def clearly_valid(limits: tuple[float, float, float], count: int) -> bool:
    """As _clearly_invertible, for `count` steps with these bounds together (transforms.bounds)."""
    least_scale, largest_scale, largest_shift = limits
    if not (least_scale > 2 / FARTHEST and max(largest_scale, largest_shift) < FARTHEST / 2):
        return False
    return (least_scale / largest_scale) ** 3 > 100 * gamma(4 * count + 6)


def transform_lines(address: str, shape: Any, flaw: str | None) -> list[str]:
    """List with the line about the transform of an object or a geometry; empty without a flaw."""
    if not flaw:
        return []
    return [line(f"{address}.transform", [asdict(step) for step in shape.transform], flaw)]
