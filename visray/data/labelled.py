"""Tables of labelled arrays, as xarray has them: each cell of the grid of their dimensions becomes a row."""

import math
from typing import Any

import numpy as np

from visray import memory
from visray.errors import UserError


def is_labelled(obj: Any) -> bool:
    """Whether an object is a Dataset or a DataArray of xarray, or offers the same."""
    return hasattr(obj, "coords") and hasattr(obj, "dims") and (hasattr(obj, "data_vars") or hasattr(obj, "values"))


def from_labelled(obj: Any, path: str) -> list[tuple[str, np.ndarray]]:
    """Names and values of the columns: coordinates first, then variables, repeated along the dimensions they lack.

    path: what messages call the object.
    """
    variables = dict(obj.data_vars) if hasattr(obj, "data_vars") else {getattr(obj, "name", None) or "value": obj}
    if not variables:
        raise UserError(f"{path}: has no variables; it must have at least one")
    sizes: dict[str, int] = {}
    for array in variables.values():
        sizes |= dict(zip(array.dims, np.shape(array.values)))
    # Coordinates along other dimensions belong to no variable.
    parts = {str(name): c for name, c in obj.coords.items() if set(c.dims) <= set(sizes)}
    rows, free = math.prod(sizes.values()), memory.free()
    names = list(dict.fromkeys([*parts, *map(str, sizes), *map(str, variables)]))
    if free is not None and rows * 16 * len(names) > free.size:
        need = f"{rows:,} rows of {len(names)} columns take about {rows * 16 * len(names) / 2**30:.1f} GiB"
        raise UserError(f"{path}: {need}, and {free}; select a part of the dimensions ({', '.join(map(str, sizes))})")
    columns = {name: _spread(c, sizes) for name, c in parts.items()}
    for axis, name in enumerate(sizes):
        if str(name) not in columns:
            shape = [-1 if i == axis else 1 for i in range(len(sizes))]
            columns[str(name)] = np.broadcast_to(np.arange(sizes[name]).reshape(shape), tuple(sizes.values())).ravel()
    return [*columns.items(), *((str(name), _spread(array, sizes)) for name, array in variables.items())]


def _spread(array: Any, sizes: dict[str, int]) -> np.ndarray:
    """Values of a labelled array, repeated along the dimensions that it lacks. Shape: (product of the sizes,)"""
    dims = [d for d in sizes if d in array.dims]
    values = np.asanyarray(array.values).transpose([list(array.dims).index(d) for d in dims])
    shape = [sizes[d] if d in dims else 1 for d in sizes]
    return np.broadcast_to(values.reshape(shape), tuple(sizes.values()), subok=True).ravel()
