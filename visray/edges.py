"""Moving edges, such as silhouettes and shadow edges: the warning that derivatives leave them out (gradients.py)."""

import warnings
from collections.abc import Sequence
from typing import Any

import drjit as dr
import numpy as np

from visray import integrator, modes
from visray.accel.intersect import closest
from visray.direct import LightSample, light_sample
from visray.images import Atlas
from visray.interaction import interact
from visray.kernel_scene import KernelScene
from visray.scene.scene import Scene, Settings


class EdgeWarning(UserWarning):
    """The picture has moving edges, such as silhouettes and shadow edges, and the derivative leaves them out."""


# Fields of lights and materials whose change moves shadow edges, or edges seen through refraction.
EDGE_MOVING_FIELDS = {"position", "direction", "angle", "width", "height", "normal", "radius", "ior"}


def moves_edges(scene: Scene, address: str) -> bool:
    """Whether a change of the value at the address moves edges in the picture."""
    movers = EDGE_MOVING_FIELDS | {"shininess"} if _stepped(scene.settings) else EDGE_MOVING_FIELDS
    return address.startswith(("objects.", "geometries.", "camera.")) or not movers.isdisjoint(address.split(".")[2:3])


def _stepped(settings: Settings) -> bool:
    """Whether the scene's shading mode reflects light in steps, as `toon` does."""
    model = modes.BY_NAME[settings.shading].model
    return model is not None and model.stepped


def warn_of_edges(scene: Scene, s: KernelScene, wrt: Sequence[str], x: Any, y: Any) -> None:
    """Warns if edges are in view that move with the value at one of the addresses `wrt`.

    x, y: columns and rows of the pixels
    """
    if any(moves_edges(scene, w) for w in wrt) and (edges := _edges(s, x, y)):
        problem = f"the picture has moving edges ({edges}): the derivative leaves them out and can be far off"
        advice = "compare with vr.difference(scene, address, step=0.01)"
        warnings.warn(f"{problem}; {advice}", EdgeWarning, stacklevel=4)


def _edges(s: KernelScene, x: Any, y: Any) -> str:
    """Names of the kinds of edges in view, as text. It is empty if there are none; a derivative is then complete,
    except for edges smaller than a pixel.

    x, y: columns and rows of the pixels
    """
    ray = integrator.camera_ray(s, s.a.F(x) + 0.5, s.a.F(y) + 0.5)
    hit = closest(integrator.camera_origin(s, ray), ray)
    si = interact(s, ray, hit, integrator.single_sample_state(s, dr.width(x)))
    fully_lit = [_fully_lit(light_sample(s, si, light)) for light in s.lights if not light.kind.has_area]
    edges = []
    visible_rows = np.unique(np.array(hit.row))
    visible_kinds = [b.kind for b in s.batches if b.has(visible_rows).any()]
    # A surface that a line can cross more than twice may hide a part of itself.
    if len(visible_rows) > 1 or any(kind.smooth and kind.max_crossings > 2 for kind in visible_kinds):
        edges.append("silhouettes")
    flat_faces = [b for b in s.batches if b.kind.many_rows and not b.kind.bends_normals]
    if not all(kind.smooth for kind in visible_kinds) or any(b.has(visible_rows).sum() > 1 for b in flat_faces):
        edges.append("creases")
    if any(np.any(np.array(l)) and not np.all(np.array(l)) for l in fully_lit):
        edges.append("shadow edges")
    if s.features["textures"] and _has_steps(s.atlas):
        edges.append("texture edges")
    if _stepped(s.settings):
        edges.append("steps of a cartoon")
    # Rays to area lights, occlusion rays and paths meet further edges, unless there is only one object.
    sampled_edges = {
        "penumbras": "area lights",
        "sky occlusion": "sky occlusion",
        "near occlusion": "near occlusion",
        "reflections": "reflection",
        "refractions": "refraction",
        "scattered light": "scatter",
    }
    if sum(map(len, s.batches)) > 1:
        edges += [name for name, effect in sampled_edges.items() if s.features[effect]]
    return ", ".join(edges)


def _fully_lit(b: LightSample) -> Any:
    """Mask of the lanes in which all light of a light sample arrives."""
    if (t := b.transmittance) is None:
        return b.arrives
    return b.arrives & (t.x == 1) & (t.y == 1) & (t.z == 1)


def _has_steps(atlas: Atlas) -> bool:
    """Whether the colour of a texture jumps, between the squares of a checker or between the pixels of an image."""
    return atlas.rows.a is not None or not np.all(np.array(atlas.rows.smooth))
