"""What a scene calls for: the effects that its kernel holds, each with the reason.

An effect is left out only if it is zero for every value that its inputs could have: neither the picture nor a
derivative that was asked for could tell. `everything` forces all of them; the picture is then the same bit for bit
(tests/test_features.py).
"""

from collections.abc import Callable
from dataclasses import dataclass

from visray.materials import Material
from visray.primitives.flat import Flat
from visray.scene.scene import Gradient, Scene


@dataclass(frozen=True)
class Feature:
    """One effect: whether it is simulated, and why."""

    name: str
    on: bool
    reason: str


@dataclass(frozen=True)
class Features:
    """The effects of a render, looked up by name: features["shadows"]. `shininess_bits`: binary digits of exponents."""

    listed: tuple[Feature, ...]
    shininess_bits: int

    def __getitem__(self, name: str) -> bool:
        return next(f.on for f in self.listed if f.name == name)

    def names(self) -> list[str]:
        """The names of those that are on."""
        return [f.name for f in self.listed if f.on]


@dataclass(frozen=True)
class Rule:
    """When an effect is called for: the addresses that call for it, why there may be none, and the fields it is made
    of.

    A derivative by one of `fields` calls for the effect as well: a term that is zero may have a slope.
    """

    name: str
    calls: Callable[[Scene], list[str]]
    absent: str
    fields: tuple[str, ...]


def used_materials(scene: Scene) -> dict[str, Material]:
    """The materials that an object has."""
    used = {o.material for o in scene.objects.values()}
    return {n: m for n, m in ({"default": Material()} | scene.materials).items() if n in used}


def _materials(scene: Scene, test: Callable[[Material], object]) -> list[str]:
    return [f"materials.{n}" for n, m in used_materials(scene).items() if test(m)]


def _lights(scene: Scene, test: Callable) -> list[str]:
    return [f"lights.{n}" for n, l in scene.lights.items() if test(l)]


def _ambient(scene: Scene) -> list[str]:
    glow = any(scene.ambient) or _lights(scene, lambda l: l.intensity and any(l.Ia))
    return _materials(scene, lambda m: any(m.ka)) if glow else []


def _diffuse(scene: Scene) -> list[str]:
    lit = _lights(scene, lambda l: l.intensity and any(l.Id))
    return _materials(scene, lambda m: any(m.kd)) if lit else []


def _specular(scene: Scene) -> list[str]:
    lit = _lights(scene, lambda l: l.intensity and any(l.Is))
    return _materials(scene, lambda m: any(m.ks)) if lit else []


def _background(scene: Scene) -> list[str]:
    sky = scene.background
    colours = (*sky.top, *sky.bottom) if isinstance(sky, Gradient) else sky
    return ["background"] if any(colours) else []


def _shadows(scene: Scene) -> list[str]:
    lone = len(scene.objects) == 1 and isinstance(next(iter(scene.objects.values())), Flat)
    return _lights(scene, lambda l: l.intensity) if scene.objects and not lone else []


RULES = (
    Rule("ambient", _ambient, "no ambient light falls on a material with ka", ("ambient", "ka", "Ia", "intensity")),
    Rule("diffuse", _diffuse, "no light with Id falls on a material with kd", ("kd", "Id", "intensity")),
    Rule("specular", _specular, "no light with Is falls on a material with ks", ("ks", "Is", "intensity", "shininess")),
    Rule("fractional shininess", lambda s: _materials(s, lambda m: any(m.ks) and m.shininess % 1),
         "every shininess is a whole number", ("ks", "shininess")),
    Rule("attenuation", lambda s: _lights(s, lambda l: l.a or l.b or l.c), "no light has a, b or c", ("a", "b", "c")),
    Rule("shadows", _shadows, "nothing can stand between a light and a surface", ("intensity",)),
    Rule("background", _background, "the background is black", ("background",)),
    Rule("coverage", lambda s: ["film.transparent"] if s.film.transparent else [], "the film is opaque: A is 1", ()),
)  # fmt: skip


def _asked(rule: Rule, wrt: tuple[str, ...]) -> str | None:
    """The first address in `wrt` that names one of the rule's fields."""

    def field(address: str) -> str:
        parts = [*address.split("."), "", ""]
        return parts[2] if parts[0] in ("materials", "lights") else parts[0]

    return next((w for w in wrt if field(w) in rule.fields), None)


def _judge(rule: Rule, scene: Scene, wrt: tuple[str, ...], everything: bool) -> Feature:
    # What the scene itself rules out is no effect of it, whoever asks.
    if rule.name == "shadows" and not scene.settings.shadows:
        return Feature(rule.name, False, "settings.shadows is false")
    if rule.name == "background" and scene.film.transparent:
        return Feature(rule.name, False, "film.transparent is true")
    calls, asked = rule.calls(scene), _asked(rule, wrt)
    if calls:
        more = f" and {len(calls) - 1} more" if len(calls) > 1 else ""
        return Feature(rule.name, True, f"called for by {calls[0]}{more}")
    if asked:
        return Feature(rule.name, True, f"a derivative by {asked} is asked for")
    return Feature(rule.name, everything, "forced" if everything else rule.absent)


def features(scene: Scene, wrt: tuple[str, ...] = (), everything: bool = False) -> Features:
    """The effects that the scene calls for; `wrt` are the addresses that derivatives are taken by."""
    most = max([m.shininess for m in used_materials(scene).values()], default=0)
    # A multiple of four, so that a small change of an exponent is a change of data, not of code.
    bits = max(8, 4 * -(-int(most).bit_length() // 4))
    return Features(tuple(_judge(rule, scene, wrt, everything) for rule in RULES), bits)
