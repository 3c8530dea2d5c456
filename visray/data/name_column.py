"""The column of a table that holds the names of its rows."""

from visray.data.numerals import read_column
from visray.data.table import Table

# Usual names of such columns, the more certain ones first.
NAME_COLUMNS = ("name", "city", "place", "station", "country", "label", "title")
# Number of rows whose cells tell what a column holds.
LOOKED_AT = 1000


def name_column(table: Table) -> str | None:
    """The column with the names of rows: one with a usual name, or the first column of texts of which most are
    different; None if there is none."""
    usual = {name.casefold(): name for name in reversed(table.names)}
    found = next((usual[name] for name in NAME_COLUMNS if name in usual), None)
    return found if found is not None else next((name for name in table.names if _holds_names(table, name)), None)


def _holds_names(table: Table, name: str) -> bool:
    """Whether a column holds texts, most of which are different."""
    values = table.columns[name]
    if values.dtype != object:
        return False
    texts = [text for text in values[:LOOKED_AT].tolist() if text.strip()]
    numbers = len(texts) - len(read_column(texts, table.decimal, table.separator).bad)
    return 2 * numbers < len(texts) <= 2 * len(set(texts))
