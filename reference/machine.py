"""When, where and with which versions figures were measured, with Mitsuba's version."""

import visray  # noqa: F401  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import mitsuba as mi

from visray.study.machine import machine as facts


def machine() -> dict:
    """Date, processor, number of threads, and versions, as a dict for a report."""
    return facts() | {"mitsuba": mi.__version__}
