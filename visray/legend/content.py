"""What the legend of a scene says: from its data and its camera to texts, colours and positions in pixels."""

from difflib import get_close_matches
from typing import Any

import numpy as np

from visray.camera import OrthographicCamera
from visray.data.base import GlobeBase
from visray.data.resolved_colors import ResolvedColors
from visray.data.rows import Rows
from visray.data.size_rule import SizeRule
from visray.legend.bars import bar_of, different
from visray.legend.labels import label, label_notes
from visray.legend.parts import LegendContent, Place, SizeScale
from visray.legend.ticks import EXACT, distinct_texts, round_values, round_values_of_log
from visray.projection import Projected, projected
from visray.scene.scene import Scene

# Largest size of a gizmo in a key, as a share of the film's shorter side, and the least that is seen, in pixels.
LARGEST, LEAST = 0.14, 1.0
# The same of a logarithmic scale: readers can complete it only between two keys.
LARGEST_OF_LOG = 0.3
# Number of gizmos in a scale of sizes.
SHOWN = 3


def legend_content(scene: Scene) -> LegendContent | None:
    """What the legend of a scene says; None if it has none. Domain: a scene that was checked."""
    if scene.data is None or scene.data.legend is None:
        return None
    legend, layers = scene.data.legend, scene.data.layers
    bars, sizes, notes = [], [], label_notes(scene.data)
    for name, rows in scene.data.rows.items():
        if not len(rows):
            continue
        if legend.bars and isinstance(rows.rules.get("color"), ResolvedColors):
            text = label(legend, name, layers[name], "color")
            bars.append(bar_of(text, rows.rules["color"], rows.known("color")))
        for key in rows.gizmo.sizes if legend.sizes else ():
            if isinstance(rows.rules.get(key), SizeRule):
                scale = _scale(scene, rows, key, label(legend, name, layers[name], key))
                sizes.append(scale)
                if not scale.entries:
                    what = "radii" if key == "radius" else f"{key}s"
                    notes.append(
                        f"legend: the {what} of {scale.label} have no key, because they are too large or too small"
                    )
    written = ("title", "subtitle", "source", "no_data", "position", "theme", "size", "font")
    own = {name: getattr(legend, name) for name in written}
    kept, places = (scale for scale in sizes if scale.entries), _places(scene, notes)
    own["date"] = scene.data.date_text or ""
    return LegendContent(
        **own, bars=tuple(different(bars)), sizes=tuple(kept), places=tuple(places), notes=tuple(notes)
    )


def _scale(scene: Scene, rows: Rows, key: str, label: str) -> SizeScale:
    """The scale of the heights or radii of a layer; without entries if none can be shown."""
    rule, values = rows.rules[key], np.abs(rows.known(key))
    values = values[~np.isnan(values)]
    shape = "bar" if key == "height" else "square" if rows.gizmo.name == "box" else "disk"
    most = float(values.max(initial=0.0))
    if rule.domain is None:
        # All values are the same.
        found = [most] if most > 0 else []
    elif rule.scale == "log":
        least = float(values.min(initial=most))
        found = round_values_of_log(least, most) if 0 < least < most else [most] if most > 0 else []
    else:
        # Below a domain that begins above 0, sizes would be below the range, and even negative.
        least = 0.0 if rule.domain[0] <= 0 else min(float(values.min(initial=most)), most)
        found = [v for v in round_values(least, most) if v > 0] if least < most else [most] if most > 0 else []
    # A value has the same size whatever other values there are, because the rule's domain is known.
    world = np.abs(rule.sizes(np.array(found), rule.range).size) if found else np.zeros(0)
    pixels = world * (_height_pixels(scene, rows) if key == "height" else 2 * _width_pixels(scene, rows))
    limit = (LARGEST_OF_LOG if rule.scale == "log" else LARGEST) * min(scene.film.size)
    fitting = [i for i in range(len(found)) if LEAST <= pixels[i] <= limit]
    kept = [fitting[i] for i in sorted({0, (len(fitting) - 1) // 2, len(fitting) - 1})] if fitting else []
    return SizeScale(label, shape, tuple((t, float(pixels[i])) for t, i in zip(_texts(found, kept), kept)))


def _texts(values: list[float], kept: list[int]) -> list[str]:
    """Some of the values as texts."""
    return distinct_texts([values[i] for i in kept], EXACT)


def _shown(scene: Scene, points: np.ndarray) -> Projected:
    """Those of the points that are visible, projected; all that are before the camera if none is visible."""
    found = projected(scene, points)
    kept = found.visible if found.visible.any() else found.depth > 0
    return Projected(*(x[kept] for x in (found.x, found.y, found.depth, found.visible)))


def _width_pixels(scene: Scene, rows: Rows) -> float:
    """Pixels of a world unit across the view, at the median depth of the rows that are seen."""
    depth = _shown(scene, rows.ground.point).depth
    if not len(depth):
        return 0.0
    camera = scene.camera
    parallel = isinstance(camera, OrthographicCamera)
    extent = camera.height if parallel else 2 * np.tan(np.radians(camera.fov) / 2) * float(np.median(depth))
    return scene.film.size[1] / extent


def _height_pixels(scene: Scene, rows: Rows) -> float:
    """Pixels of a world unit along the normal of the base: on a map, as the camera foreshortens it in the middle of the
    rows; on a globe, as at its edge, where nothing is foreshortened."""
    scale = _width_pixels(scene, rows)
    if isinstance(scene.data.base, GlobeBase) or not len(rows):
        return scale
    origin, target = (np.array(v, float) for v in (scene.camera.origin, scene.camera.target))
    seen = target if isinstance(scene.camera, OrthographicCamera) else np.median(rows.ground.point, axis=0)
    sight = seen - origin
    cosine = float(rows.ground.up[0] @ sight) / float(np.linalg.norm(sight))
    return scale * float(np.sqrt(max(0.0, 1 - cosine**2)))


def _places(scene: Scene, notes: list[str]) -> list[Place]:
    """The places that are named and seen: further points first, then rows. notes: gets one for unknown names."""
    data, legend = scene.data, scene.data.legend
    named: list[tuple[str, np.ndarray, bool, float]] = []
    for name, (lon, lat) in legend.points.items():
        where = np.array([lon]), np.array([lat])
        if data.base.inside(*where)[0]:
            named.append((name, data.base.place(*where).point[0], True, 0.0))
        else:
            notes.append(f'legend: the point "{name}" lies outside of the map')
    if legend.places != "none":
        named += [(name, point, False, radius) for name, point, radius in _wanted(scene, notes)]
    if not named:
        return []
    found = projected(scene, np.array([point for _, point, _, _ in named]))
    return [
        Place(name, float(found.x[i]), float(found.y[i]), dotted, radius)
        for i, (name, _, dotted, radius) in enumerate(named)
        if found.visible[i]
    ]


def _wanted(scene: Scene, notes: list[str]) -> list[tuple[str, np.ndarray, float]]:
    """Names, points and radii in pixels of the rows that are to be named. notes: gets one for each unknown name.

    A name that several layers have at one point is taken once, with the largest radius.
    """
    if all(rows.texts is None for rows in scene.data.rows.values()):
        notes.append("legend: no place is named, as no layer has a column of names; give a layer the field name")
        return []
    found: dict[tuple, tuple[str, np.ndarray, float]] = {}
    for rows in scene.data.rows.values():
        pixels = _width_pixels(scene, rows)
        for name, point, radius in _named_rows(rows):
            key = name, *point.tolist()
            before = found[key][2] if key in found else 0.0
            found[key] = name, point, max(before, radius * pixels)
    wanted = scene.data.legend.places
    if wanted == "all":
        return list(found.values())
    first = {name: entry for entry in reversed(found.values()) for name in (entry[0],)}
    notes += [_unknown(name, first) for name in wanted if name not in first]
    return [first[name] for name in dict.fromkeys(wanted) if name in first]


def _named_rows(rows: Rows) -> list[tuple[str, np.ndarray, float]]:
    """Names, points and radii of the rows of a layer that have a name, those with the largest sizes first."""
    if rows.texts is None:
        return []
    if rows.gizmo.name == "line":
        # A line has many segments of one name; the first stands for all.
        first = {name: i for i, name in reversed(list(enumerate(rows.texts)))}
        return [(rows.texts[i], rows.ground.point[i], 0.0) for i in sorted(first.values()) if rows.texts[i].strip()]
    # The largest sizes of all dates, so that names stay where they are while bars grow.
    largest = rows.values if rows.in_time is None else rows.in_time.largest
    size = next((np.abs(largest[key]) for key in ("height", "radius") if key in largest), np.zeros(len(rows)))
    named = (i for i in np.argsort(-size, kind="stable").tolist() if rows.texts[i].strip() and not rows.hidden[i])
    radius = rows.stand.radius if rows.in_time is None else rows.in_time.sizes["radius"]
    return [(rows.texts[i], rows.ground.point[i], float(radius[i])) for i in named]


def _unknown(name: str, known: dict[str, Any]) -> str:
    """The note on a name that no row has."""
    near = get_close_matches(name, known, 1)
    hint = f'; did you mean "{near[0]}"?' if near else ""
    return f'legend: no row that is shown has the name "{name}"{hint}'
