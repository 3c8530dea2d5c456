"""What is odd about gizmos that lie in the base, or in each other: pictures show noise of both there."""

import numpy as np

from visray.data.base import FlatBase
from visray.data.date_column import date_column
from visray.data.gizmos import Gizmo, Stand
from visray.data.table import Table, shown

# Gizmos with a flat lower end, and with a flat upper end.
LOWER = ("cylinder", "box", "cone")
UPPER = ("cylinder", "box")
# Feet and radii are the same up to this share of the size of the base: single precision tells no less.
SAME = 1e-7


def notes_of_touching(
    gizmo: Gizmo,
    base: object,
    stand: Stand,
    lift: np.ndarray,
    number: np.ndarray,
    colored: bool,
    table: Table | None = None,
) -> list[str]:
    """Sentences about gizmos that lie in the base or in each other.

    stand: where they stand. lift: height of their feet above the base. Shape: (N). number: number of each one's row.
    colored: whether they differ in colour. table: the rows' table, if its dates are not used.
    """
    notes = _in_base(gizmo, base, stand, lift == 0) if isinstance(base, FlatBase) else []
    return notes + (_in_each_other(stand, number, base.size, table) if colored else [])


def _in_base(gizmo: Gizmo, base: FlatBase, stand: Stand, at_base: np.ndarray) -> list[str]:
    """A sentence about gizmos with a side that lies in the map. at_base: whether their feet are in it. Shape: (N)."""
    if not at_base.any():
        return []
    advice = f"give the layer a lift, such as {0.001 * base.size:.1g}"
    if gizmo.flat:
        return [f"the {gizmo.name}s lie in the map, and the picture shows noise of both; leave lift out, or {advice}"]
    hanging = int((at_base & (stand.sign < 0)).sum()) if stand.sunk == 0 and gizmo.name in LOWER else 0
    sunk = int((at_base & (stand.sign > 0)).sum()) if stand.sunk == 1 and gizmo.name in UPPER else 0
    if not hanging + sunk:
        return []
    count = hanging + sunk
    what = f"{count:,} rows are below the map, and their upper ends lie in it"
    if count == 1:
        what = "1 row is below the map, and its upper end lies in it"
    return [f"{what}, where the picture shows noise of both; {advice}"]


def _in_each_other(stand: Stand, number: np.ndarray, size: float, table: Table | None) -> list[str]:
    """A sentence about gizmos with one foot and one radius. size: that of the base. table: as above"""
    # The feet of one place, such as 180 degrees east and west, differ by rounding.
    numbers = np.round(np.stack([*stand.foot, stand.radius]) / (SAME * size))
    # Equal columns have equal sums. So they are neighbours after the sums are sorted, and sorting one number is fast.
    order = np.argsort(np.sqrt([2, 3, 5, 7]) @ numbers + 0.1 * stand.sign, kind="stable")
    sorted_numbers = np.vstack([numbers, stand.sign])[:, order]
    same = np.flatnonzero((sorted_numbers[:, 1:] == sorted_numbers[:, :-1]).all(axis=0))
    if not len(same):
        return []
    one, other = number[order[same[0] : same[0] + 2]]
    what = f"{len(same):,} rows stand in another row of the same place and radius, as {other} does in {one}"
    right = "give them different radii, or show one row for each place"
    if table is not None and (column := date_column(table)):
        own = f'write "time": {shown(column)} into the layer of a scene, or --time-column {shown(column)}'
        right = f"column {shown(column)} has dates; to show one date, {own} for visray data"
    return [f"{what}; {right}"]
