"""Round shapes as triangle meshes, for Mitsuba.

Mitsuba has no cone, and no sphere or disk under a general affine map. Mitsuba's cylinder has no caps, and no general
affine map either. Besides, Mitsuba solves the equation of a cylinder in single precision without moving the origin near
the cylinder first: at a distance of a hundred radii, the error is a hundredth of a radius. Mitsuba's instances accept
affine maps, but some rays pass between the triangles of an instance.
"""

from dataclasses import dataclass

import numpy as np

# MOST_FACETS: largest number of facets around a shape. MOST_TRIANGLES: about the largest number of triangles in all
# shapes of one kind together.
MOST_FACETS = {"disk": 1024, "cylinder": 1024, "cone": 1024, "sphere": 512, "capsule": 512, "torus": 512}
MOST_TRIANGLES = 2**20
# Shapes that are curved in both directions: their number of rings grows with the number of facets around.
DOUBLY_CURVED = ("sphere", "capsule", "torus")


def facets_around(kind: str, count: int) -> int:
    """Number of facets around each shape of a kind, if the scene has `count` of them."""
    n = MOST_FACETS[kind]
    while n > 16 and count * (n * n if kind in DOUBLY_CURVED else 4 * n) > MOST_TRIANGLES:
        n //= 2
    return n


@dataclass(frozen=True)
class Tessellation:
    """Triangles inscribed in a canonical shape, which is a shape of standard size before its transform.

    vertices: positions of the vertices, (N, 3)
    normals: gradients of the shape at the vertices. Interpolated over a facet, they are parallel to the shape's normals
        up to `tilt`. (N, 3)
    uv: texture coordinates of the vertices, (N, 2)
    faces: vertex numbers of the triangles, counter-clockwise as seen from outside, (M, 3)
    gap: largest distance between the triangles and the shape
    slip: largest error of u and v, which comes from linear interpolation over a facet
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
    """A curve (a list of points) that is rotated about the z axis to make a surface.

    points: (radius, z) of each point
    gradients: (radial, axial) part of the shape's gradient at each point
    v: texture coordinate v at each point; None: a disk, with u and v on the square around it
    turn: angle about the z axis at which u is 0, in full turns
    """

    points: tuple
    gradients: tuple
    v: tuple | None = None
    turn: float = 0.5


def _disk(z: float) -> Profile:
    """The profile of a disk of radius 1 at height z. Its normal points down if z < 0, otherwise up."""
    up = -1 if z < 0 else 1
    return Profile(((1, z), (0, z)), ((0, up), (0, up)))


def _profiles(kind: str, n: int, parameter: float | None) -> list[Profile]:
    """The profiles of a canonical shape with n facets around. parameter: see `tessellate`."""
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
    # The sphere: v runs from 0 at the north pole to 1 at the south pole, as on Mitsuba's own sphere. The radius at the
    # poles is set to exactly 0.
    polar = np.linspace(0, np.pi, n // 2 + 1)[::-1]
    points = np.stack([np.sin(polar), np.cos(polar)], 1)
    points[[0, -1], 0] = 0
    return [Profile(points, points, polar / np.pi, turn=0.0)]


def _capsule(n: int, half: float) -> Profile:
    """The profile of a capsule: two quarter circles about the ends of the axis, and the wall between them.

    half: half the length of the axis over the radius
    """
    polar = np.linspace(0, np.pi / 2, n // 4 + 1)
    lower, upper = (np.stack([np.sin(a), sign * np.cos(a)], 1) for a, sign in ((polar, -1), (polar[::-1], 1)))
    # The radius at the poles is set to exactly 0. The gradients at the ends of the wall are made exactly radial.
    lower[0, 0] = upper[-1, 0] = lower[-1, 1] = upper[0, 1] = 0
    arc_length = np.concatenate([polar, 2 * half + np.pi - polar[::-1]])
    points = np.concatenate([lower - (0, half), upper + (0, half)])
    return Profile(points, np.concatenate([lower, upper]), arc_length / (2 * half + np.pi))


def tessellate(kind: str, n: int, parameter: float | None = None) -> Tessellation:
    """The triangles of a canonical shape with n facets around it.

    parameter: for a capsule, half the length of its axis over its radius; for a torus, its minor over its major radius
    """
    strips = [strip for profile in _profiles(kind, n, parameter) for strip in _strips(profile, n)]
    corners = np.concatenate([strip.reshape(-1, 8) for strip in strips])
    # On a sphere and a capsule, rings are as high as facets are wide, so the gaps of both directions add. The outer
    # radius of a torus is at most 2 and that of its tube at most 1, so the gaps add to at most three times `sagitta`.
    # The other profiles are straight.
    sagitta = float(1 - np.cos(np.pi / n))
    gap = sagitta * {"sphere": 2, "capsule": 2, "torus": 3}.get(kind, 1)
    slip = 1 / n if kind in ("cone", *DOUBLY_CURVED) else 0.0
    # Interpolation shortens only the radial part of a gradient. If the gradient has an axial part too, this turns it.
    tilt = sagitta if kind in ("cone", "torus") else 0.0
    faces = np.arange(len(corners)).reshape(-1, 3)
    return Tessellation(corners[:, :3], corners[:, 3:6], corners[:, 6:], faces, gap, slip, tilt)


def _strips(p: Profile, n: int) -> list[np.ndarray]:
    """Triangles between neighbouring points of a profile: a list of arrays.

    An array has, for each corner of a triangle, position (3), gradient (3), u and v. n: number of facets around.
    Shapes: (n, 3, 8) each.
    """
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
    """Position, gradient, u and v of point k of a profile, after a rotation by `turn` facets.

    n: number of facets around
    Shapes: turn (n) -> (n, 8).
    """
    (radius, z), (radial, axial) = p.points[k], p.gradients[k]
    x, y, one = np.cos(2 * np.pi * turn / n), np.sin(2 * np.pi * turn / n), np.ones(n)
    if p.v is None:
        u, v = 0.5 + 0.5 * radius * x, 0.5 + 0.5 * radius * y * np.sign(axial)
    else:
        # All corners of a facet get u from the same side of the seam, so that no facet crosses the seam.
        before = np.arange(n) < round(p.turn * n)
        u, v = turn / n + p.turn * np.where(before, 1, -1), p.v[k] * one
    return np.stack([radius * x, radius * y, z * one, radial * x, radial * y, axial * one, u, v], 1)
