"""What the columns of a table hold."""

from typing import Any

import numpy as np

from visray.data.date_column import dates_in
from visray.data.table import Table

# Number of examples of a column.
EXAMPLES = 3


def describe(table: Table) -> list[dict[str, Any]]:
    """A record for each column, with the same keys:

    column: its name
    kind: `numbers`, `texts`, `dates`, `mixed` (numbers and texts) or `empty`
    count, missing: how many values it has, and how many are missing
    min, max, mean: of its numbers; None if it has none, or if it is of texts
    first, last: of its dates, as texts; None for others
    distinct: how many different values it has
    examples: its first different values
    problem: for a mixed column, a sentence about the texts; else None
    """
    return [_record(table, name) for name in table.names]


def _record(table: Table, name: str) -> dict[str, Any]:
    """The record of a column."""
    numbers, problems = table.numbers(name)
    given = numbers[np.isfinite(numbers)]
    is_text = problems.count > len(given) or (problems.count > 0 and not len(given))
    record: dict[str, Any] = {"column": name, "kind": "texts", "count": 0, "missing": 0}
    record |= dict.fromkeys(("min", "max", "mean", "first", "last")) | {"distinct": 0, "examples": [], "problem": None}
    if is_text:
        held = [text for text in table.texts(name).tolist() if text.strip()]
        values = list(dict.fromkeys(held))
        count = len(held)
        if (dates := dates_in(table, name)) is not None:
            first, last = (dates.text(float(x)) for x in (np.nanmin(dates.number), np.nanmax(dates.number)))
            record |= {"kind": "dates", "first": first, "last": last}
    else:
        # Sums of large numbers overflow, and means of shifted ones do not.
        values = list(dict.fromkeys(given.tolist()))
        count = len(given) + problems.count
        record["kind"] = "mixed" if problems else "numbers" if len(given) else "empty"
        record["problem"] = str(problems) if problems else None
    if not is_text and len(given):
        low, high = float(given.min()), float(given.max())
        scale = max(abs(low), abs(high)) or 1.0
        record |= {"min": low, "max": high, "mean": float(np.mean(given / scale) * scale)}
    examples = values[:EXAMPLES]
    return record | {"count": count, "missing": len(table) - count, "distinct": len(values), "examples": examples}
