"""Properties of a VisRayTrace data scene as layers of a visray data scene.

VisRayTrace made the size s of a gizmo from a value: a linear map from [minValue, maxValue] to [0.1, 0.5 h], where h is
the height of Virtual. Gizmos are s times as large as its standard objects.
"""

from dataclasses import dataclass
from typing import Any

from visray.hints import hint
from visray.scene.legacy.color_maps import inverted
from visray.scene.legacy.data_mapping import Corners
from visray.scene.legacy.data_places import FlatPlacement, GlobePlacement
from visray.scene.legacy.data_rows import DataRows
from visray.scene.legacy.entry import Entry, Log
from visray.scene.legacy.names import unique_name, valid_name

SMALLEST_SIZE = 0.1


@dataclass(frozen=True)
class GizmoSizes:
    """Size of a kind of gizmo.

    height, radius: factor by which s is multiplied; None if the gizmo has no such size, or a fixed one.
    fixed: sizes that are the same for all values.
    sunk: share of the gizmo that is below a map.
    sunk_in_globe: share of the gizmo that is inside a globe.
    """

    height: float | None
    radius: float | None
    fixed: dict[str, float]
    sunk: float
    sunk_in_globe: float


# VisRayTrace had the first three. Programs of its family had boxes and cones, each in its own way. Here these are as
# wide and as high as a sphere of the same value, and stand like a cylinder.
GIZMOS = {
    "sphere": GizmoSizes(None, 1.0, {}, 0.25, 0.5),
    "cylinder": GizmoSizes(4.0, None, {"radius": 0.1}, 0.0, 0.5),
    "triangle": GizmoSizes(3.0, 1.0, {}, 1 / 3, 1 / 3),
    "box": GizmoSizes(2.0, 1.0, {}, 0.0, 0.5),
    "cone": GizmoSizes(2.0, 1.0, {}, 0.0, 0.5),
}


@dataclass(frozen=True)
class Property:
    """A property of the file.

    e: the property as the file gives it.
    gizmo: kind of its gizmos.
    domain: minValue and maxValue.
    palette: its palette, as a value of visray's field `palette`.
    rows: its data.
    """

    e: Entry
    gizmo: str
    domain: tuple[float, float]
    palette: Any
    rows: DataRows


def gizmo(e: Entry) -> str | None:
    """Kind of the gizmos of a property; None with an error in the log if the kind is unknown."""
    written = e.text("gyzmo")
    if written is None:
        e.log.warn(f"{e.at('gyzmo')}: is missing; a sphere is drawn")
        return "sphere"
    kind = written.strip().casefold()
    if kind not in GIZMOS:
        e.error("gyzmo", f"unknown gizmo; {hint(written, GIZMOS)}")
        return None
    return kind


def domain(e: Entry, rows: DataRows) -> tuple[float, float] | None:
    """(minValue, maxValue) of a property; None with an error in the log if they are equal. In place of a missing one,
    it is the smallest or the largest value of the data."""
    ends = []
    for side, extreme in (("min", min), ("max", max)):
        key = next((key for key in (f"{side}ValueReal", f"{side}Value") if e.has(key)), None)
        if key and e.has(f"{side}Value") and key != f"{side}Value":
            e.number(f"{side}Value", 0.0)
        end = e.number(key, float("nan")) if key else float("nan")
        if end != end:
            end = extreme(v for row in rows.rows() for v in row[2:] if v is not None)
            e.log.warn(f"{e.at(f'{side}Value')}: is missing; that of the data, {end:g}, is used")
        ends.append(end)
    low, high = ends
    if low == high:
        e.log.error(f"{e.address}: minValue and maxValue are both {low:g}; they must differ")
        return None
    if low > high:
        text = "so large values are drawn small, as in VisRayTrace"
        e.log.warn(f"{e.address}: minValue, {low:g}, is above maxValue, {high:g}; {text}")
    return low, high


def largest_size(given: Corners, log: Log) -> float:
    """Size s of a gizmo whose value is maxValue: half the height of Virtual."""
    low, high = given.virtual
    height = abs(high[1] - low[1])
    if height < 2 * SMALLEST_SIZE:
        text = f"large values are drawn smaller than small ones, whose size is {SMALLEST_SIZE:g}"
        log.warn(f"Virtual: its height in y is {height:g}, so the size at maxValue is {height / 2:g}; {text}")
    return height / 2


def report_values_outside(p: Property, largest: float) -> None:
    """Warns of values that are not between minValue and maxValue, and of sizes that are not positive.

    largest: size of maxValue.
    """
    low, high = p.domain
    values = [v for row in p.rows.rows() for v in row[2:] if v is not None]
    shares = [(v - low) / (high - low) for v in values]
    if outside := sum(not 0 <= t <= 1 for t in shares):
        text = "their sizes go on in the same way, and their colours are those of the ends"
        p.e.log.warn(f"{p.e.at('data')}: {outside} of {len(values)} values are not from {low:g} to {high:g}; {text}")
    if gone := sum(SMALLEST_SIZE + t * (largest - SMALLEST_SIZE) <= 0 for t in shares):
        text = "gizmos with negative sizes hang down, and those of size 0 are not drawn"
        p.e.log.warn(f"{p.e.at('data')}: {gone} of {len(values)} values have sizes of 0 or less; {text}")


def layers_of(
    p: Property,
    placement: FlatPlacement | GlobePlacement,
    material: str,
    largest: float,
    compat: bool,
) -> list[dict[str, Any]]:
    """Fields of the layers of a property: one layer for its values, and one for the second values if there are any.

    largest: size s of a gizmo whose value is maxValue.
    """
    name = value_column(p.e)
    low, high = sorted(p.domain)
    color = {"column": name, "palette": p.palette, "domain": (low, high), "lookup": "table"}
    color |= {"reversed": True} if low != p.domain[0] else {}
    color |= {"encoding": "linear"} if compat else {}
    layers = [_layer(p, placement, p.rows, False, color | {"column": name}, material, largest)]
    if any(v is not None for v in p.rows.second):
        rows, color = p.rows.with_second(), color | {"palette": inverted(p.palette)}
        layers.append(_layer(p, placement, rows, True, color, material, largest))
    return layers


def value_column(e: Entry) -> str:
    """Name of the column of values: the name of the property."""
    name = valid_name(e.text("name") or "") or "value"
    return unique_name(name, ("lon", "lat"))


def _layer(
    p: Property,
    placement: FlatPlacement | GlobePlacement,
    rows: DataRows,
    is_second: bool,
    color: dict[str, Any],
    material: str,
    largest: float,
) -> dict[str, Any]:
    """Fields of a layer.

    rows: its rows, which are some or all of the property.
    is_second: whether it shows the second values of the rows.
    """
    lon, lat = placement.places(rows.x, rows.z)
    if is_second:
        lon = placement.beside(lon, lat)
    columns = {"lon": lon, "lat": lat, color["column"]: list(rows.value)}
    column = color["column"]
    if is_second:
        column = unique_name(column, columns)
        columns[column] = list(rows.second)
    gizmo = GIZMOS[p.gizmo]
    sizes = _size_rules(columns, column, p.domain, largest, {"height": gizmo.height, "radius": gizmo.radius})
    return {
        "source": columns,
        "lon": "lon",
        "lat": "lat",
        "gizmo": p.gizmo,
        **gizmo.fixed,
        **sizes,
        "color": color,
        "material": material,
        "sunk": gizmo.sunk_in_globe if isinstance(placement, GlobePlacement) else gizmo.sunk,
        # Gizmos of negative values begin exactly at the base, as the formulas say.
        "lift": 0.0,
    }


def _size_rules(
    columns: dict[str, list[float]],
    name: str,
    domain: tuple[float, float],
    largest: float,
    factors: dict[str, float | None],
) -> dict[str, dict[str, Any]]:
    """Size rules of a layer, by field, with the sizes of VisRayTrace's formula.

    Usually they read the column of values. But visray turns negative values around unless the domain begins below 0,
    and it has no rule that leads from positive values to negative sizes. With such values the rules read a new column
    of sizes s, and radii another of absolute sizes. Gizmos with negative sizes hang down.

    columns: columns of the layer, to which new ones are added.
    name: name of the column of values.
    domain: minValue and maxValue.
    largest: size at maxValue.
    factors: size of the gizmo if s is 1, by field; None for a field that does not depend on s.
    """
    ends = (SMALLEST_SIZE, largest)
    slope = (ends[1] - ends[0]) / (domain[1] - domain[0])
    sizes = [ends[0] + (v - domain[0]) * slope for v in columns[name]]
    factors = {key: factor for key, factor in factors.items() if factor is not None}
    if domain[0] > domain[1]:
        domain, ends = domain[::-1], ends[::-1]
    readers = dict.fromkeys(factors, name)
    if min(sizes) < 0 or (domain[0] >= 0 and min(columns[name]) < 0):
        domain = ends = (0.0, max(map(abs, sizes)))
        for key, new, numbers in (("height", "size", sizes), ("radius", "width", [abs(s) for s in sizes])):
            if key in factors:
                readers[key] = unique_name(f"{new} of {name}", columns)
                # A gizmo without a height hangs down if its radius is negative.
                columns[readers[key]] = numbers if "height" in factors else sizes
    return {
        key: {"column": readers[key], "domain": domain, "range": tuple(factor * end for end in ends)}
        for key, factor in factors.items()
    }
