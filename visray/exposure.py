"""A scene set up for rendering, and its film after so many samples."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from visray import clock, images, integrator, llvm, tables
from visray import film as films
from visray.errors import UserError
from visray.features import Features, features
from visray.pace import Pace
from visray.progress import Bar, Patience
from visray.quantities import BACKENDS, Arrays
from visray.sampling import Plan
from visray.scene.scene import Scene


@dataclass(frozen=True)
class Set:
    """A scene set up for rendering: its stage, and the pixels in the order of the lanes."""

    scene: Scene
    a: Arrays
    features: Features
    stage: integrator.Stage
    order: np.ndarray
    x: Any
    y: Any


def set_up(
    scene: Scene,
    backend: str = "llvm",
    everything: bool = False,
    plain: bool = False,
    wrt: tuple[str, ...] = (),
    attach: Callable[[tuple[tables.Kinship, ...], tables.Tables], None] | None = None,
    without: tuple[str, ...] = (),
) -> Set:
    """The scene as a kernel sees it. `everything` and `plain` choose the slow twins of features and search; `without`
    names effects that are left out.

    wrt: the addresses that derivatives are taken by; `attach` enables them in the tables, before anything is computed.
    """
    a = arrays(backend, scene.settings.precision)
    width, height = scene.film.width, scene.film.height
    films.check_size(width, height)
    kin, on = tables.kinships(scene), features(scene, wrt, everything, without)
    packed = tables.pack(scene, a)
    if attach is not None:
        attach(kin, packed)
    ready = tables.prepare(packed, kin, (width, height), a, images.pack(a, scene.textures))
    stage = integrator.stage(ready, kin, scene, on, a, plain)
    return Set(scene, a, on, stage, *lanes(a, width, height))


def arrays(backend: str, precision: str) -> Arrays:
    """The array types of a backend, or one line that says why it cannot be had."""
    if backend not in BACKENDS:
        raise UserError(f"backend = {backend!r}: is none of {', '.join(BACKENDS)}")
    if backend == "llvm":
        llvm.require()
    elif not dr.has_backend(getattr(dr.JitBackend, {"cuda": "CUDA", "metal": "Metal"}[backend])):
        raise UserError(f"backend = {backend!r}: this machine has no such device; use --backend llvm")
    return Arrays.of(backend, precision)


def lanes(a: Arrays, width: int, height: int) -> tuple[np.ndarray, Any, Any]:
    """The pixels in the order of the lanes, and their columns and rows."""
    order = films.tiled(width, height)
    y, x = np.divmod(order, width)
    x, y = (a.put(a.U, v.astype(np.uint32)) for v in (x, y))
    dr.eval(x, y)
    return order, x, y


def part(made: Set, lanes: np.ndarray) -> Set:
    """The scene set up for some of its pixels: those of these lanes, which are numbers or a mask."""
    x, y = (made.a.put(made.a.U, np.array(v)[lanes]) for v in (made.x, made.y))
    return replace(made, order=made.order[lanes], x=x, y=y)


def blank(made: Set) -> films.Film:
    """A film for the pixels of a set, without samples."""
    return films.Film.blank(made.a, made.order, films.Origin(made.scene, made.a))


def expose(
    made: Set, progress: bool = False, patience: Patience | None = None, film: films.Film | None = None
) -> tuple[films.Film, int]:
    """The film after all samples, and how many a pixel has: fewer than asked for after Ctrl-C, but at least one pass.

    film: one to go on from, of the same picture and pixels. The bits are those of all samples at once, however they are
    cut into passes and films, and whatever the number of threads. Error: none (tests/test_same_bits.py).
    """
    patience, pace = patience or Patience(), Pace()
    if film is None:
        film = blank(made)
    film.check(films.Origin(made.scene, made.a), made.order)
    settings, n = made.scene.settings, len(made.order)
    passes = -(-settings.spp * n // max(first_pass(made), n))
    count = -(-settings.spp // passes)
    with Bar("rendering", settings.spp, progress) as bar:
        while (done := int(film.counts.min())) < settings.spp and not (done and patience.asked):
            target = min(done + count, settings.spp)
            film = exposed_once(made, film, np.maximum(film.counts, target), pace)
            bar.at(target)
            count = max(1, round(pace.room() / n))
    return film, done


def first_pass(made: Set) -> int:
    """Samples of a first pass over all pixels: a fraction of a second, by the rays of a sample and what they meet."""
    s = made.stage.scenery
    on, settings = s.features, s.settings
    rays = 1 + sum(getattr(light, "samples", 1) for light in made.scene.lights.values())
    rays += settings.occlusion.sky * on["sky occlusion"] + settings.occlusion.near * on["near occlusion"]
    paths = max(settings.scatter.rays * on["scatter"], 1) * 2 if on["paths"] else 0
    trees, searched = any(g.tree is not None for g in s.groups), any(k.kind.searched for k in s.kin)
    rays *= 1 + 4 * paths
    found = 2**25 // (rays * (8 if trees else 1) * (64 if searched else 1))
    # Small pictures are one pass, which is traced once, where that takes no more than about two seconds.
    return max(found, min(2**18, 2**27 // rays), 1)


def exposed_once(made: Set, film: films.Film, targets: int | np.ndarray, pace: Pace | None = None) -> films.Film:
    """The film after one more pass, which brings its lanes to so many samples, and of which `pace` is told. Domain: no
    lane has more than its target."""
    begun, settings = clock.now(), made.scene.settings
    first, more = film.counts, targets - film.counts
    samples = int(more.sum())
    if (first == first[0]).all() and (more == more[0]).all():
        # Numbers for all lanes are a kernel of their own, without a load from memory for each lane.
        first, more = int(first[0]), int(more[0])
    plan = Plan.of(made.a, settings.seed, settings.spp, first, more)
    film = film.after(integrator.sample(made.stage, plan, made.x, made.y, film.moments), targets)
    (pace or Pace()).evaluated(begun, samples, film.moments)
    return film
