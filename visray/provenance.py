"""Provenance: facts about how a picture was made, for the metadata of an Image."""

import json
import platform
from typing import Any

import drjit as dr
import numpy as np

from visray.projection import camera_matrices
from visray.scene.film import Film
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
        **part_of(prepared.scene.film),
    }


def part_of(film: Film) -> dict[str, str]:
    """The facts of a part of a picture: `region` (left, top, right and bottom edge) and `whole` (width and height), in
    pixels. Empty for a whole picture."""
    return (
        {} if film.region is None else {"region": " ".join(map(str, film.region)), "whole": "{} {}".format(*film.size)}
    )


def _numbers(scene: Scene, seen: np.ndarray | None) -> dict[str, int]:
    """Numbers of objects in the layer id, by name. seen: as in provenance"""
    shown = None if seen is None else set(np.unique(seen).tolist())
    written = len(scene.written_objects)
    return {
        name: number
        for number, name in enumerate(scene.all_objects, 1)
        if number <= written or shown is None or number in shown
    }
