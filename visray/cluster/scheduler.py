"""Asks what answers at an address, before Dask's client connects to it: the client would wait without an end."""

import asyncio
import threading
from typing import Any

from visray.errors import UserError

# What the identity of a scheduler has as its type.
KIND = "Scheduler"


def check_scheduler(address: str, seconds: float) -> None:
    """Raises UserError if no Dask scheduler answers at an address.

    seconds: time for the answer, with all that comes before it
    """
    found: list[Any] = []
    arguments = _connection_arguments(address)

    def ask() -> None:
        try:
            found.append(asyncio.run(asyncio.wait_for(_identity(address, seconds, arguments), seconds)))
        # Whatever the bytes of another program make of Dask's reader; a wrong length, for example, is a MemoryError.
        except Exception as error:
            found.append(error)

    # A thread, because the caller may have a loop of its own, and because a search for a name cannot be interrupted.
    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    thread.join(seconds)
    if problem := _problem(found[0] if found else TimeoutError(), address, seconds):
        raise UserError(f"cluster = {address!r}: {problem}")


async def _identity(address: str, seconds: float, arguments: dict[str, Any]) -> Any:
    """What a scheduler says of itself."""
    from distributed.comm import connect

    comm = await connect(address, timeout=seconds, deserialize=False, **arguments)
    try:
        await comm.write({"op": "identity", "reply": True})
        return await comm.read()
    finally:
        comm.abort()


def _connection_arguments(address: str) -> dict[str, Any]:
    """What Dask's configuration says of connections. Raises UserError if it does not fit the address."""
    from distributed.security import Security

    try:
        arguments = Security().get_connection_args("client")
    except (OSError, ValueError) as error:
        raise UserError(f"cluster = {address!r}: Dask's configuration of TLS cannot be used, {error}") from None
    if address.startswith("tls://") and arguments.get("ssl_context") is None:
        text = "needs certificates; give Dask their files as distributed.comm.tls (docs/cluster.md)"
        raise UserError(f"cluster = {address!r}: {text}")
    if address.startswith("tcp://") and arguments.get("require_encryption"):
        raise UserError(f"cluster = {address!r}: Dask's configuration asks for encryption; use an address with tls://")
    return arguments


def _problem(found: Any, address: str, seconds: float) -> str | None:
    """What is wrong with an answer; None if it is that of a scheduler. found: the answer, or the error"""
    from distributed.comm.core import CommClosedError

    if isinstance(found, dict) and found.get("type") == KIND:
        return None
    if isinstance(found, dict) and "type" in found:
        return f"is the address of a {str(found['type']).lower()}, not of a scheduler; give the scheduler's"
    if isinstance(found, OSError) and not isinstance(found, CommClosedError):
        return f"no scheduler answers within {seconds:g} s; start one with: dask scheduler"
    other = "tcp" if address.startswith("tls") else "tls"
    return f"is no Dask scheduler, or one for {other}://; give the address that `dask scheduler` prints"
