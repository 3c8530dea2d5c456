"""How a surface looks.

    I = Ig ka sky + sum over lights of [ Ia ka near + att S (Id kd max(n.l, 0) + Is ks max(n.h, 0)^shininess) ]

with h the unit vector halfway between l (to the light) and v (to the eye), both unit; no highlight where n.l <= 0; and
n turned to the viewer. sky and near are what occlusion leaves, S what shadows leave, att what distance and aim leave.
"""

from typing import Any

import drjit as dr

from visray import occlusion
from visray.direct import LightSample, direct
from visray.interaction import Interaction
from visray.kernel_scene import KernelScene

# A cartoon has so many steps of diffuse light, and a highlight where it is at least half as bright as at its middle.
STEPS = 4


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


def shade(s: KernelScene, si: Interaction) -> Any:
    """The colour of a surface as its ray sees it, without the light that other surfaces send."""
    return MODES[s.settings.shading](s, si)


def lit(s: KernelScene, si: Interaction) -> Any:
    """The light that leaves the surface towards the ray's origin: ambient light, and that of all lights."""
    a, on, m = s.a, s.features, si.material
    colour = dr.zeros(a.V, 1)
    if on["ambient"]:
        sky, near = s.ambient, s.lights_ambient
        if on["sky occlusion"]:
            sky = sky * occlusion.sky(s, si)
        if on["near occlusion"]:
            near = near * occlusion.near(s, si)
        colour = colour + (sky + near) * m.ka
    return colour + direct(s, si, reflected)


def reflected(s: KernelScene, si: Interaction, light: Any, sample: LightSample) -> Any:
    """What a light sample adds: its diffuse and specular parts, where it arrives and as far as it gets there."""
    a, on, m = s.a, s.features, si.material
    mode = s.settings.shading
    colour = dr.zeros(a.V, 1)
    if on["diffuse"]:
        # A cosine may be rounded to beyond 1.
        cosine = dr.minimum(dr.ceil(sample.cosine * STEPS) * (1 / STEPS), 1) if mode == "toon" else sample.cosine
        colour = colour + light.intensity * light.Id * m.kd * cosine
    if on["specular"]:
        gloss = power(_shine(s, si, sample), m.shininess, on.shininess_bits, on["fractional shininess"], a.F)
        if mode == "toon":
            gloss = dr.select(gloss >= 0.5, a.F(1), 0)
        colour = colour + light.intensity * light.Is * m.ks * gloss
    if sample.weight is not None:
        colour = colour * sample.weight
    if sample.transmittance is not None:
        colour = colour * sample.transmittance
    return dr.select(sample.arrives, colour, 0)


def _shine(s: KernelScene, si: Interaction, sample: LightSample) -> Any:
    """The cosine that the highlight is a power of: n.h, or in Phong's own model r.v with r the mirrored l."""
    if s.settings.shading == "phong":
        mirrored = (2 * sample.cosine) * si.n - sample.l
        return dr.maximum(-dr.dot(mirrored, si.d), 0)
    halfway = sample.l - si.d
    squared = dr.squared_norm(halfway)
    return dr.maximum(dr.select(squared > 0, dr.dot(si.n, halfway) * dr.rsqrt(squared), 0), 0)


def _normal(s: KernelScene, si: Interaction) -> Any:
    """The normal's x, y, z from -1..1 as red, green, blue from 0..1."""
    return 0.5 * si.n + 0.5


def _depth(s: KernelScene, si: Interaction) -> Any:
    """White at the eye, mid-grey at the distance of the camera's target, black infinitely far."""
    t = si.hit.t
    if s.attached:
        t = dr.select(si.hit.valid, dr.dot(si.surface.p - si.o, s.a.W(si.d)), t)
    return s.a.V(dr.rcp(1 + s.a.F(t) * dr.rcp(s.view.target_distance)))


def _uv(s: KernelScene, si: Interaction) -> Any:
    """u as red and v as green, each the part after the point."""
    return s.a.V(si.u - dr.floor(si.u), si.v - dr.floor(si.v), 0)


def _albedo(s: KernelScene, si: Interaction) -> Any:
    """kd, as no light changes it."""
    return si.material.kd


MODES = {
    "blinn-phong": lit,
    "phong": lit,
    "toon": lit,
    "normal": _normal,
    "depth": _depth,
    "uv": _uv,
    "albedo": _albedo,
}
