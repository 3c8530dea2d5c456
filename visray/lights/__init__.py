"""The kinds of lights.

A new kind is one file in this folder, its class in KINDS, and one sample in tests/light_samples.py
(docs/extending.md).
"""

from visray.lights.directional import DirectionalLight
from visray.lights.disk import DiskLight
from visray.lights.point import PointLight
from visray.lights.rectangle import RectangleLight
from visray.lights.sphere import SphereLight
from visray.lights.spot import SpotLight

KINDS = (PointLight, DirectionalLight, SpotLight, RectangleLight, DiskLight, SphereLight)
# The public names of this folder, which are names of visray too.
__all__ = [kind.__name__ for kind in KINDS]
