"""Handles in the picture: arrows that drag lights and the clicked object."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from threading import RLock
from typing import Any

import numpy as np

from visray.animation.moment import still_at
from visray.lights import SpotLight
from visray.live.engine import Change
from visray.live.live import Live, Pick
from visray.live.tabs import tab
from visray.primitives import Box
from visray.quantities import quantities
from visray.scene.scene import Scene
from visray.transforms import Translate

# Fields that are points. Others of three lengths, such as the edges of a rectangle, are not.
POINTS = ("position", "center", "point", "base", "a", "b", "c")
# More lights than this get no handles.
MOST_LIGHTS = 24
# Size of a handle in pixels.
SIZE = 90


@dataclass(frozen=True)
class Place:
    """A point that can be dragged.

    label: what it is, such as lights.key.position
    point: where it is, in world units
    moved: the assignments that bring it to another point
    """

    label: str
    point: tuple[float, float, float]
    moved: Callable[[tuple[float, float, float]], dict[str, Any]]


def places(scene: Scene, address: str | None, anchor: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> list[Place]:
    """What can be dragged: the lights, and an object.

    scene: a scene without an animation
    address: address of the object; None: none
    anchor: the point where the handle of an object without points of its own is, before its last step moves it
    """
    found = []
    if len(scene.lights) <= MOST_LIGHTS:
        for name, light in scene.lights.items():
            found += _points(light, f"lights.{name}")
            if isinstance(light, SpotLight):
                found.append(_aim(light, f"lights.{name}", scene.camera.target))
    section, _, name = (address or "").partition(".")
    if section == "objects" and name in scene.objects:
        found += _of_object(scene.objects[name], address, np.array(anchor))
    return found


def _points(record: Any, address: str) -> list[Place]:
    """The points among the fields of a light or an object."""
    return [
        Place(f"{address}.{field}", getattr(record, field), lambda p, at=f"{address}.{field}": {at: p})
        for field, quantity in quantities(type(record)).items()
        if field in POINTS and quantity.size == 3
    ]


def _of_object(thing: Any, address: str, anchor: np.ndarray) -> list[Place]:
    """The points of an object: those of its fields, or one that its last step moves."""
    steps = thing.transform
    if not steps and isinstance(thing, Box):
        return [_box(thing, address)]
    points = [] if steps else _points(thing, address)
    if points:
        return points
    moves = bool(steps) and isinstance(steps[-1], Translate)
    now = anchor + (steps[-1].translate if moves else 0.0)

    def moved(point: tuple[float, float, float]) -> dict[str, Any]:
        step = tuple(float(x) for x in np.array(point) - anchor)
        if moves:
            return {f"{address}.transform.{len(steps) - 1}.translate": step}
        return {f"{address}.transform": (*steps, Translate(translate=step))}

    return [Place(address, tuple(float(x) for x in now), moved)]


def _box(box: Box, address: str) -> Place:
    """The centre of a box."""
    low, high = np.array(box.min), np.array(box.max)

    def moved(point: tuple[float, float, float]) -> dict[str, Any]:
        step = np.array(point) - (low + high) / 2
        return {f"{address}.{k}": tuple(float(x) for x in v + step) for k, v in (("min", low), ("max", high))}

    return Place(address, tuple(float(x) for x in (low + high) / 2), moved)


def _aim(light: SpotLight, address: str, near: tuple[float, float, float]) -> Place:
    """The point at which a spot light aims, about as far away as another point."""
    position, direction = np.array(light.position, float), np.array(light.direction, float)
    direction /= math.hypot(*direction)
    away = math.dist(light.position, near) or 1.0
    reach = max(float((np.array(near) - position) @ direction), away / 4)

    def moved(point: tuple[float, float, float]) -> dict[str, Any]:
        new = tuple(float(x) for x in np.array(point) - position)
        return {f"{address}.direction": new} if any(new) else {}

    return Place(f"{address}.direction", tuple(float(x) for x in position + reach * direction), moved)


def anchor_of(scene: Scene, pick: Pick) -> tuple[float, float, float]:
    """The anchor of the handle of a clicked object: where it was clicked, before its last step moves it."""
    thing = scene.objects.get((pick.address or "").removeprefix("objects."))
    steps = getattr(thing, "transform", ())
    step = steps[-1].translate if steps and isinstance(steps[-1], Translate) else (0.0, 0.0, 0.0)
    return tuple(float(x - y) for x, y in zip(pick.point or (0.0, 0.0, 0.0), step))


class HandlesPart:
    """Handles that all browsers share, with a switch."""

    def __init__(self, live: Live):
        self.live = live
        self.address: str | None = None
        self.anchor = (0.0, 0.0, 0.0)
        self.shown: dict[str, Any] = {}
        self.dragged: set[str] = set()
        self.numbers, self.lock = count(), RLock()
        with tab(live.server, "Pixel"):
            self.switch = live.server.gui.add_checkbox(
                "Handles", False, order=5, hint="Arrows that drag the lights and the object that was clicked"
            )
        self.switch.on_update(live.safely(lambda _: self.refresh()))
        live.on_pick(self.picked)
        live.engine.on_scene(live.safely(self.changed))

    def picked(self, pick: Pick) -> None:
        """An object was clicked."""
        self.address, self.anchor = pick.address, anchor_of(self.live.engine.scene, pick)
        self.refresh()

    def changed(self, change: Change) -> None:
        """The scene has changed."""
        if change.kind != "effects" and self.switch.value:
            self.refresh()

    def refresh(self) -> None:
        """Shows the handles of the scene as it is now, or none."""
        with self.lock:
            scene = self.live.engine.scene
            wanted = {}
            if self.switch.value:
                still = scene if scene.animation is None else still_at(scene, self.live.engine.time)
                wanted = {place.label: place for place in places(still, self.address, self.anchor)}
            for label in [x for x in self.shown if x not in wanted]:
                self.shown.pop(label).remove()
            for label, place in wanted.items():
                point = self.live.space.to_page(place.point)
                if label not in self.shown:
                    self.shown[label] = self._handle(place, point)
                elif label not in self.dragged and math.dist(self.shown[label].position, point) > 0:
                    self.shown[label].position = point

    def _handle(self, place: Place, point: tuple[float, float, float]) -> Any:
        """A new handle."""
        scene, label = self.live.server.scene, place.label
        # A number, because names may contain slashes, which would make a tree of nodes.
        node = f"/handles/{next(self.numbers)}"
        limits = ((-1e12, 1e12),) * 3
        handle = scene.add_transform_controls(
            node, scale=SIZE, fixed=True, disable_rotations=True, depth_test=False, translation_limits=limits,
            position=point, line_width=2.0,
        )  # fmt: skip
        scene.add_label(node + "/name", label, anchor="top-right")

        @handle.on_update
        async def _(event: Any) -> None:
            self.live.safely(self._drag)(label, event)

        return handle

    def _drag(self, label: str, event: Any) -> None:
        """A browser drags a handle."""
        self.dragged.discard(label) if event.phase == "end" else self.dragged.add(label)
        if event.phase == "update":
            self.live.engine.assign(self._values(label, self.live.space.to_world(event.target.position)))

    def _values(self, label: str, point: tuple[float, float, float]) -> dict[str, Any]:
        """The assignments that bring what a handle drags to a point of the scene as it is now."""
        scene = self.live.engine.scene
        still = scene if scene.animation is None else still_at(scene, self.live.engine.time)
        return next((x.moved(point) for x in places(still, self.address, self.anchor) if x.label == label), {})
