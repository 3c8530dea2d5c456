"""A scene without the effects that its twin in Mitsuba has not: both are checked as if these were switched off."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

from visray.features import features
from visray.lights import PointLight
from visray.lights.light import Light
from visray.materials import Material
from visray.scene.scene import Occlusion, Scatter, Scene, Settings

SHADING = Settings().shading
# To compare coloured shadows takes a scene of Mitsuba's for each transparent object.
MOST_TRANSPARENT = 64


@dataclass(frozen=True)
class Omission:
    """Effects that are not compared: their names as `visray explain` lists them, what the scene has instead, and how
    they are switched off."""

    effects: tuple[str, ...]
    instead: str
    without: Callable[[Scene], Scene]


def _set(**values: object) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, settings=replace(scene.settings, **values))


def _sharp(scene: Scene) -> Scene:
    return replace(scene, camera=replace(scene.camera, aperture=0.0))


def _of_points(scene: Scene) -> Scene:
    lights = {name: middle(light) for name, light in scene.lights.items()}
    return _set(area="samples")(replace(scene, lights=lights))


OMISSIONS = (
    Omission(("sky occlusion", "near occlusion"), "all ambient light arrives", _set(occlusion=Occlusion())),
    # Coloured shadows stay: only paths end at the first surface.
    Omission(("reflection", "refraction", "nested media"), "settings.depth is 0", _set(depth=0)),
    Omission(("scatter",), "settings.scatter.rays is 0", _set(scatter=Scatter())),
    Omission(("defocus",), "camera.aperture is 0", _sharp),
    Omission(("area lights",), "their middles are points; shadows are compared from points all over them", _of_points),
)


def plain(scene: Scene) -> tuple[Scene, list[str]]:
    """The scene as its picture is compared, and a note for each thing that is not."""
    notes, mode = [], scene.settings.shading
    if mode != SHADING:
        notes.append(f"not compared: the shading {mode} (settings.shading is {SHADING})")
        scene = _set(shading=SHADING)(scene)
    on = features(scene)
    for omitted in OMISSIONS:
        if names := [name for name in omitted.effects if on[name]]:
            notes.append(f"not compared: {', '.join(names)} ({omitted.instead})")
        scene = omitted.without(scene)
    clear = [o for o in scene.objects.values() if any(scene.materials.get(o.material, Material()).kt)]
    if len(clear) > MOST_TRANSPARENT and on["coloured shadows"]:
        notes.append(f"not compared: coloured shadows ({len(clear)} transparent objects count as opaque)")
        scene = opaque(scene)
    if not any(light.intensity for light in scene.lights.values()):
        # Then visray looks for no shadows.
        scene = _set(shadows=False)(scene)
    return scene, notes


def middle(light: Light) -> Light:
    """A light without an extent: the middle of an area light, and any other as it is."""
    if not light.has_area:
        return light
    shared = {f.name: getattr(light, f.name) for f in fields(Light)}
    return PointLight(position=light.position, **shared)


def opaque(scene: Scene) -> Scene:
    """The scene with all transparent objects opaque: then a shadow is what is behind any object."""
    solid = {name: replace(m, kt=(0.0, 0.0, 0.0)) for name, m in scene.materials.items()}
    return replace(scene, materials=solid)
