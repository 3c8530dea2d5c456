"""Tables of numbers as values of a scene, such as the vertices of a mesh."""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import core_schema

from visray.named_files import DIGESTS


def canonical(values: np.ndarray) -> np.ndarray:
    """Numbers with the same bits wherever they are equal: 0 for -0, and one NaN for all of them."""
    return np.where(np.isnan(values), np.nan, values + 0.0) if values.dtype.kind == "f" else values


class NumberTable:
    """A read-only table of numbers: a NumPy array with one row per entry. Tables with equal content are equal; NaN, a
    missing number, equals NaN.

    Shape: (N, columns).
    """

    def __init__(self, values: np.ndarray):
        self.values = np.array(values, order="C")
        self.values.flags.writeable = False

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the content."""
        shape = f"{self.values.dtype.str}{self.values.shape}".encode()
        return hashlib.sha256(shape + canonical(self.values).tobytes()).hexdigest()

    def __len__(self) -> int:
        return len(self.values)

    def __eq__(self, other: object) -> bool:
        if self is other or not isinstance(other, NumberTable):
            return self is other
        return np.array_equal(self.values, other.values, equal_nan=True)

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        return f"{' x '.join(map(str, self.values.shape))} numbers"


@dataclass(frozen=True)
class TableRule:
    """The rule for the tables of a field, as an annotation that pydantic reads.

    columns: numbers per row
    whole: whether the numbers are whole and not negative
    unit: the unit, as the JSON Schema shows it
    """

    columns: int
    whole: bool
    unit: str

    def table(self, given: Any) -> NumberTable:
        """The table of a value: a NumberTable, an array, or a list of lists. Raises ValueError if it is none."""
        if isinstance(given, NumberTable):
            return given
        sort = "whole numbers, not negative" if self.whole else "numbers"
        message = f"must be a list of rows of {self.columns} {sort}"
        try:
            values = np.array(given)
        except ValueError:
            values = np.empty(0, object)
        if values.ndim != 2 or values.shape[1] != self.columns or values.dtype.kind not in "iuf":
            raise ValueError(message)
        if self.whole:
            if values.dtype.kind == "f" or values.min(initial=0) < 0 or values.max(initial=0) >= 2**32:
                raise ValueError(message)
            return NumberTable(values.astype(np.uint32))
        return NumberTable(values.astype(float))

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        def written(table: Any, info: Any) -> Any:
            if not isinstance(table, NumberTable):
                return table
            return table.digest if (info.context or {}).get(DIGESTS) else table.values.tolist()

        serializer = core_schema.plain_serializer_function_ser_schema(written, info_arg=True)
        return core_schema.no_info_plain_validator_function(self.table, serialization=serializer)

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict:
        number = {"type": "integer", "minimum": 0} if self.whole else {"type": "number"}
        row = {"type": "array", "items": number, "minItems": self.columns, "maxItems": self.columns}
        return {"type": "array", "items": row}
