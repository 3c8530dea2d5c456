"""Sends the states of a picture to one browser: only the newest, and only when the one before has arrived."""

import io
import threading
from collections.abc import Callable
from typing import Any

from PIL import Image

from visray.live.frame import Frame

# Qualities of JPEG, with full resolution of colours: while the picture gets better, and at rest, where an eye sees no
# difference.
MOVING, RESTING = 88, 97
# Seconds to wait for a browser to say that a picture has arrived. A page in the background may take longer; it gets the
# newest picture then.
PATIENCE = 5.0


def encoded(frame: Frame) -> bytes:
    """The state as a JPEG file.

    The squares at the right and lower edges of a coarse state may reach over the edges of the picture: they are cut, so
    that things stay at their place when the state gets finer.
    """
    picture = Image.fromarray(frame.rgb)
    box = frame.size[0] / frame.grain, frame.size[1] / frame.grain
    if box != picture.size:
        picture = picture.resize(picture.size, Image.Resampling.BILINEAR, (0, 0, *box))
    file = io.BytesIO()
    picture.save(file, "JPEG", quality=RESTING if frame.finished else MOVING, subsampling=0)
    return file.getvalue()


class Sender:
    """Sends states of a picture, in a thread of its own.

    show: function that sends one and returns when it has arrived. It raises an error if the browser has left.
    """

    def __init__(self, show: Callable[[Frame], None]):
        self.show = show
        self._newest: Frame | None = None
        self._closed = self._busy = False
        self._wake = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="visray sender", daemon=True)
        self._thread.start()

    def send(self, frame: Frame) -> None:
        """Sends a state soon. It replaces one that waits. Returns at once."""
        with self._wake:
            self._newest = frame
            self._wake.notify()

    @property
    def is_idle(self) -> bool:
        """Whether all that was to be sent has arrived."""
        with self._wake:
            return self._newest is None and not self._busy

    def close(self) -> None:
        """Sends nothing more."""
        with self._wake:
            self._closed, self._newest = True, None
            self._wake.notify()

    def _run(self) -> None:
        while True:
            with self._wake:
                while self._newest is None and not self._closed:
                    self._wake.wait()
                if self._closed:
                    return
                frame, self._newest, self._busy = self._newest, None, True
            try:
                self.show(frame)
            except Exception:
                # The browser has left, or the server has stopped: there is nobody to tell.
                if self._closed:
                    return
            with self._wake:
                self._busy = False


def shower(handle: Any) -> Callable[[Frame], None]:
    """A function that shows a state in a browser, and returns when it has arrived there.

    handle: viser's handle of the browser
    """
    from viser._messages import BackgroundImageMessage

    def show(frame: Frame) -> None:
        # Not by set_background_image, as this halves the resolution of colours.
        message = BackgroundImageMessage(format="jpeg", rgb_data=encoded(frame), depth_data=None)
        handle._websock_connection.queue_message(message)
        handle.flush()
        # Browsers handle messages in their order: when the question is answered, the picture is there.
        handle.local_storage.get_item("arrived", timeout=PATIENCE)

    return show
