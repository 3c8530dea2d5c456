"""Tables for the terminal. Their cells are plain text: no markup is read in them, and characters that cannot be printed
are shown as escapes.

Together with progress.py, the only access to rich.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import rich
from rich.console import Console, RenderableType
from rich.table import Column
from rich.table import Table as RichTable
from rich.text import Text

from visray import terminal

__all__ = ["Column", "Console", "RenderableType", "Table", "console", "show", "silent_rich", "styled"]


class Table(RichTable):
    """A table of plain text. A cell is a text, or a `styled` text. Titles and captions may have several lines."""

    def __init__(self, *headers: Column | str, title: str | None = None, caption: str | None = None, **more: Any):
        super().__init__(*headers, title=_lines(title), caption=_lines(caption), **more)

    def add_row(self, *cells: str | Text, **more: Any) -> None:
        """Adds a row. more: further arguments of rich's method."""
        super().add_row(*(styled(cell) if isinstance(cell, str) else cell for cell in cells), **more)


def _lines(text: str | None) -> str | None:
    """Plain text of several lines."""
    return text and "\n".join(map(terminal.printable, text.split("\n")))


def styled(text: str, style: str = "") -> Text:
    """Plain text in a style of rich, such as "green" or "bold"."""
    return Text(terminal.printable(text), style)


def console(**more: Any) -> Console:
    """A console of rich on standard output, which takes texts as they are. more: further arguments of rich's class."""
    return Console(file=terminal.Output(), markup=False, emoji=False, highlight=False, **more)


@contextmanager
def silent_rich() -> Iterator[None]:
    """A `with` block in which other libraries print nothing by way of rich."""
    shared = rich.get_console()
    before, shared.quiet = shared.quiet, True
    try:
        yield
    finally:
        shared.quiet = before


def show(*tables: Table) -> None:
    """Writes tables to standard output."""
    paper = console()
    for table in tables:
        paper.print(table)
