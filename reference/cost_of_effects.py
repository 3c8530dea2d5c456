"""The cost of each effect: the matte scene of reference/bench_mitsuba.py is compared with scenes that have one effect
more or less.

    python reference/cost_of_effects.py -o reference/cost_of_effects.json --before ../visray-before

Three numbers are measured. Operations: of the kernel. Compile time: the median of 3 kernels that are in no cache. Time
of a picture: with compiled kernels, 512 x 512 pixels, 16 samples per pixel, 2 threads. For that, the matte scene and
the changed scene alternate in 9 pairs; median and range of the ratio of their times are reported.

--before: a checkout of an earlier visray (git worktree add --detach ../visray-before 45a7471). The matte scene and some
scenes of scenes/ are rendered in 5 pairs of processes; in a pair, one process uses each visray. Measured are operations
and compile time of the kernel, and the median of 6 pictures with compiled kernels. The least CPU time of the 6 is
reported as well, because it depends little on other programs.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import drjit as dr
import numpy as np
from bench_mitsuba import PANEL, SIZE, THREADS, ours, ring, seconds, with_seed
from machine import machine
from PIL import Image
from report import report_parser, write_report

from visray import filters
from visray.passes import expose
from visray.setup import Prepared, prepare
from visray.study.timed_picture import UncachedPicture

HERE = Path(__file__).resolve().parent
SPP, PAIRS, COMPILED, PROCESSES = 16, 9, 3, 5
BLACK = (0.0, 0.0, 0.0)
HALF = (0.5, 0.5, 0.5)
# COMPARED: the scenes that, like the matte scene, are compared with an earlier visray. WIDTH: width of their pictures.
COMPARED, WIDTH = ("heart", "everything", "many", "penumbra", "transparencies"), 360
# The program of each process of a pair. It uses the visray that its PYTHONPATH contains. It prints seconds, CPU
# seconds, operations and compile seconds of a scene.
CHILD = """
import json, statistics, sys, time, visray
import drjit as dr
import bench_mitsuba
from bench_mitsuba import THREADS, ours, ring, seconds
with_seed = getattr(bench_mitsuba, "with_seed", None) or bench_mitsuba.vary
try:
    from visray.passes import expose
    from visray.setup import prepare
except ImportError:
    from visray.exposure import expose, set_up as prepare
from visray.scene.adjusted import adjusted
name, file, width = sys.argv[1:]
scene = ours(ring(), 16)
if name != "matte":
    scene = visray.load(file)
    height = round(int(width) * scene.film.height / scene.film.width)
    scene = adjusted(scene, spp=16, size=(int(width), height))
dr.set_thread_count(THREADS)
prepared = prepare(scene)
with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
    expose(prepared)
    kernel = max(dr.kernel_history([dr.KernelType.JIT]), key=lambda k: k["operation_count"])
def measured(i):
    start = time.process_time()
    return seconds(lambda: expose(with_seed(prepared, i))), time.process_time() - start
times, cpu = zip(*[measured(i) for i in range(8)][2:])
compile_seconds = (kernel["codegen_time"] + kernel["backend_time"]) / 1e3
print(json.dumps([statistics.median(times), min(cpu), kernel["operation_count"], compile_seconds]))
"""
Change = Callable[[vr.Scene], vr.Scene]


def balls(only: str = "", **fields: object) -> Change:
    """A change of the materials of all balls, or only of the material `only` if it is given.

    fields: fields of vr.Material and their new values
    """
    names = [only] if only else [f"paint {i}" for i in range(8)]
    return lambda s: replace(s, materials=s.materials | {n: replace(s.materials[n], **fields) for n in names})


def settings(**fields: object) -> Change:
    """A change of the settings. fields: fields of vr.Settings and their new values."""
    return lambda s: replace(s, settings=replace(s.settings, **fields))


def filtered(kind: str) -> Change:
    """A change of the filter of pixels. kind: its name"""
    return lambda s: vr.replaced(s, "film.filter", kind)


def floor(texture: object) -> Change:
    """A change that puts a texture on the floor."""
    grey = vr.Material(texture="t")
    return lambda s: replace(s, textures={"t": texture}, materials=s.materials | {"grey": grey})


def both(first: Change, second: Change) -> Change:
    """A change that makes two changes, one after the other."""
    return lambda s: second(first(s))


def changes(picture: str, panorama: str) -> dict[str, Change]:
    """The changes of the matte scene, by the name that the table shows. picture: path of an image, for a
    texture. panorama: path of an environment map."""
    lamp = ours(ring(), SPP).lights["key"]
    lit = lambda **f: lambda s: replace(s, lights={"key": replace(lamp, **f)})  # noqa: E731 - a change like the others
    return {
        "no shadows": settings(shadows=False),
        "no ambient light": lambda s: replace(s, ambient=BLACK),
        "black background": lambda s: replace(s, background=BLACK),
        "environment map": lambda s: replace(s, background=vr.EnvironmentMap(panorama)),
        "transparent film": lambda s: replace(s, film=replace(s.film, transparent=True)),
        "light weakens with distance": lit(a=1.0, b=0.01),
        "highlights": balls(ks=HALF, shininess=32.0),
        "highlights, exponent not a whole number": balls(ks=HALF, shininess=32.5),
        "checkered floor": floor(vr.CheckerTexture()),
        "picture on the floor": floor(vr.ImageTexture(file=picture, filter="nearest")),
        "blended picture on the floor": floor(vr.ImageTexture(file=picture)),
        **{f"filter {kind.type}": filtered(kind.type) for kind in filters.KINDS if kind is not filters.BoxFilter},
        "lens": lambda s: replace(s, camera=replace(s.camera, aperture=0.2)),
        "coloured shadows": both(balls(kt=HALF), settings(depth=0)),
        "balls are mirrors": balls(kr=HALF),
        "balls are varnished (fresnel)": balls(kr=HALF, fresnel="dielectric"),
        "balls are metal (fresnel)": balls(kr=HALF, fresnel="metal"),
        "one ball is glass": balls("paint 7", kt=HALF),
        "balls are glass": balls(kt=HALF),
        "balls are glass that reflects": balls(kt=HALF, kr=HALF),
        "balls are glass that reflects (fresnel)": balls(kt=HALF, kr=HALF, fresnel="dielectric"),
        "balls are glass that absorbs (absorption)": balls(kt=HALF, absorption=HALF),
        "scattered light, 1 ray": settings(scatter=vr.Scatter(rays=1)),
        "area light, 16 samples": lambda s: replace(s, lights={"key": PANEL}),
        "sky occlusion, 16 rays": settings(occlusion=vr.Occlusion(sky=16)),
        "near occlusion, 16 rays": both(settings(occlusion=vr.Occlusion(near=16)), lit(Ia=HALF)),
    }


def kernel(prepared: Prepared) -> tuple[int, float]:
    """Operations and compile seconds of the kernel of a prepared scene."""
    measurements = [UncachedPicture.of(prepared).compiled() for _ in range(COMPILED)]
    return measurements[0][0], median(s for _, s in measurements)


def row(name: str, matte: Prepared, prepared: Prepared) -> dict:
    """The row of the table for one scene, as a dict. The scene is compared with the matte scene."""
    operations, compiled = kernel(prepared)
    times = []
    for seed in range(-1, PAIRS):
        order = (matte, prepared) if seed % 2 else (prepared, matte)
        pair = {id(m): seconds(lambda m=m, s=seed: expose(with_seed(m, s + 1))) for m in order}
        times.append((pair[id(matte)], pair[id(prepared)]))
    ratios = [b / a for a, b in times[1:]]
    before, after = (set(m.features.names()) for m in (matte, prepared))
    return {
        "scene": name,
        "adds": [n for n in prepared.features.names() if n not in before],
        "lacks": [n for n in matte.features.names() if n not in after],
        "operations": operations,
        "compile_s": compiled,
        "seconds": median(b for _, b in times[1:]),
        "ratio": median(ratios),
        "ratio_range": [min(ratios), max(ratios)],
    }


def table(only: list[str]) -> list[dict]:
    """The rows for the matte scene, and for the scenes with one effect more or less. only: parts of the names of the
    scenes that are measured; all if it is empty."""
    matte = prepare(ours(ring(), SPP))
    kernel(matte)  # LLVM itself starts with the first kernel
    rows = [row("matte", matte, prepare(ours(ring(), SPP)))]
    with tempfile.TemporaryDirectory() as folder:
        picture = str(Path(folder, "noise.png"))
        Image.fromarray(np.random.default_rng(0).integers(0, 256, (256, 256, 3), np.uint8)).save(picture)
        panorama = str(Path(folder, "panorama.png"))
        Image.fromarray(np.random.default_rng(1).integers(0, 256, (256, 512, 3), np.uint8)).save(panorama)
        for name, change in changes(picture, panorama).items():
            if only and not any(part in name for part in only):
                continue
            rows.append(row(name, matte, prepare(change(ours(ring(), SPP)))))
            sys.stderr.write(f"{name}: {rows[-1]['ratio']:.2f}\n")
    return rows


def against(before: Path) -> dict:
    """The figures of this visray and of an earlier visray, for the matte scene and the scenes in COMPARED.

    before: the checkout of the earlier visray
    Returns a dict from the name of the scene to its figures, with the commit of the earlier visray.
    """
    commit = ["git", "-C", str(before), "rev-parse", "--short", "HEAD"]
    commit_hash = subprocess.run(commit, check=True, capture_output=True, text=True).stdout.strip()
    return {"commit": commit_hash, "pairs": PROCESSES} | {name: compared(before, name) for name in ("matte", *COMPARED)}


def compared(before: Path, name: str) -> dict:
    """The figures of one scene with this visray and an earlier visray, as a dict.

    Processes of both alternate. The kernel caches are empty before the first pair.
    """
    paths = before, HERE.parent
    runs: dict[Path, list] = {path: [] for path in paths}
    with tempfile.TemporaryDirectory() as cache:
        for i in range(PROCESSES):
            for path in paths if i % 2 else paths[::-1]:
                runs[path].append(run_of(path, name, cache))
    (old, old_cpu, old_operations, old_compiled), (new, cpu, operations, compiled) = (
        tuple(zip(*runs[path])) for path in paths
    )
    ratios = sorted(b / a for a, b in zip(old, new))
    sys.stderr.write(f"{name}: {median(ratios):.2f} of the earlier time\n")
    return {
        "operations_before": old_operations[0],
        "operations": operations[0],
        "compile_s_before": old_compiled[0],
        "compile_s": compiled[0],
        "seconds_before": median(old),
        "seconds": median(new),
        "ratio": median(ratios),
        "ratio_quartiles": [ratios[len(ratios) // 4], ratios[-1 - len(ratios) // 4]],
        "ratio_range": [ratios[0], ratios[-1]],
        "cpu_ratio": median(b / a for a, b in zip(old_cpu, cpu)),
    }


def run_of(path: Path, name: str, cache: str) -> tuple[float, float, int, float]:
    """The four numbers that CHILD prints for a scene, in a new process with the visray of a checkout.

    path: the checkout; cache: folder for the kernel caches
    """
    environment = os.environ | {
        "PYTHONPATH": f"{path}{os.pathsep}{path / 'reference'}",
        "DRJIT_CACHE_DIR": str(Path(cache, path.name)),
    }
    command = [sys.executable, "-c", CHILD, name, str(HERE.parent / "scenes" / f"{name}.json"), str(WIDTH)]
    process = subprocess.run(command, check=True, capture_output=True, text=True, cwd=path, env=environment)
    return tuple(json.loads(process.stdout))


def main() -> None:
    parser = report_parser(__doc__)
    parser.add_argument("--before", type=Path, help="a checkout of an earlier visray")
    parser.add_argument("--only-before", action="store_true", help="no table of effects")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="measure only scenes whose name has this")
    chosen = parser.parse_args()
    dr.set_thread_count(THREADS)
    rows = [] if chosen.only_before else table(chosen.only)
    report = machine() | {"size": SIZE, "spp": SPP, "load": os.getloadavg()[0], "rows": rows}
    if chosen.before:
        report["before"] = against(chosen.before.resolve())
    write_report(report, chosen.output)


if __name__ == "__main__":
    main()
