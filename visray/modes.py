"""The shading modes, one record each. Scene, kernel, schema, command line and documentation read them from here.

To add a mode, add a function and a record below (docs/extending.md).

The functions of a mode run in kernels. Each number or vector in them is a Dr.Jit array with one entry per ray.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

# Number of steps of diffuse light in mode toon. Its highlight is 1 where the highlight of Blinn-Phong is at least half
# of its largest value, and 0 elsewhere.
STEPS = 4


@dataclass(frozen=True)
class ReflectionModel:
    """How a surface reflects the light of one light sample: kd * diffuse + ks * highlight.

    diffuse: function of the cosine n.l.
    cosine: function of an Interaction and a LightSample that returns the cosine of the highlight, such as n.h.
    highlight: function of the power cosine^shininess.
    stepped: whether `diffuse` or `highlight` jumps between values. If so, derivatives do not contain the movement
        of the edges at these jumps.
    """

    diffuse: Callable[[Any], Any] = lambda cosine: cosine
    cosine: Callable[[Any, Any], Any] = lambda si, sample: _n_dot_h(si, sample)
    highlight: Callable[[Any], Any] = lambda power: power
    stepped: bool = False


@dataclass(frozen=True)
class Mode:
    """A shading mode. It shows light, by a reflection model, or it shows a property of the surface as a colour.

    name: name of the mode in settings.shading.
    meaning: one line for users.
    model: the reflection model; None in modes that show a property.
    colour: function of a KernelScene and an Interaction that returns the colour; None in modes that show light.
    """

    name: str
    meaning: str
    model: ReflectionModel | None = None
    colour: Callable[[Any, Any], Any] | None = None

    @property
    def lit(self) -> bool:
        """Whether the mode shows light. If it does not, the kernel has no code for lights, shadows or paths."""
        return self.model is not None


def _n_dot_h(si: Any, sample: Any) -> Any:
    """max(n.h, 0), with h the unit vector halfway between the directions to the light and to the viewer."""
    halfway = sample.l - si.d
    squared = dr.squared_norm(halfway)
    return dr.maximum(dr.select(squared > 0, dr.dot(si.n, halfway) * dr.rsqrt(squared), 0), 0)


def _r_dot_v(si: Any, sample: Any) -> Any:
    """max(r.v, 0), with v the direction to the viewer, and r the direction to the light mirrored about the normal."""
    mirrored = (2 * sample.cosine) * si.n - sample.l
    return dr.maximum(-dr.dot(mirrored, si.d), 0)


def _steps(cosine: Any) -> Any:
    """The cosine rounded up to a multiple of 1 / STEPS. The minimum with 1 is needed because rounding errors may make
    the cosine slightly larger than 1."""
    return dr.minimum(dr.ceil(cosine * STEPS) * (1 / STEPS), 1)


def _all_or_nothing(power: Any) -> Any:
    """1 in lanes where the power is at least 1/2, else 0."""
    return dr.select(power >= 0.5, type(power)(1), 0)


def _normal(s: Any, si: Any) -> Any:
    """(n + 1) / 2, with n the unit normal: each component is from 0 to 1."""
    return 0.5 * si.n + 0.5


def _depth(s: Any, si: Any) -> Any:
    """D / (D + t), with t the distance of the surface and D the distance of the camera's target."""
    t = si.hit.t
    if s.attached:
        t = dr.select(si.hit.valid, dr.dot(si.surface.p - si.o, s.a.W(si.d)), t)
    return s.a.V(dr.rcp(1 + s.a.F(t) * dr.rcp(s.view.target_distance)))


def _uv(s: Any, si: Any) -> Any:
    """The fractional parts of u and v."""
    return s.a.V(si.u - dr.floor(si.u), si.v - dr.floor(si.v), 0)


def _albedo(s: Any, si: Any) -> Any:
    """kd of the material, or the colour of its texture."""
    return si.material.kd


MODES = (
    Mode("blinn-phong", "light, with the highlight (n.h)^shininess of Blinn and Phong", ReflectionModel()),
    Mode("phong", "light, with the highlight (r.v)^shininess of Phong, r the mirrored direction to the light",
         ReflectionModel(cosine=_r_dot_v)),
    Mode("toon", f"light as in a cartoon: diffuse light in {STEPS} steps, and a highlight of full strength or none",
         ReflectionModel(_steps, highlight=_all_or_nothing, stepped=True)),
    Mode("normal", "the unit normal, turned to the camera: x, y, z from -1 to 1 as red, green, blue from 0 to 1",
         colour=_normal),
    Mode("depth", "the distance: white at the camera, mid-grey as far as the camera's target, black infinitely far",
         colour=_depth),
    Mode("uv", "the texture coordinates: red is the fractional part of u, green that of v", colour=_uv),
    Mode("albedo", "kd of the material, or the colour of its texture", colour=_albedo),
)  # fmt: skip
BY_NAME = {mode.name: mode for mode in MODES}
NAMES = tuple(BY_NAME)


def table() -> tuple[list[str], list[list[str]]]:
    """Column headings and rows of the table of modes in the documentation."""
    return ["`shading`", "what the picture shows"], [[f"`{mode.name}`", mode.meaning] for mode in MODES]
