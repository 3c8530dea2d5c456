"""Where a camera has got lost: behind a plane, inside an object, or where it sees nothing."""

from typing import Any

import drjit as dr
import numpy as np

from visray.accel.intersect import closest
from visray.dark.view import PictureRays, empty_notes
from visray.data.all_objects import address_of
from visray.identity_cache import IdentityCache
from visray.integrator import camera_origin, object_of
from visray.light_probe import centre_sample, interaction_of, numbers
from visray.passes import subset
from visray.primitives.plane import Plane
from visray.primitives.primitive import scalars, to_world_matrix
from visray.scene.scene import Scene
from visray.setup import Prepared
from visray.transforms import compose

# Neighbours among at most MOST x MOST pixels of a picture without edges differ by no more than this, of 255.
SMOOTH, MOST = 8, 128
# Number of rays that look for the object that a camera is in.
RAYS = 192
# A plane is level if its normal is nearer than this to the vertical (cosine of the angle).
LEVEL = 0.7
PLANES = IdentityCache()


def behind_plane(scene: Scene, camera: Any, home: Any) -> str:
    """A sentence that names the plane that a camera has crossed; "" if it has crossed none.

    home: the camera of the scene, which is on the right side of all planes
    """
    for name, normal, point in _planes(scene):
        side, right = (float(normal @ np.subtract(c.origin, point)) for c in (camera, home))
        if side * right >= 0:
            continue
        steep = float(normal @ home.up) / (np.linalg.norm(normal) * np.linalg.norm(home.up)) * np.sign(side)
        where = "behind" if abs(steep) < LEVEL else "above" if steep > 0 else "under"
        return f"The camera is {where} {address_of(name)}"
    return ""


def _planes(scene: Scene) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """The name of each plane of a scene, a normal, and a point of it."""
    if (found := PLANES.get(scene)) is None:
        found = []
        for name, plane in scene.objects.items():
            if isinstance(plane, Plane):
                place = to_world_matrix(scalars(plane).frame(), compose(plane.transform))
                found.append((name, np.cross(place[:3, 0], place[:3, 1]), place[:3, 3]))
        PLANES.put(scene, found)
    return found


def has_edges(rgb: np.ndarray) -> bool:
    """Whether neighbours in a picture differ. A picture with nothing but one colour, or a smooth sky, has no edges.
    Shape: uint8 (h, w, 3)."""
    step = max(1, max(rgb.shape[:2]) // MOST)
    few = rgb[::step, ::step].astype(int)
    return any(np.abs(np.diff(few, axis=axis)).max(initial=0) > SMOOTH for axis in (0, 1))


def void_note(prepared: Prepared) -> str:
    """A sentence that says why a picture without edges shows nothing; "" if it is as it should be.

    It is for the thread that renders.
    """
    lanes = np.linspace(0, len(prepared.order) - 1, RAYS).astype(int)
    s, few = prepared.kernel, subset(prepared, lanes)
    dr.eval(few.x, few.y)
    ray, sample = centre_sample(s, few.x, few.y)
    si = interaction_of(s, ray.exact(), closest(camera_origin(s, ray), ray, s.brute_force), sample)
    hit = numbers(si.hit.valid, RAYS).astype(bool)
    if not hit.any():
        return "" if PictureRays.of(prepared).hit.any() else _sentence(empty_notes(prepared)[0])
    objects = numbers(object_of(s, si.hit), RAYS)[hit].astype(int)
    if not hit.all() or len(set(objects)) > 1 or not numbers(si.from_inside, RAYS).all():
        return ""
    return f"The camera is inside {address_of(list(prepared.scene.all_objects)[objects[0]])}, or behind it"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]
