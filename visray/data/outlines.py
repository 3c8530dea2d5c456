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
    counts: number of segments that are left out, by reason
    """

    a: np.ndarray
    b: np.ndarray
    row: np.ndarray
    ground: Ground
    counts: dict[str, int]

    @staticmethod
    def of(lines: list[tuple[int, np.ndarray]], base: Base, lift: float) -> "Segments":
        """The segments of lines, in the order of their rows, raised by `lift`. A segment with an end outside of the
        base is left out, and so is one that crosses the edge of a map. Domain: all points are on earth."""
        starts, ends, row = [], [], []
        for number, line in sorted(lines, key=lambda pair: pair[0]):
            if len(line) < 2:
                continue
            first, last = _short_way(line[:-1], line[1:])
            if isinstance(base, GlobeBase):
                first, last = _fine(first, last)
            starts.append(first)
            ends.append(last)
            row.append(np.full(len(first), number))
        first, last = (np.concatenate(x) if x else np.zeros((0, 2)) for x in (starts, ends))
        rows = np.concatenate(row) if row else np.zeros(0, int)
        inside = base.inside(*first.T) & base.inside(*last.T)
        across = inside & ~base.joined(first[:, 0], last[:, 0])
        ground, far = base.place(*first.T), base.place(*last.T)
        a, b = ground.point + lift * ground.up, far.point + lift * far.up
        fits = inside & ~across & (np.abs(b - a).max(axis=1, initial=0) >= 1 / FARTHEST)
        found = {"segments outside of the map": ~inside, "segments across the edge of the map": across}
        counts = {reason: int(mask.sum()) for reason, mask in found.items() if mask.any()}
        parts = Ground(*(getattr(ground, name)[fits] for name in Ground.__dataclass_fields__))
        return Segments(a[fits], b[fits], rows[fits], parts, counts)

    def of_rows(self, kept: np.ndarray) -> "Segments":
        """The segments of some rows. kept: mask of the rows"""
        mine = kept[self.row]
        ground = Ground(*(getattr(self.ground, name)[mine] for name in Ground.__dataclass_fields__))
        return Segments(self.a[mine], self.b[mine], self.row[mine], ground, self.counts)


def _short_way(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Segments that take the shorter way around the earth: of two places that are more than 180 degrees of longitude
    apart, one is moved by 360. Those that go all around it, as the edge of a map of the earth does, stay as they are.
    Shapes: (N, 2)."""
    apart = last[:, 0] - first[:, 0]
    turn = np.where((np.abs(apart) > 180) & (np.abs(apart) < 360), -360.0 * np.sign(apart), 0.0)
    # The end that stays on earth is moved: longitudes go from -360 to 360.
    of_last = np.abs(last[:, 0] + turn) <= 360
    first, last = first.copy(), last.copy()
    last[:, 0] += np.where(of_last, turn, 0.0)
    first[:, 0] -= np.where(of_last, 0.0, turn)
    return first, last


def _fine(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Segments in pieces, so that none is longer than STEP. Shapes: (N, 2)."""
    steps = np.maximum(1, np.ceil(np.abs(last - first).max(axis=1) / STEP)).astype(int)
    piece = np.repeat(np.arange(len(steps)), steps)
    number = np.arange(len(piece)) - np.repeat(np.cumsum(steps) - steps, steps)
    way = last - first
    begin, end = (first[piece] + ((number + i) / steps[piece])[:, None] * way[piece] for i in (0, 1))
    # The ends are those of the line, bit for bit.
    return begin, np.where((number + 1 == steps[piece])[:, None], last[piece], end)
