"""What lies between two values of keys: pairs of valid values with no valid way from one to the other are refused."""

from itertools import pairwise
from typing import Any

import numpy as np

from visray.animation.curves import Sort, axis_of, step_key
from visray.animation.rotations import opposite, quaternion, unit
from visray.quantities import FARTHEST

# Numbers of keys are not farther from each other: their slopes, and these times the seconds of a day, stay below 1e308.
FURTHEST = 1e290


def between_flaws(sort: Sort, values: tuple) -> list[tuple[int, str]]:
    """Errors of what lies between neighbouring values, as pairs of the number of the second one and a message.

    Domain: each value is valid, and all are of this sort and of one shape.
    """
    if sort == "number":
        return _jumps(np.array(values, float))
    pairs = enumerate(pairwise(values), 1)
    return [(i, text) for i, (a, b) in pairs if (text := _FLAWS[sort](a, b))]


def _jumps(values: np.ndarray) -> list[tuple[int, str]]:
    """As between_flaws, for numbers. Shape: (K, ...)."""
    with np.errstate(over="ignore"):
        apart = np.abs(np.diff(values, axis=0)).reshape(len(values) - 1, -1).max(axis=1)
    text = f"is more than {FURTHEST:g} away from the key before; give smaller numbers"
    return [(int(i) + 1, text) for i in np.flatnonzero(apart > FURTHEST)]


def _vectors(a: tuple, b: tuple) -> str | None:
    """Whether the vectors between two come too near to 0."""
    a, b = np.array(a, float), np.array(b, float)
    way = b - a
    share = min(max(-(a @ way) / (way @ way), 0.0), 1.0) if way.any() else 0.0
    if np.abs(a + share * way).max() >= 1 / FARTHEST:
        return None
    return "the way from the key before leads through (0, 0, 0); add a key beside it"


def _directions(a: tuple, b: tuple) -> str | None:
    """Whether there is no shorter way between two directions."""
    if not opposite(unit(np.array(a, float)), unit(np.array(b, float))):
        return None
    return "is opposite to the key before, so that no way is the shorter one; add a key between them"


def _step(a: dict, b: dict) -> str | None:
    """Reason why there are no valid steps between two; None if there are."""
    return _STEP_FLAWS[step_key(a)](a, b)


def _factors(a: Any, b: Any) -> str | None:
    """Whether a factor between two scales is 0."""
    product = np.sign(np.broadcast_to(a, 3)) * np.sign(np.broadcast_to(b, 3))
    return "has another sign than the key before, and a scale between them is 0" if (product < 0).any() else None


def _rotation(a: dict, b: dict) -> str | None:
    """Whether two rotations differ by whole turns, of which the short way shows nothing."""
    p, q = (quaternion(x["rotate"], np.array(axis_of(x), float)) for x in (a, b))
    if a["rotate"] == b["rotate"] or not opposite(p if p @ q < 0 else -p, q):
        return None
    text = "is the same rotation as that of the key before, and rotations go the short way"
    return f"{text}; for whole turns write a track of the type spin, or an address that ends with .rotate"


def _matrix(a: dict, b: dict) -> str | None:
    """Whether one of two matrices mirrors."""
    mirrors = [np.linalg.det(np.array(x["matrix"], float)[:, :3]) < 0 for x in (a, b)]
    return (
        "mirrors, or the key before does, and a matrix between them is singular" if mirrors[0] != mirrors[1] else None
    )


def _nothing(a: Any, b: Any) -> None:
    """All values between two are valid."""


_STEP_FLAWS = {
    "translate": _nothing,
    "scale": lambda a, b: _factors(a["scale"], b["scale"]),
    "rotate": _rotation,
    "matrix": _matrix,
}
_FLAWS = {
    "factor": _factors,
    "vector": _vectors,
    "direction": _directions,
    "date": _nothing,
    "step": _step,
    "steps": lambda a, b: next((text for x, y in zip(a, b) if (text := _step(x, y))), None),
}
