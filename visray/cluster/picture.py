"""Renders a prepared scene into a film, as passes.expose does, with the workers of a cluster."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from visray.cluster.crew import Crew
from visray.cluster.merging import Canvas
from visray.cluster.part import TILES_PER_WORKER, Cutter, Pace, least_lanes
from visray.cluster.refusal import versions
from visray.cluster.scene_package import ScenePackage
from visray.cluster.worker import Order, samples_of
from visray.errors import ClusterLost
from visray.film import Film
from visray.passes import empty_film, first_pass_samples
from visray.progress import Bar, Interrupts
from visray.scene.scene import Scene
from visray.setup import Prepared


@dataclass(frozen=True)
class Job:
    """A picture that the workers have what they need for.

    crew: the workers
    at: moment of an animated scene, as in vr.render
    """

    crew: Crew
    at: float | None

    @staticmethod
    def begun(crew: Crew, scene: Scene, at: float | None) -> "Job":
        """The job of a picture, whose scene is sent to all workers."""
        crew.send(ScenePackage.of(scene))
        return Job(crew, at)


def expose_on(
    job: Job,
    prepared: Prepared,
    progress: bool,
    interrupts: Interrupts,
    film: Film | None,
    look: Callable[[Film], None],
    keep: Callable[[Film], None] | None,
    keep_lost: Callable[[Film], None],
) -> tuple[Film, int]:
    """Takes all samples that the scene's settings ask for. Returns the film, and the smallest number of samples of a
    pixel. After Ctrl-C this number is smaller than asked for, perhaps 0: the film has the parts that have come back.

    film: film to go on with; None starts an empty one
    look: function that is called with the film at the end, unless pixels have no sample
    keep: as in passes.expose
    keep_lost: function that is called with the film if the cluster is lost; then ClusterLost is raised

    The result is bit for bit that of passes.expose, whatever the workers are, and however many.
    """
    crew, spp = job.crew, prepared.scene.settings.spp
    canvas, keep = Canvas(film or empty_film(prepared), spp), keep or (lambda film: None)
    cutter = cutter_of(canvas, crew, may_split=canvas.is_empty and prepared.shutter is None)
    # The first tasks are short, and measured.
    pace = Pace(min(first_pass_samples(prepared), cutter.samples_left // (TILES_PER_WORKER * len(crew.workers()))))
    order = Order(versions(), prepared.a.backend, crew.threads, job.at)
    with Bar("rendering", spp, progress, before="compiling") as bar, _kept(canvas, keep_lost):
        while (crew.is_busy or not cutter.is_done) and not (canvas.counts.any() and interrupts.requested):
            while crew.has_room() and not cutter.is_done:
                part = cutter.part(pace.next_samples(cutter.samples_left, len(crew.workers())))
                crew.submit(part, part.name, samples_of, order, part, canvas.start(part))
            for part, samples in crew.done():
                canvas.add(part, samples.arrays)
                pace.add(samples.samples, samples.seconds)
                interrupts.has_results = True
                keep(canvas.now())
            bar.update(canvas.counts.mean())
    crew.cancel()
    film = canvas.finished()
    if film.counts.all():
        look(film)
    return film, int(film.counts.min())


@contextmanager
def _kept(canvas: Canvas, keep: Callable[[Film], None]) -> Iterator[None]:
    """A `with` block, after which the samples that a picture has are kept if the cluster is lost in it."""
    try:
        yield
    except ClusterLost:
        if canvas.counts.any():
            keep(canvas.finished())
        raise


def cutter_of(canvas: Canvas, crew: Crew, may_split: bool) -> Cutter:
    """What cuts a picture for these workers. may_split: whether the samples of a pixel may be divided"""
    return Cutter(len(canvas.order), canvas.spp, len(crew.workers()), least_lanes(crew.least_threads), may_split)
