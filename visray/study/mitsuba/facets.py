"""Round shapes as triangles, for Mitsuba.

Mitsuba has no cone, and no sphere or disk under every affine map. Its cylinder has no caps, takes no such map either,
and solves its equation in single precision, not recentred: at a hundred radii it is off by a hundredth of one. Its
instances would take such maps, but in them rays pass between triangles.
"""

from dataclasses import dataclass

import numpy as np

# How many facets there are around a shape at most, and how many triangles all shapes of a kind together may have.
FINEST = {"disk": 1024, "cylinder": 1024, "cone": 1024, "sphere": 512, "capsule": 512, "torus": 512}
# Those that are bent both ways, so that there are as many rings as facets around.
BENT = ("sphere", "capsule", "torus")
MOST = 2**20


def around(kind: str, count: int) -> int:
    """The number of facets around each of `count` shapes of a kind."""
    n = FINEST[kind]
    while n > 16 and count * (n * n if kind in BENT else 4 * n) > MOST:
        n //= 2
    return n


@dataclass(frozen=True)
class Facets:
    """Triangles inscribed in a canonical shape.

    vertices and normals (N, 3), uv (N, 2), faces (M, 3). Normals are the shape's own gradients: interpolated over a
    facet they are parallel to the shape's. gap: the largest distance from the shape; slip: the largest error of u and
    v, which are linear on a facet; tilt: that of the normals in radians.
    """

    vertices: np.ndarray
    normals: np.ndarray
    uv: np.ndarray
    faces: np.ndarray
    gap: float
    slip: float
    tilt: float


@dataclass(frozen=True)
class Profile:
    """A line that is turned about z. Rows: radius and z; radial and axial part of the gradient; v.

    turn: the angle at u = 0, in turns. Without v: u and v as on the square around a disk.
    """

    points: tuple
    gradients: tuple
    v: tuple | None = None
    turn: float = 0.5


def _disk(z: float) -> Profile:
    up = -1 if z < 0 else 1
    return Profile(((1, z), (0, z)), ((0, up), (0, up)))


def _profiles(kind: str, n: int, shape: float | None) -> list[Profile]:
    if kind == "disk":
        return [_disk(0)]
    if kind == "cylinder":
        return [Profile(((1, -1), (1, 1)), ((1, 0), (1, 0)), (0, 1)), _disk(1), _disk(-1)]
    if kind == "cone":
        return [Profile(((1, -1), (0, 1)), ((1, 0.5), (0, 0)), (0, 1)), _disk(-1)]
    if kind == "capsule":
        return [_capsule(n, shape)]
    if kind == "torus":
        around = np.linspace(-np.pi, np.pi, n + 1)
        gradients = np.stack([np.cos(around), np.sin(around)], 1)
        return [Profile((1, 0) + shape * gradients, gradients, around / (2 * np.pi) + 0.5)]
    # As Mitsuba's own: v from 0 at the north pole to 1. At the poles the radius is made exactly 0.
    polar = np.linspace(0, np.pi, n // 2 + 1)[::-1]
    points = np.stack([np.sin(polar), np.cos(polar)], 1)
    points[[0, -1], 0] = 0
    return [Profile(points, points, polar / np.pi, turn=0.0)]


def _capsule(n: int, half: float) -> Profile:
    """Two quarters of a circle about the ends of the axis, and the wall between them."""
    polar = np.linspace(0, np.pi / 2, n // 4 + 1)
    lower, upper = (np.stack([np.sin(a), sign * np.cos(a)], 1) for a, sign in ((polar, -1), (polar[::-1], 1)))
    # At the poles the radius is made exactly 0, and at the wall's ends the gradient level.
    lower[0, 0] = upper[-1, 0] = lower[-1, 1] = upper[0, 1] = 0
    way = np.concatenate([polar, 2 * half + np.pi - polar[::-1]])
    points = np.concatenate([lower - (0, half), upper + (0, half)])
    return Profile(points, np.concatenate([lower, upper]), way / (2 * half + np.pi))


def facets(kind: str, n: int, shape: float | None = None) -> Facets:
    """The triangles of a canonical shape with n facets around it, seen from outside counter-clockwise. shape: of a
    capsule half its axis, of a torus its minor radius, over the other radius."""
    strips = [rows for p in _profiles(kind, n, shape) for rows in _strips(p, n)]
    rows = np.concatenate([strip.reshape(-1, 8) for strip in strips])
    vertices = rows[:, :3]
    # A ring of the sphere is as high as it is wide: both bends add. Elsewhere facets are straight along the profile. A
    # torus is up to 2 wide, and its tube narrower.
    sagitta = float(1 - np.cos(np.pi / n))
    gap = sagitta * {"sphere": 2, "capsule": 2, "torus": 3}.get(kind, 1)
    slip = 1 / n if kind in ("cone", *BENT) else 0.0
    # Of a gradient that is neither level nor upright only the radial part is interpolated short.
    tilt = sagitta if kind in ("cone", "torus") else 0.0
    faces = np.arange(len(rows)).reshape(-1, 3)
    return Facets(vertices, rows[:, 3:6], rows[:, 6:], faces, gap, slip, tilt)


def _strips(p: Profile, n: int) -> list[np.ndarray]:
    """The triangles between neighbouring points of a profile: position, gradient, u, v. Shapes: (n, 3, 8) each."""
    found = []
    for k in range(len(p.points) - 1):
        low, high = p.points[k][0] > 0, p.points[k + 1][0] > 0
        i = np.arange(n)
        left, right, middle = i, i + 1, i + 0.5
        corner = [_corner(p, n, turn, k + up) for turn, up in ((left, 0), (right, 0), (right, 1), (left, 1))]
        if low and high:
            found += [np.stack([corner[a] for a in triangle], 1) for triangle in ((0, 1, 2), (0, 2, 3))]
        elif low:
            found.append(np.stack([corner[0], corner[1], _corner(p, n, middle, k + 1)], 1))
        else:
            found.append(np.stack([_corner(p, n, middle, k), corner[2], corner[3]], 1))
        if p.v is None and p.gradients[k][1] < 0:
            found[-1] = found[-1][:, ::-1]
    return found


def _corner(p: Profile, n: int, turn: np.ndarray, k: int) -> np.ndarray:
    """Point k of a profile, turned. Shapes: (n) -> (n, 8)."""
    (radius, z), (radial, axial) = p.points[k], p.gradients[k]
    x, y, one = np.cos(2 * np.pi * turn / n), np.sin(2 * np.pi * turn / n), np.ones(n)
    if p.v is None:
        u, v = 0.5 + 0.5 * radius * x, 0.5 + 0.5 * radius * y * np.sign(axial)
    else:
        # By facet, so that none spans the seam.
        before = np.arange(n) < round(p.turn * n)
        u, v = turn / n + p.turn * np.where(before, 1, -1), p.v[k] * one
    return np.stack([radius * x, radius * y, z * one, radial * x, radial * y, axial * one, u, v], 1)
