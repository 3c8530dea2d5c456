"""The scene as Mitsuba sees it. With blinn_phong_bsdf, the only module that knows Mitsuba.

The twin stands around the camera, in coordinates from there: the shift is done in double, before anything is rounded.
"""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from visray.lights.light import Light
from visray.materials import Material
from visray.primitives.primitive import MitsubaShapes
from visray.scene.scene import Scene, SkyGradient
from visray.study.mitsuba import light_emission as emission
from visray.study.mitsuba.blinn_phong_bsdf import DIFFUSE, GLOSSY, VARIANT
from visray.study.mitsuba.diffuse_colour import DiffuseColours
from visray.study.mitsuba.shadow_rays import ShadowRays
from visray.study.mitsuba.shapes import extents, parts
from visray.study.mitsuba.visray_scene import Answers, Rays


class MitsubaScene:
    """The scene in Mitsuba. `names` gives the order of the indices, `made` each object's twin."""

    def __init__(self, scene: Scene, names: tuple[str, ...], made: dict[str, MitsubaShapes], centre: np.ndarray):
        mi.set_variant(VARIANT)
        self.scene, self.centre, self.names = scene, centre, names
        self.materials = {"default": Material()} | scene.materials
        self.parts = parts([made[name] for name in names], centre)
        self.extents = extents([scene.objects[n] for n in names], self.parts)
        self.uv = [[part.uv for part in of] for of in self.parts]
        self.painting = DiffuseColours(scene, names)
        self.mitsuba = _loaded(self._children(names))
        self.among: dict[tuple[str, ...], Any] = {}
        self.owner, self.part_of = self._registry()

    def _children(self, names: tuple[str, ...]) -> dict:
        """Some of the objects as Mitsuba's load_dict takes them."""
        bsdfs = {name: _bsdf(m) for name, m in self.materials.items()}
        children: dict = {"type": "scene", "embree_use_robust_intersections": True}
        for name in names:
            i, bsdf = self.names.index(name), bsdfs[self.scene.objects[name].material]
            for j, part in enumerate(self.parts[i]):
                # Mitsuba puts shapes into another order, and forbids some of our names, so numbers are kept instead.
                children[f"{i}_{j}"] = _shape(part.shape, f"{i}_{j}", bsdf)
        return children

    def _registry(self) -> tuple[np.ndarray, np.ndarray]:
        """The object, and the shape in it, of each of Mitsuba's own numbers; -1 for no object."""
        numbers = {s.id(): int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(s))[0]) for s in self.mitsuba.shapes()}
        owner, part = (np.full(1 + max(numbers.values(), default=0), -1) for _ in range(2))
        for key, number in numbers.items():
            owner[number], part[number] = map(int, key.split("_"))
        return owner, part

    def _sent(self, rays: Rays) -> Any:
        d = mi.Vector3f(*rays.d.T.copy())
        o = mi.Point3f(*np.broadcast_to(rays.o, rays.d.shape).T.copy())
        return mi.Ray3f(o, d)

    def trace(self, rays: Rays) -> tuple[Any, Answers]:
        """What the rays hit: Mitsuba's own record, and the answers."""
        si = self.mitsuba.ray_intersect(self._sent(rays))
        number = dr.reinterpret_array(mi.UInt32, si.shape)
        dr.eval(si, number)
        number = np.array(number)
        # Mitsuba's t counts in lengths of d, which is not quite 1 in single precision.
        t = np.array(si.t, float) * np.linalg.norm(rays.d.astype(float), axis=1)
        n = np.array(si.sh_frame.n, float).T
        n = n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), np.finfo(float).tiny)
        return si, Answers(self.owner[number], t, n, self._uv(number, np.array(si.uv, float)))

    def _uv(self, number: np.ndarray, uv: np.ndarray) -> np.ndarray:
        """visray's (u, v) from Mitsuba's. Shapes: (N), (2, N) -> (N, 2)."""
        found = np.full((len(number), 2), np.nan)
        order = np.argsort(number, kind="stable")
        for lanes in np.split(order, 1 + np.flatnonzero(np.diff(number[order]))):
            which = number[lanes[0]]
            if self.owner[which] >= 0:
                ours = self.uv[self.owner[which]][self.part_of[which]]
                found[lanes] = np.stack(ours((uv[0, lanes], uv[1, lanes])), 1)
        return found

    def reaches(self, ways: ShadowRays, margin: np.ndarray) -> np.ndarray:
        """Whether nothing lies on ways, but for what is within `margin` of their beginning (N, world units)."""
        if not self.scene.settings.shadows:
            return np.ones(len(ways.p), bool)
        rest = ways.begun(margin)
        # Not by ray_test, which solves a sphere's equation as seen from the ray's origin: far from it digits cancel.
        met = self.mitsuba.ray_intersect_preliminary(self._along(rest))
        return ~np.array(met.is_valid()) | (rest.length == 0)

    def first(self, ways: ShadowRays, only: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Where ways first meet an object of `only`: the distance, inf if nowhere, and |cosine| with its normal."""
        if not len(ways.p):
            # Mitsuba ends the process for no rays at all.
            return np.zeros(0), np.zeros(0)
        if only not in self.among:
            self.among[only] = _loaded(self._children(only))
        si = self.among[only].ray_intersect(self._along(ways))
        return np.array(si.t, float), np.abs((np.array(si.n, float).T * ways.l).sum(1))

    def _along(self, ways: ShadowRays) -> Any:
        ray = self._sent(Rays(ways.p.astype(np.float32), ways.l.astype(np.float32)))
        ray.maxt = mi.Float(ways.length.astype(np.float32))
        return ray

    def colours(self, rays: Rays, si: Any, answers: Answers, uv: np.ndarray, arrive: list[np.ndarray]) -> np.ndarray:
        """The light along rays from the camera, by Mitsuba's hits, frames and BSDFs. Shapes: (N, 3).

        uv: where textures are looked up. arrive: of each light, the share that gets to what was hit. Shapes: (N, 1) or
        (N, 3).
        """
        scene = self.scene
        ka = np.array([self.materials[scene.objects[name].material].ka for name in self.names] + [(0, 0, 0)], float)
        glow = np.array(scene.ambient, float) + sum(l.intensity * np.array(l.Ia) for l in scene.lights.values())
        colour = np.where(answers.hit[:, None], glow * ka[answers.index], _sky(scene, rays))
        kd = self.painting.colours(answers.index, uv)
        p = np.array(si.p, float).T
        for light, share in zip(scene.lights.values(), arrive):
            ways = ShadowRays.to(p, light, self.centre)
            share = share * (emission.weight(light, ways.length) * emission.aim(light, ways.l))[:, None]
            sent = self._scattered(light, si, ways.l, kd)
            colour += np.where(answers.hit[:, None], sent * share, 0)
        return colour

    def _scattered(self, light: Light, si: Any, l: np.ndarray, kd: np.ndarray) -> np.ndarray:
        """Id times the diffuse part plus Is times the highlight, by Mitsuba's BSDFs and frames. Shapes: (N, 3)."""
        wo = si.to_local(mi.Vector3f(*l.T.astype(np.float32)))
        context, bsdf, total = mi.BSDFContext(), si.bsdf(), 0
        for component, colour in ((DIFFUSE, light.Id * kd), (GLOSSY, np.array(light.Is, float))):
            context.component = component
            part = np.array(bsdf.eval(context, si, wo, si.is_valid()), float).T
            total = total + light.intensity * colour * part
        return total


def _sky(scene: Scene, rays: Rays) -> np.ndarray:
    """What rays see that hit nothing. Shapes: (N, 3)."""
    if scene.film.transparent:
        return np.zeros(rays.d.shape)
    sky = scene.background
    top, bottom = (np.array(c, float) for c in ((sky.top, sky.bottom) if isinstance(sky, SkyGradient) else (sky, sky)))
    return bottom + (0.5 + 0.5 * rays.direction()[:, 1:2]) * (top - bottom)


def _loaded(children: dict) -> Any:
    """The Mitsuba scene."""
    level = mi.logger().log_level()
    # Its warnings of unequal scales are absolute, so that large shapes of equal scales cause them too.
    mi.set_log_level(mi.LogLevel.Error)
    try:
        # Optimised, meshes of one BSDF would become one mesh.
        return mi.load_dict(children, optimize=False)
    finally:
        mi.set_log_level(level)


def _bsdf(m: Material) -> Any:
    """The material, its kd taken out: the diffuse part is multiplied with the colour at (u, v)."""
    return mi.load_dict({"type": "blinn_phong", "kd": [1.0, 1.0, 1.0], "ks": list(m.ks), "shininess": m.shininess})


def _shape(shape: dict, name: str, bsdf: Any) -> Any:
    """A shape for Mitsuba's load_dict: its own kinds as a dict, a mesh as an object."""
    if shape["type"] == "mesh":
        return _mesh(shape, name, bsdf)
    whole = mi.ScalarTransform4f(shape["to_world"].tolist())
    return {"type": shape["type"], "id": name, "to_world": whole, "bsdf": bsdf}


def _mesh(shape: dict, name: str, bsdf: Any) -> Any:
    """Triangles as Mitsuba's Mesh."""
    props = mi.Properties()
    props["mesh_bsdf"] = bsdf
    props.set_id(name)
    known = {"has_vertex_normals": "normals" in shape, "has_vertex_texcoords": "uv" in shape}
    mesh = mi.Mesh(name, len(shape["vertices"]), len(shape["faces"]), props, **known)
    buffers = mi.traverse(mesh)
    fields = {"vertices": "vertex_positions", "normals": "vertex_normals", "uv": "vertex_texcoords"}
    for ours, theirs in fields.items():
        if ours in shape:
            buffers[theirs] = mi.Float(np.ravel(shape[ours]).astype(np.float32))
    buffers["faces"] = mi.UInt32(np.ravel(shape["faces"]).astype(np.uint32))
    buffers.update()
    return mesh
