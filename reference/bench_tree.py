"""The tree over bounding boxes and the older tree over bounding spheres: time of a search, and number of tests.

    python reference/bench_tree.py --before PATH -o reference/bench_tree.json

PATH: a checkout of an older visray with the trees of `visray.bvh`, such as 45a7471. They are trees over bounding
spheres, one for each batch. A row is one object in the kernel's tables; a batch is the rows of one kind.

Both trees use the same tests of rows. The two versions of visray alternate, each time in a new process with one thread;
the least CPU time counts.

Scenes: random spheres, boxes, slivers (triangles 1,000 times as long as wide), and a mix of all three; 1,000 rows and
more. Rays: coherent camera rays, shadow rays from a light to the points that the camera sees, and random rays that
start among the objects. A row is tested as in visray's search: first its bounding sphere in single, then the exact test
in double, in a branch. Also measured: the time to build a tree, and how the time to compile a kernel grows with the
number of batches.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import visray  # noqa: F401  # isort: skip - first, because it chooses the LLVM that Dr.Jit loads
import drjit as dr
import numpy as np
from tree_search import LAMP, SHAPES, SIDE, Search, rays, world

from visray.quantities import Arrays

COUNTS, TURNS, RUNS = (1000, 10_000, 100_000), 3, 3


def measured(search: Callable) -> dict:
    """A dict: compile seconds, least CPU seconds of a run, and the sum of the finite results (`answers`).

    The sum shows whether both trees give the same results. search: function that returns results and counts.
    """
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        results = search()[0]
        dr.eval(results)
        dr.sync_thread()
        compiled = sum(k["codegen_time"] + k["backend_time"] for k in dr.kernel_history([dr.KernelType.JIT])) / 1e3
    seconds = []
    for _ in range(RUNS):
        start = time.process_time()
        dr.eval(search()[0])
        dr.sync_thread()
        seconds.append(time.process_time() - start)
    finite = np.array(results[0]).astype(float)
    return {"compile_s": compiled, "s": min(seconds), "answers": float(finite[np.isfinite(finite)].sum())}


def one(shape: str, n: int) -> dict:
    """A dict with the figures of one scene, with the tree of the imported visray.

    shape: one of SHAPES; n: number of rows
    """
    a = Arrays.of("llvm", "single")
    search, report = Search(a, world(shape, n)), {}
    report["build_s"] = search.build
    eye, direction = rays("camera")
    t = np.array(search.closest(a.put(a.W, eye), a.put(a.W, direction))[0][0])
    points = eye + direction * np.where(np.isfinite(t), t, 9.0)
    lamp = np.array(LAMP)[:, None]
    distance = np.linalg.norm(points - lamp, axis=0)
    # Shadow rays end a little before the visible points, by more than the rounding of their coordinates.
    shadow = (lamp, (points - lamp) / distance, distance * (1 - 2.0**-32))
    sets = {"camera": (eye, direction), "shadow": shadow, "random": rays("random")}
    for name, (o, d, *length) in sets.items():
        o, d, length = a.put(a.W, o), a.put(a.W, d), [a.put(a.D, x) for x in length]

        def run(search: Search = search, o: Any = o, d: Any = d, length: list = length) -> tuple:
            return search.any(o, d, *length) if length else search.closest(o, d)

        report[name] = measured(run)
        counting = Search(a, world(shape, n), counted=True)
        _, boxes, rows = run(counting)
        report[name] |= {"boxes": float(np.mean(np.array(boxes))), "rows": float(np.mean(np.array(rows)))}
    return report


def batches(k: int) -> float:
    """Compile seconds of a search through k batches; the batches are spheres, boxes and slivers in turn."""
    a, kinds = Arrays.of("llvm", "single"), ("spheres", "boxes", "slivers")
    search = Search(a, [world(kinds[i % 3], 100)[0] for i in range(k)])
    o, d = (a.put(a.W, x) for x in rays("random"))
    return measured(lambda: search.closest(o, d))["compile_s"]


def builds() -> dict[str, float]:
    """Seconds to build a tree over spheres, by the number of spheres."""
    a = Arrays.of("llvm", "single")
    Search(a, world("spheres", 1000))
    return {str(n): Search(a, world("spheres", n)).build for n in (1000, 10_000, 100_000, 1_000_000)}


def turn(root: Path, *work: str) -> Any:
    """The result of a new process that imports the visray at `root`, with an empty kernel cache.

    work: name and arguments of the function to run in that process: one, batches or builds
    """
    with tempfile.TemporaryDirectory() as cache:
        environment = os.environ | {"PYTHONPATH": str(root), "DRJIT_CACHE_DIR": cache}
        command = [sys.executable, str(Path(__file__).resolve()), "--work", *work]
        return json.loads(subprocess.run(command, check=True, env=environment, stdout=subprocess.PIPE).stdout)


def compared(shape: str, n: int, roots: dict[str, Path], turns: int) -> dict:
    """A dict with the figures of both trees on one scene; times are the least of all turns.

    roots: the checkouts, by name; turns: number of processes for each checkout
    """
    reports: dict[str, list] = {name: [] for name in roots}
    for _ in range(turns):
        for name, root in roots.items():
            reports[name].append(turn(root, "one", shape, str(n)))
    result: dict[str, Any] = {"shape": shape, "rows": n}
    for kind in ("camera", "shadow", "random"):
        result[kind] = {}
        for name, turns_of_tree in reports.items():
            result[kind][name] = turns_of_tree[0][kind] | {
                k: min(r[kind][k] for r in turns_of_tree) for k in ("s", "compile_s")
            }
            result[kind][name]["Mrays_per_s"] = SIDE * SIDE / 1e6 / result[kind][name]["s"]
        if len(roots) == 2:
            old, new = result[kind]["before"], result[kind]["after"]
            if old["answers"] != new["answers"]:
                raise SystemExit(f"{shape} {n} {kind}: the results differ")
            result[kind]["speedup"] = old["s"] / new["s"]
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", type=Path, help="a checkout with the trees over bounding spheres")
    parser.add_argument("--shapes", nargs="+", default=SHAPES, choices=SHAPES)
    parser.add_argument("--counts", nargs="+", type=int, default=COUNTS)
    parser.add_argument("--turns", type=int, default=TURNS)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--work", nargs="+", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.work:
        dr.set_thread_count(1)
        name, *arguments = chosen.work
        work = {"one": lambda shape, n: one(shape, int(n)), "batches": lambda k: batches(int(k)), "builds": builds}
        print(json.dumps(work[name](*arguments)))
        return
    from machine import machine

    here = Path(__file__).resolve().parent.parent
    roots = {"before": chosen.before.resolve()} if chosen.before else {}
    roots["after"] = here
    report = machine() | {"rays": SIDE * SIDE, "threads": 1}
    report["scenes"] = [compared(s, n, roots, chosen.turns) for s in chosen.shapes for n in chosen.counts]
    report["compile_s_by_batches"] = {k: {n: turn(r, "batches", str(k)) for n, r in roots.items()} for k in (1, 3, 10)}
    report["build_s_by_rows"] = {n: turn(r, "builds") for n, r in roots.items()}
    text = json.dumps(report, indent=2) + "\n"
    sys.stdout.write(text)
    if chosen.output:
        chosen.output.write_text(text)


if __name__ == "__main__":
    main()
