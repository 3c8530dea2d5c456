"""What visray says about the materials of a scene: glass on open surfaces, colours written as those of a screen,
and more light than arrives."""

import numpy as np

from visray import modes
from visray.colors import hexadecimal, looks_like_bytes
from visray.data.all_objects import address_of
from visray.feature_rules import used_materials
from visray.features import Features
from visray.geometry import gamma
from visray.materials import Material
from visray.operands import named_operands
from visray.primitives.primitive import Primitive
from visray.scene.scene import Scene, SkyGradient
from visray.textures import CheckerTexture
from visray.warn import warn

# Sums with ks up to this one are usual: a highlight of Blinn-Phong is small, and added to kd. White paper (kd 0.8) with
# strong highlights (ks 0.5) has 1.3, and the fitted key light (0.75, fitting.py) makes that less than 1.
HIGHLIGHTS = 1.5
# Sums without ks up to this one are not told of, such as that of a pale paint (kd 0.91) that mirrors a little (kr 0.1):
# in a picture, 5 % more light than white are 6 of 255 steps.
SURPLUS = 1.05


class MaterialWarning(UserWarning):
    """Warning about a material that does not do what it seems to say."""


def warn_of_materials(scene: Scene, effects: Features) -> None:
    """Warns of glass on open surfaces, and of colours of a screen. Each is shown once. effects: those that are
    simulated."""
    for text in (*sheet_notes(scene, effects), *color_notes(scene)):
        warn(text, MaterialWarning)


def sheet_notes(scene: Scene, effects: Features) -> list[str]:
    """A list with a sentence for each material that should bend light, on open surfaces, which bend none. It names the
    first of these objects. An index of refraction of 1 says that no bending is meant."""
    if not effects["refraction"]:
        return []
    bending = {name for name, m in used_materials(scene).items() if any(m.kt) and m.ior != 1}
    sheets: dict[tuple, list[str]] = {}
    for name, obj in scene.representatives.items() if bending else ():
        material = scene.materials_of(obj)[0]
        if material in bending and not (shape := scene.shape_of(obj)).closed:
            shape = _open_part(shape)
            sheets.setdefault((material, shape.type, shape.advice_for_solid()), []).append(name)
    return [_of_sheets(scene, *key, names) for key, names in sheets.items()]


def _open_part(shape: Primitive) -> Primitive:
    """The part of an open shape that makes it open. CSG is open if its `ends` are, or because of its first operand."""
    while shape.composite and shape.ends == "capped":
        shape = next(iter(named_operands(shape.of).values()))
    return shape


def _of_sheets(scene: Scene, material: str, kind: str, advice: str, names: list[str]) -> str:
    """The sentence about objects of one material and one kind."""
    more = f" and {len(names) - 1} more" if len(names) > 1 else ""
    m = used_materials(scene)[material]
    text = (
        f"{address_of(names[0])}{more}: a {kind} that is open bends no light, although materials.{material} has kt and "
        f"the ior {m.ior:g}; "
    )
    if m.fresnel == "dielectric":
        return f"{text}it is a thin pane; {advice} if light shall be bent"
    return f"{text}{advice}, or write the ior 1 if light shall go straight through"


def color_notes(scene: Scene) -> list[str]:
    """A list with a sentence for each colour of a material, a checker or the surroundings that is so large that numbers
    from 0 to 255 must be meant. Light may be so bright: lights and emission are left out."""
    holders = {f"materials.{name}": (m, ("ka", "kd", "ks")) for name, m in scene.materials.items()}
    textures = scene.textures.items()
    holders |= {f"textures.{name}": (t, ("a", "b")) for name, t in textures if isinstance(t, CheckerTexture)}
    sky = scene.background
    if isinstance(sky, SkyGradient):
        holders["background"] = sky, ("top", "bottom")
    found = {f"{owner}.{name}": getattr(x, name) for owner, (x, names) in holders.items() for name in names}
    found |= {name: getattr(scene, name) for name in ("background", "ambient")}
    return [
        f"{address} = [{', '.join(f'{x:g}' for x in color)}]: is up to {max(color):g} times as bright as white; "
        f'a colour of a screen, whose numbers go to 255, is written "{hexadecimal(color)}"'
        for address, color in found.items()
        if isinstance(color, tuple) and looks_like_bytes(color)
    ]


def energy_notes(scene: Scene) -> list[str]:
    """A list with a sentence for each sum of shares above SURPLUS, or with ks above HIGHLIGHTS. It names the first of
    its materials."""
    if not modes.BY_NAME[scene.settings.shading].lit:
        return []
    names: dict[str, list[str]] = {}
    for name, m in used_materials(scene).items():
        if text := _surplus(scene, m):
            names.setdefault(text, []).append(f"materials.{name}")
    more = {text: f" and {len(of) - 1} more" if len(of) > 1 else "" for text, of in names.items()}
    return [f"{of[0]}{more[text]}: {text}" for text, of in names.items()]


def _surplus(scene: Scene, m: Material) -> str | None:
    """What is said about one material; None if its shares are usual."""
    passes_on, weighted = scene.settings.depth > 0, scene.settings.local == "weighted"
    kr, kt = (np.array(x if passes_on else (0, 0, 0), float) for x in (m.kr, m.kt))
    kd, ks, weight = _diffuse(scene, m), np.array(m.ks, float), 1 - kt if weighted else 1
    if m.unlit:  # what it shows is no light that it gets
        kd, ks = 0 * kd, 0 * ks
    if passes_on and m.fresnel == "dielectric":
        # A share F of the light goes by kr, and 1 - F by the others; with settings.local "full", kd and ks come on top.
        kr, kt = (0 * kr, kt) if weighted else (np.maximum(kr, kt), 0 * kt)
    if passes_on and m.fresnel == "metal" and not weighted:
        kr = np.ones(3)  # at grazing angles
    total = kr + kt + weight * (kd + ks)
    # The sum has at most six roundings.
    more_leaves = (kr + kt + weight * kd > SURPLUS * (1 + gamma(6))).any()
    if not more_leaves and (total <= HIGHLIGHTS * (1 + gamma(6))).all():
        return None
    own = [name for name, x in (("kd", kd), ("ks", ks)) if x.any()]
    inner = " + ".join(own)
    if kt.any() and weighted and own:
        inner = f"(1 - kt) ({inner})" if len(own) > 1 else f"(1 - kt) {inner}"
    written = [name for name, x in (("kr", kr), ("kt", kt)) if x.any()] + [inner] * bool(own)
    if more_leaves:
        meaning = "more light leaves it than arrives"
    else:
        meaning = "its highlights are brighter than the light that makes them"
    keeps = m.kd == Material().kd and m.texture is None and (kr.any() or kt.any())
    hint = "; kd is 0.7 unless it is written, and a mirror or glass has about 0" if keeps else ""
    return f"{' + '.join(written)} = {total.max():.4g} is above 1: {meaning}{hint}"


def _diffuse(scene: Scene, m: Material) -> np.ndarray:
    """The largest diffuse colour of a material; 0 if an image says what it is."""
    if m.texture is None:
        return np.array(m.kd, float)
    texture = scene.textures[m.texture]
    return np.maximum(texture.a, texture.b) if isinstance(texture, CheckerTexture) else np.zeros(3)
