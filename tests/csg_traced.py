"""What the kernels say of one CSG object: first hits, rays that leave surfaces, shadows, and what is inside."""

from dataclasses import dataclass
from functools import cached_property
from itertools import count
from typing import Any

import drjit as dr
import numpy as np
from csg_trees import leaves_apart
from csg_truth import Solid
from samples import Lineup

from visray.accel.intersect import Target, closest, occluded
from visray.accel.origin import RayOrigin
from visray.camera import Camera
from visray.geometry import gamma
from visray.interaction import surface_of
from visray.materials import Material
from visray.ray import Ray
from visray.scene.scene import Film, Scene, Settings
from visray.setup import prepare

# The red of a leaf's material is its number in units of this one, so that it is exact in single precision.
STEP = 2.0**-10


@dataclass(frozen=True)
class Found:
    """First hits of rays. Shapes: (N), (N, 2) or (N, 3).

    leaf: number of the material of the leaf that is seen.
    inside: whether the ray sees the surface from inside.
    """

    hit: np.ndarray
    t: np.ndarray
    p: np.ndarray
    n: np.ndarray
    leaf: np.ndarray
    inside: np.ndarray
    row: np.ndarray
    part: np.ndarray
    error: np.ndarray
    uv: np.ndarray

    def at(self, lanes: np.ndarray) -> "Found":
        """The hits of some rays."""
        return Found(*(getattr(self, name)[lanes] for name in Found.__dataclass_fields__))


class Traced:
    """An object whose leaves have materials of their own, alone in a scene."""

    def __init__(self, obj: Any, precision: str = "double", brute_force: bool = False):
        number = count()
        self.obj = leaves_apart(obj, lambda: f"m{next(number)}")
        self.brute_force = brute_force
        self.scene = Scene(
            film=Film(width=1, height=1),
            objects={"a": self.obj},
            materials={f"m{i}": Material(kd=(i * STEP, 0.5, 0.5)) for i in range(next(number))},
            settings=Settings(precision=precision),
            camera=Camera(),
            lights={},
        )
        self.kernel = prepare(self.scene).kernel
        self.a = self.kernel.a

    @cached_property
    def solid(self) -> Solid:
        """The truth about the object."""
        return Solid(self.obj)

    @property
    def material_of(self) -> np.ndarray:
        """Number of the material of each leaf of the truth. A polynomial and its clip are two of them."""
        return np.array([int(leaf.material[1:]) for leaf in self.solid.leaves])

    def vectors(self, v: np.ndarray) -> Any:
        return self.a.put(self.a.W, np.asarray(v, float).T)

    def first(self, o: np.ndarray, d: np.ndarray) -> Found:
        return self._first(Ray(self.vectors(o), self.vectors(d)))

    def _first(self, ray: Ray) -> Found:
        hit = closest(RayOrigin(self.kernel.geometry, ray.o, shared=False), ray, self.brute_force)
        s, material, *uv = surface_of(self.kernel, ray, hit)
        facing = dr.dot(self.a.W(s.n), ray.d)
        part = dr.zeros(self.a.U, ray.lanes) if hit.part is None else hit.part
        dr.eval(hit, s, material.kd, facing, part, uv)
        met, leaf = np.array(hit.valid), np.rint(np.array(material.kd.x, float) / STEP).astype(int)

        def each(x: Any, *shape: int) -> np.ndarray:
            """An array with an entry for each ray, even if all rays have one value."""
            return np.broadcast_to(np.array(x).T, (len(met), *shape))

        return Found(met, each(hit.t), each(s.p, 3), each(s.n, 3).astype(float), each(leaf), each(facing) > 0,
                     each(hit.row), each(part), each(s.error),
                     np.stack([each(x) for x in uv], 1))  # fmt: skip

    def leaving(self, start: Found, d: np.ndarray) -> Ray:
        """Rays from hits, as Interaction.spawn_ray makes them. They run on the side that `d` points to."""
        a, slope = self.a, (start.n * d).sum(1)
        return Ray(self.vectors(start.p), self.vectors(d), a.put(a.U, start.row), a.put(a.B, slope < 0),
                   a.put(a.D, start.error), a.put(a.D, np.abs(slope)), a.put(a.U, start.part))  # fmt: skip

    def first_from_origin(self, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(whether there is a hit, its distance) of rays that share their origin, a point that may be on a surface."""
        ray = Ray(self.vectors(o[None]), self.vectors(d))
        hit = closest(RayOrigin(self.kernel.geometry, ray.o, shared=True), ray, self.brute_force)
        return np.array(hit.valid), np.array(hit.t)

    def first_from(self, start: Found, d: np.ndarray) -> Found:
        """The first hits of rays that leave hits."""
        return self._first(self.leaving(start, d).exact())

    def occluded_to(self, start: Found, light: np.ndarray) -> np.ndarray:
        """Whether something is in the way from hits to lights, by rays that leave the hits. Shape of lights: (N, 3)."""
        way = light - start.p
        distance = np.linalg.norm(way, axis=1)
        ray = self.leaving(start, way / distance[:, None])
        error = gamma(9) * (np.abs(light).sum(1) + distance)
        target = Target(self.a.put(self.a.D, distance), self.a.put(self.a.D, error), may_touch=True)
        return self._occluded(ray, target)

    def occluded_from(self, light: np.ndarray, end: Found, shared: bool = False) -> np.ndarray:
        """Whether something is in the way from lights to hits, by rays that leave the lights (direct.light_sample).

        shared: whether all lights are one, and rays may be found in lists. Then the shape of `light` is (1, 3).
        """
        a, way = self.a, end.p - light
        distance = np.linalg.norm(way, axis=1)
        d = way / distance[:, None]
        error = end.error + gamma(9) * (np.abs(light).sum(1) + distance)
        slope = np.abs((end.n * d).sum(1))
        put = a.put
        target = Target(put(a.D, distance), put(a.D, error), put(a.U, end.row), put(a.B, end.inside),
                        put(a.U, end.part), slack=put(a.D, error), cosine=put(a.D, slope))  # fmt: skip
        return self._occluded(Ray(self.vectors(light), self.vectors(d)), target, shared)

    def between(self, o: np.ndarray, d: np.ndarray, length: np.ndarray) -> np.ndarray:
        """Whether something is in the way along rays that start and end in free space."""
        target = Target(self.a.put(self.a.D, length), self.a.D(0))
        return self._occluded(Ray(self.vectors(o), self.vectors(d)), target)

    def _occluded(self, ray: Ray, target: Target, shared: bool = False) -> np.ndarray:
        origin = RayOrigin(self.kernel.geometry, ray.o, shared=shared)
        return np.array(occluded(origin, ray, target, self.a.B(True), self.brute_force))

    def lengths_inside(self, o: np.ndarray, d: np.ndarray, length: np.ndarray) -> np.ndarray:
        """The lengths inside the object along rays that start and end in free space. Domain: solids."""
        line = Lineup([self.obj_alone()], len(o))
        return np.array(line.length_inside(line.ray(o, d), line.a.put(line.a.D, length))[1])

    def lengths_from(self, start: Found, d: np.ndarray, length: np.ndarray) -> np.ndarray:
        """The lengths inside the object along rays that leave hits and end in free space. Domain: solids."""
        a, n = self.a, len(d)
        line = Lineup([self.obj_alone()], n)
        inside, part = a.put(a.B, (start.n * d).sum(1) < 0), a.put(a.U, start.part)
        known = {"on_start": dr.full(a.B, True, n), "inside": inside, "start_part": part}
        ray = line.ray(start.p, d, inside=inside, part=part)
        return np.array(line.length_inside(ray, a.put(a.D, length), **known)[1])

    def inside(self, p: np.ndarray) -> np.ndarray:
        """Whether points are inside. Domain: solids."""
        line = Lineup([self.obj_alone()], len(p))
        return np.array(line.kind.inside(line.placed(), line.a.put(line.a.W, p.T)))

    def obj_alone(self) -> Any:
        """The object with one material, for a scene without materials."""
        return leaves_apart(self.obj, lambda: "default")
