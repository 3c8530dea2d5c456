"""The time that `--error` saves: adaptive renders are compared with uniform renders of equal error.

A uniform render takes the same number of samples in each pixel.

    python reference/bench_adaptive.py -o reference/bench_adaptive.json

Each scene is rendered by render(error=E). The true error of the picture is its difference from a converged picture with
other seeds; the error of the converged picture itself is subtracted. Then uniform pictures are rendered with numbers of
samples that are powers of two. The time for the same true error is interpolated between two of them, linearly in
logarithms. The two kinds of render alternate. Uniform renders use the scene's own sampler, as `--spp` does; and, in a
second series, Sobol points, which `--error` uses instead of stratified points. All kernels are compiled before, and
only the colour is rendered. Times are medians over `--runs`, in seconds of wall clock and CPU.
"""

import argparse
import json
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import Any

import visray as vr  # isort: skip - before Dr.Jit, because it chooses the LLVM
import numpy as np
from machine import machine

from visray.output.curves import LUMINANCE
from visray.scene.adjusted import adjusted
from visray.scene.scene import Scene

SCENES = Path(__file__).resolve().parents[1] / "scenes"
# By scene: width of the film, samples per pixel of each half of the converged picture, and the requested errors.
CASES = {
    "penumbra": (480, 2048, (0.003, 0.001)),
    "defocus-blur": (400, 2048, (0.015, 0.005)),
    "heart": (240, 1024, (0.02, 0.008)),
}
SAMPLES = [2**k for k in range(1, 14)]
# Seeds of the two halves of the converged picture.
SEEDS = 1001, 1002


def resized(scene: Scene, width: int) -> Scene:
    """The scene with a film of this width and of the same proportions."""
    return adjusted(scene, size=(width, round(width * scene.film.height / scene.film.width)))


def picture(scene: Scene, **how: Any) -> tuple[np.ndarray, float, float, dict]:
    """Renders a picture: (colour, wall-clock seconds, CPU seconds, metadata). how: options of vr.render."""
    wall_start, cpu_start = perf_counter(), process_time()
    image = vr.render(scene, layers=("RGB",), progress=False, **how)
    return image["RGB"].astype(float), perf_counter() - wall_start, process_time() - cpu_start, image.metadata


class Truth:
    """A converged picture: the mean of two pictures (halves) with different seeds.

    mean: its colours; variance: mean square error of `mean`; luminance: its mean luminance
    """

    def __init__(self, scene: Scene, spp: int):
        a, b = (picture(adjusted(scene, sampler="sobol", seed=seed), spp=spp)[0] for seed in SEEDS)
        self.mean, self.variance = (a + b) / 2, np.square(a - b).mean() / 4
        self.luminance = float((self.mean @ LUMINANCE).mean())

    @property
    def error(self) -> float:
        """The relative error of the converged picture itself."""
        return float(np.sqrt(self.variance)) / self.luminance

    def error_of(self, rgb: np.ndarray) -> float:
        """The relative error of a picture. The mean square error of the converged picture is subtracted."""
        square = np.square(rgb - self.mean).mean() - self.variance
        return float(np.sqrt(max(square, 0))) / self.luminance


def uniform(scene: Scene, truth: Truth, error: float) -> list[int]:
    """Two numbers of samples per pixel, n / 2 and n. Between them, a uniform render reaches this error."""
    for n in SAMPLES:
        if truth.error_of(picture(scene, spp=n)[0]) <= error:
            return [n // 2, n]
    raise SystemExit(f"{SAMPLES[-1]} samples are too few for an error of {error:.2g}")


def interpolated(points: list[tuple[float, float]], error: float) -> float:
    """The value at an error, interpolated linearly in logarithms between two points (error, value)."""
    (e0, v0), (e1, v1) = points
    share = np.log(e0 / error) / np.log(e0 / e1)
    return float(np.exp(np.log(v0) + share * np.log(v1 / v0)))


def compared(scene: Scene, truth: Truth, error: float, runs: int) -> dict:
    """A dict with the times of adaptive and uniform renders for one requested error. runs: renders of each kind."""
    # The second picture is rendered so that kernels are compiled before times are measured.
    pictures = [picture(scene, error=error) for _ in range(2)]
    reached = truth.error_of(pictures[0][0])
    scenes = {scene.settings.sampler: scene, "sobol": adjusted(scene, sampler="sobol")}
    counts = {name: uniform(s, truth, reached) for name, s in scenes.items()}
    adaptive: list[tuple[float, float]] = []
    times: dict[str, dict[int, list]] = {name: {n: [] for n in ns} for name, ns in counts.items()}
    errors: dict[str, dict[int, float]] = {name: {} for name in counts}
    for _ in range(runs):
        adaptive.append(picture(scene, error=error)[1:3])
        for name, ns in counts.items():
            for n in ns:
                rgb, *seconds, _ = picture(scenes[name], spp=n)
                times[name][n].append(seconds)
                errors[name][n] = truth.error_of(rgb)
    wall, cpu = (median(t[i] for t in adaptive) for i in (0, 1))
    metadata = pictures[0][3]
    report = {
        "error_asked": error,
        "error_estimated": metadata["error"],
        "error_true": reached,
        "spp": metadata["spp"],
        "spp_least": metadata["spp_least"],
        "spp_most": metadata["spp_most"],
        "seconds": wall,
        "cpu_seconds": cpu,
        "uniform": {},
    }
    for name, ns in counts.items():
        seconds = [
            interpolated([(errors[name][n], median(t[i] for t in times[name][n])) for n in ns], reached) for i in (0, 1)
        ]
        spp = interpolated([(errors[name][n], float(n)) for n in ns], reached)
        report["uniform"][name] = {
            "spp": spp,
            "seconds": seconds[0],
            "cpu_seconds": seconds[1],
            "ratio": seconds[0] / wall,
            "cpu_ratio": seconds[1] / cpu,
        }
    return report


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    rows = []
    for name, (width, spp, errors) in CASES.items():
        scene = resized(vr.load(SCENES / f"{name}.json"), width)
        truth = Truth(scene, spp)
        for error in errors:
            row = compared(scene, truth, error, options.runs)
            row |= {"scene": name, "width": width, "height": scene.film.height, "truth_error": truth.error}
            rows.append(row)
            print(
                f"{name} {error}: true {row['error_true']:.5f}, {row['spp']:.1f} spp, {row['seconds']:.2f} s; "
                + "; ".join(
                    f"{k}: {u['spp']:.0f} spp, {u['seconds']:.2f} s, ratio {u['ratio']:.2f} (cpu {u['cpu_ratio']:.2f})"
                    for k, u in row["uniform"].items()
                ),
                flush=True,
            )
    report = machine() | {"runs": options.runs, "rows": rows}
    if options.output:
        options.output.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main()
