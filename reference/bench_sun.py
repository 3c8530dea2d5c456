"""Rays that leave a surface: shadow rays of a directional light against those of a point light far away, and others.

    python reference/bench_sun.py --before PATH -o reference/bench_sun.json

Scenes: some of scenes/, each with a pinhole camera, without reflections and ambient occlusion, and with one light. The
versions of a scene:
    unshadowed    the light has no shadows, so the difference from this version is the cost of the other rays
    point         a point light, DISTANCE times as far from the camera's target as the camera
    directional   a directional light that shines in the same direction; the pictures of both are equal but for edges
    area          a sphere light in place of the scene's first light, with 4 samples
    sky           no shadows, but 4 rays for the ambient occlusion of the sky
    mirror        no shadows, but every material reflects half of the light
All versions alternate in one process. The times are medians of several runs, in CPU seconds of all threads for one
picture, with kernels compiled before. With `--before`, an older checkout is measured too, scene by scene, and
`before_over_now` says how many times as long it takes.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import visray  # noqa: F401  # isort: skip - before Dr.Jit, because it chooses the LLVM
import drjit as dr
import numpy as np
from machine import machine
from report import report_parser

from visray.film import Film
from visray.lights import DirectionalLight, PointLight, SphereLight
from visray.passes import empty_film, exposed_once
from visray.scene.adjusted import adjusted
from visray.scene.load import load
from visray.scene.scene import Scene
from visray.setup import Prepared, prepare

NAMES = ("heart", "barth-sextic", "barth-decic", "gallery", "tangle-cut", "torus", "box", "many")
ROOT = Path(__file__).resolve().parents[1]
SIZE, SAMPLES, RUNS, DISTANCE = 384, 4, 7, 1e6


def versions(name: str) -> dict[str, Scene]:
    """The versions of a scene, by name. name: name of the file in scenes/"""
    scene = load(ROOT / "scenes" / f"{name}.json")
    target = np.array(scene.camera.target)
    position = next(np.array(light.position) for light in scene.lights.values() if hasattr(light, "position"))
    near = np.linalg.norm(position - target)
    to_light, far = (position - target) / near, DISTANCE * np.linalg.norm(np.array(scene.camera.origin) - target)
    occlusion = replace(scene.settings.occlusion, sky=0, near=0)
    scene = adjusted(
        replace(
            scene,
            camera=replace(scene.camera, aperture=0.0),
            film=replace(scene.film, width=SIZE, height=SIZE),
            materials={n: replace(m, kr=(0.0,) * 3, kt=(0.0,) * 3) for n, m in scene.materials.items()},
            settings=replace(scene.settings, occlusion=occlusion),
            lights={"key": PointLight(position=tuple(target + far * to_light))},
        ),
        spp=SAMPLES,
    )
    unshadowed = replace(scene, settings=replace(scene.settings, shadows=False))
    sky = replace(unshadowed.settings, occlusion=replace(occlusion, sky=4))
    half = {n: replace(m, kr=(0.5,) * 3) for n, m in scene.materials.items()}
    area = SphereLight(position=tuple(position), radius=0.1 * near, samples=4)
    return {
        "unshadowed": unshadowed,
        "point": scene,
        "directional": replace(scene, lights={"key": DirectionalLight(direction=tuple(-to_light))}),
        "area": replace(scene, lights={"key": area}),
        "sky": replace(unshadowed, settings=sky),
        "mirror": replace(unshadowed, materials=half),
    }


def film(prepared: Prepared) -> Film:
    """The film of a picture that is taken in one pass, so with one kernel."""
    return exposed_once(prepared, empty_film(prepared), SAMPLES)


def picture(prepared: Prepared) -> np.ndarray:
    """The colours of all pixels, (3, N)."""
    return np.array(film(prepared).mean)


def compiled(prepared: Prepared) -> dict:
    """A dict with the compile seconds (NaN if a kernel came from the disk) and the operations of a picture's kernel."""
    dr.flush_kernel_cache()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        film(prepared)
        dr.sync_thread()
        kernels = dr.kernel_history([dr.KernelType.JIT])
    from_disk = any(k["cache_disk"] for k in kernels)
    seconds = sum(k["codegen_time"] + k["backend_time"] for k in kernels) / 1e3
    return {"compile_s": np.nan if from_disk else seconds, "operations": sum(k["operation_count"] for k in kernels)}


def seconds(prepared: Prepared) -> float:
    """CPU seconds of one picture."""
    dr.sync_thread()
    start = time.process_time()
    film(prepared)
    dr.sync_thread()
    return time.process_time() - start


def measured(name: str, runs: int) -> dict:
    """A dict with the figures of one scene."""
    prepared = {version: prepare(scene) for version, scene in versions(name).items()}
    cost = {version: compiled(p) for version, p in prepared.items()}
    different = np.abs(picture(prepared["directional"]) - picture(prepared["point"])).max(0) > 1e-3
    times: dict[str, list] = {version: [] for version in prepared}
    for _ in range(runs):
        for version, p in prepared.items():
            times[version].append(seconds(p))
    median = {version: statistics.median(t) for version, t in times.items()}
    shadows = {version: median[version] - median["unshadowed"] for version in ("directional", "point")}
    return {
        "directional_over_point": median["directional"] / median["point"],
        "shadow_rays_directional_over_point": shadows["directional"] / shadows["point"],
        "different_pixels": float(different.mean()),
        "cpu_s": median,
        "compiled": cost,
    }


def in_checkout(root: Path, name: str, runs: int) -> dict:
    """The figures of one scene, measured in a new process with the visray of a checkout and an empty kernel cache."""
    with tempfile.TemporaryDirectory() as cache:
        environment = os.environ | {"PYTHONPATH": str(root), "DRJIT_CACHE_DIR": cache}
        command = [sys.executable, __file__, "--work", name, "--runs", str(runs)]
        process = subprocess.run(command, env=environment, cwd=root, check=True, stdout=subprocess.PIPE)
    return json.loads(process.stdout)


def main() -> None:
    parser = report_parser(__doc__)
    parser.add_argument("--before", type=Path, help="an older checkout to compare with")
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--work", help=argparse.SUPPRESS)
    parser.add_argument("scenes", nargs="*", default=NAMES, help="names of files in scenes/")
    options = parser.parse_args()
    if options.work:
        print(json.dumps(measured(options.work, options.runs)))
        return
    report: dict = machine() | {"size": SIZE, "samples": SAMPLES, "runs": options.runs, "scenes": {}}
    for name in options.scenes:
        figures = {"now": in_checkout(ROOT, name, options.runs)}
        if options.before:
            before = figures["before"] = in_checkout(options.before.resolve(), name, options.runs)
            figures["before_over_now"] = {
                version: t / figures["now"]["cpu_s"][version] for version, t in before["cpu_s"].items()
            }
        report["scenes"][name] = figures
        print(name, json.dumps(figures), flush=True)
    if options.output:
        options.output.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main()
