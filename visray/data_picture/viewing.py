"""Camera, lights and legend of a picture of a table."""

from dataclasses import replace

import numpy as np

from visray import fitting
from visray.data import fit
from visray.data.base import Base, GlobeBase
from visray.data.row_balls import row_balls
from visray.data.rows import Rows
from visray.data_picture.animated import places_move, turns
from visray.legend.content import legend_content
from visray.legend.fonts import Pen, fonts_for, quiet
from visray.legend.layout import LEAST_SIDE, REFERENCE_PIXELS, layout
from visray.scene.scene import Scene

# Space between what is shown and the legend or the edge of the picture. The picture is from -1 to 1.
MARGIN = 0.04
# Smallest part of a side of the picture that a legend may leave. If it leaves less, it covers what is shown.
LEAST_PART = 0.35
# A map that is wider than the picture is seen from higher up: by so many degrees, if the camera is not so many times
# farther away then.
STEEPER, FARTHER = (5.0, 10.0), 1.03


def viewed(scene: Scene, rows: Rows) -> Scene:
    """The scene with a camera, lights, and the legend at the side where it leaves most room."""
    base = scene.data.base
    balls = _gizmo_balls(base, rows)
    if scene.animation is not None:
        balls = _at_all_times(scene, rows, balls)
    at = fit.POPULATED
    if isinstance(base, GlobeBase):
        at = fit.middle_of(*_weighted(rows))
    lowest = fit.ELEVATION if "height" in rows.gizmo.sizes else fit.ELEVATION_FLAT
    axes = fit.axes_over(base, at, lowest)
    view = min((_fitted(scene, balls, axes, position) for position in ("right", "bottom")), key=_distance)
    if isinstance(base, GlobeBase):
        return view
    window, aspect = _window(view), scene.film.size[0] / scene.film.size[1]
    for step in STEEPER:
        steeper = fit.axes_over(base, at, lowest + step)
        if _distance(replace(view, camera=fitting.fitted_view(balls, steeper, aspect, window))) <= FARTHER * _distance(
            view
        ):
            axes = steeper
    return _fitted(scene, balls, axes, view.data.legend.position)


def _weighted(rows: Rows) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Longitudes and latitudes on a globe that a picture should show, with weights: those of the rows with their sizes,
    or those of the segments of lines with their lengths. Shapes: (N) each."""
    if rows.gizmo.name != "line":
        values = rows.values if rows.in_time is None else rows.in_time.largest
        sizes = values.get("height", values.get("radius", np.ones(len(rows))))
        return rows.values["lon"], rows.values["lat"], np.abs(sizes)
    x, y, z = rows.ground.up.T
    length = np.linalg.norm(rows.fields["b"] - rows.fields["a"], axis=0)
    return np.degrees(np.arctan2(-z, x)), np.degrees(np.arcsin(np.clip(y, -1, 1))), length


def _fitted(scene: Scene, balls: fitting.Balls, axes: np.ndarray, position: str) -> Scene:
    """The scene with a camera with given axes, lights, and the legend at one side.

    balls: what the picture shows
    position: of the legend
    """
    aspect, window = scene.film.size[0] / scene.film.size[1], fitting.Window()
    legend = replace(scene.data.legend, position=position)
    scene = replace(scene, data=replace(scene.data, legend=legend), lights=fitting.fitted_lights(balls, axes))
    # The sizes in a legend, and so its own size, depend on the camera.
    for _ in range(2):
        scene = replace(scene, camera=fitting.fitted_view(balls, axes, aspect, window))
        window = _window(scene)
    return replace(scene, camera=fitting.fitted_view(balls, axes, aspect, window))


def _distance(scene: Scene) -> float:
    """Distance of the camera from its target."""
    return float(np.linalg.norm(np.subtract(scene.camera.target, scene.camera.origin)))


def _window(scene: Scene) -> fitting.Window:
    """The part of the picture that the legend of a scene leaves free."""
    scene = _legible(scene)
    width, height = scene.film.size
    content = legend_content(scene)
    with quiet():
        pen = Pen(fonts_for(content.texts(), content.font))
        boxes = dict(layout(content, width, height, pen).boxes)
    panels = [box for name, box in boxes.items() if name.startswith("panel")]
    left, right, top, bottom = 0.0, float(width), 0.0, float(height)
    if "heading" in boxes:
        top = boxes["heading"].bottom
    if "source" in boxes:
        bottom = boxes["source"].top
    if scene.data.legend.position == "bottom":
        bottom = min([bottom, *(box.top for box in panels)])
    else:
        right = min([right, *(box.left for box in panels)])
    if right - left < LEAST_PART * width:
        left, right = 0.0, float(width)
    if bottom - top < LEAST_PART * height:
        top, bottom = 0.0, float(height)
    return fitting.Window(
        left=2 * left / width - 1 + MARGIN,
        right=2 * right / width - 1 - MARGIN,
        bottom=1 - 2 * bottom / height + MARGIN,
        top=1 - 2 * top / height - MARGIN,
    )


def _legible(scene: Scene) -> Scene:
    """An animated scene with a film of the usual size, if its own is too small for a legend: it may be a draft of a
    larger one, to which the camera must fit as well."""
    width, height = scene.film.size
    if scene.animation is None or min(width, height) >= LEAST_SIDE:
        return scene
    scale = (REFERENCE_PIXELS / (width * height)) ** 0.5
    return replace(scene, film=replace(scene.film, width=round(scale * width), height=round(scale * height)))


def _at_all_times(scene: Scene, rows: Rows, balls: fitting.Balls) -> fitting.Balls:
    """What an animation shows. balls: what the rows of one date show, with the largest sizes of all dates."""
    base, [layer] = scene.data.base, scene.data.layers.values()
    if places_move(layer, base):
        lon, lat = (rows.in_time.known[key] for key in ("lon", "lat"))
        lon, lat = (x[base.inside(lon, lat)] for x in (lon, lat))
        sizes = {key: float(x.max()) for key, x in rows.in_time.sizes.items()}
        balls = balls.joined(fit.balls(base, lon, lat, sizes.get("height", 0.0), sizes["radius"]))
    if not turns(scene.animation):
        return balls
    centre = fit.outline(base).centre
    reach = (np.linalg.norm(balls.centre - centre, axis=1) + balls.radius).max()
    return fitting.Balls(centre, np.array([reach]))


def _gizmo_balls(base: Base, rows: Rows) -> fitting.Balls:
    """The base and all gizmos; of places that change in time, with the largest sizes of all dates."""
    return fit.outline(base).joined(row_balls(rows))
