"""Renders a prepared scene into a film, in passes. A pass takes some samples for the pixels of the film, with one
kernel. Where even a single sample of all pixels takes long, a pass consists of several launches of this kernel."""

from collections.abc import Callable
from dataclasses import replace

import drjit as dr
import numpy as np

from visray import clock, integrator
from visray import film as films
from visray.kernel_scene import KernelScene
from visray.moments import Moments
from visray.motion_blur import blurred
from visray.pass_timer import PassTimer
from visray.picture_identity import PictureIdentity
from visray.progress import Bar, Interrupts
from visray.sampling import SamplePlan, pixel_key
from visray.setup import Prepared

# Number of lanes that a processor computes together, with the widest registers.
PACKET = 16


def subset(prepared: Prepared, lanes: np.ndarray) -> Prepared:
    """The prepared scene with only some of its pixels. lanes: numbers of the lanes to keep, or a mask (one lane is one
    pixel)."""
    x, y = (prepared.a.put(prepared.a.U, np.array(v)[lanes]) for v in (prepared.x, prepared.y))
    # Else these gathers would be a part of the kernel, which would be another one than that of the whole picture.
    dr.eval(x, y)
    return replace(prepared, order=prepared.order[lanes], x=x, y=y)


def empty_film(prepared: Prepared) -> films.Film:
    """A film without samples, for the pixels of a prepared scene."""
    return films.Film.empty(prepared.a, prepared.order, identity_of(prepared))


def identity_of(prepared: Prepared) -> PictureIdentity:
    """The identity of the picture of a prepared scene."""
    return PictureIdentity(prepared.scene, prepared.a, prepared.shutter)


def expose(
    prepared: Prepared,
    progress: bool = False,
    interrupts: Interrupts | None = None,
    film: films.Film | None = None,
    timer: PassTimer | None = None,
    look: Callable[[films.Film], None] | None = None,
    keep: Callable[[films.Film], None] | None = None,
) -> tuple[films.Film, int]:
    """Takes all samples that the scene's settings ask for. Returns the film, and the smallest number of samples of a
    pixel. Ctrl-C ends the work after the current launch; this number is then smaller than asked for, perhaps 0.

    progress: whether a progress bar is shown
    film: film to continue, of the same picture and pixels; None starts an empty film
    timer: records how long the passes take; one that knows passes of such a scene decides about the first one
    look: function that is called with the film after the first pass
    keep: function that is called with the film after each launch (Checkpoint.keep). It must not change the film, whose
        arrays may be those of NumPy, or use it later.

    The result is bit for bit that of a single pass with all samples. It does not depend on how samples are divided into
    passes or pixels into films, nor on the number of threads (tests/test_same_bits.py).
    """
    interrupts, timer, keep = interrupts or Interrupts(), timer or PassTimer(), keep or (lambda film: None)
    if film is None:
        film = empty_film(prepared)
    film.check(identity_of(prepared), prepared.order)
    settings, n = prepared.scene.settings, len(prepared.order)
    known = timer.sample_seconds is not None
    first = int(min(timer.next_samples(), settings.spp * n)) if known else first_pass_samples(prepared)
    passes = -(-settings.spp * n // max(first, n))
    count, room = -(-settings.spp // passes), first if known or first >= n else _least_samples(prepared)
    with Bar("rendering", settings.spp, progress, before="compiling") as bar:
        while (done := int(film.counts.min())) < settings.spp and not (film.counts.any() and interrupts.requested):
            targets = np.maximum(film.counts, min(done + count, settings.spp))
            if n > room:
                film = _exposed_in_parts(prepared, film, targets, room, timer, bar, interrupts, keep)
            else:
                film = exposed_once(prepared, film, targets, timer)
                keep(film)
            interrupts.has_results = True
            bar.update(film.counts.mean())
            if look is not None and film.counts.all():
                look(film)
                look = None
            room = timer.next_samples()
            count = max(1, round(room / n))
    return film, done


def _exposed_in_parts(
    prepared: Prepared,
    film: films.Film,
    targets: np.ndarray,
    room: float,
    timer: PassTimer,
    bar: Bar,
    interrupts: Interrupts,
    keep: Callable[[films.Film], None],
) -> films.Film:
    """The film after one more pass, whose pixels are divided into several launches. Each is as short as a pass should
    be, even if a single sample of all pixels takes minutes. After Ctrl-C, some pixels have no new sample.

    targets: number of samples that each lane has after the pass
    room: number of samples that the first launch may take; the timer decides about the others
    keep: as for `expose`
    """
    a, counts = prepared.a, film.counts.copy()
    moments = [np.array(x) for x in film.moments.arrays]
    lanes = spread_lanes(len(counts))
    while len(lanes) and not (counts.any() and interrupts.requested):
        # A launch has whole packets of lanes. With fewer lanes it would take as long.
        size = max(int(room / max((targets - counts)[lanes].mean(), 1)) // PACKET, 1) * PACKET
        now, lanes = np.split(lanes, [size if len(lanes) - size >= PACKET else len(lanes)])
        kinds = Moments.types(a)
        part = films.Film(a, Moments(*(a.put(k, x[..., now]) for k, x in zip(kinds, moments))), counts[now], now)
        part = exposed_once(subset(prepared, now), part, targets[now], timer)
        for x, new in zip(moments, part.moments.arrays):
            x[..., now] = np.array(new)
        counts[now] = part.counts
        keep(film.with_moments(Moments(*moments), counts))
        interrupts.has_results = True
        bar.update(counts.mean())
        room = timer.next_samples()
    return film.with_moments(Moments(*(a.put(k, x) for k, x in zip(Moments.types(a), moments))), counts)


def spread_lanes(n: int) -> np.ndarray:
    """The lanes 0 to n - 1, in an order in which any range of them is spread over the whole picture. So all ranges take
    about the same time, and a picture that is stopped has pixels everywhere.

    Packets of lanes, which are neighbouring pixels, stay together. They are ordered by their reversed binary numbers.
    """
    packets = np.arange(-(-n // PACKET))
    bits = max(int(packets[-1]).bit_length(), 1)
    reverse = sum(((packets >> k) & 1) << (bits - 1 - k) for k in range(bits))
    lanes = (np.argsort(reverse, kind="stable")[:, None] * PACKET + np.arange(PACKET)).ravel()
    return lanes[lanes < n]


def first_pass_samples(prepared: Prepared) -> int:
    """Number of samples that the first pass should take, over all pixels. The pass should last a fraction of a second,
    estimated from the number of rays per sample and the kinds of objects."""
    # A small picture is a single pass, traced once, if that takes no more than about two seconds.
    return max(_least_samples(prepared), min(2**18, 2**27 // _rays_per_sample(prepared)), 1)


def _least_samples(prepared: Prepared) -> int:
    """Number of samples that surely last no more than a fraction of a second."""
    has_tree = bool(prepared.kernel.geometry.plan("nothing").tree)
    has_searched_kinds = any(b.kind.finds_roots for b in prepared.kernel.batches)
    return 2**25 // (_rays_per_sample(prepared) * (8 if has_tree else 1) * (64 if has_searched_kinds else 1))


def _rays_per_sample(prepared: Prepared) -> int:
    """Estimated number of rays that one sample of a pixel sends."""
    s = prepared.kernel
    effects, settings = s.features, s.settings
    rays = 1 + sum(getattr(light, "samples", 1) for light in prepared.scene.lights.values())
    rays += settings.occlusion.sky * effects["sky occlusion"] + settings.occlusion.near * effects["near occlusion"]
    paths = max(settings.scatter.rays * effects["scatter"], 1) * 2 if effects["paths"] else 0
    return rays * (1 + 4 * paths)


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
    if prepared.shutter:
        moments = _blurred(prepared, film.moments, *(np.broadcast_to(x, film.counts.shape) for x in (first, missing)))
    else:
        plan = SamplePlan.of(prepared.a, settings.seed, settings.spp, first, missing)
        moments = integrator.sample(prepared.kernel, plan, prepared.x, prepared.y, film.moments)
    film = film.with_moments(moments, targets)
    (timer or PassTimer()).evaluate(begun, samples, film.moments)
    return film


def _blurred(prepared: Prepared, before: Moments, first: np.ndarray, count: np.ndarray) -> Moments:
    """The moments of all lanes after more samples with an open shutter.

    before: moments of the lanes
    first, count: index of the first new sample of each lane, and number of its new samples
    """
    a, settings, x, y = prepared.a, prepared.scene.settings, prepared.x, prepared.y

    def launch(kernel: KernelScene, lanes: np.ndarray, first: np.ndarray, count: np.ndarray, old: Moments) -> Moments:
        plan = SamplePlan.of(a, settings.seed, settings.spp, first, count)
        index = a.put(a.U, lanes.astype(np.uint32))
        return integrator.sample(kernel, plan, dr.gather(a.U, x, index), dr.gather(a.U, y, index), old)

    key = pixel_key(SamplePlan.of(a, settings.seed, settings.spp, 0, 0), x, y)
    return blurred(prepared, before, np.array(key), first, count, launch)
