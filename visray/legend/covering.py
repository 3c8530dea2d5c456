"""Which rows of the data the keys of a legend hide."""

from collections.abc import Sequence

import numpy as np

from visray.data.rows import Rows
from visray.legend.boxes import Box
from visray.projection import projected
from visray.scene.scene import Scene


def covering_notes(scene: Scene, panels: Sequence[Box]) -> list[str]:
    """Sentences about the rows of each layer that would be seen, but lie below a panel with their lower and upper ends.
    panels: those of the legend."""
    if not panels:
        return []
    advice = "write another position or size in data.legend, turn the camera, or make the film larger"
    notes = []
    for name, rows in scene.data.rows.items():
        if found := _hidden(scene, rows, panels):
            text = "1 row" if found == 1 else f"{found:,} rows"
            notes.append(f"legend: its keys hide {text} of the layer {name}; {advice}")
    return notes


def _hidden(scene: Scene, rows: Rows, panels: Sequence[Box]) -> int:
    """Number of rows of a layer of which all is below one panel. Without rows it is 0."""
    if not len(rows):
        return 0
    low, high = (_below(scene, points, panels) for points in _ends(rows))
    gizmos = (low & high).any(axis=0) & ~rows.hidden
    # A line is hidden if all its segments are.
    return int(np.logical_and.reduceat(gizmos, rows.first).sum())


def _ends(rows: Rows) -> tuple[np.ndarray, np.ndarray]:
    """The lower and upper ends of gizmos, or the two ends of segments. Shapes: (N, 3)."""
    if rows.gizmo.name == "line":
        return rows.fields["a"].T, rows.fields["b"].T
    stand = rows.stand
    extent = stand.height if "height" in rows.gizmo.sizes else 2 * stand.radius * (not rows.gizmo.flat)
    bottom, up = stand.foot, stand.up * stand.sign * extent
    return (bottom - up * stand.sunk).T, (bottom + up * (1 - stand.sunk)).T


def _below(scene: Scene, points: np.ndarray, panels: Sequence[Box]) -> np.ndarray:
    """Whether points are visible but for each of the panels. Shapes: (N, 3) -> (P, N)."""
    found = projected(scene, points)
    with np.errstate(invalid="ignore"):
        inside = [
            (p.left <= found.x) & (found.x <= p.right) & (p.top <= found.y) & (found.y <= p.bottom) for p in panels
        ]
    return np.array(inside) & found.visible
