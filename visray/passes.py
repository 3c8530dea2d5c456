"""Renders a prepared scene into a film, in passes. A pass takes some samples for the pixels of the film, with one
kernel."""

from dataclasses import replace

import numpy as np

from visray import clock, integrator
from visray import film as films
from visray.pass_timer import PassTimer
from visray.progress import Bar, Interrupts
from visray.sampling import SamplePlan
from visray.setup import Prepared


def subset(prepared: Prepared, lanes: np.ndarray) -> Prepared:
    """The prepared scene with only some of its pixels. lanes: numbers of the lanes to keep, or a mask (one lane is one
    pixel)."""
    x, y = (prepared.a.put(prepared.a.U, np.array(v)[lanes]) for v in (prepared.x, prepared.y))
    return replace(prepared, order=prepared.order[lanes], x=x, y=y)


def empty_film(prepared: Prepared) -> films.Film:
    """A film without samples, for the pixels of a prepared scene."""
    return films.Film.empty(prepared.a, prepared.order, films.PictureIdentity(prepared.scene, prepared.a))


def expose(
    prepared: Prepared, progress: bool = False, interrupts: Interrupts | None = None, film: films.Film | None = None
) -> tuple[films.Film, int]:
    """Takes all samples that the scene's settings ask for. Returns the film, and the smallest number of samples of a
    pixel. Ctrl-C ends the work after the current pass; this number is then smaller than asked for.

    progress: whether a progress bar is shown
    film: film to continue, of the same picture and pixels; None starts an empty film

    The result is bit for bit that of a single pass with all samples. It does not depend on how samples are divided into
    passes or pixels into films, nor on the number of threads (tests/test_same_bits.py).
    """
    interrupts, timer = interrupts or Interrupts(), PassTimer()
    if film is None:
        film = empty_film(prepared)
    film.check(films.PictureIdentity(prepared.scene, prepared.a), prepared.order)
    settings, n = prepared.scene.settings, len(prepared.order)
    passes = -(-settings.spp * n // max(first_pass_samples(prepared), n))
    count = -(-settings.spp // passes)
    with Bar("rendering", settings.spp, progress) as bar:
        while (done := int(film.counts.min())) < settings.spp and not (done and interrupts.requested):
            target = min(done + count, settings.spp)
            film = exposed_once(prepared, film, np.maximum(film.counts, target), timer)
            bar.update(target)
            count = max(1, round(timer.next_samples() / n))
    return film, done


def first_pass_samples(prepared: Prepared) -> int:
    """Number of samples that the first pass should take, over all pixels. The pass should last a fraction of a second,
    estimated from the number of rays per sample and the kinds of objects."""
    s = prepared.kernel
    effects, settings = s.features, s.settings
    rays = 1 + sum(getattr(light, "samples", 1) for light in prepared.scene.lights.values())
    rays += settings.occlusion.sky * effects["sky occlusion"] + settings.occlusion.near * effects["near occlusion"]
    paths = max(settings.scatter.rays * effects["scatter"], 1) * 2 if effects["paths"] else 0
    has_tree, has_searched_kinds = bool(s.geometry.plan("nothing").tree), any(b.kind.finds_roots for b in s.batches)
    rays *= 1 + 4 * paths
    samples = 2**25 // (rays * (8 if has_tree else 1) * (64 if has_searched_kinds else 1))
    # A small picture is a single pass, traced once, if that takes no more than about two seconds.
    return max(samples, min(2**18, 2**27 // rays), 1)


def exposed_once(
    prepared: Prepared, film: films.Film, targets: int | np.ndarray, timer: PassTimer | None = None
) -> films.Film:
    """The film after one more pass.

    targets: number of samples that each lane has after the pass, one for all lanes or one for each lane
    timer: records how long the pass takes
    Domain: no lane has more samples than its target.
    """
    begun, settings = clock.now(), prepared.scene.settings
    first, missing = film.counts, targets - film.counts
    samples = int(missing.sum())
    if not samples:
        return film
    if (first == first[0]).all() and (missing == missing[0]).all():
        # If the numbers are equal in all lanes, another kernel is used, which loads none of them from memory.
        first, missing = int(first[0]), int(missing[0])
    plan = SamplePlan.of(prepared.a, settings.seed, settings.spp, first, missing)
    film = film.with_moments(integrator.sample(prepared.kernel, plan, prepared.x, prepared.y, film.moments), targets)
    (timer or PassTimer()).evaluate(begun, samples, film.moments)
    return film
