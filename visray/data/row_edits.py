"""Numbers that a layer's field `rows` puts in place of those of the source."""

import numpy as np

from visray.data.layer import DataLayer
from visray.data.timeline import Timeline


def edited(
    layer: DataLayer, values: dict[str, np.ndarray], timeline: Timeline | None
) -> tuple[dict[str, np.ndarray], list[tuple[str, str]]]:
    """The numbers of a layer's rows after its edits, by property, and errors (field, message). The arrays that are
    given, which may be those of a file, do not change.

    timeline: the places of the rows; None if nothing changes in time. An edit is for all dates of a place
    """
    result, flaws = dict(values), []
    if not layer.rows:
        return result, flaws
    count = len(values["lon"]) if timeline is None else len(timeline)
    for number, edit in layer.rows.items():
        if int(number) >= count:
            flaws.append((f"rows.{number}", f"there is no such row; the last one is {count - 1}"))
            continue
        rows = int(number) if timeline is None else timeline.rows_of(int(number))
        for key, x in vars(edit).items():
            if x is None:
                continue
            if key not in values:
                text = f"has no number of its own, as the layer takes {key} from no column"
                flaws.append((f"rows.{number}.{key}", f"{text}; change {key} of the layer"))
                continue
            if result[key] is values[key]:
                result[key] = values[key].copy()
            result[key][rows] = x
    return result, flaws
