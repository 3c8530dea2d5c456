"""Time and memory against the number of objects: spheres, and the triangles of a mesh.

    python reference/growth.py -o reference/growth.json --plot docs/growth.png

The scene is a plane with random spheres, or with a bumpy ball of triangles, and a point light; 512 x 512 pixels and 1
sample per pixel. Each case runs in a process of its own. Kernels come from Dr.Jit's cache on disk, which the first case
of each sort fills. Spheres are Python objects; the mesh is a binary PLY file.

load: from nothing to a checked scene. prepare: packing, and the lists of camera and light. picture: rays and shading of
the first picture. second: the same picture with the light elsewhere. memory: greatest size of the process.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit loads
import bench_mitsuba as peer
import numpy as np

NUMBERS = (100, 1_000, 10_000, 100_000, 1_000_000)
SORTS = ("spheres", "triangles")
STAGES = ("load", "prepare", "picture", "second")
CLOCKS = {"wall": time.perf_counter, "cpu": time.process_time}


def scene_of(sort: str, n: int, folder: Path) -> vr.Scene:
    """The scene with about n objects."""
    if sort == "spheres":
        return peer.ours(peer.cloud(n), 1)
    mesh = vr.Mesh(file=str(folder / f"{n}.ply"), normals="face", material="grey")
    scene = peer.ours([], 1)
    return vr.Scene(camera=scene.camera, film=scene.film, materials=scene.materials, lights=scene.lights,
                    settings=scene.settings, objects=scene.objects | {"ball": mesh})  # fmt: skip


def write_ball(n: int, path: Path) -> int:
    """Writes a bumpy ball of about n triangles as a binary PLY file. Returns their number."""
    from bench_lists import bumpy_ball

    columns = max(8, round(n**0.5))
    vertices, faces = bumpy_ball(columns, max(4, columns // 2))
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
    head += "".join(f"property float {c}\n" for c in "xyz")
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = np.zeros(len(faces), [("n", "u1"), ("f", "<i4", 3)])
    rows["n"], rows["f"] = 3, faces
    path.write_bytes(head.encode() + vertices.astype("<f4").tobytes() + rows.tobytes())
    return len(faces)


def case(sort: str, n: int, folder: Path, clock: str) -> dict:
    """Seconds of each stage and bytes of memory, for one case, in this process."""
    now = CLOCKS[clock]
    moments = [now()]
    scene = vr.replaced(scene_of(sort, n, folder), "settings.seed", 1)
    moments.append(now())
    prepared = vr.prepare(scene)
    moments.append(now())
    vr.render(prepared, layers=["RGB"], progress=False)
    moments.append(now())
    vr.render(prepared.updated({"lights.key.position": (3.9, 8.0, 5.0)}), layers=["RGB"], progress=False)
    moments.append(now())
    seconds = dict(zip(STAGES, np.diff(moments).tolist()))
    return seconds | {"memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024}


def plot(report: dict, path: Path) -> None:
    """The curves of the report as a picture."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), dpi=110, constrained_layout=True)
    for sort, colour in zip(SORTS, ("C0", "C1")):
        cases = [c for c in report["cases"] if c["sort"] == sort]
        n = [c["objects"] for c in cases]
        total = [sum(c[s] for s in STAGES[:3]) for c in cases]
        left.loglog(n, total, "o-", color=colour, label=f"{sort}, first picture")
        left.loglog(n, [c["second"] for c in cases], "s--", color=colour, label=f"{sort}, light moved")
        right.loglog(n, [c["memory"] / 1e9 for c in cases], "o-", color=colour, label=sort)
    left.set(xlabel="objects", ylabel="seconds")
    right.set(xlabel="objects", ylabel="gigabytes")
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--plot", type=Path)
    parser.add_argument("--clock", choices=CLOCKS, default="wall")
    parser.add_argument("--numbers", type=int, nargs="*", default=NUMBERS)
    parser.add_argument("--case", nargs=3, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.case:
        sort, n, folder = chosen.case
        print(json.dumps(case(sort, int(n), Path(folder), chosen.clock)))
        return
    from machine import machine

    report = machine() | {"clock": chosen.clock, "cases": []}
    with tempfile.TemporaryDirectory() as folder:
        for sort in SORTS:
            for turn, n in enumerate([chosen.numbers[0], *chosen.numbers]):
                count = n if sort == "spheres" else write_ball(n, Path(folder) / f"{n}.ply")
                command = [sys.executable, __file__, "--clock", chosen.clock, "--case", sort, str(n), folder]
                figures = json.loads(subprocess.run(command, check=True, capture_output=True).stdout.splitlines()[-1])
                if turn:  # the first run fills Dr.Jit's cache
                    report["cases"].append({"sort": sort, "objects": count} | figures)
                    print(json.dumps(report["cases"][-1]), flush=True)
    if chosen.output:
        chosen.output.write_text(json.dumps(report, indent=1) + "\n")
    if chosen.plot:
        plot(report, chosen.plot)


if __name__ == "__main__":
    main()
