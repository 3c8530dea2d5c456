"""The door of the live picture's server: who comes from elsewhere is refused before anything of what he sends is read.

viser asks its callbacks only when a connection is open, and then still handles what arrived together with it. So the
question is put to websockets, on which viser is built.
"""

import asyncio
import inspect
import logging
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from importlib.metadata import version
from types import SimpleNamespace
from typing import Any

from visray import terminal
from visray.errors import UserError
from visray.live import guard
from visray.tables import silent_rich

# What goes wrong in connections, such as data that are no messages. It is shown only where somebody adds a handler.
LOG = logging.getLogger("visray.live")
LOG.addHandler(logging.NullHandler())
LOG.propagate = False
# What viser warns of when browsers leave while their page is built, or send what they should not.
WARNINGS = (r"Queued a .* on a closed connection", r"\[viser\] .* does not match annotation")
# Longest text of an error that is told, in characters.
LONGEST = 200

_making = threading.Lock()


def guarded_server(host: str, port: int, name: str) -> Any:
    """A server of viser that answers only those whom guard.is_welcome lets in.

    host, port: where it listens. If the port has just been taken, it has another one
    name: title of its panel

    Raises a UserError if this version of viser gives no way to refuse others.
    """
    import viser
    from viser import _messages

    for text in WARNINGS:
        warnings.filterwarnings("ignore", text)
    # viser's own end prints a line.
    with silent_rich():
        with _asking(host) as asked:
            server = viser.ViserServer(host=host, port=port, label=name, verbose=False)
        try:
            if not asked:
                raise LookupError
            # Each would let any page have the server published on the internet, at an address of viser's makers.
            for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
                server._websock_server.unregister_handler(message)
        except (AssertionError, AttributeError, LookupError):
            server.stop()
            raise UserError(
                f"the live picture cannot be kept to this machine with viser {version('viser')}; "
                "pip install 'viser==1.1.1'"
            ) from None
    return server


@contextmanager
def _asking(host: str) -> Iterator[list[bool]]:
    """A `with` block in which servers that viser starts ask the guard first. Gives a list that is filled when one
    does."""
    from viser.infra import _infra

    asked, names = [], guard.own_names(host)
    websockets = _infra.websockets
    serve = websockets.asyncio.server.serve

    def guarded(*arguments: Any, process_request: Any = None, **more: Any) -> Any:
        async def answer(connection: Any, request: Any) -> Any:
            if not guard.is_welcome(host, request.headers, names):
                return connection.respond(HTTPStatus.FORBIDDEN, guard.refusal(host))
            found = process_request(connection, request)
            return await found if inspect.isawaitable(found) else found

        asyncio.get_running_loop().set_exception_handler(_Noise())
        asked.append(True)
        return serve(*arguments, process_request=answer, **more | {"logger": LOG})

    # Only viser sees it, not others that use websockets at the same time.
    server = _changed(websockets.asyncio.server, serve=guarded)
    with _making:
        _infra.websockets = _changed(websockets, asyncio=_changed(websockets.asyncio, server=server))
        try:
            yield asked
        finally:
            _infra.websockets = websockets


def _changed(module: Any, **names: Any) -> SimpleNamespace:
    """The names of a module, some of them with other values."""
    return SimpleNamespace(**vars(module) | names)


class _Noise:
    """Takes what fails while a message is handled, which asyncio would print. The first one is told in a line."""

    def __init__(self) -> None:
        self.told = False

    def __call__(self, loop: Any, context: dict[str, Any]) -> None:
        error = context.get("exception")
        LOG.error(context.get("message", ""), exc_info=error)
        if not self.told and error is not None:
            self.told = True
            # Others choose what it says, and how long it is.
            terminal.note(f"a message of a browser cannot be used, {type(error).__name__}: {str(error)[:LONGEST]}")
