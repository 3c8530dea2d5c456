"""Python's garbage collector (its search for reference cycles), paused while very many objects are created."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Iterator[None]:
    """Pauses the garbage collector in a `with` block; also a decorator.

    Python starts the collector each time a certain number of Python objects has been created, and it then visits all of
    them. For a scene of 30,000 objects this takes two thirds of the time of reading or validating, although they form
    no cycles.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
