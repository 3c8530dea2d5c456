"""The records of a pixel's story, and its text. Colours are linear, as in the picture."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

Colour = tuple[float, float, float]
# The text shows at most this many surfaces and lights; --json has all.
MOST_SURFACES, MOST_LIGHTS = 20, 12


def shown(value: Any) -> str:
    """A number, or the numbers of a colour or point, as text."""
    return " ".join(f"{v:.3g}" for v in (value if isinstance(value, tuple) else (value,)))


@dataclass(frozen=True)
class LightStory:
    """What becomes of the light of one light at a surface point. Numbers are means over the light's samples.

    light: address of the light.
    type: its type.
    samples: number of its samples; 1 for lights without an area.
    distance: its distance; None for a directional light.
    cosine: cosine of the angle between the normal and the direction to the light; no light arrives if it is below 0.
    attenuation: factor of the distance.
    falloff: factor of the direction; None for lights that shine the same in all directions.
    in_way: share of the samples that each object is in the way of, by its address.
    transmittance: share of the light that passes what is in the way.
    arrives: the diffuse light that arrives, before the cosine and the material.
    diffuse, specular: the light that the surface reflects.
    """

    light: str
    type: str
    samples: int
    distance: float | None
    cosine: float
    attenuation: float
    falloff: float | None
    in_way: dict[str, float]
    transmittance: Colour
    arrives: Colour
    diffuse: Colour
    specular: Colour

    def text(self, reflects: bool = True) -> str:
        """The story in one line. reflects: whether the material reflects the light of any light."""
        parts = [] if self.distance is None else [f"{shown(self.distance)} away"]
        parts.append(f"cosine {shown(self.cosine)}" + (", behind the surface" if self.cosine <= 0 else ""))
        if self.attenuation != 1:
            parts.append(f"attenuated to {shown(self.attenuation)}")
        if self.falloff is not None:
            parts.append(f"spot factor {shown(self.falloff)}" + ("" if self.falloff else ", outside its cone"))
        for address, share in self.in_way.items():
            of = "" if self.samples == 1 else f" of {round(share * self.samples)} of {self.samples} samples"
            parts.append(f"{address} is in the way{of}")
        if not any(self.diffuse + self.specular):
            parts.append("nothing of it is seen" + ("" if reflects else ", as the material's kd and ks are 0"))
        else:
            if any(t < 1 for t in self.transmittance) and self.in_way:
                parts.append(f"{shown(self.transmittance)} passes")
            parts.append(f"arrives {shown(self.arrives)}")
            parts.append(f"diffuse {shown(self.diffuse)}, specular {shown(self.specular)}")
        return f"{self.light} ({self.type}): {'; '.join(parts)}"


@dataclass(frozen=True)
class SurfaceStory:
    """What the path of the pixel meets: the surface that the camera sees, or one that is seen in it.

    way: how the path comes here: "camera", "reflection", "total reflection", "refraction", "passing" (a surface that
        counts for nothing, because another transparent solid fills both of its sides) or "scattering".
    weight: factor of the light from here in the pixel, with what media on the way have absorbed.
    object: address of the object, or of a visible light, which has no material; None if nothing is met.
    distance, point, normal, uv, inside: the hit; `inside` is whether the surface is seen from its inside.
    material: address of the material; its numbers at this point, after the texture.
    unlit: whether the surface shows kd as it is. It then has neither `ambient` nor `lights`.
    ambient: reflected ambient light.
    lights: what becomes of each light.
    own: the surface's own colour: ambient light and all lights; or the background.
    share: share of the own colour that is kept beside what passes through the surface.
    adds: what the pixel gets from here, weight * share * own.
    scattered: number of rays by which light from other matte surfaces is gathered; `scattered_light`: what they add to
        the pixel; `scattered_to`: share of the rays that meet each object first.
    notes: sentences about what is odd.
    operand: address of the operand that is met; None if the object is not made of operands.
    """

    way: str
    weight: Colour
    object: str | None
    adds: Colour
    own: Colour
    share: Colour = (1.0, 1.0, 1.0)
    distance: float | None = None
    point: Colour | None = None
    normal: Colour | None = None
    uv: tuple[float, float] | None = None
    inside: bool = False
    material: dict[str, Any] | None = None
    unlit: bool = False
    ambient: Colour | None = None
    lights: tuple[LightStory, ...] = ()
    scattered: int = 0
    scattered_light: Colour = (0.0, 0.0, 0.0)
    scattered_to: dict[str, float] | None = None
    notes: tuple[str, ...] = ()
    operand: str | None = None

    def lines(self) -> Iterator[str]:
        """The story in lines of text. The first one is about the hit."""
        how = "the camera's ray" if self.way == "camera" else f"{self.way}, with weight {shown(self.weight)},"
        if self.object is None:
            yield f"{how} meets nothing: {shown(self.own)}"
            return
        if self.material is None:
            yield f"{how} meets the visible light {self.object} after {shown(self.distance)}: {shown(self.own)}"
            return
        operand = "" if self.operand is None else f" (its operand {self.operand})"
        side = " from inside" if self.inside else ""
        yield (
            f"{how} meets {self.object}{operand}{side} after {shown(self.distance)}, at {shown(self.point)}; "
            f"normal {shown(self.normal)}, uv {shown(self.uv)}"
        )
        texture = f" with {self.material['texture']}" if self.material["texture"] else ""
        yield f"   {self.material['address']}{texture}: " + ", ".join(self._numbers())
        if self.unlit:
            yield "   unlit: it shows kd as it is, whatever light falls on it"
        if self.ambient is not None:
            yield f"   ambient light: {shown(self.ambient)}"
        reflects = any(self.material["kd"] + self.material["ks"])
        for light in self.lights[:MOST_LIGHTS]:
            yield f"   {light.text(reflects)}"
        if len(self.lights) > MOST_LIGHTS:
            yield f"   ... and {len(self.lights) - MOST_LIGHTS} lights more (--json has all)"
        share = "" if self.share == (1.0, 1.0, 1.0) else f", of which {shown(self.share)} counts"
        yield f"   its own colour is {shown(self.own)}{share}; the pixel gets {shown(self.adds)}"
        if self.scattered:
            met = ", ".join(f"{name} {100 * x:.0f} %" for name, x in self.scattered_to.items())
            yield f"   {self.scattered} scattered rays meet {met}; the pixel gets {shown(self.scattered_light)}"
        yield from (f"   note: {note}" for note in self.notes)

    def _numbers(self) -> Iterator[str]:
        """The numbers of the material that matter."""
        refined = {"ks": ("shininess",), "kt": ("ior", "absorption")}
        for field in ("ka", "kd", "ks", "kr", "kt", "emission"):
            if field in ("ka", "kd") or any(self.material[field]):
                others = (x for x in refined.get(field, ()) if x != "absorption" or any(self.material[x]))
                yield from (f"{name} {shown(self.material[name])}" for name in (field, *others))
        if self.material["fresnel"] != "none":
            yield f"fresnel {self.material['fresnel']}"


@dataclass(frozen=True)
class PixelStory:
    """How the colour of a pixel comes about, for one sample in its centre.

    x, y: column and row of the pixel, from the top left.
    shading: shading mode of the picture.
    surfaces: what the path meets, from the camera on. If a surface both reflects and refracts, a sample takes one of
        the two ways at random, and its weight makes up for the other.
    colour: colour of the pixel: the sum of what the surfaces add.
    """

    x: int
    y: int
    shading: str
    surfaces: tuple[SurfaceStory, ...]
    colour: Colour

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def lines(self) -> Iterator[str]:
        """The story in lines of text."""
        yield f"pixel {self.x}, {self.y}: {shown(self.colour)} (linear red, green, blue), one sample in its centre"
        for number, surface in enumerate(self.surfaces[:MOST_SURFACES], 1):
            first, *rest = surface.lines()
            yield f"{number}. {first}"
            yield from rest
        if len(self.surfaces) > MOST_SURFACES:
            yield f"... and {len(self.surfaces) - MOST_SURFACES} surfaces more (--json has all)"

    def as_json(self) -> dict[str, Any]:
        """The story as plain values."""
        return asdict(self)
