"""Balls that contain the gizmos of a data layer: what a camera must show."""

from dataclasses import replace

import numpy as np

from visray.data.rows import Rows
from visray.fitting import Balls


def row_balls(rows: Rows) -> Balls:
    """The feet and the tops of all gizmos; of places that change in time, with the largest sizes of all dates."""
    if "a" in rows.fields and rows.gizmo.name == "line":
        points = np.concatenate([rows.fields["a"].T, rows.fields["b"].T])
        return Balls(points, np.tile(rows.fields["radius"], 2))
    stand = rows.stand
    if rows.in_time is not None:
        sizes = rows.in_time.sizes
        stand = replace(
            stand, foot=rows.ground.point.T, height=sizes.get("height", sizes["radius"]), radius=sizes["radius"]
        )
    extent = 2 * stand.radius if "height" not in rows.gizmo.sizes else stand.height
    tops = (stand.foot + stand.up * (stand.sign * extent * (1 - stand.sunk))).T
    return Balls(stand.foot.T, stand.radius).joined(Balls(tops, stand.radius))
