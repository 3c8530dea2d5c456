"""Tables of data: what is read, how dialects are found, and what is refused in one line."""

from pathlib import Path

import numpy as np
import pytest

from visray.data.positions import out_of_range, position_columns, swapped
from visray.data.reading import read_table
from visray.data.table import Table
from visray.errors import UserError


@pytest.fixture
def table(tmp_path: Path):
    """Function that reads a table from a text or from bytes."""

    def read(content: str | bytes, name: str = "a.csv", encoding: str = "utf-8") -> Table:
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode(encoding))
        return read_table(path)

    return read


def refusal(function, *arguments, **named) -> str:
    """The message of the UserError that a call raises: it must be one line."""
    with pytest.raises(UserError) as caught:
        function(*arguments, **named)
    (line,) = caught.value.lines
    assert line.isprintable()
    return line


def test_a_plain_table(table):
    read = table("city,lon,lat,rain\nBarcelona,2.17,41.38,600\nOslo,10.7,59.9,\n")
    assert read.names == ["city", "lon", "lat", "rain"] and read.where.tolist() == [2, 3] and not read.notes
    assert read.texts("city").tolist() == ["Barcelona", "Oslo"]
    np.testing.assert_array_equal(read.numbers("rain")[0], [600, np.nan])
    assert position_columns(read) == ("lon", "lat")


@pytest.mark.parametrize(("separator", "name"), [(",", "commas"), (";", "semicolons"), ("\t", "tabs"), ("|", "bars")])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_separators_and_line_ends(table, separator, name, end):
    rows = [["city", "lon", "rain"], ["Reus", "1.1", "5"], [f'"a{separator}{end}b"', "-2.5", "6"], ["Vic", "2", "1e3"]]
    read = table(end.join(separator.join(row) for row in rows))
    assert read.separator == separator and name in read.dialect
    assert read.texts("city").tolist() == ["Reus", f"a{separator}{end}b", "Vic"]
    assert read.columns["lon"].tolist() == [1.1, -2.5, 2] and read.columns["rain"].tolist() == [5, 6, 1000]
    assert read.where.tolist() == [2, 3, 5]


def test_text_where_numbers_belong(table):
    read = table("a,b\n1,=1+2\n2,@SUM(A1)\n3,7\n" + "4,x\n" * 5)
    values, problems = read.numbers("b")
    np.testing.assert_array_equal(values, [np.nan, np.nan, 7] + [np.nan] * 5)
    assert problems.count == 7 and [cell.line for cell in problems.cells] == [2, 3, 5, 6, 7]
    assert 'line 2 "=1+2" (a formula, not its result)' in str(problems) and "and 2 more" in str(problems)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "the file is empty"),
        (" \n\n", "the file is empty"),
        ("lon,lat\n", "has a header (lon, lat) and no rows"),
        ("a;b\n1;2;3\n4\n5;6\n", 'line 2 has 3 ("1;2;3"), line 3 has 1 ("4")'),
        ('a,b\n1,"2\n3,4\n', "line 2: a quote is opened and never closed"),
        ('a,b\n1,2\n"1"x,4\n', "line 3: text follows a closing quote"),
        ('{"type": "Feature"}', "looks like JSON"),
        ("<!DOCTYPE html>", "is a web page"),
        (b"PK\x03\x04abc", "is a workbook"),
        ("a,b\n1,2\n".encode("utf-16-le"), "UTF-16 without a byte order mark"),
        (b"a,b\n1,\0\n", "line 2: holds a NUL character"),
        ("a\ná\n".encode() + "á\n".encode("cp1252"), 'UTF-8 in line 2, and another one in line 3 "á"'),
    ],
)
def test_refused(table, content, said):
    assert said in refusal(table, content)


def test_ranges(table):
    read = table("x,y\n95,2\n5,91\n-200,4\n")
    lon, lat = read.columns["x"], read.columns["y"]
    assert out_of_range(read, lon, lat) == [
        "1 longitude is not between -180 and 360: line 4 has -200; write degrees",
        "1 latitude is not between -90 and 90: line 3 has 91; write degrees",
    ]
    assert not swapped(lon, lat) and swapped(np.array([41.0, 35]), np.array([2.0, 139]))
