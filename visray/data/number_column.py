"""A column of numbers as a value of a scene, and tables of columns as sources of data layers."""

from typing import Any

import numpy as np
from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import PydanticCustomError, core_schema

from visray.named_files import DIGESTS
from visray.number_table import NumberTable


def listed(column: np.ndarray) -> list:
    """A column of numbers or of texts as a list; None for missing numbers."""
    return [None if x != x else x for x in column.tolist()]


class NumberColumn(NumberTable):
    """A read-only column of numbers; NaN where a number is missing. Shape: (N)."""

    def listed(self) -> list[float | None]:
        """The numbers as a list; None for missing ones."""
        return listed(self.values)


class ColumnRule:
    """The rule for a field that is a column, as an annotation that pydantic reads. A column is given as a list or an
    array; null stands for a missing number.

    among: whether the field may have values of other kinds than columns, of which the message then speaks, too.
    """

    def __init__(self, among: bool = False):
        self.among = among

    def column(self, given: Any) -> NumberColumn:
        """The column of a value. Raises ValueError if it is none."""
        if isinstance(given, NumberColumn):
            return given
        if self.among and (isinstance(given, (str, dict)) or np.ndim(given) == 0):
            # The type is one of those of which `scene/messages.py` makes one message about all kinds.
            raise PydanticCustomError("list_type", "must be a list of numbers")
        try:
            if isinstance(given, str) or np.ndim(given) != 1 or np.asarray(given).dtype.kind in "cmMSV":
                raise ValueError
            listed = [np.nan if x is None else x for x in given] if isinstance(given, (list, tuple)) else given
            values = np.asarray(np.ma.filled(np.ma.asarray(listed, float), np.nan), float)
        except (TypeError, ValueError):
            raise ValueError("must be the name of a column, or a list of numbers") from None
        return NumberColumn(values)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        def written(column: Any, info: Any) -> Any:
            digests = (info.context or {}).get(DIGESTS)
            # A scene that was not checked yet holds what the user gave.
            if digests and not isinstance(column, (str, NumberColumn, type(None))):
                column = self.column(column)
            if not isinstance(column, NumberColumn):
                return column
            return column.digest if digests else column.listed()

        serializer = core_schema.plain_serializer_function_ser_schema(written, info_arg=True)
        return core_schema.no_info_plain_validator_function(self.column, serialization=serializer)

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict:
        return {"type": "array", "items": {"anyOf": [{"type": "number"}, {"type": "null"}]}}
