"""Completes scenes: one without a camera gets a fitted camera, and one without lights gets fitted lights.

The camera looks from the side and from above, so that y is up and all that is bounded is in the picture, and it stands
where the most of it is seen: not below a floor, behind a wall, or in an object. The lights are a key light with soft
shadows and a weak fill light, which stand to the camera as a rig says (fitting.py). Surroundings need not be in the
picture (surroundings.py). A camera `{}` is the default camera, and lights `{}` are none.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from visray.camera import Camera, OrthographicCamera
from visray.data import fit
from visray.errors import UserError
from visray.fitting import FOV, Balls, Rig, Window, fitted_lights, fitted_origin, fitted_view
from visray.identity_cache import IdentityCache
from visray.lights.light import Light
from visray.records import altered
from visray.scene.garbage import uncollected
from visray.scene.scene import Scene
from visray.surroundings import Stage
from visray.things import things_of

# Directions from which a camera looks, the best first: azimuths in degrees from z to x, and elevations.
AZIMUTHS, ELEVATIONS = (35.0, -35.0, 0.0, 70.0, -70.0, 145.0, -145.0, 180.0), (24.0, 12.0, 45.0, 4.0)
# Angles of view that are tried, in degrees: in a room, only a wide one lets a camera stand before the walls.
FOVS = (FOV, 45.0, 65.0)
# The part of the picture for what must be in it: around it there is room for shadows.
WINDOW = Window(left=-0.82, right=0.82, bottom=-0.82, top=0.82)
# A view is taken before others that show more if it shows at least this share of what they show.
ENOUGH = 0.9
# Places of the key light and of the fill light, the best first: to the right, upwards and backwards of the camera.
KEYS = ((-0.5, 0.3, 0.81), (0.5, 0.3, 0.81), (-0.3, 0.8, 0.5), (0.3, 0.8, 0.5), (0.0, 0.2, 1.0))
FILLS = ((0.7, -0.1, 0.7), (0.7, 0.3, 0.65), (-0.7, 0.3, 0.65), (0.4, 0.8, 0.45), (0.0, 0.2, 1.0))
# Shares of the rig's distances and of its radii that are tried.
NEARER, SMALLER = (1.0, 0.6, 0.35, 0.2), (1.0, 0.5, 0.25)
# Radius of what the lights shine on if nothing is bounded, as a share of the distance of the camera's target.
PART = 0.3
# Strengths of the lights of a scene.
RIG = Rig()
# Sections of a scene in which there are things, or which say where they are and which of them are transparent.
PLACES = ("objects", "geometries", "materials", "data")
# What is said of a scene by what is missing: the camera, the lights.
DONE = {
    (True, True): "no camera and no lights: both are fitted; visray import, or vr.dump, writes them out",
    (True, False): "no camera: one is fitted; visray import, or vr.dump, writes it out",
    (False, True): 'no lights: two are fitted; "lights": {} means none; visray import, or vr.dump, writes them out',
}


@dataclass(frozen=True)
class _Fit:
    """The camera and the lights that a scene gets, and notes on what was fitted."""

    camera: Camera | OrthographicCamera
    lights: dict[str, Light]
    notes: tuple[str, ...]


# The fits of scenes as they are at rest: the check of an animation and the scene's user ask for the same one.
_fits = IdentityCache()


@uncollected()
def completed(scene: Scene, start: Scene | None = None) -> tuple[Scene, list[str]]:
    """The scene with a camera and lights, and notes on what was fitted. Domain: a scene without flaws.

    start: the scene at the beginning of its animation; None: the scene itself.
    """
    if scene.camera is not None and scene.lights is not None:
        return scene, []
    if start is not None and not _begins_at_rest(scene, start):
        fit = _fit(scene, start)
    elif (fit := _fits.get(scene)) is None:
        fit = _fit(scene, scene)
        _fits.put(scene, fit)
    return altered(scene, {"camera": fit.camera, "lights": dict(fit.lights)}), list(fit.notes)


def _begins_at_rest(scene: Scene, start: Scene) -> bool:
    """Whether all that a fit depends on is the same at the beginning of the animation."""
    given = [name for name in ("camera", "lights") if getattr(scene, name) is not None]
    return all(getattr(scene, name) == getattr(start, name) for name in (*PLACES, *given))


def _fit(scene: Scene, start: Scene) -> _Fit:
    """The camera and the lights of a scene: its own, or those fitted to `start`."""
    stage = Stage.of(things_of(start))
    camera, lights = scene.camera, scene.lights
    try:
        if camera is None:
            camera = _camera(scene, stage)
        if lights is None:
            seen_by = camera if scene.camera is None else start.camera
            lights = _lights(seen_by, stage) if stage.shown or stage.around else {}
    except UserError:
        # Their numbers would not be within the limits of a scene.
        missing = " and ".join(name for name in ("camera", "lights") if getattr(scene, name) is None)
        problem = "what the scene shows is too small, too large or too far away to fit any"
        raise UserError(f"{missing}: {problem}; write {missing}, or scale the scene") from None
    return _Fit(camera, lights, tuple(_notes(scene, stage)))


def _notes(scene: Scene, stage: Stage) -> list[str]:
    """What to say of a scene that was completed."""
    if not (stage.shown or stage.around):
        return []
    notes = [DONE[scene.camera is None, scene.lights is None]]
    if scene.camera is None and not stage.shown:
        notes.append("as nothing in the scene is bounded, its camera is the default one")
    large = [x.address for x in stage.around if x.balls is not None]
    if large and scene.camera is None:
        text = "is much larger than the rest, so the fitted camera need not show all of it"
        notes.append(f"{large[0]}: {text}" + (f"; so are {len(large) - 1} more" if large[1:] else ""))
    return notes


def _camera(scene: Scene, stage: Stage) -> Camera:
    """The fitted camera; the default one if nothing is bounded."""
    shown, aspect = stage.balls, scene.film.size[0] / scene.film.size[1]
    if shown is None:
        return Camera()
    directions = [_axes(azimuth, elevation) for elevation in ELEVATIONS for azimuth in AZIMUTHS]
    if scene.data is not None and not scene.objects:
        directions = [fit.axes_over(scene.data.base), *directions]
    axes, fov = _best_view(np.array(directions), shown, aspect, stage)
    return _upright(fitted_view(shown, axes, aspect, WINDOW, fov=fov), scene)


def _best_view(directions: np.ndarray, shown: Balls, aspect: float, stage: Stage) -> tuple[np.ndarray, float]:
    """Camera axes and a vertical angle of view. directions: the axes to choose from, the best first."""
    best, worth = (directions[0], FOVS[0]), -1.0
    for fov in FOVS:
        for some in np.array_split(directions, len(ELEVATIONS)):
            axes, visible = _first_enough(some, lambda x, fov=fov: stage.visible(_origins(x, shown, aspect, fov)))
            # Each step further from the usual view must show more.
            if ENOUGH * visible > worth:
                best, worth = (axes, fov), visible
            if worth >= ENOUGH:
                return best
    return best


def _first_enough(candidates: Sequence, worth_of: Callable[[Sequence], np.ndarray]) -> tuple[Any, float]:
    """The first of some candidates whose worth is at least ENOUGH of that of the best one, and its worth.

    worth_of: function that returns the worths of candidates, from 0 to 1.
    """
    # Often the first one is worth enough; then the others need not be looked at.
    worth = worth_of(candidates[:1])
    if worth[0] < ENOUGH:
        worth = worth_of(candidates)
    first = int(np.argmax(worth >= ENOUGH * worth.max()))
    return candidates[first], float(worth[first])


def _origins(views: Sequence[np.ndarray], shown: Balls, aspect: float, fov: float) -> np.ndarray:
    """The origins of fitted cameras with these axes. Shape: (N, 3)."""
    return np.array([fitted_origin(shown, axes, aspect, WINDOW, fov) for axes in views])


def _upright(camera: Camera, scene: Scene) -> Camera:
    """The camera with y upwards, but over a map or a globe, where north is up."""
    return replace(camera, up=(0.0, 1.0, 0.0)) if scene.data is None or scene.objects else camera


def _axes(azimuth: float, elevation: float) -> np.ndarray:
    """Axes of a camera that looks from a direction, with y upwards: to the right, up and forward. Shape: (3, 3)."""
    a, e = np.radians([azimuth, elevation])
    forward = -np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])
    return _axes_of(forward, np.array([0.0, 1.0, 0.0]))


def _axes_of(forward: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Axes of a camera that looks forward. Shape: (3, 3)."""
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, up / np.linalg.norm(up))
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])


def _lights(camera: Camera | OrthographicCamera, stage: Stage) -> dict[str, Light]:
    """The lights for a camera, in places from which the most is seen."""
    view = np.subtract(camera.target, camera.origin)
    axes = _axes_of(view, np.array(camera.up, float))
    shown = stage.balls
    if shown is None:
        reach = PART * float(np.linalg.norm(view))
        shown = Balls(np.array([camera.target], float), np.array([reach]))
    shown = Balls(shown.middle()[None], np.array([shown.reach()]))
    rigs = [_Place("key", "key_radius", KEYS), _Place("fill", "fill_radius", FILLS)]
    return {place.name: place.light(shown, axes, stage) for place in rigs}


@dataclass(frozen=True)
class _Place:
    """Where a light of a rig may stand.

    name: its name in the rig.
    size: the name of its radius in the rig.
    directions: directions to it, the best first.
    """

    name: str
    size: str
    directions: tuple[tuple[float, float, float], ...]

    def light(self, shown: Balls, axes: np.ndarray, stage: Stage) -> Light:
        """The light in the first place from which enough is seen, and where nothing cuts it."""
        rigs = [
            replace(RIG, distance=near * RIG.distance, **{self.name: toward, self.size: near * small * self.radius})
            for near in NEARER
            for small in SMALLER
            for toward in self.directions
        ]

        def worth(some: Sequence[Rig]) -> np.ndarray:
            lights = [fitted_lights(shown, axes, rig)[self.name] for rig in some]
            points = np.array([x.position for x in lights])
            return stage.visible(points) * stage.free(points, np.array([x.radius for x in lights]))

        rig, _ = _first_enough(rigs, worth)
        return fitted_lights(shown, axes, rig)[self.name]

    @property
    def radius(self) -> float:
        """Its radius in the rig."""
        return getattr(RIG, self.size)
