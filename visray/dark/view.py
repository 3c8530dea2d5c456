"""Why a picture shows nothing: where the objects are, as seen from the camera."""

from dataclasses import dataclass
from itertools import islice
from math import degrees, hypot
from typing import Any

import drjit as dr
import numpy as np

from visray.accel.intersect import closest
from visray.camera import OrthographicCamera, ParallelView
from visray.data.all_objects import address_of
from visray.integrator import camera_origin, camera_ray
from visray.interaction import interact
from visray.primitives.primitive import bounding_box
from visray.scene.scene import Scene
from visray.setup import Prepared
from visray.shading import receiving

# The largest number of objects that are looked at one by one.
MOST_OBJECTS = 2000


def listed(values: Any) -> str:
    """Numbers as a list, as a scene file has it."""
    return "[" + ", ".join(f"{v:.4g}" for v in values) + "]"


@dataclass(frozen=True)
class PictureRays:
    """What the rays through the centres of all pixels meet.

    hit: for each lane, whether its ray hits an object
    receives: for each lane, whether its ray hits an object that light falls on: one whose material is not unlit
    """

    hit: np.ndarray
    receives: np.ndarray

    @staticmethod
    def of(prepared: Prepared) -> "PictureRays":
        s, a, n = prepared.kernel, prepared.a, len(prepared.order)
        ray = camera_ray(s, a.F(prepared.x) + 0.5, a.F(prepared.y) + 0.5)
        hit = closest(camera_origin(s, ray), ray, s.brute_force)
        receives = receiving(interact(s, ray.exact(), hit)).hit.valid if s.features["unlit"] else hit.valid
        dr.eval(hit.valid, receives)
        return PictureRays(*(np.broadcast_to(np.array(mask), n) for mask in (hit.valid, receives)))


@dataclass(frozen=True)
class Box:
    """The bounding box of an object, as the camera sees it.

    address: address of the object
    middle: middle of the box, in the world
    behind, beside: whether the whole box is behind the camera, and whether it is beyond one edge of the picture
    angle: angle of its middle off the camera's view, in degrees
    pixels: width of the box in pixels
    made: whether the object is made of others, and so may be smaller than its box, and even empty
    """

    address: str
    middle: np.ndarray
    behind: bool
    beside: bool
    angle: float
    pixels: float
    made: bool


def boxes(prepared: Prepared) -> list[Box]:
    """The boxes of the objects and of the segments of lines, but not of objects that are unbounded or empty."""
    view, scene = prepared.kernel.view, prepared.scene
    o, forward, right, down = (
        np.array(v, float)[:, 0] for v in (view.o, view.forward, view.pixel_right, view.pixel_down)
    )
    parallel = isinstance(view, ParallelView)
    found = []
    for name, obj in islice(scene.parts(), MOST_OBJECTS):
        shape = scene.placed_shape(obj)
        low, high = map(np.ravel, bounding_box(shape) or (np.inf, -np.inf))
        if (low > high).any():
            continue
        corners = np.stack(np.meshgrid(*zip(low, high), indexing="ij"), -1).reshape(-1, 3)
        p = corners - o
        depth = p @ forward
        # Points behind the camera are not seen; what they are divided by does not matter.
        scale = 1 if parallel else np.where(depth > 0, depth, 1)
        x, y = (p @ axis / (axis @ axis) / scale for axis in (right, down))
        half = [n / 2 for n in scene.film.size]
        seen = depth > 0
        beyond = [(s * v[seen] > h).all() for v, h in zip((x, y), half) for s in (1, -1)]
        middle = p.mean(0)
        across = np.linalg.norm(middle - (middle @ forward) * forward)
        angle = degrees(np.arctan2(across, middle @ forward))
        pixels = hypot(np.ptp(x), np.ptp(y)) if seen.all() else np.inf
        place = corners.mean(0), not seen.any(), any(beyond), angle, pixels
        found.append(Box(address_of(name), *place, shape.composite))
    return found


def empty_notes(prepared: Prepared) -> list[str]:
    """List of one sentence that says why no ray of the camera meets an object."""
    scene = prepared.scene
    if not scene.all_objects:
        return ["the scene has no objects: the picture shows only the background"]
    if scene.film.region is not None:
        return [f"nothing is seen in film.region = {[*scene.film.region]}: no object is there"]
    found = boxes(prepared)
    endless = (n for n, o in scene.representatives.items() if not scene.placed_shape(o).bounded)
    if (name := next(endless, None)) and all(box.behind or box.beside for box in found):
        return [_past(address_of(name), found)]
    if not found:
        return ["nothing is seen: all objects are empty"]
    in_front = [box for box in found if not box.behind]
    middle = listed(np.mean([box.middle for box in (in_front or found)], 0))
    if not in_front:
        return [f"nothing is seen: all objects are behind the camera; camera.target = {middle} looks at them"]
    in_view = [box for box in in_front if not box.beside]
    if not in_view:
        nearest = min(in_front, key=lambda box: box.angle)
        return [
            f"nothing is seen: all objects are beside the picture; {nearest.address} is {nearest.angle:.0f} degrees "
            f"off the view, {_limits(scene)}; camera.target = {middle} looks at them"
        ]
    largest = max(in_view, key=lambda box: box.pixels)
    if largest.pixels < 1:
        size = f"{largest.pixels:.2g} pixels wide"
        return [f"nothing is seen: {largest.address} is only {size}; go nearer, or lower camera.fov"]
    advice = "; it may be empty" if largest.made else ""
    where = f"{largest.address}, whose bounding box is in view"
    return [f"nothing is seen: rays pass {where}, without meeting its surface{advice}"]


def _past(endless: str, found: list[Box]) -> str:
    """The sentence about a camera that looks past everything. It names the nearest bounded object, if there is one.

    endless: address of an unbounded object. found: the boxes of the bounded ones
    """
    if not found:
        return f"nothing is seen: the camera looks past {endless}; turn camera.target to it"
    nearest = min(found, key=lambda box: box.angle)
    target = f"camera.target = {listed(nearest.middle)}"
    return f"nothing is seen: the camera looks past {nearest.address}; {target} looks at it"


def _limits(scene: Scene) -> str:
    """How far the picture reaches from its middle to its upper edge, as words."""
    camera = scene.camera
    if isinstance(camera, OrthographicCamera):
        return f"and the picture is {camera.height:g} high"
    return f"and the picture ends {camera.fov / 2:.3g} degrees above and below it"
