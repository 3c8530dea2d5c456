"""Notes about polynomial surfaces and their clips: a surface that its default clip cuts, and one that its clip misses.

A default clip is a ball of radius 5 that no scene file mentions. Nobody expects that it cuts a surface. The notes say
which radius holds the whole surface. A surface that goes on for ever is cut by any clip; there is no note about it.

The surface is found by changes of the polynomial's sign along lines from the clip's centre. A sign counts only if the
value is larger than its rounding error.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from visray import polynomials
from visray.geometry import gamma
from visray.polynomials import Compiled, Factor
from visray.primitives.clips import Ball
from visray.primitives.polynomial import Polynomial
from visray.primitives.primitive import scalars
from visray.scene.scene import Scene
from visray.warn import warn

# Lines along which signs are compared, places on each inside the clip and beyond it, and how many radii of the clip
# they go on. A surface that reaches farther than ENDLESS radii is taken for one that goes on for ever.
LINES, INSIDE, BEYOND, FARTHEST, ENDLESS = 800, 60, 80, 200.0, 20.0
# Searches: how many points move, and how often.
STARTS, STEPS = 16, 40


class ClipWarning(UserWarning):
    """Warning that a default clip cuts a polynomial surface, or that a clip misses it."""


@dataclass(frozen=True)
class Extent:
    """Where a polynomial surface was found, in coordinates about the clip's centre.

    inside: whether a part of it is in the clip.
    nearest, reach: distances of the nearest and of the farthest point found; nan if none was found.
    bounded: whether it ends; a surface that is not bounded goes on for ever.
    """

    inside: bool
    nearest: float
    reach: float
    bounded: bool


def warn_of_clips(scene: Scene) -> None:
    """Warns of polynomial surfaces that their default clip cuts, and of those that their clip misses."""
    for text in clip_notes(scene):
        warn(text, ClipWarning)


def clip_notes(scene: Scene) -> list[str]:
    """List of sentences about polynomial surfaces and their clips, each of which begins with an address."""
    return [f"{address}: {note}" for address, shape in _polynomials(scene) if (note := _note(shape))]


def _polynomials(scene: Scene) -> Iterator[tuple[str, Polynomial]]:
    """Yields the address and the shape of each geometry, object and operand that is a polynomial surface."""
    yield from ((address, shape) for address, shape in scene.shapes() if isinstance(shape, Polynomial))


def _note(shape: Polynomial) -> str | None:
    """The sentence about one surface; None if there is nothing to say."""
    volume = scalars(shape.clip_volume())
    half_sides = tuple(map(float, volume.half_sides()))
    default, compiled = shape.clip is None and shape.surface is None, shape.compiled()
    ball = isinstance(shape.clip_volume(), Ball)
    found = extent(compiled, half_sides, ball, default)
    if found.inside:
        if not (default and found.bounded and found.reach > half_sides[0]):
            return None
        return (
            f"its clip, a ball of radius {half_sides[0]:g} that is not written, cuts the surface, which reaches "
            f"{found.reach:.3g} from the origin; write {_ball(1.001 * found.reach)}"
        )
    if shape.closed and not default and _negative(compiled):
        return None  # the solid fills its clip, and is seen as the clip
    where = f"its clip, a ball of radius {half_sides[0]:g} that is not written" if default else "its clip"
    if math.isnan(found.nearest):
        more = "; none was found farther out either: f has the same sign everywhere" if default else "; move the clip"
        return f"no point of the surface is in {where}{more}"
    advice = _ball(1.001 * found.reach if found.bounded else 2 * found.nearest)
    return f"no point of the surface is in {where}; it begins {found.nearest:.3g} from the origin; write {advice}"


def _ball(radius: float) -> str:
    """The clip to write, as JSON, with the radius rounded up to two digits."""
    unit = 10.0 ** (math.floor(math.log10(radius)) - 1)
    return f'"clip": {{"type": "sphere", "radius": {math.ceil(radius / unit) * unit:.6g}}}'


def _negative(compiled: Compiled) -> bool:
    """Whether f is below 0 at the clip's centre."""
    odd = [f for f in compiled.program.factors if not f.even]
    signs = [signs_of(f, compiled.values, np.zeros((1, 3)))[0] for f in odd]
    return compiled.program.sign * math.prod(signs) < 0


@lru_cache(maxsize=256)
def extent(compiled: Compiled, half_sides: tuple[float, float, float], ball: bool, default: bool) -> Extent:
    """Where a polynomial surface is.

    half_sides: half the sides of the clip; for a ball, three times its radius.
    ball: whether the clip is a ball; else it is a box.
    default: whether places beyond the clip are looked at too.
    """
    parts = [_extent(f, compiled.values, np.array(half_sides), ball, default) for f in compiled.program.factors]
    nearest, reach = (np.array([getattr(p, name) for p in parts]) for name in ("nearest", "reach"))
    some = not np.isnan(nearest).all()
    return Extent(
        any(p.inside for p in parts),
        float(np.nanmin(nearest)) if some else math.nan,
        float(np.nanmax(reach)) if some else math.nan,
        all(p.bounded for p in parts),
    )


def _extent(factor: Factor, constants: tuple, half_sides: np.ndarray, ball: bool, default: bool) -> Extent:
    """Where the surface of one factor is. Arguments as in `extent`."""
    radius = half_sides[0]
    if not default:
        return Extent(_in_clip(factor, constants, half_sides, ball), math.nan, math.nan, True)
    steps = np.geomspace(1, FARTHEST, BEYOND) * radius
    t = np.concatenate([np.linspace(0, radius, INSIDE, endpoint=False), steps])
    lines = directions(LINES)
    low, high, ends = _changes(factor, constants, np.zeros(3), lines, t)
    if not len(low):
        return _far(factor, constants, radius, t)
    low, high = _bisected(factor, constants, lines[ends], low, high)
    last = signs_of(factor, constants, t[-1] * lines)
    reach, bounded = high.max(), bool((last == last[0]).all())
    # Lines may pass beside a thin part that reaches farther.
    if bounded and reach > radius / 2:
        reach = _farthest(factor, constants, lines[ends[np.argsort(high)[-STARTS:]]], t)
    bounded = bounded and reach < ENDLESS * radius
    # A part that is too small for the lines may still be in the clip.
    inside = low.min() < radius or _in_clip(factor, constants, half_sides, ball)
    return Extent(bool(inside), float(low.min()), float(reach), bounded)


def directions(count: int) -> np.ndarray:
    """Unit vectors that cover the sphere evenly, on a Fibonacci spiral. Shapes: (count, 3)."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + math.sqrt(5)) * k
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], -1)


def signs_of(factor: Factor, constants: tuple, p: np.ndarray) -> np.ndarray:
    """Sign of a factor at each point: -1 or 1, or 0 if the value is within its rounding error.

    Error: each value is the result of at most as many roundings as there are products and sums, and the sizes of all
        terms add up to `size`.
    Shapes: p (..., 3); result (...).
    """
    axes = tuple(np.moveaxis(p, -1, 0))
    value = polynomials.interpret(factor.code, constants, axes)
    positive = tuple(("add", *at) if name == "sub" else (name, *at) for name, *at in factor.code)
    positive = tuple(("pow", *at, 1) if name == "neg" else (name, *at) for name, *at in positive)
    size = polynomials.interpret(positive, tuple(map(abs, constants)), tuple(map(np.abs, axes)))
    roundings = sum(at[1] if name == "pow" else 1 for name, *at in factor.code)
    sign = np.where(np.abs(value) > gamma(2 * roundings) * size, np.sign(value), 0)
    return np.broadcast_to(sign, p.shape[:-1])


def _changes(factor: Factor, constants: tuple, o: np.ndarray, d: np.ndarray, t: np.ndarray) -> tuple:
    """First and last changes of the sign along lines o + t d: distances before and behind each, and its line."""
    signs = signs_of(factor, constants, o + t[None, :, None] * d[:, None, :])
    # Where the sign is not known, that of the place before counts.
    known = np.maximum.accumulate(np.where(signs != 0, np.arange(len(t)), 0), axis=1)
    signs = np.take_along_axis(signs, known, 1)
    change = (signs[:, 1:] * signs[:, :-1]) < 0
    lines = np.flatnonzero(change.any(1))
    first, last = change[lines].argmax(1), change.shape[1] - 1 - change[lines, ::-1].argmax(1)
    at = np.concatenate([first, last])
    return t[at], t[at + 1], np.concatenate([lines, lines])


def _bisected(factor: Factor, constants: tuple, d: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple:
    """The distances before and behind changes of the sign, much closer together."""
    before = signs_of(factor, constants, low[:, None] * d)
    for _ in range(40):
        middle = 0.5 * (low + high)
        same = signs_of(factor, constants, middle[:, None] * d) == before
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return low, high


def _farthest(factor: Factor, constants: tuple, d: np.ndarray, t: np.ndarray) -> float:
    """Distance of the farthest point of a bounded surface: lines d, which meet it far out, are turned to where it is
    farther."""
    rng, best, width = np.random.default_rng(0), np.zeros(len(d)), 2 / math.sqrt(LINES)
    for step in range(STEPS):
        turned = d + (width * 0.82**step if step else 0) * rng.normal(size=d.shape)
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        low, high, ends = _changes(factor, constants, np.zeros(3), turned, t)
        _, high = _bisected(factor, constants, turned[ends], low, high)
        reach = np.zeros(len(d))
        np.maximum.at(reach, ends, high)
        d, best = np.where((reach > best)[:, None], turned, d), np.maximum(reach, best)
    return float(best.max())


def _in_clip(factor: Factor, constants: tuple, half_sides: np.ndarray, ball: bool) -> bool:
    """Whether a part of the surface of a factor is in the clip. Arguments as in `extent`."""
    rng = np.random.default_rng(0)

    def clipped(p: np.ndarray) -> np.ndarray:
        q = p / half_sides
        q = q / np.maximum(np.linalg.norm(q, axis=1, keepdims=True), 1) if ball else np.clip(q, -1, 1)
        return q * half_sides

    starts = clipped(rng.uniform(-1, 1, (4096, 3)) * half_sides)
    return _opposite(factor, constants, starts, clipped) is not None


def _far(factor: Factor, constants: tuple, radius: float, t: np.ndarray) -> Extent:
    """Where the surface of a factor is that no line from the centre meets: it may be small, and far away.

    radius: radius of the clip. t: distances at which signs are compared.
    """
    rng, lines = np.random.default_rng(0), directions(LINES)
    starts = directions(4096) * (radius * 10 ** rng.uniform(-2, 2, (4096, 1)))
    p = _opposite(factor, constants, starts, lambda p: p)
    if p is None:
        return Extent(False, math.nan, math.nan, True)
    distance = np.linalg.norm(p)
    low, high, ends = _changes(factor, constants, p, lines, np.append(0, np.geomspace(1e-6, 1e3, 400) * distance))
    seen = np.append(np.linalg.norm(p + high[:, None] * lines[ends], axis=1), [] if len(low) else distance)
    last = signs_of(factor, constants, t[-1] * lines)
    bounded = bool((last == last[0]).all()) and seen.max() < ENDLESS * radius
    return Extent(bool(min(distance, seen.min()) < radius), float(seen.min()), float(seen.max()), bounded)


def _opposite(
    factor: Factor, constants: tuple, starts: np.ndarray, clipped: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray | None:
    """A point at which a factor has another sign than at others, or is 0 to within rounding; None if none is found.

    starts: points where the search begins. The best of them move to where the value is nearer to 0.
    clipped: function that moves points to where they may be.
    """
    signs, rng = signs_of(factor, constants, starts), np.random.default_rng(0)
    others = np.flatnonzero(signs != signs[0])
    if len(others) or not signs[0]:
        return starts[others[0]] if len(others) else starts[0]

    def value(p: np.ndarray) -> np.ndarray:
        return signs[0] * polynomials.interpret(factor.code, constants, tuple(p.T))

    p = starts[np.argsort(value(starts))[:STARTS]]
    least = value(p)
    for step in range(STEPS):
        moves = 0.3 * 0.9**step * np.linalg.norm(p, axis=1, keepdims=True)
        moved = clipped(p + moves * rng.normal(size=p.shape))
        found = value(moved)
        p, least = np.where((found < least)[:, None], moved, p), np.minimum(found, least)
        others = np.flatnonzero(signs_of(factor, constants, p) != signs[0])
        if len(others):
            return p[others[0]]
    return None
