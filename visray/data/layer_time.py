"""The timeline of a layer, from its field `time`."""

import numpy as np

from visray.data.column import Place
from visray.data.layer import DataLayer
from visray.data.moments import Moments, moments_of_numbers, moments_of_texts
from visray.data.table import Table
from visray.data.time_column import TimeColumn
from visray.data.timeline import Timeline
from visray.errors import UserError


def layer_timeline(
    layer: DataLayer, table: Table | None, values: dict[str, np.ndarray], names: np.ndarray | None, place: Place
) -> Timeline:
    """Which rows of a layer with a time are one place, and in which order of time. Raises a UserError if the time is
    wrong.

    table: the table of its source. values: numbers of the rows, by property. names: of the rows; None without names
    place: where a row stands, in words
    """
    try:
        moments = _moments(layer.time, table, place)
        return Timeline.of(moments, names, values["lon"], values["lat"], layer.between == "held", place)
    except ValueError as error:
        raise UserError(str(error)) from None


def _moments(time: str | TimeColumn, table: Table | None, place: Place) -> Moments:
    """The moments of the rows. Raises a ValueError or a UserError if they are none."""
    if isinstance(time, TimeColumn):
        if time.values.dtype.kind == "f":
            return moments_of_numbers(time.values, place)
        return moments_of_texts(time.values.tolist(), place)
    if table is None:
        raise ValueError(f'there is no column "{time}", as the layer has no source; write a list')
    numbers, problems = table.numbers(time)
    return moments_of_texts(table.texts(time).tolist(), place) if problems else moments_of_numbers(numbers, place)
