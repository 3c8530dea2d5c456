"""How bright light can be that no sample of a picture may have met.

Small objects that the camera sees are known from the scene (small_objects.py). Other small and bright things are not:
a lamp in a mirror or behind glass, a highlight, light through a pinhole, the cone of a narrow spot light, a bright
pixel of a texture. Of these, the scene says how bright they can be. A brightness here is the root mean square of red,
green and blue.
"""

from dataclasses import dataclass

import drjit as dr
import numpy as np

from visray import modes
from visray.adaptive.small_objects import SMALL
from visray.camera import ParallelView
from visray.environment_map import EnvironmentMap
from visray.feature_rules import used_materials
from visray.geometry import gamma
from visray.lights.light import Light
from visray.materials import Material
from visray.scene.scene import SkyGradient
from visray.setup import Prepared
from visray.textures import CheckerTexture


@dataclass(frozen=True)
class Brightness:
    """Upper bounds of brightness in a scene.

    objects: brightness of each material, as a dict by its name: of its surfaces, with all that they mirror, seen from
        any side.
    hidden: brightness of light that may fall on a small part of what the camera sees, wherever that is.
    cause: what is so bright, as part of a sentence.
    """

    objects: dict[str, float]
    hidden: float
    cause: str

    @staticmethod
    def of(prepared: Prepared) -> "Brightness":
        """The bounds for a scene.

        Light of several lights is not added up, because it is rare that all of them meet in one small thing. A light
        that is inside the box of an object shines on it as from the nearest other object.
        """
        scene = prepared.scene
        materials = used_materials(scene)
        if not modes.BY_NAME[scene.settings.shading].lit or not materials:
            return Brightness(dict.fromkeys(materials, 1.0), 0.0, "")
        textures = _brightest_texels(prepared)
        colours = {name: textures.get(m.texture, np.array(m.kd)) for name, m in materials.items()}
        lights = {name: (light, _most_attenuation(prepared, light)) for name, light in scene.lights.items()}
        lit = {
            (name, key): rms(_reflected(light, m, colours[key]) * weight)
            for name, (light, weight) in lights.items()
            for key, m in materials.items()
            if not m.unlit
        }
        ambient = np.array(scene.ambient) + sum(np.array(x.Ia) * x.intensity for x in scene.lights.values())
        local = {key: max([lit.get((name, key), 0.0) for name in lights] + [0.0]) for key in materials}
        shown = {
            key: rms(colours[key])
            if m.unlit
            else local[key] + rms(ambient * np.array(m.ka) * np.maximum(1, colours[key] if m.texture else 1))
            for key, m in materials.items()
        }
        shown = {key: x + rms(materials[key].emission) for key, x in shown.items()}
        sky = _sky(prepared)
        lamps = {f"lights.{n} itself": rms(x.intensity * np.array(x.Id)) for n, x in scene.lights.items() if x.seen}
        farther = max([sky, *lamps.values()])
        brightest = max(shown, key=shown.get)
        passed_on = {key: _passed_on(prepared, m) for key, m in materials.items()}
        sides = {key: shown[key] + passed_on[key] * max(shown[brightest], farther) for key in materials}
        objects = {key: max(sides[key], sides[m.back or key]) for key, m in materials.items()}
        causes = {f"light of lights.{name} on materials.{key}": x for (name, key), x in lit.items()} | {"": 0.0} | lamps
        causes |= {f"the texture of materials.{n}": shown[n] for n, m in materials.items() if m.unlit and m.texture}
        causes[f"materials.{brightest} in mirrors, glass or scattered light"] = (
            max(passed_on.values()) * shown[brightest]
        )
        causes["a bright spot of the environment map"] = _map_share(prepared, passed_on, materials) * sky
        cause = max(causes, key=causes.get)
        return Brightness(objects, causes[cause], cause)


def _sky(prepared: Prepared) -> float:
    """The brightness of the background, at its brightest."""
    sky, s = prepared.scene.background, prepared.kernel
    if isinstance(sky, EnvironmentMap):
        texels = s.sky.panorama.texels
        greatest = [
            float(dr.max(dr.gather(s.a.F32, texels, dr.arange(s.a.U, i, dr.width(texels), 4)))[0]) for i in range(3)
        ]
        return sky.intensity * rms(greatest)
    return max(map(rms, (sky.top, sky.bottom) if isinstance(sky, SkyGradient) else (sky,)))


def _map_share(prepared: Prepared, passed_on: dict[str, float], materials: dict[str, Material]) -> float:
    """The largest share of the light of a bright pixel of the environment map that reaches the film where no sample may
    have met it: 0 without a map.

    Seen directly, a pixel of the map that is larger than one of the film is met by samples.
    """
    scene, view = prepared.scene, prepared.kernel.view
    if not isinstance(scene.background, EnvironmentMap):
        return 0.0
    shares = [*passed_on.values()] if scene.settings.misses == "background" else []
    if scene.settings.occlusion.light == "background" and prepared.features["sky occlusion"]:
        shares += [max(m.ka) for m in materials.values() if not m.unlit]
    angle = np.linalg.norm(np.array(view.pixel_right, float)) / np.linalg.norm(np.array(view.forward, float))
    is_fine = np.pi / float(prepared.kernel.sky.panorama.height[0]) < angle
    if is_fine and not scene.film.transparent and not isinstance(view, ParallelView):
        shares.append(1.0)
    return max(shares, default=0.0)


def rms(colour: np.ndarray | tuple) -> float:
    """Brightness of a colour."""
    return float(np.sqrt(np.square(colour).mean()))


def _reflected(light: Light, material: Material, kd: np.ndarray) -> np.ndarray:
    """The most light of a light, without attenuation, that a material of the diffuse colour kd can reflect."""
    return light.intensity * (np.array(light.Id) * kd + np.array(light.Is) * np.array(material.ks))


def _passed_on(prepared: Prepared, m: Material) -> float:
    """The largest share of light from other surfaces that a material reflects, refracts or scatters."""
    effects = prepared.features
    kr = (1.0,) if m.fresnel == "metal" and effects["fresnel"] else m.kr
    shares = [("reflection", kr), ("refraction", m.kt), ("scatter", (0.0, 0.0, 0.0) if m.unlit else m.kd)]
    return max([max(colour) for effect, colour in shares if effects[effect]] + [0.0])


def _brightest_texels(prepared: Prepared) -> dict[str, np.ndarray]:
    """The greatest red, green and blue of each texture, as a dict by its name; for images, no less than the greatest
    number in any image of the scene."""
    textures, atlas = prepared.scene.textures, prepared.kernel.atlas
    greatest = 0.0 if atlas is None or atlas.texels is None else float(dr.max(atlas.texels)[0])
    return {
        name: np.maximum(t.a, t.b) if isinstance(t, CheckerTexture) else np.full(3, greatest)
        for name, t in textures.items()
    }


def _most_attenuation(prepared: Prepared, light: Light) -> float:
    """The factor by which distance weakens (or, below a distance of 1, strengthens) a light where little of the film
    shows it.

    The bright spot of a light on an object has about the size of its distance from the object, or of the light itself.
    A spot that is large on the film is seen. Then the typical distance of objects counts, because light through a
    pinhole falls anywhere.
    """
    if not (light.a or light.b or light.c):
        return 1.0
    distances = _distances(prepared, light) if light.has_position else np.zeros(0)
    if not len(distances):
        return 1 / light.a if light.a else 1.0
    p, view = np.array(light.position, float), prepared.kernel.view
    pixel = float(np.linalg.norm(np.array(view.pixel_right, float)))
    if not isinstance(view, ParallelView):
        pixel *= float(np.linalg.norm(p - np.array(prepared.scene.camera.origin, float)))
    nearest = float(distances.min())
    sides = [np.linalg.norm(getattr(light, name, 0.0)) / 2 for name in ("width", "height")]
    spot = max(nearest, getattr(light, "radius", 0.0), *sides)
    small = np.pi * spot**2 < SMALL * pixel**2
    d = nearest if small else float(np.median(distances))
    return 1 / (light.a + d * (light.b + d * light.c))


def _distances(prepared: Prepared, light: Light) -> np.ndarray:
    """Distances from a light to the boxes of objects, and to planes, except those that it is in."""
    p, distances = np.array(light.position, float)[:, None], []
    for batch in prepared.kernel.batches:
        if batch.kind.bounded:
            low, high = np.array(batch.low, float), np.array(batch.high, float)
            distances.append(np.linalg.norm(np.maximum(np.maximum(low - p, p - high), 0), axis=0))
    for x in prepared.scene.representatives.values():
        if x.type == "plane" and not x.transform:
            n = np.array(x.normal) / np.linalg.norm(x.normal)
            d = abs(float(n @ (p[:, 0] - np.array(x.point))))
            distances.append(np.array([d if d > gamma(8) * np.abs(p).sum() else 0.0]))
    every = np.concatenate([np.zeros(0), *distances])
    return every[every > 0]
