"""The report of `visray doctor`: versions, LLVM, backends and kernel cache of this machine, and whether a test picture
is right.
"""

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

from visray import llvm
from visray.errors import UserError
from visray.tables import Table
from visray.version import __version__

PACKAGES = {"Dr.Jit": "drjit", "Mitsuba": "mitsuba", "NumPy": "numpy", "OpenEXR": "OpenEXR"}
BACKENDS = {"llvm": "LLVM", "cuda": "CUDA", "metal": "Metal"}
SIZE = 32
GOOD = "ready"


def examine(render: Callable[[], np.ndarray]) -> dict[str, Any]:
    """The report as a dict for json.dumps. Its entry `verdict` is `ready`, or a text that says what is wrong.

    render: function that returns a test picture of shape (32, 32, 3). It is called only if a working LLVM is found;
        without LLVM, Dr.Jit would end the process.
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
    """`ready` if the test picture is right, or else a text that says what is wrong.

    Right: the shape is (SIZE, SIZE, 3), and the numbers are finite and not all equal.
    """
    try:
        picture = np.asarray(render())
    except (UserError, RuntimeError) as error:
        # Errors of Dr.Jit are RuntimeErrors; their first line says what happened.
        return f"the test picture could not be rendered: {(str(error).strip() or repr(error)).splitlines()[0]}"
    if picture.shape != (SIZE, SIZE, 3):
        return f"the test picture has the shape {picture.shape}; right would be {(SIZE, SIZE, 3)}"
    bad = int((~np.isfinite(picture)).any(axis=2).sum())
    if bad:
        return f"the test picture has {bad} pixels that are not finite; right would be none"
    if (picture == picture.flat[0]).all():
        return f"the test picture is {picture.flat[0]:g} everywhere; right would be a sphere before a background"
    return GOOD


def table(report: dict[str, Any]) -> Table:
    """The report as a table for the terminal, with two columns: name and value."""
    rows = Table(show_header=False, box=None, pad_edge=False)
    rows.add_column(style="bold", no_wrap=True)
    rows.add_column(overflow="fold")
    for name, value in report.items():
        if isinstance(value, dict):
            for key, entry in value.items():
                rows.add_row(f"{name}: {key}", _text(entry))
        else:
            rows.add_row(name, _text(value))
    return rows


def kernel_cache() -> dict[str, Any]:
    """Dr.Jit's cache of compiled kernels, as a dict: folder, number of files, size (MiB), largest size allowed."""
    folder = _cache_folder()
    sizes = []
    for path in folder.glob("*.bin") if folder else ():
        try:
            sizes.append(path.stat().st_size)
        except FileNotFoundError:
            # Another process removed the file in the meantime.
            continue
    limit = os.environ.get("DRJIT_CACHE_MAXSIZE") or "1G"
    return {
        "folder": folder and str(folder),
        "files": len(sizes),
        "MiB": round(sum(sizes) / 2**20, 1),
        "limit": "none" if limit == "0" else limit,
    }


def _cache_folder() -> Path | None:
    """The folder of Dr.Jit's kernel cache, or None if Dr.Jit stores no kernels on disk."""
    if "DRJIT_CACHE_DIR" in os.environ:
        return Path(os.environ["DRJIT_CACHE_DIR"])
    if sys.platform == "win32":
        return Path(tempfile.gettempdir(), "drjit")
    return Path(os.environ["HOME"], ".drjit") if "HOME" in os.environ else None


def _llvm(library: llvm.LLVM | None) -> dict[str, Any]:
    """The LLVM that is loaded, as a dict: path, version, how it was chosen, vector width and processor."""
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
    """Vector width (in single-precision numbers) and name of the processor, read from the code of a small kernel.

    None if the code does not contain it.
    """
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
