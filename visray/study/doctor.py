"""What this computer offers to visray, and whether a picture comes out of it."""

import os
import platform
import re
import sys
import tempfile
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
from rich.table import Table

from visray import llvm
from visray.errors import UserError
from visray.version import __version__

PACKAGES = {"Dr.Jit": "drjit", "Mitsuba": "mitsuba", "NumPy": "numpy", "OpenEXR": "OpenEXR"}
BACKENDS = {"llvm": "LLVM", "cuda": "CUDA", "metal": "Metal"}
SIZE = 32
GOOD = "ready"


def examine(render: Callable[[], np.ndarray]) -> dict[str, Any]:
    """A report that json.dumps can write; `verdict` is `ready`, or what is wrong.

    `render` makes a real picture and returns it as (32, 32, 3). It is not called where LLVM would end the process.
    """
    report: dict[str, Any] = {
        "platform": platform.platform(),
        "Python": platform.python_version(),
        "visray": __version__,
        **{name: _version(package) for name, package in PACKAGES.items()},
    }
    try:
        library = llvm.require()
    except UserError as error:
        library, verdict = None, str(error)
    else:
        verdict = judge(render)
    report["LLVM"] = _llvm(library)
    report["backends"] = [name for name, backend in BACKENDS.items() if _has(backend)]
    report["threads"] = dr.thread_count()
    report["kernel cache"] = kernel_cache()
    return report | {"verdict": verdict}


def judge(render: Callable[[], np.ndarray]) -> str:
    """`ready` if the picture has the right shape, only finite numbers, and not all the same one; else what is wrong."""
    try:
        picture = np.asarray(render())
    except (UserError, RuntimeError) as error:
        # Dr.Jit's own errors are RuntimeErrors; the first line says what happened.
        return f"the test picture could not be rendered: {(str(error).strip() or repr(error)).splitlines()[0]}"
    if picture.shape != (SIZE, SIZE, 3):
        return f"the test picture has the shape {picture.shape}; right would be {(SIZE, SIZE, 3)}"
    bad = int((~np.isfinite(picture)).any(axis=2).sum())
    if bad:
        return f"the test picture has {bad} pixels that are not finite; right would be none"
    if (picture == picture.flat[0]).all():
        return f"the test picture is {picture.flat[0]:g} everywhere; right would be objects before a background"
    return GOOD


def table(report: dict[str, Any]) -> Table:
    """The report as two columns for the terminal."""
    rows = Table(show_header=False, box=None, pad_edge=False)
    rows.add_column(style="bold", no_wrap=True)
    rows.add_column(overflow="fold")
    for name, value in report.items():
        if isinstance(value, dict):
            for key, part in value.items():
                rows.add_row(f"{name}: {key}", _text(part))
        else:
            rows.add_row(name, _text(value))
    return rows


def kernel_cache() -> dict[str, Any]:
    """Where Dr.Jit keeps compiled kernels, how many and how large they are (MiB), and how large they may become."""
    folder = _cache_folder()
    sizes = []
    for path in folder.glob("*.bin") if folder else ():
        try:
            sizes.append(path.stat().st_size)
        except FileNotFoundError:
            # Another process has tidied up in the meantime.
            continue
    limit = os.environ.get("DRJIT_CACHE_MAXSIZE") or "1G"
    return {
        "folder": folder and str(folder),
        "files": len(sizes),
        "MiB": round(sum(sizes) / 2**20, 1),
        "limit": "none" if limit == "0" else limit,
    }


def _cache_folder() -> Path | None:
    """The folder that Dr.Jit uses, or None where it has none and keeps no kernels."""
    if "DRJIT_CACHE_DIR" in os.environ:
        return Path(os.environ["DRJIT_CACHE_DIR"])
    if sys.platform == "win32":
        return Path(tempfile.gettempdir(), "drjit")
    return Path(os.environ["HOME"], ".drjit") if "HOME" in os.environ else None


def _llvm(library: llvm.LLVM | None) -> dict[str, Any]:
    if library is None:
        return {"path": None, "version": None, "source": None}
    width, processor = _code_generation()
    return {
        "path": library.path,
        "version": ".".join(str(number) for number in library.version),
        "source": library.source,
        "vector width": width,
        "processor": processor,
    }


def _code_generation() -> tuple[int | None, str | None]:
    """How many single-precision numbers a vector holds, and for which processor, as the code of a kernel says."""
    from drjit.llvm import Float

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        dr.eval(dr.opaque(Float, 1, SIZE) + 1)
        codes = [entry["ir"].getvalue() for entry in dr.kernel_history() if entry.get("ir")]
    code = "\n".join(codes)
    width = re.search(r"<(\d+) x float>", code)
    processor = re.search(r'"target-cpu"="([^"]+)"', code)
    return int(width[1]) if width else None, processor[1] if processor else None


def _has(backend: str) -> bool:
    kind = getattr(dr.JitBackend, backend, None)
    return kind is not None and bool(dr.has_backend(kind))


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def _text(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(value) or "none"
    return "none" if value is None else str(value)
