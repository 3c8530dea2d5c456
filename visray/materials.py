"""Materials: how a surface answers light, in the terms of Blinn and Phong."""

from dataclasses import dataclass

from pydantic import ConfigDict

from visray.quantities import Color, Factor


@dataclass(frozen=True, kw_only=True)
class Material:
    """Blinn-Phong coefficients: ambient `ka`, diffuse `kd`, specular `ks`, and the exponent `shininess`."""

    __pydantic_config__ = ConfigDict(extra="forbid")

    ka: Color = (0.1, 0.1, 0.1)
    kd: Color = (0.7, 0.7, 0.7)
    ks: Color = (0.0, 0.0, 0.0)
    shininess: Factor = 32.0
