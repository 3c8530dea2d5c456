"""Random rays through a scene."""

import numpy as np

from visray.primitives.primitive import bounding_box
from visray.scene.scene import Scene
from visray.study.mitsuba.visray_scene import Rays


def random_rays(scene: Scene, centre: np.ndarray, count: int, seed: int) -> Rays:
    """Rays from random origins in and around the common bounding box of all bounded objects.

    Half of the rays aim at a random point in the bounding box of a random object. The other half have random
    directions. In a scene without bounded objects, the bounding box of the camera, its target and the lights that have
    a position is used.

    centre: the camera's position, which is the origin of the returned rays' coordinates
    count: number of rays
    """
    rng = np.random.default_rng(seed)
    boxes = [box for primitive in scene.objects.values() if (box := bounding_box(primitive)) is not None]
    if not boxes:
        lights = [light.position for light in scene.lights.values() if light.has_position]
        points = [scene.camera.origin, scene.camera.target, *lights]
        boxes = [(np.min(points, 0), np.max(points, 0))]
    low, high = (np.array(corner) - centre for corner in zip(*boxes))
    least, most = low.min(0), high.max(0)
    margin = 0.5 * (most - least).max()
    o = rng.uniform(least - margin, most + margin, (count, 3))
    d = rng.normal(size=(count, 3))
    box = rng.integers(len(boxes), size=count // 2)
    d[: count // 2] = rng.uniform(low[box], high[box]) - o[: count // 2]
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return Rays(o.astype(np.float32), d.astype(np.float32))
