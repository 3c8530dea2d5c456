"""Python's garbage collector (its search for reference cycles), paused while very many objects are created."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Iterator[None]:
    """Pauses the garbage collector in a `with` block; also a decorator.

    The collector starts again each time a certain number of objects has been created, and walks through all of them.
    Without the pause this takes two thirds of the time of reading or validating 30,000 objects of a scene, which are in
    no cycle.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
