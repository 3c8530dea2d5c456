"""A scene set up for rendering, and its film after so many samples."""

from visray import clock, integrator
from visray import film as films
from visray.pace import LONGEST, Pace
from visray.progress import Bar, Patience
from visray.sampling import Plan
from visray.scene.scene import Settings
from visray.setup import Prepared, arrays, lanes, prepare  # noqa: F401


def expose(prepared: Prepared, progress: bool = False, patience: Patience | None = None) -> tuple[films.Film, int]:
    """The film after all samples, and how many it has: fewer than asked for after Ctrl-C, but at least one pass."""
    patience = patience or Patience()
    settings, n = prepared.scene.settings, len(prepared.order)
    film, done, pace = films.Film.blank(prepared.a, n), 0, Pace()
    passes = -(-settings.spp * n // max(first_pass(prepared), n))
    count = -(-settings.spp // passes)
    with Bar("rendering", settings.spp, progress) as bar:
        while done < settings.spp and not (done and patience.asked):
            count = min(count, settings.spp - done, LONGEST)
            film = exposed_once(prepared, film, settings, done, count, pace)
            done += count
            bar.at(done)
            count = max(1, round(pace.room() / n))
    return film, done


def first_pass(prepared: Prepared) -> int:
    """Samples of a first pass over all pixels: a fraction of a second, by the rays of a sample and what they meet."""
    s = prepared.kernel
    on, settings = s.features, s.settings
    rays = 1 + sum(getattr(light, "samples", 1) for light in prepared.scene.lights.values())
    rays += settings.occlusion.sky * on["sky occlusion"] + settings.occlusion.near * on["near occlusion"]
    paths = max(settings.scatter.rays * on["scatter"], 1) * 2 if on["paths"] else 0
    trees, searched = s.geometry.tree is not None, any(b.kind.searched for b in s.batches)
    rays *= 1 + 4 * paths
    found = 2**25 // (rays * (8 if trees else 1) * (64 if searched else 1))
    # Small pictures are one pass, the same bit for bit each time, where that takes no more than about two seconds.
    return max(found, min(2**18, 2**27 // rays), 1)


def exposed_once(
    prepared: Prepared, film: films.Film, settings: Settings, done: int, count: int, pace: Pace | None = None
) -> films.Film:
    """The film after one more pass, of which `pace` is told."""
    begun = clock.now()
    plan = Plan.of(prepared.a, settings.seed, settings.spp, done, count)
    film = film.plus(prepared.a, integrator.sample(prepared.kernel, plan, prepared.x, prepared.y), done, count)
    (pace or Pace()).evaluated(begun, count * len(prepared.order), film)
    return film


# TEMPORARY until the other branches are merged.
Set = Prepared
set_up = prepare
