"""The time of an animated scene: a slider, and a button that plays it."""

import threading

from visray import clock
from visray.live.live import Live
from visray.live.ranges import step_of
from visray.live.widgets import rounded

# Seconds between two moments while the scene plays. The engine takes the newest one each time.
TICK = 1 / 15


class Playing:
    """A slider with the time, and a button that plays; both are hidden if the scene is still."""

    def __init__(self, live: Live):
        self.engine, self._lock = live.engine, threading.RLock()
        self._stopped, self._thread = threading.Event(), None
        gui = live.server.gui
        self.slider = gui.add_slider("time", 0.0, 1.0, 0.01, 0.0, hint="seconds", visible=False)
        self.button = gui.add_button("Play", icon="player-play", visible=False)
        self.shown = 0.0
        self.slider.on_update(live.safely(lambda event: self._moved()))
        self.button.on_click(live.safely(lambda event: self.pause() if self.plays else self.play()))
        live.on_stop(self.pause)
        self.changed()

    @property
    def plays(self) -> bool:
        """Whether the scene plays."""
        return self._thread is not None

    def changed(self) -> None:
        """The scene or its time has changed."""
        animation = self.engine.scene.animation
        is_animated = animation is not None and animation.duration > 0
        self.slider.visible = self.button.visible = is_animated
        if not is_animated:
            self.pause()
            return
        if self.slider.max != animation.duration:
            self.slider.max, self.slider.step = animation.duration, step_of(animation.duration)
        with self._lock:
            # While it plays, or while the slider is moved, the slider knows more than the engine.
            if not (self.plays or self.engine.seeks) and self.slider.value == self.shown:
                self._show(self.engine.time)

    def play(self) -> None:
        """Plays from the moment that is shown, again and again."""
        with self._lock:
            if self.plays:
                return
            self._stopped = threading.Event()
            self._thread = threading.Thread(target=self._run, args=(self._stopped,), daemon=True, name="visray play")
            self._thread.start()
            self.button.label, self.button.icon = "Pause", "player-pause"

    def pause(self) -> None:
        """Shows one moment, the last one."""
        with self._lock:
            if self.plays:
                self._stopped.set()
                self._thread = None
                self.button.label, self.button.icon = "Play", "player-play"

    def _run(self, stopped: threading.Event) -> None:
        """Moves the time until it is stopped."""
        last = clock.now()
        while not stopped.wait(TICK):
            now = clock.now()
            with self._lock:
                animation = self.engine.scene.animation
                if stopped.is_set() or animation is None:
                    return
                time = (self.slider.value + now - last) % animation.duration
                last = now
                self._show(time)
            self.engine.seek(time)

    def _show(self, time: float) -> None:
        """Shows a time in the slider."""
        self.shown = float(min(max(time, 0.0), self.slider.max))
        self.slider.value = self.shown

    def _moved(self) -> None:
        """Somebody has moved the slider."""
        with self._lock:
            if self.slider.value != self.shown:
                self.shown = self.slider.value
                self.engine.seek(rounded(self.shown))
