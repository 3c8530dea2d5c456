"""The rows of a data layer as numbers: where each gizmo stands, how large it is, and its colour.

All of it is NumPy, and runs once for each scene. Arrays have one entry for each gizmo. Rows of the source without a
gizmo, because a number is missing or a size is zero, have no entry.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from visray.data.base import Ground
from visray.data.gizmos import CONSTANT, Fields, Gizmo, Stand
from visray.data.size_rule import SizeRule
from visray.primitives.instance import Instance
from visray.primitives.primitive import Primitive
from visray.transforms import Matrix

# Reasons among the counts of rows: for rows that a note of its own counts, and for rows that are shown.
OUTSIDE, COLORLESS = "outside of the map", "in the colour of missing values"

# Stands for the material of rows that have colours. No name of a material has a dot.
ROW_MATERIAL = "data.row"


@dataclass(frozen=True, eq=False)
class InTime:
    """What the gizmos of a layer with a time have at all dates, and which of them are hidden at the date that is shown.
    Hidden gizmos are tiny, and below the base: so the number of gizmos never changes, and no kernel does.

    text: the date, as text
    hidden: whether each gizmo is hidden. Shape: (N)
    known: all numbers of the rows of the source, by property: those that domains and legends come from
    largest: the largest number of each gizmo, without its sign, by property. Shape: (N)
    sizes: the largest size of each gizmo, by property. Shape: (N)
    """

    text: str
    hidden: np.ndarray
    known: dict[str, np.ndarray]
    largest: dict[str, np.ndarray]
    sizes: dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Rows:
    """The gizmos of a layer.

    gizmo: kind of the gizmos
    geometry: name of the geometry, for gizmos that are one
    material: name of their material
    number: number of each gizmo's row in the source, in increasing order. The segments of a line have the same number;
        all other gizmos have different ones
    values: number of each row, by property, in units of the data; a property without a column is left out
    ground: points of the base, with their derivatives
    stand: where the gizmos stand, and their sizes
    slopes: derivative of "height" and "radius" by the value, and of "color", of shape (3, N)
    fields: fields of the objects, of shape (N) or (3, N)
    color: colour of each gizmo in linear light, of shape (3, N); None if they have those of the material
    texts: label of each row; None if the layer has no column of names
    lift: height of the feet above the base, of shape (N)
    rules: rules with the domain and range that the data give them, by property: a SizeRule, or ResolvedColors
    fitted: properties whose rules have their domain from the data
    counts: number of rows of the source that are not shown, by reason
    notes: sentences about the data
    in_time: for a layer with a time, whose rows are places; else None
    """

    gizmo: Gizmo
    geometry: str | None
    material: str
    number: np.ndarray
    values: dict[str, np.ndarray]
    ground: Ground
    stand: Stand
    slopes: dict[str, np.ndarray]
    fields: Fields
    color: np.ndarray | None
    texts: tuple[str, ...] | None
    lift: np.ndarray
    rules: dict[str, Any] = field(default_factory=dict)
    fitted: frozenset[str] = frozenset()
    counts: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    in_time: InTime | None = None

    def __len__(self) -> int:
        """Number of gizmos."""
        return len(self.number)

    @cached_property
    def first(self) -> np.ndarray:
        """Index of the first gizmo of each row of the source that has some. Shape: (number of these rows)."""
        return np.flatnonzero(np.diff(self.number, prepend=-1))

    @property
    def hidden(self) -> np.ndarray:
        """Whether each gizmo is hidden, because its place is not known at the date. Shape: (N)."""
        return np.zeros(len(self), bool) if self.in_time is None else self.in_time.hidden

    def known(self, name: str) -> np.ndarray:
        """All numbers of a property, at all dates: those that its rule and its key in the legend come from."""
        return self.values[name] if self.in_time is None else self.in_time.known[name]

    def all_notes(self) -> list[str]:
        """Sentences about the data, and about how many rows are not shown, and why."""
        one, many = ("row", "rows") if self.in_time is None else ("place", "places")
        left_out = [f"{n:,} {reason}" for reason, n in self.counts.items() if reason not in (OUTSIDE, COLORLESS)]
        count, grey = len(self.first), self.counts.get(COLORLESS, 0)
        shown = f"1 {one} is" if count == 1 else f"{count:,} {many} are"
        notes = [f"{shown} shown, and not: {', '.join(left_out)}"] if left_out else []
        if grey:
            have = "has" if grey == 1 else "have"
            notes.append(f"{grey:,} of the {many} that are shown {have} the colour of missing values")
        return [*self.notes, *notes]

    def index(self, number: int) -> int | None:
        """Index of the gizmo of a row of the source, the first one of a line; None if the row has none."""
        i = int(np.searchsorted(self.number, number))
        return i if i < len(self) and self.number[i] == number else None

    def slope_flaw(self, number: int, name: str) -> str | None:
        """Why a picture has no derivative by a number of a row of the source; None if it has one."""
        i = self.index(number)
        value, slope = self.values[name][i], self.slopes.get(name)
        if self.hidden[i]:
            return f"as the place has no numbers on {self.in_time.text}"
        if np.isnan(value):
            return "as this number is missing"
        if slope is not None and not np.isfinite(slope[..., i]).all():
            return "as its rule is infinitely steep there"
        if name in self.fitted and self.in_time is not None:
            return "as the domain of its rule is that of all dates; give the rule a domain"
        if name in self.fitted and self._is_end(value, self.rules[name]):
            return "as the domain of its rule changes with it; give the rule a domain"
        return None

    @staticmethod
    def _is_end(value: float, rule: Any) -> bool:
        """Whether a domain that the data give changes with a value. rule: a SizeRule, or ResolvedColors."""
        if isinstance(rule, SizeRule):
            return rule.domain is None or abs(value) == rule.domain[1] or (
                rule.scale == "log" and abs(value) == rule.domain[0])  # fmt: skip
        return rule.bands is None and rule.norm.moves_with(value)

    def numbers_text(self) -> str:
        """Which rows are shown, as words."""
        if not len(self):
            return "it shows none"
        return f"it shows {len(self.first):,} rows, from {self.number[0]} to {self.number[-1]}"

    def object(self, i: int) -> Primitive:
        """Gizmo i as an object of a scene, in the layer's material. Its colour is not in it."""
        frame = self.fields.get("frame")
        transform = ()
        if frame is not None:
            columns = np.stack([v[:, i] for v in frame], axis=1)
            transform = (Matrix(matrix=tuple(tuple(map(float, row)) for row in columns)),)
        if self.geometry is not None:
            return Instance(geometry=self.geometry, material=self.material, transform=transform)
        own = {name: _plain(x, i) for name, x in self.fields.items() if name != "frame"}
        return self.gizmo.kind(**own, **CONSTANT.get(self.gizmo.name, {}), material=self.material, transform=transform)

    def attached_fields(self, values: dict[str, Any], put: Any) -> Fields:
        """The fields of the objects as functions of attached arrays.

        values: attached numbers of the rows, by property
        put: function that copies an array of NumPy to Dr.Jit
        """
        shift = {name: x - put(self.values[name]) for name, x in values.items()}
        place = {name: put(getattr(self.ground, name).T) for name in ("point", "up", "east")}
        for axis in ("lon", "lat"):
            if axis in shift:
                for name in place:
                    place[name] = place[name] + put(getattr(self.ground, f"{name}_{axis}").T) * shift[axis]
        size = {
            name: put(getattr(self.stand, name)) + put(finite(self.slopes[name])) * shift[name]
            if name in shift
            else put(getattr(self.stand, name))
            for name in ("height", "radius")
        }
        up, east = place["up"], place["east"]
        north = type(up)(up.y * east.z - up.z * east.y, up.z * east.x - up.x * east.z, up.x * east.y - up.y * east.x)
        stand = Stand(place["point"] + up * put(self.lift), up, east, north, size["height"], put(self.stand.sign),
                      size["radius"], self.stand.sunk)  # fmt: skip
        return self.gizmo.fields(stand)


def finite(slope: np.ndarray) -> np.ndarray:
    """Derivatives, 0 in place of infinite ones: no derivative is taken by the numbers of these rows."""
    return np.where(np.isfinite(slope), slope, 0.0)


def _plain(x: np.ndarray, i: int) -> Any:
    """Entry i of a field as plain numbers."""
    return float(x[i]) if x.ndim == 1 else tuple(map(float, x[:, i]))
