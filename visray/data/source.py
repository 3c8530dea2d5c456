"""The source of a data layer: a file, or a table that is written in the scene or given in Python."""

import hashlib
import json
import os
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import core_schema

from visray.data.number_column import listed
from visray.data.table import Table
from visray.errors import UserError
from visray.named_files import DIGESTS, file_digest, stamp_of
from visray.number_table import canonical


class TableValue:
    """A table as a value of a scene. Tables with equal content are equal."""

    def __init__(self, table: Table):
        self.table = table

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the content."""
        content = hashlib.sha256()
        for name in self.table.names:
            column = self.table.columns[name]
            cells = canonical(column).tobytes() if column.dtype != object else json.dumps(column.tolist()).encode()
            content.update(f"{json.dumps(name)}{column.dtype.str}{len(column)}\0".encode() + cells)
        for row, line in self.table.lines:
            content.update(f"{row}\0".encode() + canonical(np.asarray(line)).tobytes())
        return content.hexdigest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TableValue) and (self is other or self.digest == other.digest)

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        return f"table of {len(self.table)} rows: {', '.join(self.table.names)}"

    def listed(self) -> dict[str, Any]:
        """The columns as lists, None for missing numbers; GeoJSON if there are lines."""
        if self.table.lines:
            from visray.data.geojson_text import to_geojson

            return to_geojson(self.table)
        return {name: listed(self.table.columns[name]) for name in self.table.names}


class SourceRule:
    """The rule for the source of a layer, as an annotation that pydantic reads: a path, or a table."""

    @staticmethod
    def source(given: Any) -> "str | TableValue":
        """The source that a value stands for. Raises ValueError if it is none."""
        if isinstance(given, TableValue) or (isinstance(given, str) and given):
            return given
        if isinstance(given, os.PathLike):
            return os.fspath(given)
        if isinstance(given, (str, bool, int, float, type(None))):
            raise ValueError('must be the path of a file, or columns such as {"lon": [2.2], "lat": [41.4]}')
        # The readers are imported where they are needed: most scenes have no data.
        from visray.data.frames import table_of

        try:
            return TableValue(table_of(given))
        except UserError as error:
            raise ValueError("; ".join(error.lines).removeprefix("the table: ")) from None

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        def written(value: Any, info: Any) -> Any:
            digests = (info.context or {}).get(DIGESTS)
            if isinstance(value, TableValue):
                return value.digest if digests else value.listed()
            # A scene that was not checked yet holds what the user gave.
            if digests and value is not None:
                value = self.source(value)
                return value.digest if isinstance(value, TableValue) else file_digest(value)
            return value

        serializer = core_schema.plain_serializer_function_ser_schema(written, info_arg=True)
        return core_schema.no_info_plain_validator_function(self.source, serialization=serializer)

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict:
        cell = {"anyOf": [{"type": "number"}, {"type": "string"}, {"type": "null"}]}
        columns = {"type": "object", "additionalProperties": {"type": "array", "items": cell}}
        return {"anyOf": [{"type": "string", "minLength": 1}, columns]}


def table_from(source: "str | TableValue | None") -> Table | None:
    """The table of a source; None without a source. Raises UserError if a file cannot be read. A file that has not
    changed is read once."""
    if isinstance(source, TableValue):
        return source.table
    return None if source is None else _read(stamp_of(source))


@lru_cache(maxsize=8)
def _read(stamp: Any) -> Table:
    """The table of a file. stamp: path of the file, with facts that change if its content does."""
    from visray.data.reading import read_table

    return read_table(stamp if isinstance(stamp, str) else stamp[0])
