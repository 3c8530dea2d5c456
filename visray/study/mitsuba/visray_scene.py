"""The visray side of the check: first hits, normals and colours along rays that Mitsuba traces too.

The rays are stored in single precision. All positions are relative to the camera (the centre of the check), because
small coordinates have small rounding errors.
"""

from dataclasses import dataclass, field
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
    """Rays in single precision, relative to the camera.

    o: origins, float32, (N, 3), or (1, 3) if all rays share one origin
    d: directions, float32, (N, 3); their lengths are 1 to within 2^-23
    """

    o: np.ndarray
    d: np.ndarray

    def direction(self) -> np.ndarray:
        """Unit directions in double precision. Shapes: (N, 3)."""
        d = self.d.astype(float)
        return d / np.linalg.norm(d, axis=1, keepdims=True)


@dataclass(frozen=True)
class FirstHits:
    """The first hit of each ray, in double precision.

    index: index of the object, -1 without a hit, (N)
    t: distance, inf without a hit, (N)
    n: unit normal, (N, 3)
    uv: texture coordinates, (N, 2); NaN if Mitsuba traced the ray and it hit nothing
    row: row of the hit in visray's tables, NO_ROW without a hit, (N); of Mitsuba's hits a single 0
    """

    index: np.ndarray
    t: np.ndarray
    n: np.ndarray
    uv: np.ndarray
    row: np.ndarray = field(default_factory=lambda: np.zeros(1, np.uint32))

    @property
    def hit(self) -> np.ndarray:
        return self.index >= 0

    def inside(self, d: np.ndarray) -> np.ndarray:
        """Whether each ray reaches its surface from inside the object. d: directions, (N, 3). Shapes: (N)."""
        return (self.n * d).sum(1) > 0


@dataclass(frozen=True)
class TracedRays:
    """Rays that visray traced.

    ray, hit, surface: visray's records of the rays, with Dr.Jit arrays
    first_hits: the same hits as NumPy arrays
    """

    ray: Ray
    hit: Hit
    surface: Surface
    first_hits: FirstHits

    def inside(self) -> np.ndarray:
        """Whether each ray reaches its surface from inside the object. Shapes: (N)."""
        return self.first_hits.inside(np.array(self.ray.d).T)


def to_numpy(v: Any) -> np.ndarray:
    """A Dr.Jit array of triples as a NumPy array in double precision. Shapes: (N, 3)."""
    return np.array(v, float).T


class VisrayScene:
    """A scene that is prepared for visray's kernels.

    names: names of the objects in the order of their indices
    object_of_row: index of the object of each row, such as the mesh of a triangle; the last entry is -1, for NO_ROW
    centre: the camera's position, (3)
    """

    def __init__(self, scene: Scene):
        self.prepared: Prepared = prepare(scene)
        self.a, self.kernel = self.prepared.a, self.prepared.kernel
        names, object_of_row = [], []
        for batch in self.kernel.batches:
            of_batch = np.arange(len(batch)) if batch.object_of is None else np.array(batch.object_of).astype(int)
            _, first_rows, numbers = np.unique(of_batch, return_index=True, return_inverse=True)
            object_of_row.append(len(names) + numbers)
            names += [batch.names[row] for row in first_rows.tolist()]
        self.names, self.object_of_row = tuple(names), np.concatenate([*object_of_row, [-1]])
        self.centre = np.array(scene.camera.origin, float)

    def pixel_rays(self) -> Rays:
        """Camera rays through the centres of all pixels, in the order of the film's rows."""
        width, height = self.prepared.scene.film.size
        y, x = np.divmod(np.arange(width * height, dtype=np.uint32), np.uint32(width))
        ray = integrator.camera_ray(self.kernel, self.a.F(x) + 0.5, self.a.F(y) + 0.5)
        o = np.zeros((1, 3)) if self.kernel.origin else to_numpy(ray.o) - self.centre
        d = np.broadcast_to(to_numpy(ray.d), (len(x), 3))
        return Rays(o.astype(np.float32), d.astype(np.float32))

    def triples(self, v: np.ndarray) -> Any:
        """A NumPy array of triples as a Dr.Jit array. Shapes: (N, 3)."""
        return self.a.put(self.a.W, v.T.astype(float))

    def trace_from(self, o: np.ndarray, d: np.ndarray, source: np.ndarray | None = None) -> TracedRays:
        """Traces rays from origins o, relative to the camera, in directions d.

        source: row whose surface the ray leaves on the outer side, (N); None: rays may start anywhere
        """
        a = self.a
        leaving = () if source is None else (a.U(source.astype(np.uint32)), dr.full(a.B, False, len(d)))
        shared = self.kernel.origin is not None and len(o) == 1 and not o.any()
        ray = Ray(self.kernel.view.o if shared else self.triples(self.centre + o), unit(self.triples(d), a.W), *leaving)
        origin = self.kernel.origin if shared else RayOrigin(self.kernel.geometry, ray.o)
        hit = closest(origin, ray)
        surface, _, u, v = surface_of(self.kernel, ray, hit)
        dr.eval(hit, surface, u, v)
        row = np.array(hit.row)
        index = self.object_of_row[np.where(row == NO_ROW, -1, row.astype(np.int64))]
        uv = np.stack([np.array(u, float), np.array(v, float)], 1)
        return TracedRays(ray, hit, surface, FirstHits(index, np.array(hit.t), to_numpy(surface.n), uv, row))

    def trace(self, rays: Rays) -> TracedRays:
        """Traces rays that are stored in single precision."""
        return self.trace_from(rays.o.astype(float), rays.d.astype(float))

    def colours(self, traced: TracedRays) -> np.ndarray:
        """Radiance along camera rays. Shapes: (N, 3)."""
        return to_numpy(integrator.radiance(self.kernel, traced.ray)[0])
