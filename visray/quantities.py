"""Field types of the scene, and array types of the kernels.

Each field of a kind of object, light or material (`Sphere.radius`, `PointLight.position`) is declared once, with one of
the types below. The type states three things: what a scene file may contain (read by pydantic), how many numbers the
field has, and its precision in a kernel: `geometry` is always double, `shading` is single or double, as
settings.precision says.

`Arrays` is the only access to Dr.Jit's array types: no other module names a backend.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from importlib import import_module
from math import isfinite
from types import MappingProxyType
from typing import Annotated, Any, Literal, NamedTuple

import drjit as dr
import numpy as np
from pydantic import AfterValidator, Field, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import core_schema

from visray.colors import color_as_picked, hexadecimal, is_number, looks_like_bytes, spelled


class Quantity(NamedTuple):
    """How a field enters a kernel.

    size: number of components, 1 or 3
    precision: "geometry" or "shading"
    unit: unit and limits, as messages and the schema show them
    """

    size: int
    precision: Literal["geometry", "shading"]
    unit: str


# Beyond these limits a product of a few numbers overflows single precision (1e38), and pixels become inf or NaN.
FARTHEST = 1e9
BRIGHTEST = 1e9


def _not_zero(v: tuple[float, float, float]) -> tuple[float, float, float]:
    """The direction unchanged; raises ValueError if it is zero or too short."""
    if not any(v):
        raise ValueError("a direction must not be (0, 0, 0)")
    if max(map(abs, v)) < 1 / FARTHEST:
        raise ValueError(f"a direction must have a component of at least {1 / FARTHEST:g}")
    return v


def _not_tiny(x: float) -> float:
    """The length unchanged; raises ValueError if it is too small."""
    if x < 1 / FARTHEST:
        raise ValueError(f"must be at least {1 / FARTHEST:g}")
    return x


class ColorMark:
    """Mark of a field that holds a colour: it may be spelled as text or as one number, which is grey.

    most: the largest number
    """

    def __init__(self, most: float):
        self.most = most

    def spelled(self, color: Any) -> Any:
        """The colour as three numbers. Raises ValueError if it is a text or a single number that is no colour."""
        if isinstance(color, (int, float)) and not isinstance(color, bool):
            if not isfinite(color):
                raise ValueError("must be finite")
            if not 0 <= color <= self.most:
                raise ValueError("must be at least 0" if color < 0 else f"must be at most {self.most:g}")
        color = spelled(color)
        is_triple = isinstance(color, (tuple, list)) and len(color) == 3 and all(map(is_number, color))
        if is_triple and self.most == 1 and looks_like_bytes(color):
            raise ValueError(
                f'must be three numbers from 0 to 1; a colour of a screen is written "{hexadecimal(color)}"'
            )
        return color

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_before_validator_function(self.spelled, handler(source))

    def __get_pydantic_json_schema__(self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler) -> dict:
        return {"anyOf": [handler(schema), {"type": "string"}, {"type": "number", "minimum": 0, "maximum": self.most}]}


class PickedColor:
    """Mark of an input that is a colour as a person picks it (colors.color_as_picked), or None."""

    @staticmethod
    def checked(color: Any) -> Any:
        """The colour as it is given. Raises ValueError if it is none."""
        if color is not None:
            color_as_picked(color)
        return color

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self.checked)

    def __get_pydantic_json_schema__(self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler) -> dict:
        byte = {"type": "number", "minimum": 0, "maximum": 255}
        triple = {"type": "array", "items": byte, "minItems": 3, "maxItems": 3}
        return {"anyOf": [{"type": "string"}, triple, {"type": "number", "minimum": 0, "maximum": 1}, {"type": "null"}]}


Real = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Coordinate = Annotated[Real, Field(ge=-FARTHEST, le=FARTHEST)]
Triple = tuple[Coordinate, Coordinate, Coordinate]
_Positive = Annotated[Real, Field(gt=0, le=FARTHEST), AfterValidator(_not_tiny)]
_NotNegative = Annotated[Real, Field(ge=0, le=BRIGHTEST)]

Point = Annotated[Triple, Quantity(3, "geometry", "world units")]
# Marks triples that must not be 0.
NOT_ZERO = AfterValidator(_not_zero)
Vector = Annotated[Triple, NOT_ZERO, Quantity(3, "geometry", "world units")]
Direction = Annotated[Triple, NOT_ZERO, Quantity(3, "geometry", "any length but 0; normalised")]
Length = Annotated[_Positive, Quantity(1, "geometry", "world units, > 0")]
Lengths = Annotated[tuple[_Positive, _Positive, _Positive], Quantity(3, "geometry", "world units, each > 0")]
LengthOrZero = Annotated[Real, Field(ge=0, le=FARTHEST), Quantity(1, "geometry", "world units, >= 0")]
# Below a hundredth of a degree, neighbouring pixels have the same direction in single precision.
Angle = Annotated[Real, Field(ge=0.01, lt=180), Quantity(1, "geometry", "degrees, from 0.01 to below 180")]
Color = Annotated[
    tuple[_NotNegative, _NotNegative, _NotNegative],
    ColorMark(BRIGHTEST),
    Quantity(3, "shading", "linear Rec. 709, each >= 0"),
]
_Part = Annotated[Real, Field(ge=0, le=1)]
Share = Annotated[tuple[_Part, _Part, _Part], ColorMark(1), Quantity(3, "shading", "linear Rec. 709, each from 0 to 1")]
Factor = Annotated[_NotNegative, Quantity(1, "shading", ">= 0")]
# A dot separates the parts of an address (`objects.ball.radius`), so a name has none.
NAME_PATTERN = r"^[^.\s]([^.]*[^.\s])?$"
Name = Annotated[str, Field(strict=True, pattern=NAME_PATTERN)]
Count = Annotated[int, Field(strict=True, gt=0)]


@cache
def quantities(kind: type) -> Mapping[str, Quantity]:
    """The numeric fields of a kind: a dict from name to Quantity, in the order of declaration."""
    table = {}
    for f in fields(kind):
        annotations = [m for m in getattr(f.type, "__metadata__", ()) if isinstance(m, Quantity)]
        if annotations:
            table[f.name] = annotations[0]
    return MappingProxyType(table)


BACKENDS = {"llvm": "drjit.llvm.ad", "cuda": "drjit.cuda.ad", "metal": "drjit.metal.ad"}


@dataclass(frozen=True)
class Arrays:
    """The array types of one render.

    backend, precision: names, such as "llvm" and "single"
    F, V: number and triple in the precision of shading
    D, W: number and triple in double
    U, B: unsigned integer and mask
    F32, V32, Q32: number, triple and quadruple in single
    X32: array in single of any number of components

    Metal has no double: there the geometry is single too, and the stated accuracy does not hold.
    """

    backend: str
    precision: str
    F: Any
    V: Any
    D: Any
    W: Any
    U: Any
    B: Any
    F32: Any
    V32: Any
    Q32: Any
    X32: Any

    def put(self, kind: Any, values: np.ndarray) -> Any:
        """Copies NumPy values into an array of type `kind` in Dr.Jit's own memory. Shapes: (N) or (3, N).

        Without a copy Dr.Jit would read NumPy's memory in place, and compile a new kernel for each memory alignment.
        Dr.Jit optimises a plain copy away. It keeps a gather whose index is unknown at tracing, and such a gather reads
        at any alignment.
        """
        values = np.ascontiguousarray(values)
        if values.shape[-1] == 1:
            entry = kind(*(float(v[0]) for v in values)) if values.ndim == 2 else kind(values.item())
            dr.make_opaque(entry)
            return entry
        index = dr.arange(self.U, values.shape[-1]) + dr.opaque(self.U, 0)
        if values.ndim == 1:
            return dr.gather(kind, kind(values), index)
        # Component by component, because for a whole matrix Dr.Jit writes its width into the kernel as a literal.
        number = dr.value_t(kind)
        return kind(*(dr.gather(number, number(row), index) for row in values))

    @staticmethod
    def of(backend: str = "llvm", precision: str = "single") -> "Arrays":
        """The array types of a backend, with shading in the given precision."""
        lib = import_module(BACKENDS[backend])
        double = (lib.Float32, lib.Array3f) if backend == "metal" else (lib.Float64, lib.Array3f64)
        shading = double if precision == "double" else (lib.Float32, lib.Array3f)
        rest = lib.UInt32, lib.Bool, lib.Float32, lib.Array3f, lib.Array4f, lib.ArrayXf
        return Arrays(backend, precision, *shading, *double, *rest)


def record(kind: type, fields: Mapping[str, Any]) -> Any:
    """A record of type `kind` with some fields; all others are None. It is made without __init__, because a kind checks
    its name, material and transform there, and a table has none."""
    made = object.__new__(kind)
    vars(made).update({name: fields.get(name) for name in kind.__dataclass_fields__})
    return made


def stacked(a: Arrays, kind: type, records: list) -> Any:
    """Several records of type `kind` as one record of arrays. Its quantities are arrays with one entry for each record;
    its other fields are None."""
    columns = {}
    for name, q in quantities(kind).items():
        number, triple = (a.D, a.W) if q.precision == "geometry" else (a.F, a.V)
        values = np.array([getattr(x, name) for x in records], float)
        columns[name] = a.put(number if q.size == 1 else triple, values.T)
    return record(kind, columns)
