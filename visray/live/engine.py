"""The engine of the live picture: one thread that renders for all browsers by turns.

All work of Dr.Jit is done in this thread. Other threads leave wishes, of which only the newest count, and wake it.
"""

import threading
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, replace
from typing import Any

from visray import clock
from visray.adaptive.result import adaptive_sampler
from visray.animation.moment import assignments as moment_assignments
from visray.animation.moment import still_at
from visray.errors import UserError
from visray.live.picture import LivePicture
from visray.live.viewer import Viewer
from visray.scene.address import changed
from visray.scene.adjusted import adjusted
from visray.scene.edits import within
from visray.scene.scene import Scene
from visray.setup import Prepared
from visray.study.leaving_out import AREA_LIGHTS, prepared_without


@dataclass(frozen=True)
class Change:
    """What has changed in the scene.

    kind: "values" (numbers at addresses), "scene" (another scene), "time" or "effects"
    addresses: of the values that changed
    """

    kind: str
    addresses: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Wishes:
    """What other threads have asked for since the last look. values: newest value by address."""

    values: Mapping[str, Any]
    scene: Scene | None = None
    seconds: float | None = None
    left_out: tuple[str, ...] | None = None


class Engine:
    """Renders a scene for viewers, in a thread of its own.

    scene: the scene with all changes so far; with its animation, if it has one
    edits: the changed values, by address
    time: the moment that is shown, in seconds; 0 without an animation
    left_out: names of effects that are not simulated
    changes: number of changes so far, of the scene or of a viewer's camera
    target: error at which a picture is finished
    """

    def __init__(self, scene: Scene, *, target: float = 0.01):
        self.target = target
        self.scene, self.edits, self.time, self.left_out = scene, {}, 0.0, ()
        self.changes = 0
        self.viewers: list[Viewer] = []
        self._base: Prepared | None = None
        self._wishes, self._jobs = _Wishes({}), deque()
        self._wake, self._lock, self._stopped = threading.Event(), threading.RLock(), False
        self._scene_listeners: list[Callable[[Change], None]] = []
        self._error_listeners: list[Callable[[tuple[str, ...]], None]] = []
        self._thread = threading.Thread(target=self._run, name="visray live", daemon=True)

    def start(self) -> "Engine":
        """Starts the thread."""
        self._thread.start()
        return self

    def stop(self) -> None:
        """Ends the thread, after its current step."""
        self._stopped = True
        self._wake.set()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join()

    def __enter__(self) -> "Engine":
        return self.start()

    def __exit__(self, *error: Any) -> None:
        self.stop()

    # Wishes, from any thread.

    def add(self, viewer: Viewer) -> None:
        """Renders for one more viewer."""
        viewer.changed = self._wake.set
        with self._lock:
            self.viewers = [*self.viewers, viewer]
        self._wake.set()

    def remove(self, viewer: Viewer) -> None:
        """Renders no more for a viewer."""
        with self._lock:
            self.viewers = [v for v in self.viewers if v is not viewer]

    def assign(self, values: Mapping[str, Any]) -> None:
        """Changes values of the scene, by address."""
        self._wish(values=values)

    @property
    def wished(self) -> Mapping[str, Any]:
        """Values that were asked for and that the scene does not have yet, by address."""
        with self._lock:
            return self._wishes.values

    @property
    def seeks(self) -> bool:
        """Whether a moment was asked for that is not the one of the scene yet."""
        with self._lock:
            return self._wishes.seconds is not None

    def seek(self, seconds: float) -> None:
        """Shows another moment of an animated scene."""
        self._wish(seconds=seconds)

    def show(self, scene: Scene) -> None:
        """Shows another scene. All changes so far are forgotten."""
        with self._lock:
            self._wishes = replace(self._wishes, values={}, scene=scene)
        self._wake.set()

    def leave_out(self, names: tuple[str, ...]) -> None:
        """Simulates all effects of the scene but these."""
        self._wish(left_out=tuple(names))

    def ask(self, work: Callable[[Prepared], Any], viewer: Viewer | None = None) -> Future:
        """The result of some work in the thread that renders, between two steps.

        work: function of the prepared scene, as the viewer sees it, or else with the camera of the scene
        """
        future: Future = Future()
        self._jobs.append((future, work, viewer))
        self._wake.set()
        return future

    def on_scene(self, callback: Callable[[Change], None]) -> None:
        """Calls a function after each change of the scene, in the thread that renders."""
        self._scene_listeners.append(callback)

    def on_error(self, callback: Callable[[tuple[str, ...]], None]) -> None:
        """Calls a function with the lines of each error, and with () when all is well again."""
        self._error_listeners.append(callback)

    def _wish(self, values: Mapping[str, Any] | None = None, **others: Any) -> None:
        """Adds a wish; newer values replace older ones."""
        with self._lock:
            merged = {k: v for k, v in self._wishes.values.items() if k not in (values or {})} | dict(values or {})
            self._wishes = replace(self._wishes, values=merged, **others)
        self._wake.set()

    # The thread that renders.

    def _run(self) -> None:
        """Works until `stop`."""
        turn = 0
        while not self._stopped:
            # Cleared before the wishes are looked at: a wish that comes later sets it again.
            self._wake.clear()
            busy = self._take_wishes() | self._take_job()
            viewers = self.viewers
            for viewer in viewers:
                busy |= self._follow(viewer)
            open_pictures = [v for v in viewers if v.picture is not None and not v.picture.finished]
            if open_pictures:
                turn += 1
                # A picture without any state comes before those that only get better.
                first = [v for v in open_pictures if v.picture.film is None] or open_pictures
                self._step(first[turn % len(first)])
            elif not busy:
                self._wake.wait()

    def _take_wishes(self) -> bool:
        """Changes the scene as other threads have asked. Returns whether anything was asked for."""
        with self._lock:
            wishes, self._wishes = self._wishes, _Wishes({})
        if wishes == _Wishes({}):
            return False
        try:
            change = self._changed(wishes)
        except UserError as error:
            self._tell_error(error.lines)
            return True
        self.changes += 1
        for callback in self._scene_listeners:
            callback(change)
        self._tell_error(())
        return True

    def _changed(self, wishes: _Wishes) -> Change:
        """Fulfils wishes. Returns what has changed. Raises UserError if the scene refuses them; then nothing has."""
        scene, edits, time, left_out = self.scene, self.edits, self.time, self.left_out
        kind = "values"
        if wishes.scene is not None:
            scene, edits, kind = wishes.scene, {}, "scene"
        if wishes.left_out is not None:
            left_out, kind = wishes.left_out, "effects"
        if wishes.seconds is not None and scene.animation is not None:
            time = min(max(wishes.seconds, 0.0), scene.animation.duration)
            kind = "time" if kind == "values" and not wishes.values else kind
        if wishes.values:
            scene, edits = changed(scene, wishes.values), edits | dict(wishes.values)
        values = dict(wishes.values)
        if scene.animation is not None:
            values |= moment_assignments(scene, time)
        # Without area lights, the prepared scene has other lights than the scene.
        has_other_lights = AREA_LIGHTS in left_out and any(within(address, "lights") for address in values)
        afresh = kind in ("scene", "effects") or self._base is None or has_other_lights
        for viewer in self.viewers:
            if afresh:
                viewer.prepared = None
            elif viewer.prepared is not None:
                viewer.prepared = viewer.prepared.updated(values)
            viewer.shown = None
        self._base = None if afresh else self._base.updated(values)
        self.scene, self.edits, self.time, self.left_out = scene, edits, time, left_out
        return Change(kind, tuple(wishes.values))

    def _prepared(self) -> Prepared:
        """The prepared scene of this moment, with the camera of the scene."""
        if self._base is None:
            scene = still_at(self.scene, self.time if self.scene.animation is not None else None)
            scene = adjusted(scene, sampler=adaptive_sampler(scene.settings.sampler))
            self._base = prepared_without(scene, *self.left_out)
        return self._base

    def _follow(self, viewer: Viewer) -> bool:
        """Begins a new picture if the viewer's camera or size or the scene has changed. Returns whether it has."""
        wanted = viewer.wanted
        if viewer.shown == wanted:
            return False
        camera, size = wanted
        begun = clock.now()
        try:
            prepared = viewer.prepared or self._prepared()
            film = replace(prepared.scene.film, width=size[0], height=size[1])
            if film != prepared.scene.film:
                prepared = prepared.adjusted(replace(prepared.scene, film=film))
            if camera is not None and camera != prepared.scene.camera:
                prepared = prepared.updated({"camera": camera})
        except UserError as error:
            viewer.shown = wanted
            self._tell_error(error.lines)
            return True
        viewer.prepared, viewer.shown = prepared, wanted
        viewer.picture = LivePicture(prepared, self.target, viewer.pace)
        viewer.change, viewer.begun = self.changes, begun
        return True

    def _step(self, viewer: Viewer) -> None:
        """Computes and sends the next state of a viewer's picture."""
        try:
            frame = viewer.picture.step()
        except UserError as error:
            viewer.picture = None
            self._tell_error(error.lines)
            return
        viewer.send(replace(frame, seconds=clock.now() - viewer.begun, change=viewer.change))

    def _take_job(self) -> bool:
        """Does one piece of work that was asked for. Returns whether there was one."""
        if not self._jobs:
            return False
        future, work, viewer = self._jobs.popleft()
        if future.set_running_or_notify_cancel():
            try:
                seen = viewer and viewer.prepared
                future.set_result(work(seen or self._prepared()))
            except BaseException as error:
                future.set_exception(error)
        return True

    def _tell_error(self, lines: tuple[str, ...]) -> None:
        """Tells the listeners of an error; (): all is well."""
        for callback in self._error_listeners:
            callback(tuple(lines))
