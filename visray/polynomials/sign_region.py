"""The sign of a factor of a polynomial in a part of space: whether both signs are there, and proofs that 0 is not."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from visray import polynomials
from visray.clip_report import directions, signs_of
from visray.polynomials.program import Factor
from visray.polynomials.volume import Affine, affine_power

# Places at which signs are compared; the best of them move to where the value is nearer to 0, so often.
PLACES, STARTS, STEPS = 6000, 24, 60
# Without a clip, places are looked at up to this distance from the origin.
FAR = 100.0
# Boxes in which f is bounded: all of them, until they are too many.
MOST_BOXES = 30_000


@dataclass(frozen=True)
class Region:
    """Where a surface is looked for: in a clip, in coordinates about its centre.

    constants: values of the program's constants.
    half: half sides of the clip.
    ball: whether it is a ball; else it is a box.
    far: whether places at all distances from its centre are looked at.
    """

    constants: tuple
    half: tuple[float, float, float]
    ball: bool
    far: bool

    def places(self) -> np.ndarray:
        """Points all over the clip. Shape: (N, 3)."""
        rng = np.random.default_rng(0)
        if self.far:
            return directions(PLACES) * FAR ** rng.uniform(-1, 1, (PLACES, 1))
        if self.ball:
            return directions(PLACES) * rng.uniform(0, 1, (PLACES, 1)) ** (1 / 3) * self.half
        return rng.uniform(-1, 1, (PLACES, 3)) * self.half

    def clipped(self, p: np.ndarray) -> np.ndarray:
        """The points, moved into the clip."""
        half = np.array(self.half)
        q = p / half
        return half * (q / np.maximum(np.linalg.norm(q, axis=1, keepdims=True), 1) if self.ball else np.clip(q, -1, 1))

    def sign(self, factor: Factor) -> int:
        """1 or -1 if the factor has this sign, or is 0, at all points that are looked at; 0 if it has both."""
        p = self.places()
        signs = signs_of(factor, self.constants, p)
        if (signs > 0).any() and (signs < 0).any():
            return 0
        sign, rng = (1 if (signs >= 0).all() else -1), np.random.default_rng(0)

        def value(p: np.ndarray) -> np.ndarray:
            return sign * np.broadcast_to(polynomials.interpret(factor.code, self.constants, tuple(p.T)), len(p))

        p = p[np.argsort(value(p))[:STARTS]]
        least = value(p)
        for step in range(STEPS):
            moves = 0.3 * 0.85 ** (step % 30) * np.linalg.norm(p, axis=1, keepdims=True)
            moved = self.clipped(p + moves * rng.normal(size=p.shape))
            found = value(moved)
            p, least = np.where((found < least)[:, None], moved, p), np.minimum(found, least)
            if (signs_of(factor, self.constants, p) == -sign).any():
                return 0
        return sign

    def is_free(self, factor: Factor) -> bool:
        """Whether it is proved that the factor is nowhere 0 in the clip: by bounds of it in boxes, which are halved."""
        used = np.array([[("axis", k) in factor.code] for k in range(3)])
        centre, size = np.zeros((3, 1)), np.ones((3, 1))
        while centre.shape[1]:
            n = centre.shape[1]
            if n > MOST_BOXES:
                return False
            axes = [Affine(centre[i], np.repeat(size[i] * np.eye(3)[:, [i]], n, axis=1), np.zeros(n)) for i in range(3)]
            form = polynomials.interpret(
                factor.code, self.constants, [a * h for a, h in zip(axes, self.half)], affine_power
            )
            left = np.broadcast_to(form.signs() == 0, n)
            if self.ball:
                left = left & ((np.maximum(np.abs(centre) - size, 0) ** 2).sum(0) <= 1)
            # A coordinate that is not in the factor is not halved.
            size = np.where(used, 0.5 * size, size)
            steps = size * np.array(list(product(*[(-1, 1) if u else (0,) for u in used[:, 0]]))).T
            centre = (centre[:, left, None] + steps[:, None, :]).reshape(3, -1)
        return True
