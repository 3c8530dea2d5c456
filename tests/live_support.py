"""Small scenes for tests of the live picture, and a list of the states that a viewer gets."""

import threading
import time

import visray as vr
from visray.live.viewer import Viewer


def small_scene(**fields):
    """A ball on a floor under a lamp."""
    defaults = {
        "camera": vr.Camera(origin=(0.0, 1.0, 5.0), target=(0.0, 0.5, 0.0)),
        "lights": {"lamp": vr.PointLight(position=(3.0, 5.0, 4.0))},
        "materials": {"red": vr.Material(kd=(0.7, 0.1, 0.1))},
        "objects": {"floor": vr.Plane(), "ball": vr.Sphere(center=(0.0, 0.6, 0.0), radius=0.6, material="red")},
        "ambient": (0.3, 0.3, 0.3),
    }
    return vr.Scene(**(defaults | fields))


class Watcher:
    """A viewer, all states that it got, and the lines of all errors that it was told."""

    def __init__(self, size=(48, 32), camera=None):
        self.frames, self.told, self.news = [], [], threading.Condition()
        self.viewer = Viewer(self._send, size, camera, self.told.append)

    def _send(self, frame):
        with self.news:
            self.frames.append(frame)
            self.news.notify_all()

    def wait(self, good, seconds=120):
        """The first state for which `good` holds, from now on; None if there is none in time."""
        end, begun = time.monotonic() + seconds, len(self.frames)
        with self.news:
            while True:
                found = next((f for f in self.frames[begun:] if good(f)), None)
                if found is not None or time.monotonic() > end:
                    return found
                self.news.wait(max(end - time.monotonic(), 0.01))


def until(condition, seconds=60):
    """Whether a condition comes true in time."""
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.005)
    return bool(condition())
