"""The engine of the live picture: one thread that renders for all browsers by turns.

All work of Dr.Jit is done in this thread. Other threads leave wishes, of which only the newest count, and wake it.
"""

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import replace
from typing import Any

from visray import clock, work_threads
from visray.live.asking import Asking
from visray.live.blur import moves, opened
from visray.live.jobs import Jobs
from visray.live.pace import Pace
from visray.live.picture import LivePicture
from visray.live.replay import Replays
from visray.live.seeing import has_lists, seen
from visray.live.state import State
from visray.live.telling import lines_of
from visray.live.viewer import Viewer
from visray.live.wishes import Change, Wishes
from visray.scene.scene import Scene
from visray.setup import Prepared

__all__ = ["Change", "Engine"]

# If placing a camera takes longer, in seconds, because its lists of rows are built, then rays search the tree while it
# moves, and lists are built when it rests.
LISTS = 0.02
# Seconds that `stop` waits for the end of the current step, which is long while a kernel is compiled.
PATIENCE = 30.0


class Engine(Asking):
    """Renders a scene for viewers, in a thread of its own.

    changes: number of changes so far, of the scene or of its effects
    target: error at which a picture is finished
    viewers: all viewers
    """

    def __init__(self, scene: Scene, *, target: float = 0.01):
        super().__init__()
        self.target, self.changes = target, 0
        self.viewers: list[Viewer] = []
        self._state = State(scene, {})
        self._jobs, self._replays = Jobs(), Replays()
        self._stopped = self._moves_in_tree = False
        self._thread: threading.Thread | None = None

    @property
    def scene(self) -> Scene:
        """The scene with all changes so far; with its animation, if it has one."""
        return self._state.scene

    @property
    def edits(self) -> Mapping[str, Any]:
        """The changed values, by address."""
        return self._state.edits

    @property
    def time(self) -> float:
        """The moment that is shown, in seconds; 0 without an animation."""
        return self._state.time

    @property
    def left_out(self) -> tuple[str, ...]:
        """Names of effects that are not simulated."""
        return self._state.left_out

    def start(self) -> "Engine":
        """Starts the thread."""
        self._thread = work_threads.begun(self._run, "visray live", self.ask_to_stop)
        return self

    def ask_to_stop(self) -> None:
        """Ends the thread soon, after its current step. Work that nobody has begun is cancelled."""
        self._stopped = True
        self._wake.set()
        self._jobs.cancel()

    def stop(self, seconds: float = PATIENCE) -> bool:
        """Ends the thread, and waits for its current step. Returns whether it has ended.

        seconds: how long to wait at most; the thread ends later then, and before Python ends
        """
        self.ask_to_stop()
        return self._thread is None or work_threads.have_ended(seconds, [self._thread])

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

    def ask(self, work: Callable[[Prepared], Any], viewer: Viewer | None = None) -> Future:
        """The result of some work in the thread that renders, between two steps. It is cancelled when the engine stops.

        work: function of the prepared scene, as the viewer sees it, or else with the camera of the scene
        """
        future = self._jobs.ask(lambda: work(self._seen(viewer, lists=True) if viewer else self._prepared()))
        self._wake.set()
        if self._stopped:
            self._jobs.cancel()
        return future

    # The thread that renders.

    def _run(self) -> None:
        """Works until `stop`."""
        turn = 0
        while not self._stopped:
            # Cleared before the wishes are looked at: a wish that comes later sets it again.
            self._wake.clear()
            busy = self._take_wishes() | self._jobs.do_one()
            for viewer in self.viewers:
                busy |= self._follow(viewer)
            open_pictures = [v for v in self.viewers if v.picture is not None and not v.picture.finished]
            if open_pictures:
                turn += 1
                # A picture without any state comes before those that only get better.
                first = [v for v in open_pictures if not v.has_state] or open_pictures
                self._step(first[turn % len(first)])
            elif not busy:
                self._wake.wait()

    def _take_wishes(self) -> bool:
        """Changes the scene as other threads have asked. Returns whether anything was asked for."""
        with self._lock:
            wishes, self._wishes = self._wishes, Wishes()
        if not wishes:
            return False
        errors: list[str] = []
        try:
            self._fulfil(wishes)
        except Exception as error:
            alone = wishes.one_by_one()
            if len(alone) == 1:
                errors += lines_of(error)
            for single in alone if len(alone) > 1 else ():
                try:
                    self._fulfil(single)
                except Exception as one:
                    errors += lines_of(one)
        self._telling.busy(None)
        self._telling.error(tuple(errors))
        return True

    def _fulfil(self, wishes: Wishes) -> None:
        """Fulfils wishes. Raises UserError if the scene refuses them; then nothing has changed."""
        afresh = wishes.scene is not None or wishes.left_out is not None
        if afresh:
            self._telling.busy("preparing the scene")
        state, change = self._state.with_wishes(wishes)
        self._state, self.changes = state, self.changes + 1
        for viewer in self.viewers:
            viewer.forget(paces=afresh)
        self._moves_in_tree &= not afresh
        self._telling.scene(change)

    def _prepared(self) -> Prepared:
        """The prepared scene of this moment, with the camera of the scene."""
        if self._state.prepared is None:
            self._telling.busy("preparing the scene")
            self._state = self._state.with_preparation()
        return self._state.prepared

    def _seen(self, viewer: Viewer, lists: bool) -> Prepared:
        """The prepared scene as a viewer sees it."""
        camera, size = viewer.shown or viewer.wanted
        return seen(self._prepared(), camera, size, lists)

    def _follow(self, viewer: Viewer) -> bool:
        """Begins a new picture if the viewer's camera or size or the scene has changed. Returns whether it has."""
        wanted = viewer.wanted
        if viewer.shown == wanted:
            return False
        viewer.shown, viewer.picture, viewer.has_state = wanted, None, False
        viewer.change, viewer.begun = self.changes, clock.now()
        try:
            self._prepared()
        except Exception as error:
            # It is the same for all viewers.
            self._telling.busy(None)
            self._telling.error(lines_of(error))
            return True
        try:
            viewer.picture = self._picture(viewer)
        except Exception as error:
            self._failed(viewer, error)
        return True

    def _failed(self, viewer: Viewer, error: Exception) -> None:
        """An error has ended a viewer's picture. The viewer is told, and the thread goes on."""
        self._telling.busy(None)
        try:
            viewer.failed(error)
        except Exception as other:
            self._telling.error(lines_of(other))

    def _picture(self, viewer: Viewer) -> LivePicture:
        """A new picture for a viewer."""
        begun = clock.now()
        prepared, rest = self._seen(viewer, lists=not self._moves_in_tree), None
        viewer.moving.placed(clock.now() - begun)
        if viewer.moving.before > LISTS and has_lists(prepared):
            self._moves_in_tree, viewer.moving = True, Pace()
            prepared = self._seen(viewer, lists=False)
        state, is_blurred = self._state, moves(self._state)
        if is_blurred:
            rest = lambda: (opened(self._seen(viewer, lists=True), state), viewer.resting)  # noqa: E731 - bound
        elif self._moves_in_tree:
            rest = lambda: (self._seen(viewer, lists=True), viewer.resting)  # noqa: E731 - bound to this viewer
        return LivePicture(prepared, self.target, viewer.moving, self._replays, rest, is_blurred)

    def _step(self, viewer: Viewer) -> None:
        """Computes and sends the next state of a viewer's picture."""
        try:
            self._telling.busy("compiling" if viewer.picture.is_new else None)
            frame = viewer.picture.step()
            self._telling.busy(None)
            viewer.has_state = True
            viewer.send(replace(frame, seconds=clock.now() - viewer.begun, change=viewer.change))
            viewer.failed(None)
        except Exception as error:
            # Without a picture, nothing is tried again until something changes.
            viewer.picture = None
            self._failed(viewer, error)
