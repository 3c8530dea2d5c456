"""Cuts polygons into triangles."""

import numpy as np

from visray.geometry import gamma
from visray.meshes.triangle_mesh import MeshError, edge_vectors, without_area

# Largest number of corners of a concave polygon: the time to cut it grows with the square.
MOST_CORNERS = 10_000


def triangulated(vertices: np.ndarray, corners: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of polygons: for each its three places in `corners`, and its polygon.

    vertices: positions
    corners: vertices of all polygons, one polygon after the other
    sizes: number of corners of each polygon, at least 3

    A convex polygon becomes a fan around its first corner. Others, and those with corners on one line, are cut ear by
    ear, so that no triangle lies outside and none is without area.

    Shapes: vertices (V, 3), corners (C), sizes (P); result (F, 3) and (F).
    """
    first = np.cumsum(sizes) - sizes
    if (sizes == 3).all():
        return np.arange(len(corners)).reshape(-1, 3), np.arange(len(sizes))
    polygon = np.repeat(np.arange(len(sizes)), sizes - 2)
    # The place of a triangle in its fan.
    place = np.arange(len(polygon)) - np.repeat(np.cumsum(sizes - 2) - (sizes - 2), sizes - 2)
    fans = first[polygon][:, None] + np.stack([np.zeros_like(place), place + 1, place + 2], axis=1)
    normals = np.cross(*edge_vectors(vertices, corners[fans]))
    # The vector area of a polygon is the sum of those of its fan, whatever its form.
    area = np.stack([np.bincount(polygon, normals[:, i], len(sizes)) for i in range(3)], axis=1)
    # A triangle without area would leave a corner in the middle of an edge of its neighbour.
    backwards = (normals * area[polygon]).sum(axis=1) < 0
    bent = np.unique(polygon[backwards | without_area(vertices, corners[fans])])
    # A quad with an inward corner is cut along the other diagonal.
    quad = np.searchsorted(polygon, bent[sizes[bent] == 4])
    fans[quad] += [1, 1, 1]
    fans[quad + 1] += [1, 1, -3]
    bent = bent[sizes[bent] > 4]
    if (count := sizes[bent].max(initial=0)) > MOST_CORNERS:
        raise MeshError("file", f"has a concave face of {count:,} corners; visray cuts up to {MOST_CORNERS:,}")
    for p in bent:
        own = slice(*np.searchsorted(polygon, [p, p + 1]))
        fans[own] = first[p] + _ears(vertices[corners[first[p] : first[p] + sizes[p]]], area[p])
    return fans, polygon


def _ears(points: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Triangles of one polygon, cut off corner by corner. Shapes: points (N, 3), area (3); result (N - 2, 3).

    Where no corner can be cut off (a polygon that crosses itself), the rest becomes a fan.
    """
    # The projection along the largest component of the area keeps the order of the corners.
    axis = int(np.abs(area).argmax())
    plane = np.delete(points, axis, axis=1)
    if (area[axis] < 0) != (axis == 1):
        plane = plane[:, ::-1]
    left, triangles, start = np.arange(len(points)), [], 0
    while len(left) > 3:
        # The search goes on where the last ear was: from the first corner, a long outline would be searched over again.
        for step in range(len(left)):
            place = (start + step) % len(left)
            ear = left[[place - 1, place, (place + 1) % len(left)]]
            if _is_ear(plane, ear, left):
                break
        else:
            break
        triangles.append(ear)
        left, start = np.delete(left, place), place
    return np.array([*triangles, *((left[0], left[i], left[i + 1]) for i in range(1, len(left) - 1))])


def _is_ear(plane: np.ndarray, ear: np.ndarray, left: np.ndarray) -> bool:
    """Whether a corner of a polygon is convex, and its triangle holds no other corner.

    Shapes: plane (N, 2), ear (3): the corner between its neighbours, left (L): the corners that are not cut off.
    """
    a, b, c = plane[ear]
    if _turn(a, b, c) <= 0:
        return False
    rest = plane[left]
    inside = (_turn(a, b, rest) >= 0) & (_turn(b, c, rest) >= 0) & (_turn(c, a, rest) >= 0)
    # The three corners themselves, and others at their places (a seam of a polygon with a hole), are no obstacle.
    return bool((rest[inside][:, None] == plane[ear]).all(axis=2).any(axis=1).all())


def _turn(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Twice the area of the triangles a, b, p in a plane: positive where p lies to the left of a b, 0 where its sign is
    lost in rounding."""
    first, second = (b[0] - a[0]) * (p[..., 1] - a[1]), (b[1] - a[1]) * (p[..., 0] - a[0])
    certain = np.abs(first - second) > gamma(4) * (np.abs(first) + np.abs(second))
    return np.where(certain, first - second, 0.0)
