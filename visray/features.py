"""Features: the effects that a scene needs and its kernel therefore simulates, each with the reason.

An effect, such as shadows or reflection, is a part of the kernel's code. It is left out only if a setting switches it
off, or if it contributes exactly 0 to the picture and to every derivative that is asked for. With `everything` only
settings switch effects off, and the picture is bit for bit the same (tests/test_features.py).

An address is the dotted name of a value in a scene, such as `materials.red.kd`.
"""

from dataclasses import dataclass, field

from visray import modes
from visray.camera import OrthographicCamera
from visray.environment_map import EnvironmentMap
from visray.feature_rules import (
    CHANGING_REFLECTED,
    PASSING_ON,
    REFLECTED,
    RULES,
    SOURCES,
    Rule,
    background_is_ambient,
    used_materials,
)
from visray.mesh_report import MeshFacts
from visray.records import altered
from visray.scene.edits import canonical
from visray.scene.scene import Scene

# The effects that shading modes without light have too.
ON_EVERYWHERE = (
    "two-sided", "textures", "bilinear", "defocus", "background", "environment map", "filter", "coverage",
)  # fmt: skip


@dataclass(frozen=True)
class Feature:
    """One effect.

    name: name of the effect, such as "shadows".
    on: whether the effect is simulated.
    reason: why the effect is simulated, or why it is left out. It makes no difference to a kernel, so it is not
        compared.
    """

    name: str
    on: bool
    reason: str = field(compare=False)


@dataclass(frozen=True)
class RayFamily:
    """How one family of rays finds objects. A family is all rays of one purpose, such as the camera rays.

    rays: name of the family.
    accelerator: name of the way in which these rays find objects, such as "tree".
    reason: why this way was chosen.
    """

    rays: str
    accelerator: str
    reason: str


@dataclass(frozen=True)
class Overlap:
    """Two transparent solids whose bounding boxes and balls overlap.

    counts, hidden: addresses of the solid that counts where both are, and of the one that does not count there.
    reason: why.
    """

    counts: str
    hidden: str
    reason: str


@dataclass(frozen=True)
class Features:
    """All effects of a render, simulated or not. features["shadows"] is whether shadows are simulated.

    listed: the effects, in the order of RULES.
    shininess_bits: number of binary digits that the kernel provides for the largest shininess.
    rays: how each family of rays finds objects; filled in by render.explain only.
    meshes: facts about each mesh; filled in by render.explain only.
    overlaps: pairs of transparent solids that may overlap; filled in by render.explain only.
    overlap_count: number of all such pairs, of which `overlaps` may be the first; filled in by render.explain only.
    notes: sentences about materials; filled in by render.explain only.
    """

    listed: tuple[Feature, ...]
    shininess_bits: int
    rays: tuple[RayFamily, ...] = ()
    meshes: tuple[MeshFacts, ...] = ()
    overlaps: tuple[Overlap, ...] = ()
    overlap_count: int = 0
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return (
            f"Features: {', '.join(self.names()) or 'none'}; off: {', '.join(f.name for f in self.listed if not f.on)}"
        )

    def __getitem__(self, name: str) -> bool:
        """Whether an effect is simulated. "paths" is simulated if reflection, refraction or scatter is."""
        if name == "paths":
            return any(self[effect] for effect in ("reflection", "refraction", "scatter"))
        return next(f.on for f in self.listed if f.name == name)

    def names(self) -> list[str]:
        """Names of the effects that are simulated."""
        return [f.name for f in self.listed if f.on]


# Addresses by which derivatives are asked for, such as "materials.red.kd.0", each with the names of the fields that
# depend on it, such as kd and ka.
Wrt = dict[str, tuple[str, ...]]


def _fields_of(address: str, scene: Scene) -> tuple[str, ...]:
    """Names of the fields that depend on the number at an address. scene: with the materials as they are written"""
    parts = [*canonical(address).split("."), "", ""]
    field = parts[{"materials": 2, "lights": 2, "camera": 1}.get(parts[0], 0)]
    material = scene.materials.get(parts[1]) if parts[0] == "materials" else None
    return ("kd", "ka") if field == "kd" and material is not None and material.ka_is_kd else (field,)


def _first_with_field(fields: tuple[str, ...], wrt: Wrt) -> str | None:
    """First address in `wrt` on which one of the fields depends, or None if there is none.

    fields: names of fields, such as "kd".
    """
    return next((w for w, own in wrt.items() if not set(own).isdisjoint(fields)), None)


def _ruled_out(name: str, scene: Scene, wrt: Wrt) -> str | None:
    """Reason why a setting of the scene switches an effect off, or None if no setting does. Such a setting counts even
    with `everything`.

    name: the effect. wrt: addresses by which derivatives are asked for.
    """
    settings = scene.settings
    if name in ("shadows", "coloured shadows") and not settings.shadows:
        return "settings.shadows is false"
    if name in ("reflection", "refraction", "nested media", "fresnel") and not settings.depth:
        return "settings.depth is 0"
    if name == "absorption" and not settings.depth and not settings.shadows:
        return "settings.depth is 0, and settings.shadows is false"
    if name == "defocus" and isinstance(scene.camera, OrthographicCamera):
        return "an orthographic camera has no lens"
    unlit = not modes.BY_NAME[settings.shading].lit
    if unlit and name not in ON_EVERYWHERE:
        return f"settings.shading is {settings.shading}"
    if name in ("textures", "bilinear") and not scene.textures:
        return "the scene has no textures"
    if name == "environment map" and not isinstance(scene.background, EnvironmentMap):
        return "the background is no environment map"
    # A transparent film leaves the background out of the picture, but a mirror may still reflect it, and it may be the
    # ambient light.
    path_rules = (r for r in RULES if r.name in ("reflection", "refraction", "scatter") and r.possible(scene))
    has_paths = not unlit and any(r.calls(scene) or _first_with_field(r.fields, wrt) for r in path_rules)
    is_ambient = not unlit and background_is_ambient(scene) and settings.occlusion.sky
    if name in ("background", "environment map") and scene.film.transparent and not (has_paths or is_ambient):
        return "film.transparent is true"
    return None


def _feature(rule: Rule, scene: Scene, wrt: Wrt, everything: bool) -> Feature:
    """The Feature that a rule gives for a scene. The rule's `needs` and the argument `without` of `features` are not
    considered here.

    wrt: addresses by which derivatives are asked for.
    everything: whether the effect is simulated although the scene does not need it.
    """
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
    """Effects that a scene needs, and effects that it does not need.

    wrt: addresses by which derivatives are asked for.
    everything: whether effects that contribute 0 are simulated too.
    without: names of effects to leave out although the scene needs them, so that their cost can be measured. Effects
        that refine a left-out effect are left out too.
    """
    asked = {w: _fields_of(w, scene) for w in wrt}
    # The materials in use are found once, not by each rule, since there may be very many objects.
    scene = altered(scene, {"materials": used_materials(scene)})
    largest = max([m.shininess for m in scene.materials.values()], default=0)
    # Rounded up to a multiple of four, so that a small change of a shininess does not change the kernel.
    bits = max(8, 4 * -(-int(largest).bit_length() // 4))
    by_name: dict[str, Feature] = {}
    for rule in RULES:
        feature = _feature(rule, scene, asked, everything)
        if {rule.name, rule.needs} & set(without):
            feature = Feature(rule.name, False, "left out")
        elif feature.on and rule.needs and not by_name[rule.needs].on:
            feature = Feature(rule.name, False, f"without {rule.needs} it changes nothing")
        by_name[rule.name] = feature
    return Features(_without_idle(tuple(by_name.values()), scene), bits)


def _without_idle(listed: tuple[Feature, ...], scene: Scene) -> tuple[Feature, ...]:
    """The effects, without those that would only change or pass on light that no effect brings.

    Their code would add literal zeros in loops, which Dr.Jit cannot trace.
    """
    on = {f.name for f in listed if f.on}
    idle = {}
    if on.isdisjoint(REFLECTED):
        idle |= dict.fromkeys(CHANGING_REFLECTED, "no surface reflects light of a light")
    misses_shine = scene.settings.misses == "ambient" and any(scene.ambient)
    if on.isdisjoint(SOURCES) and not misses_shine:
        idle |= dict.fromkeys(PASSING_ON, "nothing shines")
    return tuple(Feature(f.name, False, idle[f.name]) if f.on and f.name in idle else f for f in listed)
