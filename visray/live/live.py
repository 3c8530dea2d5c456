"""A running live picture, and how parts of its page plug in.

A part is a class in a module of its own: a panel of sliders, the story of a pixel, buttons that save. parts.py lists
all of them. The server builds each of them once, after the engine has started and before the first browser comes:

    class XPart:
        def __init__(self, live: Live): ...

In it, a part
- puts widgets that all browsers share into a tab: `with tab(live.server, "Scene"): ...`, tabs.py
- puts what only one browser shows into `client.handle.gui`, in a function that it gives to `live.on_client`
- has the scene changed: `live.engine.assign({address: value})`, and follows its changes: `live.engine.on_scene`
- follows clicks: `live.on_pick`, and what ends: `live.on_stop`
- does work with Dr.Jit: `live.ask(lambda prepared: ..., client)`, not in the thread that renders
- does long work in a thread of its own: `live.begin(work, "its name", stop)`
- says errors that stay until they are mended: `live.say_errors("file", lines)`; () when all is well again
- follows errors that a single browser has: `live.on_fail`
- says a sentence in passing: `live.tell("heart.json: written")`
- wraps callbacks of widgets: `@live.safely`, so that an error is told in the page and never lost.

Callbacks of widgets run in threads of viser. They may take long, but must not call Dr.Jit. Those of the engine run in
the thread that renders, and must return soon. Texts from files become HTML by `escaped`.
"""

import html
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

from visray import terminal, work_threads
from visray.errors import UserError
from visray.live.engine import Engine

if TYPE_CHECKING:
    from visray.live.client import Client
    from visray.live.viewpoint import Space
    from visray.scene.scene import Scene
    from visray.study.pixel.story import PixelStory
    from visray.surface_picture.recipe import Recipe


@dataclass(frozen=True)
class Pick:
    """What was clicked.

    client: the browser
    pixel: column and row in the browser's picture
    size: width and height of this picture
    address: address of the object; None for the background
    point: the point of its surface, in world units; None for the background
    story: why the pixel has its colour
    """

    client: "Client"
    pixel: tuple[int, int]
    size: tuple[int, int]
    address: str | None
    point: tuple[float, float, float] | None
    story: "PixelStory"


@dataclass(eq=False)
class Live:
    """A running live picture.

    engine: renders it, in a thread of its own
    server: the server of viser
    name: name of the scene, as the page shows it
    file: the scene's file; None for a scene made in Python
    command: words of the command line that shows this scene, without those that change values
    load: reads the scene again, as when its file has changed; None for a scene made in Python
    recipe: how `visray surface` has made the scene; None for other scenes
    space: coordinates of the pages
    clients: all browsers, by number
    errors: what is wrong, by who says so
    ended: is set when the live picture ends
    threads: threads of the parts
    parts: all parts
    """

    engine: Engine
    server: Any
    name: str
    space: "Space"
    file: Path | None = None
    command: list[str] = field(default_factory=list)
    load: Callable[[], "Scene"] | None = None
    recipe: "Recipe | None" = None
    clients: dict[int, "Client"] = field(default_factory=dict)
    errors: dict[str, tuple[str, ...]] = field(default_factory=dict)
    ended: threading.Event = field(default_factory=threading.Event)
    threads: list[threading.Thread] = field(default_factory=list)
    parts: list[Any] = field(default_factory=list)
    _client_listeners: list[Callable] = field(default_factory=list)
    _leave_listeners: list[Callable] = field(default_factory=list)
    _frame_listeners: list[Callable] = field(default_factory=list)
    _pick_listeners: list[Callable] = field(default_factory=list)
    _error_listeners: list[Callable] = field(default_factory=list)
    _fail_listeners: list[Callable] = field(default_factory=list)
    _stop_listeners: list[Callable] = field(default_factory=list)

    def on_client(self, callback: Callable[["Client"], None]) -> None:
        """Calls a function with each browser that comes."""
        self._client_listeners.append(callback)

    def on_leave(self, callback: Callable[["Client"], None]) -> None:
        """Calls a function with each browser that has left."""
        self._leave_listeners.append(callback)

    def on_frame(self, callback: Callable[..., None]) -> None:
        """Calls a function with a browser and each new state of its picture (frame.py). It is called in the thread that
        renders, and must return at once."""
        self._frame_listeners.append(callback)

    def on_pick(self, callback: Callable[[Pick], None]) -> None:
        """Calls a function with each click on the picture, after its story is known."""
        self._pick_listeners.append(callback)

    def on_errors(self, callback: Callable[[dict[str, tuple[str, ...]]], None]) -> None:
        """Calls a function with the errors of all sources after each change of them."""
        self._error_listeners.append(callback)

    def on_fail(self, callback: Callable[["Client", tuple[str, ...]], None]) -> None:
        """Calls a function with a browser and the lines of an error that only this one has; () when it sees a picture
        again. It is called in the thread that renders."""
        self._fail_listeners.append(callback)

    def on_stop(self, callback: Callable[[], None]) -> None:
        """Calls a function when the live picture ends."""
        self._stop_listeners.append(callback)

    def ask(self, work: Callable[[Any], Any], client: "Client | None" = None) -> Any:
        """The result of some work in the thread that renders (Engine.ask). Waits for it. Not for that thread itself.

        client: the browser whose view it is about; None: the scene's camera
        """
        future = self.engine.ask(work, client and client.viewer)
        while not self.ended.is_set():
            try:
                return future.result(timeout=0.1)
            except TimeoutError:
                if future.done():
                    raise
            except CancelledError:
                break
        raise UserError("the live picture has ended")

    def begin(self, work: Callable[[], None], name: str, stop: Callable[[], None]) -> None:
        """Begins a thread that may take long, or work with Dr.Jit. It has ended before Python ends.

        stop: asks it to stop soon, and returns at once
        """
        self.threads = [t for t in self.threads if t.is_alive()] + [work_threads.begun(work, name, stop)]

    def came(self, client: "Client") -> None:
        """A browser has come."""
        self.clients[client.number] = client
        self._call(self._client_listeners, client)

    def left(self, client: "Client") -> None:
        """A browser has left."""
        self.clients.pop(client.number, None)
        self._call(self._leave_listeners, client)

    def shown(self, client: "Client", frame: Any) -> None:
        """A browser's picture has a new state."""
        self._call(self._frame_listeners, client, frame)

    def failed(self, client: "Client", lines: tuple[str, ...]) -> None:
        """A browser sees nothing because of an error, or a picture again."""
        self._call(self._fail_listeners, client, lines)

    def picked(self, pick: Pick) -> None:
        """A browser has clicked on its picture."""
        self._call(self._pick_listeners, pick)

    def stopped(self) -> None:
        """The live picture ends."""
        self.ended.set()
        self._call(self._stop_listeners)

    def say_errors(self, source: str, lines: Sequence[str]) -> None:
        """Shows errors in all pages until they are mended.

        source: who says so, such as "file"; each source has its own lines
        lines: the errors; () if all is well
        """
        known = self.errors.get(source, ())
        self.errors[source] = tuple(lines)
        if known != tuple(lines):
            self._call(self._error_listeners, dict(self.errors))

    def tell(self, text: str, client: "Client | None" = None, bad: bool = False) -> None:
        """Shows a sentence for some seconds. client: the browser; None: all. bad: whether it is an error."""
        for one in [client] if client else list(self.clients.values()):
            one.handle.add_notification(
                title="" if not bad else "This did not work",
                body=terminal.printable(text),
                auto_close_seconds=12.0 if bad else 6.0,
                color="red" if bad else None,
            )

    def safely(self, function: Callable) -> Callable:
        """A function that tells its errors in the page instead of raising them. For callbacks."""

        @wraps(function)
        def called(*arguments: Any, **named: Any) -> Any:
            try:
                return function(*arguments, **named)
            except UserError as error:
                self.tell("; ".join(error.lines), self.client_of(*arguments), bad=True)
            except Exception as error:
                self.tell(f"internal error: {type(error).__name__}: {error}", self.client_of(*arguments), bad=True)

        return called

    def client_of(self, *arguments: Any) -> "Client | None":
        """The browser whose event is among the arguments of a callback; None if there is none."""
        numbers = (getattr(x, "client_id", None) for x in arguments)
        return next((self.clients[n] for n in numbers if n in self.clients), None)

    def _call(self, listeners: list[Callable], *arguments: Any) -> None:
        """Calls functions. An error of one is told in the page; the others are called all the same."""
        for listener in list(listeners):
            self.safely(listener)(*arguments)


def escaped(text: Any) -> str:
    """A text as HTML that shows it, whatever it contains."""
    return html.escape(terminal.printable(str(text)))
