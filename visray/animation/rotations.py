"""Rotations and directions between two others, the short way."""

import math

import numpy as np

from visray.geometry import gamma

# Roundings of a cosine: those of two normalisations and of a sum of four products.
_ROUNDINGS = 20


def arc(a: np.ndarray, b: np.ndarray) -> float:
    """Angle between two unit vectors. It is accurate for all angles."""
    return 2 * math.atan2(float(np.linalg.norm(a - b)), float(np.linalg.norm(a + b)))


def slerp(a: np.ndarray, b: np.ndarray, share: float) -> np.ndarray:
    """Unit vector on the great circle from a to b, at a share of the way. Domain: unit vectors that are not
    opposite."""
    angle = arc(a, b)
    sine = math.sin(angle)
    if sine == 0:
        return a
    mixed = math.sin((1 - share) * angle) / sine * a + math.sin(share * angle) / sine * b
    return mixed / np.linalg.norm(mixed)


def unit(v: np.ndarray) -> np.ndarray:
    """The vector with length 1. Domain: not 0."""
    v = v / np.abs(v).max()
    return v / np.linalg.norm(v)


def opposite(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two unit vectors are opposite, so that no way between them is the shorter one."""
    return bool(np.linalg.norm(a + b) <= gamma(_ROUNDINGS))


def quaternion(degrees: float, axis: np.ndarray) -> np.ndarray:
    """The rotation by an angle about an axis as a unit quaternion (w, x, y, z)."""
    half = math.radians(degrees) / 2
    return np.concatenate([[math.cos(half)], math.sin(half) * unit(axis)])


def nearer(q: np.ndarray, previous: np.ndarray) -> np.ndarray:
    """q or -q, which are the same rotation: that from which the way to `previous` is short. If the rotations differ by
    half a turn, both ways are equal, and q stays: the rotation goes on as its angle is written."""
    return -q if q @ previous < -gamma(_ROUNDINGS) else q


def angle_and_axis(q: np.ndarray, axis: np.ndarray) -> tuple[float, np.ndarray]:
    """Angle in degrees and axis of a unit quaternion. axis: that of a rotation by 0."""
    length = float(np.linalg.norm(q[1:]))
    if length == 0:
        return 0.0, axis
    return math.degrees(2 * math.atan2(length, float(q[0]))), q[1:] / length


def of_matrix(m: np.ndarray) -> np.ndarray:
    """Unit quaternion of a rotation matrix. Shape: (3, 3)."""
    # The largest of the four squares is at least 1/4, so that nothing cancels (S. W. Shepperd, 1978).
    trace = np.trace(m)
    squares = np.array([trace, *np.diag(m)])
    k = int(np.argmax(squares))
    if k == 0:
        q = np.array([1 + trace, m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    else:
        i, j, l = k - 1, k % 3, (k + 1) % 3
        q = np.empty(4)
        q[0] = m[l, j] - m[j, l]
        q[1 + i] = 1 + 2 * m[i, i] - trace
        q[1 + j], q[1 + l] = m[i, j] + m[j, i], m[i, l] + m[l, i]
    return q / np.linalg.norm(q)


def matrix(q: np.ndarray) -> np.ndarray:
    """Rotation matrix of a unit quaternion. Shape: (3, 3)."""
    w, v = q[0], q[1:]
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def polar(linear: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The rotation R and the symmetric stretch S with R S = linear. For a map that mirrors, S is negative. Shape:
    (3, 3)."""
    u, s, vt = np.linalg.svd(linear)
    sign = 1.0 if np.linalg.det(u @ vt) > 0 else -1.0
    return sign * u @ vt, sign * (vt.T * s) @ vt
