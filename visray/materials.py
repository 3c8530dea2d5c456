"""Materials: how a surface answers light, in the terms of Blinn and Phong, and where it sends light on."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import ConfigDict, Field

from visray.quantities import FARTHEST, Color, Factor, Length, Name, Quantity, Real, Share

RefractiveIndex = Annotated[
    Real, Field(gt=0), Field(ge=0.01, le=100), Quantity(1, "geometry", "> 0, from 0.01 to 100; air is 1")
]


@dataclass(frozen=True, kw_only=True)
class Material:
    """Blinn-Phong coefficients: ambient `ka`, diffuse `kd`, specular `ks`, and the exponent `shininess`.

    `kr` is the share of light that a mirror reflects (a metal has its ks there), `kt` the share that is let through and
    refracted by the index `ior`; the surface's own colour is weighted with 1 - kt (settings.local). A shadow through a
    solid of thickness d along the way is tinted by kt (1 - min(d / dmax, 1)). `texture` names what takes the place of
    kd.
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
    texture: Name | None = None
