"""Shadow rays through visray and through Mitsuba, from what the pixels see to every light it faces."""

from dataclasses import dataclass

import numpy as np

from visray.study.comparison import EXAMPLES, Comparison, part
from visray.study.findings import Shadows
from visray.study.rounding import AXES, Shift


@dataclass(frozen=True)
class Lit:
    """Points that face a light. Shapes: p, light and twin (N, 3), from the centre; the others (N).

    twin: the light in Mitsuba. facing: which of the pixels' points face it. margin: how much before the point Mitsuba
    may meet the point's own surface, with its cosine as visray has it; longest: with its least cosine. reached and met:
    what visray and Mitsuba say.
    """

    p: np.ndarray
    light: np.ndarray
    twin: np.ndarray
    facing: np.ndarray
    margin: np.ndarray
    longest: np.ndarray
    reached: np.ndarray
    met: np.ndarray

    def differs(self) -> np.ndarray:
        return self.facing & (self.reached != self.met)


def compare(seen: Comparison) -> tuple[Shadows, np.ndarray, list[str]]:
    """The findings, which pixels are near the edge of a shadow of any light, and a line for the first mismatches."""
    near_any, counts, examples = np.zeros(len(seen.a.t), bool), np.zeros(4, int), []
    if not seen.ours.made.scene.settings.shadows:
        return Shadows(0, 0, 0, 0), near_any, examples
    names = list(seen.ours.made.scene.lights)
    for name, lit in zip(names, _lit(seen)):
        near = lit.facing & _near(seen, lit)
        wrong = lit.differs() & ~near
        near_any |= near
        counts += [lit.facing.sum(), (lit.facing & lit.reached).sum(), near.sum(), wrong.sum()]
        for lane in np.flatnonzero(wrong)[:EXAMPLES]:
            p = (seen.ours.centre + lit.p[lane]).tolist()
            says = "visray lit, Mitsuba dark" if lit.reached[lane] else "visray dark, Mitsuba lit"
            examples.append(f"light {name}, {p} on {seen.ours.names[seen.a.index[lane]]}: {says}")
    return Shadows(*map(int, counts)), near_any, examples


def _lit(seen: Comparison) -> list[Lit]:
    """What both say of the pixels' points and each light."""
    p, centre, found = seen.points(), seen.ours.centre, []
    mine, yours = (tuple(s.lights.values()) for s in (seen.ours.made.scene, seen.theirs.scene))
    for light, twin, (reached, cosine) in zip(mine, yours, seen.ours.beams(seen.look)):
        facing = seen.a.hit & ~seen.beyond & (cosine > 0)
        start, least = seen.shift.start(p), cosine - seen.slack.angle
        margin = np.where(facing, start / np.where(facing, cosine, 1), 0)
        longest = np.where(facing & (least > 0), start / np.where(least > 0, least, 1), np.inf)
        ends = [np.broadcast_to(np.array(l.position, float) - centre, p.shape) for l in (light, twin)]
        met = seen.theirs.reaches(p, ends[1], margin)
        found.append(Lit(p, *ends, facing, margin, longest, reached, met))
    return found


def _near(seen: Comparison, lit: Lit) -> np.ndarray:
    """Whether visray says otherwise of a ray moved by Mitsuba's rounding, or one that ends where Mitsuba's may.

    Where the two differ, anything may be in the way, and so the bound is that of the object that is rounded worst;
    and as with other rays, Mitsuba's answer counts only if it is the same for rays beside it.
    """
    differs = lit.differs()
    shift = seen.shift.where(differs, seen.theirs.extents.largest(len(differs)))
    distance = np.linalg.norm(lit.light - lit.p, axis=1)
    toward = (lit.light - lit.p) / np.maximum(distance, np.finfo(float).tiny)[:, None]
    short = lit.p + np.minimum(lit.longest, distance)[:, None] * toward
    clear = seen.ours.clear
    changes = np.isinf(lit.longest) | (clear(seen.look, lit.light, short, lit.facing, arrives=False) != lit.reached)
    for p, light in _moved(lit.p, lit.light, shift):
        changes |= clear(seen.look, light, p, lit.facing) != lit.reached
    lanes = np.flatnonzero(differs & ~changes)
    if lanes.size:
        for p, light in _moved(lit.p[lanes], lit.twin[lanes], part(shift, lanes)):
            changes[lanes] |= seen.theirs.reaches(p, light, lit.margin[lanes]) != lit.met[lanes]
    return changes


def _moved(p: np.ndarray, light: np.ndarray, shift: Shift) -> list[tuple[np.ndarray, np.ndarray]]:
    """The ends of rays, moved by the bound along each of AXES."""
    start = shift.start(p)
    end = start + shift.slope() * np.linalg.norm(light - p, axis=1)
    return [(p + start[:, None] * e, light + end[:, None] * e) for e in AXES]
