"""The film of a prepared scene, pass after pass."""

from dataclasses import replace

import numpy as np

from visray import clock, integrator
from visray import film as films
from visray.pass_timer import PassTimer
from visray.progress import Bar, Interrupts
from visray.sampling import SamplePlan
from visray.setup import Prepared


def subset(prepared: Prepared, lanes: np.ndarray) -> Prepared:
    """The scene prepared for some of its pixels: those of these lanes, which are numbers or a mask."""
    x, y = (prepared.a.put(prepared.a.U, np.array(v)[lanes]) for v in (prepared.x, prepared.y))
    return replace(prepared, order=prepared.order[lanes], x=x, y=y)


def empty_film(prepared: Prepared) -> films.Film:
    """A film for the pixels of a prepared scene, without samples."""
    return films.Film.empty(prepared.a, prepared.order, films.PictureIdentity(prepared.scene, prepared.a))


def expose(
    prepared: Prepared, progress: bool = False, interrupts: Interrupts | None = None, film: films.Film | None = None
) -> tuple[films.Film, int]:
    """The film after all samples, and how many a pixel has: fewer than asked for after Ctrl-C, but at least one pass.

    film: one to go on from, of the same picture and pixels. The bits are those of all samples at once, however they are
    cut into passes and films, and whatever the number of threads. Error: none (tests/test_same_bits.py).
    """
    interrupts, pace = interrupts or Interrupts(), PassTimer()
    if film is None:
        film = empty_film(prepared)
    film.check(films.PictureIdentity(prepared.scene, prepared.a), prepared.order)
    settings, n = prepared.scene.settings, len(prepared.order)
    passes = -(-settings.spp * n // max(first_pass_samples(prepared), n))
    count = -(-settings.spp // passes)
    with Bar("rendering", settings.spp, progress) as bar:
        while (done := int(film.counts.min())) < settings.spp and not (done and interrupts.requested):
            target = min(done + count, settings.spp)
            film = exposed_once(prepared, film, np.maximum(film.counts, target), pace)
            bar.update(target)
            count = max(1, round(pace.next_samples() / n))
    return film, done


def first_pass_samples(prepared: Prepared) -> int:
    """Samples of a first pass over all pixels: a fraction of a second, by the rays of a sample and what they meet."""
    s = prepared.kernel
    on, settings = s.features, s.settings
    rays = 1 + sum(getattr(light, "samples", 1) for light in prepared.scene.lights.values())
    rays += settings.occlusion.sky * on["sky occlusion"] + settings.occlusion.near * on["near occlusion"]
    paths = max(settings.scatter.rays * on["scatter"], 1) * 2 if on["paths"] else 0
    trees, searched = s.geometry.tree is not None, any(b.kind.finds_roots for b in s.batches)
    rays *= 1 + 4 * paths
    samples = 2**25 // (rays * (8 if trees else 1) * (64 if searched else 1))
    # Small pictures are one pass, which is traced once, where that takes no more than about two seconds.
    return max(samples, min(2**18, 2**27 // rays), 1)


def exposed_once(
    prepared: Prepared, film: films.Film, targets: int | np.ndarray, pace: PassTimer | None = None
) -> films.Film:
    """The film after one more pass, which brings its lanes to so many samples, and of which `pace` is told. Domain: no
    lane has more than its target."""
    begun, settings = clock.now(), prepared.scene.settings
    first, more = film.counts, targets - film.counts
    samples = int(more.sum())
    if not samples:
        return film
    if (first == first[0]).all() and (more == more[0]).all():
        # Numbers for all lanes are a kernel of their own, without a load from memory for each lane.
        first, more = int(first[0]), int(more[0])
    plan = SamplePlan.of(prepared.a, settings.seed, settings.spp, first, more)
    film = film.with_moments(integrator.sample(prepared.kernel, plan, prepared.x, prepared.y, film.moments), targets)
    (pace or PassTimer()).evaluate(begun, samples, film.moments)
    return film
