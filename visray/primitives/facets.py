"""Round shapes as meshes, for Mitsuba: any affine map of them is a mesh again, which is not so for Mitsuba's own.

Mitsuba's own cylinder, besides, solves its equation in single precision and not recentred: seen from a hundred radii it
is off by a hundredth of one.
"""

from dataclasses import dataclass

import numpy as np

from visray.primitives.primitive import Twin, homogeneous

# The sagitta, 1 - cos(pi/1024), is 5e-6 of the radius: as much as single precision makes of 80 radii.
FACETS = 1024


@dataclass(frozen=True)
class Strip:
    """A strip around the axis z, between two circles of (radius, z); the second may be a point, or one on the axis.

    normal: (radial, axial), as a gradient. v: at the two circles, u being the angle; None: u and v as on the square
    around the disk.
    """

    start: tuple[float, float]
    end: tuple[float, float]
    normal: tuple[float, float]
    v: tuple[float, float] | None = None


def revolved(frame: tuple, outer: np.ndarray | None, *strips: Strip) -> Twin:
    """The twin of strips placed by a frame (x, y, z, o) and a transform. Normals are exact, but at an apex."""
    whole = np.array(homogeneous(*(np.array(v, float) for v in frame), outer))
    corners, normals, uv = (np.concatenate(part) for part in zip(*map(_corners, strips)))
    normals = normals @ np.linalg.inv(whole[:3, :3])
    shape = {
        "type": "mesh",
        "vertices": corners @ whole[:3, :3].T + whole[:3, 3],
        "normals": normals / np.linalg.norm(normals, axis=1, keepdims=True),
        "uv": uv,
        "faces": np.arange(len(corners)).reshape(-1, 3),
    }
    # |x| and |y| together bound how far the map carries a vector across the axis.
    sagitta = (1 - np.cos(np.pi / FACETS)) * np.hypot(*np.linalg.norm(whole[:3, :2], axis=0))
    pointed = any(s.end[0] == 0 and s.normal[0] for s in strips)
    return Twin([shape], uv=lambda found: found, gap=float(sagitta), tilt=np.pi / FACETS if pointed else 0.0)


def _corners(s: Strip) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The corners of a strip's facets, three for each, with gradients and (u, v). Shapes: (N, 3), (N, 3), (N, 2)."""
    i = np.arange(FACETS)
    left, right, middle = i, i + 1, i + 0.5
    one = [(left, s.start, 0), (right, s.start, 0), (right if s.end[0] else middle, s.end, 1)]
    two = [(left, s.start, 0), (right, s.end, 1), (left, s.end, 1)] if s.end[0] else []
    found = []
    for turn, (radius, z), end in one + two:
        x, y = np.cos(2 * np.pi * turn / FACETS), np.sin(2 * np.pi * turn / FACETS)
        along = np.ones(FACETS)
        if s.v:
            u, v = turn / FACETS + np.where(i < FACETS // 2, 0.5, -0.5), s.v[end] * along
        else:
            u, v = 0.5 + 0.5 * radius * x, 0.5 + 0.5 * radius * y * np.sign(s.normal[1])
        found.append([radius * x, radius * y, z * along, s.normal[0] * x, s.normal[0] * y, s.normal[1] * along, u, v])
    # The order (corner, number, facet) becomes rows of corners, three to a facet, seen from outside counter-clockwise.
    rows = np.array(found).reshape(-1, 3, 8, FACETS)[:, :: -1 if s.normal[1] < 0 else 1]
    rows = rows.transpose(0, 3, 1, 2).reshape(-1, 8)
    return rows[:, :3], rows[:, 3:6], rows[:, 6:]
