"""What is put to the test: the kernel, or any function of rays."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import drjit as dr
import numpy as np

from visray import clock
from visray.accel.intersect import Target, closest, occluded
from visray.accel.origin import RayOrigin
from visray.errors import UserError
from visray.geometry import face_forward
from visray.interaction import surface_of
from visray.polynomials import PolynomialError
from visray.primitives.clips import Ball
from visray.primitives.polynomial import Polynomial
from visray.pytree import rows
from visray.ray import NOTHING_KNOWN, Ray
from visray.scene.scene import Scene, Settings
from visray.setup import prepare
from visray.study.stability.exact.known_surface import Bundle, Surface
from visray.study.stability.ray_sets import Leaving

TIMED, RUNS = 1 << 17, 5


class Solver(Protocol):
    """What is put to the test."""

    def first(self, rays: Bundle) -> tuple[np.ndarray, np.ndarray | None]:
        """Distances, inf for none, and unit normals along the gradient, if it has any. Shapes: (N), (N, 3)."""

    def leave(self, leaving: Leaving) -> tuple[np.ndarray, np.ndarray]:
        """Distances along rays that leave hits of its own, NaN where it has none; and whether anything is between."""

    def unresolved(self, rays: Bundle) -> int | None:
        """On how many rays a part was too narrow to tell, where it says so itself."""

    def seconds(self, rays: Bundle) -> float | None:
        """How long one ray takes, on one thread."""


@dataclass(frozen=True)
class Function:
    """A function (o, d) -> t as a solver. Rays that leave the surface it knows nothing of."""

    solve: Callable[[np.ndarray, np.ndarray], np.ndarray]

    def first(self, rays: Bundle) -> tuple[np.ndarray, np.ndarray | None]:
        return self.solve(rays.o, rays.d), None

    def leave(self, leaving: Leaving) -> tuple[np.ndarray, np.ndarray]:
        t = self.solve(leaving.rays.o, leaving.rays.d)
        return t, np.isfinite(t)

    def unresolved(self, rays: Bundle) -> int | None:
        return None

    def seconds(self, rays: Bundle) -> float | None:
        begun = clock.now()
        self.solve(rays.o, rays.d)
        return (clock.now() - begun) / len(rays)


class Kernel:
    """visray's search in a scene that has only the surface, all in double."""

    def __init__(self, surface: Surface):
        thing = Polynomial(
            expression=surface.expression,
            parameters=dict(surface.parameters),
            clip=Ball(center=tuple(map(float, surface.centre)), radius=float(surface.radius)),
            ends="open",
        )
        try:
            prepared = prepare(Scene(objects={"surface": thing}, settings=Settings(precision="double")))
        except PolynomialError as error:
            raise UserError(str(error)) from None
        self.a, self.kernel, self.far = prepared.a, prepared.kernel, 10 * surface.radius

    def triples(self, v: np.ndarray) -> Any:
        return self.a.W(np.ascontiguousarray(v.T, float))

    def origin(self, o: Any) -> RayOrigin:
        return RayOrigin(self.kernel.geometry, o, shared=False)

    def look(self, rays: Bundle) -> tuple:
        ray = Ray(self.triples(rays.o), self.triples(rays.d))
        hit = closest(self.origin(ray.o), ray)
        surface = surface_of(self.kernel, ray, hit)[0]
        return ray, hit, surface

    def first(self, rays: Bundle) -> tuple[np.ndarray, np.ndarray | None]:
        _, hit, surface = self.look(rays)
        dr.eval(hit, surface)
        return np.array(hit.t), np.array(surface.n, float).T

    def leave(self, leaving: Leaving) -> tuple[np.ndarray, np.ndarray]:
        first, hit, surface = self.look(leaving.first)
        n, within = face_forward(surface.n, self.a.V(first.d))
        d = self.triples(leaving.rays.d)
        ray = Ray(surface.p, d, hit.row, within, surface.error, dr.dot(self.a.W(n), d), hit.part)
        dr.eval(ray)
        origin = self.origin(ray.o)
        again = closest(origin, ray)
        between = occluded(origin, ray, Target(self.a.D(self.far), self.a.D(0)), self.a.B(True))
        t = dr.select(hit.valid, again.t, dr.nan)
        return np.array(t), np.array(between)

    def unresolved(self, rays: Bundle) -> int | None:
        ray = Ray(self.triples(rays.o), self.triples(rays.d))
        batch = self.kernel.batches[0]
        seen = batch.kind.seen(rows(batch.placed, self.a.U(0)), ray.o)
        return int(np.count_nonzero(np.array(batch.kind.crossing(seen, ray, 0, None, NOTHING_KNOWN).unresolved)))

    def seconds(self, rays: Bundle) -> float | None:
        repeat = np.resize(np.arange(len(rays)), TIMED)
        ray = Ray(self.triples(rays.o[repeat]), self.triples(rays.d[repeat]))
        dr.eval(ray)
        threads, best = dr.thread_count(), np.inf
        try:
            dr.set_thread_count(1)
            for _ in range(RUNS + 1):  # the first one compiles
                dr.sync_thread()
                with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
                    dr.kernel_history_clear()
                    dr.eval(closest(self.origin(ray.o), ray))
                    spent = clock.kernel_seconds(dr.kernel_history([dr.KernelType.JIT]))
                best = min(best, spent)
        finally:
            dr.set_thread_count(threads)
        return best / TIMED
