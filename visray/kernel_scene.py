"""A scene as kernels read it: one record, made of the packed numbers.

Structure is Python, values are opaque: which kinds, lights and effects there are decides the code of a kernel, and
every number enters it as data.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray.accel import policy
from visray.accel.origin import Geometry, RayOrigin
from visray.batches import Batch, place
from visray.camera import View
from visray.features import Features, RayFamily
from visray.images import Atlas
from visray.lights.light import Light
from visray.materials import Material
from visray.pack import LightColumns, Packed, batch_key
from visray.pytree import evaluated, leaves, mapped, rows
from visray.quantities import Arrays
from visray.sampling import SampleSet
from visray.scene.scene import Scene, Settings, SkyGradient

# So many objects times lights are written out; more lights are looped over. Written out, a light's shadow rays are
# found faster, but each of its objects takes 10 ms to compile.
WRITTEN_OUT_LIGHTS = 96


@dataclass(frozen=True)
class PreparedLight:
    """A light: its kind, its row, the set of its points that are taken together, its number among all, and the origin
    of its rays.

    origin: None for lights whose shadow rays start at the points they light. samples: how many, for Python.
    """

    kind: type[Light]
    light: Any
    points: SampleSet | None
    samples: int
    number: int
    origin: RayOrigin | None


@dataclass(frozen=True)
class LightBatch:
    """Many lights of one kind, looped over: their table, the sample sets of area lights, how many they are, and the
    number of the first of them."""

    kind: type[Light]
    table: Any
    points: SampleSet | None
    count: Any
    number: int


@dataclass(frozen=True)
class KernelScene:
    """What kernels read of a scene.

    geometry: what rays can meet. view, origin: the camera, and what is seen from its middle.
    lights, looped_lights: those that are written out, and those that are looped over.
    sky, ambient, lights_ambient: background, ambient light of the scene, that of all lights together.
    reach: as far as near occlusion looks. blank: a material of zeros.
    levels: how many reflections, and scatterings, are followed. sets: the rays that are taken together, by effect.
    coverage: whether the film counts as covered where nothing is hit. attached: derivatives are asked for.
    brute_force: searches without the tests that reject most rows, and without a tree: the slow twin.
    """

    a: Arrays
    features: Features
    settings: Settings
    geometry: Geometry
    view: View
    origin: RayOrigin
    lights: tuple[PreparedLight, ...]
    looped_lights: tuple[LightBatch, ...]
    sky: SkyGradient
    ambient: Any
    lights_ambient: Any
    occlusion_distance: Any
    zero_material: Material
    bounce_limits: tuple[Any, Any]
    atlas: Atlas | None
    sample_sets: dict[str, SampleSet]
    coverage: Any
    transparent: bool
    attached: bool
    brute_force: bool

    @property
    def batches(self) -> tuple[Batch, ...]:
        return self.geometry.batches

    @property
    def rays_leave_surfaces(self) -> bool:
        """Whether rays start at the points that are shaded."""
        on = self.features
        far = any(l.origin is None for l in self.lights) or self.looped_lights
        return bool(far and on["shadows"]) or on["sky occlusion"] or on["near occlusion"]

    def loop(self, n: int, count: Any, active: Any, state: tuple, body: Callable) -> tuple:
        """`state` after body(j, *state) for j from 0 to n - 1; n is `count` as opaque data.

        A loop, but written out where derivatives are asked for: Dr.Jit 1.5 has none through loops within loops.
        """
        if self.attached:
            for j in range(n):
                state = body(self.a.U(j), *state)
            return state
        start = (dr.zeros(self.a.U, max(map(dr.width, state))), *state)
        onwards = lambda j, *state: (j + 1, *body(j, *state))  # noqa: E731 - a step and its count
        return dr.while_loop(start, lambda j, *_: (j < count) & active, onwards, label="repeated")[1:]


def kernel_scene(
    packed: Packed,
    scene: Scene,
    features: Features,
    a: Arrays,
    atlas: Atlas | None,
    brute_force: bool = False,
    before: tuple[Packed, KernelScene] | None = None,
) -> KernelScene:
    """The scene as kernels read it, evaluated. Derivatives flow through it.

    before: the packed numbers of a scene of the same structure and what was made of them; batches whose columns are the
    same are taken from there.
    """
    settings, occlusion, scatter = scene.settings, scene.settings.occlusion, scene.settings.scatter
    geometry = _geometry(packed, a, settings, before)
    geometry = replace(
        geometry, batches=tuple(replace(b, material=_needed(b.material, features)) for b in geometry.batches)
    )
    view = packed.camera.view(scene.film.width, scene.film.height, a)
    lights_ambient = _lights_ambient(packed.lights, a)
    evaluated((view, lights_ambient))
    light_tables = tuple(columns.numbers for columns in packed.lights)
    inputs = geometry.batches, light_tables, view, packed.background, packed.ambient, lights_ambient, packed.occlusion
    attached = dr.grad_enabled(leaves(inputs))
    lights, looped = _lights(packed, geometry, features, a, attached)
    counts = {"sky": occlusion.sky, "near": occlusion.near, "scatter": max(scatter.rays, 1)}
    return KernelScene(
        a=a,
        features=features,
        settings=settings,
        geometry=geometry,
        view=view,
        origin=RayOrigin(geometry, view.o),
        lights=lights,
        looped_lights=looped,
        sky=packed.background,
        ambient=packed.ambient,
        lights_ambient=lights_ambient,
        occlusion_distance=packed.occlusion.distance,
        zero_material=mapped(lambda x: type(x)(0), _needed(rows(packed.materials, a.U(0)), features)),
        bounce_limits=(dr.opaque(a.U, settings.depth), dr.opaque(a.U, scatter.depth if scatter.rays else 0)),
        atlas=atlas,
        sample_sets={name: SampleSet.of(a, n) for name, n in counts.items()},
        coverage=dr.opaque(a.F, float(not scene.film.transparent)),
        transparent=scene.film.transparent,
        attached=attached,
        brute_force=brute_force,
    )


def _geometry(packed: Packed, a: Arrays, settings: Settings, before: tuple[Packed, KernelScene] | None) -> Geometry:
    """All batches placed in the world, and the tree over them."""
    batches: list[Batch] = []
    old = {}
    if before is not None and before[0].materials is packed.materials:
        old = {id(columns): batch for columns, batch in zip(before[0].batches, before[1].batches)}
    base = 0
    for columns in packed.batches:
        batches.append(old.get(id(columns)) or place(columns, base, packed.materials))
        base += len(columns)
    still = old and all(new is last for new, last in zip(batches, before[1].batches))
    if still and before[1].geometry.accelerator == settings.accelerator:
        return before[1].geometry
    return Geometry.of(a, tuple(batches), settings.accelerator)


# The fields of a material that only some effects read.
READERS = {"kr": ("reflection", "scatter"), "kt": ("refraction", "coloured shadows", "scatter"), "ior": ("refraction",),
           "dmax": ("coloured shadows",)}  # fmt: skip


def _needed(material: Material, features: Features) -> Material:
    """The materials without what no effect reads."""
    unread = [name for name, effects in READERS.items() if not any(features[e] for e in effects)]
    return replace(material, **dict.fromkeys(unread))


def _lights_ambient(lights: tuple[LightColumns, ...], a: Arrays) -> Any:
    """The ambient light of all lights together."""
    total = a.V(0)
    for table in (l.numbers for l in lights):
        each = table.intensity * table.Ia
        total = total + a.V(*(dr.sum(c) for c in each))
    return total


def _many(lights: int, sizes: Iterable[int]) -> bool:
    """Whether there are too many lights to write them out, by the numbers of rows in the batches. Of many rows only the
    guards are written out, which takes a quarter of the time."""
    sizes = [n for n in sizes if n <= policy.MAX_UNROLLED_SHARED]
    objects = sum(n if n <= policy.MAX_UNROLLED else n // 4 for n in sizes)
    return lights > 2 and lights * (1 + objects) > WRITTEN_OUT_LIGHTS


def ray_families(scene: Scene, features: Features) -> tuple[RayFamily, ...]:
    """How the rays of a scene find what they hit, and why."""
    on, kinds = features, [type(light) for light in scene.lights.values()]
    counted = Counter(map(batch_key, scene.objects.values()))
    sizes = [policy.BatchSize(n, kind.bounded) for (kind, _), n in counted.items()]
    looped = _many(len(kinds), (size.rows for size in sizes))
    # A lone light of its kind is never looped over.
    own = [k for k in kinds if k.has_position and not k.has_area and not (looped and kinds.count(k) > 1)]
    rays = {"camera": not on["defocus"]}
    if on["shadows"] and own:
        rays["shadow rays of point and spot lights"] = True
    others = {
        "shadow rays of other lights": on["shadows"] and len(own) < len(kinds),
        "occlusion rays": on["sky occlusion"] or on["near occlusion"],
        "reflected, refracted and scattered rays": on["paths"],
    }
    rays |= {name: False for name, there in others.items() if there}
    plans = {name: policy.plan(sizes, scene.settings.accelerator, shared) for name, shared in rays.items()}
    return tuple(RayFamily(name, plan.name, plan.reason) for name, plan in plans.items())


def _lights(packed: Packed, geometry: Geometry, features: Features, a: Arrays, attached: bool) -> tuple:
    """The lights that are written out, and the kinds of those that are looped over."""
    many = not attached and _many(sum(len(l.names) for l in packed.lights), map(len, geometry.batches))
    written, looped = {}, []
    for columns in packed.lights:
        kind, table, samples = columns.kind, columns.numbers, columns.samples
        if many and len(samples) > 1:
            points = SampleSet.table(a, list(samples)) if kind.has_area else None
            looped.append(LightBatch(kind, table, points, dr.opaque(a.U, len(samples)), columns.scene_index[0]))
            continue
        for i, number in enumerate(columns.scene_index):
            light = rows(table, a.U(i))
            near = kind.has_position and not kind.has_area
            origin = RayOrigin(geometry, light.position) if near and features["shadows"] else None
            points = SampleSet.of(a, samples[i]) if kind.has_area else None
            written[number] = PreparedLight(kind, light, points, samples[i], number, origin)
    return tuple(written[number] for number in sorted(written)), tuple(looped)
