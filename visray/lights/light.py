"""The interface of all lights.

A light shines from one point (point, spot), from infinitely far away (directional), or from all points of a shape (area
lights). The light of an area light is the mean over `samples` of its points, each with its own direction, distance and
shadow.

A kind of light is one class in one file. An area light says where its points are (`point_offset`). `falloff` weakens a
light in some directions. Fields are Dr.Jit arrays in these methods.
"""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import ConfigDict, Field

from visray.quantities import Color, Factor

# What lights of other programs have, and the field that a light has instead.
INSTEAD = {
    **dict.fromkeys(("color", "colour", "rgb", "diffuse"), "Id"),
    **dict.fromkeys(("power", "strength", "energy", "brightness"), "intensity"),
}
EXAMPLES = {
    "Id": 'the colour of a light is Id, as in Id = [1, 0.8, 0.6] or Id = "orange"',
    "intensity": "the brightness of a light is intensity, as in intensity = 2",
}
# Up to this number the stratum of a sample is exact in single precision (sampling.jittered).
Samples = Annotated[int, Field(strict=True, gt=0, le=2**16)]


@dataclass(frozen=True, kw_only=True)
class Light:
    """`Ia`, `Id`, `Is` are a light's ambient, diffuse and specular colours, all multiplied by `intensity`.

    At distance d the diffuse and specular parts are multiplied by 1 / (a + b d + c d^2); a = b = c = 0 means no
    attenuation. Lights themselves are invisible, but for area
    lights that say otherwise.
    """

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")

    intensity: Factor = 1.0
    Ia: Color = (0.0, 0.0, 0.0)
    Id: Color = (1.0, 1.0, 1.0)
    Is: Color = (1.0, 1.0, 1.0)
    a: Factor = 0.0
    b: Factor = 0.0
    c: Factor = 0.0

    # By the name of a field that lights of other programs have: what is right instead.
    MISPLACED: ClassVar[dict[str, str]] = {name: EXAMPLES[field] for name, field in INSTEAD.items()}
    section: ClassVar[str] = "lights"
    # Whether the light has a position, and whether it has an area.
    has_position: ClassVar[bool] = True
    has_area: ClassVar[bool] = False

    @property
    def seen(self) -> bool:
        """Whether the light itself is seen."""
        return False

    def flaws(self) -> list[tuple[str, str]]:
        """Errors that concern several fields together, as pairs of a field's name and a message."""
        return []

    def falloff(self, d: Any) -> Any:
        """Factor from 0 to 1 that multiplies the light in the unit direction `d`, which points away from the light;
        None if it is 1 in all directions."""
        return None

    def falloff_reference(self, d: np.ndarray) -> np.ndarray:
        """The same factor in NumPy, computed by another formula: the reference for `visray check`. Shapes: (N, 3) ->
        (N)."""
        return np.ones(len(d))


@dataclass(frozen=True, kw_only=True)
class AreaLight(Light):
    """A light with an area. Each point sends the same light in all directions; `samples` of the points are used.

    If the light is `visible`, its shape is seen by the camera, in mirrors and through glass, in the colour Id times
    intensity. It is no object: it casts no shadow and is in no layer but the colour.
    """

    samples: Samples = 16
    visible: Annotated[bool, Field(strict=True)] = False

    has_area: ClassVar[bool] = True
    # The type of the primitive that has the light's shape, and the names of its fields, each with that of the light.
    shape: ClassVar[tuple[str, dict[str, str]]]

    @property
    def seen(self) -> bool:
        return self.visible

    def point_offset(self, w: Any, u: Any, v: Any) -> Any:
        """Vector of type `w` from the light's centre to one of its points, given by (u, v) in the unit square. Equal
        areas of the square map to equal areas of the light."""
        raise TypeError(f"{type(self).__name__} has no points")

    def radius_bound(self) -> Any:
        """Radius of a sphere about the light's centre that contains the light."""
        raise TypeError(f"{type(self).__name__} has no reach")
