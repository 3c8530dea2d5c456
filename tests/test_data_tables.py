"""Tables in text files: what is read, how the dialect is found, and what is refused in one line."""

import csv
import io
import json
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visray import memory
from visray.data import csv_file
from visray.data.cells import Column, columns_of
from visray.data.describe import describe
from visray.data.dialect import SEPARATORS
from visray.data.encoding import OTHERS
from visray.data.numerals import MISSING, NEUTRAL, OFTEN_MISSING, UNITS, read_column
from visray.data.positions import LATITUDES, LONGITUDES, out_of_range, position_columns, position_notes, swapped
from visray.data.reading import READERS, read_table
from visray.data.table import LISTED, Table, as_texts
from visray.errors import UserError

NAN = float("nan")


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


def test_a_plain_table_has_no_notes(table):
    read = table("city,lon,lat,rain\nBarcelona,2.17,41.38,600\nOslo,10.7,59.9,\n")
    assert read.names == ["city", "lon", "lat", "rain"] and len(read) == 2 and not read.notes
    assert read.where.tolist() == [2, 3] and [read.place(0), read.line(1)] == ["line 2", 3]
    assert read.texts("city").tolist() == ["Barcelona", "Oslo"] and read.columns["lon"].dtype == np.float64
    np.testing.assert_array_equal(read.numbers("rain")[0], [600, NAN])
    assert not read.numbers("rain")[1] and read.texts("rain").tolist() == ["600", ""]
    assert read.dialect == "UTF-8, cells separated by commas, header in line 1"


@pytest.mark.parametrize("separator", SEPARATORS)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_separators_and_line_ends(table, separator, end):
    rows = [["city", "lon", "rain"], ["Reus", "1.1", "5"], [f'"a{separator}{end}b"', "-2.5", "6"], ["Vic", "2", "1e3"]]
    read = table(end.join(separator.join(row) for row in rows))
    assert read.separator == separator and SEPARATORS[separator] in read.dialect
    assert read.texts("city").tolist() == ["Reus", f"a{separator}{end}b", "Vic"]
    assert read.columns["lon"].tolist() == [1.1, -2.5, 2] and read.columns["rain"].tolist() == [5, 6, 1000]
    assert read.where.tolist() == [2, 3, 5]


@pytest.mark.parametrize("separator", [";", "\t", "|"])
def test_a_decimal_comma_is_found_and_told(table, separator):
    rows = ["city lon lat people", "Reus 1,1 41,15 106.741", "Vic 2,25 -1,93 47.319", "Olot -2 42,18 1.037.004,5"]
    read = table("\n".join(row.replace(" ", separator) for row in rows))
    assert read.separator == separator and read.decimal == ","
    assert read.columns["lon"].tolist() == [1.1, 2.25, -2] and read.columns["lat"].tolist() == [41.15, -1.93, 42.18]
    assert read.columns["people"].tolist() == [106741, 47319, 1037004.5]
    assert "decimal comma" in read.dialect and 'column "lon": the comma is decimal' in read.notes


def test_points_separate_thousands_where_other_columns_have_decimal_commas(table):
    read = table("city;lon;people\nReus;1,1;106.741\nVic;2,25;47.319\n")
    assert read.columns["people"].tolist() == [106741, 47319]
    assert 'column "people": 106.741 is read as 106741' in read.notes
    read = table("city;lon;people\nReus;1.1;106.741\nVic;2.25;47.319\n")
    assert read.columns["people"].tolist() == [106.741, 47.319] and not read.notes
    read = table("city;people\nReus;106.741\nVic;47.319\n")
    assert read.columns["people"].tolist() == [106.741, 47.319] and "1.234 is not 1234" in read.notes[0]


# Columns of cells, the numbers that they hold, and the cells that are text. The separator is a comma.
COLUMNS = [
    (["1", "2.5", "-3e2", "+.5", "7."], [1, 2.5, -300, 0.5, 7], []),
    (["1,234.5", "12", "1,234,567"], [1234.5, 12, 1234567], []),
    (["1.234,5", "12", "1.234.567"], [1234.5, 12, 1234567], []),
    (["1,234", "5,678"], [1234, 5678], []),
    (["1,234", "5,67"], [1.234, 5.67], []),
    (["0,123", "1,234"], [0.123, 1.234], []),
    (["1,234", "1.234", "5"], [NAN, NAN, 5], [0, 1]),
    (["1,234", "1.234", "5.5"], [1234, 1.234, 5.5], []),
    (["1.5", "5,67", "1,234", "3.25"], [1.5, NAN, NAN, 3.25], [1, 2]),
    (["1 234", "1\u00a0234\u00a0567", "1\u202f234,5"], [1234, 1234567, 1234.5], []),
    (["1'234.5", "1\u2019000"], [1234.5, 1000], []),
    (["\u22125", "\u22121.5"], [-5, -1.5], []),
    (["12%", "3 %", ""], [12, 3, NAN], []),
    (["$3", "$ 4.5", "NA"], [3, 4.5, NAN], []),
    (["3 €", "1.234,5€"], [3, 1234.5], []),
    (["12%", "0.12"], [NAN, 0.12], [0]),
    (["$3", "€3"], [3, NAN], [1]),
    (["57.05N", "10 S", "3°N"], [57.05, -10, 3], []),
    (["10.33E", "2W"], [10.33, -2], []),
    (["10.33E", "-2W"], [10.33, NAN], [1]),
    (["1_000", "5"], [NAN, 5], [0]),
    (["0x10", "inf", "-Infinity", "1e999", "5"], [NAN, NAN, NAN, NAN, 5], [0, 1, 2, 3]),
    (["1,23,456", "12,34,5", "1..2", "1e", "e5", "--1", "+-1", "1 2"], [NAN] * 8, list(range(8))),
    (["1,234e5", "2"], [123400, 2], []),
    (["\u0661\u0662", "5"], [NAN, 5], [0]),
    (["=1+2", "@SUM(A1)", "-A1", "5"], [NAN, NAN, NAN, 5], [0, 1, 2]),
]


@pytest.mark.parametrize(("cells", "numbers", "bad"), COLUMNS)
def test_numbers_as_people_write_them(cells, numbers, bad):
    read = read_column(cells, separator=",")
    np.testing.assert_array_equal(read.values, numbers)
    assert read.bad.tolist() == bad
    # Spaces around a cell and repeated cells change nothing.
    again = read_column([f" {cell}\t" for cell in cells] * 2, separator=",")
    np.testing.assert_array_equal(again.values, numbers * 2)
    assert again.bad.tolist() == bad + [i + len(cells) for i in bad]


def test_what_may_mean_two_numbers_is_not_read(table):
    read = table("v\tw\n1,234\t1\n5,678\t2\n")
    assert read.numbers("v")[1].count == 2
    assert '"1,234" (it may mean 1234 or 1.234)' in str(read.numbers("v")[1])
    assert table("v;w\n1,234;1\n").columns["v"].tolist() == [1.234]
    assert 'column "v": 1,234 is read as 1.234' in table("v;w\n1,234;1\n").notes
    assert 'column "v": 1,234 is read as 1234' in table('v,w\n"1,234",1\n').notes


@pytest.mark.parametrize("word", sorted(MISSING | OFTEN_MISSING))
@pytest.mark.parametrize("other", ["1.5", "1,5", "x"])
def test_missing_values(word, other):
    read = read_column([word, other, f" {word.upper()} "])
    assert np.isnan(read.values[[0, 2]]).all() and read.bad.tolist() == ([1] if other == "x" else [])
    assert word.casefold() in MISSING


def test_codes_and_a_country_of_two_letters_stay_texts(table):
    read = table("code,id,country,month\n08001,12345678901234567,NA,01\n43201,12345678901234568,NA,12\n")
    assert read.texts("code").tolist() == ["08001", "43201"] and read.numbers("code")[0].tolist() == [8001, 43201]
    assert read.texts("id").tolist() == ["12345678901234567", "12345678901234568"]
    assert read.texts("country").tolist() == ["NA", "NA"] and not read.numbers("country")[1]
    assert read.numbers("month")[0].tolist() == [1, 12]


def test_text_where_numbers_belong(table):
    read = table("a,b\n1,=1+2\n2,@SUM(A1)\n3,7\n" + "4,x\n" * 5)
    values, problems = read.numbers("b")
    np.testing.assert_array_equal(values, [NAN, NAN, 7] + [NAN] * 5)
    assert problems.count == 7 and [cell.line for cell in problems.cells] == [2, 3, 5, 6, 7]
    assert [cell.row for cell in problems.cells] == [0, 1, 3, 4, 5]
    assert str(problems) == (
        'column "b": 7 cells hold text where numbers belong: line 2 "=1+2" (a formula, not its result), '
        'line 3 "@SUM(A1)" (a formula, not its result), line 5 "x", line 6 "x", line 7 "x", and 2 more; '
        "write numbers, or leave such cells empty"
    )
    assert 'line 2 "1_000" (an underscore)' in str(table("v\n1_000\n2\n").numbers("v")[1])
    assert "write decimal degrees" in str(table("lat\n41°23'\n2\n").numbers("lat")[1])
    assert 'row 1 "inf"' in str(Table(["v"], {"v": np.array([1, np.inf])}).numbers("v")[1])


def test_an_unknown_column_has_near_names(table):
    read = table("lon,lat,rain\n1,2,3\n")
    assert 'there is no column "Rain"; did you mean "rain"? (one of lon, lat, rain)' in refusal(read.numbers, "Rain")
    assert 'no column "a\\nb"' in refusal(read.texts, "a\nb")


def test_names_of_columns(table):
    read = table("a,a,,b,\n1,2,3,4,\n")
    assert read.names == ["a (1)", "a (2)", "column 3", "b"]
    assert 'the column "a" is there 2 times: a (1), a (2)' in read.notes and "column 3" in read.notes[0]
    assert table('a,a,a (1)," x\ny "\n1,2,3,4\n').names == ["a (2)", "a (3)", "a (1)", "x y"]
    read = table("2.17,41.38\n10.7,59.9\n")
    assert read.names == ["column 1", "column 2"] and read.columns["column 2"].tolist() == [41.38, 59.9]
    assert "line 1 holds numbers: there is no header" in read.notes[0] and read.where.tolist() == [1, 2]
    assert table("Country,1990,1991\nSpain,1,2\n").names == ["Country", "1990", "1991"]


def test_lines_before_the_header(table):
    read = table("# by hand\n\n#, again\nlon,lat\n1,2\n")
    assert read.names == ["lon", "lat"] and read.where.tolist() == [5]
    assert read.notes == ["2 comment lines before the header skipped"]
    read = table("# of 2024\n#lon,lat\n1,2\n3,4\n")
    assert read.names == ["lon", "lat"] and "line 2 is read as the header" in read.notes[0]
    assert table("# Source: me, you\n1,2\n").names == ["column 1", "column 2"]
    read = table(
        '"Data Source","World",\n\n"Updated","2024",\n\nCountry,Code,1990,1991\n"Spain","ESP","1",2\n"Peru","","2",3'
    )
    assert read.names == ["Country", "Code", "1990", "1991"] and read.where.tolist() == [6, 7]
    assert read.notes == ['4 lines before the header skipped, beginning with "Data Source"']
    read = table('"Rain\n\nin Europe"\n\nlon,lat\n1,2\n')
    assert read.names == ["lon", "lat"] and read.where.tolist() == [6] and "4 lines before" in read.notes[0]
    assert table("sep=;\na;b\n1;2\n").where.tolist() == [3]
    # A header that lacks a name is no title.
    assert "2 rows do not have the 1 cells" in refusal(table, "x\n1,2\n3,4\n")


def test_rows_without_values_and_empty_cells_at_the_end(table):
    read = table("a,b\n1,2\n\n,\n3,4,,\n , \n")
    assert read.columns["a"].tolist() == [1, 3] and read.where.tolist() == [2, 5]
    assert read.notes == ["2 rows without any value skipped", "1 row with empty cells at the end"]


def test_encodings(table):
    text = "city,rain\nMálaga,5\nŁódź,6\n"
    for encoding in ("utf-8", "utf-8-sig", "utf-16", "utf-32"):
        assert table(text, encoding=encoding).texts("city").tolist() == ["Málaga", "Łódź"]
        assert not table(text, encoding=encoding).notes
    read = table("city,rain\nVic,1\nMálaga,5\n", encoding="cp1252")
    assert read.texts("city").tolist() == ["Vic", "Málaga"]
    assert read.notes == ['is not UTF-8; it is read as Windows-1252, which makes line 3 "Málaga,5"']


def test_texts_in_a_wrong_encoding_are_noted(table):
    right = ["Málaga", "Łódź", "São Paulo", "Ñuñoa", "Ångström \u2013 x", "Ã", "東京"]
    text = "city,rain\n" + "".join(f"{city},1\n" for city in right)
    assert not table(text).notes
    for city in ("Málaga", "Łódź", "東京", "naïve €"):
        wrong = city.encode().decode("cp1252", "ignore")
        read = table(f"city,rain\nVic,1\n{wrong},2\n")
        # Windows-1252 lacks some bytes of the last two.
        assert (f"looks like {city!r}" in "".join(read.notes)) == (wrong.encode("cp1252") == city.encode())
    assert "looks like 'Málaga'" in table("city,rain\nMÃ¡laga,1\n").notes[0]


@pytest.mark.slow
def test_encodings_of_large_files(tmp_path):
    """Characters may lie across the parts that are read at once, and faults far behind."""
    path = tmp_path / "a.csv"
    rows = "a,b\n" + "Łódź,1\n" * 300_000
    path.write_text(rows)
    assert set(read_table(path).texts("a")) == {"Łódź"}
    path.write_bytes(rows.encode() + "Málaga,2\n".encode("cp1252"))
    assert 'UTF-8 in line 2, and another one in line 300002 "Málaga,2"' in refusal(read_table, path)


# Contents that are refused, and a part of the message.
REFUSED = [
    ("", "the file is empty"),
    (" \n\n", "the file is empty"),
    ("\ufeff", "the file is empty"),
    ("lon,lat\n", "has a header (lon, lat) and no rows"),
    ("# only\n# comments\n", "no rows"),
    ("a,b\n,\n", "no rows"),
    ("a;b\n1;2;3\n4\n5;6\n", 'line 2 has 3 ("1;2;3"), line 3 has 1 ("4")'),
    ("a,b\n" + "1\n" * 7, "7 rows do not have the 2 cells of the header"),
    ("1,2\n3\n", "the 2 cells of the first row"),
    ('a,b\n1,"2\n3,4\n', "line 2: a quote is opened and never closed"),
    ('a,b\n1,2\n"1"x,4\n', "line 3: text follows a closing quote"),
    (f"a,b\n1,2\n{'x' * 200_000},4\n", "line 3: a cell has more than 131,072 characters"),
    ("lon lat v\n1 2 3\n4 5 6\n", "the cells are separated by spaces"),
    ('{"type": "Feature"}', "looks like JSON"),
    ("<!DOCTYPE html>", "is a web page"),
    ("a,b\n1,2\n".encode("utf-16-le"), "UTF-16 without a byte order mark"),
    (b"a,b\n1,\0\n", "line 2: holds a NUL character"),
    ("a\ná\n".encode() + "á\n".encode("cp1252"), 'UTF-8 in line 2, and another one in line 3 "á"'),
    (b"a\n1\n\x81\n", "line 3: is neither UTF-8 nor Windows-1252"),
    (b"\xff\xfea", "is not UTF-16, as the file's first bytes say"),
    (b"\xef\xbb\xbfa\n\xe1\n", "line 2: is not UTF-8, as the file's first bytes say"),
    *((magic + b"abc\n1\n", said) for magic, said in OTHERS.items()),
]


@pytest.mark.parametrize(("content", "said"), REFUSED)
def test_refused(table, content, said):
    line = refusal(table, content)
    assert said in line and "a.csv: " in line and len(line) < 600


def test_rows_of_another_length_are_listed_up_to_five(table):
    line = refusal(table, "a,b\n" + "1\n" * 7)
    assert line.count(" has 1 ") == LISTED and "and 2 more" in line


def test_paths_that_are_no_tables(tmp_path):
    assert "there is no such file" in refusal(read_table, tmp_path / "a.csv")
    (tmp_path / "rain.csv").write_text("a\n1\n")
    assert "did you mean" in refusal(read_table, tmp_path / "rian.csv")
    assert "is a folder" in refusal(read_table, tmp_path)
    (tmp_path / "a.xlsx").write_text("x")
    line = refusal(read_table, tmp_path / "a.xlsx")
    assert all(suffix in line for suffix in READERS)
    assert "cannot be read" in refusal(read_table, "a\0.csv")


def test_a_table_that_does_not_fit_into_memory(table, monkeypatch):
    monkeypatch.setattr(memory, "free", lambda: memory.Free(1000, "are free"))
    assert "about 1,000 rows of 2 columns take about" in refusal(table, "a,b\n" + "1,2\n" * 1000)
    assert "0.0 GiB are free" in refusal(table, "a,b\n" + "1,2\n" * 1000)


def parts_read(cells: list[str], cuts: list[int], separator: str, other: str) -> tuple:
    """A column that is read in parts, beside another column that shows a decimal mark."""
    bounds = [0, *sorted(min(cut, len(cells)) for cut in cuts), len(cells)]
    parts = [cells[a:b] for a, b in pairwise(bounds) if a < b]
    columns = [Column(0, separator), Column(1, separator)]

    def again(wanted):
        for column in wanted:
            for part in parts:
                column.add(part if column.index == 0 else [other] * len(part))

    again(columns)
    return columns_of(columns, again)


def slowly_read(cells: list[str], separator: str, other: str) -> tuple:
    """The same, from texts only."""
    columns = [Column(0, separator, texts=list(cells)), Column(1, separator, texts=[other] * len(cells))]
    return columns_of(columns, lambda wanted: pytest.fail("texts are read once"))


numbers = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.integers(-(10**7), 10**7).map(str),
    st.from_regex(r"[+-]?[0-9]{1,4}[.,][0-9]{1,4}", fullmatch=True),
    st.from_regex(r"[1-9][0-9]{0,2}([.,][0-9]{3}){1,2}", fullmatch=True),
    st.sampled_from(["007", "-0", "00", "1e999", "12345678901234567", ".5", "5.", "", "", "-", "NA", "nan", "1e5"]),
)
odd = st.one_of(
    numbers,
    st.text("0123456789.,eE+-", max_size=6),
    st.sampled_from(["x", " 1", "1_0", "5 %", "$5", "1 000", "n/a", "\u2212" + "5", "5N", "=1"]),
)


@settings(max_examples=60, derandomize=True, deadline=None)
@given(
    st.one_of(st.lists(numbers, min_size=1, max_size=8), st.lists(odd, min_size=1, max_size=8)),
    st.lists(st.integers(0, 8), max_size=2),
    st.sampled_from(sorted(SEPARATORS)),
    st.sampled_from(["x", "1.5", "1,5", "3"]),
)
def test_the_fast_way_is_the_slow_way(cells, cuts, separator, other):
    (fast, fast_decimal, fast_notes), (slow, slow_decimal, slow_notes) = (
        parts_read(cells, cuts, separator, other),
        slowly_read(cells, separator, other),
    )
    assert fast_decimal == slow_decimal and fast_notes == slow_notes
    for a, b in zip(fast, slow):
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
        if a.dtype == float:
            np.testing.assert_array_equal(np.signbit(a), np.signbit(b))


@settings(max_examples=100, derandomize=True, deadline=None)
@given(
    st.lists(st.tuples(st.text("ab,;|\t\"'\n\r #é", max_size=5), st.floats(allow_nan=False, allow_infinity=False))),
    st.sampled_from(sorted(SEPARATORS)),
)
def test_what_the_csv_module_writes_is_read(tmp_path_factory, rows, separator):
    rows = [("Vic", 1.5), *rows]
    text = io.StringIO(newline="")
    csv.writer(text, delimiter=separator, quoting=csv.QUOTE_ALL).writerows([("name", "value"), *rows])
    path = tmp_path_factory.mktemp("csv") / "a.csv"
    path.write_text(text.getvalue(), encoding="utf-8", newline="")
    read = read_table(path)
    assert read.separator == separator
    assert read.texts("name").tolist() == [name for name, _ in rows]
    assert read.numbers("value")[0].tolist() == [value for _, value in rows]


def test_rows_are_read_in_parts(tmp_path, monkeypatch):
    """Parts of two rows: a column that becomes text late, one with a comma late, and lines in quotes."""
    path = tmp_path / "a.csv"
    path.write_text('a;b;c;d\n1;1;"x\n";5.123\n2;2;y;6.124\n\n3;3,5;"z\n\n";7.125\n4;4;w;8.126\n5x;5;v;9.127\n;;;\n')
    whole = read_table(path)
    for chunk in (1, 2, 3):
        monkeypatch.setattr(csv_file, "CHUNK", chunk)
        read = read_table(path)
        assert read.notes == whole.notes and read.dialect == whole.dialect
        assert read.where.tolist() == whole.where.tolist() == [2, 4, 6, 9, 10]
        assert {k: v.tolist() for k, v in read.columns.items()} == {k: v.tolist() for k, v in whole.columns.items()}
    assert whole.texts("a").tolist() == ["1", "2", "3", "4", "5x"] and whole.columns["b"].tolist() == [1, 2, 3.5, 4, 5]
    assert whole.columns["d"].tolist() == [5123, 6124, 7125, 8126, 9127]


HORRORS = st.text(st.sampled_from(list("ab01.,;\t|\"'\n\r #=-+eEN%$_é\u2212\u00a0\x00\x0b\u2028\ufeff")), max_size=40)


@settings(max_examples=200, derandomize=True, deadline=None)
@given(st.one_of(HORRORS, HORRORS.map(lambda t: "lon,lat,v\n" + t)), st.sampled_from(["utf-8", "utf-16", "cp1252"]))
def test_any_text_is_a_table_or_an_error_of_one_line(tmp_path_factory, text, encoding):
    path = tmp_path_factory.mktemp("any") / "a.csv"
    path.write_bytes(text.encode(encoding, "replace"))
    try:
        read = read_table(path)
    except UserError as error:
        assert len(error.lines) == 1 and error.lines[0].isprintable() and error.lines[0].startswith(str(path))
        return
    assert len(read) == len(read.where) > 0 and len(set(read.names)) == len(read.names)
    assert all(np.diff(read.where) > 0) and all(note.isprintable() for note in read.notes)
    for name in read.names:
        values, problems = read.numbers(name)
        assert len(values) == len(read.texts(name)) == len(read) and not np.isinf(values).any()
        assert str(problems).isprintable()
    assert json.loads(json.dumps(describe(read))) == describe(read)


@pytest.mark.parametrize("lon", [name for group in LONGITUDES for name in group])
@pytest.mark.parametrize("style", [str, str.upper, str.title, lambda name: f" {name[:3]}_{name[3:]} "])
def test_columns_of_positions_are_found_by_usual_names(lon, style):
    lat = next(name for group in LATITUDES for name in group if group[0][0] == "l" or lon == "x")
    read = Table([style(lon), "z", style(lat)], {style(lon): np.zeros(1), "z": np.zeros(1), style(lat): np.zeros(1)})
    assert position_columns(read) == (style(lon), style(lat))


def test_columns_of_positions_that_are_not_found():
    def of(*names):
        return Table(list(names), {name: np.zeros(1) for name in names}, path="a.csv")

    assert position_columns(of("x", "y", "lon", "lat")) == ("lon", "lat")
    assert position_columns(of("X", "Y")) == ("X", "Y")
    line = refusal(position_columns, of("lon", "Longitude", "lat"))
    assert line == 'a.csv: the columns "lon" and "Longitude" may hold the longitude; say which one'
    for text in ("POINT (2.17 41.38)", "(41.38, 2.17)", "41.38,2.17", "SRID=4326;POINT(2.17 41.38)"):
        read = Table(["a", "where"], {"a": as_texts(["x", "y"]), "where": as_texts(["", text])})
        assert f'the column "where" holds both coordinates in one text, "{text}"' in refusal(position_columns, read)
    assert "one of easting, lat" in refusal(position_columns, of("easting", "lat"))


def test_ranges(table):
    read = table("x,y\n95,2\n5,91\n-200,4\n,\n360,-90\n")
    lon, lat = read.columns["x"], read.columns["y"]
    assert out_of_range(read, lon, lat) == [
        "1 longitude is not between -180 and 360: line 4 has -200; write degrees",
        "1 latitude is not between -90 and 90: line 3 has 91; write degrees",
    ]
    assert not swapped(lon, lat) and swapped(np.array([41.0, 35]), np.array([2.0, 139]))
    assert not swapped(np.array([41.0, NAN]), np.array([2.0, 3])) and not swapped(lon, np.full(4, 4581234.0))
    metres = out_of_range(Table(["x"], {"x": lon}), np.full(6, 431234.0), np.full(6, 4581234.0))
    assert len(metres) == 2 and all("they look projected" in text and "and 1 more" in text for text in metres)
    found = 'longitudes are in the column "x", latitudes in "y"'
    assert position_notes(read) == [found, *out_of_range(read, lon, lat)]
    assert position_notes(table("x,y\n41,2\n35,139\n")) == [found, swapped(np.array([41.0, 35]), np.array([2.0, 139]))]
    assert position_notes(table("x,y\nb,2\n35,4\n"))[1].startswith('column "x": 1 cell holds text')
    assert position_notes(table("a,b\n1,2\n")) == ["no column is named like a longitude; say which one (one of a, b)"]


def test_describe(table):
    read = table("city,rain,odd,none\nVic,1,1,\nVic,2.5,x,\nReus,,3,\n,4,4,\n")
    records = {record["column"]: record for record in describe(read)}
    assert records["city"] == {
        "column": "city", "kind": "texts", "count": 3, "missing": 1, "min": None, "max": None, "mean": None,
        "first": None, "last": None, "distinct": 2, "examples": ["Vic", "Reus"], "problem": None,
    }  # fmt: skip
    assert records["rain"] == {
        "column": "rain", "kind": "numbers", "count": 3, "missing": 1, "min": 1, "max": 4, "mean": 2.5,
        "first": None, "last": None, "distinct": 3, "examples": [1, 2.5, 4], "problem": None,
    }  # fmt: skip
    assert records["odd"]["kind"] == "mixed" and 'line 3 "x"' in records["odd"]["problem"]
    assert records["odd"]["mean"] == pytest.approx(8 / 3) and records["odd"]["count"] == 4
    assert records["none"]["kind"] == "empty" and records["none"]["missing"] == 4
    large = describe(Table(["v"], {"v": np.full(3, 1e308)}))
    assert large[0]["mean"] == 1e308


def test_texts_of_numbers():
    read = Table(["v"], {"v": np.array([1, -2.5, NAN, 1e300, 2.0**60, -0.0])})
    assert read.texts("v").tolist() == ["1", "-2.5", "", "1e+300", "1.152921504606847e+18", "0"]
    read = Table(["v"], {"v": as_texts(["a", "", "1"])})
    assert read.texts("v").tolist() == ["a", "", "1"] and read.place(2) == "row 2"
    assert re.fullmatch(r"[^\w,.;]+", UNITS + NEUTRAL)
