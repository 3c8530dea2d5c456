"""When, where and with which versions figures were measured."""

import platform
from datetime import date
from pathlib import Path
from typing import Any

import drjit as dr

from visray.version import __version__


def machine() -> dict[str, Any]:
    """Date, processor, number of threads, and versions of packages and of LLVM, as a dict for a report."""
    cpu, info = platform.processor() or platform.machine(), Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text().splitlines()
        cpu = next((l.split(":", 1)[1].strip() for l in lines if l.startswith("model name")), cpu)
    return {
        "date": date.today().isoformat(),
        "cpu": cpu,
        "threads": dr.thread_count(),
        "python": platform.python_version(),
        "visray": __version__,
        "drjit": dr.__version__,
        "llvm": ".".join(map(str, dr.detail.llvm_version())),
    }
