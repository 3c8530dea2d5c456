"""From a layer and a base to gizmos: coordinates become points, and what was found lately is kept."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any
from weakref import WeakValueDictionary

import numpy as np

from visray.data.base import Base
from visray.data.gizmos import Stand
from visray.data.layer import DataLayer
from visray.data.rows import Rows
from visray.data.shown_rows import ShownRows
from visray.data.source import stamp_of
from visray.data.standing import Standing
from visray.data.timed_layer import TimedLayer
from visray.data.timed_rows import timed_rows
from visray.data.touching import notes_of_touching

# Layers with up to this many rows are kept for a while after no scene has them any more.
FEW_ROWS = 20_000


@dataclass(frozen=True, eq=False)
class Resolved:
    """A layer on a base: its rows, or its flaws.

    rows: the gizmos; None if there are flaws
    flaws: errors (field, message)
    """

    rows: Rows | None
    flaws: tuple[tuple[str, str], ...] = ()


def resolved(layer: DataLayer, base: Base, moment: float = 0.0) -> Resolved:
    """A layer on a base. What was resolved lately, and has not changed, is not resolved again.

    moment: for a layer with a time, the date that is shown, as a number
    """
    if layer.time is None:
        return _LATE.get(_Key(layer, base))
    timed = timed_layer(layer, base)
    return Resolved(None, timed.flaws) if timed.flaws else _MOMENTS.get(_Moment(timed, moment))


def timed_layer(layer: DataLayer, base: Base) -> TimedLayer:
    """What is true of a layer with a time at all dates. It is kept as in `resolved`. Domain: it has a time."""
    return _TIMED.get(_Key(layer, base))


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


@dataclass(frozen=True)
class _Moment:
    """A layer with a time, and a moment, as a key of a cache."""

    timed: TimedLayer
    moment: float


class _Late:
    """What was made lately: all that something still holds, and the last few small results.

    make: function that makes the result of a key
    size: function that returns the number of rows of a result
    held: results by key, as long as something else refers to them
    small: the last results with few rows
    """

    def __init__(self, make: Callable[[Any], Any], size: Callable[[Any], int]) -> None:
        self.make, self.size = make, size
        self.held: WeakValueDictionary[Any, Any] = WeakValueDictionary()
        self.small: deque[Any] = deque(maxlen=16)

    def get(self, key: Any) -> Any:
        """The result of a key, made now or lately."""
        found = self.held.get(key)
        if found is None:
            found = self.held[key] = self.make(key)
            # Many large layers, as of an animation, would fill the memory.
            if self.size(found) <= FEW_ROWS:
                self.small.append(found)
        return found


def _size(found: Resolved) -> int:
    """Number of gizmos of a layer."""
    return 0 if found.rows is None else len(found.rows)


def _resolved(layer: DataLayer, base: Base) -> Resolved:
    """A layer without a time on a base: its rows, or its flaws."""
    shown = ShownRows(layer, base)
    if shown.flaws:
        return Resolved(None, tuple(shown.flaws))
    return Resolved(_lines(shown) if shown.t.is_lines else _points(shown))


_LATE = _Late(lambda key: _resolved(key.layer, key.base), _size)
_TIMED = _Late(lambda key: TimedLayer(key.layer, key.base), lambda timed: len(timed.shown.kept))
_MOMENTS = _Late(lambda key: Resolved(timed_rows(key.timed, key.moment)), _size)


def _points(s: ShownRows) -> Rows:
    """The rows of points."""
    kept = np.flatnonzero(s.kept)
    values = {key: x[s.kept] for key, x in s.t.values.items()}
    ground = s.base.place(values["lon"], values["lat"])
    sizes = {key: x[s.kept] for key, x in s.sizes.items()}
    # Colours are those of the rows that are shown, and sizes those of all rows.
    slopes = {key: x if key == "color" else x[s.kept] for key, x in s.slopes.items()}
    standing = Standing.of(s.layer, s.base, ground, sizes)
    s.notes += notes_of_touching(s.gizmo, s.base, standing.stand, standing.lift, kept, s.color is not None, s.t.table)
    return _rows(s, kept, values, ground, standing.stand, standing.signed(slopes), s.gizmo.fields(standing.stand),
                 s.color, standing.lift)  # fmt: skip


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
