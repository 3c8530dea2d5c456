"""The scene: plain numbers, frozen, the same in a file and in Python."""

import hashlib
from dataclasses import dataclass, field
from typing import Annotated, Literal, Union

from pydantic import ConfigDict, Field, TypeAdapter

from visray import lights, modes, primitives, textures
from visray.camera import Camera
from visray.materials import Material
from visray.quantities import Color, Count, Length, Name

STRICT = ConfigDict(extra="forbid", revalidate_instances="always")


@dataclass(frozen=True, kw_only=True)
class Film:
    """Size of the picture in pixels. A `transparent` film leaves the background out; layer A then holds the coverage
    by objects."""

    __pydantic_config__ = STRICT
    width: Count = 640
    height: Count = 480
    transparent: Annotated[bool, Field(strict=True)] = False


@dataclass(frozen=True, kw_only=True)
class SkyGradient:
    """Background colour of a ray that hits nothing. It is `bottom` for a ray straight down, `top` for one straight up,
    and in between it is linear in the y of the ray's unit direction."""

    __pydantic_config__ = STRICT
    top: Color
    bottom: Color


Rays = Annotated[int, Field(strict=True, ge=0, le=2**16)]
Depth = Annotated[int, Field(strict=True, ge=0, le=1000)]


@dataclass(frozen=True, kw_only=True)
class Occlusion:
    """Ambient occlusion: how much ambient light reaches a point.

    sky: rays per point that measure which share of the sky is visible; this share scales the scene's `ambient`.
    near: rays per point that measure how close other surfaces are; the result scales the lights' Ia. A surface counts
    less the farther away it is, linearly, and no more at all beyond `distance`.
    hemisphere: distribution of the rays: `cosine`, or `box`, toward uniform points of a half cube, as in the original
    VisRayTrace.

    With 0 rays nothing is occluded.
    """

    __pydantic_config__ = STRICT
    sky: Rays = 0
    near: Rays = 0
    distance: Length = 1.0
    hemisphere: Literal["cosine", "box"] = "cosine"


@dataclass(frozen=True, kw_only=True)
class Scatter:
    """Diffuse interreflection: light that matte surfaces send on to other surfaces.

    rays: rays per point that the camera sees. depth: bounces; a point of the second bounce and later sends one ray.
    """

    __pydantic_config__ = STRICT
    rays: Rays = 0
    depth: Depth = 1


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How the picture is made.

    spp: samples per pixel. sampler: how samples are placed in a pixel. seed: seed of the random numbers.
    precision: precision of shading; geometry is always double.
    shading: shading model, or the surface property that is shown. shadows: whether lights cast shadows.
    depth: largest number of reflections and refractions in a row.
    misses: colour of a secondary ray that hits nothing: the background, or the scene's `ambient`.
    local: weight of a transparent surface's own colour: `weighted` with 1 - kt, or `full`.
    area: `samples` lights a point from every sample of an area light; `centre` lights it from the light's centre and
    takes only the shadow from the samples, as the original VisRayTrace does.
    accelerator: how rays find what they hit; the picture is the same bit for bit.
    """

    __pydantic_config__ = STRICT
    # Up to this limit sampling.jittered computes the row of a stratum exactly in single precision.
    spp: Annotated[int, Field(strict=True, gt=0, le=2**22)] = 16
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**32)] = 0
    precision: Literal["single", "double"] = "single"
    sampler: Literal["stratified", "sobol", "independent"] = "stratified"
    shading: Literal[modes.NAMES] = "blinn-phong"
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
    """A scene: everything that determines a picture. Textures, materials, lights and objects have names and keep the
    order of the file."""

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
        """SHA-256 of the scene's canonical JSON. Equal scenes have equal hashes."""
        return hashlib.sha256(ADAPTER.dump_json(self)).hexdigest()


ADAPTER = TypeAdapter(Scene)
