"""Colours of surfaces.

    I = Ig ka sky + sum over lights of [ Ia ka near + att S (Id kd max(n.l, 0) + Is ks max(n.h, 0)^shininess) ]

Vectors have length 1: n is the normal turned to the viewer, l points to the light, v to the viewer, and h is halfway
between l and v. There is no highlight if n.l <= 0.
Ig is the scene's ambient light; if settings.occlusion.light is "background", Ig sky is the mean light of the background
where it is not hidden. Ia, Id and Is are the light's ambient, diffuse and specular colours, and ka, kd and ks
those of the material. sky and near are the shares of ambient light that occlusion leaves (occlusion.py). S is the share
of light that passes all objects on its way. att is attenuation by distance times the light's falloff.

An unlit material shows kd instead, in all modes that show light. A material's emission is added to both. Other modes
replace the diffuse term and the highlight, or show a property of the surface (modes.py).
"""

from dataclasses import replace
from typing import Any

import drjit as dr

from visray import light_loop, modes, occlusion
from visray.direct import LightSample, direct
from visray.interaction import Interaction
from visray.kernel_scene import KernelScene
from visray.ray import NO_ROW


def power(x: Any, exponent: Any, bits: int, fraction: bool, real: Any) -> Any:
    """x^exponent, by repeated squaring for the integer part of the exponent; 0^0 is 1.

    The integer part is detached: the derivative by the exponent, x^e ln x, comes from the fractional part alone.

    bits: number of binary digits of the largest exponent
    fraction: whether exponents may have a fractional part; must be True for derivatives by the exponent
    real: array type
    Domain: 0 <= x <= 1.
    Error: relative; gamma(n) for an integer part n, because each squaring doubles the relative error, as it doubles the
        exponent, and adds one rounding. A fractional part adds the errors of exp2 and log2.
    """
    integer = dr.detach(dr.floor(exponent))
    n = dr.uint32_array_t(dr.detached_t(real))(integer)
    result, square = real(1), x
    for bit in range(bits):
        result = dr.select((n & (1 << bit)) != 0, result * square, result)
        square = square * square
    if fraction:
        positive = x > 0
        rest = dr.exp2((exponent - integer) * dr.log2(dr.select(positive, x, 1)))
        result *= dr.select(positive | (exponent == integer), rest, 0)
    return result


def shade(s: KernelScene, si: Interaction) -> Any:
    """Colour of a surface in the scene's shading mode, without light from other surfaces. Shapes: (3, N)."""
    mode = modes.BY_NAME[s.settings.shading]
    return lit(s, si) if mode.lit else mode.colour(s, si)


def lit(s: KernelScene, si: Interaction) -> Any:
    """Light that leaves the surface towards the ray's origin, a colour: reflected ambient light plus reflected light of
    all lights; of an unlit surface, kd; and the emission of both."""
    on = s.features
    receiver = receiving(si) if on["unlit"] else si
    colour = ambient(s, receiver)
    # Without both terms all lights are black, and Dr.Jit cannot trace a loop whose sum stays a literal zero.
    if on["diffuse"] or on["specular"]:
        lights = light_loop.direct if s.light_steps else direct
        colour = colour + lights(s, receiver, reflected)
    if on["unlit"]:
        colour = dr.select(si.material.shading > 0, si.material.kd, colour)
    return colour + si.material.emission if on["emission"] else colour


def receiving(si: Interaction) -> Interaction:
    """The interaction as lights see it: without a hit in the lanes whose surface is unlit. No shadow rays and no
    occlusion rays start there. Domain: scenes with unlit materials."""
    return replace(si, hit=replace(si.hit, row=dr.select(si.material.shading > 0, NO_ROW, si.hit.row)))


def ambient(s: KernelScene, si: Interaction) -> Any:
    """Reflected ambient light, a colour."""
    colour, on = dr.zeros(s.a.V, 1), s.features
    if on["ambient"]:
        sky, near = s.ambient, s.lights_ambient
        if s.settings.occlusion.light == "background":
            sky = occlusion.sky_light(s, si) if on["sky occlusion"] and on["background"] else dr.zeros(s.a.V, 1)
        elif on["sky occlusion"]:
            sky = sky * occlusion.sky(s, si)
        if on["near occlusion"]:
            near = near * occlusion.near(s, si)
        colour = colour + (sky + near) * si.material.ka
    return colour


def reflected(s: KernelScene, si: Interaction, light: Any, sample: LightSample) -> Any:
    """Reflected light of one light sample, a colour: diffuse term plus highlight, multiplied by attenuation, falloff
    and transmittance; black if no light arrives.

    light: numbers of the light
    """
    a, on, m = s.a, s.features, si.material
    model = modes.BY_NAME[s.settings.shading].model
    colour = dr.zeros(a.V, 1)
    if on["diffuse"]:
        colour = colour + light.intensity * light.Id * m.kd * model.diffuse(sample.cosine)
    if on["specular"]:
        cosine = model.cosine(si, sample)
        highlight = power(cosine, m.shininess, on.shininess_bits, on["fractional shininess"], a.F)
        colour = colour + light.intensity * light.Is * m.ks * model.highlight(highlight)
    if sample.weight is not None:
        colour = colour * sample.weight
    if sample.transmittance is not None:
        colour = colour * sample.transmittance
    return dr.select(sample.arrives, colour, 0)
