"""A viewer: one browser, with its own camera and the size of its window."""

import threading
from collections.abc import Callable
from typing import Any

from visray.live.frame import Frame
from visray.live.pace import Pace
from visray.live.picture import LivePicture
from visray.live.telling import lines_of


class Viewer:
    """What one browser looks at, and where its pictures go.

    send: function that gets each new state of the picture. It is called in the thread that renders, and must return at
        once.
    size: width and height of the picture in pixels.
    camera: a camera, or None for that of the scene.
    fail: function that gets the lines of an error that only this viewer has, such as that of a camera in its own
        target, and () when it sees a picture again. It is called as `send` is.

    The other fields belong to the engine (engine.py), in the thread that renders.
    """

    def __init__(
        self,
        send: Callable[[Frame], None],
        size: tuple[int, int],
        camera: Any = None,
        fail: Callable[[tuple[str, ...]], None] = lambda lines: None,
    ):
        self.send, self.fail = send, fail
        self._lines: tuple[str, ...] = ()
        self._wanted = (camera, size)
        self._lock = threading.Lock()
        self.changed: Callable[[], None] = lambda: None
        self.shown: tuple[Any, tuple[int, int]] | None = None
        self.picture: LivePicture | None = None
        self.has_state = False
        self.moving, self.resting = Pace(), Pace()
        self.change, self.begun = 0, 0.0

    def look(self, camera: Any = None, size: tuple[int, int] | None = None) -> None:
        """Looks with another camera, or at a picture of another size. May be called from any thread. Only the newest
        values count."""
        with self._lock:
            old_camera, old_size = self._wanted
            self._wanted = (camera or old_camera, size or old_size)
        self.changed()

    @property
    def wanted(self) -> tuple[Any, tuple[int, int]]:
        """The newest camera (None: that of the scene) and size."""
        with self._lock:
            return self._wanted

    def failed(self, error: Exception | None) -> None:
        """An error has ended its picture; None: it has a new state."""
        lines = () if error is None else lines_of(error)
        if lines != self._lines:
            self._lines = lines
            self.fail(lines)

    def forget(self, paces: bool) -> None:
        """The scene has changed: what is shown is old. paces: whether steps may take much longer or shorter now."""
        self.shown = None
        if paces:
            self.moving, self.resting = Pace(), Pace()
