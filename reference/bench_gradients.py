"""The seconds to a first derivative of a scene, compilation included, and to a second one of the same structure.

    python reference/bench_gradients.py -o reference/bench_gradients.json
    python reference/bench_gradients.py --before PATH --limit 600

Each figure comes from a process of its own, whose cache of kernels is empty. `cpu` is the time of the processor, which
is more reliable on a busy machine. `operations` is the number of operations of the largest kernel, `compiled` the
number of kernels that were compiled. With `--before`, an older checkout is measured as well; `null` means that it had
no derivative after the limit.

Cases: a red, a mirrored and a glass ball under an area light of 16 samples; and two scenes of this repository.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from report import report_parser, write_report

HERE = Path(__file__).resolve().parents[1]
# Name of the case: address, and width and height in pixels. All have 4 samples per pixel.
CASES = {
    "three balls": ("objects.red.center", (96, 60)),
    "transparent-spheres": ("objects.as glass.radius", (24, 16)),
    "area-lights": ("materials.ivory.kt", (96, 32)),
}
MODES = "derivative", "gradient"


def three_balls() -> Any:
    """A red, a mirrored and a glass ball on a checkered floor, under a lamp with an area."""
    import visray as vr

    black, grey = (0.0, 0.0, 0.0), (0.5, 0.5, 0.5)
    mirror = vr.Material(ka=black, kd=black, ks=grey, kr=(0.9, 0.9, 0.9), shininess=200)
    centers = {"red": (-2.0, 1.0, 0.0), "mirror": (0.0, 1.0, 0.0), "glass": (2.0, 1.0, 1.0)}
    return vr.Scene(
        camera=vr.Camera(origin=(0.0, 2.0, 8.0), target=(0.0, 1.0, 0.0), fov=35.0),
        background=vr.SkyGradient(bottom=(0.8, 0.9, 1.0), top=(0.1, 0.3, 0.8)),
        textures={"check": vr.CheckerTexture(a=(1.0, 1.0, 1.0), b=(0.01, 0.01, 0.01))},
        materials={
            "floor": vr.Material(texture="check"),
            "red": vr.Material(ka=(0.08, 0.01, 0.01), kd=(0.8, 0.1, 0.1), ks=grey, shininess=50),
            "mirror": mirror,
            "glass": vr.Material(
                ka=black, kd=black, ks=grey, kr=(0.05, 0.05, 0.05), kt=(0.93, 0.93, 0.93), ior=1.5, shininess=200
            ),
        },
        lights={"sun": vr.SphereLight(position=(4.0, 6.0, 5.0), radius=1.0)},
        objects={"floor": vr.Plane(material="floor")}
        | {name: vr.Sphere(center=center, material=name) for name, center in centers.items()},
    )


def measure(case: str, mode: str) -> dict:
    """Seconds of the first and of the second derivative, in this process."""
    import warnings
    from dataclasses import replace

    import visray  # noqa: F401  # isort: skip - first, because it chooses the LLVM that Dr.Jit loads
    import drjit as dr

    import visray as vr

    warnings.simplefilter("ignore", vr.EdgeWarning)
    address, (width, height) = CASES[case]
    scene = three_balls() if case == "three balls" else vr.load(HERE / "scenes" / f"{case}.json")
    scene = replace(
        scene,
        film=replace(scene.film, width=width, height=height),
        settings=replace(scene.settings, spp=4, precision="double"),
    )
    result: dict[str, Any] = {}
    for name in ("first", "second"):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            begun, cpu_begun = time.perf_counter(), time.process_time()
            vr.derivative(scene, address) if mode == "derivative" else vr.gradient(scene, [address])
            result[f"{name}_seconds"] = round(time.perf_counter() - begun, 2)
            result[f"{name}_cpu_seconds"] = round(time.process_time() - cpu_begun, 2)
            kernels = dr.kernel_history([dr.KernelType.JIT])
        result[f"{name}_compiled"] = sum(not k["cache_hit"] for k in kernels)
        result["operations"] = max(k["operation_count"] for k in kernels)
    return result


def in_process(checkout: Path, case: str, mode: str, limit: float) -> dict | None:
    """The result of `measure` in a new process that uses a checkout; None after `limit` seconds."""
    with tempfile.TemporaryDirectory() as cache:
        environment = os.environ | {"PYTHONPATH": str(checkout), "DRJIT_CACHE_DIR": cache}
        command = [sys.executable, __file__, "--case", case, mode]
        try:
            done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=limit, check=True)
        except subprocess.TimeoutExpired:
            return None
    return json.loads(done.stdout)


def main(arguments: argparse.Namespace) -> None:
    if arguments.case:
        sys.stdout.write(json.dumps(measure(*arguments.case)))
        return
    from machine import machine

    checkouts = {"now": HERE} | ({"before": arguments.before} if arguments.before else {})
    results = {
        case: {
            mode: {name: in_process(path, case, mode, arguments.limit) for name, path in checkouts.items()}
            for mode in MODES
        }
        for case in CASES
    }
    write_report({"machine": machine(), "limit_seconds": arguments.limit, "cases": results}, arguments.output)


if __name__ == "__main__":
    parser = report_parser(__doc__)
    parser.add_argument("--before", type=Path, metavar="PATH", help="an older checkout to measure as well")
    parser.add_argument("--limit", type=float, default=600.0, metavar="SECONDS", help="seconds for each process")
    parser.add_argument("--case", nargs=2, help=argparse.SUPPRESS)
    main(parser.parse_args())
