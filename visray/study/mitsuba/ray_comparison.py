"""Comparison of the hits of the same rays in visray and in Mitsuba, ray by ray."""

from dataclasses import replace
from typing import Any

import numpy as np

from visray.study.mitsuba.mitsuba_scene import MitsubaScene
from visray.study.mitsuba.placed_shapes import LARGEST_SQUARE
from visray.study.mitsuba.report import RayDifferences
from visray.study.mitsuba.rounding import (
    AllowedDifference,
    RayError,
    absolute_difference,
    allowed_difference,
    angle,
    coincident,
    moved_rays,
)
from visray.study.mitsuba.visray_scene import FirstHits, Rays, TracedRays, VisrayScene

EXAMPLES = 3


class RayComparison:
    """The hits of the same rays by visray and by Mitsuba.

    ours, theirs: the scene in visray and in Mitsuba
    rays: the rays that both programs trace
    traced: visray's own records of the rays and hits
    our_hits, their_hits: first hits by visray and by Mitsuba
    si: Mitsuba's own record of the hits (SurfaceInteraction)
    ray_error, allowed: bounds of rounding, see rounding.py

    Masks with one entry a ray:
    beyond: visray hits a plane so far away (LARGEST_SQUARE / 2) that the squares for it in Mitsuba may not reach there
    tied: the programs hit two different objects whose surfaces are in the same place
    mismatch: the programs hit different objects, or only one program hits, and rounding does not explain this
    same: both programs hit the same object, and rounding cannot change that
    """

    def __init__(self, ours: VisrayScene, theirs: MitsubaScene, rays: Rays):
        self.ours, self.theirs, self.rays = ours, theirs, rays
        self.traced: TracedRays = ours.trace(rays)
        self.our_hits: FirstHits = self.traced.first_hits
        self.si, self.their_hits = theirs.trace(rays)
        self.ray_error: RayError = theirs.rounding.ray_error(self.our_hits.index, self.their_hits.index)
        self.allowed: AllowedDifference = allowed_difference(ours, rays, self.our_hits, self.ray_error, theirs.rounding)
        self.beyond = self._beyond()
        self.mismatch = (self.our_hits.index != self.their_hits.index) & ~self.allowed.edge & ~self.beyond
        self.tied = np.zeros(len(self.our_hits.t), bool)
        self._excuse_tied()
        self._excuse_unstable()
        same = (self.our_hits.index == self.their_hits.index) & self.our_hits.hit
        self.same = same & ~self.allowed.edge & ~self.beyond

    def _beyond(self) -> np.ndarray:
        """The mask `beyond`."""
        unbounded = np.append(~self.theirs.rounding.bounded, False)[self.our_hits.index]
        return unbounded & (np.linalg.norm(self.rays.o, axis=1) + self.our_hits.t > LARGEST_SQUARE / 2)

    def _excuse_tied(self) -> None:
        """Marks mismatches between surfaces in the same place as `tied`, no longer as `mismatch`."""
        lanes = np.flatnonzero(self.mismatch & self.our_hits.hit & self.their_hits.hit)
        if lanes.size:
            rays, our_hits, their_hits = (select(x, lanes) for x in (self.rays, self.our_hits, self.their_hits))
            self.tied[lanes] = coincident(self.ours, rays, our_hits, their_hits, self.allowed.t[lanes])
            self.mismatch &= ~self.tied

    def _excuse_unstable(self) -> None:
        """Marks a mismatch as near an edge if a ray moved by Mitsuba's rounding error hits another object in Mitsuba.

        This happens if a ray is almost parallel to a facet. Embree then decides whether the ray hits by the sign of a
        product that consists of rounding errors only, even if the ray passes far from the facet.
        """
        lanes = np.flatnonzero(self.mismatch)
        if lanes.size:
            for o, d in moved_rays(select(self.rays, lanes), select(self.ray_error, lanes)):
                index = self.theirs.trace(Rays(o.astype(np.float32), d.astype(np.float32)))[1].index
                self.allowed.edge[lanes] |= index != self.their_hits.index[lanes]
            self.mismatch &= ~self.allowed.edge

    def points(self) -> np.ndarray:
        """Hit points relative to the camera; for rays that hit nothing, their origins. Shapes: (N, 3)."""
        return self.rays.o + np.where(self.our_hits.hit, self.our_hits.t, 0)[:, None] * self.rays.direction()

    def differences(self) -> RayDifferences:
        """Counts of rays, and the largest differences between the hits of both programs."""
        a, b, allowed, same = self.our_hits, self.their_hits, self.allowed, self.same
        size = np.linalg.norm(self.rays.o, axis=1) + np.where(a.hit, a.t, 0)
        dt, turn, duv = absolute_difference(a.t, b.t), angle(a.n, b.n), np.abs(a.uv - b.uv).max(1)
        sided = np.append(self.theirs.rounding.sided, False)[a.index]
        turn = np.where(sided, turn, np.minimum(turn, np.pi - turn))
        uv_known, both_hit = same & ~allowed.seam, self.mismatch & a.hit & b.hit
        return RayDifferences(
            rays=len(a.t),
            hits=int(a.hit.sum()),
            near_edge=int((allowed.edge & ~self.beyond).sum()),
            tied=int(self.tied.sum()),
            beyond=int(self.beyond.sum()),
            hit_mismatches=int((self.mismatch & ~both_hit).sum()),
            object_mismatches=int(both_hit.sum()),
            uv_unresolved=int((same & allowed.seam).sum()),
            dt=largest(dt / np.maximum(size, np.finfo(float).tiny), same),
            dt_bound=largest(dt, same, allowed.t),
            angle=largest(turn, same),
            angle_bound=largest(turn, same, allowed.angle),
            uv=largest(duv, uv_known),
            uv_bound=largest(duv, uv_known, allowed.uv),
        )

    def examples(self, title: str) -> list[str]:
        """A line of text for each of the first EXAMPLES mismatches. title: what a ray is called in the text."""
        names = (*self.ours.names, "nothing")
        lines = []
        for lane in np.flatnonzero(self.mismatch)[:EXAMPLES]:
            o = self.ours.centre + self.rays.o[min(lane, len(self.rays.o) - 1)]
            hits = [f"{names[x.index[lane]]} at {x.t[lane]:.9g}" for x in (self.our_hits, self.their_hits)]
            ray = f"from {o.tolist()} along {self.rays.d[lane].tolist()}"
            lines.append(f"{title} {lane}, {ray}: visray {hits[0]}, Mitsuba {hits[1]}")
        return lines


def select(record: Any, lanes: np.ndarray) -> Any:
    """A copy of a record of arrays with chosen lanes only.

    lanes: indices or mask of the chosen entries
    Arrays with a single entry, which all lanes share, are not changed.
    """
    values = {name: getattr(record, name) for name in record.__dataclass_fields__}
    return replace(record, **{name: v if len(v) == 1 else v[lanes] for name, v in values.items()})


def largest(values: np.ndarray, mask: np.ndarray, bound: np.ndarray | None = None) -> float:
    """The largest value among the lanes of the mask; with `bound`, the largest quotient value / bound there.

    It is 0 if the mask is false everywhere.
    """
    chosen = values[mask]
    return float((chosen if bound is None else chosen / bound[mask]).max(initial=0.0))
