"""Where figures come from: date, processor, versions."""

import platform
from datetime import date
from pathlib import Path

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import drjit as dr
import mitsuba as mi


def machine() -> dict:
    """Date, processor, threads and versions."""
    name = platform.processor() or platform.machine()
    if Path("/proc/cpuinfo").exists():
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        name = next((l.split(":", 1)[1].strip() for l in lines if l.startswith("model name")), name)
    return {
        "date": date.today().isoformat(),
        "cpu": name,
        "threads": dr.thread_count(),
        "python": platform.python_version(),
        "visray": vr.__version__,
        "drjit": dr.__version__,
        "mitsuba": mi.__version__,
        "llvm": ".".join(map(str, dr.detail.llvm_version())),
    }
