"""What visray says along rays: the same rays, in single precision, that its check sends through Mitsuba.

All positions are taken from a centre, the camera: single precision is finest where the numbers are small.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray import integrator
from visray.accel.intersect import closest
from visray.accel.origin import RayOrigin
from visray.interaction import surface_of
from visray.ray import NO_ROW, Hit, Ray, Surface, unit
from visray.scene.scene import Scene
from visray.setup import Prepared, prepare


@dataclass(frozen=True)
class Rays:
    """Rays from the centre of the check. Shapes: o (1, 3) or (N, 3), d (N, 3), float32; d is unit to 2^-23."""

    o: np.ndarray
    d: np.ndarray

    def direction(self) -> np.ndarray:
        """d in double, of unit length. Shapes: (N, 3)."""
        d = self.d.astype(float)
        return d / np.linalg.norm(d, axis=1, keepdims=True)


@dataclass(frozen=True)
class Answers:
    """What is hit first along each ray, in double.

    index: of the object, -1 for none; t: distance, inf for none; n: unit normal; uv: NaN where it is not known.
    Shapes: (N), (N), (N, 3), (N, 2).
    """

    index: np.ndarray
    t: np.ndarray
    n: np.ndarray
    uv: np.ndarray

    @property
    def hit(self) -> np.ndarray:
        return self.index >= 0


@dataclass(frozen=True)
class Look:
    """Rays as a kernel has seen them, and the answers on the host."""

    ray: Ray
    hit: Hit
    surface: Surface
    answers: Answers

    def within(self) -> np.ndarray:
        """Whether each ray meets its surface from within."""
        return (self.answers.n * np.array(self.ray.d).T).sum(1) > 0


def rows(v: Any) -> np.ndarray:
    """Triples of a kernel as an array in double. Shapes: (N, 3)."""
    return np.array(v, float).T


class VisrayScene:
    """A scene as visray sees it; `names` are its objects in the order of its indices."""

    def __init__(self, scene: Scene):
        self.prepared: Prepared = prepare(scene)
        self.a, self.kernel = self.prepared.a, self.prepared.kernel
        self.names = tuple(name for batch in self.kernel.batches for name in batch.names)
        self.centre = np.array(scene.camera.origin, float)

    def pixel_rays(self) -> Rays:
        """The rays through the centres of the pixels, row by row."""
        film = self.prepared.scene.film
        y, x = np.divmod(np.arange(film.width * film.height, dtype=np.uint32), np.uint32(film.width))
        ray = integrator.camera_ray(self.kernel, self.a.F(x) + 0.5, self.a.F(y) + 0.5)
        return Rays(np.zeros((1, 3), np.float32), rows(ray.d).astype(np.float32))

    def triples(self, v: np.ndarray) -> Any:
        """Rows of numbers as a kernel's triples."""
        return self.a.W(np.ascontiguousarray(v.T, float))

    def look(self, o: np.ndarray, d: np.ndarray, source: np.ndarray | None = None) -> Look:
        """The first hits along rays from the centre + o; `source`: objects that rays leave, outwards."""
        a = self.a
        leaving = () if source is None else (a.U(source.astype(np.uint32)), dr.full(a.B, False, len(d)))
        shared = len(o) == 1 and not o.any()
        ray = Ray(self.kernel.view.o if shared else self.triples(self.centre + o), unit(self.triples(d), a.W), *leaving)
        origin = self.kernel.origin if shared else RayOrigin(self.kernel.geometry, ray.o)
        hit = closest(origin, ray)
        surface, _, u, v = surface_of(self.kernel, ray, hit)
        dr.eval(hit, surface, u, v)
        index = np.array(hit.row).astype(np.int64)
        index[index == NO_ROW] = -1
        uv = np.stack([np.array(u, float), np.array(v, float)], 1)
        return Look(ray, hit, surface, Answers(index, np.array(hit.t), rows(surface.n), uv))

    def trace(self, rays: Rays) -> Look:
        """What the rays hit."""
        return self.look(rays.o.astype(float), rays.d.astype(float))

    def colours(self, look: Look) -> np.ndarray:
        """The light along rays from the camera. Shapes: (N, 3)."""
        return rows(integrator.radiance(self.kernel, look.ray)[0])
