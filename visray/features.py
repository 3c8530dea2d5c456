"""Features: the effects that a scene needs and its kernel therefore simulates, each with the reason.

An effect is left out only if it contributes exactly 0 to the picture and to every derivative that is asked for. With
`everything` no effect is left out, and the picture is the same bit for bit.
Error: none (tests/test_features.py).
"""

from dataclasses import dataclass, replace

from visray import modes
from visray.feature_rules import RULES, Rule, used_materials
from visray.scene.scene import Scene


@dataclass(frozen=True)
class Feature:
    """One effect.

    name: such as "shadows". on: whether it is simulated. reason: why it is or is not.
    """

    name: str
    on: bool
    reason: str


@dataclass(frozen=True)
class RayFamily:
    """Accelerator of one family of rays.

    rays: name of the family, such as "camera". accelerator: how these rays find what they hit. reason: why it was
    chosen.
    """

    rays: str
    accelerator: str
    reason: str


@dataclass(frozen=True)
class Features:
    """Effects of a render, looked up by name: features["shadows"].

    listed: all effects, in the order of RULES.
    shininess_bits: number of binary digits of the largest shininess in the kernel.
    rays: accelerator of each family of rays; filled in by `explain` only.
    """

    listed: tuple[Feature, ...]
    shininess_bits: int
    rays: tuple[RayFamily, ...] = ()

    def __getitem__(self, name: str) -> bool:
        """Whether an effect is simulated. `paths` stands for reflection, refraction or scatter."""
        if name == "paths":
            return any(self[effect] for effect in ("reflection", "refraction", "scatter"))
        return next(f.on for f in self.listed if f.name == name)

    def names(self) -> list[str]:
        """Names of the effects that are simulated."""
        return [f.name for f in self.listed if f.on]


def _first_with_field(fields: tuple[str, ...], wrt: tuple[str, ...]) -> str | None:
    """First address in `wrt` of one of the fields, or None."""

    def field(address: str) -> str:
        parts = [*address.split("."), "", ""]
        return parts[{"materials": 2, "lights": 2, "camera": 1}.get(parts[0], 0)]

    return next((w for w in wrt if field(w) in fields), None)


def _ruled_out(name: str, scene: Scene, wrt: tuple[str, ...]) -> str | None:
    """Reason why a setting of the scene switches an effect off, even with `everything`; None if none does."""
    settings = scene.settings
    if name in ("shadows", "coloured shadows") and not settings.shadows:
        return "settings.shadows is false"
    if name in ("reflection", "refraction", "nested media") and not settings.depth:
        return "settings.depth is 0"
    unlit = not modes.BY_NAME[settings.shading].lit
    if unlit and name not in ("textures", "bilinear", "defocus", "background", "coverage"):
        return f"settings.shading is {settings.shading}"
    if name in ("textures", "bilinear") and not scene.textures:
        return "the scene has no textures"
    # A transparent film leaves the background out of the picture, but a mirror may still reflect it.
    path_rules = (r for r in RULES if r.name in ("reflection", "refraction", "scatter") and r.possible(scene))
    has_paths = not unlit and any(r.calls(scene) or _first_with_field(r.fields, wrt) for r in path_rules)
    if name == "background" and scene.film.transparent and not has_paths:
        return "film.transparent is true"
    return None


def _feature(rule: Rule, scene: Scene, wrt: tuple[str, ...], everything: bool) -> Feature:
    """The effect of a rule in a scene, before `needs` and `without` are considered."""
    off_reason = _ruled_out(rule.name, scene, wrt)
    if off_reason:
        return Feature(rule.name, False, off_reason)
    calls = rule.calls(scene)
    derivative = _first_with_field(rule.fields, wrt) if rule.possible(scene) else None
    if calls:
        more = f" and {len(calls) - 1} more" if len(calls) > 1 else ""
        return Feature(rule.name, True, f"needed by {calls[0]}{more}")
    if derivative:
        return Feature(rule.name, True, f"a derivative by {derivative} is asked for")
    return Feature(rule.name, everything, "forced" if everything else rule.absent)


def features(
    scene: Scene, wrt: tuple[str, ...] = (), everything: bool = False, without: tuple[str, ...] = ()
) -> Features:
    """Effects that a scene needs.

    wrt: addresses of the derivatives that are asked for.
    everything: simulate also effects that are 0.
    without: effects to leave out although the scene needs them, with those that refine them, to measure their cost.
    """
    # Materials are filtered once, not by each rule, since there may be very many objects.
    scene = replace(scene, materials=used_materials(scene))
    largest = max([m.shininess for m in scene.materials.values()], default=0)
    # Rounded up to a multiple of four: then a small change of a shininess does not change the kernel.
    bits = max(8, 4 * -(-int(largest).bit_length() // 4))
    by_name: dict[str, Feature] = {}
    for rule in RULES:
        feature = _feature(rule, scene, wrt, everything)
        if {rule.name, rule.needs} & set(without):
            feature = Feature(rule.name, False, "left out")
        elif feature.on and rule.needs and not by_name[rule.needs].on:
            feature = Feature(rule.name, False, f"without {rule.needs} it changes nothing")
        by_name[rule.name] = feature
    return Features(tuple(by_name.values()), bits)
