"""Materials: Blinn-Phong reflection, mirrors and refraction, and what a palette colour changes in them."""

from dataclasses import InitVar, dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field

from visray.colors import color_as_picked
from visray.errors import FieldError
from visray.quantities import FARTHEST, Color, Factor, Length, PickedColor, Quantity, Real, Share
from visray.records import record_kind
from visray.references import MaterialName, TextureName

RefractiveIndex = Annotated[
    Real, Field(gt=0), Field(ge=0.01, le=100), Quantity(1, "geometry", "> 0, from 0.01 to 100; air is 1")
]
# The fields that a palette colour can change.
COLORED = ("ka", "kd", "ks", "kr", "kt", "emission")
# The kd of a material that says nothing about it.
KD = (0.7, 0.7, 0.7)
# How kr and kt depend on the angle. In kernels, the field `fresnel` is the place in this list.
FRESNEL = ("none", "dielectric", "metal")
DIELECTRIC, METAL = 1, 2


def _once(names: tuple[str, ...]) -> tuple[str, ...]:
    """The names unchanged; raises ValueError if one occurs twice."""
    if repeated := [name for name in COLORED if names.count(name) > 1]:
        raise ValueError(f"has {repeated[0]} twice; name it once")
    return names


@record_kind
@dataclass(frozen=True, kw_only=True)
class Material:
    """Blinn-Phong coefficients: ambient `ka`, diffuse `kd`, specular `ks`, and the exponent `shininess`. Without a `ka`
    of its own, a material reflects ambient light as it reflects other light: by kd, or by the colour of its texture.
    `color` is another way to give kd, as people pick colours: "tomato", "#c33", three numbers from 0 to 255, or one
    from 0 to 1 for grey in linear light. It is not kept; kd is.

    `kr` is the share of light that a mirror reflects (for a metal, its ks). `kt` is the share of light that passes
    through, refracted by the index `ior`; the surface's own colour is then weighted with 1 - kt (settings.local). Light
    that passes through a solid on its way from a light to a surface is multiplied by kt (1 - min(d / dmax, 1)), where d
    is the length of its way inside the solid. All light that runs a length d inside a solid is multiplied by
    exp(-absorption d).

    `fresnel` says how kr and kt depend on the angle. "none": not at all. "dielectric": kr is multiplied by F and kt by
    1 - F, where F is the reflectance of an interface of the index `ior`; the own colour is weighted with (1 - F)
    (1 - kt). "metal": kr is the reflectance of light that meets the surface at a right angle, and grows to 1 at grazing
    angles (Schlick); the own colour is weighted with what kr has not taken.

    Where transparent solids overlap, the one with the higher `priority`
    counts; of equal priorities, the one with the smaller volume. `texture` names a texture. Its colour replaces kd and
    multiplies ka, so that it shows in shadow too; with `textured` = "kd", ka is kept.

    With `shading` = "unlit", the surface's own colour is kd or that of its texture, whatever light falls on it. kr and
    kt add to it as in other materials.

    `emission` is light that the surface itself sends out. It is a part of the surface's own colour: the camera sees it,
    and so do mirrors, glass and scattered rays, but it casts no light as lights do.

    `colored` names the fields that a palette colour of a data layer changes: it replaces kd and multiplies the others.

    `back` names the material of the side that the normal points away from, such as the inside of a bowl. Both materials
    must be opaque, and the back's must have no `back` itself. A palette colour changes the front only.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")
    # The section of a scene that has materials (records.Reference). No annotation, so that it is no field.
    section = "materials"

    # The mark of the colour is outside of the union, so that ka is a quantity (quantities.quantities).
    ka: Annotated[Color | None, Quantity(3, "shading", "linear Rec. 709, each >= 0; null: as kd")] = None
    kd: Color = KD
    ks: Color = (0.0, 0.0, 0.0)
    shininess: Factor = 32.0
    kr: Share = (0.0, 0.0, 0.0)
    kt: Share = (0.0, 0.0, 0.0)
    ior: RefractiveIndex = 1.5
    dmax: Length = FARTHEST
    absorption: Color = (0.0, 0.0, 0.0)
    fresnel: Literal[FRESNEL] = "none"
    emission: Color = (0.0, 0.0, 0.0)
    # It is no Quantity: kernels read the order of the solids, not the number.
    priority: Real = 0.0
    texture: TextureName | None = None
    textured: Literal["ka and kd", "kd"] = "ka and kd"
    shading: Literal["lit", "unlit"] = "lit"
    colored: Annotated[tuple[Literal[COLORED], ...], AfterValidator(_once)] = ("ka", "kd")
    back: MaterialName | None = None
    color: InitVar[Annotated[Any, PickedColor()]] = None

    def __post_init__(self, color: Any) -> None:
        """Puts `color` into kd. Raises FieldError if there is a kd, too. Domain: it is a colour, or None."""
        if color is None:
            return
        if self.kd is not KD:
            raise FieldError("color sets kd; write only one of the two")
        object.__setattr__(self, "kd", color_as_picked(color))

    @property
    def keeps_ka(self) -> bool:
        """Whether the material has a texture that leaves ka as it is."""
        return self.texture is not None and self.textured == "kd"

    @property
    def resolved(self) -> "Material":
        """The material with numbers in `ka`. Where a texture takes the place of kd and multiplies ka, these are 1."""
        if self.ka is not None:
            return self
        return replace(self, ka=(1.0, 1.0, 1.0) if self.texture is not None and not self.keeps_ka else self.kd)

    @property
    def ka_is_kd(self) -> bool:
        """Whether kd is the ambient colour too, so that it reaches the ambient light of the picture."""
        return self.ka is None and (self.texture is None or self.keeps_ka)

    @property
    def replaced(self) -> tuple[str, ...]:
        """Names of the fields whose place a palette colour takes: kd, and with it a ka that follows."""
        return ("ka", "kd") if self.ka is None and {"ka", "kd"} <= {*self.colored} else ("kd",)

    @property
    def unlit(self) -> bool:
        """Whether the surface shows kd as it is, whatever light falls on it."""
        return self.shading == "unlit"

    @property
    def scatters(self) -> bool:
        """Whether the material is matte, so that it scatters light of other surfaces: it is lit, has kd or a texture,
        and has neither kr nor kt."""
        return not self.unlit and not any((*self.kr, *self.kt)) and (any(self.kd) or self.texture is not None)

    def with_color(self, color: tuple[float, float, float]) -> "Material":
        """The material with a palette colour in the fields `colored`: it replaces kd and a ka that follows, and
        multiplies the others.

        color: linear Rec. 709
        """
        rgb = tuple(float(x) for x in color)
        own = {name: getattr(self.resolved, name) for name in self.colored}
        new = {name: rgb if name in self.replaced else tuple(np.multiply(x, rgb).tolist()) for name, x in own.items()}
        return replace(self.resolved, **new)

    def color_flaw(self) -> str | None:
        """Why a palette colour would not be seen in the material, as the end of a sentence; None if it is seen."""
        if self.texture is not None and "kd" in self.colored:
            return "has a texture, which takes the place of the colour in kd"
        black, white = self.with_color((0.0, 0.0, 0.0)), self.with_color((1.0, 1.0, 1.0))
        shown = [name for name in COLORED if not (self.unlit and name in ("ka", "ks"))]
        if all(getattr(black, name) == getattr(white, name) for name in shown):
            return f"shows no colour, as colored = {list(self.colored)} names no field that is seen"
        return None


def colored(table: Material, color: Any, names: tuple[str, ...], replaced: tuple[str, ...] = ("kd",)) -> Material:
    """The materials of a table with palette colours, as `Material.with_color` gives them; with derivatives.

    table: Dr.Jit arrays with one entry for each row
    color: a colour for each row
    names, replaced: the fields `colored` and `replaced` of all these materials
    """
    return replace(table, **{name: color if name in replaced else getattr(table, name) * color for name in names})
