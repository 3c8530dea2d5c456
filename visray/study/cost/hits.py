"""What a choice of knobs does to geometry: first hits, and what hides the points that are seen."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray import integrator, warp
from visray.accel.intersect import Target, closest, occluded
from visray.accel.origin import RayOrigin
from visray.interaction import Interaction, interact
from visray.kernel_scene import KernelScene
from visray.ray import NO_ROW, Ray, unit
from visray.setup import Prepared
from visray.study.cost.records import Geometry
from visray.study.mitsuba.visray_scene import to_numpy


@dataclass(frozen=True)
class View:
    """What rays from the camera hit first, as shaded and on the host.

    index: of the object among `names`, -1 for none; t: distance, inf for none; n: outward unit normal.
    Shapes: (N), (N), (N, 3).
    """

    kernel: KernelScene
    si: Interaction
    names: tuple[str, ...]
    index: np.ndarray
    t: np.ndarray
    n: np.ndarray


def geometry(prepared: Prepared, truth: Prepared, seed: int = 0) -> Geometry:
    """First hits along the rays through the truth's pixel centres in double, and whether what is seen is hidden.

    Both are the same scene with other knobs; objects are told by their names, as knobs may change their order. From
    where both see the same object, a random ray is sent over the hemisphere above it (cosine distributed about the
    truth's normal, on the viewer's side): the same direction from either's own point, as the integrator lets it leave.
    Those that run below the surface as one of them sees it are left out: neither would have drawn them.
    """
    a = truth.a
    ray = integrator.camera_ray(truth.kernel, a.F(truth.x) + 0.5, a.F(truth.y) + 0.5).exact()
    right, found = _view(truth, ray), _view(prepared, ray)
    place = {name: i for i, name in enumerate(right.names)}
    index = np.array([place[name] for name in found.names] + [-1])[found.index]
    same = (index == right.index) & (index >= 0)
    t, n = right.t[same], right.n[same]
    steps, angles = np.abs(found.t[same] - t) / np.spacing(t), _angles(found.n[same], n)

    u, v = np.random.default_rng(seed).uniform(size=(2, len(same)))
    normal = dr.select(right.si.hit.valid, a.W(right.si.n), a.W(0, 0, 1))
    d = unit(warp.cosine(normal, a.D(u), a.D(v)), a.W)
    active = a.B(same) & (dr.dot(a.W(right.si.n), d) > 0) & (dr.dot(a.W(found.si.n), d) > 0)
    dr.eval(d, active)
    hidden, open_ = _hidden(found, d, active), ~_hidden(right, d, active)
    return Geometry(
        rays=len(same),
        lost=int(((right.index >= 0) & (index < 0)).sum()),
        added=int(((right.index < 0) & (index >= 0)).sum()),
        other=int(((right.index >= 0) & (index >= 0) & ~same).sum()),
        ulps=float(steps.max(initial=0)),
        angle=float(angles.max(initial=0)),
        leaving=int(np.array(active).sum()),
        self_shadows=int((hidden & open_).sum()),
    )


def _view(prepared: Prepared, ray: Ray) -> View:
    """What the rays from the camera hit first."""
    s = prepared.kernel
    here = interact(s, ray, closest(s.origin, ray, s.brute_force))
    dr.eval(here.hit, here.surface, here.n, here.from_inside)
    index = np.array(here.hit.row).astype(np.int64)
    index[index == NO_ROW] = -1
    names = tuple(name for batch in s.batches for name in batch.names)
    # One normal may be that of all rays.
    n = np.broadcast_to(to_numpy(here.surface.n), (len(index), 3))
    return View(s, here, names, index, np.array(here.hit.t), n)


def _angles(n: np.ndarray, m: np.ndarray) -> np.ndarray:
    """Between vectors, from 0 to pi radians: by sine and cosine, as either alone loses small or large ones. Shapes:
    (N, 3) to (N)."""
    return np.arctan2(np.linalg.norm(np.cross(n, m), axis=1), (n * m).sum(1))


def _hidden(view: View, d: Any, active: Any) -> np.ndarray:
    """Whether rays from what is seen meet anything, of those that are active."""
    s, here = view.kernel, view.si
    origin = RayOrigin(s.geometry, here.surface.p, shared=False)
    ray = here.spawn_ray(d, dr.dot(s.a.W(here.n), d))
    far = Target(dr.full(s.a.D, dr.inf, dr.width(d)), s.a.D(0))
    return np.array(occluded(origin, ray, far, active, s.brute_force))
