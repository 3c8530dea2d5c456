"""Settings that a study varies, and their choices: what trades accuracy for time, for the effects that a scene uses.

Settings that define the light are not varied: settings.scatter.depth and settings.occlusion.distance say which light
there is, not how accurately it is computed.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Literal

from visray.explaining import explain
from visray.feature_rules import used_materials
from visray.primitives import Polynomial
from visray.scene.address import changed, value
from visray.scene.scene import DEEPEST, Scene
from visray.textures import ImageTexture

Kind = Literal["sampling", "bias", "step"]

SAMPLERS = ("stratified", "sobol", "independent")
SPP, SAMPLER = "settings.spp", "settings.sampler"
DEPTH, PRECISION = "settings.depth", "settings.precision"
SKY, NEAR, SCATTER = "settings.occlusion.sky", "settings.occlusion.near", "settings.scatter.rays"
# Powers of 4: with a slope of 1/2 each step halves the error. MORE times the scene's samples are added, so that the
# price of half the error is measured; for independent samples only where the scene uses them. (quick, full)
SAMPLES, MORE = ((1, 4, 16, 64), (1, 4, 16, 64, 256)), 4
# Numbers of rays, as multiples of the scene's. (quick, full)
FACTORS = (1 / 4, 1 / 2, 1, 2, 4), (1 / 4, 1 / 2, 1, 2, 4, 16)
TOLERANCES = (0.0, 1e-9, 1e-3), (0.0, 1e-12, 1e-9, 1e-6, 1e-3)
# The largest values that the fields of a scene allow.
MOST_SAMPLES, MOST_RAYS = 2**22, 2**16
# These settings are measured, but never recommended or tuned: they change more than the error shows.
KEPT = ("roots", "accelerator", "texture filter")
TOGETHER = "together"  # the name of the best values of all settings at once


@dataclass(frozen=True)
class Choice:
    """One value of a setting.

    setting: the setting's name, as in VariedSetting
    value: the value
    settings: the values that it gives to fields of the scene, by address
    own: whether it is the scene's own value
    """

    setting: str
    value: Any
    settings: dict[str, Any]
    own: bool = False

    def of(self, scene: Scene) -> Scene:
        """The scene with this choice."""
        return scene if self.own else changed(scene, self.settings)


@dataclass(frozen=True)
class VariedSetting:
    """What a study varies: a field of the scene, or a few that change together.

    name: its name, such as "depth" or "samples, sobol"
    kind: "sampling", "bias" or "step", as in Curve
    few, all: choices of the quick and of the full study, in the order of value; the scene's own is among them, except
        for a sampler that the scene does not use
    """

    name: str
    kind: Kind
    few: tuple[Choice, ...]
    all: tuple[Choice, ...]

    def choices(self, quick: bool) -> tuple[Choice, ...]:
        """The choices of the quick or of the full study."""
        return self.few if quick else self.all


def is_samples(setting: str) -> bool:
    """Whether the setting of this name is the samples per pixel: of a sampler, or with the best values of all settings
    together."""
    return setting.startswith("samples, ") or setting == TOGETHER


def varied_settings(scene: Scene) -> tuple[VariedSetting, ...]:
    """The settings of a scene that a study varies; the samplers first."""
    on = explain(scene)
    found = [_samples(scene, sampler) for sampler in SAMPLERS]
    if on["area lights"] and scene.all_objects:
        found.append(_light_samples(scene))
    for effect, name, address in (
        ("sky occlusion", "sky rays", SKY),
        ("near occlusion", "near rays", NEAR),
        ("scatter", "scatter rays", SCATTER),
    ):
        if on[effect]:
            found.append(_rays(scene, name, address))
    if on["reflection"] or on["refraction"]:
        found.append(_depth(scene.settings.depth))
    found.append(_of_values("precision", "step", scene, [PRECISION], ("single", "double")))
    if curved := [f"{address}.tolerance" for address, shape in scene.shapes() if _searched(shape)]:
        found.append(_of_values("roots", "bias", scene, curved, *TOLERANCES))
    if scene.all_objects:
        ways = "auto", "none", "lists", "tree"
        found.append(_of_values("accelerator", "step", scene, ["settings.accelerator"], ways))
    if on["textures"] and (images := _images(scene)):
        found.append(_of_values("texture filter", "step", scene, images, ("nearest", "bilinear")))
    return tuple(found)


def default(scene: Scene, varied: Iterable[VariedSetting]) -> Choice:
    """The scene as it is, with its own values of all settings that are varied."""
    addresses = dict.fromkeys(a for s in varied for c in s.all for a in c.settings)
    return Choice("scene", "as it is", {a: value(scene, a) for a in addresses}, own=True)


def sample_counts(sampler: str, quick: bool) -> list[int]:
    """Samples per pixel that are measured: powers of 4, and for Sobol points all powers of 2. Between powers of 2 Sobol
    points are worse, so the best choice is among these."""
    counts = SAMPLES[not quick]
    return sorted({*counts, *(2 * n for n in counts[:-1])}) if sampler == "sobol" else list(counts)


def _samples(scene: Scene, sampler: str) -> VariedSetting:
    """Samples per pixel with a sampler."""
    own, name = scene.settings, f"samples, {sampler}"

    def choice(spp: int) -> Choice:
        same = (own.spp, own.sampler) == (spp, sampler)
        return Choice(name, spp, {SPP: spp, SAMPLER: sampler}, own=same)

    more = {own.spp}
    if sampler != "independent" or sampler == own.sampler:
        more.add(min(MORE * own.spp, MOST_SAMPLES))
    return _ladder(
        name, "sampling", choice, *(sorted({*sample_counts(sampler, quick), *more}) for quick in (True, False))
    )


def _light_samples(scene: Scene) -> VariedSetting:
    """Light samples of all area lights together."""
    own = {f"lights.{name}.samples": light.samples for name, light in scene.lights.items() if light.has_area}

    def choice(factor: float) -> Choice:
        settings = {address: _times(n, factor) for address, n in own.items()}
        return Choice("light samples", sum(settings.values()), settings, own=settings == own)

    return _ladder("light samples", "sampling", choice, *FACTORS)


def _rays(scene: Scene, name: str, address: str) -> VariedSetting:
    """Rays of an effect."""
    own = value(scene, address)

    def choice(factor: float) -> Choice:
        n = _times(own, factor)
        return Choice(name, n, {address: n}, own=n == own)

    return _ladder(name, "sampling", choice, *FACTORS)


def _depth(own: int) -> VariedSetting:
    """Path depth of reflections and refractions, up to twice the scene's."""
    powers = [2**k for k in range(own.bit_length()) if 2**k < own]
    few = sorted({*powers, own, min(2 * own, DEEPEST)})
    choice = lambda depth: Choice("depth", depth, {DEPTH: depth}, own=depth == own)  # noqa: E731 - a name for a row
    return _ladder("depth", "bias", choice, few, [0, *few])


def _of_values(name: str, kind: Kind, scene: Scene, addresses: list[str], few: tuple, all: tuple = ()) -> VariedSetting:
    """A setting that gives the same value to all its addresses. If the scene has several values there, its own choice
    has the value "as it is"."""
    own = {address: value(scene, address) for address in addresses}

    def choice(x: Any) -> Choice:
        settings = own if x == "as it is" else dict.fromkeys(addresses, x)
        return Choice(name, x, settings, own=settings == own)

    mixed = len(set(own.values())) > 1
    ladders = [list(ladder) + ["as it is"] * mixed for ladder in (few, all or few)]
    if not mixed:
        present = next(iter(own.values()))
        ladders = [l if present in l else sorted([*l, present]) for l in ladders]
    return _ladder(name, kind, choice, *ladders)


def _ladder(name: str, kind: Kind, choice: Callable[[Any], Choice], few: Iterable, all: Iterable) -> VariedSetting:
    """A setting with one choice for each different value. few, all: what `choice` makes choices of, in order."""
    return VariedSetting(name, kind, *(tuple({c.value: c for c in map(choice, xs)}.values()) for xs in (few, all)))


def _times(n: int, factor: float) -> int:
    """A number of rays or samples times a factor, from 1 to the largest that a scene allows."""
    return min(max(1, round(n * factor)), MOST_RAYS)


def _searched(shape: Any) -> bool:
    """Whether the crossings of an object are searched up to a tolerance; those of degree 2 have a formula."""
    return isinstance(shape, Polynomial) and any(f.degree > 2 for f in shape.compiled().program.factors)


def _images(scene: Scene) -> list[str]:
    """Addresses of the filters of image textures in use."""
    used = {m.texture for m in used_materials(scene).values()}
    return [f"textures.{n}.filter" for n, t in scene.textures.items() if n in used and isinstance(t, ImageTexture)]
