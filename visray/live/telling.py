"""What the engine of a live picture tells others: changes of the scene, errors, and what it is busy with."""

from collections.abc import Callable
from typing import Any

from visray.errors import UserError


class Telling:
    """Functions that are called with news, by their sort. News that nobody has heard yet are told to new listeners
    at once.

    An error of such a function is told as an error, and never ends the thread that tells.
    """

    def __init__(self) -> None:
        self._listeners: dict[str, list[Callable[[Any], None]]] = {"scene": [], "error": [], "busy": []}
        self._last: dict[str, Any] = {"error": (), "busy": None}

    def listen(self, sort: str, callback: Callable[[Any], None]) -> None:
        """Calls a function with all later news of a sort. It is called at once if something is wrong now, or if the
        engine is busy."""
        self._listeners[sort].append(callback)
        if self._last.get(sort):
            self._call(callback, self._last[sort])

    def scene(self, change: Any) -> None:
        """The scene has changed."""
        for callback in self._listeners["scene"]:
            self._call(callback, change)

    def error(self, lines: tuple[str, ...]) -> None:
        """Something is wrong, as the lines say; (): all is well again."""
        self._if_new("error", tuple(lines))

    def busy(self, text: str | None) -> None:
        """Pictures have to wait for something; None: no longer."""
        self._if_new("busy", text)

    def _if_new(self, sort: str, news: Any) -> None:
        """Tells news, unless they were the last that were told."""
        if news == self._last[sort]:
            return
        self._last[sort] = news
        for callback in self._listeners[sort]:
            self._call(callback, news)

    def _call(self, callback: Callable[[Any], None], news: Any) -> None:
        """Calls a listener. Its own error is told, too, but not one of a listener to errors."""
        try:
            callback(news)
        except Exception as error:
            if callback not in self._listeners["error"]:
                self.error(lines_of(error))


def lines_of(error: Exception) -> tuple[str, ...]:
    """What is said of an error: its lines if it is an error of the user."""
    if isinstance(error, UserError):
        return tuple(error.lines)
    return (f"internal error: {type(error).__name__}: {error}",)
