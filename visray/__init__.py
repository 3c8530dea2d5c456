"""visray: a ray tracer whose primitives and Blinn-Phong integrator are Dr.Jit kernels.

    import visray as vr
    image = vr.render("scene.json", spp=64)
    image.write("picture.exr")
    image["N"]            # normals, as a NumPy array

A scene can be written in Python as well:

    scene = vr.Scene(objects={"ball": vr.Sphere((0, 1, 0), 1, material=vr.Material(color="gold"))})
    scene = scene.with_object("floor", vr.Plane()).with_light("key", vr.PointLight((4, 6, 5)))
    vr.render(scene, spp=64).write("ball.png")

Scenes: Scene, load, dump, replaced, value, data_scene, surface_scene; prepare for many pictures of one scene.
Pictures: render, animate, view, Image. What is in them: explain, why, projected, cost, tune.
Derivatives: gradient, derivative, difference. dir(visray) has all names; help(visray.render) says more.

Names are imported when they are first used, because the command line needs few of them.
"""

import sys
from importlib import import_module
from importlib.machinery import PathFinder
from typing import TYPE_CHECKING

from visray import clock, drjit_import  # noqa: F401 - the clock starts

if TYPE_CHECKING:
    from visray.public import *  # noqa: F403

drjit_import.watch()

# From each name of an earlier version to its name today.
_RENAMED = {"Gradient": "SkyGradient", "surfaces": "SURFACES"}


def _import_public() -> dict[str, object]:
    """Adds all public names to this module. Returns its names."""
    public = import_module("visray.public")
    globals().update({name: getattr(public, name) for name in public.__all__}, __all__=public.__all__)
    return globals()


def __dir__() -> list[str]:
    """Public names, sorted. Submodules, which Python adds to the package when they are imported, are internal and left
    out."""
    return sorted(_import_public()["__all__"])


def __getattr__(name: str) -> object:
    """A public name, when it is first used. Raises an AttributeError for a name that visray does not have. For a name
    of an earlier version, the message says its new name."""
    if name in _RENAMED:
        text = f"visray.{name} is now visray.{_RENAMED[name]}; use the new name"
        # In `from visray import Gradient`, Python would replace the text of an AttributeError by its own.
        importing = sys._getframe(1).f_globals.get("__name__") == "importlib._bootstrap"
        # Because `name` is given, Python adds no suggestion of its own, such as "Did you mean: 'gradient'?".
        raise ImportError(text) if importing else AttributeError(text, name=None)
    if _may_be_public(name) and name in (names := _import_public()):
        return names[name]
    raise AttributeError(f"module 'visray' has no attribute {name!r}")


def _may_be_public(name: str) -> bool:
    """Whether a name may be a public one. Python asks for submodules too, before it imports them."""
    if name.startswith("_"):
        return name in ("__all__", "__version__")
    return name.isidentifier() and PathFinder.find_spec(f"visray.{name}", __path__) is None  # noqa: F405 - the star is for type checkers
