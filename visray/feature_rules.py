"""Rules that decide which effects a scene needs, one rule for each effect.

To add an effect, add a rule to RULES, and code to the kernel that asks for features["name of the effect"].

An address is the dotted name of a value in a scene, such as `materials.red`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from visray import modes
from visray.data.all_objects import address_of
from visray.data.rows import ROW_MATERIAL
from visray.environment_map import EnvironmentMap
from visray.filters import SQUARE
from visray.materials import COLORED, Material
from visray.primitives.csg_operands import bodies
from visray.primitives.flat import Flat
from visray.scene.scene import Scene, SkyGradient


@dataclass(frozen=True)
class Rule:
    """Rule that decides whether a scene needs an effect.

    name: name of the effect.
    calls: function that returns a list of the addresses in a scene that need the effect; an empty list means that the
        scene does not need it. The scene must contain only materials that are in use (used_materials).
    absent: reason that is given if the list is empty.
    fields: names of the fields that the effect depends on. A derivative by one of these fields needs the effect too,
        because a term that is 0 may have a derivative that is not 0.
    possible: function that returns whether such a derivative can be other than 0 in a scene.
    needs: name of another effect that this effect refines, or None. Without the other effect, this one is left out.
    """

    name: str
    calls: Callable[[Scene], list[str]]
    absent: str
    fields: tuple[str, ...]
    possible: Callable[[Scene], object] = lambda scene: True
    needs: str | None = None


# Effects that bring light, and effects that only change or pass on the light that others bring. If none of the effects
# that bring light is simulated, those of the second kind contribute nothing.
REFLECTED = ("diffuse", "specular")
SOURCES = ("ambient", *REFLECTED, "unlit", "emission", "visible lights", "background")
CHANGING_REFLECTED = ("attenuation", "shadows", "coloured shadows", "area lights")
PASSING_ON = ("reflection", "refraction", "nested media", "fresnel", "absorption", "scatter")


def used_materials(scene: Scene) -> dict[str, Material]:
    """Materials that at least one object or operand has, on its front or its back, as a dict by name.

    A material that rows of data have in colours is here with the largest numbers that it has in any of them. All are
    here with numbers in `ka` (Material.resolved).
    """
    known = {"default": Material()} | scene.materials
    fronts = {name for obj in scene.representatives.values() for name in scene.materials_of(obj)}
    backs = {m.back for n, m in known.items() if n in fronts}
    materials = {n: m for n, m in known.items() if n in fronts | backs}
    if scene.data is None:
        return {n: m.resolved for n, m in materials.items()}
    layers = [rows for rows in scene.data.rows.values() if len(rows)]
    coloured = [rows for rows in layers if rows.color is not None]
    plain = {name for obj in scene.written_objects.values() for name in scene.materials_of(obj)} | backs
    # The colours of rows change what has the material of the layer, not operands that name one, even the same one.
    gizmos = [x.object(0) if x.color is None else x.object(0).with_fields(material=ROW_MATERIAL) for x in layers]
    plain |= {m for obj in gizmos for m in scene.materials_of(obj)}
    looks = {name: [m.resolved] if name in plain else [] for name, m in materials.items()}
    for rows in coloured:
        looks[rows.material].append(materials[rows.material].with_color(rows.color.max(1)))
    return {name: _largest(looks[name]) for name in materials}


def _largest(looks: list[Material]) -> Material:
    """A material with the largest of the numbers that a colour changes. looks: the same material in several colours"""
    if len(looks) == 1:
        return looks[0]
    largest = {name: tuple(np.max([getattr(m, name) for m in looks], axis=0).tolist()) for name in COLORED}
    return replace(looks[0], **largest)


def _materials(scene: Scene, test: Callable[[Material], object]) -> list[str]:
    """List of the addresses of the materials that pass a test."""
    return [f"materials.{n}" for n, m in scene.materials.items() if test(m)]


def _lit(scene: Scene, test: Callable[[Material], object]) -> list[str]:
    """List of the addresses of the materials that pass a test and show light that falls on them."""
    return _materials(scene, lambda m: not m.unlit and test(m))


def _some_lit(scene: Scene) -> bool:
    """Whether any material shows light that falls on it. A scene without objects counts as if it had one."""
    return not scene.materials or any(not m.unlit for m in scene.materials.values())


def _lights(scene: Scene, test: Callable) -> list[str]:
    """List of the addresses of the lights that pass a test."""
    return [f"lights.{n}" for n, l in scene.lights.items() if test(l)]


# The following functions are the `calls` of the rules. Each returns a list of the addresses that need its effect. A
# material "has" ka, kd, ks, kr or kt, and a light "has" Ia, Id or Is, if one of the three numbers is not 0.
def _ambient(scene: Scene) -> list[str]:
    """Addresses of the materials with ka; empty if there is no ambient light: no `ambient` of the scene, or background
    in its place, and no light with Ia."""
    has_ambient = _ambient_source(scene) or _lights(scene, lambda l: l.intensity and any(l.Ia))
    return _lit(scene, lambda m: any(m.ka)) if has_ambient else []


def _diffuse(scene: Scene) -> list[str]:
    """Addresses of the materials with kd or a texture; empty if no light has Id."""
    lit = _lights(scene, lambda l: l.intensity and any(l.Id))
    return _lit(scene, lambda m: any(m.kd) or m.texture) if lit else []


def _specular(scene: Scene) -> list[str]:
    """Addresses of the materials with ks; empty if no light has Is."""
    lit = _lights(scene, lambda l: l.intensity and any(l.Is))
    return _lit(scene, lambda m: any(m.ks)) if lit else []


def background_is_ambient(scene: Scene) -> bool:
    """Whether sky rays bring the light of the background, in place of the scene's `ambient`."""
    return scene.settings.occlusion.light == "background"


def _ambient_source(scene: Scene) -> list[str]:
    """The address of what brings the scene's ambient light, in a list; empty if that is black."""
    if background_is_ambient(scene):
        return _background(scene)
    return ["ambient"] if any(scene.ambient) else []


def _map(scene: Scene) -> list[str]:
    """The address of the background, in a list; empty if it is no environment map, or a black one."""
    return _background(scene) if isinstance(scene.background, EnvironmentMap) else []


def _background(scene: Scene) -> list[str]:
    """The address of the background, in a list; empty if the background is black."""
    sky = scene.background
    if isinstance(sky, EnvironmentMap):
        return ["background"] if sky.intensity else []
    colours = (*sky.top, *sky.bottom) if isinstance(sky, SkyGradient) else sky
    return ["background"] if any(colours) else []


def _shadows(scene: Scene) -> list[str]:
    """Addresses of the lights whose intensity is not 0; empty if no object can cast a shadow."""
    return _lights(scene, lambda l: l.intensity) if _can_occlude(scene) else []


def _can_occlude(scene: Scene) -> bool:
    """Whether any object can hide a light from a point of a surface. A flat object that is the only object cannot."""
    objects = scene.all_objects
    single_flat = len(objects) == 1 and isinstance(scene.shape_of(next(iter(objects.values()))), Flat)
    return bool(objects) and not single_flat


def _coloured(scene: Scene) -> list[str]:
    """Addresses of the transparent materials; empty if there is no light or no object can cast a shadow.

    Lights of intensity 0 count too: the derivative by the intensity depends on the colour of the shadow.
    """
    return _materials(scene, lambda m: any(m.kt)) if scene.lights and _can_occlude(scene) else []


def _nested(scene: Scene) -> list[str]:
    """Addresses of the transparent objects; empty if they are fewer than two bodies, or if none of them is closed (the
    surface of a solid). A single one has to be known too if other objects may lie in it, and their look depends on the
    medium around them: it absorbs, or they reflect by `fresnel`."""
    transparent = {n for n, m in scene.materials.items() if any(m.kt)}
    objects = scene.objects_of(transparent)
    several = len(objects) > 1 or any(len(bodies("", o, scene.geometries)) > 1 for o in objects.values())
    if not several and len(scene.all_objects) > 1:
        coated = (m for m in scene.materials.values() if m.fresnel == "dielectric" and not any(m.kt))
        several = bool(_absorbing(scene)) or any(coated)
    can_nest = several and any(scene.shape_of(o).closed for o in objects.values())
    return [address_of(n) for n in objects] if can_nest else []


def _absorbing(scene: Scene) -> list[str]:
    """Addresses of the transparent materials with absorption."""
    return _materials(scene, lambda m: any(m.kt) and any(m.absorption))


def _absorption(scene: Scene) -> list[str]:
    """Addresses of the transparent materials with absorption; empty if light neither passes through them nor casts
    coloured shadows."""
    return _absorbing(scene) if scene.settings.depth or (scene.settings.shadows and _coloured(scene)) else []


def _fresnel(scene: Scene) -> list[str]:
    """Addresses of the materials with `fresnel` and with kr or kt; empty if settings.depth is 0."""
    with_shares = _materials(scene, lambda m: m.fresnel != "none" and any((*m.kr, *m.kt)))
    return with_shares if scene.settings.depth else []


def _scatter(scene: Scene) -> list[str]:
    """Addresses of the matte materials; empty if settings.scatter has no rays or a depth of 0."""
    scatter = scene.settings.scatter
    return _materials(scene, lambda m: m.scatters) if scatter.rays and scatter.depth else []


def _sky(scene: Scene) -> list[str]:
    """The address of the number of sky rays, in a list; empty if there are no such rays, if what they bring (the
    scene's `ambient`, or the background) is black, or if no material has ka."""
    occludes = _ambient_source(scene) and scene.settings.occlusion.sky
    return ["settings.occlusion.sky"] if occludes and _lit(scene, lambda m: any(m.ka)) else []


def _near(scene: Scene) -> list[str]:
    """The address of the number of near rays, in a list; empty if there are no such rays, if no light has Ia, or if no
    material has ka."""
    occludes = scene.settings.occlusion.near and _lights(scene, lambda l: l.intensity and any(l.Ia))
    return ["settings.occlusion.near"] if occludes and _lit(scene, lambda m: any(m.ka)) else []


def _bilinear(scene: Scene) -> list[str]:
    """Addresses of the image textures that a material uses and whose filter is bilinear."""
    named = {m.texture for m in scene.materials.values()}
    return [f"textures.{n}" for n, t in scene.textures.items() if n in named and getattr(t, "filter", "") == "bilinear"]


def _with_share(scene: Scene, field: str) -> list[str]:
    """Addresses of the materials that have a field, "kr" or "kt"."""
    return _materials(scene, lambda m: any(getattr(m, field)))


def _if_lit(calls: Callable[[Scene], list[str]]) -> Callable[[Scene], list[str]]:
    """Function of a scene: if its shading mode shows light, it returns what `calls` returns, else an empty list."""
    return lambda scene: calls(scene) if modes.BY_NAME[scene.settings.shading].lit else []


RULES = (
    Rule("ambient", _if_lit(_ambient), "no ambient light falls on a material with ka",
         ("ambient", "ka", "Ia", "intensity", "background"), _some_lit),
    Rule("diffuse", _if_lit(_diffuse), "no light with Id falls on a material with kd", ("kd", "Id", "intensity"),
         _some_lit),
    Rule("specular", _if_lit(_specular), "no light with Is falls on a material with ks",
         ("ks", "Is", "intensity", "shininess"), _some_lit),
    Rule("fractional shininess", _if_lit(lambda s: _lit(s, lambda m: any(m.ks) and m.shininess % 1)),
         "every shininess is a whole number", ("ks", "shininess"), needs="specular"),
    Rule("attenuation", _if_lit(lambda s: _lights(s, lambda l: l.a or l.b or l.c)), "no light has a, b or c",
         ("a", "b", "c")),
    Rule("shadows", _if_lit(_shadows), "no object can occlude a light", ("intensity",)),
    Rule("coloured shadows", _if_lit(_coloured), "no object that casts a shadow is transparent", ("kt", "dmax"),
         needs="shadows"),
    Rule("area lights", _if_lit(lambda s: _lights(s, lambda l: l.has_area and l.intensity)),
         "no light has an area", ()),
    Rule("sky occlusion", _if_lit(_sky), "settings.occlusion.sky is 0, or no ambient light falls on a material with ka",
         ("ambient", "ka", "background"), lambda s: s.settings.occlusion.sky, "ambient"),
    Rule("near occlusion", _if_lit(_near), "settings.occlusion.near is 0, or no Ia falls on a material with ka",
         ("Ia", "ka", "intensity"), lambda s: s.settings.occlusion.near, "ambient"),
    Rule("reflection", _if_lit(lambda s: _with_share(s, "kr")), "no material has kr", ("kr",)),
    Rule("refraction", _if_lit(lambda s: _with_share(s, "kt")), "no material has kt", ("kt",)),
    Rule("nested media", _if_lit(_nested), "no transparent solid is beside another transparent object",
         ("kt", "absorption"), needs="refraction"),
    Rule("fresnel", _if_lit(_fresnel), "no material with kr or kt has fresnel", ("kr", "kt"),
         lambda s: any(m.fresnel != "none" for m in s.materials.values())),
    Rule("absorption", _if_lit(_absorption), "no transparent material has absorption", ("absorption", "kt")),
    Rule("scatter", _if_lit(_scatter), "settings.scatter has no rays, or no material is matte", ("kd",),
         lambda s: s.settings.scatter.rays and s.settings.scatter.depth and _some_lit(s)),
    Rule("unlit", _if_lit(lambda s: _materials(s, lambda m: m.unlit)), "no material is unlit", ()),
    Rule("emission", _if_lit(lambda s: _materials(s, lambda m: any(m.emission))), "no material has emission",
         ("emission",)),
    Rule("visible lights", _if_lit(lambda s: _lights(s, lambda l: l.seen and l.intensity and any(l.Id))),
         "no area light is visible", ("intensity", "Id"), lambda s: _lights(s, lambda l: l.seen)),
    Rule("two-sided", lambda s: _materials(s, lambda m: m.back), "no material has a back", ()),
    Rule("textures", lambda s: _materials(s, lambda m: m.texture), "no material has a texture", ()),
    Rule("bilinear", _bilinear, "no texture blends its pixels", (), needs="textures"),
    Rule("defocus", lambda s: ["camera.aperture"] if s.camera.aperture else [], "camera.aperture is 0",
         ("aperture", "focus")),
    Rule("background", _background, "the background is black", ("background",)),
    Rule("environment map", _map, "the environment map is black", ("background",), needs="background"),
    Rule("filter", lambda s: [] if s.film.filter == SQUARE else ["film.filter"],
         "film.filter is a box of radius 0.5: a pixel is the light on its square", ()),
    Rule("coverage", lambda s: ["film.transparent"] if s.film.transparent else [], "film.transparent is false: A is 1",
         ()),
)  # fmt: skip
