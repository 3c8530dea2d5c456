"""Data layers: rows of a table, each shown by a gizmo on the base."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from visray.data.base import Latitude, Longitude
from visray.data.color_rule import ColorSpec
from visray.data.column import Column
from visray.data.gizmos import GIZMOS
from visray.data.number_column import ColumnRule, NumberColumn
from visray.data.row_names import RowNames
from visray.data.size_rule import SizeSpec
from visray.data.source import SourceRule, TableValue
from visray.data.time_column import TimeColumn, TimeRule
from visray.quantities import FARTHEST, Real
from visray.records import record_kind
from visray.references import GeometryName, MaterialName

Numbers = Annotated[NumberColumn, ColumnRule()]
OwnNumbers = Annotated[NumberColumn, ColumnRule(among=True)]
Times = Annotated[TimeColumn, TimeRule()]
Source = Annotated[str | TableValue, SourceRule()]
Share = Annotated[Real, Field(ge=0, le=1)]
# More digits than the number of any row, and fewer than Python refuses to read.
ROW_NUMBER = r"^(0|[1-9][0-9]{0,17})$"
RowNumber = Annotated[str, Field(pattern=ROW_NUMBER)]


@record_kind
@dataclass(frozen=True, kw_only=True)
class RowEdit:
    """Numbers of one row that replace those of the source, in units of the data."""

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")

    lon: Longitude | None = None
    lat: Latitude | None = None
    height: Real | None = None
    radius: Real | None = None
    color: Real | None = None


@record_kind
@dataclass(frozen=True, kw_only=True)
class DataLayer:
    """A layer shows each row of a table by a gizmo.

    source: path of a CSV or GeoJSON file, or the columns themselves, by name.
    lon, lat: columns with the longitude and the latitude in degrees, or the numbers themselves; null: columns with the
        usual names.
    value: column, or numbers, for the height (or the radius, of a gizmo without height) and for the colour, where
        these are not given.
    name: column with the name of each row, for labels, or the names themselves; null: a column with a usual name, or
        the first one of texts.
    gizmo: the shape; `geometry` shows one of the scene's geometries, whose name is in the field `geometry`. A `line`
        follows the lines and outlines of a GeoJSON file.
    height, radius: sizes: a number in world units, a column, numbers, or a rule. The radius is half the width.
    color: colours: a column, numbers, a rule, or one colour in sRGB; null: that of the material.
    material: name of the gizmos' material. Its field `colored` says what the colours change.
    sunk: share of a gizmo's height that is below the base.
    lift: height of the gizmo's foot above the base; null: 0, and a little for disks, which would lie in the base.
    rows: numbers that replace those of the source, by the number of the row, counted from 0.
    time: column with the moment of each row, a date or a number, or the moments themselves; null: nothing changes.
        With moments, rows of one name are one place, or rows of one lon and lat if there are no names, and each place
        has one gizmo, which shows its numbers at the `date` of the data. Rows are then places, in the order of their
        names.
    between: what a number is between two dates: `interpolated`, which is linear in time, or `held`, which is the last
        known one.

    Sizes and colours are those of the interpolated numbers. The domains of their rules are by default those of all
    dates, so that nothing else changes a gizmo in time.
    """

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")

    source: Source | None = None
    lon: Column | Numbers | None = None
    lat: Column | Numbers | None = None
    value: Column | Numbers | None = None
    name: Column | RowNames | None = None
    gizmo: Literal[tuple(GIZMOS)] = "cylinder"
    geometry: GeometryName | None = None
    height: SizeSpec | OwnNumbers | None = None
    radius: SizeSpec | OwnNumbers | None = None
    # Three numbers from 0 to 1 are a colour, and other lists are numbers of rows.
    color: Annotated[ColorSpec | OwnNumbers, Field(union_mode="left_to_right")] = None
    material: MaterialName = "default"
    sunk: Share = 0.0
    lift: Annotated[Real, Field(ge=-FARTHEST, le=FARTHEST)] | None = None
    rows: dict[RowNumber, RowEdit] = field(default_factory=dict)
    time: Column | Times | None = None
    between: Literal["interpolated", "held"] = "interpolated"
