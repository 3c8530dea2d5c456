"""The report of `visray data --describe`: what the columns of a table hold."""

from pathlib import Path
from typing import Any

from visray.terminal import write_json, write_line


def describe_table(file: Path, json: bool) -> int:
    """Prints what the columns of a table hold. Returns the exit code."""
    from visray import tables
    from visray.data.describe import describe
    from visray.data.positions import position_notes
    from visray.data.reading import read_table

    table = read_table(file)
    records, positions = describe(table), position_notes(table)
    if json:
        report = {"file": str(file), "rows": len(table), "dialect": table.dialect, "notes": table.notes}
        report["positions"] = positions
        write_json(report | {"columns": records})
        return 0
    shown = tables.Table("column", "holds", "missing", "values")
    for record in records:
        missing = f"{record['missing']:,}" if record["missing"] else ""
        shown.add_row(record["column"], f"{record['count']:,} {record['kind']}", missing, _values(record))
    tables.show(shown)
    lines = [f"{file}: {len(table):,} rows", table.dialect, *table.notes]
    lines += positions + [record["problem"] for record in records if record["problem"]]
    for line in filter(None, lines):
        write_line(line)
    return 0


def _values(record: dict[str, Any]) -> str:
    """The values of a column in words: a range, or the first few. record: of the column, as `describe` returns it."""
    if record["kind"] == "numbers":
        least, greatest, mean = (_written(record[key]) for key in ("min", "max", "mean"))
        return f"{least} to {greatest}, mean {mean}"
    if record["kind"] == "dates":
        return f"{record['first']} to {record['last']} ({record['distinct']:,} different)"
    shown = ", ".join(value if isinstance(value, str) else _written(value) for value in record["examples"])
    return shown + (f", ... ({record['distinct']:,} different)" if record["distinct"] > len(record["examples"]) else "")


def _written(number: float) -> str:
    """A number with six digits, or all digits before the point if they are not many."""
    return f"{number:,.0f}" if 1e5 <= abs(number) < 1e12 else f"{number:,.6g}"
