"""visray: a ray tracer whose primitives and Blinn-Phong integrator are Dr.Jit kernels.

    import visray as vr
    image = vr.render("scene.json", spp=64)
    image.write("picture.exr")
    image["N"]            # normals, as a NumPy array

A scene can be written in Python as well: vr.Scene(objects={"ball": vr.Sphere(radius=1)}, ...).
"""

# ruff: noqa: E402, F401 - the order matters here
from visray import clock  # isort: skip
from visray import llvm

llvm.prepare()  # before anything imports Dr.Jit, which loads its LLVM at once

from visray import surfaces
from visray.camera import Camera
from visray.errors import UserError
from visray.gradients import EdgeWarning, derivative, difference, gradient
from visray.lights import DirectionalLight, DiskLight, PointLight, RectangleLight, SphereLight, SpotLight
from visray.materials import Material
from visray.output.image import Image
from visray.primitives import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Disk,
    Ellipsoid,
    Plane,
    Polynomial,
    Rectangle,
    Sphere,
    Torus,
    Triangle,
)  # fmt: skip
from visray.primitives.clips import Ball, Block
from visray.render import explain, prepare, render
from visray.scene.address import replaced, value
from visray.scene.load import dump, load
from visray.scene.scene import Film, Gradient, Occlusion, Scatter, Scene, Settings
from visray.setup import Prepared
from visray.study.cost.study import cost
from visray.study.cost.tuning import tune
from visray.textures import CheckerTexture, ImageTexture
from visray.transforms import Matrix, Rotate, Scale, Translate
from visray.version import __version__

__all__ = [
    "Ball", "Block", "Box", "Camera", "Capsule", "CheckerTexture", "Cone", "Cylinder", "DirectionalLight", "Disk",
    "DiskLight", "EdgeWarning", "Ellipsoid", "Film", "Gradient", "Image", "ImageTexture", "Material", "Matrix",
    "Occlusion", "Plane", "PointLight", "Polynomial", "Prepared", "Rectangle", "RectangleLight", "Rotate", "Scale",
    "Scatter", "Scene", "Settings", "Sphere", "SphereLight", "SpotLight", "Torus", "Translate", "Triangle", "UserError",
    "__version__", "cost", "derivative", "difference", "dump", "explain", "gradient", "load", "prepare", "render",
    "replaced", "surfaces", "tune", "value",
]  # fmt: skip
