"""A column of moments as a value of a scene: dates as texts, or numbers."""

from typing import Any

import numpy as np
from pydantic import GetJsonSchemaHandler
from pydantic_core import PydanticCustomError

from visray.data.number_column import ColumnRule, NumberColumn
from visray.data.values import column_of_array


class TimeColumn(NumberColumn):
    """A read-only column of dates or numbers; "" or NaN where one is missing. Shape: (N)."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TimeColumn) and self.digest == other.digest

    __hash__ = NumberColumn.__hash__


class TimeRule(ColumnRule):
    """The rule for a field that is a column of moments, as an annotation that pydantic reads. A column is given as a
    list of texts or numbers, or as an array of dates or numbers."""

    def column(self, given: Any) -> TimeColumn:
        """The column of a value. Raises ValueError if it is none."""
        if isinstance(given, TimeColumn):
            return given
        if isinstance(given, (str, dict)) or np.ndim(given) == 0:
            raise PydanticCustomError("list_type", "must be a list of dates or numbers")
        try:
            values, _ = column_of_array(getattr(given, "values", given))
        except (TypeError, ValueError):
            raise ValueError("must be the name of a column, or a list of dates or numbers") from None
        return TimeColumn(values.astype(str) if values.dtype == object else values)

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict:
        return {"type": "array", "items": {"anyOf": [{"type": "string"}, {"type": "number"}, {"type": "null"}]}}
