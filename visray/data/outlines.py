"""Lines and outlines as segments on a base."""

from dataclasses import dataclass

import numpy as np

from visray.data.base import Base, GlobeBase, Ground
from visray.quantities import FARTHEST

# Longest step of a line on a globe, in degrees. Between, the segment runs below the globe by less than 4e-5 of its
# radius.
STEP = 1.0


@dataclass(frozen=True, eq=False)
class Segments:
    """Segments of lines.

    a, b: the ends in world units. Shapes: (N, 3).
    row: row of the line that each segment is a part of. Shape: (N).
    ground: the ground at a
    counts: number of points that are not on the base, by reason
    """

    a: np.ndarray
    b: np.ndarray
    row: np.ndarray
    ground: Ground
    counts: dict[str, int]

    @staticmethod
    def of(lines: list[tuple[int, np.ndarray]], base: Base, lift: float, kept: np.ndarray) -> "Segments":
        """The segments of lines whose rows are kept, raised by `lift`. A segment with an end outside of the base is
        left out, and so are those that cross the edge of a map from side to side."""
        starts, ends, row = [], [], []
        for number, line in lines:
            if not kept[number] or len(line) < 2:
                continue
            points = _fine(line) if isinstance(base, GlobeBase) else line
            starts.append(points[:-1])
            ends.append(points[1:])
            row.append(np.full(len(points) - 1, number))
        first, last = (np.concatenate(x) if x else np.zeros((0, 2)) for x in (starts, ends))
        rows = np.concatenate(row) if row else np.zeros(0, int)
        inside = base.inside(*first.T) & base.inside(*last.T)
        ground, far = base.place(*first.T), base.place(*last.T)
        a, b = ground.point + lift * ground.up, far.point + lift * far.up
        long = np.abs(b - a).max(axis=1, initial=0)
        fits = inside & (long >= 1 / FARTHEST) & (long < 0.5 * base.size)
        counts = {"segments outside of the map": int((~inside).sum())} if not inside.all() else {}
        parts = Ground(*(getattr(ground, name)[fits] for name in Ground.__dataclass_fields__))
        return Segments(a[fits], b[fits], rows[fits], parts, counts)


def _fine(line: np.ndarray) -> np.ndarray:
    """A line with points between, so that no step is longer than STEP. Shapes: (N, 2)."""
    steps = np.maximum(1, np.ceil(np.abs(np.diff(line, axis=0)).max(axis=1) / STEP)).astype(int)
    piece = np.repeat(np.arange(len(steps)), steps)
    share = (np.arange(len(piece)) - np.repeat(np.cumsum(steps) - steps, steps)) / steps[piece]
    between = line[piece] + share[:, None] * (line[piece + 1] - line[piece])
    return np.concatenate([between, line[-1:]])
