"""What other threads may ask of the engine of a live picture, and what it tells them."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from visray.live.telling import Telling
from visray.live.wishes import Change, Wishes
from visray.scene.scene import Scene


class Asking:
    """Wishes of other threads, and functions that are called with news. All methods may be called from any thread."""

    def __init__(self) -> None:
        self._wishes, self._telling = Wishes(), Telling()
        self._wake, self._lock = threading.Event(), threading.RLock()

    def assign(self, values: Mapping[str, Any]) -> None:
        """Changes values of the scene, by address."""
        self._wish(lambda wishes: wishes.with_values(values))

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
        self._wish(lambda wishes: replace(wishes, seconds=seconds))

    def show(self, scene: Scene) -> None:
        """Shows another scene. All changes so far are forgotten."""
        self._wish(lambda wishes: replace(wishes, scene=scene, values={}))

    def leave_out(self, names: tuple[str, ...]) -> None:
        """Simulates all effects of the scene but these."""
        self._wish(lambda wishes: replace(wishes, left_out=tuple(names)))

    def on_scene(self, callback: Callable[[Change], None]) -> None:
        """Calls a function after each change of the scene, in the thread that renders."""
        self._telling.listen("scene", callback)

    def on_error(self, callback: Callable[[tuple[str, ...]], None]) -> None:
        """Calls a function with the lines of each error, and with () when all is well again."""
        self._telling.listen("error", callback)

    def on_busy(self, callback: Callable[[str | None], None]) -> None:
        """Calls a function with what the engine does when pictures have to wait for it, such as "compiling", and with
        None when it is done."""
        self._telling.listen("busy", callback)

    def _wish(self, change: Callable[[Wishes], Wishes]) -> None:
        """Changes the wishes, and wakes the thread that renders."""
        with self._lock:
            self._wishes = change(self._wishes)
        self._wake.set()
