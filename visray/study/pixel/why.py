"""Finds the story of a pixel: follows the path of one sample through the functions that pictures are rendered with.

All lanes hold the same sample of the same pixel. Different lanes look at different samples of an area light, or at
different scattered rays.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np

from visray import indirect as paths
from visray.accel.intersect import closest
from visray.accel.origin import RayOrigin
from visray.address_index import AddressIndex
from visray.background import background
from visray.columns import Columns, materials_of
from visray.data.all_objects import address_of
from visray.errors import UserError
from visray.integrator import camera_origin, object_of
from visray.interaction import Interaction
from visray.light_probe import LightProbe, centre_sample, interaction_of, numbers, prepared_lights, probed
from visray.lights.light import Light
from visray.media import Interface, interface_at, local_weight, transmitted
from visray.modes import BY_NAME
from visray.pytree import evaluated
from visray.quantities import quantities
from visray.ray import NO_ROW, Hit, Ray
from visray.renderer import prepare
from visray.sampling import SampleState
from visray.scene.scene import Scene
from visray.setup import Prepared
from visray.shading import ambient, shade
from visray.study.pixel.story import Colour, LightStory, PixelStory, SurfaceStory
from visray.visible_lights import nearest_light

BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)


def why(scene: Scene | Prepared | str | Path, x: int, y: int) -> PixelStory:
    """Why a pixel has its colour: what is hit, what becomes of each light, and what is reflected and refracted.

    x, y: column and row of the pixel in the whole picture, from 0, 0 at the top left.

    The story is that of one sample in the pixel's centre, without the blur of a lens or a filter. `print` shows it as
    text.
    """
    prepared = scene if isinstance(scene, Prepared) else prepare(scene)
    film = prepared.scene.film
    for name, value, size in (("x", x, film.size[0]), ("y", y, film.size[1])):
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not 0 <= value < size:
            raise UserError(f"{name} = {value!r}: must be a whole number from 0 to {size - 1}, as the film has {size}")
    return _Walk(prepared, int(x), int(y)).story()


def sample_of(prepared: Prepared, x: int, y: int, lanes: int) -> tuple[Ray, SampleState]:
    """The camera ray through a pixel's centre and the random numbers of the pixel's first sample, in several lanes."""
    x, y = (dr.opaque(prepared.a.U, v, lanes) for v in (x, y))
    return centre_sample(prepared.kernel, x, y)


@dataclass
class _Walk:
    """The path of one sample of a pixel."""

    prepared: Prepared
    x: int
    y: int

    def __post_init__(self):
        scene, self.s = self.prepared.scene, self.prepared.kernel
        self.objects, self.light_names = list(scene.all_objects), list(scene.lights)
        samples = [getattr(light, "samples", 1) for light in scene.lights.values()]
        # At least two lanes, because single numbers make other kernels.
        self.n = max(2, *samples, scene.settings.scatter.rays, 1)
        self.j = dr.arange(self.s.a.U, self.n) + dr.opaque(self.s.a.U, 0)
        self.addresses = AddressIndex(scene, self.prepared.packed)

    def story(self) -> PixelStory:
        """The whole story."""
        s, surfaces = self.s, []
        ray, sample = sample_of(self.prepared, self.x, self.y, self.n)
        origin = RayOrigin(s.geometry, ray.o, shared=False) if s.features["defocus"] else camera_origin(s, ray)
        first = self.interaction(ray, closest(origin, ray, s.brute_force), sample)
        si, ray, way, weight, number = first, ray.exact(), "camera", s.a.V(1), 0
        limits = s.bounce_limits if s.features["scatter"] else (s.bounce_limits[0], None)
        while True:
            media = interface_at(s, si) if s.features["paths"] else None
            if (lamp := self.lamp(si, ray, way, weight, limits)) is not None:
                surfaces.append(lamp)
                break
            if (passed := transmitted(s, si, media)) is not None:
                weight = weight * passed
            surfaces.append(self.surface(si, ray, way, weight, media))
            if not s.features["paths"] or surfaces[-1].object is None:
                break
            b = paths.bounce(s, si, ray, media, *limits, s.a.U(0) if way == "camera" else None)
            evaluated((b.ray, b.weight, b.alive, b.scattered))
            if not self.first(b.alive):
                break
            if way == "camera" and self.first(b.scattered):
                surfaces[-1] = self.with_scattered(surfaces[-1], si, ray, media)
                break
            way, weight, limits = self.way_of(si, b, media), weight * b.weight, paths.limits_after(s.a, b, *limits)
            ray = b.ray
            hit = closest(RayOrigin(s.geometry, ray.o, shared=False), ray, s.brute_force, b.alive)
            si = self.interaction(ray, hit, first.sample.derived(1 + (dr.opaque(s.a.U, number) << 16)))
            number += 1
        total = [np.add(x.adds, x.scattered_light) for x in surfaces]
        return PixelStory(self.x, self.y, s.settings.shading, tuple(surfaces), _colour(np.sum(total, 0)))

    def interaction(self, ray: Ray, hit: Hit, sample: SampleState) -> Interaction:
        """The interaction at a hit, evaluated."""
        return interaction_of(self.s, ray.exact(), hit, sample)

    def first(self, value: Any) -> Any:
        """The value of the first lane, as a plain number or a tuple of numbers."""
        x = numbers(value, self.n)[0]
        return _colour(x) if x.shape else x.item()

    def lamp(self, si: Interaction, ray: Ray, way: str, weight: Any, limits: tuple) -> SurfaceStory | None:
        """The story of a visible light that is met before the surface; None if there is none.

        limits: numbers of bounces that are still allowed
        """
        s = self.s
        if not s.visible_lights or (limits[1] is not None and self.first(limits[1] != s.bounce_limits[1])):
            return None
        lamp = nearest_light(s.visible_lights, ray, si.hit)
        if not self.first(lamp.met):
            return None
        own, factor = self.first(lamp.colour), self.first(weight)
        name = f"lights.{self.light_names[int(self.first(lamp.number))]}"
        return SurfaceStory(way, factor, name, _product(factor, own), own, distance=self.first(lamp.distance))

    def surface(self, si: Interaction, ray: Ray, way: str, weight: Any, media: Interface | None) -> SurfaceStory:
        """The story of a surface, or of the background."""
        s, factor = self.s, self.first(weight)
        if not self.first(si.hit.valid):
            sky = paths.miss_radiance(s, ray.d)
            if way == "camera":
                sky = s.a.V(0) if s.transparent else background(s, ray.d)
            own = self.first(sky)
            return SurfaceStory(way, factor, None, _product(factor, own), own)
        name = self.objects[int(self.first(object_of(s, si.hit)))]
        given, operand = self.seen(name, si)
        material = self.material(given, name, si)
        lit_mode, unlit = BY_NAME[s.settings.shading].lit, material["shading"] == "unlit"
        lit = lit_mode and not unlit
        lights = self.lights(si) if lit else ()
        reflected = self.first(ambient(s, si)) if lit else None
        emission = self.first(si.material.emission) if s.features["emission"] else BLACK
        own = self.first(shade(s, si))
        if lit:
            own = _sum(reflected, emission, *(_sum(l.diffuse, l.specular) for l in lights))
        kept = local_weight(s, si, media) if s.features["paths"] else None
        share = WHITE if kept is None else self.first(kept)
        return SurfaceStory(
            way, factor, address_of(name), _product(factor, share, own), own, share,
            distance=self.first(si.hit.t), point=self.first(si.surface.p), normal=self.first(si.n),
            uv=(self.first(si.u), self.first(si.v)), inside=self.first(si.from_inside), material=material,
            unlit=lit_mode and unlit, ambient=reflected, lights=lights, notes=_notes(material, s.settings.local),
            operand=None if operand == address_of(name) else operand,
        )  # fmt: skip

    def seen(self, name: str, si: Interaction) -> tuple[str, str | None]:
        """(name of the material that an object shows at a surface point, address of the operand there). The address is
        None for objects that are not made of operands."""
        scene, row, side = self.prepared.scene, self.first(si.hit.row), int(self.first(si.from_inside))
        batch, columns = next(x for x in zip(self.s.batches, self.prepared.packed.batches) if x[0].has(row))
        row -= batch.first_row
        looks, leaf = columns.looks, None
        if looks is None:
            number = columns.material[row if columns.object_of is None else columns.object_of[row]]
        else:
            leaf = batch.kind.leaf_number(self.first(si.hit.part))
            number = looks.material[looks.of[leaf]]
            leaf -= int(columns.numbers.objects.value.firsts()[row])
        return scene.sides_of(list(materials_of(scene))[number])[side], self.operand(name, columns, row, leaf)

    def operand(self, name: str, columns: Columns, row: int, leaf: int | None) -> str | None:
        """Address of an operand of an object; None for objects that are not made of operands.

        row: number in `columns` of the row that is hit.
        leaf: number of the leaf that is hit, for CSG.
        """
        geometries, unions = self.prepared.scene.geometries, self.prepared.scene.unions
        if columns.bodies:
            # The bodies of a row of data are side by side.
            body = columns.bodies[row % len(columns.bodies)]
            return (body if leaf is None else [x for x in body.walk(geometries) if x.is_leaf][leaf]).address or None
        if leaf is not None:
            return self.addresses.operand_of(columns.names[row], leaf)
        union = unions.get(name, {}).get(columns.names[row])
        return union and union.operand.address

    def material(self, given: str, name: str, si: Interaction) -> dict[str, Any]:
        """The material at a surface point: its address, its texture and its numbers.

        given: name of the material
        name: name of the object
        """
        scene = self.prepared.scene
        material = scene.material(given)
        values = {field: getattr(material.resolved, field) for field in quantities(type(material))}
        # A texture, and the colour of a row of data, change these numbers.
        changed = ("ka", "kd", *(material.colored if "." in name else ()))
        values |= {f: self.first(x) for f in changed if (x := getattr(si.material, f)) is not None}
        texture = None if material.texture is None else f"textures.{material.texture}"
        texts = {"texture": texture, "shading": material.shading, "fresnel": material.fresnel}
        return {"address": f"materials.{given}"} | texts | values

    def lights(self, si: Interaction) -> tuple[LightStory, ...]:
        """What becomes of each light at a surface point."""
        s, scene = self.s, self.prepared.scene
        if not (s.features["diffuse"] or s.features["specular"]):
            return ()
        stories = {}
        for number, prepared, salt in prepared_lights(s):
            name = self.light_names[number]
            light = scene.lights[name]
            stories[number] = self.light(name, light, probed(s, si, prepared, salt, self.j))
        return tuple(stories[number] for number in sorted(stories))

    def light(self, name: str, light: Light, probe: LightProbe) -> LightStory:
        """The story of one light."""
        n = getattr(light, "samples", 1)
        in_way = [address_of(self.objects[k]) for lane in probe.in_way[:n] for k in lane]
        mean = {field: np.asarray(getattr(probe, field)[:n], float).mean(0) for field in (
            "distance", "cosine", "attenuation", "falloff", "transmittance", "diffuse", "specular"
        )}  # fmt: skip
        factors = probe.attenuation[:n] * probe.falloff[:n]
        arrives = (factors[:, None] * probe.transmittance[:n]).mean(0) * light.intensity * np.array(light.Id)
        has_falloff = type(light).falloff is not Light.falloff
        return LightStory(
            f"lights.{name}", light.type, n, float(mean["distance"]) if light.has_position else None,
            float(mean["cosine"]), float(mean["attenuation"]), float(mean["falloff"]) if has_falloff else None,
            {address: in_way.count(address) / n for address in dict.fromkeys(in_way)},
            *(_colour(v) for v in (mean["transmittance"], arrives, mean["diffuse"], mean["specular"])),
        )  # fmt: skip

    def way_of(self, si: Interaction, b: paths.Bounce, media: Interface | None) -> str:
        """How a path goes on from a surface."""
        if self.first(b.scattered):
            return "scattering"
        if media is not None and media.hidden is not None and self.first(media.hidden):
            return "passing"
        if self.first(b.ray.inside ^ si.from_inside):
            return "refraction"
        kr = self.first(si.material.kr) if self.s.features["reflection"] else BLACK
        return "reflection" if any(kr) else "total reflection"

    def with_scattered(self, surface: SurfaceStory, si: Interaction, ray: Ray, media: Interface | None) -> SurfaceStory:
        """The story of a surface with the light that its scattered rays bring."""
        s, rays = self.s, self.prepared.scene.settings.scatter.rays
        light = self.first(paths.indirect(s, si, ray, media))
        b = paths.scattered(s, si, self.j)
        hit = closest(RayOrigin(s.geometry, b.ray.o, shared=False), b.ray, s.brute_force, b.alive)
        met = numbers(object_of(s, Hit(hit.t, dr.select(b.alive, hit.row, NO_ROW), hit.part)), self.n)[:rays]
        names = ["nothing" if k == NO_ROW else address_of(self.objects[int(k)]) for k in met]
        return replace(
            surface, scattered=rays, scattered_light=light,
            scattered_to={name: names.count(name) / rays for name in dict.fromkeys(names)},
        )  # fmt: skip


def _notes(material: dict[str, Any], local: str) -> tuple[str, ...]:
    """Sentences about a material that sends on more light than it gets."""
    kt, kr = (np.array(material[k]) for k in ("kt", "kr"))
    own = 1 if local == "full" else 1 - kt
    own = 0 if material["shading"] == "unlit" else own  # what it shows is no light that it gets
    if material["fresnel"] == "dielectric":
        # A share F of the light goes by kr, and 1 - F by the others.
        kr, kt = (0 * kr, kt) if local != "full" else (np.maximum(kr, kt), 0 * kt)
    total = kr + kt + own * (np.array(material["kd"]) + material["ks"])
    if total.max() <= 1:
        return ()
    return (f"{material['address']} may send on {total.max():.3g} times the light that it gets",)


def _colour(v: Any) -> Colour:
    return tuple(float(x) for x in v)


def _sum(*colours: Colour) -> Colour:
    return _colour(np.sum(colours, 0))


def _product(*colours: Colour) -> Colour:
    return _colour(np.prod(colours, 0))
