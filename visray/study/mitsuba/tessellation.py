"""Round shapes as triangle meshes, for Mitsuba.

Mitsuba has no cone, and no sphere or disk under a general affine map. Its cylinder has no caps and takes no such map
either. It solves the cylinder's equation in single precision without recentring: at a distance of a hundred radii the
result is off by a hundredth of a radius. Mitsuba's instances would take such maps, but rays pass between their
triangles.
"""

from dataclasses import dataclass

import numpy as np

# Facets around a shape at most, and triangles of all shapes of a kind together at most.
MOST_FACETS = {"disk": 1024, "cylinder": 1024, "cone": 1024, "sphere": 512, "capsule": 512, "torus": 512}
MOST_TRIANGLES = 2**20
# Shapes that are curved in both directions: they have as many rings as facets around.
DOUBLY_CURVED = ("sphere", "capsule", "torus")


def facets_around(kind: str, count: int) -> int:
    """Number of facets around each of `count` shapes of a kind."""
    n = MOST_FACETS[kind]
    while n > 16 and count * (n * n if kind in DOUBLY_CURVED else 4 * n) > MOST_TRIANGLES:
        n //= 2
    return n


@dataclass(frozen=True)
class Tessellation:
    """Triangles inscribed in a canonical shape.

    vertices: (N, 3)
    normals: gradients of the shape; interpolated over a facet they are parallel to the shape's own, (N, 3)
    uv: (N, 2)
    faces: vertex numbers of the triangles, counter-clockwise as seen from outside, (M, 3)
    gap: largest distance from the shape
    slip: largest error of u and v, which are linear on a facet
    tilt: largest error of the normals (radians)
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
    """A curve that is rotated about the z axis.

    points: radius and z of each point
    gradients: radial and axial part of the shape's gradient at each point
    v: texture coordinate at each point; None: u and v are those of the square around a disk
    turn: the angle where u = 0, in full turns
    """

    points: tuple
    gradients: tuple
    v: tuple | None = None
    turn: float = 0.5


def _disk(z: float) -> Profile:
    up = -1 if z < 0 else 1
    return Profile(((1, z), (0, z)), ((0, up), (0, up)))


def _profiles(kind: str, n: int, parameter: float | None) -> list[Profile]:
    """The curves of a canonical shape with n facets around."""
    if kind == "disk":
        return [_disk(0)]
    if kind == "cylinder":
        return [Profile(((1, -1), (1, 1)), ((1, 0), (1, 0)), (0, 1)), _disk(1), _disk(-1)]
    if kind == "cone":
        return [Profile(((1, -1), (0, 1)), ((1, 0.5), (0, 0)), (0, 1)), _disk(-1)]
    if kind == "capsule":
        return [_capsule(n, parameter)]
    if kind == "torus":
        around = np.linspace(-np.pi, np.pi, n + 1)
        gradients = np.stack([np.cos(around), np.sin(around)], 1)
        return [Profile((1, 0) + parameter * gradients, gradients, around / (2 * np.pi) + 0.5)]
    # The sphere: v runs from 0 at the north pole to 1, as on Mitsuba's own sphere. The poles get exactly radius 0.
    polar = np.linspace(0, np.pi, n // 2 + 1)[::-1]
    points = np.stack([np.sin(polar), np.cos(polar)], 1)
    points[[0, -1], 0] = 0
    return [Profile(points, points, polar / np.pi, turn=0.0)]


def _capsule(n: int, half: float) -> Profile:
    """Two quarter circles about the ends of the axis, and the wall between them."""
    polar = np.linspace(0, np.pi / 2, n // 4 + 1)
    lower, upper = (np.stack([np.sin(a), sign * np.cos(a)], 1) for a, sign in ((polar, -1), (polar[::-1], 1)))
    # The poles get exactly radius 0, and the ends of the wall a gradient that is exactly radial.
    lower[0, 0] = upper[-1, 0] = lower[-1, 1] = upper[0, 1] = 0
    arc_length = np.concatenate([polar, 2 * half + np.pi - polar[::-1]])
    points = np.concatenate([lower - (0, half), upper + (0, half)])
    return Profile(points, np.concatenate([lower, upper]), arc_length / (2 * half + np.pi))


def tessellate(kind: str, n: int, parameter: float | None = None) -> Tessellation:
    """The triangles of a canonical shape with n facets around it.

    parameter: of a capsule half its axis over its radius; of a torus its minor radius over its major one
    """
    strips = [strip for profile in _profiles(kind, n, parameter) for strip in _strips(profile, n)]
    corners = np.concatenate([strip.reshape(-1, 8) for strip in strips])
    # On a sphere, rings are as high as facets are wide, and the gaps of both directions add. Elsewhere facets are
    # straight along the profile. A torus has radius 2 at most, and its tube is narrower.
    sagitta = float(1 - np.cos(np.pi / n))
    gap = sagitta * {"sphere": 2, "capsule": 2, "torus": 3}.get(kind, 1)
    slip = 1 / n if kind in ("cone", *DOUBLY_CURVED) else 0.0
    # Interpolation shortens only the radial part of a gradient. That turns a gradient that has an axial part as well.
    tilt = sagitta if kind in ("cone", "torus") else 0.0
    faces = np.arange(len(corners)).reshape(-1, 3)
    return Tessellation(corners[:, :3], corners[:, 3:6], corners[:, 6:], faces, gap, slip, tilt)


def _strips(p: Profile, n: int) -> list[np.ndarray]:
    """Triangles between neighbouring points of a profile: position, gradient, u, v. Shapes: a list of (n, 3, 8)."""
    strips = []
    for k in range(len(p.points) - 1):
        low, high = p.points[k][0] > 0, p.points[k + 1][0] > 0
        i = np.arange(n)
        left, right, middle = i, i + 1, i + 0.5
        corner = [_corner(p, n, turn, k + up) for turn, up in ((left, 0), (right, 0), (right, 1), (left, 1))]
        if low and high:
            strips += [np.stack([corner[a] for a in triangle], 1) for triangle in ((0, 1, 2), (0, 2, 3))]
        elif low:
            strips.append(np.stack([corner[0], corner[1], _corner(p, n, middle, k + 1)], 1))
        else:
            strips.append(np.stack([_corner(p, n, middle, k), corner[2], corner[3]], 1))
        if p.v is None and p.gradients[k][1] < 0:
            strips[-1] = strips[-1][:, ::-1]
    return strips


def _corner(p: Profile, n: int, turn: np.ndarray, k: int) -> np.ndarray:
    """Point k of a profile, rotated by `turn` facets: position, gradient, u, v. Shapes: (n) -> (n, 8)."""
    (radius, z), (radial, axial) = p.points[k], p.gradients[k]
    x, y, one = np.cos(2 * np.pi * turn / n), np.sin(2 * np.pi * turn / n), np.ones(n)
    if p.v is None:
        u, v = 0.5 + 0.5 * radius * x, 0.5 + 0.5 * radius * y * np.sign(axial)
    else:
        # Each facet decides for itself on which side of the seam it lies, so that none spans the seam.
        before = np.arange(n) < round(p.turn * n)
        u, v = turn / n + p.turn * np.where(before, 1, -1), p.v[k] * one
    return np.stack([radius * x, radius * y, z * one, radial * x, radial * y, axial * one, u, v], 1)
