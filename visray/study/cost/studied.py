"""A report that shows and writes itself."""

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from visray.errors import UserError
from visray.output.files import write_text
from visray.study.cost import writing
from visray.study.cost.records import Report
from visray.study.cost.wording import duration, percent

SUFFIXES = (".html", ".json", ".csv")


@dataclass(frozen=True)
class Study(Report):
    """What accuracy costs for a scene: shows its figure in a notebook, and writes itself to a file."""

    def __repr__(self) -> str:
        error, took = percent(self.default.error.rmse.middle), duration(self.default.seconds.middle)
        size = f"{self.width} x {self.height} pixels, {self.seeds} seeds"
        return f"<Study of {self.scene}: {size}, error {error} in {took}{', stopped' if self.stopped else ''}>"

    def as_json(self) -> dict[str, Any]:
        """The numbers as json.dumps takes them, without pictures."""
        return writing.as_json(self)

    def as_csv(self) -> str:
        """A row for each point, with all settings."""
        return writing.as_csv(self)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes an .html page that opens offline, or a .json or .csv file."""
        check_report(path)
        suffix = Path(path).suffix.lower()
        if suffix == ".html":
            # Matplotlib takes a while to load.
            from visray.study.cost.page import page

            text = page(self)
        else:
            text = json.dumps(self.as_json(), indent=1) + "\n" if suffix == ".json" else self.as_csv()
        write_text(path, text)

    def _repr_html_(self) -> str:
        from visray.study.cost.page import display

        return display(self)


def check_report(path: str | os.PathLike[str]) -> None:
    """Returns if a report could have this name, else raises a UserError."""
    if Path(path).suffix.lower() not in SUFFIXES:
        raise UserError(f"{path}: the name says no format of a report; end it in {', '.join(SUFFIXES)}")
