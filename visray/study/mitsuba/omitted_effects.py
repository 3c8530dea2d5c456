"""Effects that Mitsuba does not have, or simulates in another way. The check compares the scene without them."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

from visray.features import features
from visray.lights import PointLight
from visray.lights.light import Light
from visray.scene.scene import Occlusion, Scatter, Scene, Settings

SHADING = Settings().shading
# Coloured shadows are compared only if the scene has at most this many transparent objects, because each of these needs
# its own Mitsuba scene.
MOST_TRANSPARENT = 64


@dataclass(frozen=True)
class Omission:
    """Effects that are not compared.

    effects: names of the effects, as `visray explain` lists them
    instead: what the compared scene has instead of the effects, as text for the user
    switch_off: function that takes a scene and returns it without the effects
    """

    effects: tuple[str, ...]
    instead: str
    switch_off: Callable[[Scene], Scene]


def _with_settings(**values: object) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, settings=replace(scene.settings, **values))


def _without_defocus(scene: Scene) -> Scene:
    return replace(scene, camera=replace(scene.camera, aperture=0.0)) if scene.camera.aperture else scene


def _with_unseen_lights(scene: Scene) -> Scene:
    unseen = {name: replace(light, visible=False) for name, light in scene.lights.items() if light.seen}
    return replace(scene, lights=scene.lights | unseen)


def _without_area_lights(scene: Scene) -> Scene:
    lights = {name: without_extent(light) for name, light in scene.lights.items()}
    return _with_settings(area="samples")(replace(scene, lights=lights))


OMISSIONS = (
    Omission(("sky occlusion", "near occlusion"), "all ambient light arrives", _with_settings(occlusion=Occlusion())),
    # With depth 0, paths end at the first surface. Coloured shadows are still simulated.
    Omission(("reflection", "refraction", "nested media"), "settings.depth is 0", _with_settings(depth=0)),
    Omission(("scatter",), "settings.scatter.rays is 0", _with_settings(scatter=Scatter())),
    Omission(("visible lights",), "lights are not seen", _with_unseen_lights),
    Omission(("defocus",), "camera.aperture is 0", _without_defocus),
    Omission(
        ("area lights",),
        "point lights in their middles instead; shadows are compared from a grid of points on each",
        _without_area_lights,
    ),
)


def without_omitted_effects(scene: Scene) -> tuple[Scene, list[str]]:
    """The scene whose picture is compared, and a list of notes for the user about the effects that are not compared."""
    notes, mode = [], scene.settings.shading
    if mode != SHADING:
        notes.append(f"not compared: the shading {mode} (settings.shading is {SHADING})")
        scene = _with_settings(shading=SHADING)(scene)
    present = features(scene)
    for omission in OMISSIONS:
        if names := [name for name in omission.effects if present[name]]:
            notes.append(f"not compared: {', '.join(names)} ({omission.instead})")
        scene = omission.switch_off(scene)
    transparent = scene.objects_of([name for name, m in scene.materials.items() if any(m.kt)])
    if len(transparent) > MOST_TRANSPARENT and present["coloured shadows"]:
        notes.append(f"not compared: coloured shadows ({len(transparent)} transparent objects count as opaque)")
        scene = opaque(scene)
    if not features(scene)["shadows"]:
        # visray traces no shadow rays if all lights are dark, or if all surfaces are unlit.
        scene = _with_settings(shadows=False)(scene)
    return scene, notes


def without_extent(light: Light) -> Light:
    """A point light in the middle of the light if it is an area light; otherwise the light itself."""
    if not light.has_area:
        return light
    shared = {f.name: getattr(light, f.name) for f in fields(Light)}
    return PointLight(position=light.position, **shared)


def opaque(scene: Scene) -> Scene:
    """The scene with all objects opaque, so that every occluder makes a full shadow."""
    materials = {name: replace(m, kt=(0.0, 0.0, 0.0)) for name, m in scene.materials.items()}
    return replace(scene, materials=materials)
