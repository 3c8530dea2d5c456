"""Tables of Python objects: dicts of columns, records, NumPy arrays, data frames and labelled arrays of any library.

No library but NumPy is needed: an object is recognised by what it offers.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from visray.data.geojson import from_geojson, is_geojson
from visray.data.interchange import from_interchange
from visray.data.labelled import from_labelled, is_labelled
from visray.data.table import Table, shown
from visray.data.values import column_of_array
from visray.errors import UserError
from visray.terminal import printable

KINDS = "a dict of columns, a list of records, a structured array, a data frame, GeoJSON, or a Dataset of xarray"


def table_of(obj: Any, path: str = "the table") -> Table:
    """The table of a Python object. Raises a UserError of one line if it is no table.

    path: what messages call the table.
    """
    if isinstance(obj, Table):
        return obj
    if is_geojson(obj):
        return from_geojson(obj, path)
    if hasattr(obj, "__geo_interface__"):
        return _geography(obj, path)
    try:
        return _joined(_columns(obj, path), path)
    except (UserError, MemoryError):
        raise
    # Objects of other libraries may raise anything when they are read.
    except Exception as error:
        raise UserError(printable(f"{path}: cannot be read ({_said(error)}); give {KINDS}")) from None


def _said(error: Exception) -> str:
    """Text of an exception on one line, with the name of its class."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:200]


def _geography(obj: Any, path: str) -> Table:
    """The table of an object with `__geo_interface__`, such as those of geopandas and shapely."""
    crs = getattr(obj, "crs", None)
    if crs is not None and hasattr(crs, "to_epsg") and crs.to_epsg() not in (4326, 4979):
        raise UserError(printable(f"{path}: its CRS is {' '.join(str(crs).split())[:60]}; give obj.to_crs(4326)"))
    return from_geojson(_lists(obj.__geo_interface__), path)


def _lists(value: Any) -> Any:
    """A value with lists in place of tuples, as JSON has them."""
    if isinstance(value, Mapping):
        return {str(key): _lists(v) for key, v in value.items()}
    return [_lists(v) for v in value] if isinstance(value, (list, tuple)) else value


def _joined(named: list[tuple[str, Any]], path: str) -> Table:
    """The table of columns that may have any type."""
    if not named:
        raise UserError(f"{path}: has no columns; it must have at least one")
    columns, notes, names = {}, [], [name for name, _ in named]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise UserError(printable(f"{path}: the column {shown(twice)} is there twice; rename one"))
    for name, values in named:
        try:
            columns[name], more = column_of_array(values)
        except (ValueError, TypeError) as error:
            raise UserError(printable(f"{path}: column {shown(name)} {' '.join(str(error).split())}")) from None
        notes += [printable(f"column {shown(name)}: {text}") for text in more]
    if len({len(values) for values in columns.values()}) > 1:
        listed = ", ".join(f"{shown(n)} has {len(values):,}" for n, values in list(columns.items())[:5])
        raise UserError(printable(f"{path}: its columns have different lengths ({listed}); give each as many values"))
    if not len(columns[names[0]]):
        raise UserError(f"{path}: has no rows; it must have at least one")
    return Table(names, columns, None, path, notes)


def _columns(obj: Any, path: str) -> list[tuple[str, Any]]:
    """Names and values of the columns of an object."""
    if is_labelled(obj):
        return from_labelled(obj, path)
    if isinstance(obj, Mapping):
        return [(str(name), values) for name, values in obj.items()]
    if isinstance(obj, np.ndarray) and obj.dtype.names:
        return [(name, obj[name].ravel()) for name in obj.dtype.names]
    if isinstance(obj, (list, tuple)) and obj and all(isinstance(row, Mapping) for row in obj):
        names = dict.fromkeys(name for row in obj for name in row)
        return [(str(name), [row.get(name) for row in obj]) for name in names]
    if callable(getattr(obj, "collect", None)):
        raise UserError(printable(f"{path}: {type(obj).__name__} is not computed yet; give obj.collect()"))
    names = getattr(obj, "column_names", None)
    names = getattr(obj, "columns", getattr(obj, "keys", None)) if names is None else names
    names = names() if callable(names) else names
    if names is not None and hasattr(obj, "__getitem__"):
        # In Arrow's tables `columns` are the columns themselves, so their names come first.
        index = getattr(obj, "index", None)
        labels = [(index.name, index)] if isinstance(getattr(index, "name", None), str) else []
        return labels + [(str(name), obj[name]) for name in names]
    if hasattr(obj, "__dataframe__"):
        return from_interchange(obj)
    raise UserError(printable(f"{path}: {type(obj).__name__} is no table; give {KINDS}"))
