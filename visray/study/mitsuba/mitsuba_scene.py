"""The Mitsuba side of the check. Only this module, blinn_phong_bsdf and mitsuba_environment
import Mitsuba.

The camera is the origin of Mitsuba's coordinates. Objects are moved there in double precision, before their numbers are
rounded to single precision.
"""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from visray.environment_map import EnvironmentMap
from visray.lights.light import Light
from visray.materials import Material
from visray.primitives.mesh import Mesh
from visray.primitives.primitive import MitsubaShapes
from visray.scene.scene import Scene, SkyGradient
from visray.study.mitsuba import light_falloff
from visray.study.mitsuba.blinn_phong_bsdf import DIFFUSE, GLOSSY, VARIANT
from visray.study.mitsuba.mitsuba_environment import environment_light
from visray.study.mitsuba.placed_shapes import object_rounding, placed_shapes
from visray.study.mitsuba.shadow_rays import ShadowRays
from visray.study.mitsuba.surface_colours import SurfaceColours
from visray.study.mitsuba.visray_scene import FirstHits, Rays


class MitsubaScene:
    """A scene that is loaded into Mitsuba.

    scene: the scene in visray's form
    names: names of the objects in the order of their indices
    shapes: by the name of an object, the Mitsuba shapes that stand for it
    centre: the camera's position
    """

    def __init__(self, scene: Scene, names: tuple[str, ...], shapes: dict[str, MitsubaShapes], centre: np.ndarray):
        mi.set_variant(VARIANT)
        self.scene, self.centre, self.names = scene, centre, names
        self.materials = {"default": Material()} | scene.materials
        self.shapes = placed_shapes([shapes[name] for name in names], centre)
        self.rounding = object_rounding([scene.objects[n] for n in names], self.shapes)
        self.is_mesh = np.append([isinstance(scene.objects[name], Mesh) for name in names], False)
        self.surface_colours = SurfaceColours(scene, names)
        self.mitsuba = _loaded(self._children(names))
        self.scenes_of_subsets: dict[tuple[str, ...], Any] = {}
        self.object_of, self.shape_of = self._registry()

    def _children(self, names: tuple[str, ...]) -> dict:
        """The objects with the given names, as a dict for Mitsuba's load_dict."""
        sides = {name: map(self.scene.material, self.scene.sides_of(name)) for name in self.materials}
        bsdfs = {name: _bsdf(*both) for name, both in sides.items()}
        children: dict = {"type": "scene", "embree_use_robust_intersections": True}
        for name in names:
            i, bsdf = self.names.index(name), bsdfs[self.scene.objects[name].material]
            for j, placed in enumerate(self.shapes[i]):
                # Ids are made of numbers, because Mitsuba forbids some of visray's names. They are needed to find
                # the shapes again, because Mitsuba puts them into another order.
                children[f"{i}_{j}"] = _shape(placed.shape, f"{i}_{j}", bsdf)
        return children

    def _registry(self) -> tuple[np.ndarray, np.ndarray]:
        """Two arrays that are indexed by Mitsuba's shape numbers: the index of the object, -1 if the number stands for
        no object; and the index of the shape among the shapes of its object.
        """
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
        """Traces rays. Returns their first hits twice: as Mitsuba's record (SurfaceInteraction), and as FirstHits."""
        si = self.mitsuba.ray_intersect(self._mitsuba_rays(rays))
        number = dr.reinterpret_array(mi.UInt32, si.shape)
        dr.eval(si, number)
        number = np.array(number)
        # Mitsuba measures t in lengths of d, and in single precision this length is not exactly 1.
        t = np.array(si.t, float) * np.linalg.norm(rays.d.astype(float), axis=1)
        index = self.object_of[number]
        # If facets stand for a curved surface, Mitsuba's normals for shading are those of the surface. Triangles of a
        # mesh are compared themselves; their normals for shading show in the picture.
        n = np.where(self.is_mesh[index][:, None], np.array(si.n, float).T, np.array(si.sh_frame.n, float).T)
        n = n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), np.finfo(float).tiny)
        return si, FirstHits(index, t, n, self._visray_uv(number, np.array(si.uv, float)))

    def _visray_uv(self, number: np.ndarray, uv: np.ndarray) -> np.ndarray:
        """visray's (u, v), computed from Mitsuba's; NaN for rays that hit nothing.

        number: Mitsuba's shape number of each hit
        Shapes: number (N), uv (2, N) -> (N, 2).
        """
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
        """Whether no object lies on a shadow ray farther than `margin` from its start; always true without shadows.

        margin: in world units, (N)
        Shapes: (N).
        """
        if not self.scene.settings.shadows:
            return np.ones(len(shadow_rays.p), bool)
        rest = shadow_rays.without_start(margin)
        # Mitsuba's ray_test is not used: it solves a sphere's equation relative to the ray's origin, so that digits
        # cancel if the sphere is far away.
        hit = self.mitsuba.ray_intersect_preliminary(self._bounded_rays(rest))
        return ~np.array(hit.is_valid()) | (rest.length == 0)

    def first_hit(self, shadow_rays: ShadowRays, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
        """The first hit of shadow rays with the objects of the given names; other objects are ignored.

        Returns the distance, inf without a hit, and the cosine of the angle between ray and normal. Shapes: (N), (N).
        """
        if not len(shadow_rays.p):
            # Mitsuba ends the process if there are no rays at all.
            return np.zeros(0), np.zeros(0)
        if names not in self.scenes_of_subsets:
            self.scenes_of_subsets[names] = _loaded(self._children(names))
        si = self.scenes_of_subsets[names].ray_intersect(self._bounded_rays(shadow_rays))
        return np.array(si.t, float), (np.array(si.n, float).T * shadow_rays.l).sum(1)

    def _bounded_rays(self, shadow_rays: ShadowRays) -> Any:
        ray = self._mitsuba_rays(Rays(shadow_rays.p.astype(np.float32), shadow_rays.l.astype(np.float32)))
        ray.maxt = mi.Float(shadow_rays.length.astype(np.float32))
        return ray

    def colours(
        self, rays: Rays, si: Any, hits: FirstHits, uv: np.ndarray, transmittances: list[np.ndarray]
    ) -> np.ndarray:
        """Radiance along camera rays, computed from Mitsuba's hits, shading frames and BSDFs. Shapes: (N, 3).

        si, hits: Mitsuba's own record of the hits, and the first hits
        uv: texture coordinates at which textures are looked up, (N, 2)
        transmittances: for each light, the fraction of its light that arrives at the hit, (N, 1) or (N, 3)
        """
        scene = self.scene
        side = self.surface_colours.seen(hits.index, hits.inside(rays.d))
        kd, ka = self.surface_colours.both(side, uv)
        ambient = np.array(scene.ambient, float) + sum(l.intensity * np.array(l.Ia) for l in scene.lights.values())
        colour = np.where(hits.hit[:, None], ambient * ka, _sky(scene, rays))
        p = np.array(si.p, float).T
        for light, share in zip(scene.lights.values(), transmittances):
            to_light = ShadowRays.to(p, light, self.centre)
            falloff = light_falloff.attenuation(light, to_light.length) * light.falloff_reference(-to_light.l)
            reflected = self._reflected(light, si, to_light.l, kd)
            arrives = hits.hit & ~(self.is_mesh[hits.index] & _behind_triangle(si, to_light.l))
            colour += np.where(arrives[:, None], reflected * (share * falloff[:, None]), 0)
        own = np.where(self.surface_colours.unlit[side][:, None], kd, colour)
        return own + self.surface_colours.emission[side]

    def _reflected(self, light: Light, si: Any, l: np.ndarray, kd: np.ndarray) -> np.ndarray:
        """Reflected light of one light: Id times the diffuse part plus Is times the highlight. Shapes: (N, 3).

        Both parts are computed by the BSDF in Mitsuba. l: unit directions to the light; kd: diffuse colours.
        """
        wo = si.to_local(mi.Vector3f(*l.T.astype(np.float32)))
        context, bsdf, total = mi.BSDFContext(), si.bsdf(), 0
        for component, colour in ((DIFFUSE, light.Id * kd), (GLOSSY, np.array(light.Is, float))):
            context.component = component
            value = np.array(bsdf.eval(context, si, wo, si.is_valid()), float).T
            total = total + light.intensity * colour * value
        return total


def _behind_triangle(si: Any, l: np.ndarray) -> np.ndarray:
    """Whether the light is on the other side of the triangle than the viewer. Normals for shading do not tell that, and
    in visray no light goes through a triangle. l: unit directions to the light. Shapes: (N, 3) -> (N).
    """
    n, v = np.array(si.n, float).T, np.array(si.to_world(si.wi), float).T
    return (n * l).sum(1) * (n * v).sum(1) <= 0


def _sky(scene: Scene, rays: Rays) -> np.ndarray:
    """Background colour of rays that hit nothing; black if the film is transparent. Shapes: (N, 3)."""
    if scene.film.transparent:
        return np.zeros(rays.d.shape)
    sky = scene.background
    if isinstance(sky, EnvironmentMap):
        return environment_light(sky, rays.direction())
    top, bottom = (np.array(c, float) for c in ((sky.top, sky.bottom) if isinstance(sky, SkyGradient) else (sky, sky)))
    return bottom + (0.5 + 0.5 * rays.direction()[:, 1:2]) * (top - bottom)


def _loaded(children: dict) -> Any:
    """The Mitsuba scene of a dict for load_dict."""
    level = mi.logger().log_level()
    # Mitsuba warns if the scales of a shape are unequal. As it tests their absolute difference, it also warns of large
    # shapes with equal scales.
    mi.set_log_level(mi.LogLevel.Error)
    try:
        # With optimize=True, meshes of one BSDF would be merged into one mesh.
        return mi.load_dict(children, optimize=False)
    finally:
        mi.set_log_level(level)


def _bsdf(front: Material, back: Material) -> Any:
    """The BSDF of a material, with kd = 1: `_reflected` multiplies the diffuse part by the colour at (u, v)."""
    sides = {"ks": list(front.ks), "shininess": front.shininess, "back_ks": list(back.ks),
             "back_shininess": back.shininess}  # fmt: skip
    return mi.load_dict({"type": "blinn_phong", "kd": [1.0, 1.0, 1.0]} | sides)


def _shape(shape: dict, name: str, bsdf: Any) -> Any:
    """A shape for Mitsuba's load_dict: a Mesh object if it consists of triangles, otherwise a dict."""
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
    if "normals" in shape:
        # Mitsuba computes normals of its own when the vertices change, so they are set once more.
        buffers["vertex_normals"] = mi.Float(np.ravel(shape["normals"]).astype(np.float32))
        buffers.update()
    return mesh
