"""Tables of Python objects: dicts, arrays, data frames and labelled grids of any library, by what they offer."""

import datetime
from dataclasses import dataclass, field
from decimal import Decimal
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from visray import memory
from visray.data.frames import table_of
from visray.data.interchange import BITS, BYTES, SENTINEL, UNITS
from visray.data.layer import DataLayer
from visray.data.source import TableValue
from visray.data.table import Table
from visray.errors import UserError

NAN = float("nan")
DAYS = [datetime.datetime(2020, 1, day) for day in (1, 2, 3)] + [None]
COLUMNS = {
    "city": ["a", "b", None, "Ω"],
    "lon": [1.5, 2.5, None, 3.0],
    "n": [1, None, 3, 4],
    "flag": [True, False, True, None],
    "day": DAYS,
}


def refusal(obj: Any) -> str:
    """The message of the UserError for an object: it must be one line."""
    with pytest.raises(UserError) as caught:
        table_of(obj)
    (line,) = caught.value.lines
    assert line.isprintable() and line.startswith("the table: ") and len(line) < 600
    return line


def check(read: Table, rows: slice = slice(None)) -> None:
    """Asserts that a table holds COLUMNS."""
    assert read.texts("city").tolist() == ["a", "b", "", "Ω"][rows]
    for name, wanted in (("lon", [1.5, 2.5, NAN, 3]), ("n", [1, NAN, 3, 4]), ("flag", [1, 0, 1, NAN])):
        assert read.columns[name].dtype == np.float64
        np.testing.assert_array_equal(read.columns[name], wanted[rows])
    days = [text.removesuffix("T00:00:00").removesuffix("T00:00:00.000000") for text in read.texts("day").tolist()]
    assert days == ["2020-01-01", "2020-01-02", "2020-01-03", ""][rows]
    assert len(read) == len(days) and read.where is None


def test_dicts_and_records():
    check(table_of(COLUMNS))
    check(table_of([dict(zip(COLUMNS, row)) for row in zip(*COLUMNS.values())]))
    read = table_of([{"a": 1, "b": "x"}, {"a": 2, "c": 3}])
    assert read.columns["a"].tolist() == [1, 2] and read.texts("b").tolist() == ["x", ""]
    assert table_of(read) is read


def test_arrays():
    rows = np.array([(1, 2.5, "q"), (2, 3.5, "r")], dtype=[("a", int), ("b", np.float32), ("c", "U3")])
    read = table_of(rows)
    assert read.columns["a"].tolist() == [1, 2] and read.columns["b"].tolist() == [2.5, 3.5]
    assert read.texts("c").tolist() == ["q", "r"]
    masked = table_of({"a": np.ma.array([1, 2, 3], mask=[0, 1, 0]), "b": np.ma.array(["x", "y", "z"], mask=[0, 1, 0])})
    np.testing.assert_array_equal(masked.columns["a"], [1, NAN, 3])
    assert masked.texts("b").tolist() == ["x", "", "z"]
    structured = np.ma.array(rows, mask=[(0, 1, 0), (0, 0, 1)])
    np.testing.assert_array_equal(table_of(structured).columns["b"], [NAN, 3.5])
    for dtype in (np.int8, np.uint16, np.float16, np.longdouble, bool):
        assert table_of({"a": np.array([0, 1], dtype)}).columns["a"].tolist() == [0, 1]
    dates = np.array(["2020-01-01", "NaT"], "M8[ns]")
    assert table_of({"a": dates}).texts("a").tolist() == ["2020-01-01", ""]
    assert table_of({"a": dates + np.timedelta64(1, "s")}).texts("a").tolist() == ["2020-01-01T00:00:01", ""]


def test_values_of_other_types():
    read = table_of({"a": [Decimal("1.5"), np.float32(2), None], "b": ["x", 1, None], "c": [2**60, 1, None]})
    np.testing.assert_array_equal(read.columns["a"], [1.5, 2, NAN])
    assert table_of({"a": ["\ud800é"]}).texts("a").tolist() == ["\\ud800é"]
    assert read.texts("b").tolist() == ["x", "1", ""] and read.texts("c").tolist() == [str(2**60), "1", ""]
    assert read.notes == ["column \"b\": it holds numbers and other values, such as 'x' in row 0; all are texts"]
    whole = table_of({"a": np.array([2**60, 1])})
    assert whole.texts("a").tolist() == [str(2**60), "1"] and whole.numbers("a")[0].tolist() == [2.0**60, 1]
    values, problems = table_of({"a": [np.inf, 1.0]}).numbers("a")
    np.testing.assert_array_equal(values, [NAN, 1])
    assert problems.count == 1 and problems.cells[0].row == 0


class Broken:
    """Looks like a data frame, and fails when it is read."""

    columns = ("a",)

    def __getitem__(self, name: str) -> Any:
        raise RuntimeError("two\nlines")


# Objects that are refused, and a part of the message.
REFUSED = [
    ({"a": [1, 2], "b": [1]}, 'different lengths ("a" has 2, "b" has 1)'),
    ({"a": np.zeros((2, 2))}, 'column "a" has the shape (2, 2)'),
    ({"a": 3}, 'column "a" has the shape ()'),
    ({"a": "text"}, 'column "a" has the shape ()'),
    ({"a": 1j * np.ones(2)}, 'column "a" has the type complex128'),
    ({}, "has no columns"),
    ({"a": []}, "has no rows"),
    ({1: [1], "1": [2]}, 'the column "1" is there twice'),
    (3, "int is no table"),
    (None, "NoneType is no table"),
    ("a.csv", "str is no table"),
    ([1, 2], "list is no table"),
    (np.zeros((3, 2)), "ndarray is no table"),
    (Broken(), "RuntimeError: two lines"),
    (SimpleNamespace(columns=["a"], collect=lambda: None), "give obj.collect()"),
]


@pytest.mark.parametrize(("obj", "said"), REFUSED)
def test_refused(obj, said):
    assert said in refusal(obj)


@dataclass
class Frame:
    """Stands for a data frame: names and columns, each of which NumPy can read."""

    held: dict[str, Any]
    index: Any = None

    @property
    def columns(self) -> list[str]:
        return list(self.held)

    def __getitem__(self, name: str) -> Any:
        return self.held[name]


def test_frames_by_what_they_offer():
    check(table_of(Frame(COLUMNS)))
    named = np.array(["p", "q", "r", "s"]).view(type("Index", (np.ndarray,), {"name": "city"}))
    read = table_of(Frame({"n": [1, 2, 3, 4]}, named))
    assert read.names == ["city", "n"] and read.texts("city").tolist() == ["p", "q", "r", "s"]


@dataclass
class Buffer:
    """A buffer of the interchange protocol."""

    held: np.ndarray

    @property
    def ptr(self) -> int:
        return self.held.ctypes.data

    @property
    def bufsize(self) -> int:
        return self.held.nbytes


@dataclass
class Chunk:
    """A column of the interchange protocol."""

    data: np.ndarray
    dtype: tuple
    count: int
    offset: int = 0
    describe_null: tuple = (0, None)
    validity: np.ndarray | None = None
    offsets: np.ndarray | None = None
    data_dtype: tuple | None = None
    describe_categorical: dict = field(default_factory=dict)
    parts: int = 1

    def size(self) -> int:
        return self.count

    def get_buffers(self) -> dict:
        offsets = None if self.offsets is None else (Buffer(self.offsets), (0, self.offsets.itemsize * 8, "l", "="))
        validity = None if self.validity is None else (Buffer(self.validity), (20, 8, "b", "="))
        return {"data": (Buffer(self.data), self.data_dtype or self.dtype), "validity": validity, "offsets": offsets}

    def get_chunks(self) -> list["Chunk"]:
        return [self] * self.parts


@dataclass
class Interchange:
    """A data frame that offers only the interchange protocol."""

    held: dict[str, Chunk]

    def __dataframe__(self, nan_as_null: bool = False, allow_copy: bool = True) -> "Interchange":
        return self

    def column_names(self) -> list[str]:
        return list(self.held)

    def get_column_by_name(self, name: str) -> Chunk:
        return self.held[name]


def read_column(chunk: Chunk) -> np.ndarray:
    """The column of a data frame that offers only the interchange protocol."""
    return table_of(Interchange({"a": chunk})).columns["a"]


NUMBERS = [("i1", 0), ("i2", 0), ("i4", 0), ("i8", 0), ("u1", 1), ("u2", 1), ("u4", 1), ("u8", 1), ("f4", 2), ("f8", 2)]


@pytest.mark.parametrize(("dtype", "kind"), NUMBERS)
@pytest.mark.parametrize("offset", [0, 3, 9])
def test_interchange_numbers_and_masks(dtype, kind, offset):
    data = np.arange(offset + 5).astype(dtype)
    wanted = np.arange(offset, offset + 5).astype(float)
    form = (kind, data.itemsize * 8, "x", "=")
    np.testing.assert_array_equal(read_column(Chunk(data, form, 5, offset)), wanted)
    np.testing.assert_array_equal(read_column(Chunk(data, form, 5, offset, parts=2)), np.tile(wanted, 2))
    missing = np.zeros(offset + 5, bool)
    missing[[offset + 1, offset + 4]] = True
    gone = np.where(missing[offset:], NAN, wanted)
    for mark in (0, 1):
        mask = missing if mark else ~missing
        bits = np.packbits(mask, bitorder="little")
        np.testing.assert_array_equal(read_column(Chunk(data, form, 5, offset, (BITS, mark), bits)), gone)
        np.testing.assert_array_equal(read_column(Chunk(data, form, 5, offset, (BYTES, mark), mask.view("u1"))), gone)
    np.testing.assert_array_equal(
        read_column(Chunk(data, form, 5, offset, (SENTINEL, offset + 2))), np.where(wanted == offset + 2, NAN, wanted)
    )
    np.testing.assert_array_equal(read_column(Chunk(data, form, 5, offset, (BITS, 0), None)), wanted)


def test_interchange_booleans_texts_dates_and_categories():
    bits = np.packbits([0, 1, 1, 0, 1, 1], bitorder="little")
    assert read_column(Chunk(bits, (20, 1, "b", "="), 4, 2)).tolist() == [1, 0, 1, 1]
    assert read_column(Chunk(np.array([1, 0, 1], "u1"), (20, 8, "b", "="), 2, 1)).tolist() == [0, 1]
    letters = np.frombuffer("abΩc".encode(), "u1").copy()
    for width in ("i4", "i8"):
        places = np.array([0, 1, 4, 4, 5], width)
        texts = Chunk(letters, (21, 8, "u", "="), 3, 1, (BITS, 0), np.array([0b1011], "u1"), places)
        assert read_column(texts).tolist() == ["bΩ", "", "c"]
    for letter, unit in UNITS.items():
        stored = np.array(["2020-01-01", "NaT", "2021-05-06"], f"M8[{unit}]").view("i8")
        null = (SENTINEL, np.iinfo("i8").min)
        assert read_column(Chunk(stored, (22, 64, f"ts{letter}:", "="), 3, 0, null)).tolist() == [
            "2020-01-01",
            "",
            "2021-05-06",
        ]
    days = np.array([0, 366], "i4")
    assert read_column(Chunk(days, (22, 32, "tdD", "="), 2)).tolist() == ["1970-01-01", "1971-01-02"]
    categories = Chunk(letters, (21, 8, "u", "="), 2, 0, offsets=np.array([0, 2, 5], "i4"))
    codes = np.array([1, -1, 0], "i1")
    described = {"is_ordered": False, "is_dictionary": True, "categories": categories}
    chunk = Chunk(
        codes, (23, 8, "c", "="), 3, 0, (SENTINEL, -1), data_dtype=(0, 8, "c", "="), describe_categorical=described
    )
    assert read_column(chunk).tolist() == ["Ωc", "", "ab"]


def test_interchange_that_cannot_be_read():
    assert "too few for 5 values" in refusal(Interchange({"a": Chunk(np.zeros(3), (2, 64, "g", "="), 5)}))
    assert "a type that visray does not read" in refusal(Interchange({"a": Chunk(np.zeros(3), (99, 64, "?", "="), 3)}))


def labelled(dims: tuple, values: np.ndarray, coords: dict, name: str | None = None) -> SimpleNamespace:
    """Stands for a DataArray."""
    return SimpleNamespace(dims=dims, values=values, coords=coords, name=name)


def test_labelled_grids():
    lat = labelled(("lat",), np.array([10.0, 20.0]), {})
    lon = labelled(("lon",), np.array([0.0, 120.0, 240.0]), {})
    rain = np.arange(6.0).reshape(2, 3)
    rain[1, 1] = NAN
    coords = {"lat": lat, "lon": lon, "month": labelled((), np.array(7), {})}
    read = table_of(labelled(("lat", "lon"), rain, coords, "rain"))
    assert read.names == ["lat", "lon", "month", "rain"] and read.columns["month"].tolist() == [7] * 6
    assert read.columns["lat"].tolist() == [10] * 3 + [20] * 3 and read.columns["lon"].tolist() == [0, 120, 240] * 2
    np.testing.assert_array_equal(read.columns["rain"], rain.ravel())
    # Dimensions in another order, and one without a coordinate.
    height = labelled(("lon", "level", "lat"), np.arange(12).reshape(3, 2, 2), {})
    dataset = SimpleNamespace(
        dims=(), coords=coords, data_vars={"rain": labelled(("lat", "lon"), rain, coords), "height": height}
    )
    read = table_of(dataset)
    assert len(read) == 12 and read.columns["level"].tolist() == [0, 1] * 6
    for i in range(12):
        at = {name: read.columns[name][i] for name in read.names}
        y, x = [10, 20].index(at["lat"]), [0, 120, 240].index(at["lon"])
        assert at["height"] == height.values[x, int(at["level"]), y]
        np.testing.assert_array_equal(at["rain"], rain[y, x])
    assert "has no variables" in refusal(SimpleNamespace(dims=(), coords={}, data_vars={}))


def test_a_grid_that_does_not_fit_into_memory(monkeypatch):
    monkeypatch.setattr(memory, "free", lambda: memory.Free(10_000, "are free"))
    line = refusal(labelled(("y", "x"), np.zeros((100, 100)), {}))
    assert "10,000 rows of 3 columns" in line and "select a part of the dimensions (y, x)" in line


def test_objects_with_geography():
    point = SimpleNamespace(__geo_interface__={"type": "Point", "coordinates": (2.0, 41.0)})
    assert table_of(point).columns["lon"].tolist() == [2]
    point.crs = SimpleNamespace(to_epsg=lambda: 3857)
    assert "give obj.to_crs(4326)" in refusal(point)
    assert table_of({"type": "Point", "coordinates": [2, 41]}).columns["lat"].tolist() == [41]


def test_pandas():
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(COLUMNS)
    for same in (
        frame,
        frame.convert_dtypes(),
        frame.assign(city=frame["city"].astype("category")),
        frame.set_index("city"),
    ):
        check(table_of(same))
    assert "there twice" in refusal(pandas.DataFrame([[1, 2]], columns=["a", "a"]))


def test_polars():
    polars = pytest.importorskip("polars")
    check(table_of(polars.DataFrame(COLUMNS)))
    assert "give obj.collect()" in refusal(polars.DataFrame(COLUMNS).lazy())


def test_arrow():
    arrow = pytest.importorskip("pyarrow")
    whole = arrow.table(COLUMNS)
    only = SimpleNamespace(__dataframe__=whole.__dataframe__)
    check(table_of(whole))
    check(table_of(only))
    check(table_of(SimpleNamespace(__dataframe__=whole.slice(1, 2).__dataframe__)), slice(1, 3))
    check(
        table_of(SimpleNamespace(__dataframe__=arrow.concat_tables([whole.slice(0, 1), whole.slice(1)]).__dataframe__))
    )
    words = arrow.table({"a": arrow.array(["u", None, "v", "u"]).dictionary_encode()})
    assert table_of(SimpleNamespace(__dataframe__=words.__dataframe__)).texts("a").tolist() == ["u", "", "v", "u"]


def test_xarray():
    xarray = pytest.importorskip("xarray")
    coords = {"lat": [10, 20], "lon": [0, 120, 240], "time": np.array(["2020-01", "2020-02"], "M8[ns]")}
    rain = np.arange(12.0).reshape(2, 2, 3)
    dataset = xarray.Dataset(
        {"rain": (("time", "lat", "lon"), rain), "land": (("lat", "lon"), np.ones((2, 3)))}, coords
    )
    for obj in (dataset, dataset["rain"]):
        read = table_of(obj)
        np.testing.assert_array_equal(read.columns["rain"], rain.ravel())
        assert read.columns["lon"].tolist() == [0, 120, 240] * 4
        assert read.texts("time").tolist() == ["2020-01-01"] * 6 + ["2020-02-01"] * 6


def test_geopandas():
    geopandas, shapely = pytest.importorskip("geopandas"), pytest.importorskip("shapely")
    frame = geopandas.GeoDataFrame({"n": [1, 2]}, geometry=[shapely.Point(2, 41), shapely.Point(3, 42)], crs=4326)
    assert table_of(frame).columns["lat"].tolist() == [41, 42]
    assert "give obj.to_crs(4326)" in refusal(frame.to_crs(3857))
    assert len(table_of(shapely.Polygon([(0, 0), (1, 0), (1, 1)])).lines) == 1


RECORDS = [dict(zip(COLUMNS, row)) for row in zip(*COLUMNS.values())]


@pytest.mark.parametrize("source", [COLUMNS, Frame(COLUMNS), RECORDS, table_of(COLUMNS)])
def test_a_layer_takes_any_of_them(source):
    read = TypeAdapter(DataLayer).validate_python({"source": source}).source
    check(read.table)
    assert read == TableValue(table_of(COLUMNS))


def test_a_layer_says_what_is_no_table():
    with pytest.raises(ValidationError, match="set is no table; give a dict of columns"):
        TypeAdapter(DataLayer).validate_python({"source": {1, 2}})
