"""Names of places beside their points, where they cover neither each other nor the rest of the legend.

Places are taken in their order. Each gets the first of eight positions around its point that is free, also of the
gizmos of other places; or else the first that is free of texts. If there is none, it has no name in the picture. So the
same places always get the same positions.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from visray.legend.boxes import ASCENT, LEADING, Box, TextLine
from visray.legend.fonts import Pen
from visray.legend.parts import Place

# Height of a name, distance from its point, space on each side, and radius of a dot, in heights of the legend's text.
NAME, AWAY, SIDE, DOT = 0.88, 0.2, 0.15, 0.18
# Largest distance of a name from its point for the sake of a gizmo, in the same unit.
FARTHEST = 2.5
# Directions from the point to the middle of the name, the best first: right, left, above, below, and the corners.
SIDES = ((1, 0), (-1, 0), (0, -1), (0, 1), (1, -1), (1, 1), (-1, -1), (-1, 1))
# Largest number of names, beyond which none is legible in any film.
MOST = 2000


@dataclass(frozen=True)
class Label:
    """The name of a place in the picture. box: what it covers. dot: the point and the radius of its dot, or None."""

    line: TextLine
    box: Box
    dot: tuple[float, float, float] | None


def labels_of(
    places: Sequence[Place], taken: Iterable[Box], width: int, height: int, em: float, pen: Pen
) -> tuple[list[Label], list[str]]:
    """The names of places that have room, and the names of those that have none.

    taken: boxes that must stay free. width, height: size of the film. em: height of the legend's text.
    """
    size, labels, left_out = NAME * em, [], []
    covered, gizmos = _Covered(taken, len(places)), _Covered((), len(places))
    for place in places:
        gizmos.add(_around(place, place.radius))
    for i, place in enumerate(places):
        free = [] if i >= MOST or not place.name.strip() else _free(place, covered, width, height, em, pen)
        box = next((b for b in free if not gizmos.meets(b, i)), free[0] if free else None)
        if box is None:
            left_out.append(place.name)
            continue
        line = TextLine(place.name, box.left + SIDE * em, box.top + ASCENT * size, size, f"place {i}")
        labels.append(Label(line, box, (place.x, place.y, DOT * em) if place.dotted else None))
        covered.add(box)
        if place.dotted:
            covered.add(_around(place, DOT * em))
    return labels, left_out


def _around(place: Place, radius: float) -> Box:
    """The square around the point of a place."""
    return Box(place.x - radius, place.y - radius, place.x + radius, place.y + radius)


class _Covered:
    """Boxes that are covered already, as one array, because there may be many. boxes: the first of them. n: number of
    places, each of which adds at most two."""

    def __init__(self, boxes: Iterable[Box], n: int):
        first = np.array(list(boxes), float).reshape(-1, 4)
        self._boxes = np.concatenate([first, np.zeros((2 * n, 4))])
        self._count = len(first)

    def add(self, box: Box) -> None:
        self._boxes[self._count] = box
        self._count += 1

    def meets(self, box: Box, but: int = -1) -> bool:
        """Whether one of them overlaps a box. but: number of one that does not count."""
        left, top, right, bottom = self._boxes[: self._count].T
        met = (left < box.right) & (box.left < right) & (top < box.bottom) & (box.top < bottom)
        if but >= 0:
            met[but] = False
        return bool(met.any())


def _free(place: Place, covered: _Covered, width: int, height: int, em: float, pen: Pen) -> list[Box]:
    """The free boxes beside a place for its name, the best first."""
    if not (0 <= place.x <= width and 0 <= place.y <= height):
        return []
    across, tall = pen.width(place.name, NAME * em) + 2 * SIDE * em, NAME * em * LEADING
    away, found = AWAY * em + min(place.radius, FARTHEST * em), []
    for x, y in SIDES:
        # At a corner of the box, so that it is about as far away as at a side.
        near = away * (0.7 if x and y else 1)
        left = place.x + x * (near + across / 2) - across / 2
        top = place.y + y * (near + tall / 2) - tall / 2
        found.append(Box(left, top, left + across, top + tall))
    return [box for box in found if box.inside(width, height) and not covered.meets(box)]
