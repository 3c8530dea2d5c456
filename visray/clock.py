"""The clock. All of visray reads time here, so that tests can replace it by made-up seconds."""

from collections.abc import Iterable
from time import perf_counter
from typing import Any


def now() -> float:
    """Seconds since an arbitrary moment."""
    return perf_counter()


def kernel_seconds(kernels: Iterable[dict[str, Any]]) -> float:
    """Total running time of kernels, in seconds. kernels: entries of Dr.Jit's kernel history."""
    return sum(k["execution_time"] for k in kernels) / 1e3


# The moment when visray was loaded. On the command line, a user's time limit is counted from here.
LOADED = now()
