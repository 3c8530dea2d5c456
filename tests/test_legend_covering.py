"""Rows that the keys of a legend hide are counted."""

from dataclasses import replace

import numpy as np
import pytest

import visray as vr
from visray.data.gizmos import GIZMOS
from visray.legend.boxes import Box
from visray.legend.covering import covering_notes
from visray.legend.layer import drawn_legend
from visray.scene.check import checked

BOXES = ("right", "left", "bottom")


def scene(position: str, gizmo: str = "disk", count: int = 15) -> vr.Scene:
    """A map that fills the picture, seen from above."""
    lon, lat = (x.ravel() for x in np.meshgrid(np.linspace(-19, 19, count), np.linspace(-14, 14, count)))
    values = np.arange(len(lon)) + 1.0
    sizes = {"radius": 0.02} | ({"height": 0.01} if "height" in GIZMOS[gizmo].sizes else {})
    layer = vr.DataLayer(
        source={"lon": lon, "lat": lat, "v": values}, gizmo=gizmo, color="v", sunk=0.5, **sizes
    )  # fmt: skip
    return checked(
        vr.Scene(
            camera=vr.OrthographicCamera(origin=(0, 50, 0), target=(0, 0, 0), up=(0, 0, -1), height=7.5),
            film=vr.Film(width=400, height=300),
            data=vr.Data(
                base=vr.MapBase(extent=(-20, 20, -15, 15), width=10.0, depth=7.5),
                layers={"rain": layer},
                legend=vr.Legend(position=position),
            ),
            lights={},
        )
    )


@pytest.mark.parametrize("gizmo", ["disk", "sphere", "cylinder", "box"])
@pytest.mark.parametrize("position", BOXES)
def test_hidden_rows_are_counted(position: str, gizmo: str) -> None:
    made = scene(position, gizmo)
    rows, film = made.data.rows["rain"], made.film
    picture = drawn_legend(made, np.ones((film.height, film.width, 3)), np.ones((film.height, film.width)))
    (panel,) = picture.layout.panels
    # The map fills the picture, so 10 world units are 400 pixels.
    x, _, z = 40 * rows.ground.point.T
    x, y = x + 200, z + 150
    expected = int(((panel.left <= x) & (x <= panel.right) & (panel.top <= y) & (y <= panel.bottom)).sum())
    assert expected > 1
    assert any(f"its keys hide {expected} rows of the layer rain; " in note for note in picture.notes)


WHOLE = Box(0, 0, 400, 300)


def test_rows_behind_a_globe_are_not_hidden_by_the_legend() -> None:
    lon = np.array([0.0, 20.0, 180.0, 200.0])
    layer = vr.DataLayer(source={"lon": lon, "lat": 0 * lon, "v": lon + 1}, height=0.1, color="v")
    made = checked(
        vr.Scene(
            camera=vr.Camera(origin=(5, 0, 0)),
            film=vr.Film(width=400, height=300),
            data=vr.Data(layers={"a": layer}),
            lights={},
        )
    )
    (note,) = covering_notes(made, [WHOLE])
    assert "hide 2 rows of the layer a" in note and covering_notes(made, []) == []


@pytest.mark.parametrize(("lowest", "count"), [(0, 1), (150, 0)])
def test_a_line_is_hidden_if_all_its_segments_are(lowest: float, count: int) -> None:
    """The line goes on above a panel that begins in the middle."""
    layer = vr.DataLayer(source={"type": "LineString", "coordinates": [[-2, -3], [0, 8], [2, -4]]}, gizmo="line")
    made = scene("right")
    made = checked(replace(made, data=replace(made.data, layers={"roads": layer})))
    notes = covering_notes(made, [WHOLE._replace(top=lowest)])
    assert [note.split("; ")[0] for note in notes] == ["legend: its keys hide 1 row of the layer roads"] * count


def test_a_bar_that_is_seen_above_the_legend_is_not_hidden() -> None:
    made = scene("right", "cylinder", 1)
    layers = {"rain": replace(made.data.layers["rain"], height=3.0, sunk=0.0)}
    made = replace(made, camera=replace(made.camera, origin=(0, 50, 50)), data=replace(made.data, layers=layers))
    assert covering_notes(made, [WHOLE]) and not covering_notes(made, [WHOLE._replace(top=220)])
