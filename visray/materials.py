"""Materials: Blinn-Phong reflection, mirrors and refraction."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from visray.quantities import FARTHEST, Color, Factor, Length, Name, Quantity, Real, Share

RefractiveIndex = Annotated[
    Real, Field(gt=0), Field(ge=0.01, le=100), Quantity(1, "geometry", "> 0, from 0.01 to 100; air is 1")
]


@dataclass(frozen=True, kw_only=True)
class Material:
    """Blinn-Phong coefficients: ambient `ka`, diffuse `kd`, specular `ks`, and the exponent `shininess`.

    `kr` is the share of light that a mirror reflects (for a metal, its ks). `kt` is the share of light that passes
    through, refracted by the index `ior`; the surface's own colour is then weighted with 1 - kt (settings.local). Light
    that passes through a solid on its way from a light to a surface is multiplied by kt (1 - min(d / dmax, 1)), where d
    is the length of its way inside the solid. Where transparent solids overlap, the one with the higher `priority`
    counts; of equal priorities, the one with the smaller volume. `texture` names a texture. Its colour replaces kd and
    multiplies ka, so that it shows in shadow too; with `textured` = "kd", ka is kept.

    With `shading` = "unlit", the surface's own colour is kd or that of its texture, whatever light falls on it. kr and
    kt add to it as in other materials.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    ka: Color = (0.1, 0.1, 0.1)
    kd: Color = (0.7, 0.7, 0.7)
    ks: Color = (0.0, 0.0, 0.0)
    shininess: Factor = 32.0
    kr: Share = (0.0, 0.0, 0.0)
    kt: Share = (0.0, 0.0, 0.0)
    ior: RefractiveIndex = 1.5
    dmax: Length = FARTHEST
    # It is no Quantity: kernels read the order of the solids, not the number.
    priority: Real = 0.0
    texture: Name | None = None
    textured: Literal["ka and kd", "kd"] = "ka and kd"
    shading: Literal["lit", "unlit"] = "lit"

    @property
    def keeps_ka(self) -> bool:
        """Whether the material has a texture that leaves ka as it is."""
        return self.texture is not None and self.textured == "kd"

    @property
    def unlit(self) -> bool:
        """Whether the surface shows kd as it is, whatever light falls on it."""
        return self.shading == "unlit"

    @property
    def scatters(self) -> bool:
        """Whether the material is matte, so that it scatters light of other surfaces: it is lit, has kd or a texture,
        and has neither kr nor kt."""
        return not self.unlit and not any((*self.kr, *self.kt)) and (any(self.kd) or self.texture is not None)
