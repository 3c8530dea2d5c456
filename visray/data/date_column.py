"""Columns of dates in a table."""

import numpy as np

from visray.data.moments import Moments, moments_of_texts
from visray.data.table import Table

# Usual names of columns of years, whose dates are plain numbers, in lower case.
YEAR_COLUMNS = ("year", "jahr", "any", "année", "año")


def dates_in(table: Table, name: str) -> Moments | None:
    """The dates of a column of texts; None if one of its texts is no date, or if there is none."""
    if table.columns[name].dtype != object:
        return None
    try:
        found = moments_of_texts(table.texts(name).tolist(), table.place)
    except ValueError:
        return None
    return None if np.isnan(found.number).all() else found


def date_column(table: Table) -> str | None:
    """The first column with several dates, or with years and a usual name; None if there is none."""
    return next((name for name in table.names if _has_several(table, name)), None)


def _has_several(table: Table, name: str) -> bool:
    """Whether a column has several dates."""
    if name.casefold() in YEAR_COLUMNS:
        number = table.numbers(name)[0]
    elif (found := dates_in(table, name)) is not None:
        number = found.number
    else:
        return False
    given = number[~np.isnan(number)]
    return bool(len(given)) and given.min() < given.max()
