"""How the cost of a polynomial surface grows with its degree, and what precision costs.

    DRJIT_CACHE_DIR=$(mktemp -d) python reference/bench_degree.py -o reference/bench_degree.json --plot docs/degree.png

An empty cache, so that compilations are seen.

Degree: the Banchoff-Chmutov surfaces T_n(x) + T_n(y) + T_n(z) = 0, 512 x 512 camera rays, one thread, processor time of
one ray, least of several; kernels compiled before, the compilation told apart. All of them have about as many rays
that hit.

Precision: what is around the surface (camera, normals, light) in single and the surface in double, against all in
double, for camera rays and for samples of pictures with light and shadow; and the surface itself in single, which
visray does not offer: its kernel is asked in single for the same rays.
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
from visray.search import closest

from visray import roots
from visray.camera import Camera
from visray.integrator import camera_ray
from visray.lights import PointLight
from visray.passes import expose
from visray.primitives.clips import Ball
from visray.primitives.polynomial import Polynomial
from visray.render import adjusted
from visray.scene.scene import Film, Scene
from visray.setup import prepare

SIZE, RUNS, DEGREES = 512, 9, range(2, 21, 2)
# From here the clip is seen whole, along no symmetry of the surfaces.
EYE, LAMP = (2.5, 1.4, 1.8), (3.0, -2.0, 4.0)
SAMPLES = 4


def chebyshev(n: int, variable: str) -> str:
    """T_n by Horner's rule in the variable's square, for even n."""
    c = np.polynomial.chebyshev.cheb2poly([0] * n + [1])[::2].astype(int).tolist()
    text = str(c[-1])
    for number in c[-2::-1]:
        text = f"({text}*{variable}^2{number:+d})"
    return text


def banchoff_chmutov(n: int) -> Polynomial:
    """The surface of degree n, which lies within 1.75 of its middle."""
    return Polynomial(expression=" + ".join(chebyshev(n, v) for v in "xyz"), clip=Ball(radius=1.75))


def scene(surface: Polynomial, **settings: Any) -> Scene:
    radius = surface.clip_volume().radius
    camera = Camera(origin=tuple(radius * x for x in EYE), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), fov=30.0)
    lights = {"key": PointLight(position=tuple(radius * x for x in LAMP))}
    made = Scene(camera=camera, film=Film(width=SIZE, height=SIZE), lights=lights, objects={"surface": surface})
    return adjusted(made, **settings) if settings else made


def spent(work: Any) -> tuple[float, float, int]:
    """The least processor time of some runs, the seconds of the compilation (NaN if there was none), the operations of
    the kernels."""
    dr.flush_kernel_cache()
    least, compiled, operations = np.inf, 0.0, 0
    for run in range(RUNS):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.sync_thread()
            begun = time.process_time()
            dr.eval(work())
            dr.sync_thread()
            seconds = time.process_time() - begun
            kernels = dr.kernel_history([dr.KernelType.JIT])
        if run:
            least = min(least, seconds)
        else:
            compiled = sum(k["codegen_time"] + k["backend_time"] for k in kernels) / 1e3
            operations = sum(k["operation_count"] for k in kernels)
            from_disk = any(k["cache_disk"] for k in kernels)
    return least, np.nan if from_disk else compiled, operations


def of_degree(n: int) -> dict:
    """What one surface costs."""
    surface = banchoff_chmutov(n)
    begun = time.perf_counter()
    surface.compiled()
    built = time.perf_counter() - begun
    prepared = prepare(scene(surface))
    stage, a = prepared.kernel, prepared.a

    def look() -> Any:
        return closest(stage.origin, camera_ray(stage, a.F(prepared.x) + 0.5, a.F(prepared.y) + 0.5))

    seconds, compiled, operations = spent(look)
    if np.isnan(compiled):
        raise SystemExit("kernels came from the disk; set DRJIT_CACHE_DIR to an empty folder")
    hits = float(np.mean(np.array(look().index) == 0))
    return {
        "degree": n,
        "build_s": built,
        "compile_s": compiled,
        "operations": operations,
        "ns_per_ray": 1e9 * seconds / SIZE**2,
        "hits": hits,
    }


def exponent(rows: list[dict]) -> float:
    """The slope of log time over log degree, from degree 4: below, the roots come by formula."""
    rows = [r for r in rows if r["degree"] >= 4]
    return float(np.polyfit(np.log([r["degree"] for r in rows]), np.log([r["ns_per_ray"] for r in rows]), 1)[0])


def precision(name: str) -> dict:
    """Time and error of the three choices for a known surface."""
    surface = Polynomial(surface=name)
    made = {p: prepare(scene(surface, precision=p, spp=SAMPLES)) for p in ("single", "double")}
    found: dict = {"surface": name}

    def look(p: str) -> Any:
        m = made[p]
        return closest(m.kernel.origin, camera_ray(m.kernel, m.a.F(m.x) + 0.5, m.a.F(m.y) + 0.5))

    m = made["single"]
    ray = camera_ray(m.kernel, m.a.F(m.x) + 0.5, m.a.F(m.y) + 0.5)
    o, d = np.array(m.kernel.origin.o, float).ravel(), np.array(ray.d, float)
    t = {"double": np.array(closest(m.kernel.origin, ray).t), "single": _in_single(m, surface, o, d)[1]}
    for p in made:
        found[f"{p}_ns"] = 1e9 * spent(lambda p=p: look(p))[0] / SIZE**2
        found[f"{p}_picture_ns"] = 1e9 * spent(lambda p=p: expose(made[p])[0])[0] / SIZE**2 / SAMPLES
    found["inside_single_ns"] = 1e9 * spent(lambda: _in_single(m, surface, o, d)[0])[0] / SIZE**2
    hit, found_in_single = np.isfinite(t["double"]), np.isfinite(t["single"])
    both = hit & found_in_single
    off = np.abs(t["single"][both] / t["double"][both] - 1)
    found["inside_single_wrong_hits_per_million"] = 1e6 * float(np.mean(hit != found_in_single))
    found["inside_single_wrong_roots_per_million"] = 1e6 * float(np.mean(off > 1e-3) * both.mean())
    found["inside_single_error_p999"] = float(np.quantile(off[off <= 1e-3], 0.999))
    return found


def _in_single(made: Any, surface: Polynomial, o: np.ndarray, d: np.ndarray) -> tuple[Any, np.ndarray]:
    """Distances by the same kernel, all of it in single."""
    a, built = made.a, surface.compiled()
    real, many = a.F32, a.V32
    direction = many(np.ascontiguousarray(d.astype(np.float32)))
    origin = [real(float(x)) for x in o]
    radius = surface.clip_volume().radius
    middle = -(origin[0] * direction.x + origin[1] * direction.y + origin[2] * direction.z)
    nearest = [dr.fma(middle, y, x) for x, y in zip(origin, direction)]
    rest = radius**2 - sum(x * x for x in nearest)
    half = dr.sqrt(dr.maximum(rest, 0))
    ends = middle - half, middle + half
    way = roots.ChordSegment.of(origin, tuple(direction), ends, *ends)
    c = roots.first_crossing(built.program, tuple(map(real, built.values)), way, rest > 0)
    return c.t, np.array(c.t)


def plot(report: dict, path: Path) -> None:
    """The growth as a picture."""
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
