"""The same rays through visray and through Mitsuba, lane by lane."""

from dataclasses import replace
from typing import Any

import numpy as np

from visray.study.mitsuba.mitsuba_scene import MitsubaScene
from visray.study.mitsuba.report import Crossings
from visray.study.mitsuba.rounding import Shift, Slack, angle, gaps, moved, slack, tied
from visray.study.mitsuba.shapes import LARGEST_SQUARE
from visray.study.mitsuba.visray_scene import Answers, Look, Rays, VisrayScene

EXAMPLES = 3


class Comparison:
    """What both say of the same rays. All masks have one entry a ray.

    look, a: visray's answers; si, b: Mitsuba's. beyond: a plane was hit where its twin ends. tied: two surfaces are in
    the same place. apart: the two hit different things, and rounding does not explain it. same: both hit one object.
    """

    def __init__(self, ours: VisrayScene, theirs: MitsubaScene, rays: Rays):
        self.ours, self.theirs, self.rays = ours, theirs, rays
        self.look: Look = ours.trace(rays)
        self.a: Answers = self.look.answers
        self.si, self.b = theirs.trace(rays)
        self.shift: Shift = theirs.extents.shift(self.a.index, self.b.index)
        self.slack: Slack = slack(ours, rays, self.a, self.shift, theirs.extents)
        self.beyond = self._beyond()
        self.apart = (self.a.index != self.b.index) & ~self.slack.edge & ~self.beyond
        self.tied = np.zeros(len(self.a.t), bool)
        self._tie()
        self._settle()
        self.same = (self.a.index == self.b.index) & self.a.hit & ~self.slack.edge & ~self.beyond

    def _beyond(self) -> np.ndarray:
        """Hits of planes farther away than half the largest of their twins' squares is long."""
        unbounded = np.append(~self.theirs.extents.bounded, False)[self.a.index]
        return unbounded & (np.linalg.norm(self.rays.o, axis=1) + self.a.t > LARGEST_SQUARE / 2)

    def _tie(self) -> None:
        lanes = np.flatnonzero(self.apart & self.a.hit & self.b.hit)
        if lanes.size:
            rays, a, b = (part(x, lanes) for x in (self.rays, self.a, self.b))
            self.tied[lanes] = tied(self.ours, rays, a, b, self.slack.t[lanes])
            self.apart &= ~self.tied

    def _settle(self) -> None:
        """Counts as near an edge what Mitsuba itself answers otherwise for a ray beside it.

        Where a facet is seen edge-on, the product by which Embree tells its sides is all rounding, far beyond its ends.
        """
        lanes = np.flatnonzero(self.apart)
        if lanes.size:
            for o, d in moved(part(self.rays, lanes), part(self.shift, lanes)):
                found = self.theirs.trace(Rays(o.astype(np.float32), d.astype(np.float32)))[1].index
                self.slack.edge[lanes] |= found != self.b.index[lanes]
            self.apart &= ~self.slack.edge

    def points(self) -> np.ndarray:
        """Where the rays hit, from the centre; the rays' origins where they hit nothing. Shapes: (N, 3)."""
        return self.rays.o + np.where(self.a.hit, self.a.t, 0)[:, None] * self.rays.direction()

    def crossings(self) -> Crossings:
        """The differences in numbers."""
        a, b, allowed, same = self.a, self.b, self.slack, self.same
        size = np.linalg.norm(self.rays.o, axis=1) + np.where(a.hit, a.t, 0)
        dt, turn, duv = gaps(a.t, b.t), angle(a.n, b.n), np.abs(a.uv - b.uv).max(1)
        sided = np.append(self.theirs.extents.sided, False)[a.index]
        turn = np.where(sided, turn, np.minimum(turn, np.pi - turn))
        known, both = same & ~allowed.seam, self.apart & a.hit & b.hit
        return Crossings(
            rays=len(a.t),
            hits=int(a.hit.sum()),
            near_edge=int((allowed.edge & ~self.beyond).sum()),
            tied=int(self.tied.sum()),
            beyond=int(self.beyond.sum()),
            hit_mismatches=int((self.apart & ~both).sum()),
            object_mismatches=int(both.sum()),
            uv_unresolved=int((same & allowed.seam).sum()),
            dt=most(dt / np.maximum(size, np.finfo(float).tiny), same),
            dt_bound=most(dt, same, allowed.t),
            angle=most(turn, same),
            angle_bound=most(turn, same, allowed.angle),
            uv=most(duv, known),
            uv_bound=most(duv, known, allowed.uv),
        )

    def examples(self, title: str) -> list[str]:
        """A line each for the first few rays of which the two say something else."""
        names = (*self.ours.names, "nothing")
        found = []
        for lane in np.flatnonzero(self.apart)[:EXAMPLES]:
            o = self.ours.centre + self.rays.o[min(lane, len(self.rays.o) - 1)]
            says = [f"{names[x.index[lane]]} at {x.t[lane]:.9g}" for x in (self.a, self.b)]
            way = f"from {o.tolist()} along {self.rays.d[lane].tolist()}"
            found.append(f"{title} {lane}, {way}: visray {says[0]}, Mitsuba {says[1]}")
        return found


def part(x: Any, lanes: np.ndarray) -> Any:
    """Some lanes of a record of arrays; what all lanes share stays."""
    values = {name: getattr(x, name) for name in x.__dataclass_fields__}
    return replace(x, **{name: v if len(v) == 1 else v[lanes] for name, v in values.items()})


def most(values: np.ndarray, mask: np.ndarray, bound: np.ndarray | None = None) -> float:
    """The largest of the values where the mask holds, or of their shares of a bound; 0 where it holds nowhere."""
    chosen = values[mask]
    return float((chosen if bound is None else chosen / bound[mask]).max(initial=0.0))
