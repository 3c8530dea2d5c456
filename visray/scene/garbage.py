"""Python's search for reference cycles, put off while very many objects are made that are in none."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Iterator[None]:
    """Puts the search for cycles off until the end; also a decorator.

    Each of 30,000 objects that are read or validated would be walked through again and again, as the search starts anew
    whenever so many more have been made: two thirds of the time.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
