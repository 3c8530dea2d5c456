"""How a picture was made: the facts in the metadata of an Image, and the camera's matrices."""

import json
import platform
from typing import Any

import drjit as dr
import numpy as np

from visray.primitives.primitive import scalars
from visray.scene.scene import Scene
from visray.setup import Prepared
from visray.version import __version__


def provenance(prepared: Prepared, scene_hash: str, seconds: float) -> dict[str, Any]:
    """Facts for the metadata of a picture; those about its samples and its error are not among them.

    scene_hash: the hash of the scene as the caller gave it, before settings were changed for the goal.
    seconds: the time of the render.
    """
    s = prepared.scene.settings
    return {
        "scene_hash": scene_hash,
        "seed": s.seed,
        "sampler": s.sampler,
        "spp_asked": s.spp,
        "precision": s.precision,
        "backend": prepared.a.backend,
        "features": prepared.features.names(),
        "objects": json.dumps({name: i + 1 for i, name in enumerate(prepared.scene.objects)}, ensure_ascii=False),
        "visray": __version__,
        "drjit": dr.__version__,
        "llvm": ".".join(map(str, dr.detail.llvm_version())) if prepared.a.backend == "llvm" else "",
        "python": platform.python_version(),
        "threads": dr.thread_count(),
        "render_seconds": seconds,
        **camera_matrices(prepared.scene),
    }


def camera_matrices(scene: Scene) -> dict[str, list[list[float]]]:
    """The matrices worldToCamera and worldToNDC, which multiply a row vector from the right.

    Camera space: x right, y up, z along the view. NDC: (0, 0) top left to (1, 1) bottom right.
    """
    c, f = scene.camera, scene.film
    right, up, forward, _ = (np.array(v, float) for v in scalars(c).axes())
    o = np.array(c.origin, float)
    to_camera = np.eye(4)
    to_camera[:3, :3] = np.stack([right, up, forward], axis=1)
    to_camera[3, :3] = -o @ to_camera[:3, :3]
    half = np.tan(np.radians(c.fov) / 2)
    to_ndc = np.array(
        [[0.5 * f.height / f.width / half, 0, 0, 0], [0, -0.5 / half, 0, 0], [0.5, 0.5, 1, 1], [0, 0, 0, 0]]
    )
    return {"worldToCamera": to_camera.tolist(), "worldToNDC": (to_camera @ to_ndc).tolist()}
