"""Shadow rays: straight segments from points to one light."""

from dataclasses import dataclass, replace

import numpy as np

from visray.lights.light import Light


@dataclass(frozen=True)
class ShadowRays:
    """Shadow rays to one light, in double precision.

    p: points where the rays start, relative to the camera, (N, 3)
    l: unit directions towards the light, (N, 3)
    length: length of the rays; inf if the light is infinitely far away and the ray was not shortened (world units), (N)
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
        """Shadow rays from points p to the middle of a light.

        If the light is infinitely far away, the rays run against the light's direction. centre: the camera's position.
        """
        if light.has_position:
            return ShadowRays.between(p, np.array(light.position, float) - centre)
        d = np.array(light.direction, float)
        l = np.broadcast_to(-d / np.linalg.norm(d), p.shape)
        return ShadowRays(p, l, np.full(len(p), np.inf), np.array([True]))

    @property
    def end(self) -> np.ndarray:
        """End points. Shapes: (N, 3). Domain: rays of finite length."""
        return self.p + self.length[:, None] * self.l

    def without_start(self, by: np.ndarray) -> "ShadowRays":
        """The same rays without a first piece of length `by`. Rays that are shorter than `by` get length 0.

        Shapes: (N).
        """
        by = np.clip(by, 0, self.length)
        return replace(self, p=self.p + by[:, None] * self.l, length=self.length - by)

    def without_end(self, by: np.ndarray) -> "ShadowRays":
        """The same rays without a last piece of length `by`. Rays that are shorter than `by` get length 0.

        Shapes: (N).
        """
        return replace(self, length=np.maximum(self.length - by, 0))

    def limited(self, length: np.ndarray) -> "ShadowRays":
        """The same rays, cut off so that none is longer than `length`. Shapes: (N)."""
        return replace(self, length=np.minimum(self.length, length))

    def moved(self, start: np.ndarray, slope: np.ndarray, e: np.ndarray) -> "ShadowRays":
        """The rays, moved along the vector e: at distance s from its start, each point moves by (start + slope s) e.

        Shapes: start, slope (N), e (3).
        """
        p = self.p + start[:, None] * e
        if not self.infinite:
            return ShadowRays.between(p, self.end + (start + slope * self.length)[:, None] * e)
        l = self.l + slope[:, None] * e
        return replace(self, p=p, l=l / np.linalg.norm(l, axis=1, keepdims=True))
