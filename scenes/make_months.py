"""The table scenes/data/coastal-months.csv: the months of scenes/data/coastal-cities.csv one below another, as data in
time are written: a row for each city and month.

    python scenes/make_months.py
    python scenes/make_months.py -o somewhere/else.csv

The numbers are means of 1946 to 1989, so the years of the dates, 2001 and 2002, mean nothing. January comes once more
at the end, so that an animation of the year closes.
"""

import argparse
import csv
from collections.abc import Iterator
from pathlib import Path

DATA = Path(__file__).resolve().parent / "data"
MONTHS = (
    "january", "february", "march", "april", "may", "june",
    "july", "august", "september", "october", "november", "december",
)  # fmt: skip
YEAR = 2001


def months() -> Iterator[dict]:
    """The rows of the table."""
    with (DATA / "coastal-cities.csv").open(encoding="utf-8", newline="") as file:
        cities = list(csv.DictReader(file))
    for city in cities:
        for k in range(len(MONTHS) + 1):
            year, month = divmod(k, len(MONTHS))
            place = {key: city[key] for key in ("name", "country", "lon", "lat")}
            yield place | {"month": f"{YEAR + year}-{month + 1:02}", "temperature": city[MONTHS[month]]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=DATA / "coastal-months.csv")
    with parser.parse_args().output.open("w", encoding="utf-8", newline="") as file:
        rows = list(months())
        table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


if __name__ == "__main__":
    main()
