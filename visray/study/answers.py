"""What visray says along rays: the same rays, in single precision, that its check sends through Mitsuba.

All positions are taken from a centre, the camera: single precision is finest where the numbers are small.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray import integrator
from visray.exposure import Set, set_up
from visray.ray import NO_OBJECT, Hit, Ray, Surface, unit
from visray.scene.scene import Scene
from visray.scenery import feel
from visray.search import Watch, closest


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


class Ours:
    """A scene as visray sees it; `names` are its objects in the order of its indices."""

    def __init__(self, scene: Scene):
        self.made: Set = set_up(scene)
        self.a, self.stage = self.made.a, self.made.stage
        self.scenery = self.stage.scenery
        self.names = tuple(name for k in self.scenery.kin for name in k.names)
        self.centre = np.array(scene.camera.origin, float)

    def pixel_rays(self) -> Rays:
        """The rays through the centres of the pixels, row by row."""
        film = self.made.scene.film
        y, x = np.divmod(np.arange(film.width * film.height, dtype=np.uint32), np.uint32(film.width))
        ray = integrator.camera_ray(self.stage, self.a.F(x) + 0.5, self.a.F(y) + 0.5)
        return Rays(np.zeros((1, 3), np.float32), rows(ray.d).astype(np.float32))

    def triples(self, v: np.ndarray) -> Any:
        """Rows of numbers as a kernel's triples."""
        return self.a.W(np.ascontiguousarray(v.T, float))

    def look(self, o: np.ndarray, d: np.ndarray, source: np.ndarray | None = None) -> Look:
        """The first hits along rays from the centre + o; `source`: objects that rays leave, outwards."""
        a = self.a
        leaving = () if source is None else (a.U(source.astype(np.uint32)), dr.full(a.B, False, len(d)))
        shared = len(o) == 1 and not o.any()
        ray = Ray(self.stage.view.o if shared else self.triples(self.centre + o), unit(self.triples(d), a.W), *leaving)
        watch = self.stage.watch if shared else Watch(a, self.scenery.kin, self.scenery.groups, ray.o)
        hit = closest(watch, ray)
        surface, _, u, v = feel(self.scenery, ray, hit)
        dr.eval(hit, surface, u, v)
        index = np.array(hit.index).astype(np.int64)
        index[index == NO_OBJECT] = -1
        uv = np.stack([np.array(u, float), np.array(v, float)], 1)
        return Look(ray, hit, surface, Answers(index, np.array(hit.t), rows(surface.n), uv))

    def trace(self, rays: Rays) -> Look:
        """What the rays hit."""
        return self.look(rays.o.astype(float), rays.d.astype(float))

    def colours(self, look: Look) -> np.ndarray:
        """The light along rays from the camera. Shapes: (N, 3)."""
        return rows(integrator.radiance(self.stage, look.ray)[0])
