"""The scene: plain numbers, frozen, the same in a file and in Python."""

import hashlib
from dataclasses import dataclass, field
from typing import Annotated, Literal, Union

from pydantic import ConfigDict, Field, TypeAdapter

from visray import lights, primitives, textures
from visray.camera import Camera
from visray.materials import Material
from visray.quantities import Color, Count, Length, Name

STRICT = ConfigDict(extra="forbid", revalidate_instances="always")


@dataclass(frozen=True, kw_only=True)
class Film:
    """The picture's size in pixels. A `transparent` film leaves the background out and keeps its coverage in A."""

    __pydantic_config__ = STRICT
    width: Count = 640
    height: Count = 480
    transparent: Annotated[bool, Field(strict=True)] = False


@dataclass(frozen=True, kw_only=True)
class SkyGradient:
    """What a ray sees that hits nothing: `bottom` straight down, `top` straight up, linear in the ray's y between."""

    __pydantic_config__ = STRICT
    top: Color
    bottom: Color


Rays = Annotated[int, Field(strict=True, ge=0, le=2**16)]
Depth = Annotated[int, Field(strict=True, ge=0, le=1000)]


@dataclass(frozen=True, kw_only=True)
class Occlusion:
    """How much ambient light gets to a point. `sky` rays tell what share of the sky it sees, which weakens the scene's
    `ambient`; `near` rays tell how close things are, a ramp up to `distance`, which weakens the lights' Ia.

    0 rays: all of it gets there. `hemisphere`: rays by the cosine, or crowded as the original's `box` did.
    """

    __pydantic_config__ = STRICT
    sky: Rays = 0
    near: Rays = 0
    distance: Length = 1.0
    hemisphere: Literal["cosine", "box"] = "cosine"


@dataclass(frozen=True, kw_only=True)
class Scatter:
    """Light that matte surfaces pass on: `rays` from what the eye sees, one from each of the further `depth` - 1
    levels."""

    __pydantic_config__ = STRICT
    rays: Rays = 0
    depth: Depth = 1


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How the picture is made: samples per pixel, where they fall (`sampler`) and from which seed; precision of
    shading; what is shaded (`shading`); shadows or none; how many reflections and refractions are followed (`depth`).

    `misses`: what a secondary ray finds that hits nothing, the background or the scene's `ambient`. `local`: whether
    the own colour of a transparent surface is weighted with 1 - kt, or stands in full. `area`: whether area lights
    light from every sample, or, as in the original, from their centre with a shadow from every sample.
    `accelerator`: how rays find what they hit; the picture is the same bit for bit.
    """

    __pydantic_config__ = STRICT
    # Up to here a stratum's row comes out right in single precision (sampling.in_cell).
    spp: Annotated[int, Field(strict=True, gt=0, le=2**22)] = 16
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**32)] = 0
    precision: Literal["single", "double"] = "single"
    sampler: Literal["stratified", "sobol", "independent"] = "stratified"
    shading: Literal["blinn-phong", "phong", "toon", "normal", "depth", "uv", "albedo"] = "blinn-phong"
    shadows: Annotated[bool, Field(strict=True)] = True
    depth: Depth = 6
    misses: Literal["background", "ambient"] = "background"
    local: Literal["weighted", "full"] = "weighted"
    area: Literal["samples", "centre"] = "samples"
    accelerator: Literal["auto", "none", "tree"] = "auto"
    occlusion: Occlusion = field(default_factory=Occlusion)
    scatter: Scatter = field(default_factory=Scatter)


Object = Annotated[Union[primitives.KINDS], Field(discriminator="type")]
Light = Annotated[Union[lights.KINDS], Field(discriminator="type")]
Texture = Annotated[Union[textures.KINDS], Field(discriminator="type")]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Everything a picture is made of. Materials, lights and objects have names, and keep the order of the file."""

    __pydantic_config__ = STRICT
    camera: Camera = field(default_factory=Camera)
    film: Film = field(default_factory=Film)
    background: SkyGradient | Color = SkyGradient(top=(0.5, 0.7, 1.0), bottom=(1.0, 1.0, 1.0))
    ambient: Color = (1.0, 1.0, 1.0)
    textures: dict[Name, Texture] = field(default_factory=dict)
    materials: dict[Name, Material] = field(default_factory=dict)
    lights: dict[Name, Light] = field(default_factory=dict)
    objects: dict[Name, Object] = field(default_factory=dict)
    settings: Settings = field(default_factory=Settings)

    def hash(self) -> str:
        """The SHA-256 of the scene's canonical JSON: equal scenes have equal hashes."""
        return hashlib.sha256(ADAPTER.dump_json(self)).hexdigest()


ADAPTER = TypeAdapter(Scene)
