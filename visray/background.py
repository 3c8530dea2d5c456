"""Light of the background: a gradient or a colour, or an environment map."""

from dataclasses import replace
from typing import Any

import drjit as dr

from visray.images import environment
from visray.images.environment import Environment
from visray.kernel_scene import KernelScene
from visray.scene.scene import SkyGradient


def background(s: KernelScene, d: Any) -> Any:
    """Light of the background from direction d, a colour.

    A gradient changes linearly with d.y, from `bottom` at -1 to `top` at 1.
    """
    if not s.features["background"]:
        return s.a.V(0)
    if isinstance(s.sky, Environment):
        return environment.light(s.a, s.sky, d)
    up = 0.5 * s.a.F(d.y) + 0.5
    return dr.fma(s.sky.top - s.sky.bottom, up, s.sky.bottom)


def blackened(sky: SkyGradient | Environment) -> SkyGradient | Environment:
    """The background of a KernelScene, in black, for the same kernel."""
    names = ("intensity",) if isinstance(sky, Environment) else ("top", "bottom")
    return replace(sky, **{n: dr.opaque(type(x), 0, dr.width(x)) for n in names for x in (getattr(sky, n),)})
