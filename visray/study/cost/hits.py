"""Geometry of a choice: first hits and self-shadows, compared with those of the reference."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray import integrator, warp
from visray.accel.intersect import Target, closest, occluded
from visray.accel.origin import RayOrigin
from visray.interaction import Interaction, interact
from visray.kernel_scene import KernelScene
from visray.ray import Ray, unit
from visray.setup import Prepared
from visray.study.cost.records import Geometry
from visray.study.mitsuba.visray_scene import to_numpy


@dataclass(frozen=True)
class View:
    """First hits of rays from the camera.

    kernel, si: the scene, and the surface interactions as shaded
    names: names of the objects, in the order of the scene
    index: index of the object in `names`, -1 for none, shape (N)
    t: distance, inf for none, shape (N)
    n: outward unit normal, shape (N, 3)
    """

    kernel: KernelScene
    si: Interaction
    names: tuple[str, ...]
    index: np.ndarray
    t: np.ndarray
    n: np.ndarray


def geometry(prepared: Prepared, truth: Prepared, seed: int = 0) -> Geometry:
    """Compares first hits along rays through pixel centres, in double, and the occlusion of rays that leave them.

    Both are the same scene with other settings. Objects are told by name, because settings may change their order.
    Where both hit the same object, a random ray leaves it over the hemisphere on the viewer's side (cosine distributed
    about the reference's normal): the same direction from the hit point of each, as in the integrator. Rays that run
    below the surface of one of them are left out: the integrator does not trace them.
    """
    a = truth.a
    ray = integrator.camera_ray(truth.kernel, a.F(truth.x) + 0.5, a.F(truth.y) + 0.5).exact()
    right, other = _view(truth, ray), _view(prepared, ray)
    place = {name: i for i, name in enumerate(right.names)}
    index = np.array([place[name] for name in other.names] + [-1])[other.index]
    same = (index == right.index) & (index >= 0)
    t, n = right.t[same], right.n[same]
    steps, angles = np.abs(other.t[same] - t) / np.spacing(t), _angles(other.n[same], n)

    u, v = np.random.default_rng(seed).uniform(size=(2, len(same)))
    normal = dr.select(right.si.hit.valid, a.W(right.si.n), a.W(0, 0, 1))
    d = unit(warp.cosine(normal, a.D(u), a.D(v)), a.W)
    active = a.B(same) & (dr.dot(a.W(right.si.n), d) > 0) & (dr.dot(a.W(other.si.n), d) > 0)
    dr.eval(d, active)
    hidden, visible = _hidden(other, d, active), ~_hidden(right, d, active)
    return Geometry(
        rays=len(same),
        lost=int(((right.index >= 0) & (index < 0)).sum()),
        added=int(((right.index < 0) & (index >= 0)).sum()),
        other=int(((right.index >= 0) & (index >= 0) & ~same).sum()),
        ulps=float(steps.max(initial=0)),
        angle=float(angles.max(initial=0)),
        leaving=int(np.array(active).sum()),
        self_shadows=int((hidden & visible).sum()),
    )


def _view(prepared: Prepared, ray: Ray) -> View:
    """First hits of rays from the camera."""
    s = prepared.kernel
    si = interact(s, ray, closest(integrator.camera_origin(s, ray), ray, s.brute_force))
    dr.eval(si.hit, si.surface, si.n, si.from_inside)
    index = np.array(integrator.object_of(s, si.hit)).astype(np.int32)
    # All rays may share one normal.
    n = np.broadcast_to(to_numpy(si.surface.n), (len(index), 3))
    return View(s, si, tuple(prepared.scene.all_objects), index, np.array(si.hit.t), n)


def _angles(n: np.ndarray, m: np.ndarray) -> np.ndarray:
    """Angles between vectors, 0 to pi radians, from sine and cosine: each alone is inaccurate somewhere. Shapes: (N, 3)
    to (N)."""
    return np.arctan2(np.linalg.norm(np.cross(n, m), axis=1), (n * m).sum(1))


def _hidden(view: View, d: Any, active: Any) -> np.ndarray:
    """Whether active rays that leave the first hits are occluded."""
    s, si = view.kernel, view.si
    origin = RayOrigin(s.geometry, si.surface.p, shared=False)
    ray = si.spawn_ray(d, dr.dot(s.a.W(si.n), d))
    far = Target(dr.full(s.a.D, dr.inf, dr.width(d)), s.a.D(0))
    return np.array(occluded(origin, ray, far, active, s.brute_force))
