"""Operands of CSG that are watertight meshes, in 80-bit floats: every triangle is tested with every ray."""

from functools import cached_property

import numpy as np
from csg_leaves import Unframed
from csg_sets import IN, OUT, UNKNOWN, Sets
from samples import Real, dot, norm, real, unit

# Most rays that are tested at once.
CHUNK = 256


class Shell(Unframed):
    """A watertight mesh whose triangles turn counter-clockwise seen from outside."""

    @cached_property
    def corners(self) -> np.ndarray:
        """Shape: (triangles, 3 corners, 3)."""
        return real(self.thing.vertices.values)[self.faces]

    @property
    def faces(self) -> np.ndarray:
        return np.asarray(self.thing.faces.values, int)

    @cached_property
    def normals(self) -> np.ndarray:
        a, b, c = self.corners.transpose(1, 0, 2)
        return np.cross(b - a, c - a)

    @cached_property
    def edges(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """(corners of each edge, edges of each triangle, whether the triangle runs it forwards, the triangles of each
        edge). Shapes: (E, 2), (T, 3), (T, 3), (E, 2)."""
        sides = np.stack([self.faces, np.roll(self.faces, -1, 1)], 2).reshape(-1, 2)
        ends, of = np.unique(np.sort(sides, 1), axis=0, return_inverse=True)
        order = np.argsort(of.ravel(), kind="stable")
        assert np.array_equal(np.bincount(of.ravel()), np.full(len(ends), 2)), "the mesh is not watertight"
        return ends, of.reshape(-1, 3), (sides[:, 0] < sides[:, 1]).reshape(-1, 3), (order // 3).reshape(-1, 2)

    def hull(self) -> tuple[np.ndarray, float]:
        p = np.asarray(self.thing.vertices.values, float)
        middle = (p.min(0) + p.max(0)) / 2
        return middle, float(np.linalg.norm(p - middle, axis=1).max())

    def sets(self, o: np.ndarray, d: np.ndarray) -> Sets:
        o, d = self.local(o, d)
        slack = self.slack(o, d, 0.0)
        parts = [self._crossings(o[i : i + CHUNK], d[i : i + CHUNK], slack[i : i + CHUNK])
                 for i in range(0, len(o), CHUNK)]  # fmt: skip
        most = max(len(p[0]) for p in parts)
        t, sign, error = (
            np.concatenate([np.pad(p[k], ((0, most - len(p[k])), (0, 0)), constant_values=fill) for p in parts], 1)
            for k, fill in enumerate((np.inf, 0, 0))
        )

        def state(at: np.ndarray) -> np.ndarray:
            depth, near = np.zeros(at.shape, int), np.zeros(at.shape, bool)
            for x, s, e in zip(t, sign, error):
                depth += np.where(x < at, s, 0)
                near |= (x - e < at) & (at < x + e)
            return np.where(near, UNKNOWN, np.where(depth > 0, IN, OUT))

        return Sets.of(np.concatenate([t - error, t + error]), state)

    def _crossings(self, o: np.ndarray, d: np.ndarray, slack: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(distances, 1 where the ray enters and -1 where it leaves, errors) of all crossings of lines, and of all
        outlines that they pass within rounding, with 0 for the sign. Shapes: (K, N)."""
        ends, of, forwards, pairs = self.edges
        middle = real(self.hull()[0])
        shift = dot(middle - o, d) / dot(d, d)
        near = o + shift[:, None] * d
        p = real(self.thing.vertices.values)[None] - near[:, None]
        a, b = p[:, ends[:, 0]], p[:, ends[:, 1]]
        turn = np.cross(a, b)
        volume = (turn * d[:, None]).sum(2)
        # Both triangles of an edge read one sign, so that no line passes between them, whatever the rounding.
        sides = (volume >= 0)[:, of] == forwards
        leaves, enters = sides.all(2), ~sides.any(2)
        slope = d @ self.normals.T
        height = (p[:, self.faces[:, 0]] * self.normals).sum(2)
        steep = np.abs(slope) / norm(self.normals)
        with np.errstate(all="ignore"):
            t, error = height / slope + shift[:, None], slack[:, None] / steep
            # Where an edge between a front and a back is passed within rounding, the line may touch.
            across = np.cross(b - a, d[:, None])
            outline = (slope[:, pairs[:, 0]] < 0) != (slope[:, pairs[:, 1]] < 0)
            outline &= np.abs(volume) <= slack[:, None] * norm(across)
            share = -(np.cross(a, d[:, None]) * across).sum(2) / (across**2).sum(2)
            outline &= (share > -0.01) & (share < 1.01)
            reached = ((a + share[..., None] * (b - a)) * d[:, None]).sum(2) / dot(d, d)[:, None] + shift[:, None]
            flat = slack[:, None] / np.minimum(steep[:, pairs[:, 0]], steep[:, pairs[:, 1]])
        hit = leaves | enters
        t = np.concatenate([np.where(hit, t, np.inf), np.where(outline, reached, np.inf)], 1).T
        sign = np.concatenate([np.where(enters, 1, -1), np.zeros_like(outline, int)], 1).T
        error = np.concatenate([error, 2 * flat], 1).T
        order = np.argsort(t, 0, kind="stable")[: max(1, int(np.isfinite(t).sum(0).max()))]
        t, sign, error = (np.take_along_axis(x, order, 0) for x in (t, sign, error))
        return t, np.where(np.isfinite(t), sign, 0), np.where(np.isfinite(t), error, 0).astype(Real)

    def surface(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        parts = [self._nearest(p[i : i + CHUNK]) for i in range(0, len(p), CHUNK)]
        if not parts:
            return np.zeros(0, Real), np.zeros((0, 3), Real)
        distance, face, _ = (np.concatenate(x) for x in zip(*parts))
        return distance, unit(self.normals)[face]

    def crease(self, p: np.ndarray) -> np.ndarray:
        return np.concatenate([self._nearest(p[i : i + CHUNK])[2] for i in range(0, len(p), CHUNK)])

    def _nearest(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(distance of the nearest triangle, less than 0 inside; its number; the point's distance from its edges)."""
        n, a = unit(self.normals)[:, None], self.corners.transpose(1, 0, 2)[:, :, None]
        height = ((p - a[0]) * n).sum(2)
        within, nearest = np.full(height.shape, np.inf, Real), np.full(height.shape, np.inf, Real)
        for k in range(3):
            side, way = a[(k + 1) % 3] - a[k], p - a[k]
            within = np.minimum(within, (way * unit(np.cross(n, side))).sum(2))
            share = np.clip((way * side).sum(2) / (side * side).sum(2), 0, 1)
            nearest = np.minimum(nearest, norm(way - share[..., None] * side))
        distance = np.where(within >= 0, np.abs(height), nearest)
        face = distance.argmin(0)
        best, edge = (np.take_along_axis(x, face[None], 0)[0] for x in (distance, within))
        return np.where(self._inside(p), -best, best), face, np.maximum(edge, 0)

    def _inside(self, p: np.ndarray) -> np.ndarray:
        """By the solid angle of all triangles (van Oosterom and Strackee 1983), which is 4 pi inside."""
        a, b, c = self.corners.transpose(1, 0, 2)[:, :, None] - p
        x, y, z = norm(a), norm(b), norm(c)
        volume = (a * np.cross(b, c)).sum(2)
        angle = np.arctan2(volume, x * y * z + (a * b).sum(2) * z + (b * c).sum(2) * x + (c * a).sum(2) * y)
        return angle.sum(0) > np.pi
