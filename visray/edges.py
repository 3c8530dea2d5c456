"""Moving edges, such as silhouettes and shadow edges: the warning that derivatives leave them out (gradients.py).

Edges are looked for along the rays through the centres of the pixels, so edges of things smaller than a pixel may be
missed. What is found there but need not move with the value in question, such as an edge of a mesh that is nearly flat,
is reported all the same.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Any

import drjit as dr
import numpy as np

from visray import integrator, modes
from visray.accel.intersect import closest
from visray.data.all_objects import address_of
from visray.direct import LightSample, light_sample
from visray.interaction import interact
from visray.kernel_scene import KernelScene, reach_of
from visray.primitives.csg_operands import operands
from visray.primitives.primitive import Primitive
from visray.ray import NO_ROW
from visray.scene.scene import Scene, Settings
from visray.shading import receiving

# Fields of lights and materials whose change moves shadow edges, or edges seen through refraction.
EDGE_MOVING_FIELDS = {"position", "direction", "angle", "width", "height", "normal", "radius", "ior"}
# A message lists at most this many addresses of edges of one kind.
MOST_LISTED = 4


class EdgeWarning(UserWarning):
    """The picture has moving edges, such as silhouettes and shadow edges, and the derivative leaves them out."""


def moves_edges(scene: Scene, address: str) -> bool:
    """Whether a change of the value at the address moves edges in the picture."""
    movers = EDGE_MOVING_FIELDS | {"shininess"} if _stepped(scene.settings) else EDGE_MOVING_FIELDS
    return address.startswith(("objects.", "geometries.", "camera.")) or not movers.isdisjoint(address.split(".")[2:3])


def _stepped(settings: Settings) -> bool:
    """Whether the scene's shading mode reflects light in steps, as `toon` does."""
    model = modes.BY_NAME[settings.shading].model
    return model is not None and model.stepped


def _reached(scene: Scene, s: KernelScene, x: Any, y: Any) -> tuple[Any, Any]:
    """Columns and rows of the pixels that samples lie in: with a filter, also pixels beyond the edges of the picture.

    x, y: those of the picture's pixels
    """
    more = ceil(reach_of(scene, s.features))
    if not more:
        return x, y
    (left, top), (width, height) = scene.film.corner, scene.film.raster
    rows, columns = np.mgrid[top - more : top + height + more, left - more : left + width + more]
    return tuple(s.a.put(s.a.F, v.ravel().astype(float)) for v in (columns, rows))


def warn_of_edges(scene: Scene, s: KernelScene, wrt: Sequence[str], x: Any, y: Any) -> None:
    """Warns if edges are in view that move with the value at one of the addresses `wrt`.

    x, y: columns and rows of the pixels
    """
    movers = [w for w in wrt if moves_edges(scene, w)]
    x, y = _reached(scene, s, x, y)
    if movers and (edges := EdgesInView(scene, s, movers, x, y).found()):
        listed = "; ".join(kind + (f" of {_listed(where)}" if where else "") for kind, where in edges.items())
        problem = f"the picture has moving edges ({listed})"
        size = "the derivative leaves them out, so it can be wrong by a factor or in its sign, and not only a little"
        advice = "compare with vr.difference(scene, address, step=0.01)"
        warnings.warn(f"{problem}: {size}; {advice}", EdgeWarning, stacklevel=5)


def _listed(addresses: list[str]) -> str:
    """The addresses as text, at most MOST_LISTED of them."""
    more = len(addresses) - MOST_LISTED
    return ", ".join(addresses[:MOST_LISTED]) + (f" and {more} more" if more > 0 else "")


@dataclass(frozen=True)
class EdgesInView:
    """The edges in view that move with one of several values.

    scene: the scene
    s: the scene as kernels read it
    movers: addresses of the values
    x, y: columns and rows of the pixels
    """

    scene: Scene
    s: KernelScene
    movers: list[str]
    x: Any
    y: Any

    def found(self) -> dict[str, list[str]]:
        """The kinds of edges, each with the addresses of the objects or lights that have them. It is empty if there are
        none; a derivative is then complete, except for edges smaller than a pixel."""
        edges = {
            "silhouettes": [address_of(n) for n in self.moving if self.visible_count > 1 or self._hides_itself(n)],
            "creases": [address_of(n) for n in self.moving if self._is_creased(n)],
            "shadow edges": [f"lights.{n}" for n in self._lights_with_shadow_edges()],
            "ends of highlights": [f"lights.{n}" for n in self._lights_with_ends()],
            "outlines of lights": [f"lights.{n}" for n in self._moving_lights if self.scene.lights[n].seen],
            "texture edges": [address_of(n) for n in self.moving if self._has_steps(n)],
        }
        if self.scene.settings.shading == "uv":
            edges["jumps of u and v"] = [address_of(n) for n in self.moving if self._jumps(n)]
        found = {kind: where for kind, where in edges.items() if where}
        if _stepped(self.scene.settings):
            found["steps of a cartoon"] = []
        return found | self._sampled()

    def _sampled(self) -> dict[str, list[str]]:
        """Edges that only rays meet that do not come from the camera: rays to area lights, occlusion rays and paths.
        They are not looked for, but there are none if there is only one object."""
        if sum(map(len, self.s.batches)) < 2:
            return {}
        effects, scene = self.s.features, self.scene

        def objects_with(field: str) -> list[str]:
            having = {n for n, m in scene.materials.items() if any(getattr(m, field))}
            return [address_of(n) for n in scene.objects_of(having)]

        kinds = {
            "penumbras": ("area lights", [f"lights.{n}" for n, light in scene.lights.items() if light.has_area]),
            "reflections": ("reflection", objects_with("kr")),
            "refractions": ("refraction", objects_with("kt")),
            "scattered light": ("scatter", []),
        }
        if self.moves_all or self.moved_shapes:
            kinds |= {name: (name, []) for name in ("sky occlusion", "near occlusion")}
        return {kind: where for kind, (effect, where) in kinds.items() if effects[effect]}

    @cached_property
    def moves_all(self) -> bool:
        """Whether all objects move in the picture."""
        return any(w.startswith("camera.") for w in self.movers)

    @cached_property
    def moved_shapes(self) -> set[str]:
        """Names of the objects that move in the scene."""
        heads = {".".join(w.split(".")[: 3 if w.startswith("data.") else 2]) for w in self.movers}
        shows = any(head.startswith("geometries.") for head in heads)

        def moves(name: str, obj: Primitive) -> bool:
            """Whether an object moves: itself, or a geometry that it or one of its operands shows."""
            walk = operands(address_of(name), obj, self.scene.geometries) if shows else ()
            return address_of(name) in heads or any(x.address in heads for x in walk)

        return {name for name, obj in self.scene.all_objects.items() if moves(name, obj)}

    @cached_property
    def moving(self) -> list[str]:
        """Names of the visible objects that move in the picture."""
        return [name for name in self._visible if self.moves_all or name in self.moved_shapes]

    @cached_property
    def _shown(self) -> tuple[np.ndarray, np.ndarray, dict[str, tuple[np.ndarray, np.ndarray]]]:
        """What the centres of the pixels show, found by one kernel.

        The numbers of object, row and part, as an array of shape (3, N), the texture coordinates (2, N), and, for each
        unrolled light without an area, two masks: where its light arrives, and where the surface is turned to it.
        """
        s, names = self.s, list(self.scene.lights)
        ray = integrator.camera_ray(s, s.a.F(self.x) + 0.5, s.a.F(self.y) + 0.5)
        hit = closest(integrator.camera_origin(s, ray), ray)
        si = interact(s, ray, hit, integrator.single_sample_state(s, dr.width(self.x)))
        receiver = receiving(si) if s.features["unlit"] else si
        part = 0 * hit.row if hit.part is None else hit.part
        faces, lit = (integrator.object_of(s, hit), hit.row, part), {}
        for light in s.lights:
            if not light.kind.has_area:
                sample, valid = light_sample(s, receiver, light), receiver.hit.valid
                turned_to = valid & (sample.cosine > 0)
                lit[names[light.number]] = dr.detach(_fully_lit(sample) & valid), dr.detach(turned_to)
        uv = dr.detach((si.u, si.v))
        dr.eval(faces, uv, lit)
        masks = {name: tuple(np.array(mask) for mask in pair) for name, pair in lit.items()}
        return np.stack([np.array(x) for x in faces]), np.stack([np.array(x) for x in uv]), masks

    @cached_property
    def _visible(self) -> dict[str, int]:
        """For each visible object the number of its faces in view: its triangles or its parts."""
        shown, names = self._shown[0], list(self.scene.all_objects)
        faces = np.unique(shown[:, shown[0] != NO_ROW], axis=1)
        return {names[i]: int(n) for i, n in zip(*np.unique(faces[0], return_counts=True))}

    @cached_property
    def visible_count(self) -> int:
        """Number of the visible objects; what is behind all objects counts as one."""
        return len(self._visible) + bool((self._shown[0][1] == NO_ROW).any())

    def _kinds(self, name: str) -> tuple[list[type[Primitive]], bool, bool]:
        """The classes of the shapes in the kernel of which an object is made; whether there are several primitives: of
        triangles, of the segments of a line, or of operands; and whether there are operands."""
        bodies = self.scene.unions.get(name, (name,))
        found = [(b, row) for n in bodies for b in self.s.batches if (row := b.names.row(n)) is not None]
        joined = len(bodies) > 1 or any(b.kind.composite for b, _ in found)
        several = joined or any(b.kind.many_rows or b.names.repeats(row) > 1 for b, row in found)
        shapes = (x.kind for b, _ in found for x in (b.kind.leaf_sites() if b.kind.composite else (b,)))
        return list(dict.fromkeys(shapes)), several, joined

    def _hides_itself(self, name: str) -> bool:
        """Whether a visible object may hide a part of itself."""
        kinds, several, _ = self._kinds(name)
        if self._visible[name] > 1 and (several or any(kind.walks for kind in kinds)):
            return True
        return any(kind.max_crossings > (2 if kind.closed else 1) for kind in kinds if not kind.walks)

    def _is_creased(self, name: str) -> bool:
        """Whether a visible object may have a crease in view."""
        kinds, several, joined = self._kinds(name)
        if joined:
            # Where operands meet there are creases. What counts as one face of an operand may have more, as of a box.
            return self._visible[name] > 1 or any(not (kind.smooth or kind.bends_normals) for kind in kinds)
        (kind,) = kinds
        if kind.bends_normals or (kind.smooth and not several):
            return False
        # A polynomial of degree 2 that has no factors is smooth, or a cone, which is smooth but for its apex.
        may_cross_itself = kind.finds_roots and any(f.degree > 2 for f in kind.program.factors)
        return self._visible[name] > 1 or may_cross_itself

    def _jumps(self, name: str) -> bool:
        """Whether u or v of a visible object jumps in view: between whole numbers, or at a seam."""
        faces, uv, _ = self._shown
        own = uv[:, faces[0] == list(self.scene.all_objects).index(name)]
        return any(len(np.unique(np.floor(x))) > 1 or np.ptp(x) > 0.5 for x in own)

    def _has_steps(self, name: str) -> bool:
        """Whether the colour of an object's texture jumps, between the squares of a checker or between pixels."""
        if not self.s.features["textures"]:
            return False
        scene = self.scene
        sides = (side for x in scene.materials_of(scene.all_objects[name]) for side in scene.sides_of(x))
        named = [scene.material(side).texture for side in sides]
        return any(getattr(scene.textures[x], "filter", "nearest") == "nearest" for x in named if x is not None)

    @cached_property
    def _moving_lights(self) -> list[str]:
        """Names of the lights whose shadows move in the picture."""
        names = list(self.scene.lights)
        if self.moves_all or self.moved_shapes:
            return names
        return [n for n in names if any(w.startswith(f"lights.{n}.") for w in self.movers)]

    def _lights_with_shadow_edges(self) -> list[str]:
        """Names of the lights without an area whose light arrives at a part of the surface points that are turned to
        it. A looped light counts if anything can hide it, because it is not looked for."""
        s = self.s
        found = {n for n, (lit, turned_to) in self._shown[2].items() if lit.any() and not lit[turned_to].all()}
        if s.features["shadows"] and sum(map(len, s.batches)) > 1:
            looped = {batch.kind for batch in s.looped_lights if not batch.kind.has_area}
            found |= {n for n, light in self.scene.lights.items() if type(light) in looped}
        return [n for n in self._moving_lights if n in found]

    def _lights_with_ends(self) -> list[str]:
        """Names of the lights whose highlights end on a face in view, where it turns away from the light. Other light
        has faded by then."""
        if not self.s.features["specular"]:
            return []
        faces, _, masks = self._shown
        _, face = np.unique(faces, axis=1, return_inverse=True)
        # The numbers of all faces that are turned to the light somewhere, and of those that are not somewhere.
        found = {
            n for n, (_, t) in masks.items() if set(face[t].tolist()) & set(face[~t & (faces[0] != NO_ROW)].tolist())
        }
        return [n for n in self._moving_lights if n in found]


def _fully_lit(b: LightSample) -> Any:
    """Mask of the lanes in which all light of a light sample arrives."""
    if (t := b.transmittance) is None:
        return b.arrives
    return b.arrives & (t.x == 1) & (t.y == 1) & (t.z == 1)
