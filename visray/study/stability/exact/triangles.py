"""Exact first hits of rays with closed meshes, in whole numbers.

A double is a whole number divided by 2^1074. So the numbers of a ray and of a triangle, multiplied by this power, are
whole numbers, and Python computes with them exactly.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from visray.geometry import gamma
from visray.study.stability.mesh_shapes import NamedMesh

SCALE = 1 << 1074
CHUNK = 1 << 18  # number of pairs of a ray and a triangle that NumPy tests at once
Whole = tuple[int, int, int]


def whole(v: np.ndarray) -> Whole:
    """Three doubles times 2^1074."""
    return tuple(n * (SCALE // k) for n, k in (float(x).as_integer_ratio() for x in v))


def dot(p: Whole, q: Whole) -> int:
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


def cross(p: Whole, q: Whole) -> Whole:
    return p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]


def minus(p: Whole, q: Whole) -> Whole:
    return p[0] - q[0], p[1] - q[1], p[2] - q[2]


@dataclass(frozen=True)
class Crossing:
    """The crossing of a line with the plane of a triangle that it may hit.

    face: number of the triangle
    inside: whether the line hits the triangle, edges and corners included
    certain: whether the line is inside by more than the rounding of double
    front: whether the line enters on the side to which the triangle's normal points
    numerator, denominator: their quotient is the distance
    rounding: bound on the error of the distance in double
    """

    face: int
    inside: bool
    certain: bool
    front: bool
    numerator: int
    denominator: int
    rounding: float

    @property
    def t(self) -> float:
        """The distance, rounded to a double."""
        return self.numerator / self.denominator

    def error(self, t: float) -> float:
        """The difference of a double from the exact distance."""
        n, k = t.as_integer_ratio()
        return (n * self.denominator - k * self.numerator) / (k * self.denominator)


@dataclass(frozen=True)
class ExactHit:
    """The first hit of a ray.

    near_edge: whether rounding may change what is hit, because the ray passes a silhouette
    crossing: the first hit; None without a hit
    faces: numbers of the triangles that may be hit there: several if the ray passes a common edge or corner
    rounding: bound on the error of the distance in double
    """

    near_edge: bool
    crossing: Crossing | None = None
    faces: tuple[int, ...] = ()
    rounding: float = 0.0


class ExactMesh:
    """A closed mesh whose first hits are found exactly."""

    def __init__(self, mesh: NamedMesh):
        self.vertices, self.faces = mesh.vertices, mesh.faces
        self.corners = [[whole(mesh.vertices[k]) for k in face] for face in mesh.faces]
        sides = [[minus(c[1], c[0]), minus(c[2], c[0])] for c in self.corners]
        self.normals = [cross(x, y) for x, y in sides]
        self.unit_normals = np.array([_unit(n) for n in self.normals])

    def first_hits(self, o: np.ndarray, d: np.ndarray) -> list[ExactHit]:
        """The first hits of rays. Shapes: (N, 3) each."""
        found = self.candidates(o, d, np.zeros(len(o)))
        return [_first(list(self._crossings(whole(o[i]), 1, d[i], o[i], *found[i]))) for i in range(len(o))]

    def first_hits_from(
        self, start: list[ExactHit], o: np.ndarray, d: np.ndarray, p: np.ndarray, out: np.ndarray, slack: np.ndarray
    ) -> list[ExactHit]:
        """The first hits of rays that leave the mesh at the exact hits of other rays.

        start, o, d: these hits, and the rays that hit, of shapes (N, 3)
        p: the hit points in double, with an error of at most `slack`. Shapes: (N, 3), (N)
        out: directions of the rays that leave. Shape: (N, 3)
        """
        found, results = self.candidates(p, out, slack), []
        for i, hit in enumerate(start):
            k = hit.crossing.denominator
            first, way = whole(o[i]), whole(d[i])
            # The exact point o + d numerator / denominator, times the denominator.
            origin = tuple(x * k + y * hit.crossing.numerator for x, y in zip(first, way))
            rows, certain = found[i]
            keep = rows != hit.crossing.face
            crossings = list(self._crossings(origin, k, out[i], p[i], rows[keep], certain[keep]))
            close = [c for c in crossings if abs(c.t) <= c.rounding + 4 * slack[i] * self._steepness(c, out[i])]
            results.append(ExactHit(near_edge=True) if close else _first(crossings))
        return results

    def _steepness(self, c: Crossing, d: np.ndarray) -> float:
        """1 over the cosine between a direction and a triangle's normal."""
        return 1 / max(abs(float(self.unit_normals[c.face] @ d)), gamma(8))

    def candidates(self, o: np.ndarray, d: np.ndarray, slack: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """For each ray, (numbers of the triangles that rounding does not exclude, whether each is surely met).

        slack: errors of the origins. Shape: (N)

        Error: the products d . (b x c) have an error of at most gamma(8) 2 |b| |c|, and those of the kernel one of
        gamma(24) 2 |b| |c|. An error e of the origin adds 2 e (|b| + |c|).
        """
        results, step = [], max(1, CHUNK // len(self.faces))
        for first in range(0, len(o), step):
            part = slice(first, first + step)
            corners = [self.vertices[self.faces[:, k]][None] - o[part, None] for k in range(3)]
            sizes = [np.linalg.norm(c, axis=2) for c in corners]
            inside, outside = [], []
            for k in range(3):
                b, c = (k + 1) % 3, (k + 2) % 3
                volume = np.einsum("ij,ikj->ik", d[part], np.cross(corners[b], corners[c]))
                bound = gamma(64) * sizes[b] * sizes[c] + 2 * slack[part, None] * (sizes[b] + sizes[c])
                inside.append(volume > bound)
                outside.append(volume < -bound)
            maybe = ~(np.any(inside, axis=0) & np.any(outside, axis=0))
            certain = np.all(inside, axis=0) | np.all(outside, axis=0)
            for row, sure in zip(maybe, certain):
                faces = np.flatnonzero(row)
                results.append((faces, sure[faces]))
        return results

    def _crossings(
        self, o: Whole, scale: int, d: np.ndarray, near: np.ndarray, faces: np.ndarray, certain: np.ndarray
    ) -> Iterator[Crossing]:
        """The crossings with some triangles, in front of the origin and behind it; none if the ray is in the plane.

        o: the exact origin times `scale`
        near: the origin in double
        """
        way = whole(d)
        for face, sure in zip(faces.tolist(), certain.tolist()):
            a, b, c = (minus(tuple(x * scale for x in v), o) for v in self.corners[face])
            volumes = [dot(way, cross(p, q)) for p, q in ((b, c), (c, a), (a, b))]
            n = self.normals[face]
            slope = dot(way, n)
            if not slope:
                continue
            inside = (min(volumes) >= 0 or max(volumes) <= 0) and any(volumes)
            reach = np.linalg.norm(self.vertices[self.faces[face]] - near, axis=1).max()
            cosine = max(abs(float(self.unit_normals[face] @ d)), gamma(8))
            sign = 1 if slope > 0 else -1
            numerator, denominator = sign * dot(a, n), sign * slope * scale
            rounding = gamma(4) * abs(numerator / denominator) + gamma(6) * reach / cosine
            yield Crossing(face, inside, sure, slope < 0, numerator, denominator, rounding)


def _unit(n: Whole) -> np.ndarray:
    """The unit vector of a vector of whole numbers."""
    most = max(map(abs, n))
    v = np.array([x / most for x in n])
    return v / np.linalg.norm(v)


def _first(crossings: list[Crossing]) -> ExactHit:
    """The first hit among the crossings of a ray.

    A ray near edges or corners is judged if all triangles there are seen from the same side, because it cannot pass
    between them. Where some are seen from the front and some from behind, it passes a silhouette.
    """
    ahead = [c for c in crossings if c.numerator > 0]
    hits = [c for c in ahead if c.inside]
    if not hits:
        return ExactHit(near_edge=any(not c.certain for c in ahead))
    first = min(hits, key=lambda c: c.t)
    together = [c for c in ahead if abs(c.t - first.t) <= c.rounding + first.rounding]
    before = [c for c in ahead if c.t < first.t and c not in together]
    silhouette = len({c.front for c in together}) > 1 and not first.certain
    rounding = max(c.rounding for c in together)
    return ExactHit(bool(before) or silhouette, first, tuple(c.face for c in together), rounding)
