"""Which rows of a layer are one place, and in which order of time."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from visray.data.column import Place
from visray.data.moments import Moments
from visray.data.series import Series
from visray.data.table import shown


@dataclass(frozen=True, eq=False)
class Timeline:
    """The rows of a layer as places that change in time. Places are numbered in the order of their names, or of their
    longitudes and then latitudes if they have none: so the order of the rows does not matter.

    moments: the moments of all N rows
    order: numbers of the M rows that count, those of each place one after another, in order of time. Shape: (M)
    start: index in `order` of the first row of each place, and M. Shape: (P + 1)
    held: whether values are held until the next date; else they are interpolated
    unused: number of rows that do not count, by reason
    """

    moments: Moments
    order: np.ndarray
    start: np.ndarray
    held: bool
    unused: dict[str, int]

    @staticmethod
    def of(
        moments: Moments, names: np.ndarray | None, lon: np.ndarray, lat: np.ndarray, held: bool, place: Place
    ) -> "Timeline":
        """The places of rows. Raises ValueError if a place has two rows of one date, or if no row counts.

        names: of the rows; None: those with the same lon and lat are one place
        place: where a row stands, in words
        """
        dated, unused = ~np.isnan(moments.number), {}
        if names is not None:
            # Fixed widths sort much faster than objects.
            texts = np.array([text.strip() for text in names.tolist()], str)
            named, reason = texts != "", "without a name"
            keys: Sequence[np.ndarray] = (texts,)
        else:
            named, reason = ~(np.isnan(lon) | np.isnan(lat)), "without a position"
            keys = lat, lon
        for text, wrong in (("without a date", ~dated), (reason, dated & ~named)):
            if wrong.any():
                unused[text] = int(wrong.sum())
        rows = np.flatnonzero(dated & named)
        if not len(rows):
            raise ValueError("no row has a date and a place; a layer needs one at least")
        order = rows[np.lexsort([moments.number[rows], *(key[rows] for key in keys)])]
        same = np.ones(len(order) - 1, bool)
        for key in keys:
            same &= key[order][1:] == key[order][:-1]
        start = np.concatenate([[0], np.flatnonzero(~same) + 1, [len(order)]])
        twice = np.flatnonzero(same & (np.diff(moments.number[order]) == 0))
        if len(twice):
            one, other = sorted(order[twice[0] : twice[0] + 2].tolist())
            what = shown(names[one]) if names is not None else "one place"
            text = f"{place(one)} and {place(other)} are both {what} on {moments.text(moments.number[one])}"
            more = f", and {len(twice) - 1:,} more" if len(twice) > 1 else ""
            raise ValueError(f"{text}{more}; a place has one row for each date: take as name what tells places apart")
        return Timeline(moments, order, start, held, unused)

    def __len__(self) -> int:
        """Number of places."""
        return len(self.start) - 1

    @cached_property
    def first(self) -> np.ndarray:
        """The first row of each place. Shape: (P)."""
        return self.order[self.start[:-1]]

    @cached_property
    def place(self) -> np.ndarray:
        """The number of the place of each row in `order`. Shape: (M)."""
        return np.repeat(np.arange(len(self)), np.diff(self.start))

    @cached_property
    def limits(self) -> tuple[float, float]:
        """The first and the last moment."""
        number = self.moments.number[self.order]
        return float(number.min()), float(number.max())

    @cached_property
    def used(self) -> np.ndarray:
        """Mask of the rows that count. Shape: (N)."""
        mask = np.zeros(len(self.moments.number), bool)
        mask[self.order] = True
        return mask

    def rows_of(self, place: int) -> np.ndarray:
        """The rows of a place, in order of time."""
        return self.order[self.start[place] : self.start[place + 1]]

    def series(self, values: np.ndarray, cyclic: bool = False) -> Series:
        """The numbers of the places in time.

        values: one for each of the N rows, NaN where one is missing. cyclic: as in Series
        """
        known = ~np.isnan(values[self.order])
        rows, place = self.order[known], self.place[known]
        start = np.searchsorted(place, np.arange(len(self) + 1))
        return Series(self.moments.number[rows], values[rows], start, self.held, cyclic)

    def gaps(self, values: np.ndarray) -> int:
        """Number of rows without a number, between rows of the same place that have one. Shape: values (N)."""
        known = ~np.isnan(values[self.order])
        at = np.flatnonzero(known)
        first = np.full(len(self), len(self.order))
        last = np.full(len(self), -1)
        np.minimum.at(first, self.place[at], at)
        np.maximum.at(last, self.place[at], at)
        index = np.arange(len(self.order))
        return int((~known & (index > first[self.place]) & (index < last[self.place])).sum())

    def largest(self, values: np.ndarray) -> np.ndarray:
        """The largest number of each place at any date, without its sign; 0 without any. Shapes: (N) -> (P)."""
        found = np.nan_to_num(np.abs(values[self.order]), nan=0.0)
        return np.maximum.reduceat(found, self.start[:-1])
