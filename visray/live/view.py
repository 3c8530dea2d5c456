"""`vr.view`: a live picture of a scene, in a browser or in a notebook."""

import atexit
import html
import threading
import webbrowser
from pathlib import Path
from typing import Any

from visray.arguments import checked_arguments
from visray.errors import UserError
from visray.live import guard
from visray.scene.check import checked
from visray.scene.load import load
from visray.scene.scene import Scene

# Height of the picture in a notebook, in pixels.
NOTEBOOK_HEIGHT = 560
# Number of ports that are tried if other programs take each of them in that moment.
TRIES = 5


class LiveView:
    """A live picture that runs. It ends with `stop`, or with the program.

    url: its address, for a browser on this machine
    """

    def __init__(self, live: Any, url: str):
        self.live, self.url = live, url
        self._ended, self._stopping = threading.Event(), threading.Lock()
        atexit.register(self._end)

    def stop(self) -> bool:
        """Ends it. Returns whether all of it has ended; else a thread that compiles goes on for a while."""
        from visray.live import server

        with self._stopping:
            if self._ended.is_set():
                return server.has_ended(self.live)
            self._ended.set()
            atexit.unregister(self._end)
            return server.stop(self.live)

    def _end(self) -> None:
        """Ends it with the program."""
        from visray.live.server import stop_at_the_end

        self._ended.set()
        stop_at_the_end(self.live)

    def wait(self) -> None:
        """Waits until it is stopped, or until Ctrl-C, which ends it."""
        try:
            # With a limit, because Windows hears of Ctrl-C only between two waits.
            while not self._ended.wait(0.5):
                pass
        except KeyboardInterrupt:
            self.stop()

    def open(self) -> bool:
        """Shows it in the browser of this machine. Returns False if there is none."""
        try:
            return webbrowser.open(self.url)
        except webbrowser.Error:
            return False

    def __enter__(self) -> "LiveView":
        return self

    def __exit__(self, *error: Any) -> None:
        self.stop()

    def __repr__(self) -> str:
        return f"LiveView({self.url!r})"

    def _repr_html_(self) -> str:
        """The same page inside a notebook."""
        style = f"width:100%;height:{NOTEBOOK_HEIGHT}px;border:0"
        return f'<iframe src="{html.escape(self.url)}" style="{style}" title="visray"></iframe>'


@checked_arguments
def view(
    scene: Scene | str | Path,
    *,
    host: str = guard.LOCAL,
    port: int | None = None,
    error: float = 0.01,
    name: str | None = None,
) -> LiveView:
    """A live picture of a scene: it turns under the mouse, follows sliders, and gets better while it rests.

    scene: a scene, or the path of a scene file, whose changes are followed
    host: where the server listens. The default can be reached from this machine alone; through any other host, anybody
        who reaches it can change the scene.
    port: its port. None: 8080, or the next free one
    error: the picture gets better until its error is no larger
    name: name of the scene. Default: that of the file, or "scene"

    Returns at once. In a notebook the value shows itself. A script goes on, and its end ends the live picture:
    `vr.view(scene).wait()` waits for Ctrl-C. Needs viser: pip install 'visray[view]'.
    """
    if not isinstance(error, (int, float)) or not 0 < error < 1:
        raise UserError(f"error = {error!r}: must be a number between 0 and 1, such as 0.01")
    path = Path(scene) if isinstance(scene, (str, Path)) else None
    loaded = checked(scene) if path is None else load(path)
    shown = name or (path.stem if path is not None else "scene")
    words = ["visray", "view", str(path)] if path is not None else []
    return started(
        loaded, name=shown, host=host, port=port, error=error, file=path, command=words,
        load=None if path is None else lambda: load(path),
    )  # fmt: skip


def started(scene: Scene, *, host: str, port: int | None, error: float, **more: Any) -> LiveView:
    """Starts a live picture. more: as for serve (server.py)."""
    guard.check_installed()
    from visray.live.server import serve

    for left in reversed(range(TRIES)):
        chosen = guard.chosen_port(host, port)
        try:
            live = serve(scene, host=host, port=chosen, target=error, **more)
            break
        except UserError:
            # Another program may take the port in between.
            if port is not None or not left or guard.is_free(host, chosen):
                raise
    return LiveView(live, guard.url_of(host, chosen))
