"""The scene: plain numbers, frozen, the same in a file and in Python."""

import hashlib
import json
from dataclasses import dataclass, field
from typing import Annotated, Literal, Union

from pydantic import ConfigDict, Field, TypeAdapter

from visray import lights, primitives
from visray.camera import Camera
from visray.materials import Material
from visray.quantities import Color, Count, Name

STRICT = ConfigDict(extra="forbid", revalidate_instances="always")


@dataclass(frozen=True, kw_only=True)
class Film:
    """The picture's size in pixels. A `transparent` film leaves the background out and keeps its coverage in A."""

    __pydantic_config__ = STRICT
    width: Count = 640
    height: Count = 480
    transparent: Annotated[bool, Field(strict=True)] = False


@dataclass(frozen=True, kw_only=True)
class Gradient:
    """What a ray sees that hits nothing: `bottom` straight down, `top` straight up, linear in the ray's y between."""

    __pydantic_config__ = STRICT
    top: Color
    bottom: Color


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How the picture is made: samples per pixel, seed, precision of shading, shadows or none."""

    __pydantic_config__ = STRICT
    # Up to here a stratum's row comes out right in single precision (sampling.in_pixel).
    spp: Annotated[int, Field(strict=True, gt=0, le=2**22)] = 16
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**32)] = 0
    precision: Literal["single", "double"] = "single"
    shadows: Annotated[bool, Field(strict=True)] = True


Object = Annotated[Union[primitives.KINDS], Field(discriminator="type")]
Light = lights.PointLight if len(lights.KINDS) == 1 else Annotated[Union[lights.KINDS], Field(discriminator="type")]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Everything a picture is made of. Materials, lights and objects have names, and keep the order of the file."""

    __pydantic_config__ = STRICT
    camera: Camera = field(default_factory=Camera)
    film: Film = field(default_factory=Film)
    background: Gradient | Color = Gradient(top=(0.5, 0.7, 1.0), bottom=(1.0, 1.0, 1.0))
    ambient: Color = (1.0, 1.0, 1.0)
    materials: dict[Name, Material] = field(default_factory=dict)
    lights: dict[Name, Light] = field(default_factory=dict)
    objects: dict[Name, Object] = field(default_factory=dict)
    settings: Settings = field(default_factory=Settings)

    def hash(self) -> str:
        """The SHA-256 of the scene's canonical JSON: equal scenes have equal hashes."""
        return hashlib.sha256(json.dumps(ADAPTER.dump_python(self, mode="json")).encode()).hexdigest()


ADAPTER = TypeAdapter(Scene)
