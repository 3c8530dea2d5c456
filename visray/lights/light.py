"""What every light is.

A light shines from one place (point, spot), from infinitely far (directional), or from all points of a shape (the area
lights): then what arrives is the mean over `samples` of them, each with its own direction, distance and shadow.

A kind is one file. Where it has an extent it says where its points are (`offset`); how it weakens to the sides is
`aim`. Fields are Dr.Jit arrays in these methods.
"""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from pydantic import ConfigDict, Field

from visray.quantities import Color, Factor

# Up to here a sample's stratum comes out right in single precision (sampling.jittered).
Samples = Annotated[int, Field(strict=True, gt=0, le=2**16)]


@dataclass(frozen=True, kw_only=True)
class Light:
    """`Ia`, `Id`, `Is` are a light's ambient, diffuse and specular colours, all scaled by `intensity`.

    At distance d the diffuse and specular parts are weakened by 1 / (a + b d + c d^2); a = b = c = 0 means no
    attenuation. Lights are not seen themselves.
    """

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")

    intensity: Factor = 1.0
    Ia: Color = (0.0, 0.0, 0.0)
    Id: Color = (1.0, 1.0, 1.0)
    Is: Color = (1.0, 1.0, 1.0)
    a: Factor = 0.0
    b: Factor = 0.0
    c: Factor = 0.0

    # Whether the light has a place, and whether it has an extent.
    has_position: ClassVar[bool] = True
    has_area: ClassVar[bool] = False

    def flaws(self) -> list[tuple[str, str]]:
        """What no field alone can show to be wrong: pairs of a field and what is wrong with it."""
        return []

    def falloff(self, d: Any) -> Any:
        """The share of the light that is sent in the unit direction `d`, or None where it is 1 for all of them."""
        return None


@dataclass(frozen=True, kw_only=True)
class AreaLight(Light):
    """A light with an extent: every point of it sends the same in every direction, and `samples` of them are taken."""

    samples: Samples = 16

    has_area: ClassVar[bool] = True

    def point_offset(self, w: Any, u: Any, v: Any) -> Any:
        """From the middle of the light to its point for (u, v) in the unit square, a triple of type `w`; equal areas of
        the square are equal areas of the light."""
        raise TypeError(f"{type(self).__name__} has no points")

    def radius_bound(self) -> Any:
        """The radius of a sphere about the middle of the light that holds it."""
        raise TypeError(f"{type(self).__name__} has no reach")
