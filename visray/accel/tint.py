"""How transparent rows tint the shadow rays that pass through them."""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.absorption import let_through
from visray.accel.origin import Candidate, RayOrigin
from visray.accel.ray_segment import RaySegment, passage
from visray.batches import Batch
from visray.pytree import rows


@dataclass(frozen=True)
class Tint:
    """The numbers of materials that tint shadows, as arrays with one entry for each object of a batch.

    kt, dmax, absorption: fields of the materials; absorption is None in scenes without it
    """

    kt: Any
    dmax: Any
    absorption: Any

    @staticmethod
    def of(batch: Batch) -> "Tint":
        """The numbers of the materials of a batch."""
        m = batch.material
        return Tint(m.kt, m.dmax, m.absorption)


def tint_factors(
    origin: RayOrigin, c: Candidate, segment: RaySegment, attached: RaySegment | None, tints: tuple
) -> tuple[Any, tuple]:
    """(mask of the rays that a row tints, the factors of the three channels): kt (1 - min(d / dmax, 1)) if the ray
    enters and leaves the row, kt if it does only one of both, and in all cases exp(-absorption d).

    attached: the segment with derivatives, which the factors then carry; None without derivatives by the segment
    tints: a Tint for each batch
    """
    a, kind, tint = origin.a, segment.kind, rows(tints[c.batch], origin.batches[c.batch].object_at(c.row))
    hit, passes_through, inside = passage(segment, attached)
    share = a.F(dr.select(passes_through, 1 - dr.minimum(inside / tint.dmax, 1), 1))
    factors = tuple(k * share for k in tint.kt)
    if tint.absorption is None or not kind.closed:
        return hit, factors
    if kind.own_passage:
        # Such a kind looks at crossings only, and knows no length if there are none.
        whole = ~hit & kind.inside(segment.placed, segment.ray.o)
        inside = dr.select(whole, segment.end - segment.begin, inside)
    if kind.bounded:
        inside = dr.select(inside < dr.inf, inside, 0)
    clear = (tint.kt.x > 0) | (tint.kt.y > 0) | (tint.kt.z > 0)
    left = let_through(tint.absorption, dr.maximum(inside, 0))
    return hit | (clear & (inside > 0)), tuple(dr.select(hit, k, 1) * x for k, x in zip(factors, left))
