"""The straight ways from points to a light: on them visray and Mitsuba look for what is in between."""

from dataclasses import dataclass, replace

import numpy as np

from visray.lights.light import Light


@dataclass(frozen=True)
class ShadowRays:
    """ShadowRays to one light, in double. Shapes: p and l (N, 3), length (N).

    p: where they begin, from the centre of the check. l: unit, towards the light. length: in world units, inf for all
    of the way to a light that is infinitely far away. far: whether it is. Shapes: (1).
    """

    p: np.ndarray
    l: np.ndarray
    length: np.ndarray
    far: np.ndarray

    @staticmethod
    def between(p: np.ndarray, end: np.ndarray) -> "ShadowRays":
        """From p to points. Shapes: (N, 3), (N, 3) or (3)."""
        way = end - p
        length = np.linalg.norm(way, axis=1)
        l = np.divide(way, length[:, None], out=np.zeros_like(way), where=length[:, None] > 0)
        return ShadowRays(p, l, length, np.array([False]))

    @staticmethod
    def to(p: np.ndarray, light: Light, centre: np.ndarray) -> "ShadowRays":
        """From p to a light: to its middle, or against its direction."""
        if light.has_position:
            return ShadowRays.between(p, np.array(light.position, float) - centre)
        d = np.array(light.direction, float)
        return ShadowRays(
            p, np.broadcast_to(-d / np.linalg.norm(d), p.shape), np.full(len(p), np.inf), np.array([True])
        )

    @property
    def end(self) -> np.ndarray:
        """Where they end. Shapes: (N, 3), finite where the lengths are."""
        return self.p + self.length[:, None] * self.l

    def begun(self, by: np.ndarray) -> "ShadowRays":
        """The ways without the first part, at most all of them. Shapes: (N)."""
        by = np.clip(by, 0, self.length)
        return replace(self, p=self.p + by[:, None] * self.l, length=self.length - by)

    def ended(self, by: np.ndarray) -> "ShadowRays":
        """The ways without the last part."""
        return replace(self, length=np.maximum(self.length - by, 0))

    def cut(self, length: np.ndarray) -> "ShadowRays":
        """The ways, as far as these lengths."""
        return replace(self, length=np.minimum(self.length, length))

    def moved(self, start: np.ndarray, slope: np.ndarray, e: np.ndarray) -> "ShadowRays":
        """The ways moved along e: where they begin by `start`, other places by `slope` times their distance more."""
        p = self.p + start[:, None] * e
        if not self.far:
            return ShadowRays.between(p, self.end + (start + slope * self.length)[:, None] * e)
        l = self.l + slope[:, None] * e
        return replace(self, p=p, l=l / np.linalg.norm(l, axis=1, keepdims=True))
