"""Addresses of clusters: tcp://HOST:PORT of a scheduler, or local:N for N workers on this machine."""

import re
from contextlib import suppress
from importlib.util import find_spec
from ipaddress import ip_address

from visray.cluster.local import check_count
from visray.errors import UserError

ADDRESS = re.compile(r"(?:tcp|tls)://(\S+):(\d+)")
LOCAL = re.compile(r"local:(-?\d+)")
PORTS = range(1, 65536)
# Length of a name, and of each of its parts between dots (RFC 1035).
NAME, PART = 253, 63


def local_count(address: str) -> int | None:
    """The number of workers on this machine; None for the address of a scheduler."""
    found = LOCAL.fullmatch(address)
    return None if found is None else int(found[1])


def check_address(address: str) -> None:
    """Raises UserError if this is not the address of a cluster, or if Dask is not installed."""
    if (count := local_count(address)) is not None:
        check_count(address, count)
    elif (found := ADDRESS.fullmatch(address)) is not None:
        _check_host(address, found[1], int(found[2]))
    else:
        raise UserError(
            f"cluster = {address!r}: must be the address of a scheduler, such as tcp://host:8786, or local:N"
        )
    if find_spec("distributed") is None:
        raise UserError(f"cluster = {address!r}: needs Dask, which is not installed: pip install 'visray[cluster]'")


def _check_host(address: str, host: str, port: int) -> None:
    """Raises UserError if no machine can have this name or number, or if there is no such port.

    address: what the user gave, for messages
    host: a name, a number as in 10.0.0.1, or one in brackets as in [::1]
    """
    if port not in PORTS:
        raise UserError(f"cluster = {address!r}: the port must be from {PORTS[0]} to {PORTS[-1]}; Dask's own is 8786")
    if not (_is_number(host) or _is_name(host)):
        raise UserError(f"cluster = {address!r}: {host} is no name of a machine; write one as in tcp://host:8786")


def _is_number(host: str) -> bool:
    """Whether this is the number of a machine in a network."""
    bracketed = host.startswith("[") and host.endswith("]")
    with suppress(ValueError):
        return ip_address(host[1:-1] if bracketed else host).version == (6 if bracketed else 4)
    return False


def _is_name(host: str) -> bool:
    """Whether this may be the name of a machine. A name of digits and dots is a number that is wrong."""
    parts = host.removesuffix(".").split(".")
    if len(host) > NAME or all(part.isdigit() for part in parts):
        return False
    return all(len(part) <= PART and re.fullmatch(r"\w([\w-]*\w)?", part) for part in parts)
