"""Provenance: facts about how a picture was made, for the metadata of an Image."""

import json
import platform
from typing import Any

import drjit as dr
import numpy as np

from visray.camera import OrthographicCamera
from visray.primitives.primitive import scalars
from visray.scene.scene import Scene
from visray.setup import Prepared
from visray.version import __version__


def provenance(prepared: Prepared, scene_hash: str, seconds: float, seen: np.ndarray | None = None) -> dict[str, Any]:
    """Dict of the facts about a picture, except those about its samples and its error.

    scene_hash: hash of the scene that was given by the caller. The prepared scene may have another sampler.
    seconds: duration of the render.
    seen: layer id of the picture, or None. With it, rows of data that no pixel shows are not named, as there may be
        very many.
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
        "objects": json.dumps(_numbers(prepared.scene, seen), ensure_ascii=False),
        "visray": __version__,
        "drjit": dr.__version__,
        "llvm": ".".join(map(str, dr.detail.llvm_version())) if prepared.a.backend == "llvm" else "",
        "python": platform.python_version(),
        "threads": dr.thread_count(),
        "render_seconds": seconds,
        **camera_matrices(prepared.scene),
    }


def _numbers(scene: Scene, seen: np.ndarray | None) -> dict[str, int]:
    """Numbers of objects in the layer id, by name. seen: as in provenance"""
    shown = None if seen is None else set(np.unique(seen).tolist())
    written = len(scene.written_objects)
    return {
        name: number
        for number, name in enumerate(scene.all_objects, 1)
        if number <= written or shown is None or number in shown
    }


def camera_matrices(scene: Scene) -> dict[str, list[list[float]]]:
    """The matrices worldToCamera and worldToNDC, as a dict of lists of rows. They multiply a row vector v from the
    right: v M.

    In camera space x points to the right, y up, and z along the view direction. In NDC the picture extends from (0, 0)
    at the top left to (1, 1) at the bottom right; z is 1 for a perspective camera, and the depth for an orthographic
    one.
    """
    c, f = scene.camera, scene.film
    right, up, forward, _ = (np.array(v, float) for v in scalars(c).axes())
    o = np.array(c.origin, float)
    to_camera = np.eye(4)
    to_camera[:3, :3] = np.stack([right, up, forward], axis=1)
    to_camera[3, :3] = -o @ to_camera[:3, :3]
    parallel = isinstance(c, OrthographicCamera)
    half = 0.5 * c.height if parallel else np.tan(np.radians(c.fov) / 2)
    to_middle = [0.5, 0.5, 0, 1]
    to_ndc = np.array(
        [
            [0.5 * f.height / f.width / half, 0, 0, 0],
            [0, -0.5 / half, 0, 0],
            *([[0, 0, 1, 0], to_middle] if parallel else [[0.5, 0.5, 1, 1], [0, 0, 0, 0]]),
        ]
    )
    return {"worldToCamera": to_camera.tolist(), "worldToNDC": (to_camera @ to_ndc).tolist()}
