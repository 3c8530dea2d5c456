"""Which things of a scene are surroundings, and from which directions the rest is seen.

Surroundings, such as a floor, a wall or a sky, need not be in a fitted picture as a whole: they are unbounded, or much
larger than all that lies on them or in them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from visray.blocking import Blocker
from visray.fitting import Balls
from visray.primitives.box import Box
from visray.primitives.ellipsoid import Ellipsoid
from visray.primitives.sphere import Sphere
from visray.things import Thing

# A bounded thing is a surrounding if its radius is so many times that of all smaller things together, and these touch
# it, or are nearer to it than their own radius; or if it is a hollow room for them, a ball or a box, and larger by the
# second factor.
LARGER, ROOMY = 20.0, 1.5
# Largest number of things to which a view is tested, and of things that may hide them, the largest ones.
TARGETS, HIDING = 24, 64
# A floor lies below things if the direction up from it to them is nearer to y than this cosine says.
UPRIGHT = 0.7


@dataclass(frozen=True)
class Stage:
    """What a fitted picture shows, and what may hide it.

    shown: the things that must be in the picture.
    around: the surroundings.
    """

    shown: tuple[Thing, ...]
    around: tuple[Thing, ...]

    @staticmethod
    def of(things: Sequence[Thing]) -> "Stage":
        """The stage of a scene's things."""
        endless = [x for x in things if x.balls is None]
        bounded = sorted((x for x in things if x.balls is not None), key=lambda x: x.reach)
        keep = next((i for i in _candidates(bounded) if _is_around(bounded[i], _union(bounded[:i]))), len(bounded))
        shown = {id(x) for x in bounded[:keep]}
        ordered = [x for x in things if id(x) in shown]
        return Stage(tuple(ordered), (*endless, *bounded[keep:]))

    @cached_property
    def balls(self) -> Balls | None:
        """Balls that contain all that must be in the picture; None if there is nothing."""
        return _union(self.shown) if self.shown else None

    def visible(self, points: np.ndarray) -> np.ndarray:
        """For each point, the share of the things whose middle is not hidden from it. 1 if nothing is shown.

        Shapes: points (N, 3); result (N).
        """
        targets = _some(self.shown, TARGETS)
        if not targets:
            return np.ones(len(points))
        seen = np.ones((len(targets), len(points)), bool)
        middles = np.array([x.center for x in targets])
        begin = np.broadcast_to(middles[:, None], (*seen.shape, 3)).reshape(-1, 3)
        end = np.broadcast_to(points, (*seen.shape, 3)).reshape(-1, 3)
        for other, blocker in self._hiding:
            own = np.array([x is other for x in targets])
            seen &= ~blocker.blocks(begin, end).reshape(seen.shape) | own[:, None]
        return seen.mean(axis=0)

    def free(self, points: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Whether balls are cut by nothing along the axes.

        Shapes: points (N, 3), radius (N); result (N).
        """
        result = np.ones(len(points), bool)
        for step in np.concatenate([np.eye(3), -np.eye(3)]):
            for _, blocker in self._hiding:
                result &= ~blocker.blocks(points, points + radius[:, None] * step)
        return result

    @cached_property
    def _hiding(self) -> list[tuple[Thing, Blocker]]:
        """The things that may hide others."""
        largest = sorted(self.shown, key=lambda x: -x.reach)[:HIDING]
        opaque = [x for x in (*self.around[:HIDING], *largest) if x.opaque and x.shape is not None]
        return [(x, blocker) for x in opaque if (blocker := Blocker.of(x.shape)) is not None]


def _candidates(things: Sequence[Thing]) -> list[int]:
    """Numbers of the things that are much larger than the box of all before them. Domain: bounded things by size."""
    if len(things) < 2:
        return []
    low = np.minimum.accumulate(np.array([x.low for x in things]))
    high = np.maximum.accumulate(np.array([x.high for x in things]))
    half = 0.5 * np.max(high - low, axis=1)
    reach = np.array([x.reach for x in things])
    # The longest side of a box is no longer than the diameter of what it contains.
    return [i + 1 for i in np.flatnonzero(reach[1:] > ROOMY * half[:-1]).tolist()]


def _some(things: Sequence[Thing], most: int) -> list[Thing]:
    """At most so many of the things, evenly chosen."""
    if len(things) <= most:
        return list(things)
    return [things[i] for i in np.linspace(0, len(things) - 1, most).astype(int)]


def _union(things: Sequence[Thing]) -> Balls:
    """The balls of several things."""
    return Balls(*(np.concatenate([getattr(x.balls, k) for x in things]) for k in ("centre", "radius")))


def _is_around(thing: Thing, rest: Balls) -> bool:
    """Whether a thing is a surrounding of smaller things."""
    reach, away = rest.reach(), rest.middle() - thing.center
    distance = float(np.linalg.norm(away))
    if thing.opaque and thing.reach > ROOMY * reach and _contains(thing, rest):
        return True
    if thing.reach < LARGER * reach:
        return False
    near = (rest.middle() + reach >= thing.low).all() and (rest.middle() - reach <= thing.high).all()
    flat = np.ptp([thing.low, thing.high], axis=0)[1] < reach
    return bool(near) and (flat or away[1] > UPRIGHT * distance or distance < reach)


def _contains(thing: Thing, rest: Balls) -> bool:
    """Whether a ball or a box contains all of the rest. Domain: bounded things."""
    if type(thing.shape) not in (Sphere, Ellipsoid, Box):
        return False
    low, high = rest.box()
    if not ((thing.low <= low).all() and (high <= thing.high).all()):
        return False
    if type(thing.shape) is Box:
        return not thing.shape.transform
    inside = np.linalg.norm((rest.centre - thing.center) / (0.5 * (thing.high - thing.low)), axis=1)
    return bool((inside + rest.radius / (0.5 * np.min(thing.high - thing.low)) < 1).all())
