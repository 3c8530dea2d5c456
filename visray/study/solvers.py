"""What is put to the test: the kernel, or any function of rays."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import drjit as dr
import numpy as np

from visray import clock
from visray.errors import UserError
from visray.exposure import set_up
from visray.geometry import facing
from visray.polynomials import Wrong
from visray.primitives.clips import Ball
from visray.primitives.polynomial import Polynomial
from visray.ray import Ray
from visray.scene.scene import Scene, Settings
from visray.scenery import feel
from visray.search import End, Watch, blocked, closest
from visray.study.exact.known_surface import Bundle, Surface
from visray.study.ray_sets import Leaving
from visray.trees import rows

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
            made = set_up(Scene(objects={"surface": thing}, settings=Settings(precision="double")))
        except Wrong as error:
            raise UserError(str(error)) from None
        self.a, self.scenery, self.far = made.a, made.stage.scenery, 10 * surface.radius

    def triples(self, v: np.ndarray) -> Any:
        return self.a.W(np.ascontiguousarray(v.T, float))

    def watch(self, o: Any) -> Watch:
        return Watch(self.a, self.scenery.kin, self.scenery.groups, o, shared=False)

    def look(self, rays: Bundle) -> tuple:
        ray = Ray(self.triples(rays.o), self.triples(rays.d))
        hit = closest(self.watch(ray.o), ray)
        surface = feel(self.scenery, ray, hit)[0]
        return ray, hit, surface

    def first(self, rays: Bundle) -> tuple[np.ndarray, np.ndarray | None]:
        _, hit, surface = self.look(rays)
        dr.eval(hit, surface)
        return np.array(hit.t), np.array(surface.n, float).T

    def leave(self, leaving: Leaving) -> tuple[np.ndarray, np.ndarray]:
        first, hit, surface = self.look(leaving.first)
        n, within = facing(surface.n, self.a.V(first.d))
        d = self.triples(leaving.rays.d)
        ray = Ray(surface.p, d, hit.index, within, surface.error, None, dr.dot(self.a.W(n), d))
        dr.eval(ray)
        watch = self.watch(ray.o)
        again = closest(watch, ray)
        between = blocked(watch, ray, End(self.a.D(self.far)), self.a.B(True))
        t = dr.select(hit.valid, again.t, dr.nan)
        return np.array(t), np.array(between)

    def unresolved(self, rays: Bundle) -> int | None:
        ray = Ray(self.triples(rays.o), self.triples(rays.d))
        kind, placed = self.scenery.kin[0].kind, rows(self.scenery.groups[0].placed, self.a.U(0))
        return int(np.count_nonzero(np.array(kind.unresolved(kind.seen(placed, ray.o), ray))))

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
                    dr.eval(closest(self.watch(ray.o), ray))
                    spent = clock.ran(dr.kernel_history([dr.KernelType.JIT]))
                best = min(best, spent)
        finally:
            dr.set_thread_count(threads)
        return best / TIMED
