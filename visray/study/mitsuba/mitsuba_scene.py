"""The Mitsuba side of the check. Only this module and blinn_phong_bsdf import Mitsuba.

The camera is the origin of Mitsuba's coordinates. The shift is done in double precision, before anything is rounded.
"""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from visray.lights.light import Light
from visray.materials import Material
from visray.primitives.primitive import MitsubaShapes
from visray.scene.scene import Scene, SkyGradient
from visray.study.mitsuba import light_falloff
from visray.study.mitsuba.blinn_phong_bsdf import DIFFUSE, GLOSSY, VARIANT
from visray.study.mitsuba.diffuse_colour import DiffuseColours
from visray.study.mitsuba.placed_shapes import object_rounding, placed_shapes
from visray.study.mitsuba.shadow_rays import ShadowRays
from visray.study.mitsuba.visray_scene import FirstHits, Rays


class MitsubaScene:
    """A scene that is loaded into Mitsuba.

    names: the objects in the order of their indices
    shapes: of each object by name, the shapes that stand for it
    centre: the camera's position
    """

    def __init__(self, scene: Scene, names: tuple[str, ...], shapes: dict[str, MitsubaShapes], centre: np.ndarray):
        mi.set_variant(VARIANT)
        self.scene, self.centre, self.names = scene, centre, names
        self.materials = {"default": Material()} | scene.materials
        self.shapes = placed_shapes([shapes[name] for name in names], centre)
        self.rounding = object_rounding([scene.objects[n] for n in names], self.shapes)
        self.diffuse_colours = DiffuseColours(scene, names)
        self.mitsuba = _loaded(self._children(names))
        self.scenes_of_subsets: dict[tuple[str, ...], Any] = {}
        self.object_of, self.shape_of = self._registry()

    def _children(self, names: tuple[str, ...]) -> dict:
        """Chosen objects as a dict for Mitsuba's load_dict."""
        bsdfs = {name: _bsdf(m) for name, m in self.materials.items()}
        children: dict = {"type": "scene", "embree_use_robust_intersections": True}
        for name in names:
            i, bsdf = self.names.index(name), bsdfs[self.scene.objects[name].material]
            for j, placed in enumerate(self.shapes[i]):
                # Numbers serve as ids: Mitsuba forbids some of our names, and puts shapes into another order.
                children[f"{i}_{j}"] = _shape(placed.shape, f"{i}_{j}", bsdf)
        return children

    def _registry(self) -> tuple[np.ndarray, np.ndarray]:
        """For each of Mitsuba's shape numbers, the object's index and the shape's index in it; -1 for no object."""
        numbers = {s.id(): int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(s))[0]) for s in self.mitsuba.shapes()}
        object_of, shape_of = (np.full(1 + max(numbers.values(), default=0), -1) for _ in range(2))
        for key, number in numbers.items():
            object_of[number], shape_of[number] = map(int, key.split("_"))
        return object_of, shape_of

    def _mitsuba_rays(self, rays: Rays) -> Any:
        d = mi.Vector3f(*rays.d.T.copy())
        o = mi.Point3f(*np.broadcast_to(rays.o, rays.d.shape).T.copy())
        return mi.Ray3f(o, d)

    def trace(self, rays: Rays) -> tuple[Any, FirstHits]:
        """Traces rays. Returns Mitsuba's own record (SurfaceInteraction) and the first hits."""
        si = self.mitsuba.ray_intersect(self._mitsuba_rays(rays))
        number = dr.reinterpret_array(mi.UInt32, si.shape)
        dr.eval(si, number)
        number = np.array(number)
        # Mitsuba's t counts lengths of d, which in single precision is not exactly 1.
        t = np.array(si.t, float) * np.linalg.norm(rays.d.astype(float), axis=1)
        n = np.array(si.sh_frame.n, float).T
        n = n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), np.finfo(float).tiny)
        return si, FirstHits(self.object_of[number], t, n, self._visray_uv(number, np.array(si.uv, float)))

    def _visray_uv(self, number: np.ndarray, uv: np.ndarray) -> np.ndarray:
        """visray's (u, v) from Mitsuba's. Shapes: shape numbers (N), uv (2, N) -> (N, 2)."""
        result = np.full((len(number), 2), np.nan)
        order = np.argsort(number, kind="stable")
        for lanes in np.split(order, 1 + np.flatnonzero(np.diff(number[order]))):
            number_of_lanes = number[lanes[0]]
            index = self.object_of[number_of_lanes]
            if index >= 0:
                visray_uv = self.shapes[index][self.shape_of[number_of_lanes]].uv
                result[lanes] = np.stack(visray_uv((uv[0, lanes], uv[1, lanes])), 1)
        return result

    def unoccluded(self, shadow_rays: ShadowRays, margin: np.ndarray) -> np.ndarray:
        """Whether nothing lies on shadow rays farther than `margin` from their start (world units). Shapes: (N)."""
        if not self.scene.settings.shadows:
            return np.ones(len(shadow_rays.p), bool)
        rest = shadow_rays.without_start(margin)
        # Not by ray_test: it solves a sphere's equation relative to the ray's origin, and far away digits cancel.
        hit = self.mitsuba.ray_intersect_preliminary(self._bounded_rays(rest))
        return ~np.array(hit.is_valid()) | (rest.length == 0)

    def first_hit(self, shadow_rays: ShadowRays, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
        """The first hit of shadow rays with the named objects alone.

        Returns the distance, inf for none, and the |cosine| of the ray with the normal. Shapes: (N), (N).
        """
        if not len(shadow_rays.p):
            # Mitsuba ends the process if there are no rays at all.
            return np.zeros(0), np.zeros(0)
        if names not in self.scenes_of_subsets:
            self.scenes_of_subsets[names] = _loaded(self._children(names))
        si = self.scenes_of_subsets[names].ray_intersect(self._bounded_rays(shadow_rays))
        return np.array(si.t, float), np.abs((np.array(si.n, float).T * shadow_rays.l).sum(1))

    def _bounded_rays(self, shadow_rays: ShadowRays) -> Any:
        ray = self._mitsuba_rays(Rays(shadow_rays.p.astype(np.float32), shadow_rays.l.astype(np.float32)))
        ray.maxt = mi.Float(shadow_rays.length.astype(np.float32))
        return ray

    def colours(
        self, rays: Rays, si: Any, hits: FirstHits, uv: np.ndarray, transmittances: list[np.ndarray]
    ) -> np.ndarray:
        """Radiance along camera rays, by Mitsuba's hits, shading frames and BSDFs. Shapes: (N, 3).

        uv: where textures are looked up, (N, 2)
        transmittances: for each light, the share of its light that arrives at the hit, (N, 1) or (N, 3)
        """
        scene = self.scene
        ka = np.array([self.materials[scene.objects[name].material].ka for name in self.names] + [(0, 0, 0)], float)
        ambient = np.array(scene.ambient, float) + sum(l.intensity * np.array(l.Ia) for l in scene.lights.values())
        colour = np.where(hits.hit[:, None], ambient * ka[hits.index], _sky(scene, rays))
        kd = self.diffuse_colours.colours(hits.index, uv)
        p = np.array(si.p, float).T
        for light, share in zip(scene.lights.values(), transmittances):
            to_light = ShadowRays.to(p, light, self.centre)
            falloff = light_falloff.attenuation(light, to_light.length) * light.falloff_reference(-to_light.l)
            reflected = self._reflected(light, si, to_light.l, kd)
            colour += np.where(hits.hit[:, None], reflected * (share * falloff[:, None]), 0)
        return colour

    def _reflected(self, light: Light, si: Any, l: np.ndarray, kd: np.ndarray) -> np.ndarray:
        """Reflected light: Id times the diffuse part plus Is times the highlight, by Mitsuba's BSDF. Shapes: (N, 3)."""
        wo = si.to_local(mi.Vector3f(*l.T.astype(np.float32)))
        context, bsdf, total = mi.BSDFContext(), si.bsdf(), 0
        for component, colour in ((DIFFUSE, light.Id * kd), (GLOSSY, np.array(light.Is, float))):
            context.component = component
            value = np.array(bsdf.eval(context, si, wo, si.is_valid()), float).T
            total = total + light.intensity * colour * value
        return total


def _sky(scene: Scene, rays: Rays) -> np.ndarray:
    """Background colour of rays that hit nothing. Shapes: (N, 3)."""
    if scene.film.transparent:
        return np.zeros(rays.d.shape)
    sky = scene.background
    top, bottom = (np.array(c, float) for c in ((sky.top, sky.bottom) if isinstance(sky, SkyGradient) else (sky, sky)))
    return bottom + (0.5 + 0.5 * rays.direction()[:, 1:2]) * (top - bottom)


def _loaded(children: dict) -> Any:
    """Loads a Mitsuba scene."""
    level = mi.logger().log_level()
    # Mitsuba warns of unequal scales by an absolute difference, so it warns of large shapes of equal scales too.
    mi.set_log_level(mi.LogLevel.Error)
    try:
        # With optimize=True, meshes of one BSDF would be merged into one mesh.
        return mi.load_dict(children, optimize=False)
    finally:
        mi.set_log_level(level)


def _bsdf(m: Material) -> Any:
    """The BSDF of a material with kd = 1: the diffuse part is later multiplied by the colour at (u, v)."""
    return mi.load_dict({"type": "blinn_phong", "kd": [1.0, 1.0, 1.0], "ks": list(m.ks), "shininess": m.shininess})


def _shape(shape: dict, name: str, bsdf: Any) -> Any:
    """A shape for Mitsuba's load_dict: a dict, or a Mesh object for triangles."""
    if shape["type"] == "mesh":
        return _mesh(shape, name, bsdf)
    to_world = mi.ScalarTransform4f(shape["to_world"].tolist())
    return {"type": shape["type"], "id": name, "to_world": to_world, "bsdf": bsdf}


def _mesh(shape: dict, name: str, bsdf: Any) -> Any:
    """Triangles as a Mitsuba Mesh."""
    props = mi.Properties()
    props["mesh_bsdf"] = bsdf
    props.set_id(name)
    attributes = {"has_vertex_normals": "normals" in shape, "has_vertex_texcoords": "uv" in shape}
    mesh = mi.Mesh(name, len(shape["vertices"]), len(shape["faces"]), props, **attributes)
    buffers = mi.traverse(mesh)
    fields = {"vertices": "vertex_positions", "normals": "vertex_normals", "uv": "vertex_texcoords"}
    for ours, theirs in fields.items():
        if ours in shape:
            buffers[theirs] = mi.Float(np.ravel(shape[ours]).astype(np.float32))
    buffers["faces"] = mi.UInt32(np.ravel(shape["faces"]).astype(np.uint32))
    buffers.update()
    return mesh
