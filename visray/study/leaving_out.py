"""A scene prepared without some of its effects."""

from dataclasses import fields, replace

from visray.lights import PointLight
from visray.lights.light import Light
from visray.scene.scene import Scene
from visray.setup import Prepared, prepare

AREA_LIGHTS = "area lights"


def prepared_without(scene: Scene, *effects: str) -> Prepared:
    """The scene, prepared without some effects. Instead of the effect "area lights", the lights themselves change
    (with_point_lights).

    effects: names of the effects
    """
    scene = with_point_lights(scene) if AREA_LIGHTS in effects else scene
    return prepare(scene, without=tuple(e for e in effects if e != AREA_LIGHTS))


def less(prepared: Prepared, effect: str) -> Prepared:
    """A prepared scene without one more effect, as in prepared_without. What both have is not prepared again."""
    if effect != AREA_LIGHTS:
        return prepared.leaving_out(effect)
    return prepare(with_point_lights(prepared.scene), prepared.a.backend, without=prepared.without)


def with_point_lights(scene: Scene) -> Scene:
    """The scene with point lights in the middles of its area lights."""
    shared = [f.name for f in fields(Light)]
    points = {
        name: PointLight(position=l.position, **{f: getattr(l, f) for f in shared}) if l.has_area else l
        for name, l in scene.lights.items()
    }
    return replace(scene, lights=points)
