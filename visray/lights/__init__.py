"""Lights. A new kind is one file here, its name in KINDS and one sample in tests/light_samples.py."""

from visray.lights.directional import DirectionalLight
from visray.lights.disk import DiskLight
from visray.lights.point import PointLight
from visray.lights.rectangle import RectangleLight
from visray.lights.sphere import SphereLight
from visray.lights.spot import SpotLight

KINDS = (PointLight, DirectionalLight, SpotLight, RectangleLight, DiskLight, SphereLight)
