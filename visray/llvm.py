"""Finds a libLLVM that Dr.Jit can use, before Dr.Jit is imported.

Dr.Jit loads a libLLVM when it is imported: the first one that it finds. With LLVM 15 and 16, which many distributions
ship, the process aborts in the middle of a render, and no exception can be caught. So this module chooses a library by
its version and passes its path on in DRJIT_LIBLLVM_PATH. If no library is usable, the variable is set to a path that
does not exist, because otherwise Dr.Jit would load a library with which it aborts.
"""

import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from glob import escape, glob
from importlib import import_module, metadata

from visray import memory
from visray.drjit_import import EXTENSION
from visray.errors import UserError

VARIABLE = "DRJIT_LIBLLVM_PATH"
WHEEL = "karellen-llvm-core"
# Dr.Jit 1.5 emits llvm.minimum and llvm.maximum, which LLVM before 17 cannot compile.
OLDEST = 17
NOWHERE = "/no usable LLVM (see: visray doctor)"
ANY_LLVM = {"darwin": "libLLVM*.dylib", "win32": "LLVM-C.dll"}.get(sys.platform, "libLLVM*.so*")
# Address space that Dr.Jit and LLVM take, and each of its threads: a stack of 8 MiB, and what the C library keeps apart
# for it. Measured in a render of a small picture: 410 MiB with two threads.
LIBRARIES, THREAD = 384 * 2**20, 16 * 2**20
_LIBRARY = re.compile(r"libLLVM(?:-\d[\w.]*)?\.(?:so|dylib|\d+)|LLVM-C\.dll$")
# A single digit after .so is the number of an ABI, not a version.
_IN_NAME = re.compile(r"libLLVM(?:-|\.so\.(?=\d\d)|\.(?=\d\d))(\d+(?:\.\d+)*)")
_IN_FOLDER = re.compile(r"/Cellar/llvm(?:@\d+)?/(\d+(?:\.\d+)*)")

_VERSION_SCRIPT = """
import ctypes, sys
try:
    library = ctypes.CDLL(sys.argv[1])
except OSError as error:
    sys.exit(f"cannot be loaded: {error}")
if not hasattr(library, "LLVMDisposeMessage"):
    sys.exit("is not LLVM")
if not hasattr(library, "LLVMGetVersion"):
    sys.exit("is LLVM 15 or older, which ends the process during a render")
numbers = [ctypes.c_uint() for _ in range(3)]
library.LLVMGetVersion(*map(ctypes.byref, numbers))
print(".".join(str(number.value) for number in numbers))
"""


@dataclass(frozen=True)
class LLVM:
    """A libLLVM.

    path: path of the file
    version: its version, as far as it is known
    source: where it was found: in the variable, the Python environment or the system
    """

    path: str
    version: tuple[int, ...]
    source: str


@dataclass(frozen=True)
class SearchResult:
    """The result of a search for a libLLVM.

    llvm: the library, or None
    refused: one line for each library that was found and is not usable
    imported_before: whether Dr.Jit was imported before visray; then nothing was searched, and nothing can be changed
    """

    llvm: LLVM | None
    refused: tuple[str, ...] = ()
    imported_before: bool = False


_result: SearchResult | None = None


def prepare() -> SearchResult:
    """Searches for a libLLVM in the first call, sets DRJIT_LIBLLVM_PATH, and returns the result. Must be called before
    drjit or mitsuba is imported. Raises UserError if the address space is too small for them."""
    global _result
    if _result is None:
        if EXTENSION in sys.modules:
            _result = SearchResult(None, imported_before=True)
        else:
            _check_address_space()
            _result = search()
            os.environ[VARIABLE] = _result.llvm.path if _result.llvm else NOWHERE
    return _result


def _check_address_space() -> None:
    """Raises UserError if `ulimit -v` leaves too little for Dr.Jit, which would end the process without a word."""
    left, needed = memory.address_space(), LIBRARIES + THREAD * (os.cpu_count() or 1)
    if left is not None and left.size < needed:
        raise UserError(f"memory: {left}, and Dr.Jit takes up to {needed / 2**30:.1f} GiB; allow more, or no limit")


def library() -> LLVM | None:
    """The libLLVM that Dr.Jit uses or will use; None if there is no usable one."""
    result = prepare()
    if not result.imported_before:
        return result.llvm
    version = loaded_version()
    path = os.environ.get(VARIABLE) or "chosen by Dr.Jit"
    return LLVM(path, version, "loaded before visray was imported") if version else None


def require() -> LLVM:
    """The libLLVM in use, with the version that it reports itself. Raises UserError if a render would fail or abort."""
    result = prepare()
    if not result.imported_before and result.llvm is None:
        raise UserError(_advice(result.refused))
    version = loaded_version()
    llvm = library()
    if llvm and version and version[0] >= OLDEST:
        return LLVM(llvm.path, version, llvm.source)
    problem = f"LLVM {_dotted(version)}, which ends the process during a render" if version else "no LLVM"
    if not result.imported_before:
        advice = f"set {VARIABLE} to a libLLVM of version {OLDEST} or newer, or {_installation()}"
        raise UserError(f"LLVM: Dr.Jit was given {result.llvm.path} and loaded {problem}; {advice}")
    advice = "import visray before drjit and mitsuba"
    if search().llvm is None:
        advice += f", after you {_installation()}"
    raise UserError(f"LLVM: Dr.Jit was imported before visray and loaded {problem}; {advice}")


def loaded_version() -> tuple[int, ...] | None:
    """Version of the libLLVM that Dr.Jit has loaded; None if it has loaded none. Imports Dr.Jit."""
    # Not at the top: the import loads libLLVM, so it must come after the search.
    version = import_module("drjit.detail").llvm_version()
    return tuple(version) if version[0] > 0 else None


def search() -> SearchResult:
    """Searches for a libLLVM in the variable DRJIT_LIBLLVM_PATH, then in the Python environment, then in the system.
    Loads nothing into this process.

    If the variable names a library, no other library replaces it, because the user has asked for it.
    """
    named = os.environ.get(VARIABLE)
    if named and named != NOWHERE:
        judgement = judge(named, VARIABLE)
        if isinstance(judgement, LLVM):
            return SearchResult(judgement)
        return SearchResult(None, (f"{VARIABLE}={judgement}",))
    refused: list[str] = []
    for source, paths in (("Python environment", _environment), ("system", _system)):
        judgements = [judge(path, source) for path in _distinct(paths())]
        refused += [judgement for judgement in judgements if isinstance(judgement, str)]
        usable = [judgement for judgement in judgements if isinstance(judgement, LLVM)]
        if usable:
            return SearchResult(max(usable, key=lambda library: library.version), tuple(refused))
    return SearchResult(None, tuple(refused))


def judge(path: str, source: str) -> LLVM | str:
    """The library at `path`, or the reason why it is refused, as `<path> <reason>`."""
    if os.path.dirname(path) and not os.path.isfile(path):
        return f"{path} " + ("is not a file" if os.path.exists(path) else "does not exist")
    version = version_in_name(path) if os.path.dirname(path) else None
    if version is None:
        version = _reported_version(path)
    if isinstance(version, str):
        return f"{path} {version}"
    if version[0] < OLDEST:
        return f"{path} is LLVM {_dotted(version)}, which ends the process during a render"
    return LLVM(path, version, source)


def version_in_name(path: str) -> tuple[int, ...] | None:
    """Version in the name of the file that `path` leads to; None if the name contains no version."""
    resolved = os.path.realpath(path)
    match = _IN_NAME.match(os.path.basename(resolved)) or _IN_FOLDER.search(resolved)
    return tuple(int(number) for number in match[1].split(".")) if match else None


def _reported_version(path: str) -> tuple[int, ...] | str:
    """Version that the library itself reports, or a text that says what is wrong with the library. A separate process
    loads it, because loading may abort."""
    try:
        run = subprocess.run(
            [sys.executable, "-I", "-S", "-c", _VERSION_SCRIPT, path],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=60,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return "does not tell its version"
    version = run.stdout.strip()
    if run.returncode == 0 and re.fullmatch(r"\d+(\.\d+)*", version):
        return tuple(int(number) for number in version.split("."))
    lines = run.stderr.strip().splitlines()
    return lines[-1] if run.returncode == 1 and lines else "does not tell its version"


def _environment() -> Iterator[str]:
    """Paths of libraries in the Python environment: from a Python package or from conda."""
    try:
        files = metadata.distribution(WHEEL).files or []
    except metadata.PackageNotFoundError:
        files = []
    yield from (str(file.locate()) for file in files if _LIBRARY.match(file.name))
    data = sysconfig.get_path("data")
    for folder in ("lib", os.path.join("Library", "bin")):
        yield from glob(os.path.join(escape(data), folder, ANY_LLVM))


def _system() -> Iterator[str]:
    """Paths of libraries of the operating system or its package manager, for this processor."""
    if sys.platform == "darwin":
        roots = ("/opt/homebrew", "/usr/local")
        patterns = [f"{root}/{home}/lib/" for root in roots for home in ("opt/llvm*", "Cellar/llvm*/*")]
        patterns += ["/opt/local/libexec/llvm-*/lib/"]
    elif sys.platform == "win32":
        programs = os.environ.get("PROGRAMFILES", r"C:\Program Files")
        patterns = [os.path.join(programs, "LLVM", "bin", "")]
        patterns += [os.path.join(escape(folder), "") for folder in os.get_exec_path() if folder]
    else:
        patterns = [f"/usr/lib/{platform.machine()}-linux-gnu/", "/usr/lib/llvm-*/lib/", "/usr/lib/llvm/*/lib64/"]
        patterns += ["/usr/lib64/", "/usr/lib64/llvm*/lib/", "/usr/lib/", "/usr/local/lib/"]
        yield from _ldconfig()
    for pattern in patterns:
        yield from glob(pattern + ANY_LLVM)


def _ldconfig() -> Iterator[str]:
    """Paths of libraries in the cache of the dynamic linker, for 64-bit processes."""
    program = shutil.which("ldconfig") or shutil.which("ldconfig", path="/sbin:/usr/sbin")
    if program is None:
        return
    run = subprocess.run([program, "-p"], capture_output=True, text=True, timeout=60, check=False)
    for line in run.stdout.splitlines():
        name, arrow, path = line.strip().partition(" => ")
        if arrow and name.startswith("libLLVM") and ("x86-64" in name or "AArch64" in name):
            yield path


def _distinct(paths: Iterable[str]) -> list[str]:
    """The files that `paths` lead to, if their names are those of a libLLVM; each file once, in order."""
    resolved = (os.path.realpath(path) for path in paths if _LIBRARY.match(os.path.basename(path)))
    return list(dict.fromkeys(path for path in resolved if os.path.isfile(path)))


def _advice(refused: tuple[str, ...]) -> str:
    """One line for the user: no library is usable, what to install, and why libraries were refused."""
    if refused and refused[0].startswith(VARIABLE):
        return f"{refused[0]}; set it to a libLLVM of version {OLDEST} or newer, or unset it and {_installation()}"
    line = f"LLVM: Dr.Jit needs version {OLDEST} or newer and there is none; {_installation()}"
    return f"{line} (refused: {'; '.join(refused)})" if refused else line


def _installation() -> str:
    """How to install a libLLVM on this platform."""
    if sys.platform == "darwin":
        return "run: brew install llvm"
    if sys.platform == "win32":
        return "run: winget install LLVM.LLVM"
    if platform.machine() == "x86_64":
        return f"run: pip install {WHEEL}"
    return f"install libLLVM {OLDEST} or newer from your distribution (for example: apt install libllvm19)"


def _dotted(version: tuple[int, ...]) -> str:
    """A version as text, such as 19.1.0."""
    return ".".join(str(number) for number in version)
