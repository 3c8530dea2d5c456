"""One sample for each kind of light, and for area lights their surface by formulas that are not the light's own.

A new kind of light needs an entry in LIGHT_SAMPLES, and nothing else in the tests that run over visray.lights.KINDS.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import pi
from typing import Any

import numpy as np
from samples import direction

from visray.lights import KINDS, DirectionalLight, DiskLight, PointLight, RectangleLight, SphereLight, SpotLight


@dataclass(frozen=True)
class LightSurface:
    """The surface of an area light, in NumPy, in coordinates about the middle of the light.

    area: of the whole surface.
    away: how far points (N, 3) are off the surface.
    square: a map of the surface to the unit square that keeps areas; its axes are `turn`, a random orthonormal frame
        (rows), wherever the shape leaves a choice. Shapes: (N, 3) -> (N), (N).
    """

    area: Callable[[Any], float]
    away: Callable[[Any, np.ndarray], np.ndarray]
    square: Callable[[Any, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class LightSample:
    """A kind of light.

    above: the light at a place, up to `size` wide, shining straight down.
    posed: the light above a scene of size 1 about the origin, in no special position.
    random: a light at a place, up to `size` wide, that looks roughly downwards: its own fields, as a dict.
    surface: of area lights.
    all_around: fields with which it shines in all directions; empty if it always does, None if it never does.
    """

    kind: type
    above: Callable[[tuple, float], Any]
    posed: Any
    random: Callable[[np.random.Generator, float], dict[str, Any]]
    surface: LightSurface | None = None
    all_around: dict[str, Any] | None = field(default_factory=dict)


def downwards(rng: np.random.Generator) -> tuple:
    return tuple((rng.normal(size=3) * (0.5, 0.1, 0.5) - (0, 1, 0)).tolist())


def cosine(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The angle of points in a plane, from 0 to 1, from its cosine."""
    angle = np.arccos(np.clip(x / np.hypot(x, y), -1, 1)) / (2 * pi)
    return np.where(y < 0, 1 - angle, angle)


def _spot(rng: np.random.Generator, size: float) -> dict[str, Any]:
    return {"direction": downwards(rng), "angle": float(rng.uniform(20, 80)), "exponent": float(rng.uniform(0, 3))}


def _rectangle(rng: np.random.Generator, size: float) -> dict[str, Any]:
    return {"width": tuple((size * rng.normal(size=3)).tolist()), "height": (0.0, 0.1 * size, size)}


def _rectangle_square(l: RectangleLight, p: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """By Cramer's rule: the triple product with one side and the normal, over that of both sides."""
    w, h = np.array(l.width), np.array(l.height)
    n = np.cross(w, h)
    return 0.5 + np.cross(p, h) @ n / (n @ n), 0.5 + np.cross(w, p) @ n / (n @ n)


def _rectangle_away(l: RectangleLight, p: np.ndarray) -> np.ndarray:
    """The larger of the distances from the plane, and from the outline if outside."""
    n = np.cross(l.width, l.height)
    n /= np.linalg.norm(n)
    u, v = _rectangle_square(l, p, np.eye(3))
    beyond = [np.maximum(np.abs(x - 0.5) - 0.5, 0) * np.linalg.norm(side) for x, side in ((u, l.width), (v, l.height))]
    return np.max([np.abs(p @ n), *beyond], 0)


def _disk_square(l: DiskLight, p: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The area within the radius grows with its square; the angle is from any direction across the axis."""
    n = np.array(l.normal) / np.linalg.norm(l.normal)
    x = np.cross(n, turn[0])
    x /= np.linalg.norm(x)
    return (p * p).sum(1) / l.radius**2, cosine(p @ x, p @ np.cross(n, x))


def _disk_away(l: DiskLight, p: np.ndarray) -> np.ndarray:
    n = np.array(l.normal) / np.linalg.norm(l.normal)
    return np.maximum(np.abs(p @ n), np.linalg.norm(p, axis=1) - l.radius)


def _sphere_square(l: SphereLight, p: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """By Archimedes: the area between two heights along any axis is that of the cylinder around it."""
    return 0.5 + 0.5 * (p @ turn[2]) / l.radius, cosine(p @ turn[0], p @ turn[1])


def _sphere_away(l: SphereLight, p: np.ndarray) -> np.ndarray:
    return np.abs(np.linalg.norm(p, axis=1) - l.radius)


LIGHT_SAMPLES = {
    s.kind.__name__: s
    for s in (
        LightSample(
            PointLight,
            lambda p, size: PointLight(position=p),
            PointLight(position=(3, 4, 5), Ia=(0.1, 0.1, 0.1), a=0.5, b=0.1, c=0.01),
            lambda rng, size: {},
        ),
        LightSample(
            DirectionalLight,
            lambda p, size: DirectionalLight(direction=(0.0, -1.0, 0.0)),
            DirectionalLight(direction=(-0.6, -1, -0.4), a=2.0),
            lambda rng, size: {"direction": downwards(rng)},
        ),
        LightSample(
            SpotLight,
            lambda p, size: SpotLight(position=p, direction=(0.0, -1.0, 0.0), angle=85.0),
            SpotLight(position=(2, 4, 3), direction=(-0.5, -1, -0.7), angle=24.0, exponent=0.0),
            _spot,
            all_around={"angle": 180.0},
        ),
        LightSample(
            RectangleLight,
            lambda p, size: RectangleLight(position=p, width=(size, 0.0, 0.0), height=(0.0, 0.0, size)),
            RectangleLight(position=(0.5, 3, 1), width=(1, 0, 0.2), height=(0, 0.3, 1)),
            _rectangle,
            LightSurface(
                lambda l: float(np.linalg.norm(np.cross(l.width, l.height))), _rectangle_away, _rectangle_square
            ),
        ),
        LightSample(
            DiskLight,
            lambda p, size: DiskLight(position=p, radius=size / 2),
            DiskLight(position=(-0.5, 3, 1), normal=(0.2, -1, 0), radius=0.8),
            lambda rng, size: {"radius": size * float(rng.uniform(0.2, 1)), "normal": direction(rng)},
            LightSurface(lambda l: pi * l.radius**2, _disk_away, _disk_square),
        ),
        LightSample(
            SphereLight,
            lambda p, size: SphereLight(position=p, radius=size / 2),
            SphereLight(position=(-2, 2, 2), radius=0.5),
            lambda rng, size: {"radius": size * float(rng.uniform(0.2, 1))},
            LightSurface(lambda l: 4 * pi * l.radius**2, _sphere_away, _sphere_square),
        ),
    )
}
LIGHT_NAMES = [kind.__name__ for kind in KINDS]
AREA_NAMES = [kind.__name__ for kind in KINDS if kind.has_area]


def light_sample(name: str) -> LightSample:
    """The sample of a kind, by its name."""
    assert name in LIGHT_SAMPLES, f"{name} has no entry in LIGHT_SAMPLES of tests/light_samples.py"
    sample = LIGHT_SAMPLES[name]
    assert (sample.surface is not None) == sample.kind.has_area, (
        f"the sample of {name} needs a surface if it is an area light"
    )
    return sample
