"""What the keys of a legend are called: columns, or the texts and units that the legend gives them."""

from visray.data.color_rule import ColorRule
from visray.data.data_scene import Data
from visray.data.layer import DataLayer
from visray.data.legend import Legend
from visray.data.size_rule import SizeRule
from visray.data.source import table_from
from visray.hints import hint
from visray.terminal import printable


def label(legend: Legend, name: str, layer: DataLayer, key: str) -> str:
    """What a property of a layer shows, with its unit. name: of the layer. key: "color", "height" or "radius"."""
    names = _names(name, layer, key)
    text = next((legend.labels[n] for n in names if n in legend.labels), names[0])
    unit = next((legend.units[n] for n in names if n in legend.units), "")
    return f"{text} ({unit})" if unit else text


def _names(name: str, layer: DataLayer, key: str) -> tuple[str, ...]:
    """The names of what a property of a layer shows: its column. Numbers that are written in the layer have the name of
    the layer, and that of the field that holds them."""
    rule = getattr(layer, key)
    column = rule if isinstance(rule, str) else rule.column if isinstance(rule, ColorRule | SizeRule) else None
    if rule is not None and column is None:
        return name, key
    if column in (None, "value") and layer.value is not None:
        return (layer.value,) if isinstance(layer.value, str) else (name, "value")
    return (column,) if column else (name,)


def label_notes(data: Data) -> list[str]:
    """List of sentences about labels and units for columns that there are not."""
    shown, there = {}, set()
    for name, rows in data.rows.items():
        layer = data.layers[name]
        shown |= {n: None for key in rows.rules for n in reversed(_names(name, layer, key))}
        table = table_from(layer.source)
        there |= set() if table is None else set(table.names)
    given = {"labels": data.legend.labels, "units": data.legend.units}
    return [
        printable(f'legend.{field}: no column "{n}" is shown; {hint(n, shown)}')
        for field, texts in given.items()
        for n in texts
        if n not in shown and n not in there
    ]
