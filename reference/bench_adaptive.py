"""What `--error` saves: samples where there is noise, against equally many everywhere, at equal error.

    python reference/bench_adaptive.py -o reference/bench_adaptive.json

Of each scene, render(error=E) is made; its true error is found against a converged picture of other seeds (whose own
error is taken out). Then the time that a uniform render takes for the same true error: by turns with the other, at
powers of two of samples, in between on a straight line of logarithms. Uniform renders are made with the scene's own
sampler, as `--spp` does, and with Sobol points, which `--error` takes in place of stratified ones. All kernels are
compiled before, only the colour is made; medians of `--runs`, seconds of the clock and of the processor.
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
from visray.render import adjusted
from visray.scene.scene import Scene

SCENES = Path(__file__).resolve().parents[1] / "scenes"
# Width of the film, samples of each half of the converged picture, and the errors asked for.
CASES = {
    "penumbra": (480, 2048, (0.003, 0.001)),
    "defocus-blur": (400, 2048, (0.015, 0.005)),
    "heart": (240, 1024, (0.02, 0.008)),
}
SAMPLES = [2**k for k in range(1, 14)]
# Seeds of the converged picture.
SEEDS = 1001, 1002


def resized(scene: Scene, width: int) -> Scene:
    return adjusted(scene, size=(width, round(width * scene.film.height / scene.film.width)))


def picture(scene: Scene, **how: Any) -> tuple[np.ndarray, float, float, dict]:
    """The colour of a picture, the seconds of the clock and of the processor that it took, what it says of itself."""
    begun, spent = perf_counter(), process_time()
    image = vr.render(scene, layers=("RGB",), progress=False, **how)
    return image["RGB"].astype(float), perf_counter() - begun, process_time() - spent, image.metadata


class Truth:
    """A converged picture: the mean of two halves, and the variance of it."""

    def __init__(self, scene: Scene, spp: int):
        a, b = (picture(adjusted(scene, sampler="sobol", seed=seed), spp=spp)[0] for seed in SEEDS)
        self.mean, self.variance = (a + b) / 2, np.square(a - b).mean() / 4
        self.luminance = float((self.mean @ LUMINANCE).mean())

    @property
    def error(self) -> float:
        return float(np.sqrt(self.variance)) / self.luminance

    def error_of(self, rgb: np.ndarray) -> float:
        """The relative error of a picture, without that of the truth."""
        square = np.square(rgb - self.mean).mean() - self.variance
        return float(np.sqrt(max(square, 0))) / self.luminance


def uniform(scene: Scene, truth: Truth, error: float) -> list[int]:
    """The samples between which a uniform render has this error."""
    for n in SAMPLES:
        if truth.error_of(picture(scene, spp=n)[0]) <= error:
            return [n // 2, n]
    raise SystemExit(f"{SAMPLES[-1]} samples do not do for an error of {error:.2g}")


def between(points: list[tuple[float, float]], error: float) -> float:
    """The seconds for an error, on a line of logarithms through two points (error, seconds)."""
    (e0, t0), (e1, t1) = points
    share = np.log(e0 / error) / np.log(e0 / e1)
    return float(np.exp(np.log(t0) + share * np.log(t1 / t0)))


def compared(scene: Scene, truth: Truth, error: float, runs: int) -> dict:
    """One target: what both ways take."""
    found = [picture(scene, error=error) for _ in range(2)]
    reached = truth.error_of(found[0][0])
    ways = {scene.settings.sampler: scene, "sobol": adjusted(scene, sampler="sobol")}
    counts = {name: uniform(s, truth, reached) for name, s in ways.items()}
    adaptive: list[tuple[float, float]] = []
    times: dict[str, dict[int, list]] = {name: {n: [] for n in ns} for name, ns in counts.items()}
    errors: dict[str, dict[int, float]] = {name: {} for name in counts}
    for _ in range(runs):
        adaptive.append(picture(scene, error=error)[1:3])
        for name, ns in counts.items():
            for n in ns:
                rgb, *taken, _ = picture(ways[name], spp=n)
                times[name][n].append(taken)
                errors[name][n] = truth.error_of(rgb)
    wall, cpu = (median(t[i] for t in adaptive) for i in (0, 1))
    facts = found[0][3]
    report = {
        "error_asked": error,
        "error_estimated": facts["error"],
        "error_true": reached,
        "spp": facts["spp"],
        "spp_least": facts["spp_least"],
        "spp_most": facts["spp_most"],
        "seconds": wall,
        "cpu_seconds": cpu,
        "uniform": {},
    }
    for name, ns in counts.items():
        taken = [
            between([(errors[name][n], median(t[i] for t in times[name][n])) for n in ns], reached) for i in (0, 1)
        ]
        spp = between([(errors[name][n], float(n)) for n in ns], reached)
        report["uniform"][name] = {
            "spp": spp,
            "seconds": taken[0],
            "cpu_seconds": taken[1],
            "ratio": taken[0] / wall,
            "cpu_ratio": taken[1] / cpu,
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
