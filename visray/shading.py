"""What is seen where a ray hits: the surface point, and Blinn-Phong.

    I = Ig ka + sum over lights of [ Ia ka + att S (Id kd max(n.l, 0) + Is ks max(n.h, 0)^shininess) ]

with h the unit vector halfway between l (to the light) and v (to the eye), both unit; no highlight where n.l <= 0; and
n turned to the viewer.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray import tables
from visray.features import Features
from visray.geometry import extent, facing, gamma
from visray.lights import PointLight
from visray.materials import Material
from visray.quantities import Arrays
from visray.ray import Hit, Ray, Surface, inverse_length
from visray.search import Watch, blocked
from visray.tables import Group, Kinship, Ready
from visray.trees import leaves, rebuilt, rows


@dataclass(frozen=True)
class Scenery:
    """What the effects need of a scene: families and groups of its objects, its lights, the watch kept from each.

    spans: for each group, the greatest coordinates of its objects, which their rounding is relative to. `plain`
    searches without the tests that reject most objects: the slow twin.
    """

    a: Arrays
    features: Features
    kin: tuple[Kinship, ...]
    groups: tuple[Group, ...]
    spans: tuple[Any, ...]
    ambient: Any
    lights: tuple[PointLight, ...]
    watches: tuple[Watch, ...]
    attached: bool
    plain: bool


def scenery(ready: Ready, kin: tuple[Kinship, ...], features: Features, a: Arrays, plain: bool) -> Scenery:
    """The scene as the effects need it. Where there are shadows, a watch is kept from every light."""
    count = 0 if ready.lights is None else dr.width(ready.lights.intensity)
    lights = tuple(rows(ready.lights, a.U(i)) for i in range(count))
    watches = tuple(Watch(a, kin, ready.groups, l.position) for l in lights) if features["shadows"] else ()
    spans = tuple(map(_span, ready.groups))
    dr.eval(spans)
    attached = dr.grad_enabled(leaves(ready))
    return Scenery(a, features, kin, ready.groups, spans, ready.ambient, lights, watches, attached, plain)


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
    surface = Surface(dr.zeros(a.W, n), dr.zeros(a.V, n), dr.zeros(a.D, n))
    black, none = dr.zeros(a.V, n), dr.zeros(a.F, n)
    material = Material(ka=black, kd=black, ks=black, shininess=none)
    state = (surface, material, none, none)
    base = 0
    for k, group, span in zip(s.kin, s.groups, s.spans):
        size, local = len(k.names), hit.index - base
        here = (hit.index >= base) & (hit.index < base + size)
        table = (group.placed, group.material, span)

        def touch(*_: Any, k: Kinship = k, table: tuple = table, here: Any = here, local: Any = local) -> tuple:
            placed, material, span = _row_of(s, table, len(k.names), here, local)
            return leaves(_surface(s, k.kind, placed, material, span, ray, t))

        if len(s.kin) == 1:
            state = rebuilt(state, touch())
        elif s.attached:
            state = rebuilt(state, tuple(dr.select(here, new, old) for new, old in zip(touch(), leaves(state))))
        else:
            state = rebuilt(state, dr.if_stmt(leaves(state), here, touch, lambda *old: old, label="feel"))
        base += size
    return state


def _row_of(s: Scenery, table: tuple, size: int, here: Any, index: Any) -> tuple:
    """An object's row of a table for each lane: by branches, as a packet of lanes needs few of few objects.

    Not where derivatives are asked for: of what a branch in a loop hands through from outside, Dr.Jit 1.5 makes zero.
    """
    if s.attached or size > tables.WRITTEN_OUT:
        return rows(table, dr.select(here, index, 0))
    u = s.a.U
    kept = leaves(rows(table, u(0)))
    for i in range(1, size):
        kept = dr.if_stmt(kept, index == i, lambda *_, i=i: leaves(rows(table, u(i))), lambda *old: old, label="row")
    return rebuilt(table, kept)


def _surface(s: Scenery, kind: type, placed: Any, material: Material, span: Any, ray: Ray, t: Any) -> tuple:
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
    return Surface(p, dr.normalize(s.a.V(g)), error), material, s.a.F(u), s.a.F(v)


def power(x: Any, exponent: Any, bits: int, fraction: bool, real: Any) -> Any:
    """x^exponent for 0 <= x <= 1, by repeated squaring for the whole part; 0^0 is 1.

    Error: relative, gamma(exponent) for the whole part: each squaring doubles the error before it, as much as one
    rounding of x makes in its power; and for the fractional part those of exp2 and log2. The whole part is detached:
    the slope by the exponent, x^e ln x, comes from the fractional part alone, which must then be there.
    """
    whole = dr.detach(dr.floor(exponent))
    n = dr.uint32_array_t(dr.detached_t(real))(whole)
    result, square = real(1), x
    for bit in range(bits):
        result = dr.select((n & (1 << bit)) != 0, result * square, result)
        square = square * square
    if fraction:
        positive = x > 0
        rest = dr.exp2((exponent - whole) * dr.log2(dr.select(positive, x, 1)))
        result *= dr.select(positive | (exponent == whole), rest, 0)
    return result


def blinn_phong(s: Scenery, ray: Ray, hit: Hit, surface: Surface, m: Material) -> Any:
    """The light that leaves the surface towards the ray's origin."""
    a, on = s.a, s.features
    d = a.V(ray.d)
    n, within = facing(surface.n, d)
    colour = dr.zeros(a.V, 1)
    if on["ambient"]:
        glow = s.ambient
        for light in s.lights:
            glow = glow + light.intensity * light.Ia
        colour = colour + glow * m.ka
    for number, light in enumerate(s.lights):
        colour = colour + _lit(s, light, beam(s, number, hit, surface, n, within), n, d, m)
    return colour


@dataclass(frozen=True)
class Beam:
    """Light on its way to a point: unit direction to the light, distance, cosine with the normal, whether it
    arrives."""

    l: Any
    distance: Any
    cosine: Any
    reached: Any


def beam(s: Scenery, number: int, hit: Hit, surface: Surface, n: Any, within: Any) -> Beam:
    """What of light `number` arrives at a surface whose normal `n` is turned to the viewer; `within`: seen from
    inside."""
    a, light = s.a, s.lights[number]
    from_light = surface.p - light.position
    inverse = inverse_length(from_light, a.F32 if a.precision == "single" else None)
    d = from_light * inverse
    distance = dr.squared_norm(from_light) * inverse
    l = a.V(-d)
    cosine = dr.dot(n, l)
    reached = hit.valid & (cosine > 0)
    if s.features["shadows"]:
        # The ray runs from the light to the point: all rays of a light share their origin. It counts as arrived where
        # it meets a surface flush with the one seen: no farther above it than both are off, as seen from eye and light.
        error = surface.error + gamma(8) * (extent(light.position) + distance)
        length = distance - a.D(a.F(error) / cosine)
        shaft = Ray(light.position, d, error=error)
        reached &= ~blocked(s.watches[number], shaft, length, hit.index, within, reached, s.plain)
    return Beam(l, distance, cosine, reached)


def _lit(s: Scenery, light: PointLight, b: Beam, n: Any, d: Any, m: Material) -> Any:
    """What a beam adds: its diffuse and specular parts, attenuated, where it arrives."""
    a, on = s.a, s.features
    colour = dr.zeros(a.V, 1)
    if on["diffuse"]:
        colour = colour + light.intensity * light.Id * m.kd * b.cosine
    if on["specular"]:
        halfway = b.l - d
        squared = dr.squared_norm(halfway)
        cosine = dr.select(squared > 0, dr.dot(n, halfway) * dr.rsqrt(squared), 0)
        gloss = power(dr.maximum(cosine, 0), m.shininess, on.shininess_bits, on["fractional shininess"], a.F)
        colour = colour + light.intensity * light.Is * m.ks * gloss
    if on["attenuation"]:
        far = a.F(b.distance)
        weight = light.a + far * (light.b + far * light.c)
        colour = colour * dr.select(weight > 0, dr.rcp(weight), 1)
    return dr.select(b.reached, colour, 0)
