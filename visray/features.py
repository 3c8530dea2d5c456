"""Features: the effects that a scene needs and its kernel therefore simulates, each with the reason.

An effect is left out only if it contributes exactly 0 to the picture and to every derivative that is asked for. With
`everything` no effect is left out, and the picture is the same bit for bit.
Error: none (tests/test_features.py).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from visray import modes
from visray.materials import Material
from visray.primitives.flat import Flat
from visray.scene.scene import Scene, SkyGradient


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

    listed: every effect.
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


@dataclass(frozen=True)
class Rule:
    """Rule that decides whether a scene needs an effect. The scene must hold only materials that are in use
    (used_materials).

    name: the effect.
    calls: addresses in a scene that need the effect; empty if there are none.
    absent: reason that is given where there are none.
    fields: fields that the effect depends on. A derivative by one of them needs the effect too: a term that is 0 may
    have a derivative that is not.
    possible: whether such a derivative can be other than 0 in a scene.
    needs: the effect that this one only refines, if any.
    """

    name: str
    calls: Callable[[Scene], list[str]]
    absent: str
    fields: tuple[str, ...]
    possible: Callable[[Scene], object] = lambda scene: True
    needs: str | None = None


def used_materials(scene: Scene) -> dict[str, Material]:
    """Materials that at least one object has, by name."""
    used = {o.material for o in scene.objects.values()}
    return {n: m for n, m in ({"default": Material()} | scene.materials).items() if n in used}


def _materials(scene: Scene, test: Callable[[Material], object]) -> list[str]:
    """Addresses of the materials that pass a test."""
    return [f"materials.{n}" for n, m in scene.materials.items() if test(m)]


def _lights(scene: Scene, test: Callable) -> list[str]:
    """Addresses of the lights that pass a test."""
    return [f"lights.{n}" for n, l in scene.lights.items() if test(l)]


# Functions `calls` of the rules: the addresses that need an effect.
def _ambient(scene: Scene) -> list[str]:
    """Materials with ka, where there is ambient light."""
    has_ambient = any(scene.ambient) or _lights(scene, lambda l: l.intensity and any(l.Ia))
    return _materials(scene, lambda m: any(m.ka)) if has_ambient else []


def _diffuse(scene: Scene) -> list[str]:
    """Materials with kd or a texture, where a light has Id."""
    lit = _lights(scene, lambda l: l.intensity and any(l.Id))
    return _materials(scene, lambda m: any(m.kd) or m.texture) if lit else []


def _specular(scene: Scene) -> list[str]:
    """Materials with ks, where a light has Is."""
    lit = _lights(scene, lambda l: l.intensity and any(l.Is))
    return _materials(scene, lambda m: any(m.ks)) if lit else []


def _background(scene: Scene) -> list[str]:
    """The background, unless it is black."""
    sky = scene.background
    colours = (*sky.top, *sky.bottom) if isinstance(sky, SkyGradient) else sky
    return ["background"] if any(colours) else []


def _shadows(scene: Scene) -> list[str]:
    """Lights, where an object can cast a shadow."""
    return _lights(scene, lambda l: l.intensity) if _can_occlude(scene) else []


def _can_occlude(scene: Scene) -> bool:
    """Whether an object can occlude a light from a surface. A single flat object cannot."""
    single_flat = len(scene.objects) == 1 and isinstance(next(iter(scene.objects.values())), Flat)
    return bool(scene.objects) and not single_flat


def _coloured(scene: Scene) -> list[str]:
    """Transparent materials, where they can cast a shadow.

    The lights' intensity does not matter: also with intensity 0, the derivative by it depends on the shadow's colour.
    """
    return _materials(scene, lambda m: any(m.kt)) if scene.lights and _can_occlude(scene) else []


def _nested(scene: Scene) -> list[str]:
    """Transparent objects, where there are at least two and one of them is closed."""
    transparent = {n for n, m in scene.materials.items() if any(m.kt)}
    objects = {n: o for n, o in scene.objects.items() if o.material in transparent} if transparent else {}
    can_nest = len(objects) > 1 and any(o.closed for o in objects.values())
    return [f"objects.{n}" for n in objects] if can_nest else []


def _scatter(scene: Scene) -> list[str]:
    """Matte materials, where settings.scatter is on."""
    scatter = scene.settings.scatter
    return _materials(scene, _matte) if scatter.rays and scatter.depth else []


def _matte(m: Material) -> bool:
    """Whether a material reflects diffusely, and neither mirrors nor transmits."""
    return not any((*m.kr, *m.kt)) and (any(m.kd) or m.texture is not None)


def _sky(scene: Scene) -> list[str]:
    """The setting of sky occlusion, where it can weaken the scene's ambient light."""
    occludes = any(scene.ambient) and scene.settings.occlusion.sky
    return ["settings.occlusion.sky"] if occludes and _materials(scene, lambda m: any(m.ka)) else []


def _near(scene: Scene) -> list[str]:
    """The setting of near occlusion, where it can weaken a light's Ia."""
    occludes = scene.settings.occlusion.near and _lights(scene, lambda l: l.intensity and any(l.Ia))
    return ["settings.occlusion.near"] if occludes and _materials(scene, lambda m: any(m.ka)) else []


def _bilinear(scene: Scene) -> list[str]:
    """Textures in use that blend pixels."""
    named = {m.texture for m in scene.materials.values()}
    return [f"textures.{n}" for n, t in scene.textures.items() if n in named and getattr(t, "filter", "") == "bilinear"]


def _paths(scene: Scene) -> list[str]:
    """Materials that continue a path: by reflection, refraction or scatter."""
    return [*_with_share(scene, "kr"), *_with_share(scene, "kt"), *_scatter(scene)]


def _with_share(scene: Scene, field: str) -> list[str]:
    """Materials whose kr, or whose kt, is not 0."""
    return _materials(scene, lambda m: any(getattr(m, field)))


def _if_lit(calls: Callable[[Scene], list[str]]) -> Callable[[Scene], list[str]]:
    """`calls` of an effect that only shading modes with light can show."""
    return lambda scene: calls(scene) if modes.BY_NAME[scene.settings.shading].lit else []


RULES = (
    Rule("ambient", _if_lit(_ambient), "no ambient light falls on a material with ka",
         ("ambient", "ka", "Ia", "intensity")),
    Rule("diffuse", _if_lit(_diffuse), "no light with Id falls on a material with kd", ("kd", "Id", "intensity")),
    Rule("specular", _if_lit(_specular), "no light with Is falls on a material with ks",
         ("ks", "Is", "intensity", "shininess")),
    Rule("fractional shininess", _if_lit(lambda s: _materials(s, lambda m: any(m.ks) and m.shininess % 1)),
         "every shininess is a whole number", ("ks", "shininess"), needs="specular"),
    Rule("attenuation", _if_lit(lambda s: _lights(s, lambda l: l.a or l.b or l.c)), "no light has a, b or c",
         ("a", "b", "c")),
    Rule("shadows", _if_lit(_shadows), "nothing can stand between a light and a surface", ("intensity",)),
    Rule("coloured shadows", _if_lit(_coloured), "nothing that throws a shadow lets light through", ("kt", "dmax"),
         needs="shadows"),
    Rule("area lights", _if_lit(lambda s: _lights(s, lambda l: l.has_area and l.intensity)),
         "every light is a point or far", ()),
    Rule("sky occlusion", _if_lit(_sky), "settings.occlusion.sky is 0, or no ambient light falls on a material with ka",
         ("ambient", "ka"), lambda s: s.settings.occlusion.sky, "ambient"),
    Rule("near occlusion", _if_lit(_near), "settings.occlusion.near is 0, or no Ia falls on a material with ka",
         ("Ia", "ka", "intensity"), lambda s: s.settings.occlusion.near, "ambient"),
    Rule("reflection", _if_lit(lambda s: _with_share(s, "kr")), "no material has kr", ("kr",)),
    Rule("refraction", _if_lit(lambda s: _with_share(s, "kt")), "no material has kt", ("kt",)),
    Rule("nested media", _if_lit(_nested), "no transparent solid is beside another transparent object", ("kt",),
         needs="refraction"),
    Rule("scatter", _if_lit(_scatter), "settings.scatter has no rays, or no material is matte", ("kd",),
         lambda s: s.settings.scatter.rays and s.settings.scatter.depth),
    Rule("textures", lambda s: _materials(s, lambda m: m.texture), "no material has a texture", ()),
    Rule("bilinear", _bilinear, "no texture blends its pixels", (), needs="textures"),
    Rule("defocus", lambda s: ["camera.aperture"] if s.camera.aperture else [], "camera.aperture is 0",
         ("aperture", "focus")),
    Rule("background", _background, "the background is black", ("background",)),
    Rule("coverage", lambda s: ["film.transparent"] if s.film.transparent else [], "the film is opaque: A is 1", ()),
)  # fmt: skip


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
    has_paths = (_paths(scene) or any(_first_with_field(r.fields, wrt) for r in path_rules)) and not unlit
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
        return Feature(rule.name, True, f"called for by {calls[0]}{more}")
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
