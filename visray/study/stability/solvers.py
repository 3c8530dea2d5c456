"""Solvers under test: visray's kernel, or any function that intersects rays with a surface."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import drjit as dr
import numpy as np

from visray import clock
from visray.accel.intersect import Target, closest, occluded
from visray.accel.origin import RayOrigin
from visray.camera import Camera
from visray.errors import UserError
from visray.geometry import face_forward
from visray.interaction import surface_of
from visray.polynomials import PolynomialError
from visray.primitives.clips import Ball
from visray.primitives.polynomial import Polynomial
from visray.primitives.primitive import Primitive
from visray.pytree import rows
from visray.ray import NOTHING_KNOWN, Ray
from visray.scene.scene import Scene, Settings
from visray.setup import prepare
from visray.study.stability.exact.surface import RayBundle, Surface
from visray.study.stability.ray_sets import SecondaryRays

TIMED_RAYS, RUNS = 1 << 17, 5


class Solver(Protocol):
    """A solver under test, for one surface."""

    def first_hits(self, rays: RayBundle) -> tuple[np.ndarray, np.ndarray | None]:
        """Distances of the first hits, inf without a hit; and unit normals along the gradient, or None if not known.

        Shapes: (N), (N, 3).
        """

    def secondary(self, secondary: SecondaryRays) -> tuple[np.ndarray, np.ndarray]:
        """First hits and occlusion of rays that start at the hits of the incoming rays, as the solver finds these hits.

        Returns distances, inf without a hit, NaN if the solver finds no hit of the incoming ray; and whether the
        secondary ray is occluded. Shapes: (N), (N).
        """

    def unresolved(self, rays: RayBundle) -> int | None:
        """Number of rays for which the solver reports that rounding hides whether they hit; None: no such reports."""

    def seconds(self, rays: RayBundle) -> float | None:
        """Time of one ray in seconds, on one thread; None: not measured."""


@dataclass(frozen=True)
class FunctionSolver:
    """A solver made from a function (o, d) -> t. The function is not told which rays start on the surface.

    solve: takes origins and directions, (N, 3) each, and returns distances, inf without a hit, (N)
    """

    solve: Callable[[np.ndarray, np.ndarray], np.ndarray]

    def first_hits(self, rays: RayBundle) -> tuple[np.ndarray, np.ndarray | None]:
        return self.solve(rays.o, rays.d), None

    def secondary(self, secondary: SecondaryRays) -> tuple[np.ndarray, np.ndarray]:
        t = self.solve(secondary.rays.o, secondary.rays.d)
        return t, np.isfinite(t)

    def unresolved(self, rays: RayBundle) -> int | None:
        return None

    def seconds(self, rays: RayBundle) -> float | None:
        start = clock.now()
        self.solve(rays.o, rays.d)
        return (clock.now() - start) / len(rays)


class PrimitiveSolver:
    """visray's own search, in a scene that contains a single object, with all numbers in double precision.

    far: distance up to which rays that leave the object may be occluded by it
    """

    def __init__(self, primitive: Primitive, far: float):
        settings = Settings(precision="double")
        prepared = prepare(Scene(camera=Camera(), lights={}, objects={"surface": primitive}, settings=settings))
        self.a, self.kernel, self.far = prepared.a, prepared.kernel, far

    def triples(self, v: np.ndarray) -> Any:
        """A NumPy array of triples as a Dr.Jit array. Shapes: (N, 3)."""
        return self.a.put(self.a.W, v.T.astype(float))

    def origin(self, o: Any) -> RayOrigin:
        return RayOrigin(self.kernel.geometry, o, shared=False)

    def trace(self, rays: RayBundle) -> tuple:
        """The records (ray, hit, surface) of the rays, with Dr.Jit arrays."""
        ray = Ray(self.triples(rays.o), self.triples(rays.d))
        hit = closest(self.origin(ray.o), ray)
        surface = surface_of(self.kernel, ray, hit)[0]
        return ray, hit, surface

    def first_hits(self, rays: RayBundle) -> tuple[np.ndarray, np.ndarray | None]:
        _, hit, surface = self.trace(rays)
        dr.eval(hit, surface)
        return np.array(hit.t), np.array(surface.n, float).T

    def secondary(self, secondary: SecondaryRays) -> tuple[np.ndarray, np.ndarray]:
        incoming, hit, surface = self.trace(secondary.incoming)
        n, inside = face_forward(surface.n, self.a.V(incoming.d))
        d = self.triples(secondary.rays.d)
        ray = Ray(surface.p, d, hit.row, inside, surface.error, dr.dot(self.a.W(n), d), hit.part)
        dr.eval(ray)
        origin = self.origin(ray.o)
        next_hit = closest(origin, ray)
        is_occluded = occluded(origin, ray, Target(self.a.D(self.far), self.a.D(0)), self.a.B(True))
        t = dr.select(hit.valid, next_hit.t, dr.nan)
        return np.array(t), np.array(is_occluded)

    def seconds(self, rays: RayBundle) -> float | None:
        repeated = np.resize(np.arange(len(rays)), TIMED_RAYS)
        ray = Ray(self.triples(rays.o[repeated]), self.triples(rays.d[repeated]))
        dr.eval(ray)
        threads, least = dr.thread_count(), np.inf
        try:
            dr.set_thread_count(1)
            for _ in range(RUNS + 1):  # the first run compiles
                dr.sync_thread()
                with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
                    dr.kernel_history_clear()
                    dr.eval(closest(self.origin(ray.o), ray))
                    seconds = clock.kernel_seconds(dr.kernel_history([dr.KernelType.JIT]))
                least = min(least, seconds)
        finally:
            dr.set_thread_count(threads)
        return least / TIMED_RAYS


class KernelSolver(PrimitiveSolver):
    """visray's own search for a polynomial surface."""

    def __init__(self, surface: Surface):
        primitive = Polynomial(
            expression=surface.expression,
            parameters=dict(surface.parameters),
            clip=Ball(center=tuple(map(float, surface.centre)), radius=float(surface.radius)),
            ends="open",
        )
        try:
            super().__init__(primitive, 10 * surface.radius)
        except PolynomialError as error:
            raise UserError(str(error)) from None

    def unresolved(self, rays: RayBundle) -> int | None:
        ray = Ray(self.triples(rays.o), self.triples(rays.d))
        batch = self.kernel.batches[0]
        seen = batch.kind.seen(rows(batch.placed, self.a.U(0)), ray.o)
        return int(np.count_nonzero(np.array(batch.kind.crossing(seen, ray, 0, None, NOTHING_KNOWN).unresolved)))
