"""The tree by itself: the speed of rays through it and through Mitsuba's scene, its build time, and its memory.

    python reference/bench_tree.py -o reference/bench_tree.json

1. Rays without a shared origin, on the plane and the meshes or spheres of bench_incoherent.py: rays over the hemisphere
   above points that the camera sees (occlusion), reflected rays (mirror), rays to points of a rectangle light (panel),
   and rays of a lens. Occlusion and panel rays ask whether anything is hit, mirror and lens rays for the first hit.
   Mitsuba answers with `ray_test` and `ray_intersect_preliminary`, which use Embree for triangles. Both programs
   alternate in one process with one thread; the least CPU time of several runs counts. Rays exist before: only the
   search is measured.
2. CPU seconds to build the tree over a mesh, and the peak memory of the process before and after.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import visray  # noqa: F401  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import drjit as dr
import mitsuba as mi
import numpy as np
from bench_incoherent import BODIES, EYE, FOV, LAMP, TARGET, prepared, theirs
from machine import machine
from report import report_parser, write_report

from visray.accel.intersect import Target, closest, occluded
from visray.accel.origin import Geometry, RayOrigin
from visray.film import tile_order
from visray.quantities import Arrays
from visray.ray import Ray

SIDE, RUNS = 512, 5
A = Arrays.of("llvm", "single")
# What the rays of each set ask for.
SETS = {"occlusion": "any", "mirror": "closest", "panel": "any", "lens": "closest"}
Rays = tuple[np.ndarray, np.ndarray, np.ndarray | None]


def camera_rays(seed: int, aperture: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Origins and unit directions of a ray through a random point of each pixel, in the order of visray's lanes."""
    rng, n = np.random.default_rng(seed), SIDE * SIDE
    y, x = np.divmod(tile_order(SIDE, SIDE), SIDE)
    x, y = ((v + rng.random(n)) / SIDE for v in (x, y))
    forward = np.subtract(TARGET, EYE)
    focus = np.linalg.norm(forward)
    forward = forward / focus
    right = np.cross(forward, (0, 1, 0))
    right /= np.linalg.norm(right)
    up, slope = np.cross(right, forward), np.tan(np.radians(FOV / 2))
    d = forward[:, None] + slope * ((2 * x - 1) * right[:, None] + (1 - 2 * y) * up[:, None])
    radius, turn = aperture / 2 * np.sqrt(rng.random(n)), 2 * np.pi * rng.random(n)
    offset = radius * (np.cos(turn) * right[:, None] + np.sin(turn) * up[:, None])
    d = d * focus - offset
    return np.array(EYE)[:, None] + offset, d / np.linalg.norm(d, axis=0)


def ray_sets(scene: "mi.Scene") -> dict[str, Rays]:
    """For each of SETS: origins, unit directions, and lengths or None. The surface points come from Mitsuba, and rays
    start a little above them."""
    (o, d), rng = camera_rays(1), np.random.default_rng(1)
    si = scene.ray_intersect(mi.Ray3f(mi.Point3f(o.astype(np.float32)), mi.Vector3f(d.astype(np.float32))))
    t, n = np.array(si.t, float), np.array(si.n, float)
    t, n = np.where(np.isfinite(t), t, 10), np.where(np.isfinite(t), n, [[0.0], [1], [0]])
    n = np.where((n * d).sum(axis=0) > 0, -n, n)
    p = o + t * d + 1e-4 * n
    above = n + (v := rng.normal(size=n.shape)) / np.linalg.norm(v, axis=0)  # density proportional to the cosine
    above /= np.maximum(np.linalg.norm(above, axis=0), 1e-9)
    mirrored = d - 2 * (n * d).sum(axis=0) * n
    to_lamp = np.array(LAMP)[:, None] + rng.uniform(-1, 1, n.shape) * [[1], [0], [1]] - p
    distance = np.linalg.norm(to_lamp, axis=0)
    return {
        "occlusion": (p, above, None),
        "mirror": (p, mirrored / np.linalg.norm(mirrored, axis=0), None),
        "panel": (p, to_lamp / distance, distance * (1 - 1e-4)),
        "lens": (*camera_rays(2, 0.4), None),
    }


def ours(geometry: Geometry, rays: Rays, asked: str) -> Callable:
    """A function that searches with visray and returns arrays."""
    o, d = (A.put(A.W, x) for x in rays[:2])
    length = dr.full(A.D, dr.inf, dr.width(d)) if rays[2] is None else A.put(A.D, rays[2])
    dr.eval(o, d, length)

    def search() -> Any:
        origin, ray = RayOrigin(geometry, o, shared=False), Ray(o, d)
        if asked == "closest":
            hit = closest(origin, ray)
            return hit.t, hit.row
        return occluded(origin, ray, Target(length, dr.zeros(A.D, dr.width(d))), A.B(True))

    return search


def mitsubas(scene: "mi.Scene", rays: Rays, asked: str) -> Callable:
    """The same with Mitsuba."""
    o, d = mi.Point3f(rays[0].astype(np.float32)), mi.Vector3f(rays[1].astype(np.float32))
    length = mi.Float(float("inf")) if rays[2] is None else mi.Float(rays[2].astype(np.float32))
    dr.eval(o, d, length)

    def search() -> Any:
        ray = mi.Ray3f(o, d, length, 0, [])
        if asked == "any":
            return scene.ray_test(ray)
        hit = scene.ray_intersect_preliminary(ray, coherent=False)
        return hit.t, hit.prim_index

    return search


def cpu_seconds(search: Callable) -> float:
    start = time.process_time()
    dr.eval(search())
    dr.sync_thread()
    return time.process_time() - start


def speeds(body: str, n: int, runs: int) -> list[dict]:
    """For each of SETS, a dict with millions of rays per second of both programs on one core.

    ratio: visray's speed divided by Mitsuba's.
    """
    geometry, scene, result = prepared(body, n, "occlusion").kernel.geometry, theirs(body, n, "occlusion"), []
    for name, rays in ray_sets(scene).items():
        searches = ours(geometry, rays, SETS[name]), mitsubas(scene, rays, SETS[name])
        for search in searches:
            cpu_seconds(search)
        a, b = (min(t) for t in zip(*((cpu_seconds(searches[0]), cpu_seconds(searches[1])) for _ in range(runs))))
        rate = SIDE * SIDE / 1e6
        result.append({"body": body, "rows": n, "rays": name, "visray": rate / a, "mitsuba": rate / b, "ratio": b / a})
        print(f"{body} {n} {name}: ratio {b / a:.2f}", file=sys.stderr, flush=True)
    return result


def build(n: int) -> dict:
    """CPU seconds and memory for the tree over a mesh of n triangles; to be called in a new process."""
    batches = prepared("mesh", n, "lens").kernel.geometry.batches
    dr.sync_thread()
    peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024  # noqa: E731 - MB
    before, start, wall = peak(), time.process_time(), time.perf_counter()
    tree = Geometry(A, batches, "tree").tree
    dr.sync_thread()
    cpu, wall = time.process_time() - start, time.perf_counter() - wall
    size = dr.width(tree.blocks) * 4 / 2**20
    return {"rows": n, "cpu_s": cpu, "wall_s": wall, "tree_MB": size, "peak_before_MB": before, "peak_MB": peak()}


def main() -> None:
    parser = report_parser(__doc__)
    parser.add_argument("--bodies", nargs="+", default=list(BODIES), choices=list(BODIES))
    parser.add_argument("--counts", nargs="+", type=int, help="numbers of rows; all of BODIES without it")
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--build", type=int, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    mi.set_variant("llvm_ad_rgb")
    dr.set_thread_count(1)
    if chosen.build:
        print(json.dumps(build(chosen.build)))
        return
    report = machine() | {"rays": SIDE * SIDE, "threads": 1, "unit": "million rays per second"}
    report |= {"speeds": [], "builds": []}
    for body in chosen.bodies:
        for n in BODIES[body]:
            if not chosen.counts or n in chosen.counts:
                report["speeds"] += speeds(body, n, chosen.runs)
                if body == "mesh":
                    command = [sys.executable, str(Path(__file__).resolve()), "--build", str(n)]
                    done = subprocess.run(command, check=True, stdout=subprocess.PIPE)
                    report["builds"].append(json.loads(done.stdout.splitlines()[-1]))
    write_report(report, chosen.output)


if __name__ == "__main__":
    main()
