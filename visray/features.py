"""What a scene calls for: the effects that its kernel holds, each with the reason.

An effect is left out only if it is zero for every value that its inputs could have: neither the picture nor a
derivative that was asked for could tell. `everything` forces all of them; the picture is then the same bit for bit
(tests/test_features.py).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from visray import modes
from visray.materials import Material
from visray.primitives.flat import Flat
from visray.scene.scene import Scene, SkyGradient


@dataclass(frozen=True)
class Feature:
    """One effect: whether it is simulated, and why."""

    name: str
    on: bool
    reason: str


@dataclass(frozen=True)
class RayFamily:
    """Rays that find rows in one way: which they are, what finds the rows, and why."""

    rays: str
    accelerator: str
    reason: str


@dataclass(frozen=True)
class Features:
    """The effects of a render, looked up by name: features["shadows"].

    listed: all of them. shininess_bits: binary digits of exponents. rays: how rays find what they hit, where that is
    asked for.
    """

    listed: tuple[Feature, ...]
    shininess_bits: int
    rays: tuple[RayFamily, ...] = ()

    def __getitem__(self, name: str) -> bool:
        """Whether an effect is simulated; `paths`: any of those by which light comes from other surfaces."""
        if name == "paths":
            return any(self[way] for way in ("reflection", "refraction", "scatter"))
        return next(f.on for f in self.listed if f.name == name)

    def names(self) -> list[str]:
        """The names of those that are on."""
        return [f.name for f in self.listed if f.on]


@dataclass(frozen=True)
class Rule:
    """When an effect is called for: the addresses that call for it, why there may be none, and the fields it is made
    of. The scene that a rule is asked of has only the materials that are used (used_materials).

    A derivative by one of `fields` calls for the effect as well, a term that is zero may have a slope; but not where it
    is not `possible`. `needs`: the effect that this one only refines.
    """

    name: str
    calls: Callable[[Scene], list[str]]
    absent: str
    fields: tuple[str, ...]
    possible: Callable[[Scene], object] = lambda scene: True
    needs: str | None = None


def used_materials(scene: Scene) -> dict[str, Material]:
    """The materials that an object has."""
    used = {o.material for o in scene.objects.values()}
    return {n: m for n, m in ({"default": Material()} | scene.materials).items() if n in used}


def _materials(scene: Scene, test: Callable[[Material], object]) -> list[str]:
    return [f"materials.{n}" for n, m in scene.materials.items() if test(m)]


def _lights(scene: Scene, test: Callable) -> list[str]:
    return [f"lights.{n}" for n, l in scene.lights.items() if test(l)]


def _ambient(scene: Scene) -> list[str]:
    glow = any(scene.ambient) or _lights(scene, lambda l: l.intensity and any(l.Ia))
    return _materials(scene, lambda m: any(m.ka)) if glow else []


def _diffuse(scene: Scene) -> list[str]:
    lit = _lights(scene, lambda l: l.intensity and any(l.Id))
    return _materials(scene, lambda m: any(m.kd) or m.texture) if lit else []


def _specular(scene: Scene) -> list[str]:
    lit = _lights(scene, lambda l: l.intensity and any(l.Is))
    return _materials(scene, lambda m: any(m.ks)) if lit else []


def _background(scene: Scene) -> list[str]:
    sky = scene.background
    colours = (*sky.top, *sky.bottom) if isinstance(sky, SkyGradient) else sky
    return ["background"] if any(colours) else []


def _shadows(scene: Scene) -> list[str]:
    return _lights(scene, lambda l: l.intensity) if _in_the_way(scene) else []


def _in_the_way(scene: Scene) -> bool:
    """Whether an object can stand between a light and a surface: one flat thing cannot."""
    lone = len(scene.objects) == 1 and isinstance(next(iter(scene.objects.values())), Flat)
    return bool(scene.objects) and not lone


def _lets_through(scene: Scene) -> list[str]:
    return _materials(scene, lambda m: any(m.kt))


def _coloured(scene: Scene) -> list[str]:
    """Without a look at how bright the lights are: a light of intensity 0 has a slope, and its shadow a colour."""
    return _lets_through(scene) if scene.lights and _in_the_way(scene) else []


def _nested(scene: Scene) -> list[str]:
    """Transparent things, where there are two or more and a solid among them."""
    through = {n for n, m in scene.materials.items() if any(m.kt)}
    clear = {n: o for n, o in scene.objects.items() if o.material in through} if through else {}
    nested = len(clear) > 1 and any(o.closed for o in clear.values())
    return [f"objects.{n}" for n in clear] if nested else []


def _scatter(scene: Scene) -> list[str]:
    scatter = scene.settings.scatter
    return _materials(scene, _matte) if scatter.rays and scatter.depth else []


def _matte(m: Material) -> bool:
    return not any((*m.kr, *m.kt)) and (any(m.kd) or m.texture is not None)


def _sky(scene: Scene) -> list[str]:
    dim = any(scene.ambient) and scene.settings.occlusion.sky
    return ["settings.occlusion.sky"] if dim and _materials(scene, lambda m: any(m.ka)) else []


def _near(scene: Scene) -> list[str]:
    dim = scene.settings.occlusion.near and _lights(scene, lambda l: l.intensity and any(l.Ia))
    return ["settings.occlusion.near"] if dim and _materials(scene, lambda m: any(m.ka)) else []


def _bilinear(scene: Scene) -> list[str]:
    named = {m.texture for m in scene.materials.values()}
    return [f"textures.{n}" for n, t in scene.textures.items() if n in named and getattr(t, "filter", "") == "bilinear"]


def _paths(scene: Scene) -> list[str]:
    return [*_mirrors(scene, "kr"), *_mirrors(scene, "kt"), *_scatter(scene)]


def _mirrors(scene: Scene, field: str) -> list[str]:
    return _materials(scene, lambda m: any(getattr(m, field)))


def _seen(rule: Callable[[Scene], list[str]]) -> Callable[[Scene], list[str]]:
    """The rule, where surfaces show their light at all."""
    return lambda scene: rule(scene) if modes.BY_NAME[scene.settings.shading].lit else []


RULES = (
    Rule("ambient", _seen(_ambient), "no ambient light falls on a material with ka",
         ("ambient", "ka", "Ia", "intensity")),
    Rule("diffuse", _seen(_diffuse), "no light with Id falls on a material with kd", ("kd", "Id", "intensity")),
    Rule("specular", _seen(_specular), "no light with Is falls on a material with ks",
         ("ks", "Is", "intensity", "shininess")),
    Rule("fractional shininess", _seen(lambda s: _materials(s, lambda m: any(m.ks) and m.shininess % 1)),
         "every shininess is a whole number", ("ks", "shininess"), needs="specular"),
    Rule("attenuation", _seen(lambda s: _lights(s, lambda l: l.a or l.b or l.c)), "no light has a, b or c",
         ("a", "b", "c")),
    Rule("shadows", _seen(_shadows), "nothing can stand between a light and a surface", ("intensity",)),
    Rule("coloured shadows", _seen(_coloured), "nothing that throws a shadow lets light through", ("kt", "dmax"),
         needs="shadows"),
    Rule("area lights", _seen(lambda s: _lights(s, lambda l: l.has_area and l.intensity)),
         "every light is a point or far", ()),
    Rule("sky occlusion", _seen(_sky), "settings.occlusion.sky is 0, or no ambient light falls on a material with ka",
         ("ambient", "ka"), lambda s: s.settings.occlusion.sky, "ambient"),
    Rule("near occlusion", _seen(_near), "settings.occlusion.near is 0, or no Ia falls on a material with ka",
         ("Ia", "ka", "intensity"), lambda s: s.settings.occlusion.near, "ambient"),
    Rule("reflection", _seen(lambda s: _mirrors(s, "kr")), "no material has kr", ("kr",)),
    Rule("refraction", _seen(lambda s: _mirrors(s, "kt")), "no material has kt", ("kt",)),
    Rule("nested media", _seen(_nested), "no transparent solid is beside another transparent thing", ("kt",),
         needs="refraction"),
    Rule("scatter", _seen(_scatter), "settings.scatter has no rays, or no material is matte", ("kd",),
         lambda s: s.settings.scatter.rays and s.settings.scatter.depth),
    Rule("textures", lambda s: _materials(s, lambda m: m.texture), "no material has a texture", ()),
    Rule("bilinear", _bilinear, "no texture blends its pixels", (), needs="textures"),
    Rule("defocus", lambda s: ["camera.aperture"] if s.camera.aperture else [], "camera.aperture is 0",
         ("aperture", "focus")),
    Rule("background", _background, "the background is black", ("background",)),
    Rule("coverage", lambda s: ["film.transparent"] if s.film.transparent else [], "the film is opaque: A is 1", ()),
)  # fmt: skip


def _asked(fields: tuple[str, ...], wrt: tuple[str, ...]) -> str | None:
    """The first address in `wrt` that names one of the fields."""

    def field(address: str) -> str:
        parts = [*address.split("."), "", ""]
        return parts[{"materials": 2, "lights": 2, "camera": 1}.get(parts[0], 0)]

    return next((w for w in wrt if field(w) in fields), None)


def _ruled_out(name: str, scene: Scene, wrt: tuple[str, ...]) -> str | None:
    """Why the scene itself rules an effect out, whoever asks."""
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
    # What a transparent film leaves out may still be seen in a mirror.
    ways = (r for r in RULES if r.name in ("reflection", "refraction", "scatter") and r.possible(scene))
    mirrored = (_paths(scene) or any(_asked(r.fields, wrt) for r in ways)) and not unlit
    if name == "background" and scene.film.transparent and not mirrored:
        return "film.transparent is true"
    return None


def _judge(rule: Rule, scene: Scene, wrt: tuple[str, ...], everything: bool) -> Feature:
    never = _ruled_out(rule.name, scene, wrt)
    if never:
        return Feature(rule.name, False, never)
    calls, asked = rule.calls(scene), _asked(rule.fields, wrt) if rule.possible(scene) else None
    if calls:
        more = f" and {len(calls) - 1} more" if len(calls) > 1 else ""
        return Feature(rule.name, True, f"called for by {calls[0]}{more}")
    if asked:
        return Feature(rule.name, True, f"a derivative by {asked} is asked for")
    return Feature(rule.name, everything, "forced" if everything else rule.absent)


def features(
    scene: Scene, wrt: tuple[str, ...] = (), everything: bool = False, without: tuple[str, ...] = ()
) -> Features:
    """The effects that the scene calls for; `wrt` are the addresses that derivatives are taken by.

    `without`: effects that are left out although called for, with those that need them, to find what each costs.
    """
    # Once, as there may be very many objects.
    scene = replace(scene, materials=used_materials(scene))
    most = max([m.shininess for m in scene.materials.values()], default=0)
    # A multiple of four, so that a small change of an exponent is a change of data, not of code.
    bits = max(8, 4 * -(-int(most).bit_length() // 4))
    found: dict[str, Feature] = {}
    for rule in RULES:
        f = _judge(rule, scene, wrt, everything)
        if {rule.name, rule.needs} & set(without):
            f = Feature(rule.name, False, "left out")
        elif f.on and rule.needs and not found[rule.needs].on:
            f = Feature(rule.name, False, f"without {rule.needs} it changes nothing")
        found[rule.name] = f
    return Features(tuple(found.values()), bits)
