"""Shadow rays: straight segments from points to one light."""

from dataclasses import dataclass, replace

import numpy as np

from visray.lights.light import Light


@dataclass(frozen=True)
class ShadowRays:
    """Shadow rays to one light, in double precision.

    p: where the rays start, relative to the centre of the check, (N, 3)
    l: unit directions towards the light, (N, 3)
    length: world units, inf for a whole ray to a light that is infinitely far away, (N)
    infinite: whether the light is infinitely far away, (1)
    """

    p: np.ndarray
    l: np.ndarray
    length: np.ndarray
    infinite: np.ndarray

    @staticmethod
    def between(p: np.ndarray, end: np.ndarray) -> "ShadowRays":
        """Shadow rays from points p to points `end`. Shapes: (N, 3), (N, 3) or (3)."""
        difference = end - p
        length = np.linalg.norm(difference, axis=1)
        l = np.divide(difference, length[:, None], out=np.zeros_like(difference), where=length[:, None] > 0)
        return ShadowRays(p, l, length, np.array([False]))

    @staticmethod
    def to(p: np.ndarray, light: Light, centre: np.ndarray) -> "ShadowRays":
        """Shadow rays from points p to the middle of a light, or against its direction."""
        if light.has_position:
            return ShadowRays.between(p, np.array(light.position, float) - centre)
        d = np.array(light.direction, float)
        l = np.broadcast_to(-d / np.linalg.norm(d), p.shape)
        return ShadowRays(p, l, np.full(len(p), np.inf), np.array([True]))

    @property
    def end(self) -> np.ndarray:
        """End points, finite where the lengths are. Shapes: (N, 3)."""
        return self.p + self.length[:, None] * self.l

    def without_start(self, by: np.ndarray) -> "ShadowRays":
        """The same rays without a first piece of length `by`, or of their whole length if that is less. Shapes: (N)."""
        by = np.clip(by, 0, self.length)
        return replace(self, p=self.p + by[:, None] * self.l, length=self.length - by)

    def without_end(self, by: np.ndarray) -> "ShadowRays":
        """The same rays without a last piece of length `by`. Shapes: (N)."""
        return replace(self, length=np.maximum(self.length - by, 0))

    def limited(self, length: np.ndarray) -> "ShadowRays":
        """The same rays, cut off at a greatest length. Shapes: (N)."""
        return replace(self, length=np.minimum(self.length, length))

    def moved(self, start: np.ndarray, slope: np.ndarray, e: np.ndarray) -> "ShadowRays":
        """The rays moved along the vector e: by `start` where they start, plus `slope` times the distance from there.

        Shapes: start, slope (N), e (3).
        """
        p = self.p + start[:, None] * e
        if not self.infinite:
            return ShadowRays.between(p, self.end + (start + slope * self.length)[:, None] * e)
        l = self.l + slope[:, None] * e
        return replace(self, p=p, l=l / np.linalg.norm(l, axis=1, keepdims=True))
