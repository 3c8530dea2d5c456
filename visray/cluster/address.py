"""Addresses of clusters: tcp://HOST:PORT of a scheduler, or local:N for N workers on this machine."""

import re
from importlib.util import find_spec

from visray.cluster.local import check_count
from visray.errors import UserError

ADDRESS = re.compile(r"(tcp|tls)://\S+:\d+")
LOCAL = re.compile(r"local:(-?\d+)")


def local_count(address: str) -> int | None:
    """The number of workers on this machine; None for the address of a scheduler."""
    found = LOCAL.fullmatch(address)
    return None if found is None else int(found[1])


def check_address(address: str) -> None:
    """Raises UserError if this is not the address of a cluster, or if Dask is not installed."""
    if (count := local_count(address)) is not None:
        check_count(address, count)
    elif not ADDRESS.fullmatch(address):
        raise UserError(
            f"cluster = {address!r}: must be the address of a scheduler, such as tcp://host:8786, or local:N"
        )
    if find_spec("distributed") is None:
        raise UserError(f"cluster = {address!r}: needs Dask, which is not installed: pip install 'visray[cluster]'")
