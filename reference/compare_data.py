"""What visray, pyvista and matplotlib with basemap take for the same picture of data: lines of code, and seconds.

    python -m venv peers && peers/bin/pip install pyvista matplotlib basemap      # in another environment than visray's
    python reference/compare_data.py --peers peers/bin/python -o reference/compare_data.json

The picture: 200 bars on a globe, and on a flat map, with a palette, a colour bar and a title, 960 x 540 pixels. The
scripts are those of the folder data_compare, written as one writes them who knows the program well. Also, visray's
command that makes such a picture without a script.

lines: those with code, without docstrings, comments and empty lines
s: least wall-clock seconds of several runs, from the start of a process to the PNG file; the programs take turns
cpu_s: least processor seconds of these runs
first: with an empty cache of kernels. pyvista and basemap have no such cache

A program that is not installed is left out. With --picture, the pictures are also written side by side.
"""

import argparse
import ast
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from PIL import Image

from visray.output.files import write_text
from visray.study.machine import machine

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = ROOT / "reference" / "data_compare"
KINDS = ("globe", "map")
RUNS = 5
# Programs, with the modules that they need.
PROGRAMS = {"visray": "visray", "pyvista": "pyvista", "basemap": "mpl_toolkits.basemap"}
# Distributions whose versions are reported.
DISTRIBUTIONS = ("pyvista", "vtk", "basemap", "matplotlib", "numpy")
COMMAND = ["-m", "visray", "data", "scenes/data/cities.csv", "--height", "population", "--color", "rain"]
COMMAND += ["--palette", "plasma", "--title", "Rain in large cities", "--quiet", "--size", "960x540"]
THUMBNAIL = (480, 270)


def lines_of_code(text: str) -> int:
    """Number of lines of a script that have code; lines of docstrings and comments do not count."""
    tree = ast.parse(text)
    documented = (ast.Module, ast.FunctionDef, ast.ClassDef)
    docs: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, documented) and ast.get_docstring(node) is not None:
            docs |= set(range(node.body[0].lineno, node.body[0].end_lineno + 1))
    written = (line.strip() for number, line in enumerate(text.splitlines(), 1) if number not in docs)
    return sum(bool(line) and not line.startswith("#") for line in written)


def installed(python: str, module: str) -> bool:
    """Whether a Python has a module."""
    find = f"import importlib.util as u, sys; sys.exit(u.find_spec({module.split('.')[0]!r}) is None)"
    if "." in module:
        find = f"import {module}"
    return subprocess.run([python, "-c", find], cwd=ROOT, capture_output=True).returncode == 0


def versions(python: str) -> dict[str, str]:
    """Versions of the distributions that a Python has, by name."""
    code = "import importlib.metadata as m, json; print(json.dumps([[d.name, d.version] for d in m.distributions()]))"
    pairs = json.loads(subprocess.run([python, "-c", code], capture_output=True, text=True, check=True).stdout)
    found = {name.lower(): version for name, version in pairs}
    return {name: found[name] for name in DISTRIBUTIONS if name in found}


def seconds(words: list[str], cache: str) -> tuple[float, float]:
    """Wall-clock and processor seconds of a process. cache: folder for visray's kernels."""
    environment = os.environ | {"DRJIT_CACHE_DIR": cache, "PYTHONPATH": str(ROOT)}
    start = time.perf_counter()
    process = subprocess.Popen(words, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    complaint = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(words)} failed:\n{complaint.decode()}")
    return time.perf_counter() - start, usage.ru_utime + usage.ru_stime


def timed(calls: dict[str, Callable[[], tuple[float, float]]], runs: int) -> dict[str, dict[str, float]]:
    """Least wall-clock and processor seconds of each call, by name. The calls take turns."""
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in calls}
    for i in range(runs):
        # Each time another one begins.
        for name in (names := list(calls))[i % len(names) :] + names[: i % len(names)]:
            found[name].append(calls[name]())
            print(f"run {i + 1}, {name}: {found[name][-1][0]:.2f} s", file=sys.stderr)
    least = {name: [round(min(x), 3) for x in zip(*pairs)] for name, pairs in found.items()}
    return {name: {"s": wall, "cpu_s": cpu} for name, (wall, cpu) in least.items()}


def measured(kind: str, pythons: dict[str, str], folder: Path, runs: int) -> list[dict]:
    """Lines and seconds for one kind of picture, as a list of dicts.

    pythons: the Python of each program
    folder: for pictures and kernels
    """
    commands = {
        name: [python, str(SCRIPTS / f"{name}_{kind}.py"), str(folder / f"{name}_{kind}.png")]
        for name, python in pythons.items()
    }
    base = ["--base", kind, "-o", str(folder / f"command_{kind}.png")]
    commands["visray data"] = [pythons["visray"], *COMMAND, *base]
    kept = str(folder / "kernels")

    def empty(words: list[str]) -> tuple[float, float]:
        with tempfile.TemporaryDirectory(dir=folder) as cache:
            return seconds(words, cache)

    calls: dict[str, Callable] = {}
    for name, words in commands.items():
        calls[name] = lambda words=words: seconds(words, kept)
        if name.startswith("visray"):
            calls[f"{name}, first"] = lambda words=words: empty(words)
            seconds(words, kept)
    times = timed(calls, runs)
    rows = []
    for name in commands:
        script = SCRIPTS / f"{name}_{kind}.py"
        row = {"picture": kind, "program": name, "lines": lines_of_code(script.read_text()) if script.exists() else 1}
        rows.append(row | times[name] | ({"first": times[f"{name}, first"]} if f"{name}, first" in times else {}))
    return rows


def side_by_side(folder: Path, names: list[str], out: Path) -> None:
    """Writes the pictures of the programs into one file: a column for each program, a row for each kind."""
    sheet = Image.new("RGB", (THUMBNAIL[0] * len(names), THUMBNAIL[1] * len(KINDS)), "white")
    for row, kind in enumerate(KINDS):
        for column, name in enumerate(names):
            with Image.open(folder / f"{name}_{kind}.png") as picture:
                small = picture.convert("RGB").resize(THUMBNAIL, Image.LANCZOS)
            sheet.paste(small, (THUMBNAIL[0] * column, THUMBNAIL[1] * row))
    sheet.save(out, optimize=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, help="a JSON file")
    parser.add_argument("--peers", default=sys.executable, help="the Python that has pyvista and basemap")
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--picture", type=Path, help="a PNG file with all pictures")
    chosen = parser.parse_args()
    pythons = {name: sys.executable if name == "visray" else chosen.peers for name in PROGRAMS}
    for name, module in PROGRAMS.items():
        if not installed(pythons[name], module):
            print(f"{name} is not installed: left out")
            del pythons[name]
    report = machine() | {
        "programs": list(pythons),
        "peers": versions(chosen.peers),
        "runs": chosen.runs,
        "load": round(os.getloadavg()[0], 1),
    }
    with tempfile.TemporaryDirectory() as name_of_folder:
        folder = Path(name_of_folder)
        rows = [row for kind in KINDS for row in measured(kind, pythons, folder, chosen.runs)]
        if chosen.picture:
            side_by_side(folder, list(pythons), chosen.picture)
    for row in rows:
        first = f", first {row['first']['s']:.2f} s" if "first" in row else ""
        print(f"{row['picture']}, {row['program']}: {row['lines']} lines, {row['s']:.2f} s{first}")
    if chosen.output:
        write_text(chosen.output, json.dumps(report | {"rows": rows}, indent=2) + "\n")


if __name__ == "__main__":
    main()
