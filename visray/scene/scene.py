"""The scene as frozen dataclasses of plain numbers. A scene file has the same fields."""

import hashlib
import json
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, Literal, Union

import numpy as np
from pydantic import BeforeValidator, ConfigDict, Discriminator, Field, Tag, TypeAdapter

from visray import camera as cameras
from visray import lights, modes, primitives, textures
from visray.animation.animation import Animation
from visray.colors import spelled
from visray.data.all_objects import AllObjects, address_of
from visray.data.data_scene import Data
from visray.environment_map import EnvironmentMap
from visray.errors import UserError
from visray.materials import Material
from visray.named_files import DIGESTS
from visray.primitives.csg_bodies import Body, separate_bodies
from visray.primitives.csg_operands import has_operands, materials_of, operands
from visray.primitives.csg_resolved import resolved
from visray.primitives.instance import Instance
from visray.primitives.primitive import Primitive
from visray.quantities import Color, Length, Name
from visray.records import record_kind
from visray.scene.building import Buildable
from visray.scene.film import Film
from visray.scene.naming import with_named_entries
from visray.scene.summary import summary, table
from visray.terminal import printable

# Name of the material of objects that name none.
DEFAULT_MATERIAL = "default"
# Endings of files that may be environment maps.
MAPS = (".exr", ".hdr", ".pic", ".png", ".jpg", ".jpeg")
STRICT = ConfigDict(extra="forbid", revalidate_instances="always")


@record_kind
@dataclass(frozen=True, kw_only=True)
class SkyGradient:
    """Background colour of rays that hit nothing. A ray straight down gets `bottom`, a ray straight up gets `top`. In
    between, the colour is a linear function of the y of the ray's unit direction."""

    __pydantic_config__ = STRICT
    top: Color = field(kw_only=False)
    bottom: Color = field(kw_only=False)


def _background_type(raw: Any) -> str:
    """Name of the type of a background, given as a dict, as an instance, or as a colour."""
    if isinstance(raw, dict):
        return "SkyGradient" if raw.keys() & {"top", "bottom"} or not raw else "EnvironmentMap"
    return type(raw).__name__ if isinstance(raw, SkyGradient | EnvironmentMap) else "color"


def _no_file(raw: Any) -> Any:
    """The background, unless it is a text that names a file: then raises ValueError, which says how to write that."""
    if isinstance(raw, str) and Path(raw).suffix.lower() in MAPS:
        raise ValueError(f'is no colour; write {{"file": {json.dumps(raw)}}} for an environment map')
    return raw


Background = Annotated[
    Annotated[SkyGradient, Tag("SkyGradient")]
    | Annotated[EnvironmentMap, Tag("EnvironmentMap")]
    | Annotated[Color, Tag("color")],
    Discriminator(_background_type),
    BeforeValidator(_no_file),
]
Rays = Annotated[int, Field(strict=True, ge=0, le=2**16)]
# Largest settings.depth of a scene.
DEEPEST = 1000
Depth = Annotated[int, Field(strict=True, ge=0, le=DEEPEST)]


@record_kind
@dataclass(frozen=True, kw_only=True)
class Occlusion:
    """Ambient occlusion: how much ambient light reaches a point. Rays over the hemisphere above the point measure it.

    sky: number of rays per point that measure which share of the sky is visible. The share scales the scene's
        `ambient`. With 0 rays it is 1.
    near: number of rays per point that measure how near other surfaces are. A ray whose first hit is at distance t has
        the value t / `distance`, and a ray without a hit within `distance` has the value 1. The mean value scales the
        lights' Ia. With 0 rays it is 1.
    distance: length of the `near` rays.
    hemisphere: distribution of the rays. `cosine`: density proportional to the cosine with the normal. `box`: rays
        toward uniformly distributed points in the volume of a half cube, as in the original VisRayTrace.
    light: what the rays of `sky` that hit nothing bring: the scene's `ambient`, or the `background` in their direction.
    """

    __pydantic_config__ = STRICT
    sky: Rays = 0
    near: Rays = 0
    distance: Length = 1.0
    hemisphere: Literal["cosine", "box"] = "cosine"
    light: Literal["ambient", "background"] = "ambient"


@record_kind
@dataclass(frozen=True, kw_only=True)
class Scatter:
    """Diffuse interreflection: light that matte surfaces send on to other surfaces.

    rays: number of rays from each point that the camera sees; 0 means no interreflection.
    depth: largest number of bounces. At the second bounce and later bounces a point sends only one ray.
    """

    __pydantic_config__ = STRICT
    rays: Rays = 0
    depth: Depth = 1


@record_kind
@dataclass(frozen=True, kw_only=True)
class Settings:
    """How the picture is made.

    spp: samples per pixel.
    seed: seed of the random numbers.
    precision: precision of shading; geometry is always in double precision.
    sampler: how samples are placed in a pixel.
    shading: shading mode: a reflection model, or the surface property that is shown as a colour.
    shadows: whether objects cast shadows.
    depth: largest number of reflections and refractions in a row.
    misses: colour of a reflected, refracted or scattered ray that hits nothing: the background, or the scene's
        `ambient`.
    local: weight of a transparent surface's own colour: 1 - kt (`weighted`), or 1 (`full`).
    area: points from which an area light shines. `samples`: the light of all its samples is averaged. `centre`: all
        light comes from its centre, and only the shadow is averaged over the samples, as in the original VisRayTrace.
    accelerator: how rays find objects. The picture is bit for bit the same with each, but for the last bit of coloured
        shadows through several transparent objects.
    """

    __pydantic_config__ = STRICT
    # Up to this limit, sampling.jittered computes strata exactly in single precision.
    spp: Annotated[int, Field(strict=True, gt=0, le=2**22)] = 16
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**32)] = 0
    precision: Literal["single", "double"] = "single"
    sampler: Literal["stratified", "sobol", "independent"] = "stratified"
    shading: Literal[modes.NAMES] = "blinn-phong"
    shadows: Annotated[bool, Field(strict=True)] = True
    depth: Depth = 16
    misses: Literal["background", "ambient"] = "background"
    local: Literal["weighted", "full"] = "weighted"
    area: Literal["samples", "centre"] = "samples"
    accelerator: Literal["auto", "none", "lists", "tree"] = "auto"
    occlusion: Occlusion = field(default_factory=Occlusion)
    scatter: Scatter = field(default_factory=Scatter)


def _camera_type(raw: Any) -> Any:
    """Type of a camera, given as a dict or as an instance; None for anything else. A dict without a type stands for a
    perspective camera."""
    if isinstance(raw, dict):
        return raw.get("type", cameras.Camera.type)
    return getattr(raw, "type", None)


Camera = Annotated[Union[tuple(Annotated[kind, Tag(kind.type)] for kind in cameras.KINDS)], Discriminator(_camera_type)]
Geometry = Annotated[Union[primitives.KINDS], Field(discriminator="type")]
Object = Annotated[Union[primitives.OBJECTS], Field(discriminator="type")]
Light = Annotated[Union[lights.KINDS], Field(discriminator="type")]
Texture = Annotated[Union[textures.KINDS], Field(discriminator="type")]


# Parts of a scene by the names of their fields.
_OWNERS = {
    f.name: part
    for part, kind in (("camera", cameras.Camera), ("film", Film), ("settings", Settings))
    for f in fields(kind)
    if f.name != "type"
}


@with_named_entries
@dataclass(frozen=True, kw_only=True)
class Scene(Buildable):
    """A scene: everything that determines a picture. Textures, materials, lights, geometries and objects are dicts by
    name, in the order of the file. A geometry is a shape without a material; the objects that are its instances show
    it. If `camera` or `lights` is None, it is fitted to the scene when the scene is checked (fitted_scene.py)."""

    __pydantic_config__ = STRICT
    # By the name of a field that a part of the scene has: this part, and what is right instead.
    # They have no type annotation, as __dataclass_fields__ holds all names that have one.
    OWNERS = _OWNERS
    MISPLACED = {name: f'is a field of {part}; write "{part}": {{"{name}": ...}}' for name, part in _OWNERS.items()}
    camera: Camera | None = None
    film: Film = field(default_factory=Film)
    background: Background = SkyGradient(top=(0.5, 0.7, 1.0), bottom=(1.0, 1.0, 1.0))
    ambient: Color = (0.2, 0.2, 0.2)
    textures: dict[Name, Texture] = field(default_factory=dict)
    materials: dict[Name, Material] = field(default_factory=dict)
    lights: dict[Name, Light] | None = None
    geometries: dict[Name, Geometry] = field(default_factory=dict)
    objects: dict[Name, Object] = field(default_factory=dict)
    data: Data | None = None
    animation: Animation | None = None
    settings: Settings = field(default_factory=Settings)

    def __post_init__(self) -> None:
        """Raises UserError for a background whose text is no colour, where Python makes the scene."""
        try:
            spelled(_no_file(self.background))
        except ValueError as error:
            raise UserError(printable(f"Scene: background = {json.dumps(self.background)}: {error}")) from None

    def __repr__(self) -> str:
        return summary(self)

    def _repr_html_(self) -> str:
        """For notebooks."""
        return table(self)

    @cached_property
    def all_objects(self) -> Mapping[str, Object]:
        """All objects that are rendered, by name, in order: `objects`, then those of `data` (data/all_objects.py)."""
        return self.objects if self.data is None else AllObjects(self.objects, self.data)

    def parts(self) -> Iterable[tuple[str, Object]]:
        """Names and objects in this order; in place of a line of `data`, its segments, and in place of a union that is
        drawn as several bodies, these, each with a name of its own."""
        return self.apart(self.objects.items() if self.data is None else self.all_objects.parts())

    def apart(self, objects: Iterable[tuple[str, Object]]) -> Iterator[tuple[str, Object]]:
        """Yields names and objects, with its bodies in place of each union that is drawn as several."""
        for name, obj in objects:
            if name in self.unions:
                yield from ((body, x.obj) for body, x in self.unions[name].items())
            else:
                yield name, obj

    @cached_property
    def unions(self) -> Mapping[str, Mapping[str, Body]]:
        """The unions that are drawn as several bodies (csg_bodies.py), by name, with their bodies by name."""
        transparent = {name for name, m in self.materials.items() if any(m.kt)}
        composite = {name for name, x in self.geometries.items() if x.composite}
        found = {
            name: separate_bodies(address_of(name), obj, self.geometries, transparent)
            for name, obj in self.objects.items()
            if obj.composite or (isinstance(obj, Instance) and obj.geometry in composite)
        }
        return {name: bodies for name, bodies in found.items() if bodies}

    @cached_property
    def bodies(self) -> Mapping[str, Object]:
        """The written objects, with its bodies in place of each union that is drawn as several."""
        return dict(self.apart(self.written_objects.items())) if self.unions else self.written_objects

    def shapes(self) -> Iterator[tuple[str, Primitive]]:
        """Yields the address and the shape of each geometry and each object, and of their operands at all depths. These
        have the transforms of what is around them too."""
        for section, shapes in (("geometries", self.geometries), ("objects", self.objects)):
            for name, shape in shapes.items():
                yield f"{section}.{name}", shape
                if has_operands(shape):
                    inner = islice(operands(f"{section}.{name}", shape, {}), 1, None)
                    yield from ((x.address, x.shape.with_fields(transform=x.steps)) for x in inner)

    @property
    def written_objects(self) -> Mapping[str, Object]:
        """The objects that have an instance of their own: `objects`, and the base of `data`."""
        return self.objects if self.data is None else self.all_objects.written

    @property
    def representatives(self) -> Mapping[str, Object]:
        """Objects of all kinds and materials that the scene has: of the rows of a layer, only the first."""
        return self.objects if self.data is None else self.all_objects.representatives

    @property
    def hidden(self) -> np.ndarray:
        """Numbers of the objects that are not to be seen, in the order of all_objects: rows without data at a date."""
        return np.zeros(0, int) if self.data is None else self.all_objects.hidden

    def materials_of(self, obj: Object) -> tuple[str, ...]:
        """Names of the materials that an object has: its own one, then those of its operands."""
        return materials_of(obj, self.geometries)

    def materials_of_objects(self) -> list[tuple[str, ...]]:
        """What `materials_of` says of each object, in the order of all_objects."""
        if self.data is not None:
            return self.all_objects.materials(self.materials_of)
        return [self.materials_of(x) for x in self.objects.values()]

    def objects_of(self, materials: Collection[str]) -> dict[str, Object]:
        """The parts with one of these materials, by name, in the order of `parts`."""
        if self.data is not None:
            return self.all_objects.of_materials(materials, self.materials_of)
        if not materials:
            return {}
        return {name: x for name, x in self.objects.items() if not set(self.materials_of(x)).isdisjoint(materials)}

    def sides_of(self, material: str) -> tuple[str, str]:
        """Names of the materials that surfaces of a material show on the front and on the back."""
        return material, getattr(self.materials.get(material), "back", None) or material

    def material(self, name: str) -> Material:
        """The material with a name. Domain: it exists."""
        return self.materials[name] if name in self.materials or name != DEFAULT_MATERIAL else Material()

    def shape_of(self, obj: Object) -> Primitive:
        """The geometry of an instance, without the instance's own transform; a difference for an object with cuts, and
        for CSG one without instances; any other object itself."""
        if obj.cut or obj.composite:
            return resolved(obj, self.geometries)
        return self.shape_of(self.geometries[obj.geometry]) if isinstance(obj, Instance) else obj

    def placed_shape(self, obj: Object) -> Primitive:
        """The object that is rendered for an object of the scene: for an instance, its geometry with the material and
        the transform of the instance; CSG as in `shape_of`; any other object itself."""
        shape = self.shape_of(obj)
        if isinstance(obj, Instance) and not shape.composite:
            return obj.placed_shape(shape)
        return resolved(obj, self.geometries)

    def hash(self) -> str:
        """SHA-256 of the scene's canonical JSON, and of the contents of all files that it names: textures, environment
        maps, meshes and tables. Equal scenes with equal files have equal hashes. A file that has not changed is read
        once."""
        return hashlib.sha256(ADAPTER.dump_json(self, context={DIGESTS: True})).hexdigest()


ADAPTER = TypeAdapter(Scene)
