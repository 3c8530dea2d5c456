"""Why no light of a light is seen: what becomes of each light at points that the camera sees."""

from collections import Counter
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray.accel.intersect import closest
from visray.dark.evidence import NEARLY_BLACK
from visray.dark.view import PictureRays, listed
from visray.data.all_objects import address_of
from visray.feature_rules import used_materials
from visray.integrator import camera_origin, object_of
from visray.light_probe import LightProbe, centre_sample, interaction_of, numbers, prepared_lights, probed
from visray.lights.light import Light
from visray.materials import Material
from visray.passes import subset
from visray.scene.scene import Scene
from visray.setup import Prepared

# Numbers of points that are looked at, of lights that are looked at, and of lights that are told of.
MOST_POINTS, MOST_LIGHTS, TOLD_LIGHTS = 64, 64, 4
# An attenuation below this is a cause by itself: a light of intensity 1 is black in an 8-bit picture.
FAINT = NEARLY_BLACK


@dataclass(frozen=True)
class SeenPoints:
    """Points on objects that the camera sees.

    p: the points
    objects: number of each point's object
    from_inside: whether the camera sees the inner side of each object
    probes: what becomes of each light at the points, by the number of the light

    Shapes: p (N, 3), objects (N), from_inside (N)
    """

    p: np.ndarray
    objects: np.ndarray
    from_inside: np.ndarray
    probes: dict[int, LightProbe]

    @staticmethod
    def of(prepared: Prepared, rays: PictureRays) -> "SeenPoints":
        """Some points, evenly spread over the pixels whose rays hit an object that light falls on."""
        lanes = np.flatnonzero(rays.receives)
        lanes = lanes[np.linspace(0, len(lanes) - 1, min(MOST_POINTS, len(lanes))).astype(int)]
        # At least two lanes, because single numbers make other kernels.
        lanes = np.repeat(lanes, 2) if len(lanes) == 1 else lanes
        s, pixels, n = prepared.kernel, subset(prepared, lanes), len(lanes)
        dr.eval(pixels.x, pixels.y)
        ray, sample = centre_sample(s, pixels.x, pixels.y)
        si = interaction_of(s, ray.exact(), closest(camera_origin(s, ray), ray, s.brute_force), sample)
        objects = numbers(object_of(s, si.hit), n).astype(int)
        j, probes = dr.arange(s.a.U, n), {}
        on = prepared.features
        if on["diffuse"] or on["specular"]:
            for number, light, salt in list(prepared_lights(s))[:MOST_LIGHTS]:
                of_light = j % max(light.samples, 1) if light.kind.has_area else j
                probes[number] = probed(s, si, light, salt, of_light)
        return SeenPoints(numbers(si.surface.p, n), objects, numbers(si.from_inside, n), probes)


def unlit_notes(prepared: Prepared, rays: PictureRays, black: bool) -> list[str]:
    """List of sentences that say why a picture shows no light of a light.

    black: whether the picture is black; else it shows ambient light, unlit surfaces or the background
    """
    what = "the picture is black" if black else "no light shines on what is seen"
    if not rays.receives.any():
        return [f"{what}: all that is seen is unlit, and its kd is black"] if black else []
    scene, seen = prepared.scene, SeenPoints.of(prepared, rays)
    names = list(scene.all_objects)
    if len(set(seen.objects)) == 1 and seen.from_inside.all() and rays.hit.all():
        where = f"camera.origin lies inside or behind {address_of(names[seen.objects[0]])}"
        return [f"{what}: {where}, and no light reaches its inner side; move the camera or a light"]
    if not black and all(any(m.kr + m.kt) for m in map(scene.material, _materials(scene, seen))):
        return []  # mirrors and glass show the background
    causes = _without_probes(scene) if not seen.probes else [
        _cause(scene, name, light, seen, i, prepared) for i, (name, light) in enumerate(scene.lights.items())
        if i in seen.probes
    ]  # fmt: skip
    causes = [cause for cause in causes if cause]
    more = f"; and {len(causes) - TOLD_LIGHTS} lights more" if len(causes) > TOLD_LIGHTS else ""
    if causes:
        return [f"{what}: {'; '.join(causes[:TOLD_LIGHTS])}{more}"]
    return [f"{what}: nothing that is seen sends light to the camera"] if black else []


def _materials(scene: Scene, seen: SeenPoints, points: Any = slice(None)) -> list[str]:
    """Names of the materials that may be seen at some of the points, in alphabetical order. points: their indices"""
    names, sides = scene.materials_of_objects(), zip(seen.objects[points], seen.from_inside[points])
    return sorted({scene.sides_of(name)[int(inside)] for k, inside in sides for name in names[k]})


def _without_probes(scene: Scene) -> list[str]:
    """Causes that are seen without looking at points: no effect brings light of a light."""
    if not scene.lights:
        return ["the scene has no lights" + ("" if any(scene.ambient) else ", and ambient is black")]
    dim = [name for name, l in scene.lights.items() if not l.intensity or not any(l.Id + l.Is)]
    if len(dim) == len(scene.lights):
        return [f"lights.{name} has {'intensity 0' if not scene.lights[name].intensity else 'neither Id nor Is'}"
                for name in dim]  # fmt: skip
    used = [name for name, m in used_materials(scene).items() if not m.unlit]
    return [f"materials.{name} has neither kd nor ks" for name in sorted(used)]


def _cause(scene: Scene, name: str, light: Light, seen: SeenPoints, number: int, prepared: Prepared) -> str | None:
    """Why the light of one light is not seen; None if it is seen well."""
    address, probe, names = f"lights.{name}", seen.probes[number], list(scene.all_objects)
    if not light.intensity or not any(light.Id + light.Is):
        return f"{address} has {'intensity 0' if not light.intensity else 'neither Id nor Is'}"
    for k in _around(prepared, light):
        if not any(scene.materials.get(scene.materials_of(scene.all_objects[names[k]])[0], Material()).kt):
            return f"{address} lies inside {address_of(names[k])}, which lets no light out; move it"
    outside = probe.falloff == 0
    if outside.all():
        direction = listed(np.median(seen.p, 0) - np.array(light.position))
        return f"{address} points past all that is seen; direction = {direction} points at it"
    passes = probe.transmittance.max(1) > 0
    factor = float((probe.attenuation * probe.falloff)[passes].max()) if passes.any() else 0.0
    if passes.any():
        if factor * light.intensity < FAINT and factor < FAINT:
            return f"{address} is attenuated to {factor:.2g} at what is seen; lower its a, b or c"
        if light.intensity * max(light.Id + light.Is) < FAINT:
            return f"{address} has intensity {light.intensity:g}; raise it"
        if not (probe.diffuse + probe.specular).any():
            dull = ", ".join(f"materials.{material}" for material in _materials(scene, seen, passes))
            return f"{address} arrives, but {dull} reflects none of it"
        return None
    return f"{address} {_hidden(probe, seen, names)}; move it"


def _around(prepared: Prepared, light: Light) -> list[int]:
    """Numbers of the closed objects in which the position of a light lies."""
    if not light.has_position:
        return []
    s, found = prepared.kernel, []
    p = s.a.W(*light.position)
    for batch in s.batches:
        if batch.kind.closed and not batch.kind.many_rows:
            within = np.broadcast_to(np.array(batch.kind.inside(batch.placed, p)), len(batch))
            found += np.broadcast_to(np.array(batch.object), len(batch))[within].tolist()
    return found


def _hidden(probe: LightProbe, seen: SeenPoints, names: list[str]) -> str:
    """Where a light is that is behind all surfaces or hidden from them, as the end of a sentence."""
    behind = Counter(names[k] for k in seen.objects[~probe.faces])
    in_way = Counter(names[k] for lane in probe.in_way for k in lane[:1])
    both = behind + in_way
    if not both:
        return "does not reach what is seen"
    most = both.most_common(1)[0][0]
    if not in_way:
        return f"is behind all surfaces that are seen, such as {address_of(most)}"
    if in_way[most] and behind[most]:
        return f"is behind {address_of(most)}, which blocks its light"
    blocker = in_way.most_common(1)[0][0]
    return f"is hidden by {address_of(blocker)}" + (", or behind the surfaces that are seen" if behind else "")
