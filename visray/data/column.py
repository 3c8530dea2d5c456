"""Columns of a table, as rules name them, and words for rows that have something wrong."""

from collections.abc import Callable
from typing import Annotated

import numpy as np
from pydantic import Field

Column = Annotated[str, Field(strict=True, min_length=1)]

# Number of rows that a message names.
FIRST = 5
# Where a row stands, from its number: `line 12` of a file, or `row 12`.
Place = Callable[[int], str]


def row_place(number: int) -> str:
    """Where a row of a table without lines stands."""
    return f"row {number}"


def rows_text(wrong: np.ndarray, values: np.ndarray, rows: np.ndarray | None = None, place: Place = row_place) -> str:
    """The first few wrong rows with their values, and how many more there are, as in `row 3 (-1.5), row 8 (0)`.

    wrong: whether each value is wrong; at least one is.
    rows: numbers of the rows; None: they are counted from 0.
    place: where a row stands, from its number.

    Shapes: (N) each.
    """
    found = np.flatnonzero(wrong)
    numbers = found if rows is None else np.asarray(rows)[found]
    shown = ", ".join(f"{place(number)} ({values[i]:g})" for i, number in zip(found[:FIRST], numbers))
    return f"{shown}, and {len(found) - FIRST} more" if len(found) > FIRST else shown
