"""visray: a ray tracer whose primitives and Blinn-Phong integrator are Dr.Jit kernels.

    import visray as vr
    image = vr.render("scene.json", spp=64)
    image.write("picture.exr")
    image["N"]            # normals, as a NumPy array

A scene can be written in Python as well: vr.Scene(objects={"ball": vr.Sphere(radius=1)}, ...).
"""

# ruff: noqa: E402, F401, F403 - the order of imports matters; lights and primitives list their own public names
import sys

from visray import clock  # isort: skip
from visray import llvm

llvm.prepare()  # before Dr.Jit is imported, because its import loads LLVM

from visray import lights, primitives
from visray.camera import Camera, OrthographicCamera
from visray.edges import EdgeWarning
from visray.errors import UserError
from visray.gradients import derivative, difference, gradient
from visray.lights import *
from visray.materials import Material
from visray.output.image import Image
from visray.polynomials.catalogue import SURFACES, KnownSurface
from visray.primitives import *
from visray.primitives.clips import Ball, Block
from visray.render import explain, prepare, render
from visray.scene.address import replaced, value
from visray.scene.load import dump, load
from visray.scene.scene import Film, Occlusion, Scatter, Scene, Settings, SkyGradient
from visray.setup import Prepared
from visray.study.cost.study import cost
from visray.study.cost.tuning import tune
from visray.textures import CheckerTexture, ImageTexture
from visray.transforms import Matrix, Rotate, Scale, Translate
from visray.version import __version__

__all__ = [
    *lights.__all__,
    *primitives.__all__,
    "SURFACES",
    "Ball",
    "Block",
    "Camera",
    "CheckerTexture",
    "EdgeWarning",
    "Film",
    "Image",
    "ImageTexture",
    "KnownSurface",
    "Material",
    "Matrix",
    "Occlusion",
    "OrthographicCamera",
    "Prepared",
    "Rotate",
    "Scale",
    "Scatter",
    "Scene",
    "Settings",
    "SkyGradient",
    "Translate",
    "UserError",
    "__version__",
    "cost",
    "derivative",
    "difference",
    "dump",
    "explain",
    "gradient",
    "load",
    "prepare",
    "render",
    "replaced",
    "tune",
    "value",
]  # fmt: skip

# From each name of an earlier version to its name today.
_RENAMED = {"Gradient": "SkyGradient", "surfaces": "SURFACES"}


def __dir__() -> list[str]:
    """Public names, sorted. Submodules, which Python adds to the package when they are imported, are internal and left
    out."""
    return sorted(__all__)


def __getattr__(name: str) -> object:
    """Raises an error, because visray has no attribute `name`. For a name of an earlier version, the message says its
    new name."""
    if name not in _RENAMED:
        raise AttributeError(f"module 'visray' has no attribute {name!r}")
    text = f"visray.{name} is now visray.{_RENAMED[name]}; use the new name"
    # In `from visray import Gradient`, Python would replace the text of an AttributeError by its own.
    importing = sys._getframe(1).f_globals.get("__name__") == "importlib._bootstrap"
    # Because `name` is given, Python adds no suggestion of its own, such as "Did you mean: 'gradient'?".
    raise ImportError(text) if importing else AttributeError(text, name=None)
