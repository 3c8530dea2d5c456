"""What is simulated and why; that leaving the rest out changes no bit; and no derivative that was asked for."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np
import pytest

from visray.camera import Camera
from visray.features import RULES, features
from visray.gradients import gradient
from visray.lights import PointLight
from visray.materials import Material
from visray.primitives import Box, Cylinder, Plane, Rectangle, Sphere, Triangle
from visray.render import _pictures as pictures
from visray.render import expose, set_up
from visray.scene.address import replaced, value
from visray.scene.scene import Film, Gradient, Scene, Settings
from visray.transforms import Rotate

BLACK = (0.0, 0.0, 0.0)
FULL = Scene(
    camera=Camera(origin=(0.5, 2, 6), target=(0, 0.5, 0), fov=40.0),
    film=Film(width=24, height=16, transparent=False),
    background=Gradient(top=(0.2, 0.4, 0.8), bottom=(0.9, 0.8, 0.7)),
    ambient=(0.3, 0.2, 0.1),
    materials={
        "gloss": Material(ka=(0.2, 0.1, 0.1), kd=(0.5, 0.4, 0.3), ks=(0.3, 0.4, 0.5), shininess=17.5),
        "wall": Material(ka=(0.1, 0.1, 0.1), kd=(0.6, 0.6, 0.7), ks=(0.1, 0.1, 0.1), shininess=4.0),
    },
    lights={
        "key": PointLight(position=(3, 5, 4), Ia=(0.1, 0.1, 0.1), a=0.5, b=0.1, c=0.01),
        "fill": PointLight(position=(-4, 2, 3), intensity=0.4, Is=(0.5, 0.2, 0.2)),
    },
    objects={
        "floor": Plane(material="wall"),
        "ball": Sphere(center=(0, 1, 0), material="gloss"),
        "box": Box(min=(1.2, 0, -1), max=(2, 1, 0), material="gloss", transform=(Rotate(rotate=20.0),)),
        "can": Cylinder(center=(-1.7, 0.5, 0.5), material="wall"),
        "leaf": Triangle(a=(-1, 0, 1.5), b=(0.3, 0.1, 1.6), c=(-0.5, 1, 1.2), material="gloss"),
    },
    settings=Settings(spp=3, seed=5),
)


def material(**fields: Any) -> Callable[[Scene], Scene]:
    return lambda s: replace(s, materials={k: replace(m, **fields) for k, m in s.materials.items()})


def light(**fields: Any) -> Callable[[Scene], Scene]:
    return lambda s: replace(s, lights={k: replace(l, **fields) for k, l in s.lights.items()})


def whole(**fields: Any) -> Callable[[Scene], Scene]:
    return lambda s: replace(s, **fields)


def film(**fields: Any) -> Callable[[Scene], Scene]:
    return lambda s: replace(s, film=replace(s.film, **fields))


def lone(thing: Any) -> Callable[[Scene], Scene]:
    return lambda s: replace(s, objects={"lone": replace(thing, material="gloss")})


# Changes of the full scene: which effect they take away (or add), and the reason that is given.
CASES = {
    "ambient 0": (whole(ambient=BLACK), "ambient", True, "called for by materials.gloss and 1 more"),
    "no Ia": (lambda s: light(Ia=BLACK)(whole(ambient=BLACK)(s)), "ambient", False,
              "no ambient light falls on a material with ka"),
    "no ka": (material(ka=BLACK), "ambient", False, "no ambient light falls on a material with ka"),
    "no kd": (material(kd=BLACK), "diffuse", False, "no light with Id falls on a material with kd"),
    "no Id": (light(Id=BLACK), "diffuse", False, "no light with Id falls on a material with kd"),
    "no ks": (material(ks=BLACK), "specular", False, "no light with Is falls on a material with ks"),
    "no Is": (light(Is=BLACK), "specular", False, "no light with Is falls on a material with ks"),
    "whole shininess": (material(shininess=301.0), "fractional shininess", False, "every shininess is a whole number"),
    "no attenuation": (light(a=0.0, b=0.0, c=0.0), "attenuation", False, "no light has a, b or c"),
    "one flat thing": (lone(Rectangle(width=(3, 0, 0), height=(0, 3, 0))), "shadows", False,
                       "nothing can stand between a light and a surface"),
    "one solid thing": (lone(Sphere()), "shadows", True, "called for by lights.key and 1 more"),
    "shadows off": (whole(settings=replace(FULL.settings, shadows=False)), "shadows", False,
                    "settings.shadows is false"),
    "no objects": (whole(objects={}), "shadows", False, "nothing can stand between a light and a surface"),
    "no lights": (whole(lights={}), "shadows", False, "nothing can stand between a light and a surface"),
    "lights off": (light(intensity=0.0), "diffuse", False, "no light with Id falls on a material with kd"),
    "black sky": (whole(background=BLACK), "background", False, "the background is black"),
    "plain sky": (whole(background=(0.0, 0.0, 0.1)), "background", True, "called for by background"),
    "transparent": (film(transparent=True), "background", False, "film.transparent is true"),
    "opaque": (film(transparent=False), "coverage", False, "the film is opaque: A is 1"),
    "covering": (film(transparent=True), "coverage", True, "called for by film.transparent"),
}  # fmt: skip
EACH = pytest.mark.parametrize("case", CASES)


def exposed(scene: Scene, everything: bool) -> dict[str, np.ndarray]:
    made = set_up(scene, everything=everything)
    film, done = expose(made)
    assert done == scene.settings.spp
    return pictures(made, film, done, ("RGB", "A", "variance"))


def operations(scene: Scene, everything: bool = False) -> int:
    """Of the kernel that renders the samples: the greatest there is."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        expose(set_up(scene, everything=everything))
        return max(k["operation_count"] for k in dr.kernel_history([dr.KernelType.JIT]))


@EACH
def test_reason(case: str) -> None:
    change, name, on, reason = CASES[case]
    found = {f.name: f for f in features(change(FULL)).listed}
    assert list(found) == [r.name for r in RULES]
    assert (found[name].on, found[name].reason) == (on, reason)
    forced = {f.name: f for f in features(change(FULL), everything=True).listed}
    # What the scene forbids is not forced: shadows that are switched off, a background that the film leaves out.
    forbidden = case in ("shadows off", "transparent")
    assert forced[name].on != forbidden
    assert forced[name].reason == (reason if on or forbidden else "forced")


def test_every_rule_is_on_in_one_case_and_off_in_another() -> None:
    assert features(FULL).names() == [r.name for r in RULES if r.name != "coverage"]
    assert {name for _, name, on, _ in CASES.values() if not on} == {r.name for r in RULES}


@EACH
@pytest.mark.parametrize("precision", ["single", "double"])
def test_everything_is_the_same_bit_for_bit(case: str, precision: str) -> None:
    """Colour, coverage and variance, with what the scene does not call for left out and forced in."""
    scene = CASES[case][0](FULL)
    scene = replace(scene, settings=replace(scene.settings, precision=precision))
    without, forced = exposed(scene, False), exposed(scene, True)
    assert list(without) == ["RGB", "A", "variance"]
    for name in without:
        assert without[name].tobytes() == forced[name].tobytes()


@pytest.mark.parametrize(
    "case", ["no ka", "no kd", "no ks", "whole shininess", "no attenuation", "shadows off", "black sky", "no lights"]
)
def test_what_is_not_called_for_is_not_in_the_kernel(case: str) -> None:
    scene = CASES[case][0](FULL)
    assert operations(scene) < operations(FULL)
    assert operations(scene) < operations(scene, everything=True)


def test_matte_costs_less_than_glossy_and_glossy_less_than_a_broken_exponent() -> None:
    matte, glossy = material(ks=BLACK)(FULL), material(shininess=4.0)(FULL)
    assert operations(matte) < operations(glossy) < operations(FULL)


def test_only_materials_in_use_count() -> None:
    """A shiny material that no object has changes neither the features nor the kernel's size."""
    matte = material(ks=BLACK)(FULL)
    more = replace(matte, materials=matte.materials | {"unused": Material(ks=(1, 1, 1), shininess=1000.5)})
    assert features(more) == features(matte)
    assert operations(more) == operations(matte)


@pytest.mark.parametrize(
    ("shininess", "bits"), [(0.0, 8), (32.0, 8), (255.9, 8), (256.0, 12), (5000.0, 16), (2.0**20, 24)]
)
def test_digits_of_exponents(shininess: float, bits: int) -> None:
    """Enough for the greatest whole exponent, in steps of four so that a small change compiles nothing."""
    found = features(material(shininess=shininess)(FULL)).shininess_bits
    assert found == bits and 2**found > shininess


# Terms that are zero and whose slopes are not. The lights have no fall-off to 0, for there a slope does not exist.

SLOPES = {
    "materials.gloss.ks": material(ks=BLACK, shininess=8.0),
    "materials.gloss.kd": material(kd=BLACK),
    "materials.gloss.ka": material(ka=BLACK),
    "materials.gloss.shininess": material(shininess=8.0),
    "lights.key.Is": light(Is=BLACK),
    "lights.key.Id": light(Id=BLACK),
    "lights.key.Ia": light(Ia=BLACK),
    "lights.key.intensity": light(intensity=0.0),
    "lights.key.b": lambda s: light(a=1.0, b=0.0, c=0.0)(lone(Sphere())(s)),
    "ambient": lambda s: light(Ia=BLACK)(whole(ambient=BLACK)(s)),
    "background.top": whole(background=Gradient(top=BLACK, bottom=BLACK)),
}


def plus(scene: Scene, address: str, step: float) -> Scene:
    """The scene with the number at an address grown by a step, or its three numbers by one, two and three steps."""
    before = np.array(value(scene, address), float)
    moved = before + step * (np.array([1, 2, 3]) if before.ndim else 1)
    return replaced(scene, address, tuple(moved.tolist()) if moved.ndim else float(moved))


def mean_after(scene: Scene, address: str, step: float) -> float:
    moved = plus(scene, address, step)
    moved = replace(moved, settings=replace(moved.settings, precision="double"))
    return float(np.array(expose(set_up(moved, everything=True))[0].mean).mean())


@pytest.mark.parametrize("address", SLOPES)
def test_a_term_that_is_zero_keeps_its_slope(address: str) -> None:
    """Against one-sided differences of the picture with everything forced, at the border of the domain.

    Extrapolated from h and h/2, the error is h^2 / 12 of the third derivative: none for the linear terms; 6 distance^2
    of the slope for b, the lamp being nearer than 8; and ln^2 cos for an exponent, less.
    """
    scene = SLOPES[address](FULL)
    slope = gradient(scene, [address])[address]
    expected = float(np.sum(np.array(slope) * ([1, 2, 3] if np.ndim(slope) else 1)))
    assert abs(expected) > 1e-4
    h = 1e-3
    base, one, half = (mean_after(scene, address, s) for s in (0.0, h, h / 2))
    difference = 2 * (half - base) / (h / 2) - (one - base) / h
    # And the rounding of a mean of some 1 000 sums over a step.
    assert abs(expected - difference) <= h * h / 12 * 6 * 64 * abs(difference) + 4e3 * 2.0**-53 / (h / 2)


def test_a_highlight_that_is_zero_keeps_the_slope_of_its_broken_exponent() -> None:
    """ks = 0 with a shininess of 17.5: the slope by ks is that of cos^17.5, not of cos^17."""
    scene = material(ks=BLACK, shininess=17.5)(FULL)
    found = gradient(scene, ["materials.gloss.ks"])["materials.gloss.ks"]
    h = 1e-3
    exact = (mean_after(scene, "materials.gloss.ks", h) - mean_after(scene, "materials.gloss.ks", 0.0)) / h
    # Linear in ks: only rounding, of some 1 000 sums.
    assert abs(float(np.sum(found * [1, 2, 3])) - exact) <= 1e3 * 2.0**-53 / h
    assert features(scene, ("materials.gloss.ks",))["fractional shininess"]
