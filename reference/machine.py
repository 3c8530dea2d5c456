"""Where figures come from: date, processor, versions."""

import visray  # noqa: F401  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import mitsuba as mi

from visray.study.machine import machine as facts


def machine() -> dict:
    """Date, processor, threads and versions, Mitsuba's among them."""
    return facts() | {"mitsuba": mi.__version__}
