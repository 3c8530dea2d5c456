"""The data of a scene: a base, the layers on it, and the legend."""

from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property

from pydantic import ConfigDict

from visray.data.base import Base, GlobeBase
from visray.data.layer import DataLayer
from visray.data.legend import Legend
from visray.data.resolve import Resolved, resolved, timed_layer
from visray.data.rows import Rows
from visray.data.shown_date import Date, ShownDate
from visray.data.table import LISTED
from visray.errors import UserError
from visray.hints import hint
from visray.quantities import Name
from visray.records import record_kind
from visray.terminal import printable

# Names that no layer can have, because they are the names of other parts of the data.
RESERVED = ("base", "layers", "legend")


@record_kind
@dataclass(frozen=True, kw_only=True)
class Data:
    """Real data as a part of a scene.

    base: the map, the plane or the globe on which the data stand.
    layers: layers of data, by name.
    legend: what is written over the picture; null: nothing.
    date: the moment that layers with a time show, a date such as "2020-06-15", or a number; of dates, a number is a
        year with a fraction. null: the first date of the data.
    """

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")

    base: Base = field(default_factory=GlobeBase)
    layers: dict[Name, DataLayer] = field(default_factory=dict)
    legend: Legend | None = None
    date: Date | None = None

    @cached_property
    def shown_date(self) -> ShownDate:
        """The date that is shown. Domain: the base has no flaws."""
        timed = {name: timed_layer(x, self.base) for name, x in self.layers.items() if x.time is not None}
        return ShownDate.of({name: x.timeline for name, x in timed.items() if not x.flaws}, self.date)

    @property
    def date_text(self) -> str | None:
        """The date as the legend shows it; None if it shows none. Domain: no flaws."""
        if self.legend is None or self.legend.date is False or not self.shown_date.moments:
            return None
        return self.shown_date.text(self.legend.date)

    @cached_property
    def _resolved(self) -> dict[str, Resolved]:
        """The layers on the base, by name. Domain: the base has no flaws."""
        moments = self.shown_date.moments
        return {name: resolved(layer, self.base, moments.get(name, 0.0)) for name, layer in self.layers.items()}

    @cached_property
    def rows(self) -> dict[str, Rows]:
        """The rows of each layer, by its name. Domain: no flaws."""
        return {name: found.rows for name, found in self._resolved.items()}

    def value(self, layer: str, number: str, name: str) -> float:
        """A number of a row, in units of the data; with a time, that of the place at the date. Raises a UserError if it
        has none then. Domain: the row has a gizmo, and the number."""
        rows = self.rows[layer]
        i = rows.index(int(number))
        if rows.hidden[i]:
            address = f"data.{layer}.{number}.{name}"
            raise UserError(printable(f"{address}: the place is not shown on {rows.in_time.text}; take another date"))
        return float(rows.values[name][i])

    def row(self, layer: str, name: str) -> int:
        """Number of the row with a name, as `data.LAYER.NUMBER` has it. Raises a UserError if no row that is shown has
        the name, or several have it. Domain: no flaws."""
        if layer not in self.rows:
            raise UserError(printable(f"data.{layer}: there is no such layer; {hint(layer, list(self.rows))}"))
        rows = self.rows[layer]
        if rows.texts is None:
            raise UserError(printable(f"data.layers.{layer}.name: the layer has no column of names; name one"))
        # A row of lines has a gizmo for each segment.
        found = list(dict.fromkeys(int(n) for n, text in zip(rows.number, rows.texts) if text == name))
        if not found:
            near = get_close_matches(str(name), dict.fromkeys(rows.texts), 1)
            right = f'did you mean "{near[0]}"?' if near else f'data.rows["{layer}"].texts has all names'
            raise UserError(printable(f'data.{layer}: no row that is shown has the name "{name}"; {right}'))
        if len(found) > 1:
            several = ", ".join(map(str, found[:LISTED])) + (", ..." if len(found) > LISTED else "")
            raise UserError(printable(f'data.{layer}: rows {several} have the name "{name}"; take one of these'))
        return found[0]

    def flaws(self) -> list[tuple[str, str]]:
        """A list of errors (address below the data, message)."""
        found = [(f"base.{name}", text) for name, text in self.base.flaws()]
        if found:
            return found
        for name, made in self._resolved.items():
            if name in RESERVED:
                found.append((f"layers.{name}", "this name is taken by a part of the data; take another name"))
            found += [(f"layers.{name}.{part}", text) for part, text in made.flaws]
        if self.shown_date.flaw and not found:
            found.append(("date", self.shown_date.flaw))
        if self.legend is not None and (text := self.shown_date.form_flaw(self.legend.date)):
            found.append(("legend.date", text))
        return found

    def notes(self) -> list[str]:
        """List of sentences about the data, each of which begins with an address."""
        names: dict[str, list[str]] = {}
        for name, rows in self.rows.items():
            for text in rows.all_notes():
                names.setdefault(text, []).append(name)
        # What is true of several layers, as of those with one source, is said once.
        return [f"data.layers.{' and '.join(layers)}: {text}" for text, layers in names.items()]
