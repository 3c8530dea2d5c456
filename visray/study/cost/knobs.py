"""A scene's own knobs: the settings that trade accuracy for time, of the effects that the scene calls for.

What a scene is, is no knob: settings.scatter.depth and occlusion.distance say which light there is, not how well it is
computed.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Literal

from visray.adaptive.error_floor import DEEPEST
from visray.feature_rules import used_materials
from visray.primitives import Polynomial
from visray.render import explain
from visray.scene.address import changed, value
from visray.scene.scene import Scene
from visray.textures import ImageTexture

Kind = Literal["sampling", "bias", "step"]

SAMPLERS = ("stratified", "sobol", "independent")
SPP, SAMPLER = "settings.spp", "settings.sampler"
DEPTH, PRECISION = "settings.depth", "settings.precision"
# Powers of 4: with a slope of 1/2, each halves the error. The scene's own samples times MORE too, so that what half its
# error costs is measured, but of independent samples only where they are its own: they need too many. (quick, full)
SAMPLES, MORE = ((1, 4, 16, 64), (1, 4, 16, 64, 256)), 4
# So many times the scene's own number of rays. (quick, full)
FACTORS = (1 / 4, 1 / 2, 1, 2, 4), (1 / 4, 1 / 2, 1, 2, 4, 16)
TOLERANCES = (0.0, 1e-9, 1e-3), (0.0, 1e-12, 1e-9, 1e-6, 1e-3)
# The most that a scene may ask for, by the types of its fields.
MOST_SAMPLES, MOST_RAYS = 2**22, 2**16
# What these knobs do is shown, but nobody should save there: neither points of several knobs nor a tuner turn them.
KEPT = ("roots", "accelerator", "texture filter")


@dataclass(frozen=True)
class Choice:
    """One position of a knob. settings: by address, as vr.replaced takes them, all that the knob turns. own: it is the
    scene as it is."""

    knob: str
    value: Any
    settings: dict[str, Any]
    own: bool = False

    def of(self, scene: Scene) -> Scene:
        """The scene with the knob in this position."""
        return scene if self.own else changed(scene, self.settings)


@dataclass(frozen=True)
class Knob:
    """What can be turned; its positions in the order of value, few for a quick study or all. One of them is the scene's
    own, but for samplers that the scene does not use."""

    name: str
    kind: Kind
    few: tuple[Choice, ...]
    all: tuple[Choice, ...]

    def choices(self, quick: bool) -> tuple[Choice, ...]:
        return self.few if quick else self.all


def knobs(scene: Scene) -> tuple[Knob, ...]:
    """The knobs that the scene has; the samplers first."""
    on, settings = explain(scene), scene.settings
    found = [_samples(scene, sampler) for sampler in SAMPLERS]
    if on["area lights"] and scene.objects:
        found.append(_light_samples(scene))
    for effect, name, address in (
        ("sky occlusion", "sky rays", "settings.occlusion.sky"),
        ("near occlusion", "near rays", "settings.occlusion.near"),
        ("scatter", "scatter rays", "settings.scatter.rays"),
    ):
        if on[effect]:
            found.append(_rays(scene, name, address))
    if on["reflection"] or on["refraction"]:
        found.append(_depth(settings.depth))
    found.append(_of_values("precision", "step", scene, [PRECISION], ("single", "double")))
    if curved := [f"objects.{n}.tolerance" for n, o in scene.objects.items() if _searched(o)]:
        found.append(_of_values("roots", "bias", scene, curved, *TOLERANCES))
    if scene.objects:
        found.append(_of_values("accelerator", "step", scene, ["settings.accelerator"], ("auto", "none", "tree")))
    if on["textures"] and (images := _images(scene)):
        found.append(_of_values("texture filter", "step", scene, images, ("nearest", "bilinear")))
    return tuple(found)


def default(scene: Scene, turned: Iterable[Knob]) -> Choice:
    """The scene as it is, with all that the knobs turn."""
    addresses = dict.fromkeys(a for k in turned for c in k.all for a in c.settings)
    return Choice("default", "as it is", {a: value(scene, a) for a in addresses}, own=True)


def _samples(scene: Scene, sampler: str) -> Knob:
    """Samples per pixel of a sampler."""
    own, name = scene.settings, f"samples, {sampler}"

    def choice(spp: int) -> Choice:
        same = (own.spp, own.sampler) == (spp, sampler)
        return Choice(name, spp, {SPP: spp, SAMPLER: sampler}, own=same)

    there = {own.spp}
    if sampler != "independent" or sampler == own.sampler:
        there.add(min(MORE * own.spp, MOST_SAMPLES))
    return _ladder(name, "sampling", choice, *(sorted({*counts, *there}) for counts in SAMPLES))


def _light_samples(scene: Scene) -> Knob:
    """The samples of all area lights together."""
    own = {f"lights.{name}.samples": light.samples for name, light in scene.lights.items() if light.has_area}

    def choice(factor: float) -> Choice:
        settings = {address: _times(n, factor) for address, n in own.items()}
        return Choice("light samples", sum(settings.values()), settings, own=settings == own)

    return _ladder("light samples", "sampling", choice, *FACTORS)


def _rays(scene: Scene, name: str, address: str) -> Knob:
    """The rays of an effect."""
    own = value(scene, address)

    def choice(factor: float) -> Choice:
        n = _times(own, factor)
        return Choice(name, n, {address: n}, own=n == own)

    return _ladder(name, "sampling", choice, *FACTORS)


def _depth(own: int) -> Knob:
    """How many reflections and refractions are followed: up to twice as many as the scene says."""
    powers = [2**k for k in range(own.bit_length()) if 2**k < own]
    few = sorted({*powers, own, min(2 * own, DEEPEST)})
    choice = lambda depth: Choice("depth", depth, {DEPTH: depth}, own=depth == own)  # noqa: E731 - a name for a row
    return _ladder("depth", "bias", choice, few, [0, *few])


def _of_values(name: str, kind: Kind, scene: Scene, addresses: list[str], few: tuple, all: tuple = ()) -> Knob:
    """A knob that puts the same value at all its addresses. Where the scene has several there, its own position is one
    more: `as it is`."""
    own = {address: value(scene, address) for address in addresses}

    def choice(x: Any) -> Choice:
        settings = own if x == "as it is" else dict.fromkeys(addresses, x)
        return Choice(name, x, settings, own=settings == own)

    mixed = len(set(own.values())) > 1
    ladders = [list(ladder) + ["as it is"] * mixed for ladder in (few, all or few)]
    if not mixed:
        there = next(iter(own.values()))
        ladders = [l if there in l else sorted([*l, there]) for l in ladders]
    return _ladder(name, kind, choice, *ladders)


def _ladder(name: str, kind: Kind, choice: Callable[[Any], Choice], few: Iterable, all: Iterable) -> Knob:
    """The knob with a choice for each of the numbers, those that come out alike only once."""
    return Knob(name, kind, *(tuple({c.value: c for c in map(choice, xs)}.values()) for xs in (few, all)))


def _times(n: int, factor: float) -> int:
    return min(max(1, round(n * factor)), MOST_RAYS)


def _searched(thing: Any) -> bool:
    """Whether the crossings of an object are searched for up to a tolerance: those of degree 2 have a formula."""
    return isinstance(thing, Polynomial) and any(f.degree > 2 for f in thing.compiled().program.factors)


def _images(scene: Scene) -> list[str]:
    """The addresses of the filters of images that are seen."""
    used = {m.texture for m in used_materials(scene).values()}
    return [f"textures.{n}.filter" for n, t in scene.textures.items() if n in used and isinstance(t, ImageTexture)]
