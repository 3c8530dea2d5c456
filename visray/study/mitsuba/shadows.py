"""Shadow rays through visray and through Mitsuba, from what the pixels see to every light it faces."""

from dataclasses import dataclass, replace

import numpy as np

from visray.geometry import gamma
from visray.lights.light import Light
from visray.study.mitsuba import light_arrival as arrivals
from visray.study.mitsuba import light_emission as emission
from visray.study.mitsuba.comparison import EXAMPLES, Comparison, part
from visray.study.mitsuba.light_arrival import Arrival
from visray.study.mitsuba.report import Shadows
from visray.study.mitsuba.rounding import AXES, Shift
from visray.study.mitsuba.shadow_rays import ShadowRays

# So many times as far as a scene reaches, ways to a light infinitely far away are followed: what is beyond are planes,
# which any ray that is parallel to them but for its rounding meets somewhere.
HORIZON = 256


@dataclass(frozen=True)
class Lit:
    """What the pixels see, and a light. All shapes have one entry a pixel.

    light and twin: for visray, and for Mitsuba. ways and others: to them, `_trimmed`; rest: what must be clear of what
    is cut off; on: the objects whose surface the light lies on. facing: which points face it; cosine: by visray,
    positive there. margin: how much before the point Mitsuba may meet the point's own surface; longest: with the least
    cosine it may have. reached and met: whether light arrives, by visray and by Mitsuba.
    """

    light: Light
    twin: Light
    ways: ShadowRays
    rest: ShadowRays | None
    on: np.ndarray
    others: ShadowRays
    facing: np.ndarray
    cosine: np.ndarray
    margin: np.ndarray
    longest: np.ndarray
    reached: np.ndarray
    met: np.ndarray

    def differs(self) -> np.ndarray:
        return self.facing & (self.reached != self.met)


@dataclass
class Found:
    """What a comparison of shadows found. lit: what is known of each light; near: of each, which pixels are near the
    edge of a shadow; examples: a line for the first mismatches."""

    shadows: Shadows
    lit: list[Lit]
    near: list[np.ndarray]
    examples: list[str]


def compare(seen: Comparison) -> Found:
    """Every light of a scene that has no area lights, as both see it."""
    mine, yours = seen.ours.prepared.scene, seen.theirs.scene
    found = Found(Shadows(0, 0, 0, 0), [], [], [])
    counts = np.zeros(4, int)
    pairs = zip(mine.lights.items(), yours.lights.values(), arrivals.beams(seen.ours, seen.look))
    for (name, light), twin, arrival in pairs:
        lit = meet(seen, light, twin, arrival)
        close = lit.facing & near(seen, lit)
        wrong = lit.differs() & ~close
        found.lit.append(lit)
        found.near.append(close)
        counts += [lit.facing.sum(), (lit.facing & lit.reached).sum(), close.sum(), wrong.sum()]
        found.examples += examples(seen, name, lit, wrong)
    if mine.settings.shadows:
        found.shadows = Shadows(*map(int, counts))
    return found


def examples(seen: Comparison, name: str, lit: Lit, wrong: np.ndarray) -> list[str]:
    """A line each for the first points where the two differ."""
    found = []
    for lane in np.flatnonzero(wrong)[:EXAMPLES]:
        p = (seen.ours.centre + seen.points()[lane]).tolist()
        says = "visray lit, Mitsuba dark" if lit.reached[lane] else "visray dark, Mitsuba lit"
        found.append(f"light {name}, {p} on {seen.ours.names[seen.a.index[lane]]}: {says}")
    return found


def meet(seen: Comparison, light: Light, twin: Light, arrival: Arrival) -> Lit:
    """What both say of the pixels' points and a light, by visray's `arrival`."""
    p = seen.points()
    facing = seen.a.hit & ~seen.beyond & (arrival.cosine > 0)
    cosine = np.where(facing, arrival.cosine, 1)
    start, least = seen.shift.start(p), cosine - seen.slack.angle
    margin = np.where(facing, start / cosine, 0)
    longest = np.where(facing & (least > 0), start / np.where(least > 0, least, 1), np.inf)
    (ways, rest, on), (others, *_) = (_trimmed(seen, ShadowRays.to(p, l, seen.ours.centre)) for l in (light, twin))
    met = seen.theirs.reaches(others, margin) & (emission.aim(twin, others.l) > 0)
    return Lit(light, twin, ways, rest, on, others, facing, cosine, margin, longest, arrival.reached, met)


def _trimmed(seen: Comparison, ways: ShadowRays) -> tuple[ShadowRays, ShadowRays | None, np.ndarray]:
    """Shadow rays to a light that end at the horizon, or before the surfaces that the light lies on, as seen by visray,
    by Mitsuba, and by moved rays; what is then left of them before those surfaces; and the objects that have these.

    A light that lies on a surface is not hidden by it. But it may be off it by the bound of Mitsuba's rounding, the
    surface as much, and the end of a moved ray by sqrt(3) times the largest bound.
    """
    ours, extents, objects = seen.ours, seen.theirs.extents, np.arange(len(seen.ours.names))
    if ways.far:
        size = np.linalg.norm(ways.p, axis=1) + extents.far[extents.bounded].max(initial=0.0)
        return ways.cut(HORIZON * size), None, objects[:0]
    light, shift, largest = ways.end[0], extents.shift(objects), extents.largest(len(ways.p))
    reach = shift.start(np.broadcast_to(light, (len(objects), 3)))
    on, normals = arrivals.flush(ours, light, reach)
    if not on.size:
        return ways, None, on
    cosine = np.abs(ways.l @ normals.T)
    moves = np.sqrt(3) * (largest.start(ways.p) + largest.slope() * ways.length)
    off = 2 * (reach[on] + shift.slope()[on] * ways.length[:, None]) + moves[:, None]
    # In double, the way meets a surface that the light is on no farther before it than what it is made of is rounded.
    fine = gamma(32) * (np.linalg.norm(ours.centre + light) + np.linalg.norm(ours.centre + ways.p, axis=1))
    spare, tiny = (
        np.where(cosine > 0, x / np.where(cosine > 0, cosine, 1), np.inf).max(1) for x in (off, fine[:, None])
    )
    return ways.ended(spare), ways.ended(tiny).begun(ways.length - spare), on


def near(seen: Comparison, lit: Lit) -> np.ndarray:
    """Whether visray says otherwise of a ray moved by Mitsuba's rounding, or one that ends where Mitsuba's may.

    Where the two differ, anything may be in the way, and so the bound is that of the object that is rounded worst;
    and as with other rays, Mitsuba's answer counts only if it is the same for rays beside it.
    """
    differs = lit.differs()
    shift = seen.shift.where(differs, seen.theirs.extents.largest(len(differs)))

    def says(ways: ShadowRays, arrives: bool = True) -> np.ndarray:
        clear = arrivals.clear(seen.ours, seen.look, ways, lit.facing, arrives)
        return clear & arrivals.sends(seen.ours, lit.light, ways)

    # Not the kernel's own answer: were it wrong, all moved rays would differ from it.
    straight = says(lit.ways)
    changes = np.isinf(lit.longest) | (lit.ways.length == 0)
    if lit.rest is not None:
        changes |= ~arrivals.clear(seen.ours, seen.look, lit.rest, lit.facing, arrives=False)
    if lit.ways.far:
        changes |= says(replace(lit.ways, length=np.full(len(straight), np.inf))) != straight
    changes |= says(lit.ways.begun(np.where(np.isinf(lit.longest), 0, lit.longest)), arrives=False) != straight
    for ways in moved(lit.ways, shift):
        changes |= says(ways) != straight
    lanes = np.flatnonzero(differs & ~changes)
    if lanes.size:
        beside = part(shift, lanes)
        others = part(lit.others, lanes)
        # Moved behind its own surface, a ray begins as much farther above it.
        margin = lit.margin[lanes] + np.sqrt(3) * beside.start(others.p) / lit.cosine[lanes]
        for ways in moved(others, beside):
            met = seen.theirs.reaches(ways, margin) & (emission.aim(lit.twin, ways.l) > 0)
            changes[lanes] |= met != lit.met[lanes]
    return changes


def moved(ways: ShadowRays, shift: Shift) -> list[ShadowRays]:
    """ShadowRays whose ends are moved by the bound along each of AXES."""
    start, slope = shift.start(ways.p), shift.slope()
    return [ways.moved(start, slope, e) for e in AXES]
