"""Environment maps: pictures of all that surrounds a scene, as its background.

Kernels read them in images/environment.py.
"""

from dataclasses import dataclass
from typing import Annotated

from pydantic import ConfigDict

from visray.named_files import FileRule
from visray.quantities import Coordinate, Factor, Quantity
from visray.records import record_kind


@record_kind
@dataclass(frozen=True)
class EnvironmentMap:
    """Background: a picture of all directions, infinitely far away.

    `file`: an EXR, HDR (Radiance), PNG or JPEG file, relative to the scene file. It is equirectangular: twice as wide
    as high, with equal steps of longitude and latitude. Its upper edge is straight up (+y), its middle towards -z, and
    its right half towards +x. PNG and JPEG are read as sRGB, EXR and HDR as linear light. Pixels are blended.
    `rotation` turns it about y, counter-clockwise when seen from above: at 90, its middle is towards -x. `intensity`
    multiplies its light.
    """

    __pydantic_config__ = ConfigDict(extra="forbid", revalidate_instances="always")

    file: Annotated[str, FileRule()]
    rotation: Annotated[Coordinate, Quantity(1, "geometry", "degrees about y")] = 0.0
    intensity: Factor = 1.0
