"""What it costs to find exact hits of a mesh with Embree, through Mitsuba: speeds, and rays with a wrong answer.

    python reference/embree_exact.py -o reference/embree_exact.json

Embree works in single precision. Its answers become those of the exact test of every triangle only if something shows
that it has missed no nearer triangle. The rays and the meshes are those of bench_tree.py, without the plane. Measured:

    embree      Embree alone
    proposed    the triangle that Embree finds, tested in double. `wrong`: number of rays whose answer is not exact
    certified   the same, and then the tree is walked up to that hit: for hidden rays not at all. This is exact
    tree        the tree alone. This is exact

The ways alternate in one process with one thread; the least CPU time of several runs counts. `speed` is relative to
Embree alone.
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import visray  # noqa: F401  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import drjit as dr
import mitsuba as mi
import numpy as np
from bench_incoherent import BODIES, ball, prepared, theirs
from bench_tree import SETS, A, Rays, cpu_seconds, ray_sets
from machine import machine
from report import report_parser, write_report

from visray.accel.intersect import Target, closest, occluded
from visray.accel.origin import Geometry, RayOrigin
from visray.geometry import gamma
from visray.pytree import rows
from visray.ray import NO_ROW, NOTHING_KNOWN, Ray

RUNS = 5


def mesh(n: int) -> tuple[Geometry, "mi.Scene"]:
    """The mesh for visray and for Mitsuba, both with the same numbers of triangles."""
    batch = next(b for b in prepared("mesh", n, "lens").kernel.geometry.batches if b.kind.triangular)
    geometry = Geometry(A, (replace(batch, first_row=0),), "tree")
    _ = geometry.tree  # It is built now, because no kernel that is being traced can build it.
    vertices, faces = ball(n)
    twin = mi.Mesh("mesh", len(vertices), len(faces))
    parameters = mi.traverse(twin)
    parameters["vertex_positions"] = mi.Float(vertices.astype(np.float32).ravel())
    parameters["faces"] = mi.UInt32(faces.astype(np.uint32).ravel())
    parameters.update()
    return geometry, mi.load_dict({"type": "scene", "mesh": twin})


def ways(geometry: Geometry, scene: "mi.Scene", rays: Rays, asked: str) -> dict[str, Callable]:
    """Functions that search in one way each. They return (distance, triangle) or (whether rays are hidden)."""
    batch, (o, d) = geometry.batches[0], (A.put(A.W, x) for x in rays[:2])
    n = dr.width(d)
    length = dr.full(A.D, dr.inf, n) if rays[2] is None else A.put(A.D, rays[2])
    dr.eval(o, d, length)

    def found() -> tuple[Any, Any]:
        ray = mi.Ray3f(mi.Point3f(o), mi.Vector3f(d), mi.Float(length), 0, [])
        if asked == "any":
            return (scene.ray_test(ray),)
        hit = scene.ray_intersect_preliminary(ray, coherent=False)
        return hit.t, hit.prim_index

    def proposal() -> tuple[Any, Any]:
        """(distance of the triangle that Embree finds, in double; its number)."""
        ray = mi.Ray3f(mi.Point3f(o), mi.Vector3f(d), mi.Float(length), 0, [])
        hit = scene.ray_intersect_preliminary(ray, coherent=False)
        valid = hit.is_valid()
        row = dr.select(valid, hit.prim_index, 0)
        x = batch.kind.crossing(batch.kind.seen(rows(batch.placed, row, valid), o), Ray(o, d), 0, None, NOTHING_KNOWN)
        met = valid & x.met
        return dr.select(met, x.t, dr.inf), dr.select(met, hit.prim_index, NO_ROW)

    def exact(active: Any, within: Any) -> tuple:
        origin, ray = RayOrigin(geometry, o, shared=False), Ray(o, d)
        if asked == "any":
            return (occluded(origin, ray, Target(length, dr.zeros(A.D, n)), active),)
        hit = closest(origin, ray, within=within)
        return hit.t, hit.row

    def proposed() -> tuple:
        t, row = proposal()
        return (t < length,) if asked == "any" else (t, row)

    def certified() -> tuple:
        t = proposal()[0]
        if asked == "any":
            return ((t < length) | exact(~(t < length), None)[0],)
        # The search ends behind the hit, because another triangle may be hit at the same distance.
        return exact(A.B(True), t * (1 + gamma(2)))

    everything = A.B(True), A.D(dr.inf)
    return {"embree": found, "proposed": proposed, "certified": certified, "tree": lambda: exact(*everything)}


def measured(geometry: Geometry, scene: "mi.Scene", rays: Rays, asked: str, runs: int) -> dict:
    """A dict: the speed of each way relative to Embree, and the number of wrong rays of the ways in double."""
    searches = ways(geometry, scene, rays, asked)
    answers = {name: [np.array(x) for x in search()] for name, search in searches.items()}
    times = [{name: cpu_seconds(search) for name, search in searches.items()} for _ in range(runs)]
    least = {name: min(t[name] for t in times) for name in searches}
    wrong = {name: int((answers[name][-1] != answers["tree"][-1]).sum()) for name in ("proposed", "certified")}
    return {"speed": {name: least["embree"] / t for name, t in least.items()}, "wrong": wrong, "rays": rays[0].shape[1]}


def main() -> None:
    parser = report_parser(__doc__)
    parser.add_argument("--counts", nargs="+", type=int, default=BODIES["mesh"], help="numbers of triangles")
    parser.add_argument("--runs", type=int, default=RUNS)
    chosen = parser.parse_args()
    mi.set_variant("llvm_ad_rgb")
    dr.set_thread_count(1)
    report = machine() | {"threads": 1, "results": []}
    for n in chosen.counts:
        geometry, scene = mesh(n)
        for name, rays in ray_sets(theirs("mesh", n, "lens")).items():
            result = {"triangles": n, "set": name} | measured(geometry, scene, rays, SETS[name], chosen.runs)
            report["results"].append(result)
            print(n, name, {k: round(x, 2) for k, x in result["speed"].items()}, result["wrong"], file=sys.stderr)
    write_report(report, chosen.output)


if __name__ == "__main__":
    main()
