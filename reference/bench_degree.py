"""The cost of polynomial surfaces: how the cost grows with the degree, and what double precision costs.

    DRJIT_CACHE_DIR=$(mktemp -d) python reference/bench_degree.py -o reference/bench_degree.json --plot docs/degree.png

The cache of kernels must be empty, so that compilation can be measured.

Degree: the Banchoff-Chmutov surfaces T_n(x) + T_n(y) + T_n(z) = 0 are intersected with 512 x 512 camera rays on one
thread. The time is the CPU time of one ray, the least of several runs, with kernels compiled before. The compile time
is reported separately. About the same number of rays hits each of the surfaces.

Precision: three cases are compared. (1) The surface is computed in double, and the rest (camera, normals, light) in
single precision. (2) Everything is computed in double. Both are measured for camera rays, and for samples of pictures
with light and shadow. (3) The surface itself is computed in single, which visray does not offer: the surface's kernel
runs in single for the same rays.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import visray  # noqa: F401  # isort: skip - before Dr.Jit, because it chooses the LLVM
import drjit as dr
import numpy as np
from machine import machine

from visray import roots
from visray.accel.intersect import closest
from visray.camera import Camera
from visray.integrator import camera_ray
from visray.lights import PointLight
from visray.passes import expose
from visray.primitives.clips import Ball
from visray.primitives.polynomial import Polynomial
from visray.scene.adjusted import adjusted
from visray.scene.scene import Film, Scene
from visray.setup import prepare

SIZE, RUNS, DEGREES = 512, 9, range(2, 21, 2)
# Positions in units of the clip's radius. The eye sees the whole clip, and does not look along a symmetry axis of the
# surfaces.
EYE, LAMP = (2.5, 1.4, 1.8), (3.0, -2.0, 4.0)
SAMPLES = 4


def chebyshev(n: int, variable: str) -> str:
    """The Chebyshev polynomial T_n as text: an expression by Horner's rule in the variable's square. Domain: even n."""
    c = np.polynomial.chebyshev.cheb2poly([0] * n + [1])[::2].astype(int).tolist()
    text = str(c[-1])
    for number in c[-2::-1]:
        text = f"({text}*{variable}^2{number:+d})"
    return text


def banchoff_chmutov(n: int) -> Polynomial:
    """The Banchoff-Chmutov surface of degree n, within a ball of radius 1.75."""
    return Polynomial(expression=" + ".join(chebyshev(n, v) for v in "xyz"), clip=Ball(radius=1.75))


def scene(surface: Polynomial, **settings: Any) -> Scene:
    """A scene with the surface, a camera and a point light. settings: options of render.adjusted, such as spp."""
    radius = surface.clip_volume().radius
    camera = Camera(origin=tuple(radius * x for x in EYE), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), fov=30.0)
    lights = {"key": PointLight(position=tuple(radius * x for x in LAMP))}
    lit = Scene(camera=camera, film=Film(width=SIZE, height=SIZE), lights=lights, objects={"surface": surface})
    return adjusted(lit, **settings) if settings else lit


def measured(work: Any) -> tuple[float, float, int]:
    """Least CPU seconds of several runs, compile seconds (NaN if kernels came from the disk), number of operations.

    work: function that returns the Dr.Jit arrays to evaluate
    """
    dr.flush_kernel_cache()
    least, compiled, operations = np.inf, 0.0, 0
    for run in range(RUNS):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.sync_thread()
            start = time.process_time()
            dr.eval(work())
            dr.sync_thread()
            seconds = time.process_time() - start
            kernels = dr.kernel_history([dr.KernelType.JIT])
        if run:
            least = min(least, seconds)
        else:
            compiled = sum(k["codegen_time"] + k["backend_time"] for k in kernels) / 1e3
            operations = sum(k["operation_count"] for k in kernels)
            from_disk = any(k["cache_disk"] for k in kernels)
    return least, np.nan if from_disk else compiled, operations


def of_degree(n: int) -> dict:
    """A dict with the cost of the Banchoff-Chmutov surface of degree n."""
    surface = banchoff_chmutov(n)
    start = time.perf_counter()
    surface.compiled()
    build_seconds = time.perf_counter() - start
    prepared = prepare(scene(surface))
    kernel, a = prepared.kernel, prepared.a

    def first_hits() -> Any:
        return closest(kernel.origin, camera_ray(kernel, a.F(prepared.x) + 0.5, a.F(prepared.y) + 0.5))

    seconds, compiled, operations = measured(first_hits)
    if np.isnan(compiled):
        raise SystemExit("kernels came from the disk; set DRJIT_CACHE_DIR to an empty folder")
    hits = float(np.mean(np.array(first_hits().row) == 0))
    return {
        "degree": n,
        "build_s": build_seconds,
        "compile_s": compiled,
        "operations": operations,
        "ns_per_ray": 1e9 * seconds / SIZE**2,
        "hits": hits,
    }


def exponent(rows: list[dict]) -> float:
    """The slope of log time over log degree. Degrees below 4 are left out: their roots are computed by formula."""
    rows = [r for r in rows if r["degree"] >= 4]
    return float(np.polyfit(np.log([r["degree"] for r in rows]), np.log([r["ns_per_ray"] for r in rows]), 1)[0])


def precision(name: str) -> dict:
    """A dict with times and errors of the three cases of precision. name: name of a surface in the catalogue."""
    surface = Polynomial(surface=name)
    prepared = {p: prepare(scene(surface, precision=p, spp=SAMPLES)) for p in ("single", "double")}
    report: dict = {"surface": name}

    def first_hits(p: str) -> Any:
        m = prepared[p]
        return closest(m.kernel.origin, camera_ray(m.kernel, m.a.F(m.x) + 0.5, m.a.F(m.y) + 0.5))

    m = prepared["single"]
    ray = camera_ray(m.kernel, m.a.F(m.x) + 0.5, m.a.F(m.y) + 0.5)
    o, d = np.array(m.kernel.origin.o, float).ravel(), np.array(ray.d, float)
    t = {"double": np.array(closest(m.kernel.origin, ray).t), "single": _in_single(m, surface, o, d)[1]}
    for p in prepared:
        report[f"{p}_ns"] = 1e9 * measured(lambda p=p: first_hits(p))[0] / SIZE**2
        report[f"{p}_picture_ns"] = 1e9 * measured(lambda p=p: expose(prepared[p])[0])[0] / SIZE**2 / SAMPLES
    report["inside_single_ns"] = 1e9 * measured(lambda: _in_single(m, surface, o, d)[0])[0] / SIZE**2
    hit_in_double, hit_in_single = np.isfinite(t["double"]), np.isfinite(t["single"])
    both = hit_in_double & hit_in_single
    error = np.abs(t["single"][both] / t["double"][both] - 1)
    report["inside_single_wrong_hits_per_million"] = 1e6 * float(np.mean(hit_in_double != hit_in_single))
    report["inside_single_wrong_roots_per_million"] = 1e6 * float(np.mean(error > 1e-3) * both.mean())
    report["inside_single_error_p999"] = float(np.quantile(error[error <= 1e-3], 0.999))
    return report


def _in_single(prepared: Any, surface: Polynomial, o: np.ndarray, d: np.ndarray) -> tuple[Any, np.ndarray]:
    """First hits computed in single only: the distances as a Dr.Jit array, and as a NumPy array.

    o, d: origin of the rays, (3), and directions, (3, N)
    """
    a, compiled = prepared.a, surface.compiled()
    real, vector = a.F32, a.V32
    direction = vector(np.ascontiguousarray(d.astype(np.float32)))
    origin = [real(float(x)) for x in o]
    radius = surface.clip_volume().radius
    middle = -(origin[0] * direction.x + origin[1] * direction.y + origin[2] * direction.z)
    nearest = [dr.fma(middle, y, x) for x, y in zip(origin, direction)]
    rest = radius**2 - sum(x * x for x in nearest)
    half = dr.sqrt(dr.maximum(rest, 0))
    ends = middle - half, middle + half
    segment = roots.ChordSegment.of(origin, tuple(direction), ends, *ends)
    c = roots.first_crossing(compiled.program, tuple(map(real, compiled.values)), segment, rest > 0)
    return c.t, np.array(c.t)


def plot(report: dict, path: Path) -> None:
    """Writes a plot of the time of a ray against the degree to `path`."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    rows = report["degrees"]
    x, y = [r["degree"] for r in rows], [r["ns_per_ray"] for r in rows]
    figure, axes = pyplot.subplots(figsize=(6, 4), dpi=120)
    axes.loglog(x, y, "o-", label=f"visray, degree^{report['exponent']:.2f} from 4 on")
    at = np.array([4, 20])
    axes.loglog(at, y[x.index(4)] * (at / 4) ** 2, "--", color="gray", label="quadratic")
    axes.set_xticks(x, [str(n) for n in x])
    axes.minorticks_off()
    axes.set_xlabel("degree of the Banchoff-Chmutov surface")
    axes.set_ylabel("ns per camera ray, one thread")
    axes.grid(alpha=0.3)
    axes.legend()
    figure.tight_layout()
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--plot", type=Path, help="a PNG file; needs matplotlib")
    args = parser.parse_args()
    dr.set_thread_count(1)
    report: dict = machine() | {"size": SIZE, "runs": RUNS, "degrees": []}
    for n in DEGREES:
        report["degrees"].append(of_degree(n))
        print(report["degrees"][-1], flush=True)
    report["exponent"] = exponent(report["degrees"])
    report["precision"] = [precision(name) for name in ("heart", "barth-sextic", "barth-decic")]
    print(json.dumps(report["precision"], indent=2), report["exponent"])
    if args.output:
        args.output.write_text(json.dumps(report, indent=2) + "\n")
    if args.plot:
        plot(report, args.plot)


if __name__ == "__main__":
    main()
