"""From a layer and a base to gizmos: coordinates become points, and what was found lately is kept."""

from collections import deque
from dataclasses import dataclass, fields
from typing import Any
from weakref import WeakValueDictionary

import numpy as np

from visray.data.base import Base, FlatBase
from visray.data.gizmos import Stand
from visray.data.layer import DataLayer
from visray.data.rows import Rows
from visray.data.shown_rows import ShownRows
from visray.data.source import stamp_of
from visray.data.touching import LOWER, notes_of_touching

# Layers with up to this many rows are kept for a while after no scene has them any more.
FEW_ROWS = 20_000
# How far disks are above the base, and hanging bars below it, if the layer has no lift: a share of the base's size.
LIFT = 0.001


@dataclass(frozen=True, eq=False)
class Resolved:
    """A layer on a base: its rows, or its flaws.

    rows: the gizmos; None if there are flaws
    flaws: errors (field, message)
    """

    rows: Rows | None
    flaws: tuple[tuple[str, str], ...] = ()


def resolved(layer: DataLayer, base: Base) -> Resolved:
    """A layer on a base. What was resolved lately, and has not changed, is not resolved again."""
    return _LATE.get(_Key(layer, base))


class _Key:
    """A layer and a base as a key of a cache: equal keys have equal rows."""

    def __init__(self, layer: DataLayer, base: Base):
        self.layer, self.base = layer, base
        own = tuple(getattr(layer, f.name) for f in fields(layer) if f.name not in ("rows", "source"))
        self.parts = (own, tuple(sorted(layer.rows.items())), stamp_of(layer.source), base)
        self.hash = hash(self.parts)

    def __hash__(self) -> int:
        return self.hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self.parts == other.parts


class _Late:
    """What was resolved lately: all that a scene still holds, and the last few small layers.

    held: results by key, as long as something else refers to them
    small: the last results with few rows
    """

    def __init__(self) -> None:
        self.held: WeakValueDictionary[_Key, Resolved] = WeakValueDictionary()
        self.small: deque[Resolved] = deque(maxlen=16)

    def get(self, key: _Key) -> Resolved:
        """A layer on a base, resolved now or lately."""
        found = self.held.get(key)
        if found is None:
            found = self.held[key] = _resolved(key.layer, key.base)
            # Many large layers, as of an animation, would fill the memory.
            if found.rows is None or len(found.rows) <= FEW_ROWS:
                self.small.append(found)
        return found


_LATE = _Late()


def _resolved(layer: DataLayer, base: Base) -> Resolved:
    """A layer on a base: its rows, or its flaws."""
    shown = ShownRows(layer, base)
    if shown.flaws:
        return Resolved(None, tuple(shown.flaws))
    return Resolved(_lines(shown) if shown.t.is_lines else _points(shown))


def _points(s: ShownRows) -> Rows:
    """The rows of points."""
    kept = np.flatnonzero(s.kept)
    values = {key: x[s.kept] for key, x in s.t.values.items()}
    ground = s.base.place(values["lon"], values["lat"])
    sizes = {key: x[s.kept] for key, x in s.sizes.items()}
    signed = sizes.get("height", sizes["radius"])
    sign = np.where(signed < 0, -1.0, 1.0)
    # Colours are those of the rows that are shown, and sizes those of all rows.
    slopes = {key: x.T if key == "color" else x[s.kept] * sign for key, x in s.slopes.items()}
    lift = _lift(s, sign)
    up, east = ground.up.T, ground.east.T
    stand = Stand(ground.point.T + up * lift, up, east, np.cross(ground.up, ground.east).T,
                  np.abs(sizes.get("height", sizes["radius"])), sign, np.abs(sizes["radius"]),
                  s.layer.sunk)  # fmt: skip
    s.notes += notes_of_touching(s.gizmo, s.base, stand, lift, kept, s.color is not None)
    return _rows(s, kept, values, ground, stand, slopes, s.gizmo.fields(stand), s.color, lift)


def _lift(s: ShownRows, sign: np.ndarray) -> np.ndarray:
    """Height of each gizmo's foot above the base. Those that would lie in a map, with a flat side, are moved a little,
    so that the picture shows no noise of both. sign: of their sizes. Shape: (N)."""
    if s.layer.lift is not None:
        return np.full(len(sign), s.layer.lift)
    little = LIFT * s.base.size
    hangs = isinstance(s.base, FlatBase) and s.layer.sunk == 0 and s.gizmo.name in LOWER
    return np.where(hangs & (sign < 0), -little, little if s.gizmo.flat else 0.0)


def _lines(s: ShownRows) -> Rows:
    """The rows of lines: one for each segment."""
    radius = s.sizes["radius"]
    found = s.segments.of_rows(s.kept)
    row = found.row
    values = {key: x[row] for key, x in s.t.values.items()}
    # Colours are those of the rows that are shown, and sizes those of all rows.
    shown = (np.cumsum(s.kept) - 1)[row]
    slopes = {key: x[shown].T if key == "color" else x[row] for key, x in s.slopes.items()}
    one = np.ones(len(row))
    nowhere = np.zeros((3, len(row)))
    stand = Stand(nowhere, nowhere, nowhere, nowhere, one, one, radius[row], 0.0)
    shape = {"a": found.a.T, "b": found.b.T, "radius": radius[row]}
    color = None if s.color is None else s.color[shown]
    return _rows(s, row, values, found.ground, stand, slopes, shape, color, np.full(len(row), s.layer.lift or 0.0))


def _rows(
    s: ShownRows, row: np.ndarray, values: dict, ground: Any, stand: Stand, slopes: dict, shape: dict,
    color: np.ndarray | None, lift: np.ndarray,
) -> Rows:  # fmt: skip
    """The rows. row: number of each gizmo's row in the source"""
    texts = s.t.texts()
    return Rows(
        s.gizmo, s.layer.geometry, s.layer.material, row, values, ground, stand, slopes, shape,
        None if color is None else color.T, None if texts is None else tuple(texts[row].tolist()), lift, s.rules,
        frozenset(s.fitted), s.counts, tuple(s.notes),
    )  # fmt: skip
