"""What a worker does: it takes the samples of a part of a picture. Dask calls these functions in the worker."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import drjit as dr
import numpy as np

from visray import clock, integrator
from visray.cluster.kept_scenes import ONE_AT_A_TIME, kept_prepared
from visray.cluster.part import Part
from visray.cluster.refusal import WorkerRefusal, facts, refused
from visray.cluster.scene_package import ScenePackage
from visray.errors import UserError
from visray.film import Film
from visray.moments import BLOCK, Moments
from visray.pass_timer import PassTimer
from visray.passes import expose, identity_of, spread_lanes, subset
from visray.sampling import SamplePlan
from visray.setup import Prepared, set_threads


@dataclass(frozen=True)
class Order:
    """What a client asks of a worker, for all tasks of a job.

    versions: versions that the worker must have
    backend: name of the backend
    threads: number of threads; None keeps the worker's own
    at: moment of an animated scene, as in vr.render
    """

    versions: dict[str, str]
    backend: str = "llvm"
    threads: int | None = None
    at: float | None = None


@dataclass(frozen=True)
class Start:
    """The lanes of a part that goes on from samples taken before.

    lanes: the lanes. Shape: (N)
    counts: number of samples that each lane has. Shape: (N)
    arrays: their moments. Shapes: (..., N)
    """

    lanes: np.ndarray
    counts: np.ndarray
    arrays: tuple[np.ndarray, ...]

    def film(self, prepared: Prepared) -> Film:
        """The film of these lanes."""
        a, kinds = prepared.a, Moments.types(prepared.a)
        moments = Moments(*(a.put(kind, x) for kind, x in zip(kinds, self.arrays)))
        return Film(a, moments, self.counts, prepared.order[self.lanes], identity_of(prepared))


@dataclass(frozen=True)
class Samples:
    """The samples of a part, as they travel.

    arrays: of a tile, the moments of its film; of sample blocks, the sums of integrator.block_sums. None for what the
        scene does not count. Shapes: (..., lanes) or (..., blocks * lanes), block after block
    samples: number of samples
    seconds: seconds that they took, without compilation
    compile_seconds: seconds of compilation, and of preparing the scene
    """

    arrays: tuple[np.ndarray | None, ...]
    samples: int
    seconds: float
    compile_seconds: float


@contextmanager
def ready(order: Order) -> Iterator[None]:
    """A `with` block in which the worker does nothing else. Raises WorkerRefusal if it cannot do what is asked."""
    with ONE_AT_A_TIME:
        if reason := refused(facts(), order.versions):
            raise WorkerRefusal(_address(), reason)
        if order.threads is not None and order.threads != dr.thread_count():
            set_threads(order.threads)
        yield


@contextmanager
def unpacking() -> Iterator[None]:
    """A `with` block that unpacks and prepares a package. Raises WorkerRefusal if its files cannot be written here, or
    if the scene does not fit."""
    try:
        yield
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        raise WorkerRefusal(_address(), f"cannot write the scene's files, {where}{error.strerror or error}") from None
    except UserError as error:
        raise WorkerRefusal(_address(), " ".join(error.lines)) from None


def samples_of(package: ScenePackage, order: Order, part: Part, start: Start | None = None) -> Samples:
    """The samples of a part. start: None begins with no samples, of the lanes that the part itself names"""
    with ready(order):
        begun, timer = clock.now(), PassTimer()
        with unpacking():
            prepared = kept_prepared(package, order.backend, order.at)
        prepared_seconds, spp = clock.now() - begun, prepared.scene.settings.spp
        lanes = start.lanes if start else spread_lanes(len(prepared.order))[part.lanes]
        if part.is_tile:
            arrays = tile(prepared, lanes, timer, start.film(prepared) if start else None)
        else:
            arrays = sample_blocks(prepared, lanes, part, timer)
        count = len(lanes) * (min(BLOCK * part.end_block, spp) - BLOCK * part.first_block)
        count -= int(start.counts.sum()) if start else 0
        seconds = clock.now() - begun - prepared_seconds - timer.compile_seconds
        return Samples(arrays, count, seconds, timer.compile_seconds + prepared_seconds)


def tile(prepared: Prepared, lanes: np.ndarray, timer: PassTimer, film: Film | None = None) -> tuple[np.ndarray, ...]:
    """The moments of a film of these lanes, with all samples. film: the film to go on with"""
    film, _ = expose(subset(prepared, lanes), film=film, timer=timer)
    return tuple(np.array(x) for x in film.moments.arrays)


def sample_blocks(prepared: Prepared, lanes: np.ndarray, part: Part, timer: PassTimer) -> tuple[np.ndarray | None, ...]:
    """The sums of each sample block of these lanes. A lane of the kernel is one block of one pixel."""
    begun, settings, n = clock.now(), prepared.scene.settings, len(lanes)
    first = np.repeat(np.arange(part.first_block, part.end_block) * BLOCK, n)
    count = np.minimum(BLOCK, settings.spp - first)
    wide = subset(prepared, np.tile(lanes, part.blocks))
    plan = SamplePlan.of(prepared.a, settings.seed, settings.spp, first, count)
    sums = integrator.block_sums(prepared.kernel, plan, wide.x, wide.y)
    timer.evaluate(begun, int(count.sum()), [x for x in sums if x is not None])
    return tuple(None if x is None else np.array(x) for x in sums)


def _address() -> str:
    """Address of this worker."""
    from distributed import get_worker

    worker = get_worker()
    return f"{worker.address} ({worker.name})" if str(worker.name) != worker.address else worker.address
