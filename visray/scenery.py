"""A scene as the effects need it, and what a hit feels like: the surface point, its material and its (u, v)."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray import tables, texturing
from visray.features import Features
from visray.geometry import extent, facing, gamma
from visray.images import Atlas
from visray.materials import Material
from visray.quantities import Arrays
from visray.ray import Hit, Ray, Surface
from visray.sampling import Draw, Lot
from visray.scene.scene import Scene, Settings
from visray.search import Watch
from visray.tables import Group, Kinship, Ready
from visray.trees import leaves, mapped, rebuilt, rows

# So many objects times lights are written out; more lights are looped over. Written out, a light's shadow rays are
# found faster, but each of its objects takes 10 ms to compile.
CROWD = 96


@dataclass(frozen=True)
class Lamp:
    """A light: its kind, its row, its points that are taken together, its number among all, and the watch from it.

    watch: None for lights whose shadow rays start at the points they light. samples: how many, for Python.
    """

    kind: type
    light: Any
    lot: Lot | None
    samples: int
    number: int
    watch: Watch | None


@dataclass(frozen=True)
class Crowd:
    """Many lights of one kind, looped over: their table, the lots of area lights, how many they are, and the number of
    the first of them."""

    kind: type
    table: Any
    lots: Lot | None
    count: Any
    number: int


@dataclass(frozen=True)
class Scenery:
    """What the effects need of a scene: families and groups of its objects, its lights, its settings.

    spans: for each group, the greatest coordinates of its objects, which their rounding is relative to. reach: as far
    as near occlusion looks. middle: the distance of the camera's target. blank: a material of zeros. levels: how many
    reflections, and scatterings, are followed. lots: the rays that are taken together, by effect. `plain` searches
    without the tests that reject most objects: the slow twin. attached: derivatives are asked for.
    """

    a: Arrays
    features: Features
    settings: Settings
    kin: tuple[Kinship, ...]
    groups: tuple[Group, ...]
    spans: tuple[Any, ...]
    sky: Any
    ambient: Any
    glow: Any
    reach: Any
    middle: Any
    blank: Material
    levels: tuple[Any, Any]
    atlas: Atlas | None
    lamps: tuple[Lamp, ...]
    crowds: tuple[Crowd, ...]
    lots: dict[str, Lot]
    transparent: bool
    attached: bool
    plain: bool

    @property
    def wide(self) -> bool:
        """Whether rays start at the points that are shaded."""
        on = self.features
        far = any(l.watch is None for l in self.lamps) or self.crowds
        return bool(far and on["shadows"]) or on["sky occlusion"] or on["near occlusion"]

    def repeated(self, n: int, count: Any, active: Any, state: tuple, body: Callable) -> tuple:
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


@dataclass(frozen=True)
class Site:
    """A hit that is shaded. o, d: the ray's origin and direction; n: the normal turned to the viewer, who sees it from
    `within` or not; watch: from the point, where rays start there; draw: the random numbers that belong to it."""

    o: Any
    d: Any
    hit: Hit
    surface: Surface
    n: Any
    within: Any
    material: Material
    u: Any
    v: Any
    watch: Watch | None
    draw: Draw | None

    def leaving(self, d: Any, cosine: Any, error: Any = None) -> Ray:
        """A ray from the point on the viewer's side, with that cosine with the normal; `error` as in Ray.

        What lies flush with the surface is not met: nothing that is no farther above it than the point is off.
        """
        return Ray(self.surface.p, d, self.hit.index, self.within, self.surface.error, error, cosine)


def scenery(
    ready: Ready, kin: tuple[Kinship, ...], scene: Scene, features: Features, a: Arrays, plain: bool
) -> Scenery:
    """The scene as the effects need it. Where there are shadows, a watch is kept from the lights that are points."""
    settings, attached = scene.settings, dr.grad_enabled(leaves(ready))
    groups = tuple(replace(g, material=_needed(g.material, features)) for g in ready.groups)
    spans = tuple(map(_span, ready.groups))
    dr.eval(spans)
    lamps, crowds = _lights(ready, kin, scene, features, a, attached)
    occlusion, scatter = settings.occlusion, settings.scatter
    counts = {"sky": occlusion.sky, "near": occlusion.near, "scatter": max(scatter.rays, 1)}
    return Scenery(
        a=a,
        features=features,
        settings=settings,
        kin=kin,
        groups=groups,
        spans=spans,
        sky=ready.background,
        ambient=ready.ambient,
        glow=ready.glow,
        reach=ready.reach,
        middle=ready.view.middle,
        blank=mapped(lambda x: type(x)(0), _needed(ready.blank, features)),
        levels=(dr.opaque(a.U, settings.depth), dr.opaque(a.U, scatter.depth if scatter.rays else 0)),
        atlas=ready.atlas,
        lamps=lamps,
        crowds=crowds,
        lots={name: Lot.of(a, n) for name, n in counts.items()},
        transparent=scene.film.transparent,
        attached=attached,
        plain=plain,
    )


# The fields of a material that only some effects read.
READERS = {"kr": ("reflection", "scatter"), "kt": ("refraction", "coloured shadows", "scatter"), "ior": ("refraction",),
           "dmax": ("coloured shadows",)}  # fmt: skip


def _needed(material: Material, features: Features) -> Material:
    """The materials without what no effect reads."""
    unread = [name for name, effects in READERS.items() if not any(features[e] for e in effects)]
    return replace(material, **dict.fromkeys(unread))


def _lights(ready: Ready, kin: tuple, scene: Scene, features: Features, a: Arrays, attached: bool) -> tuple:
    """The lights that are written out, and the kinds of those that are looped over."""
    objects = sum(len(k.names) for k in kin if len(k.names) <= tables.WRITTEN_OUT)
    many = not attached and len(scene.lights) > 2 and len(scene.lights) * (1 + objects) > CROWD
    place = {name: i for i, name in enumerate(scene.lights)}
    lamps, crowds = {}, []
    for troop, table in zip(tables.troops(scene), ready.lights):
        samples = [getattr(scene.lights[name], "samples", 1) for name in troop.names]
        if many and len(troop.names) > 1:
            lots = Lot.table(a, samples) if troop.kind.wide else None
            crowds.append(Crowd(troop.kind, table, lots, dr.opaque(a.U, len(samples)), place[troop.names[0]]))
            continue
        for i, name in enumerate(troop.names):
            light = rows(table, a.U(i))
            near = troop.kind.placed and not troop.kind.wide
            watch = Watch(a, kin, ready.groups, light.position) if near and features["shadows"] else None
            lot = Lot.of(a, samples[i]) if troop.kind.wide else None
            lamps[name] = Lamp(troop.kind, light, lot, samples[i], place[name], watch)
    return tuple(lamps[name] for name in scene.lights if name in lamps), tuple(crowds)


def site(s: Scenery, ray: Ray, hit: Hit, draw: Draw | None = None) -> Site:
    """A hit, ready to be shaded."""
    surface, material, u, v = feel(s, ray, hit)
    d = s.a.V(ray.d)
    n, within = facing(surface.n, d)
    watch = Watch(s.a, s.kin, s.groups, surface.p, shared=False) if s.wide and draw is not None else None
    return Site(ray.o, d, hit, surface, n, within, material, u, v, watch, draw)


def _span(group: Group) -> Any:
    """No coordinate that an object is made of is greater, up to a factor that the rounding bound allows for."""
    if group.radius is None:
        return dr.detach(extent(group.placed.o))
    return extent(group.centre) + group.radius


def feel(s: Scenery, ray: Ray, hit: Hit) -> tuple[Surface, Material, Any, Any]:
    """The surface point, its material and its (u, v), with derivatives: the winner of a detached search, evaluated
    anew.

    t follows from the implicit function theorem: f(o + t d) = 0 gives dt = -df / (g.d).
    """
    a, n = s.a, dr.width(ray.d)
    # Lanes that hit nothing take part at the ray's origin: no inf or NaN enters a derivative there.
    t = dr.select(hit.valid, hit.t, 0)
    normal = dr.zeros(a.W, n) if s.features["paths"] else None
    surface = Surface(dr.zeros(a.W, n), dr.zeros(a.V, n), dr.zeros(a.D, n), normal)
    texture = dr.zeros(a.U, n) if s.features["textures"] else None
    # A texture far out on a plane is looked up in double.
    none = dr.zeros(a.D if s.features["textures"] else a.F, n)
    state = (surface, mapped(lambda x: dr.zeros(type(x), n), s.blank), texture, none, none)
    base = 0
    for k, group, span in zip(s.kin, s.groups, s.spans):
        size, local = len(k.names), hit.index - base
        here = (hit.index >= base) & (hit.index < base + size)
        table = (group.placed, group.material, group.texture if s.features["textures"] else None, span)

        def touch(*_: Any, k: Kinship = k, table: tuple = table, here: Any = here, local: Any = local) -> tuple:
            placed, material, texture, span = _row_of(s, table, len(k.names), here, local)
            surface, u, v = _surface(s, k.kind, placed, span, ray, t)
            return leaves((surface, material, texture, type(none)(u), type(none)(v)))

        if len(s.kin) == 1:
            state = rebuilt(state, touch())
        elif s.attached:
            state = rebuilt(state, tuple(dr.select(here, new, old) for new, old in zip(touch(), leaves(state))))
        else:
            state = rebuilt(state, dr.if_stmt(leaves(state), here, touch, lambda *old: old, label="feel"))
        base += size
    surface, material, texture, u, v = state
    if s.features["textures"]:
        bare = texture == tables.NO_TEXTURE
        painted = texturing.colour(a, s.atlas, dr.select(bare, 0, texture), u, v, s.features["bilinear"])
        material = replace(material, kd=dr.select(bare, material.kd, painted))
    return surface, material, a.F(u), a.F(v)


def felt_distance(s: Scenery, ray: Ray, hit: Hit) -> Any:
    """How far away a hit is, with derivatives."""
    ray = ray.exact()
    return dr.dot(feel(s, ray, hit)[0].p - ray.o, ray.d)


def _row_of(s: Scenery, table: tuple, size: int, here: Any, index: Any) -> tuple:
    """An object's row of a table for each lane: by branches, as a packet of lanes needs few of few objects.

    Not where derivatives are asked for: of what a branch in a loop hands through from outside, Dr.Jit 1.5 makes zero.
    """
    if s.attached or size > tables.FEW:
        return rows(table, dr.select(here, index, 0))
    u = s.a.U
    kept = leaves(rows(table, u(0)))
    for i in range(1, size):
        kept = dr.if_stmt(kept, index == i, lambda *_, i=i: leaves(rows(table, u(i))), lambda *old: old, label="row")
    return rebuilt(table, kept)


def _surface(s: Scenery, kind: type, placed: Any, span: Any, ray: Ray, t: Any) -> tuple:
    p = ray.o + t * ray.d
    f, g = kind.level(placed, p)
    if dr.grad_enabled((f, p)):
        t = t - (f - dr.detach(f)) / dr.detach(dr.dot(g, ray.d))
        p = ray.o + t * ray.d
        g = kind.level(placed, p)[1]
    # p is off by the rounding of o + t d (two for each coordinate) and that of t, which moves it along the ray by as
    # much as the local origin is known to: five more, of numbers no greater than |o| + t and the object's coordinates.
    # Tested against exact arithmetic; a transform that shears multiplies it by the distortion of its frame.
    error = gamma(8) * (extent(ray.o) + t + span)
    u, v = kind.uv(placed, p)
    normal = dr.normalize(g) if s.features["paths"] else None
    return Surface(p, dr.normalize(s.a.V(g)), error, normal), u, v
