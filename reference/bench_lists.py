"""The speed of lists: many spheres, and meshes of many triangles, on a plane under a point light, against Mitsuba.

    python reference/bench_lists.py -o reference/bench_lists.json

Both programs render the same scene with hard shadows, 512 x 512 pixels, 2 threads, with kernels compiled before. They
alternate, and each figure is the median of 5 renders (of 3 where a render of Mitsuba takes seconds).

spheres: 100, 1,000, 10,000 and 100,000 random spheres in the same space. Mitsuba has one `sphere` shape for each.
meshes: a bumpy ball of 10,000, 160,000 and 1,000,000 triangles with flat faces. Mitsuba finds them with Embree.
`ratio` is Mitsuba's time over visray's. In `ratio_with_build`, visray's time contains the build of its lists, and
Mitsuba's its build of the scene's acceleration structure.
Mitsuba's integrator is `direct` with one emitter sample and no BSDF sample, its fastest way to this picture.
"""

import json
import statistics
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import bench_mitsuba as peer
import drjit as dr
import mitsuba as mi
import numpy as np
from machine import machine
from report import report_parser

from visray.passes import expose
from visray.setup import prepare

SPHERES, MESHES = (100, 1_000, 10_000, 100_000), ((100, 50), (400, 200), (1000, 500))
SAMPLES, RUNS = (16, 64), 5
CLOCKS = {"wall": time.perf_counter, "cpu": time.process_time}
GREY = (0.6, 0.5, 0.4)


def bumpy_ball(columns: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a closed ball with bumps, of 2 columns (rows - 1) triangles."""
    polar = np.linspace(0, np.pi, rows + 1)[1:-1]
    t, p = np.meshgrid(polar, np.linspace(0, 2 * np.pi, columns, endpoint=False), indexing="ij")
    r = 2.2 * (1 + 0.06 * np.sin(9 * t) * np.cos(11 * p) + 0.02 * np.sin(31 * t) * np.sin(29 * p))
    ring = np.stack([r * np.sin(t) * np.cos(p), 2.4 + r * np.cos(t), r * np.sin(t) * np.sin(p)], -1).reshape(-1, 3)
    i, j = np.arange(rows - 2)[:, None] * columns, np.arange(columns)[None]
    a, b = (i + j).ravel(), (i + (j + 1) % columns).ravel()
    top, bottom = len(ring), len(ring) + 1
    first, last = np.arange(columns), (rows - 2) * columns + np.arange(columns)
    faces = [
        np.stack([a, b, a + columns], 1),
        np.stack([b, b + columns, a + columns], 1),
        np.stack([np.full(columns, top), np.roll(first, -1), first], 1),
        np.stack([np.full(columns, bottom), last, np.roll(last, -1)], 1),
    ]
    return np.concatenate([ring, [[0, 4.6, 0], [0, 0.2, 0]]]), np.concatenate(faces)


def our_mesh(vertices: np.ndarray, faces: np.ndarray) -> vr.Scene:
    """The scene with a mesh for visray."""
    scene = peer.ours([], 16)
    mesh = vr.Mesh(vertices=vertices, faces=faces, normals="face", material="paint")
    materials = scene.materials | {"paint": vr.Material(kd=GREY)}
    return replace(scene, objects=scene.objects | {"ball": mesh}, materials=materials)


def their_scene(spheres: peer.Balls, mesh: Path | None = None) -> "mi.Scene":
    """The same scene for Mitsuba. mesh: a PLY file with a mesh, or None."""
    content = peer.mitsuba_content(spheres)
    content["integrator"] |= {"emitter_samples": 1, "bsdf_samples": 0}
    if mesh is not None:
        bsdf = {"type": "diffuse", "reflectance": {"type": "rgb", "value": GREY}}
        content["ball"] = {"type": "ply", "filename": str(mesh), "face_normals": True,
                           "bsdf": {"type": "twosided", "inside": bsdf}}  # fmt: skip
    return mi.load_dict(content)


class Race:
    """Two programs that render one scene by turns. clock: function that returns the seconds to compare."""

    def __init__(self, scene: vr.Scene, their_content, clock) -> None:
        self.clock, self.scene, self.content = clock, scene, their_content
        self.seeds = iter(range(1, 100_000))
        expose(prepare(scene))  # compiles the kernels, and reads meshes
        self.prepared, self.our_build = self.timed(lambda: prepare(scene))
        self.theirs, self.their_build = self.timed(their_content)

    def timed(self, work):
        """(result, seconds) of a call."""
        dr.sync_thread()
        start = self.clock()
        result = work()
        dr.sync_thread()
        return result, self.clock() - start

    def run(self, spp: int, runs: int) -> dict:
        """Figures at a number of samples per pixel."""
        prepared = self.prepared.adjusted(vr.replaced(self.scene, "settings.spp", spp))

        def visray() -> None:
            expose(peer.with_seed(prepared, next(self.seeds)))

        def mitsuba() -> None:
            dr.eval(mi.render(self.theirs, spp=spp, seed=next(self.seeds)))

        for work in (visray, mitsuba):
            work()
        times = [(self.timed(visray)[1], self.timed(mitsuba)[1]) for _ in range(runs)]
        ours, theirs = (statistics.median(t) for t in zip(*times))
        rate = peer.SIZE**2 * spp / 1e6
        return {
            "spp": spp,
            "runs": runs,
            "visray_Msamples_per_s": rate / ours,
            "mitsuba_Msamples_per_s": rate / theirs,
            "ratio": theirs / ours,
            "ratio_range": [min(t / o for o, t in times), max(t / o for o, t in times)],
            "build_s": {"visray": self.our_build, "mitsuba": self.their_build},
            "ratio_with_build": (theirs + self.their_build) / (ours + self.our_build),
        }


def main() -> None:
    parser = report_parser(__doc__)
    parser.add_argument("--clock", choices=CLOCKS, default="wall", help="cpu: for a machine that others use too")
    parser.add_argument("--spheres", type=int, nargs="*", default=SPHERES)
    parser.add_argument("--meshes", type=int, nargs="*", default=[n for n, _ in MESHES], help="columns of the ball")
    parser.add_argument("--samples", type=int, nargs="*", default=SAMPLES)
    chosen = parser.parse_args()
    mi.set_variant("llvm_ad_rgb")
    dr.set_thread_count(peer.THREADS)
    clock, report = CLOCKS[chosen.clock], machine() | {"size": peer.SIZE, "clock": chosen.clock, "cases": []}
    with tempfile.TemporaryDirectory() as folder:
        for n in chosen.spheres:
            balls = peer.cloud(n)
            race = Race(peer.ours(balls, 16), lambda balls=balls: their_scene(balls), clock)
            for spp in chosen.samples:
                _note(report, {"spheres": n} | race.run(spp, 3 if n > 10_000 else RUNS))
        for columns, rows in ((n, n // 2) for n in chosen.meshes):
            vertices, faces = bumpy_ball(columns, rows)
            path = Path(folder) / f"{columns}.ply"
            mesh = mi.Mesh("ball", len(vertices), len(faces))
            params = mi.traverse(mesh)
            params["vertex_positions"], params["faces"] = (
                vertices.astype(np.float32).ravel(),
                faces.ravel().astype("u4"),
            )
            params.update()
            mesh.write_ply(str(path))
            race = Race(our_mesh(vertices, faces), lambda path=path: their_scene([], path), clock)
            for spp in chosen.samples:
                _note(report, {"triangles": len(faces)} | race.run(spp, RUNS))
    if chosen.output:
        chosen.output.write_text(json.dumps(report, indent=1) + "\n")


def _note(report: dict, figures: dict) -> None:
    """Adds figures to the report, and shows them."""
    report["cases"].append(figures)
    sys.stdout.write(json.dumps(figures) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
