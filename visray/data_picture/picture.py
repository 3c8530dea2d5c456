"""The scene that shows a table without a scene file: map or globe, gizmos, camera, lights and legend fit the data."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from visray import fitting
from visray.animation.animation import Animation
from visray.data import basemap, fit
from visray.data.base import Base, GlobeBase
from visray.data.data_scene import RESERVED, Data
from visray.data.layer import DataLayer
from visray.data.legend import Legend
from visray.data.rows import Rows
from visray.data.source import TableValue, table_from
from visray.data.table import Table
from visray.data_picture.animated import animation_of, turns, with_names
from visray.data_picture.placing import BASE_MATERIAL, DATA_MATERIAL, base_for, flaw_lines, layer_for, places, sized
from visray.data_picture.viewing import viewed
from visray.data_picture.wishes import Wishes, checked, completed, passed_over
from visray.errors import UserError
from visray.legend.layout import LEAST_SIDE
from visray.materials import Material
from visray.records import altered
from visray.scene.film import Film
from visray.scene.scene import Scene, Settings
from visray.terminal import printable
from visray.textures import ImageTexture

# Name of the texture of the scene.
TEXTURE = "map"
# Name of the layer of a table that is no file.
WITHOUT_FILE = "table"
# Colour of gizmos without a colour column, linear Rec. 709.
ONE_COLOUR = (0.75, 0.2, 0.08)
# Pixels of the drawn map for each pixel of the picture's width: in front, a map is magnified.
MAP_PIXELS = 2
# Values are skewed if half of them lie in this share of their range, unless there are FEW.
SKEWED, FEW = 0.06, 10


@dataclass(frozen=True)
class DataPicture:
    """A scene that shows a table.

    scene: the scene
    drawn: the picture of the map, if none is given: it is to be written to the path of the scene's texture. Shape:
        uint8 (H, W, 3)
    choices: what was chosen, each a text by a name
    notes: what the picture does not show
    """

    scene: Scene
    drawn: np.ndarray | None
    choices: dict[str, str]
    notes: list[str]


def data_picture(source: str | TableValue, wishes: Wishes, map_path: str) -> DataPicture:
    """The scene that shows a table. Raises a UserError if the table or a wish is wrong.

    source: path of a file, or the table itself
    map_path: path of the texture if a map is drawn
    """
    table = table_from(source)
    asked = checked(table, wishes)
    wishes = completed(table, asked)
    layer = layer_for(source, table, wishes)
    lon, lat = places(layer, table)
    base = base_for(lon, lat, wishes)
    layer = sized(layer, base, lon, lat, wishes.size[0])
    name = _layer_name(source)
    legend = Legend(
        title=wishes.title, source=wishes.source_line, places=wishes.places, labels=wishes.labels, units=wishes.units,
        # A column that is shown as a size and as a colour needs one key.
        sizes=wishes.color not in (wishes.height, wishes.radius),
    )  # fmt: skip
    data = Data(base=base, layers={name: layer}, legend=legend, date=wishes.date)
    if flaws := data.flaws():
        raise UserError(*flaw_lines(table.path, flaws))
    rows = data.rows[name]
    if not len(rows):
        why = [", ".join(f"{n:,} {why}" for why, n in rows.counts.items()), *rows.notes]
        raise UserError(printable(f"{table.path}: no row can be shown; {'; '.join(why)}"))
    animation, names = animation_of(layer, base, wishes), []
    if animation is not None and asked.places == "auto" and wishes.places == "all":
        data, names = with_names(data, animation)
    drawn = None if wishes.image else basemap.drawn(base, MAP_PIXELS * wishes.size[0])
    scene = _scene(data, rows, wishes, wishes.image or map_path, animation)
    notes = [*names, *_notes(scene, rows, wishes)]
    if not (asked.height or asked.radius or asked.color):
        notes += passed_over(table, wishes)
    return DataPicture(scene, drawn, _choices(table, wishes, layer, base, len(rows.first)), notes)


def _scene(data: Data, rows: Rows, wishes: Wishes, texture: str, animation: Animation | None) -> Scene:
    """The scene of the data. texture: path of the map's picture. animation: of the scene"""
    width, height = wishes.size
    plain = ONE_COLOUR if rows.color is None else (1.0, 1.0, 1.0)
    materials = {
        BASE_MATERIAL: Material(kd=(1.0, 1.0, 1.0), texture=TEXTURE),
        DATA_MATERIAL: Material(kd=plain),
    }
    wrap = ("repeat", "clamp") if isinstance(data.base, GlobeBase) else "clamp"
    scene = Scene(
        film=altered(Film(), {"width": width, "height": height}),
        background=fitting.PAPER,
        ambient=(fit.AMBIENT,) * 3,
        textures={TEXTURE: ImageTexture(file=texture, wrap=wrap)},
        materials=materials,
        data=data,
        animation=animation,
        settings=Settings() if wishes.spp is None else altered(Settings(), {"spp": wishes.spp}),
    )
    return viewed(scene, rows)


def _layer_name(source: str | TableValue) -> str:
    """Name of the layer: that of the file, without dots."""
    if isinstance(source, TableValue):
        return WITHOUT_FILE
    name = Path(source).stem.replace(".", " ").strip() or "data"
    return f"{name} data" if name in RESERVED else name


def _choices(table: Table, wishes: Wishes, layer: DataLayer, base: Base, count: int) -> dict[str, str]:
    """What was chosen, by name."""
    chosen = {"rows": f"{count:,} of {len(table):,}"}
    if wishes.time_column is not None:
        chosen = {"places": f"{count:,}", "time": wishes.time_column}
    columns = ("lon", "lat", "height", "radius", "color")
    chosen |= {name: getattr(wishes, name) for name in columns if getattr(wishes, name)}
    chosen["gizmo"] = layer.gizmo
    if wishes.animate is not None:
        chosen["animation"] = f"{wishes.animate:g} s"
    if isinstance(base, GlobeBase):
        return chosen | {"base": "globe"}
    west, east, south, north = base.extent
    return chosen | {"base": "map", "extent": f"{west:g},{east:g},{south:g},{north:g}"}


def _notes(scene: Scene, rows: Rows, wishes: Wishes) -> list[str]:
    """What the picture does not show."""
    base, count, notes = scene.data.base, len(rows), []
    if not (wishes.height or wishes.radius or wishes.color):
        notes.append("no column of numbers is shown, so all gizmos are alike; write --height or --color with a column")
    if not wishes.image and not basemap.has_land(base):
        text = f"the map has no coasts, as it shows less than {basemap.COARSE:g} degrees; to show some, give a picture"
        notes.append(f"{text}: --map IMAGE --extent WEST,EAST,SOUTH,NORTH")
    if points := rows.counts.get("without a line"):
        text = "1 row is a point" if points == 1 else f"{points:,} rows are points"
        notes.append(f"{text}, and not shown; --gizmo sphere shows points, and no lines")
    if "lon" in rows.values and (nowhere := int(((rows.values["lon"] == 0) & (rows.values["lat"] == 0)).sum())):
        text = "1 row is" if nowhere == 1 else f"{nowhere:,} rows are"
        notes.append(f"{text} at longitude 0 and latitude 0, in the sea: is the position missing?")
    if (skewed := _skewed(rows)) and wishes.norm is None:
        notes.append(f"--color: {skewed}; most have nearly the same colour, and --norm quantile spreads them")
    if scene.animation is not None and min(wishes.size) < LEAST_SIDE:
        text = "are too few for a legend; its place is left free for larger pictures of the scene"
        notes.append(f"{wishes.size[0]} x {wishes.size[1]} pixels {text}")
    if isinstance(base, GlobeBase) and "lon" in rows.values and not turns(scene.animation):
        toward = np.array(scene.camera.origin)[:, None] - rows.stand.foot
        far = int(((rows.stand.up * toward).sum(axis=0) < 0).sum())
        if far:
            notes.append(f"{far:,} of {count:,} rows are on the far side of the globe; --base map shows all")
    return notes


def _skewed(rows: Rows) -> str:
    """Words that say where half of the values lie that are shown as colours, if that is a small part of their range;
    else ""."""
    values = rows.known("color") if "color" in rows.values else np.zeros(0)
    values = values[np.isfinite(values)]
    if len(values) < FEW:
        return ""
    low, middle, high = np.quantile(values, (0, 0.5, 1))
    if middle - low < SKEWED * (high - low):
        return f"half of the values are from {low:g} to {middle:g}, and the largest is {high:g}"
    if high - middle < SKEWED * (high - low):
        return f"half of the values are from {middle:g} to {high:g}, and the smallest is {low:g}"
    return ""
