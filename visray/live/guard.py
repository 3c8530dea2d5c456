"""Who may reach the live picture: this machine alone, unless the user says otherwise, and no page of another site."""

import errno
import ipaddress
import socket
import threading
from collections.abc import Collection
from importlib.util import find_spec
from typing import Any
from urllib.parse import urlsplit

from visray.errors import UserError

DEFAULT_PORT = 8080
LOCAL = "127.0.0.1"
# Number of ports that are tried when a free one is looked for.
TRIED = 200


def check_installed() -> None:
    """Raises a UserError if viser is not installed. Does not import it, as this takes long."""
    try:
        found = find_spec("viser") is not None
    except ValueError:
        found = False
    if not found:
        raise UserError("the live picture needs viser: pip install 'visray[view]'")


def is_local(host: str) -> bool:
    """Whether a host is this machine, as seen from itself."""
    name = host.strip("[]").lower()
    if name == "localhost":
        return True
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False


def is_free(host: str, port: int) -> bool:
    """Whether a server can listen at a port. Raises a UserError if the host is none of this machine."""
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except (OSError, UnicodeError) as error:
        raise UserError(f"--host = {host!r}: {_reason(error)}; {LOCAL} is this machine alone, 0.0.0.0 all") from None
    for family, kind, protocol, _, address in found:
        with socket.socket(family, kind, protocol) as probe:
            # As servers do, so that a port of a server that has just ended is free.
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                probe.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            try:
                probe.bind(address)
            except PermissionError:
                raise UserError(f"--port = {port}: needs the rights of an administrator; take 1024 or more") from None
            except OSError as error:
                if isinstance(error, OSError) and error.errno not in _taken():
                    raise UserError(f"--host = {host!r}: {_reason(error)}; {LOCAL} is this machine alone") from None
                return False
    return True


def chosen_port(host: str, port: int | None) -> int:
    """The port to listen at. port: the port asked for; None: the usual one, or another one that is free.

    Raises a UserError if the port that was asked for is taken; it names a free one.
    """
    if port is not None and not 1 <= port <= 65535:
        raise UserError(f"--port = {port}: must be a number from 1 to 65535")
    first = DEFAULT_PORT if port is None else port
    if is_free(host, first):
        return first
    others = (p for p in range(first + 1, min(first + TRIED, 65536)) if is_free(host, p))
    free = next(others, None)
    if port is None and free is not None:
        return free
    advice = f"--port {free} is free" if free is not None else "choose another one"
    raise UserError(f"--port = {first}: is taken by another program; {advice}")


def own_names(host: str) -> set[str]:
    """Names of this machine, in small letters. One that only its network knows may come a little later.

    host: where the server listens
    """
    full = socket.gethostname().lower()
    short = full.partition(".")[0]
    names = {"localhost", host.lower(), full, short, f"{short}.local"} - {""}
    if not is_local(host):
        # Others are asked for it, who may not answer.
        threading.Thread(target=lambda: names.add(socket.getfqdn().lower()), daemon=True).start()
    return names


def is_welcome(host: str, headers: Any, names: Collection[str] = ()) -> bool:
    """Whether a request comes from a page of this server, and not from a page of another site that a browser on this
    machine shows.

    host: where the server listens
    headers: headers of the request, by name
    names: own_names(host)
    """
    try:
        origin, asked = headers.get("Origin"), headers.get("Host") or ""
        named = (urlsplit(f"//{asked}").hostname or "").rstrip(".")
        # A site that gives its own name the address of this machine is no page of this server either.
        if not (is_local(named) if is_local(host) else _is_address(named) or named in names):
            return False
        return origin is None or urlsplit(origin).netloc.lower() == asked.lower()
    except (ValueError, LookupError):
        return False  # no address, or two of them


def refusal(host: str) -> str:
    """What those read who are not welcome."""
    if is_local(host):
        return f"Only {LOCAL} is answered here, and no page of another site.\n"
    return (
        "Only the addresses and names of this machine are answered here, and no page of another site. Use its number, "
        "as in http://192.168.1.5:8080, or start with the name: --host NAME\n"
    )


def url_of(host: str, port: int) -> str:
    """The address for a browser on this machine."""
    shown = "localhost" if host in ("0.0.0.0", "::", "") else f"[{host}]" if ":" in host else host
    return f"http://{shown}:{port}"


def _is_address(name: str) -> bool:
    """Whether a name is the number of a machine, which no site can have as its name."""
    try:
        return bool(ipaddress.ip_address(name))
    except ValueError:
        return False


def _taken() -> tuple[int, ...]:
    return errno.EADDRINUSE, getattr(errno, "WSAEADDRINUSE", errno.EADDRINUSE), errno.EACCES


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
