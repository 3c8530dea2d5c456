"""The time that visray needs, before it traces rays, for a scene with very many objects: to read, check, pack and
prepare the scene.

    python reference/bench_scene.py --before PATH -o reference/bench_scene.json

The scene has 30,000 spheres, 96 x 64 pixels, and 1 sample per pixel. Each figure is the least of several processes.
With `--before`, an older checkout and this one alternate. Kernels come from Dr.Jit's cache on disk, which the first
process of each checkout fills. The time of imports is not counted. `cpu` is the CPU time of the process, which is more
reliable on a busy machine.

Stages: load (a file), check (the loaded scene), check_new (a new scene of Python objects), check_again (the same scene
once more), features, hash, pack, prepare.
Frames: from_file (first picture of a process, from a file), from_objects (first picture of another process, from Python
objects), second (the same scene again in that process), moved (that scene with another radius of one sphere).
"""

import argparse
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parents[1]
SIZE, RUNS, OBJECTS = (96, 64), 5, 30_000
PARTS = ("stages", "file", "objects")


def content(count: int) -> dict:
    """The content of a scene file with `count` small spheres at random places, as a dict."""
    draw = random.Random(1)
    spheres = {
        f"s{i}": {
            "type": "sphere",
            "center": [draw.uniform(-10, 10) for _ in range(3)],
            "radius": draw.uniform(0.02, 0.1),
            "material": "paint",
        }
        for i in range(count)
    }
    return {
        "camera": {"origin": [0, 0, 40]},
        "film": {"width": SIZE[0], "height": SIZE[1]},
        "settings": {"spp": 1},
        "materials": {"paint": {}},
        "lights": {"key": {"type": "point", "position": [10, 20, 30]}},
        "objects": spheres,
    }


def scene_of(raw: dict) -> Any:
    """The scene as Python objects that are not checked yet. raw: the content of its file."""
    import visray as vr

    def fields(entry: dict) -> dict:
        return {k: tuple(v) if isinstance(v, list) else v for k, v in entry.items() if k != "type"}

    return vr.Scene(
        camera=vr.Camera(**fields(raw["camera"])),
        film=vr.Film(**raw["film"]),
        settings=vr.Settings(**raw["settings"]),
        materials={"paint": vr.Material()},
        lights={"key": vr.PointLight(**fields(raw["lights"]["key"]))},
        objects={name: vr.Sphere(**fields(entry)) for name, entry in raw["objects"].items()},
    )


class Stopwatch:
    """Measures wall-clock and CPU seconds of calls. times: the results, by the name of the call."""

    def __init__(self) -> None:
        self.times: dict[str, dict[str, float]] = {}

    def time(self, name: str, work: Callable[[], Any]) -> Any:
        """Calls `work`, adds its times under a name, and returns its result."""
        start = time.perf_counter(), time.process_time()
        result = work()
        end = time.perf_counter(), time.process_time()
        self.times[name] = {"seconds": end[0] - start[0], "cpu": end[1] - start[1]}
        return result


def stages(path: Path) -> dict:
    """The times of the stages, by name. path: the scene file."""
    from visray.features import features
    from visray.pack import pack
    from visray.quantities import Arrays
    from visray.scene.load import checked, load
    from visray.setup import prepare

    watch, a = Stopwatch(), Arrays.of()
    scene = watch.time("load", lambda: load(path))
    watch.time("check", lambda: checked(scene))
    unchecked = scene_of(json.loads(path.read_text()))
    watch.time("check_new", lambda: checked(unchecked))
    watch.time("check_again", lambda: checked(unchecked))
    watch.time("features", lambda: features(scene))
    watch.time("hash", scene.hash)
    watch.time("pack", lambda: pack(scene, a))
    watch.time("prepare", lambda: prepare(scene))
    return watch.times


def frame(scene: Any) -> Any:
    """Renders a picture. scene: a vr.Scene, or the path of a file."""
    import visray as vr

    return vr.render(scene, layers=["RGB"], progress=False)


def first_of_file(path: Path) -> dict:
    """The time of the first picture of this process, rendered from a file."""
    watch = Stopwatch()
    watch.time("from_file", lambda: frame(path))
    return watch.times


def frames_of_objects(path: Path) -> dict:
    """The times of three pictures of a scene of Python objects: first, second, and after one sphere has changed."""
    from dataclasses import replace

    scene, watch = scene_of(json.loads(path.read_text())), Stopwatch()
    watch.time("from_objects", lambda: frame(scene))
    watch.time("second", lambda: frame(scene))
    scene.objects["s0"] = replace(scene.objects["s0"], radius=0.05)
    watch.time("moved", lambda: frame(scene))
    return watch.times


def measured(checkout: Path, path: Path, part: str) -> dict:
    """The times of one part, measured in a new process with the visray of a checkout.

    path: the scene file; part: one of PARTS
    """
    command = [sys.executable, __file__, "--part", part, "--scene", str(path)]
    process = subprocess.run(
        command, env=os.environ | {"PYTHONPATH": str(checkout)}, cwd=checkout, check=True, capture_output=True
    )
    return json.loads(process.stdout.splitlines()[-1])


def least(runs: list[dict]) -> dict:
    """For each name and unit, the least time of several runs."""
    return {name: {unit: min(run[name][unit] for run in runs) for unit in ("seconds", "cpu")} for name in runs[0]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--before", type=Path, help="an older checkout to compare with")
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--objects", type=int, default=OBJECTS)
    parser.add_argument("--part", choices=PARTS, help=argparse.SUPPRESS)
    parser.add_argument("--scene", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.part:
        import visray  # noqa: F401 - imports are not counted

        work = {"stages": stages, "file": first_of_file, "objects": frames_of_objects}[options.part]
        print(json.dumps(work(options.scene)))
        return
    checkouts = {"now": HERE} | ({"before": options.before.resolve()} if options.before else {})
    runs: dict[str, dict[str, list]] = {name: {part: [] for part in PARTS} for name in checkouts}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "spheres.json"
        path.write_text(json.dumps(content(options.objects)))
        for turn in range(options.runs + 1):
            for part in PARTS:
                for name, checkout in checkouts.items():
                    times = measured(checkout, path, part)
                    if turn:  # the first run fills Dr.Jit's cache
                        runs[name][part].append(times)
    figures = {name: {k: v for part in PARTS for k, v in least(parts[part]).items()} for name, parts in runs.items()}
    for stage in figures["now"]:
        print(f"{stage:13s}" + "".join(f"  {n} {f[stage]['seconds']:.3f} s (cpu {f[stage]['cpu']:.3f})"
                                       for n, f in figures.items()))  # fmt: skip
    if options.output:
        from machine import machine

        report = machine() | {"objects": options.objects, "size": SIZE, "runs": options.runs, "least": figures}
        options.output.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main()
