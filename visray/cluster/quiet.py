"""Keeps what Dask says about itself from the user's terminal."""

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

# The loggers of Dask's scheduler and client, and of the libraries that they use.
LOGGERS = ("distributed", "tornado", "asyncio", "bokeh")


@contextmanager
def quiet() -> Iterator[None]:
    """A `with` block in which Dask logs nothing and warns of nothing. Errors are still raised."""
    loggers = [logging.getLogger(name) for name in LOGGERS]
    # Dask gives its own loggers levels and handlers when it is imported, so all that exist by now are asked.
    loggers += [
        logging.getLogger(name) for name in list(logging.root.manager.loggerDict) if name.split(".")[0] in LOGGERS
    ]
    levels = [logger.level for logger in loggers]
    try:
        for logger in loggers:
            logger.setLevel(logging.CRITICAL + 1)
        # These filters stay. A generator, which the caller may leave at any time, could not take them back in order.
        for name in LOGGERS:
            warnings.filterwarnings("ignore", module=rf"{name}(\.|$)")
        yield
    finally:
        for logger, level in zip(loggers, levels):
            logger.setLevel(level)
