"""How a picture of a surface was asked for, so that it can be made again, with other values of the parameters."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from visray.errors import UserError
from visray.primitives.clips import Ball
from visray.primitives.polynomial import Polynomial
from visray.scene.address import changed, parse_assignments, value
from visray.scene.check import checked
from visray.scene.scene import Scene
from visray.surface_picture.look import INSIDE, OUTSIDE
from visray.surface_picture.picture import SIZE, SurfacePicture, Wishes, surface_picture
from visray.surface_picture.reading import SURFACE

# Addresses of what is fitted to a surface, beside the camera.
FITTED = (
    "ambient",
    *(f"objects.{SURFACE}.{name}" for name in ("clip.center", "clip.radius", "material")),
    *(f"lights.{light}.{name}" for light in ("key", "fill") for name in ("position", "radius")),
    *(f"materials.{side}.{name}" for side in (OUTSIDE, INSIDE) for name in ("back", "ka", "kd")),
)
_MISSING = object()


@dataclass(frozen=True)
class Recipe:
    """What `visray surface` is given.

    formula: the formula, or the name of a known surface.
    parameters: numbers by name.
    wishes: what is asked for beside.
    settings: values in the scene by address, each a text ADDRESS=VALUE.
    """

    formula: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    wishes: Wishes = field(default_factory=Wishes)
    settings: tuple[str, ...] = ()

    def with_values(self, values: Mapping[str, float], size: tuple[int, int]) -> "Recipe":
        """The same with other values of parameters, and for a picture of another size in pixels."""
        return replace(self, parameters={**self.parameters, **values}, wishes=replace(self.wishes, size=size))

    def picture(self) -> tuple[Scene, SurfacePicture]:
        """The scene with all settings, and the picture without them. Raises a UserError if something is wrong."""
        made = surface_picture(self.formula, self.parameters, self.wishes)
        scene = checked(made.scene)
        return (changed(scene, parse_assignments(self.settings)) if self.settings else scene), made

    def words(self) -> list[str]:
        """The words of the command line that makes the picture."""
        size, wishes = self.wishes.size, self.wishes
        triples = {"--from": wishes.towards, "--color": wishes.color, "--inside": wishes.inside}
        options = [("--param", f"{name}={value!r}") for name, value in self.parameters.items()]
        options += [] if wishes.clip is None else [("--clip", repr(wishes.clip))]
        options += [(name, ",".join(map(repr, triple))) for name, triple in triples.items() if triple is not None]
        options += [] if size == SIZE else [("--size", f"{size[0]}x{size[1]}")]
        options += [("--set", text) for text in self.settings]
        # Behind two hyphens, or else a formula such as -x is an option.
        last = ["--", self.formula] if self.formula.startswith("-") else []
        first = [] if last else [self.formula]
        return ["visray", "surface", *first, *(word for option in options for word in option), *last]


def recipe_of(scene: Scene) -> Recipe | None:
    """How `visray surface` makes the picture of the surface in a scene that it, or vr.surface_scene, has made. None if
    the scene is none of these."""
    shape = scene.objects.get(SURFACE)
    made = isinstance(shape, Polynomial) and isinstance(shape.clip, Ball) and {"key", "fill"} <= set(scene.lights)
    if not made or not {OUTSIDE, INSIDE} <= set(scene.materials) or not (shape.surface or shape.expression):
        return None
    return Recipe(shape.surface or shape.expression, dict(shape.parameters), Wishes(scene.film.size))


def fitted_values(scene: Scene, wanted: Scene) -> dict[str, Any]:
    """The values by address that differ, of those that are fitted to a surface.

    scene: with the surface as it is. wanted: the scene whose values are taken.
    """
    same_kind = type(scene.camera) is type(wanted.camera)
    addresses = FITTED + (tuple(f"camera.{f.name}" for f in fields(wanted.camera)) if same_kind else ("camera",))
    return different(scene, wanted, addresses)


def different(scene: Scene, wanted: Scene, addresses: Iterable[str]) -> dict[str, Any]:
    """The values by address of `wanted` that are others in `scene`, or that are not there."""
    values = {address: _value(wanted, address) for address in addresses}
    return {a: x for a, x in values.items() if x is not _MISSING and _value(scene, a) != x}


def _value(scene: Scene, address: str) -> Any:
    """The value at an address, or _MISSING."""
    try:
        return value(scene, address)
    except UserError:
        return _MISSING
