"""Evidence in a picture that light reaches something, or that nothing is seen."""

from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np

from visray.background import blackened
from visray.batches import Batch
from visray.columns import NO_TEXTURE, BackSide, Looks
from visray.environment_map import EnvironmentMap
from visray.feature_rules import used_materials
from visray.geometry import gamma
from visray.materials import Material
from visray.passes import expose, subset
from visray.progress import Interrupts
from visray.pytree import Packets, evaluated
from visray.scene.scene import Scene, SkyGradient
from visray.setup import Prepared

# Below this, every pixel of an 8-bit picture is 0: half a step of sRGB, which is linear there.
NEARLY_BLACK = 0.5 / 255 / 12.92
# Colours are sums of a few rounded products in single precision.
ROUNDING = gamma(64, "single")
# Number of pixels that are looked at first, before all of them.
FIRST_PIXELS = 1024
# At most this many pixels are looked at. More would take as much memory as the picture itself.
MOST_PIXELS = 2**20
# Share of the pixels that are dark in a picture that may be unlit.
DARK_SHARE = 1 / 64


def _sky(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """The background at the bottom and at the top of the sky. Domain: no environment map."""
    sky = scene.background
    ends = (sky.bottom, sky.top) if isinstance(sky, SkyGradient) else (sky, sky)
    return tuple(np.zeros(3) if scene.film.transparent else np.array(c, float) for c in ends)


def _shows_map(scene: Scene) -> bool:
    """Whether the film shows an environment map where there is no object."""
    return isinstance(scene.background, EnvironmentMap) and not scene.film.transparent


def shows_only_background(prepared: Prepared, rgb: np.ndarray, coverage: np.ndarray | None = None) -> bool:
    """Whether all colours of a picture may be those of the background. It is False for nearly all other pictures.

    coverage: coverage of the pixels; None if it does not matter

    What shows a whole environment map may show anything, so there only coverage counts.
    """
    if coverage is not None and not coverage.any():
        return True
    if _shows_map(prepared.scene):
        return False
    bottom, top = _sky(prepared.scene)
    across, error = top - bottom, 4 * ROUNDING * max(bottom.max(), top.max())
    for colours in (rgb[:, :: max(1, rgb.shape[1] // FIRST_PIXELS)], rgb):
        share = across @ (colours - bottom[:, None]) / max(across @ across, 1e-300)
        nearest = bottom[:, None] + across[:, None] * np.clip(share, 0, 1)
        if (np.abs(colours - nearest) > error).any():
            return False
    return True


def may_be_unlit(prepared: Prepared, rgb: np.ndarray) -> bool:
    """Whether the colours leave it open that no light of a light is seen.

    Without such light, matte surfaces show at most their ambient light. So a picture with few pixels that are so dark
    is not unlit. Without mirrors, glass and textures, a pixel is then a mixture of the background, black, and the
    materials' ambient light. So no colour, and no difference of two colours, is larger than in all of these. An unlit
    material shows kd in place of its ambient light, and emission is added to both.
    """
    scene, on = prepared.scene, prepared.features
    rgb = rgb[:, :: max(1, rgb.shape[1] // (64 * FIRST_PIXELS))]
    ambient = np.array(scene.ambient) + sum((l.intensity * np.array(l.Ia) for l in scene.lights.values()), np.zeros(3))
    materials = used_materials(scene).values()
    # Of textures and of colours of data, only the largest numbers are known.
    if any(m.unlit and m.texture for m in materials) or any(
        rows.color is not None for rows in (scene.data.rows.values() if scene.data is not None else ())
    ):
        return True
    colours = [(np.array(m.kd) if m.unlit else ambient * m.ka) + m.emission for m in materials]
    colours += [l.intensity * np.array(l.Id) for l in scene.lights.values() if l.seen]
    brightest = (1 + ROUNDING) * max(np.max(colours, initial=0), NEARLY_BLACK)
    if (rgb.max(0) <= brightest).mean() < DARK_SHARE:
        return False
    if on["paths"] or on["textures"] or _shows_map(scene):
        return True
    corners = np.stack([np.zeros(3), *_sky(scene), *colours], 1)
    farthest = _largest(corners) + max(4 * ROUNDING * corners.max(), NEARLY_BLACK)
    return not (_largest(rgb) > farthest).any()


def _largest(rgb: np.ndarray) -> np.ndarray:
    """The largest red, green and blue, and the largest differences of two of them. Shapes: rgb (3, N); result (9)."""
    differences = [(x - y).max() for x in rgb for y in rgb if x is not y]
    return np.array([*rgb.max(1), *differences])


def is_lit(prepared: Prepared, interrupts: Interrupts | None = None) -> bool:
    """Whether light of a light is seen anywhere, by samples of the same kernel without ambient light and background,
    and with black unlit surfaces, emission and visible lights.

    A few pixels are looked at first, and then all, or MOST_PIXELS of them. After Ctrl-C, the answer is that there is
    some.
    """
    s, scene = prepared.kernel, prepared.scene
    scene, interrupts = replace(scene, settings=replace(scene.settings, spp=1)), interrupts or Interrupts()
    black = lambda colour: dr.opaque(type(colour), 0, dr.width(colour))  # noqa: E731 - a colour of the same kind
    lamps = tuple(replace(lamp, colour=black(lamp.colour)) for lamp in s.visible_lights)
    dark = replace(s, ambient=black(s.ambient), lights_ambient=black(s.lights_ambient), sky=blackened(s.sky))
    dark = replace(dark, visible_lights=lamps)
    if prepared.features["unlit"] or prepared.features["emission"]:
        dark = replace(dark, geometry=s.geometry.with_looks(tuple(_without_own_light(batch) for batch in s.batches)))
    n = len(prepared.order)
    for step in sorted({max(1, n // FIRST_PIXELS), max(1, n // MOST_PIXELS)}, reverse=True):
        pixels = subset(prepared, np.arange(0, n, step))
        dr.eval(pixels.x, pixels.y)
        film, _ = expose(replace(pixels, kernel=dark, scene=scene), interrupts=interrupts)
        if interrupts.requested or np.array(film.mean).max() > NEARLY_BLACK:
            return True
    return False


def _without_own_light(batch: Batch) -> Batch:
    """The batch with black materials in place of unlit ones, and without emission."""
    sides = _with_black_sides(batch)
    tables = sides["material"], sides["back"] and sides["back"].material
    packets = batch.packets and Packets.of(batch.packets.four, tables)
    looks = batch.looks and replace(batch.looks, **_with_black_sides(batch.looks))
    return evaluated(replace(batch, packets=packets, looks=looks, **sides))


def _with_black_sides(shown: Batch | Looks) -> dict[str, Any]:
    """The fields `material`, `texture` and `back` of a batch or of looks, as a dict, with black in place of unlit
    materials, and without emission."""
    back = shown.back and BackSide(*_without_light(shown.back.material, shown.back.texture))
    material, texture = _without_light(shown.material, shown.texture)
    return {"material": material, "texture": texture, "back": back}


def _without_light(m: Material, texture: Any) -> tuple[Material, Any]:
    """Materials and their textures, without emission, and with black ones without texture in place of unlit ones."""
    if m.emission is not None:
        m = replace(m, emission=dr.opaque(type(m.emission), 0, dr.width(m.emission)))
    if m.shading is None:
        return m, texture
    unlit = m.shading > 0
    return replace(m, kd=dr.select(unlit, 0, m.kd)), dr.select(unlit, NO_TEXTURE, texture)
