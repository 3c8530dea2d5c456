"""The scene that a live picture shows, at one moment and with its changes, prepared for rendering."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from visray.adaptive.result import adaptive_sampler
from visray.animation.moment import assignments as moment_assignments
from visray.animation.moment import still_at
from visray.live.wishes import Change, Wishes
from visray.records import altered
from visray.scene.address import changed
from visray.scene.check import checked
from visray.scene.edits import within
from visray.scene.scene import Scene
from visray.setup import Prepared
from visray.study.leaving_out import AREA_LIGHTS, prepared_without


@dataclass(frozen=True)
class State:
    """A scene with its changes.

    scene: the scene with all changes so far; with its animation, if it has one
    edits: the changed values, by address
    time: the moment that is shown, in seconds; 0 without an animation
    left_out: names of effects that are not simulated
    prepared: the scene of this moment, prepared; None as long as nobody has looked at it
    """

    scene: Scene
    edits: Mapping[str, Any]
    time: float = 0.0
    left_out: tuple[str, ...] = ()
    prepared: Prepared | None = None

    def with_wishes(self, wishes: Wishes) -> tuple["State", Change]:
        """The state after some wishes are fulfilled, and what has changed. Raises UserError if the scene refuses
        them."""
        scene, edits, time, left_out, kind = self.scene, self.edits, self.time, self.left_out, "values"
        if wishes.scene is not None:
            scene, edits, kind = wishes.scene, {}, "scene"
            time = min(time, scene.animation.duration) if scene.animation is not None else 0.0
        if wishes.left_out is not None:
            left_out, kind = wishes.left_out, "scene" if kind == "scene" else "effects"
        if wishes.seconds is not None and scene.animation is not None:
            time = min(max(wishes.seconds, 0.0), scene.animation.duration)
            kind = "time" if kind == "values" and not wishes.values else kind
        if wishes.values:
            scene, edits = changed(scene, wishes.values), {**edits, **wishes.values}
        state, values = State(scene, edits, time, left_out), dict(wishes.values)
        if scene.animation is not None:
            values |= moment_assignments(scene, time)
        # The prepared scene is of one moment: it has neither an animation nor a shutter.
        values = {a: x for a, x in values.items() if not (within(a, "animation") or within(a, "camera.shutter"))}
        # Without area lights, the prepared scene has other lights than the scene.
        other_lights = AREA_LIGHTS in left_out and any(within(address, "lights") for address in values)
        other_lights |= (AREA_LIGHTS in left_out) != (AREA_LIGHTS in self.left_out)
        if kind == "scene" or (other_lights and self.prepared is not None):
            # A scene that cannot be prepared is refused here, and the one before stays.
            state = state.with_preparation()
        elif (prepared := self.prepared) is not None:
            if left_out != self.left_out:
                effects = (effect for effect in left_out if effect != AREA_LIGHTS)
                prepared = replace(prepared, without=()).leaving_out(*effects)
            if values and scene.animation is None and AREA_LIGHTS not in left_out:
                # The scene is checked already, which takes long if it is large.
                prepared = prepared.changed_to(state.still(), values)
            elif values:
                prepared = prepared.updated(values)
            state = replace(state, prepared=prepared)
        return state, Change(kind, tuple(wishes.values))

    def with_preparation(self) -> "State":
        """The state with its scene prepared. Raises UserError if that cannot be done."""
        if self.prepared is not None:
            return self
        return replace(self, prepared=prepared_without(checked(self.still()), *self.left_out))

    def still(self) -> Scene:
        """The scene of this moment, as it is prepared."""
        scene = still_at(self.scene, self.time if self.scene.animation is not None else None)
        settings = altered(scene.settings, {"sampler": adaptive_sampler(scene.settings.sampler)})
        return altered(scene, {"settings": settings})
