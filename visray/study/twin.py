"""The scene as Mitsuba sees it. With blinn_phong_bsdf, the only module that knows Mitsuba.

The twin stands around the camera, in coordinates from there: the shift is done in double, before anything is rounded.
"""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from visray.lights import PointLight
from visray.materials import Material
from visray.primitives.primitive import Twin
from visray.scene.scene import Gradient, Scene
from visray.study.answers import Answers, Rays
from visray.study.blinn_phong_bsdf import DIFFUSE, GLOSSY, VARIANT
from visray.study.parts import extents, parts
from visray.study.rounding import Shift


class Theirs:
    """The scene in Mitsuba. `names` gives the order of the indices, `made` each object's twin."""

    def __init__(self, scene: Scene, names: tuple[str, ...], made: dict[str, Twin], centre: np.ndarray):
        mi.set_variant(VARIANT)
        self.scene, self.centre, self.names = scene, centre, names
        self.materials = {"default": Material()} | scene.materials
        bsdfs = {name: _bsdf(m) for name, m in self.materials.items()}
        found = parts([made[name] for name in names], centre)
        self.extents = extents([scene.objects[n] for n in names], found)
        self.uv = [[part.uv for part in of] for of in found]
        children: dict = {"type": "scene", "embree_use_robust_intersections": True}
        for i, name in enumerate(names):
            for j, part in enumerate(found[i]):
                # Mitsuba puts shapes into another order, and forbids some of our names, so numbers are kept instead.
                children[f"{i}_{j}"] = _shape(part.shape, f"{i}_{j}", bsdfs[scene.objects[name].material])
        self.mitsuba = _loaded(children)
        self.owner, self.part_of = self._registry()

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

    def reaches(self, p: np.ndarray, light: np.ndarray, margin: np.ndarray) -> np.ndarray:
        """Whether nothing lies between points and a light, but for what is within `margin` of the point.

        Shapes: p (N, 3), light (3), margin (N), in world units.
        """
        way = light - p
        length = np.linalg.norm(way, axis=1)
        d = np.divide(way, length[:, None], out=np.zeros_like(way), where=length[:, None] > 0)
        ray = self._sent(Rays((p + margin[:, None] * d).astype(np.float32), d.astype(np.float32)))
        ray.maxt = mi.Float((length - margin).astype(np.float32))
        # Not by ray_test, which solves a sphere's equation as seen from the ray's origin: far from it digits cancel.
        return ~np.array(self.mitsuba.ray_intersect_preliminary(ray).is_valid()) | (length <= margin)

    def colours(self, rays: Rays, si: Any, answers: Answers, shift: Shift) -> np.ndarray:
        """The light along rays from the camera, by Mitsuba's hits, frames, tests and BSDFs. Shapes: (N, 3)."""
        scene, n = self.scene, len(answers.t)
        ka = np.array([self.materials[scene.objects[name].material].ka for name in self.names] + [(0, 0, 0)], float)
        glow = np.array(scene.ambient, float) + sum(l.intensity * np.array(l.Ia) for l in scene.lights.values())
        colour = np.where(answers.hit[:, None], glow * ka[answers.index], _sky(scene, rays))
        p = np.array(si.p, float).T
        for light in scene.lights.values():
            way = np.array(light.position, float) - self.centre - p
            distance = np.linalg.norm(way, axis=1)
            l = way / np.maximum(distance, np.finfo(float).tiny)[:, None]
            sent = self._scattered(light, si, l)
            if scene.settings.shadows:
                cosine = np.abs((answers.n * l).sum(1))
                lit = answers.hit & (cosine > 0)
                margin = np.where(lit, shift.start(p) / np.where(lit, cosine, 1), 0)
                clear = self.reaches(p, p + way, margin)
            else:
                clear = np.ones(n, bool)
            colour += np.where((answers.hit & clear)[:, None], sent * _weight(light, distance)[:, None], 0)
        return colour

    def _scattered(self, light: PointLight, si: Any, l: np.ndarray) -> np.ndarray:
        """Id times the diffuse part plus Is times the highlight, by Mitsuba's BSDFs and frames. Shapes: (N, 3)."""
        wo = si.to_local(mi.Vector3f(*l.T.astype(np.float32)))
        context, bsdf, total = mi.BSDFContext(), si.bsdf(), 0
        for component, colour in ((DIFFUSE, light.Id), (GLOSSY, light.Is)):
            context.component = component
            part = np.array(bsdf.eval(context, si, wo, si.is_valid()), float).T
            total = total + light.intensity * np.array(colour, float) * part
        return total


def _weight(light: PointLight, distance: np.ndarray) -> np.ndarray:
    weight = light.a + light.b * distance + light.c * distance**2
    return np.divide(1, weight, out=np.ones_like(distance), where=weight > 0)


def _sky(scene: Scene, rays: Rays) -> np.ndarray:
    """What rays see that hit nothing. Shapes: (N, 3)."""
    if scene.film.transparent:
        return np.zeros(rays.d.shape)
    sky = scene.background
    top, bottom = (np.array(c, float) for c in ((sky.top, sky.bottom) if isinstance(sky, Gradient) else (sky, sky)))
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
    return mi.load_dict({"type": "blinn_phong", "kd": list(m.kd), "ks": list(m.ks), "shininess": m.shininess})


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
