"""Area lights through visray and through Mitsuba: from what the pixels see to points all over each of them."""

from dataclasses import replace

import numpy as np

from visray.lights import PointLight
from visray.lights.light import AreaLight
from visray.scene.scene import Scene
from visray.study.mitsuba import light_arrival as arrivals
from visray.study.mitsuba.comparison import Comparison
from visray.study.mitsuba.mitsuba_scene import MitsubaScene
from visray.study.mitsuba.report import Penumbras
from visray.study.mitsuba.shadows import examples, meet, near
from visray.study.mitsuba.visray_scene import Rays, VisrayScene

# So many points of each light, in as many strata; and so many rays at most, from fewer pixels where there are more.
SIDE, MOST_RAYS = 4, 2**20


def compare(
    whole: Scene, theirs: MitsubaScene, lights: dict[str, AreaLight], rays: Rays
) -> tuple[Penumbras, list[str]]:
    """The findings, and a line for the first mismatches.

    whole: the scene with its area lights, all objects opaque; lights: as Mitsuba is given them; rays: of the pixels.
    """
    mine = {name: light for name, light in whole.lights.items() if light.has_area}
    if not mine or not whole.settings.shadows:
        return Penumbras(), []
    step = -(-len(rays.d) * len(mine) * SIDE**2 // MOST_RAYS)
    ours = VisrayScene(whole)
    seen = Comparison(ours, theirs, replace(rays, d=rays.d[::step]))
    total = np.zeros(6)
    lines: list[str] = []
    for name, light in mine.items():
        found, wrong = _of(seen, light, lights[name], name)
        total += found
        lines += wrong
    counts, sums = total[:5].astype(int).tolist(), total[5]
    of, reached, close, mismatches, compared = counts
    mean = float(sums / max(compared, 1))
    return Penumbras(len(mine), SIDE**2, len(seen.a.t), of, reached, close, mismatches, compared, mean), lines


def _of(seen: Comparison, light: AreaLight, twin: AreaLight, name: str) -> tuple[np.ndarray, list[str]]:
    """Of one light: rays, those that reach it, near an edge, mismatches; pixels that are compared, and the sum of the
    differences of their fractions."""
    n = len(seen.a.t)
    counts, lines = np.zeros(4), []
    close, apart, faces = np.zeros(n, bool), np.zeros(n), np.zeros(n, bool)
    for p, q in zip(points(seen.ours, light), points(seen.ours, twin)):
        ends = (PointLight(position=tuple((seen.ours.centre + x).tolist())) for x in (p, q))
        lit = meet(seen, *ends, arrivals.beam_of_point(seen.ours, seen.look, light, p))
        edge = lit.facing & near(seen, lit)
        wrong = lit.differs() & ~edge
        counts += [lit.facing.sum(), (lit.facing & lit.reached).sum(), edge.sum(), wrong.sum()]
        close, faces = close | edge, faces | lit.facing
        apart += lit.facing * (lit.reached.astype(float) - lit.met) / SIDE**2
        lines += examples(seen, name, lit, wrong)
    compared = faces & ~close
    return np.append(counts, [compared.sum(), np.abs(apart[compared]).sum()]), lines


def points(ours: VisrayScene, light: AreaLight) -> np.ndarray:
    """The middles of the strata of an area light, from the centre. Shapes: (SIDE^2, 3)."""
    a, row = ours.a, arrivals.table(ours, light)
    v, u = (np.mgrid[:SIDE, :SIDE].reshape(2, -1) + 0.5) / SIDE
    return np.array(row.position + row.point_offset(a.W, a.D(u), a.D(v)), float).T - ours.centre
