"""A browser that shows the live picture: its window, its camera, and where its pictures go."""

import math
import threading
from collections import deque
from typing import Any

from visray.animation.moment import assignments, still_at
from visray.live.engine import Change, Engine
from visray.live.frame import Frame
from visray.live.reshaping import reshaped
from visray.live.sending import PATIENCE, Sender, shower
from visray.live.viewer import Viewer
from visray.live.viewpoint import Pose, camera_at, page_fov, pose_of, widened, widening

# A picture has at most this many pixels; in a larger window each of them is shown larger.
MOST_PIXELS = 2_200_000
# Fields of a camera that say where it is. When one of them is set, all browsers go there.
PLACE = ("origin", "target", "up", "height", "type")
# Number of poses that a browser was sent and may still report.
REMEMBERED = 64
# A page that opens reports poses of its own first, which look at the origin from these distances.
STRAY = 5.0, 27**0.5
# Seconds that a page has to make room for its panel before its first picture.
LAYOUT = 0.4


def picture_size(window: tuple[int, int]) -> tuple[int, int]:
    """Width and height of the picture for a window, both in pixels."""
    scale = min(1.0, math.sqrt(MOST_PIXELS / (window[0] * window[1])))
    return tuple(max(round(n * scale), 8) for n in window)


def camera_of_scene(engine: Engine) -> Any:
    """The camera of the scene at the moment that is shown."""
    scene = engine.scene
    if scene.animation is None or not any(a.startswith("camera") for a in assignments(scene, engine.time)):
        return scene.camera
    return still_at(scene, engine.time).camera


def is_stray(pose: Pose) -> bool:
    """Whether a pose is one that a page has while it opens, before it knows of the scene."""
    away = math.hypot(*pose.position)
    return math.hypot(*pose.look_at) < 1e-6 and any(math.isclose(away, x, rel_tol=1e-6) for x in STRAY)


class Client:
    """A browser.

    live: the live picture (live.Live)
    number: its number, unique in a live picture
    handle: viser's handle of it
    viewer: what the engine renders for it
    camera: its camera as a camera of the scene, for a picture of the film's shape
    frame: newest state of its picture; None before the first
    """

    def __init__(self, live: Any, handle: Any):
        self.live, self.handle, self.number = live, handle, handle.client_id
        self.frame: Frame | None = None
        self.base = camera_of_scene(live.engine)
        self.camera = self.base
        self.window = (640, 480)
        self._pose: Pose | None = None  # None: where the scene's camera is
        self._sent = deque([pose_of(self.base, live.space)], maxlen=REMEMBERED)
        self._fov: float | None = None
        self._arrived = False
        self._lock = threading.RLock()
        self._windows, self._laid_out = 0, threading.Event()
        self._send = shower(handle)
        self.sender = Sender(self._sent_to_page)
        self.viewer = Viewer(self._show, picture_size(self.window), self.base, lambda lines: live.failed(self, lines))

    @property
    def at_home(self) -> bool:
        """Whether it looks from where the scene's camera is."""
        return self._pose is None

    @property
    def _film(self) -> tuple[int, int]:
        """Width and height of the scene's film, in pixels."""
        return self.live.engine.scene.film.size

    def look(self, pose: Pose, window: tuple[int, int]) -> None:
        """The browser says where its camera is. window: width and height in pixels."""
        if min(window) < 8 or max(window) > 20_000 or not pose.is_valid():
            return
        with self._lock:
            other, self.window = window != self.window, window
            self._windows += other
            if self._windows > 1:
                self._laid_out.set()
            # While nobody has moved it, it reports the poses that it was sent, some of them late.
            known = list(self._sent) if self.at_home else [pose_of(self.base, self.live.space)]
            is_home = any(pose.is_same(p) for p in known)
            self._arrived = self._arrived or not is_stray(pose)
            self._pose = None if is_home or not self._arrived else pose
            self._follow()
        if other and self.frame is not None:
            # The page would stretch the picture that it shows.
            self.sender.send(self.frame)

    def _sent_to_page(self, frame: Frame) -> None:
        """Sends a state. The first one waits until the page has made room for the panel. In the thread that sends."""
        if not self._laid_out.is_set():
            # Messages are handled in their order: when this one is answered, the panel is known.
            self.handle.local_storage.get_item("opened", timeout=PATIENCE)
            self._laid_out.wait(LAYOUT)
            self._laid_out.set()
        self._send(reshaped(frame, self.window, self._film))

    def rebased(self, change: Change) -> None:
        """The scene has changed: its camera may have, too."""
        base = camera_of_scene(self.live.engine)
        told = any(a == "camera" or a.startswith(tuple(f"camera.{f}" for f in PLACE)) for a in change.addresses)
        with self._lock:
            before, self.base = pose_of(self.base, self.live.space), base
            if told:
                self._pose = None
            if self.at_home and (told or not pose_of(base, self.live.space).is_same(before)):
                self.go_home()
            self._follow()

    def go_home(self) -> None:
        """Looks from where the scene's camera is."""
        with self._lock:
            self._pose = None
            pose = pose_of(self.base, self.live.space)
            self._sent.append(pose)
            self._place(pose)
            self._follow()

    def go_to(self, pose: Pose) -> None:
        """Looks from another place."""
        with self._lock:
            self._pose = pose
            self._place(pose)
            self._follow()

    def turn_around(self, point: Any) -> None:
        """Turns the camera to a point of the scene, around which the mouse turns it from now on."""
        with self._lock:
            now = self._pose or pose_of(self.base, self.live.space)
            self.go_to(Pose(now.position, self.live.space.to_page(point), now.up))

    def leave(self) -> None:
        """The browser has left."""
        self.sender.close()
        self.live.engine.remove(self.viewer)

    def _place(self, pose: Pose) -> None:
        """Moves the camera in the browser."""
        camera = self.handle.camera
        if not camera._state.update_timestamp:
            return
        with self.handle.atomic():
            camera.up_direction = pose.up
            camera.position = pose.position
            camera.look_at = pose.look_at

    def _follow(self) -> None:
        """Renders with the newest camera."""
        pose = self._pose
        self.camera = self.base if pose is None else camera_at(self.base, pose, self.live.space)
        factor = widening(self._film, self.window)
        fov = math.radians(page_fov(self.base, factor))
        if fov != self._fov and self.handle.camera._state.update_timestamp:
            self._fov, self.handle.camera.fov = fov, fov
        self.viewer.look(camera=widened(self.camera, factor), size=picture_size(self.window))

    def _show(self, frame: Frame) -> None:
        """Gets a new state of the picture, in the thread that renders."""
        self.frame = frame
        self.sender.send(frame)
        self.live.shown(self, frame)
