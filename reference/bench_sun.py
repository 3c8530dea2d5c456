"""Shadows of a directional light against those of a point light far away in the same direction: time and compilation.

    DRJIT_CACHE_DIR=$(mktemp -d) python reference/bench_sun.py -o reference/bench_sun.json

The cache of kernels must be empty, so that compilation can be measured.

Scenes: some of scenes/, each with a pinhole camera, without reflections and ambient occlusion, and with only one light.
In the first version it is directional. In the second it is a point light DISTANCE times as far from the camera's target
as the camera. In the third the light has no shadows, so the difference is the cost of the shadow rays. Both pictures
with shadows must be equal but for the edges of shadows.

All versions alternate in one process. The times are medians of several runs, in CPU seconds of all threads for one
picture, with kernels compiled before.
"""

import argparse
import json
import statistics
import time
from dataclasses import replace
from pathlib import Path

import visray  # noqa: F401  # isort: skip - before Dr.Jit, because it chooses the LLVM
import drjit as dr
import numpy as np
from machine import machine

from visray.lights import DirectionalLight, PointLight
from visray.passes import expose
from visray.render import adjusted
from visray.scene.load import load
from visray.scene.scene import Film, Scene
from visray.setup import Prepared, prepare

NAMES = ("heart", "barth-sextic", "barth-decic", "gallery", "tangle-cut", "torus", "box", "many")
SCENES, SIZE, SAMPLES, RUNS, DISTANCE = Path(__file__).resolve().parents[1] / "scenes", 384, 4, 7, 1e6


def versions(name: str) -> dict[str, Scene]:
    """The versions of a scene: directional, point and unshadowed. name: name of the file in scenes/"""
    scene = load(SCENES / f"{name}.json")
    target = np.array(scene.camera.target)
    key = next(np.array(light.position) for light in scene.lights.values() if hasattr(light, "position"))
    to_light = (key - target) / np.linalg.norm(key - target)
    far = DISTANCE * np.linalg.norm(np.array(scene.camera.origin) - target)
    lights = {
        "directional": DirectionalLight(direction=tuple(-to_light)),
        "point": PointLight(position=tuple(target + far * to_light)),
    }
    matte = {n: replace(m, kr=(0.0,) * 3, kt=(0.0,) * 3) for n, m in scene.materials.items()}
    settings = replace(scene.settings, occlusion=replace(scene.settings.occlusion, sky=0, near=0))
    scene = replace(scene, materials=matte, settings=settings, camera=replace(scene.camera, aperture=0.0))
    scene = adjusted(replace(scene, film=Film(width=SIZE, height=SIZE)), spp=SAMPLES)
    made = {kind: replace(scene, lights={"key": light}) for kind, light in lights.items()}
    return made | {"unshadowed": replace(made["point"], settings=replace(scene.settings, shadows=False))}


def picture(prepared: Prepared) -> np.ndarray:
    """The colours of all pixels, (3, N)."""
    return np.array(expose(prepared)[0].mean)


def compiled(prepared: Prepared) -> dict:
    """A dict with the compile seconds and the number of operations of a picture's kernels."""
    dr.flush_kernel_cache()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        expose(prepared)
        dr.sync_thread()
        kernels = dr.kernel_history([dr.KernelType.JIT])
    if any(k["cache_disk"] for k in kernels):
        raise SystemExit("kernels came from the disk; set DRJIT_CACHE_DIR to an empty folder")
    return {
        "compile_s": sum(k["codegen_time"] + k["backend_time"] for k in kernels) / 1e3,
        "operations": sum(k["operation_count"] for k in kernels),
    }


def seconds(prepared: Prepared) -> float:
    """CPU seconds of one picture."""
    dr.sync_thread()
    start = time.process_time()
    expose(prepared)
    dr.sync_thread()
    return time.process_time() - start


def measured(name: str, runs: int) -> dict:
    """A dict with the figures of one scene."""
    prepared = {kind: prepare(scene) for kind, scene in versions(name).items()}
    report: dict = {"scene": name, "compiled": {kind: compiled(p) for kind, p in prepared.items()}}
    pictures = {kind: picture(p) for kind, p in prepared.items()}
    different = np.abs(pictures["directional"] - pictures["point"]).max(0) > 1e-3
    report["different_pixels"] = float(different.mean())
    times: dict[str, list] = {kind: [] for kind in prepared}
    for _ in range(runs):
        for kind, p in prepared.items():
            times[kind].append(seconds(p))
    median = {kind: statistics.median(t) for kind, t in times.items()}
    report["cpu_s"] = median
    report["directional_over_point"] = median["directional"] / median["point"]
    shadows = {kind: median[kind] - median["unshadowed"] for kind in ("directional", "point")}
    report["shadow_rays_directional_over_point"] = shadows["directional"] / shadows["point"]
    return report


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("scenes", nargs="*", default=NAMES, help="names of files in scenes/")
    options = parser.parse_args()
    report: dict = machine() | {"size": SIZE, "samples": SAMPLES, "runs": options.runs, "scenes": []}
    for name in options.scenes:
        report["scenes"].append(measured(name, options.runs))
        print(json.dumps(report["scenes"][-1]), flush=True)
    if options.output:
        options.output.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main()
