"""The layer and the base of a picture of a table: where gizmos stand, and how large they are."""

from dataclasses import replace
from typing import Any

import numpy as np
from PIL import Image as Pillow

from visray.data.base import MERCATOR_LIMIT, Base, MapBase, on_earth
from visray.data.color_rule import ColorRule
from visray.data.fitted_base import fitted_base, spacing
from visray.data.layer import DataLayer
from visray.data.layer_table import LayerTable
from visray.data.positions import swapped
from visray.data.size_rule import SizeRule
from visray.data.source import TableValue
from visray.data.table import Table, shown
from visray.data_picture.wishes import Wishes, shows_lines
from visray.errors import UserError
from visray.terminal import printable

# Names of the materials of the scene.
BASE_MATERIAL, DATA_MATERIAL = "map", "data"
# Radius of a gizmo in distances between neighbours, and its limits in sizes of the base.
RADIUS, THINNEST, THICKEST = 0.4, 0.0025, 0.008
# Largest radius of gizmos whose radius is a column, likewise.
RADIUS_OF_COLUMN, SMALLEST, LARGEST = 1.5, 0.008, 0.02
# Radius of lines, in pixels of a base as wide as the picture, and of the widest lines of a column, in such radii.
LINE_PIXELS, WIDEST = 1.1, 4.0
# Fields of the rule of colours that options set.
COLOURS = ("palette", "norm", "domain", "bands")
# Options that set fields of the layer, by field.
OPTIONS = {name: f"--{name}" for name in ("lon", "lat", "name", "height", "radius", "color", "gizmo")}
OPTIONS["time"] = "--time-column"


def layer_for(source: str | TableValue, table: Table, wishes: Wishes) -> DataLayer:
    """The layer, without the sizes that depend on the base. source: path of the table, or the table itself."""
    gizmo = wishes.gizmo or ("line" if shows_lines(table, None) else "cylinder" if wishes.height else "sphere")
    color: Any = wishes.color
    chosen = {key: value for key in COLOURS if (value := getattr(wishes, key)) is not None}
    if chosen and color is not None:
        color = ColorRule(column=color, **chosen)
    return DataLayer(
        source=source, lon=wishes.lon, lat=wishes.lat, name=wishes.name, gizmo=gizmo, height=wishes.height,
        radius=wishes.radius, color=color, material=DATA_MATERIAL, time=wishes.time_column,
        between="held" if wishes.held else "interpolated",
        # The middle of a sphere is the place of its datum.
        sunk=0.5 if gizmo == "sphere" else 0.0,
    )  # fmt: skip


def base_for(lon: np.ndarray, lat: np.ndarray, wishes: Wishes) -> Base:
    """The base for places. Raises a UserError if the extent is wrong. Shapes: lon, lat (N)."""
    if wishes.extent is not None:
        base = MapBase(extent=wishes.extent, projection=_projection(wishes), material=BASE_MATERIAL)
        if flaws := base.flaws():
            raise UserError(*(f"--extent = {','.join(f'{x:g}' for x in wishes.extent)}: {text}" for _, text in flaws))
        return base
    return replace(fitted_base(lon, lat, wishes.base), material=BASE_MATERIAL)


def _projection(wishes: Wishes) -> str:
    """The projection that fits the shape of the user's picture better. Domain: there is an extent."""
    west, east, south, north = wishes.extent
    if wishes.image is None or not (west < east and south < north) or max(-south, north) > MERCATOR_LIMIT:
        return "equirectangular"
    try:
        with Pillow.open(wishes.image) as picture:
            shape = picture.height / picture.width
    except OSError:
        return "equirectangular"
    squeezed, mercator = (
        MapBase(extent=wishes.extent, width=1.0, projection=name).true_depth for name in ("equirectangular", "mercator")
    )
    # In equirectangular pictures, a degree of latitude is as long as one of longitude, or as it is in the middle.
    nearest = min((squeezed, (north - south) / (east - west), mercator), key=lambda x: abs(np.log(shape / x)))
    return "mercator" if nearest == mercator != squeezed else "equirectangular"


def places(layer: DataLayer, table: Table) -> tuple[np.ndarray, np.ndarray]:
    """Longitudes and latitudes of the rows that have some. Raises a UserError without any."""
    if shows_lines(table, layer.gizmo):
        points = np.concatenate([line for _, line in table.lines])
        lon, lat = points[:, 0], points[:, 1]
    else:
        own = LayerTable.of(layer)
        if own.flaws:
            if "lat" in own.values and swapped(own.values["lon"], own.values["lat"]):
                turned = f"write --lon {shown(layer.lat)} --lat {shown(layer.lon)}"
                raise UserError(*(printable(f"{table.path}: {text}; {turned}") for _, text in own.flaws))
            flaws = [(f"layers.x.{part}", text) for part, text in own.flaws]
            raise UserError(*flaw_lines(table.path, flaws))
        lon, lat = own.values["lon"], own.values["lat"]
    kept = on_earth(lon, lat)
    if not kept.any():
        raise UserError(f"{table.path}: no row has a longitude and a latitude")
    if layer.time is None:
        return lon[kept], lat[kept]
    # A place that has many dates counts once.
    return tuple(np.unique([lon[kept], lat[kept]], axis=1))


def sized(layer: DataLayer, base: Base, lon: np.ndarray, lat: np.ndarray, pixels: int) -> DataLayer:
    """The layer with radii that suit the distances of its places; those of lines suit the width of the picture in
    pixels. Shapes: lon, lat (N)."""
    if layer.gizmo == "line":
        thin = LINE_PIXELS / pixels * base.size
        if isinstance(layer.radius, str):
            return replace(layer, radius=SizeRule(column=layer.radius, range=(_short(thin), _short(WIDEST * thin))))
        return replace(layer, radius=_short(thin))
    inside = base.inside(lon, lat)
    apart = spacing(base.place(lon[inside], lat[inside]).point)
    if apart == 0:
        # All are in one place.
        apart = base.size
    if isinstance(layer.radius, str):
        most = np.clip(RADIUS_OF_COLUMN * apart, SMALLEST * base.size, LARGEST * base.size)
        # The area that a gizmo covers is proportional to its value.
        return replace(layer, radius=SizeRule(column=layer.radius, scale="sqrt", range=(0.0, _short(most))))
    return replace(layer, radius=_short(np.clip(RADIUS * apart, THINNEST * base.size, THICKEST * base.size)))


def _short(number: float) -> float:
    """A number with two digits, so that a file is easy to read."""
    return float(f"{number:.2g}")


def flaw_lines(path: str, flaws: list[tuple[str, str]]) -> list[str]:
    """Messages about flaws of the data. Of equal ones, about a column that is shown twice, the first.

    path: what messages call the table
    flaws: errors (address below `data`, message)
    """
    texts = {text: part for part, text in reversed(flaws)}
    return [_flaw_line(path, part, text) for text, part in reversed(texts.items())]


def _flaw_line(path: str, part: str, text: str) -> str:
    """The message about a flaw of the data. part: its address below `data`."""
    field = part.split(".")[2] if part.startswith("layers.") and part.count(".") >= 2 else ""
    if part.endswith(tuple(f"color.{name}" for name in COLOURS)):
        text = text.replace('write "reversed": true', "write _r at the end of its name")
        return printable(f"--{part.rpartition('.')[2]}: {text}")
    option = "--date" if part == "date" else OPTIONS.get(field, path)
    return printable(f"{option}: {text}")
