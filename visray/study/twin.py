"""The scene as Mitsuba sees it. With blinn_phong_bsdf, the only module that knows Mitsuba.

The twin stands around the camera, in coordinates from there: the shift is done in double, before anything is rounded.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from visray.lights import PointLight
from visray.materials import Material
from visray.primitives.primitive import Primitive, Twin
from visray.scene.scene import Gradient, Scene
from visray.study.answers import Answers, Rays
from visray.study.blinn_phong_bsdf import DIFFUSE, GLOSSY, VARIANT
from visray.study.facets import Facets, around, facets
from visray.study.rounding import BOUND, Extents, Shift
from visray.transforms import compose

# A plane is made of squares, each twice as large as the one in it, so that corners are as near as the points between
# them, and rounded as finely. These are the first one, unless the camera is farther away, and a bound of the last one:
# the products of three lengths in Embree stay below the largest single, 2^128.
SMALLEST_SQUARE, LARGEST_SQUARE = 2.0**-16, 2.0**40


def twins(scene: Scene) -> tuple[dict[str, Twin], dict[str, str]]:
    """The twins of the objects, and of those that have none, why."""
    answers = {name: thing.mitsuba() for name, thing in scene.objects.items()}
    return (
        {name: a for name, a in answers.items() if isinstance(a, Twin)},
        {name: a for name, a in answers.items() if isinstance(a, str)},
    )


@dataclass(frozen=True)
class Part:
    """One shape of a twin, its numbers from the centre, and what bounds its rounding: see Extents.

    blunt: how many times farther the corners of a facet are than it is wide, so that as many times their rounding turns
    it; smear: the change of (u, v) on a facet over its width, where it is one of many.
    """

    shape: dict
    uv: Callable
    far: float
    growth: float = 0.0
    blunt: float = 1.0
    smear: float = 0.0
    gap: float = 0.0
    slip: float = 0.0
    tilt: float = 0.0


def parts(made: list[Twin], centre: np.ndarray) -> list[list[Part]]:
    """The shapes of twins, moved so that `centre` is the origin."""
    counts = Counter(shape["type"] for twin in made for shape in twin.shapes)
    return [[_part(dict(shape), twin.uv or (lambda uv: uv), centre, counts) for shape in twin.shapes] for twin in made]


def _part(shape: dict, uv: Callable, centre: np.ndarray, counts: Counter) -> Part:
    if shape["type"] == "mesh":
        shape["vertices"] = shape["vertices"] - centre
        far, blunt = _of_facets(shape["vertices"], shape["faces"])
        return Part(shape, uv, far.max(), blunt=blunt.max())
    whole = shape["to_world"] = shape["to_world"].copy()
    whole[:3, 3] -= centre
    if shape["type"] == "plane":
        return _plane(whole, uv)
    if shape["type"] == "rectangle":
        x, y, _, o = whole[:3].T
        corners = np.array([o - x - y, o + x - y, o + x + y, o - x + y])
        far, blunt = _of_facets(corners, np.array([[0, 1, 2], [0, 2, 3]]))
        return Part(shape, uv, far.max(), blunt=blunt.max())
    if shape["type"] == "disk":
        # Only its z axis could be of another length, which means nothing on a disk.
        whole[:3, 2] *= np.linalg.norm(whole[:3, 0]) / np.linalg.norm(whole[:3, 2])
    if shape["type"] in ("sphere", "disk") and uniform(whole[:3, :3]):
        own = (lambda found: uv(_square(found))) if shape["type"] == "disk" else uv
        return Part(shape, own, np.linalg.norm(whole[:3], axis=0).sum())
    return _faceted(facets(shape["type"], around(shape["type"], counts[shape["type"]])), uv, whole)


def _square(polar: tuple) -> tuple:
    """The square around a disk, from 0 to 1, from Mitsuba's distance and angle on it, both from 0 to 1."""
    return tuple(0.5 + 0.5 * polar[0] * part(2 * np.pi * polar[1]) for part in (np.cos, np.sin))


def _faceted(f: Facets, uv: Callable, whole: np.ndarray) -> Part:
    """A round shape as a mesh. Its normals are given, so they do not turn with the facets.

    But where on a narrow facet a ray is, and so what its (u, v) are, is less certain than where it is in the world.
    """
    linear = whole[:3, :3]
    vertices, normals = f.vertices @ linear.T + whole[:3, 3], f.normals @ np.linalg.inv(linear)
    normals /= np.linalg.norm(normals, axis=1).max()
    far, blunt = _of_facets(vertices, f.faces)
    smear = (blunt / far * np.ptp(f.uv[f.faces], 1).max(1)).max()
    mesh = {"type": "mesh", "vertices": vertices, "normals": normals, "uv": f.uv, "faces": f.faces}
    gap, tilt = f.gap * np.linalg.norm(linear, 2), f.tilt * np.linalg.cond(linear)
    return Part(mesh, uv, far.max(), smear=smear, gap=gap, slip=f.slip, tilt=tilt)


def uniform(linear: np.ndarray) -> bool:
    """Whether a linear map keeps shapes: a turn, a mirror, a scale."""
    square = linear.T @ linear
    scale = np.trace(square) / 3
    # Twelve roundings in the product and the trace; a tenfold share for those of the composed steps.
    return bool(np.allclose(square, scale * np.eye(3), rtol=0, atol=120 * np.finfo(float).eps * scale))


def mirrors(matrix: np.ndarray | None) -> bool:
    """Whether a transform turns a right hand into a left one."""
    return matrix is not None and bool(np.linalg.det(matrix[:, :3]) < 0)


def _of_facets(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far the corners of each triangle are, and how many times that is its width."""
    corners = vertices[faces]
    sides = np.roll(corners, -1, 1) - corners
    width = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / np.linalg.norm(sides, axis=2).max(1)
    far = np.linalg.norm(corners, axis=2).max(1)
    return far, far / width


def _plane(whole: np.ndarray, uv: Callable) -> Part:
    """A plane as squares within squares about the point nearest to the centre."""
    x, y, _, o = whole[:3].T
    n = np.cross(x, y) / np.linalg.norm(np.cross(x, y))
    foot = n * (n @ o)
    s = x / np.linalg.norm(x)
    first = 2.0 ** np.ceil(np.log2(max(np.linalg.norm(foot), SMALLEST_SQUARE)))
    sides = first * 2.0 ** np.arange(max(1, 1 + np.log2(LARGEST_SQUARE / first)))
    corners = np.array([-s - np.cross(n, s), s - np.cross(n, s), s + np.cross(n, s), -s + np.cross(n, s)])
    away = (sides[:, None, None] * corners).reshape(-1, 3)
    inner = 4 * np.arange(len(sides) - 1)[:, None] + np.arange(4)
    after = 4 * np.arange(len(sides) - 1)[:, None] + (np.arange(4) + 1) % 4
    rings = np.stack([inner, inner + 4, after + 4, inner, after + 4, after], -1).reshape(-1, 3)
    faces = np.concatenate([[[0, 1, 2], [0, 2, 3]], rings])
    # (u, v) from the foot: single precision is finest near the camera, and the foot's own are added in double.
    inverse = np.linalg.inv(whole[:3, :3])[:2]
    base = inverse @ (foot - o)
    mesh = {"type": "mesh", "vertices": foot + away, "faces": faces, "uv": away @ inverse.T}
    spread = 2 * np.sqrt(2)
    far = np.linalg.norm(foot) + spread * first
    blunt = _of_facets(mesh["vertices"], faces)[1].max()
    return Part(mesh, lambda found: uv((found[0] + base[0], found[1] + base[1])), far, spread, blunt)


def extents(things: list[Primitive], made: list[list[Part]]) -> Extents:
    """What bounds the rounding of each object's twin."""

    def most(name: str) -> np.ndarray:
        return np.array([max(getattr(p, name) for p in found) for found in made])

    return Extents(
        far=most("far"),
        growth=most("growth"),
        gap=most("gap"),
        angle=BOUND * most("blunt") + most("tilt"),
        smear=most("smear"),
        slip=most("slip"),
        bounded=np.array([t.bounded for t in things]),
        sided=np.array([t.closed and not mirrors(compose(t.transform)) for t in things]),
    )


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
        level = mi.logger().log_level()
        # Its warnings of unequal scales are absolute, so that large shapes of equal scales cause them too.
        mi.set_log_level(mi.LogLevel.Error)
        # Optimised, meshes of one BSDF would become one mesh.
        self.mitsuba = mi.load_dict(children, optimize=False)
        mi.set_log_level(level)
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
        # Not by ray_test, which solves the equation of a sphere from the ray's origin, so that far from it digits cancel.
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
