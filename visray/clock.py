"""The clock. All of visray asks this one, so that what hangs on seconds can be tried with seconds that are made up."""

from collections.abc import Iterable
from time import perf_counter
from typing import Any


def now() -> float:
    """Seconds, from some moment on."""
    return perf_counter()


def kernel_seconds(kernels: Iterable[dict[str, Any]]) -> float:
    """How many seconds kernels ran, of Dr.Jit's history."""
    return sum(k["execution_time"] for k in kernels) / 1e3


# When visray was loaded, which it is first of all: where the time that a user gives begins on the command line.
LOADED = now()
