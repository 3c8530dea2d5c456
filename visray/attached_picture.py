"""Pictures with derivatives, in forward and in reverse mode: sweeps over waves of paths (wavefront.py).

Shapes: pictures are NumPy arrays (3, N), with one pixel for each lane of the prepared scene.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np

from visray import integrator
from visray.jacobian import Launches
from visray.progress import Bar, Interrupts
from visray.pytree import mapped
from visray.sampling import SamplePlan
from visray.setup import Prepared
from visray.wavefront import MULTIPLE, Arrival, Chunk, Waves, search


class Sweeps:
    """Traces all paths of a picture, chunk by chunk and surface by surface.

    waves: the paths
    launches: launches that read the scene
    interrupts: Ctrl-C. It is seen after each launch
    bar: progress bar. One step is one surface of one chunk
    """

    def __init__(self, waves: Waves, launches: Launches, interrupts: Interrupts, bar: Bar):
        self.waves, self.launches, self.interrupts, self.bar = waves, launches, interrupts, bar
        self.a, self.chunks = waves.s.a, waves.chunks()
        self.kept: tuple[list[Arrival], Callable] | None = None
        self.bar.total = len(self.chunks) * (waves.last_level + 1) * (1 if launches.tangents is not None else 2)
        self.done = 0

    def picture(self) -> tuple[np.ndarray, np.ndarray]:
        """(the picture, its tangent). In reverse mode, the tangent is 0."""
        pictures = np.zeros((len(self.waves.x), 6))
        for chunk in self.chunks:
            light = np.zeros((6, len(chunk.pixel)))
            arrivals, camera = self._arrivals(chunk)
            kept = []
            for at, colours in arrivals:
                lanes = np.array(at.wave.lane)[: at.count]
                for k, colour in enumerate(colours):
                    light[3 * k : 3 * k + 3, lanes] += _numpy(colour)[:, : at.count]
                kept.append(at)
            # In the order of lanes, so that the sum does not depend on how paths are divided into chunks.
            np.add.at(pictures, chunk.pixel[: chunk.count], light[:, : chunk.count].T)
            # Several chunks are traced again in reverse mode, because their waves may not fit into memory.
            self.kept = (kept, camera) if len(self.chunks) == 1 else None
        mean = pictures.T / self.waves.spp
        return mean[:3], mean[3:]

    def _arrivals(self, chunk: Chunk) -> tuple[Iterator, Callable]:
        """An iterator over the levels of a chunk, as pairs of an Arrival and (light, its tangent), and the launch of
        its camera rays."""
        wave, camera = self.waves.start(chunk)
        return self._levels(chunk, wave, camera), camera

    def _levels(self, chunk: Chunk, wave: Any, camera: Callable) -> Iterator:
        """The iterator of `_arrivals`."""
        end = self.done + self.waves.last_level + 1
        rays, tangents, hit = self._launch(camera, (), ())
        weight = self.waves.weight(wave)
        carried, tangents = (*rays, weight), (*tangents, 0 * weight) if tangents else ()
        dr.make_opaque(carried, tangents)
        count, level, before = chunk.count, 0, np.arange(chunk.count)
        while count:
            at = Arrival(count, dr.opaque(self.a.U, level), wave, hit, carried, before)
            results, tangents, others = self._launch(self.waves.surface(at), carried, tangents)
            yield at, (results[0], *tangents[:1])
            self._advance(self.done + 1)
            if not others:
                break
            alive, wave, ray = others
            before = np.flatnonzero(np.array(alive)[:count])
            count, level = len(before), level + 1
            if count:
                lanes = self.a.put(self.a.U, np.resize(before, count + -count % MULTIPLE).astype(np.uint32))
                kept = results[1:], tangents[1:], wave, ray
                carried, tangents, wave, ray = mapped(lambda x, lanes=lanes: dr.gather(type(x), x, lanes), kept)
                dr.make_opaque(carried, tangents, wave, ray)
                hit = self.launches.plain(search, replace(ray, o=carried[0], d=carried[1]))
        self._advance(end)

    def _launch(self, f: Callable, inputs: tuple, tangents: tuple) -> tuple:
        """(results, tangents, others) of a launch; in reverse mode, without tangents."""
        if self.launches.tangents is not None:
            return self.launches.forward(f, inputs, tangents)
        results, others = self.launches.plain(f, *inputs)
        return results, (), others

    def pull(self, adjoint: np.ndarray) -> None:
        """Reverse mode: hands the adjoint of the picture on to the parameters."""
        adjoint = adjoint / self.waves.spp
        for chunk in self.chunks:
            kept, camera = self.kept or self._traced_again(chunk)
            below = None
            for at in reversed(kept):
                below = self._pulled(at, chunk, adjoint, below)
                self._advance(self.done + 1)
            self.launches.reverse(camera, (), below[1][:2], len(chunk.pixel))
        self.launches.pull()

    def _traced_again(self, chunk: Chunk) -> tuple[list[Arrival], Callable]:
        """The levels of a chunk, and the launch of its camera rays."""
        arrivals, camera = self._arrivals(chunk)
        return [at for at, _ in arrivals], camera

    def _pulled(
        self, at: Arrival, chunk: Chunk, adjoint: np.ndarray, below: tuple[Arrival, tuple] | None
    ) -> tuple[Arrival, tuple]:
        """The surfaces `at`, with the adjoints of what they were reached by.

        adjoint: that of the picture
        below: the same for the surfaces of the next level; None if there are none
        """
        lanes, n = np.array(at.wave.lane), len(np.array(at.wave.lane))
        adjoints = [np.zeros((3, n)) for _ in range(4)]
        adjoints[0][:, : at.count] = adjoint[:, chunk.pixel[lanes[: at.count]]]
        if below is not None:
            later, of_carried = below
            for x, y in zip(adjoints[1:], of_carried):
                x[:, later.before] = _numpy(y)[:, : later.count]
        kinds = (self.a.V, *map(type, at.carried))
        put = [self.a.put(kind, x) for kind, x in zip(kinds, adjoints)]
        return at, self.launches.reverse(self.waves.surface(at), at.carried, put, n)

    def _advance(self, done: int) -> None:
        """Reports progress, and stops if Ctrl-C was pressed."""
        if self.interrupts.requested:
            raise KeyboardInterrupt
        self.done = done
        self.bar.update(done)


def _numpy(v: Any) -> np.ndarray:
    """A triple as a NumPy array, component by component, because for a whole matrix Dr.Jit writes its width into a
    kernel as a literal. Shapes: (3, N)."""
    return np.stack([np.array(c) for c in v])


class SampleLoop:
    """A picture whose kernel needs no loop inside its loop over samples: it is one launch.

    Methods are those of Sweeps.
    """

    def __init__(self, prepared: Prepared, spp: int, forward: bool):
        """forward: whether the parameters have tangents"""
        self.prepared, self.forward = prepared, forward
        s, plan = prepared.kernel, SamplePlan.of(prepared.a, prepared.scene.settings.seed, spp, 0, spp)
        self.mean = integrator.attached_mean(s, plan, prepared.x, prepared.y)

    def picture(self) -> tuple[np.ndarray, np.ndarray]:
        """As Sweeps.picture."""
        tangent = np.zeros((3, len(self.prepared.order)))
        if self.forward and dr.grad_enabled(self.mean):
            tangent[:] = np.array(dr.forward_to(self.mean))
        picture = np.empty_like(tangent)
        picture[:] = np.array(dr.detach(self.mean))
        return picture, tangent

    def pull(self, adjoint: np.ndarray) -> None:
        """As Sweeps.pull."""
        if dr.grad_enabled(self.mean):
            dr.set_grad(self.mean, self.prepared.a.put(self.prepared.a.V, adjoint))
            dr.enqueue(dr.ADMode.Backward, self.mean)
            dr.traverse(dr.ADMode.Backward)
