"""Motion blur against the mean of 64 sharp frames, and what it costs.

    python reference/motion_blur.py -o reference/motion_blur.json

Error: a frame of each animated scene is rendered with a shutter of 64 moments, and so are 64 sharp frames, one at each
of these moments, all with other seeds. The root mean square of the difference between the blurred frame and the mean of
the sharp ones is compared with its standard error, which comes from the variances of both (layer variance). Samples are
independent of each other, so that these variances are true. `bias` is the mean of the difference, in its standard
errors. `moved` is the difference between one sharp frame and the mean, for comparison.

Cost: the next frame of the scene as it is, with its own number of moments, and the same without a shutter, by turns,
from the prepared scene to the picture in memory. Kernels are compiled before. Times are medians.
"""

import statistics
import time
from pathlib import Path

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import numpy as np
from machine import machine
from report import report_parser, write_report

from visray.animation.moment import assignments
from visray.moving import moving
from visray.scene.adjusted import adjusted

SCENES = Path(__file__).resolve().parents[1] / "scenes"
# By scene: seconds, at which much moves.
TIMES = {"bouncing-balls": 0.1, "heart-beat": 0.12, "barth-turn": 1.5, "earth-and-moon": 3.0, "data-year": 1.0}
SMALL, LARGE = (120, 68), (480, 270)
MOMENTS, SPP, SHARP_SPP, RUNS = 64, (16, 256), 16, 5
LAYERS = "RGB", "variance"


def rendered(scene: vr.Scene | vr.Prepared, **more: object) -> vr.Image:
    return vr.render(scene, progress=False, **{"layers": LAYERS} | more)


def difference(scene: vr.Scene, t: float) -> list[dict]:
    """How a blurred frame differs from the mean of sharp ones, for each number of samples. t: time of the frame."""
    scene = adjusted(vr.replaced(scene, "settings.sampler", "independent"), size=SMALL)
    scene = vr.replaced(scene, "camera.shutter", vr.Shutter(close=1, moments=MOMENTS))
    times = scene.camera.shutter.times(t, 1 / scene.animation.fps)
    sharp = [rendered(vr.at(scene, x), seed=1000 + k, spp=SHARP_SPP) for k, x in enumerate(times)]
    mean = np.mean([image["RGB"].astype(float) for image in sharp], 0)
    noise = sum(image["variance"].astype(float) for image in sharp) / SHARP_SPP / MOMENTS**2
    moved = rendered(vr.at(scene, t), spp=max(SPP))["RGB"] - mean
    rows = []
    for spp in SPP:
        image = rendered(scene, at=t, spp=spp)
        error, variance = image["RGB"] - mean, noise + image["variance"] / spp
        standard = rms(np.sqrt(variance))
        rows.append({
            "spp": spp, "rms": rms(error), "standard_error": standard, "ratio": rms(error) / standard,
            "bias": float(error.mean() / np.sqrt(variance.sum()) * variance.size), "moved": rms(moved),
        })  # fmt: skip
    return rows


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.square(values).mean()))


def cost(scene: vr.Scene, t: float) -> list[dict]:
    """Seconds of a blurred and of a sharp frame, for each number of samples. t: time of the first frame."""
    scene = adjusted(scene, size=LARGE)
    if scene.camera.shutter is None:
        scene = vr.replaced(scene, "camera.shutter", vr.Shutter())
    return [seconds(adjusted(scene, spp=spp), t) | {"spp": spp} for spp in SPP]


def seconds(scene: vr.Scene, t: float) -> dict:
    """Seconds of a frame with and without blur, on the clock and of the processors, by turns."""
    prepared, found = vr.prepare(vr.at(scene, t)), {"blurred": [], "sharp": []}
    for run in range(RUNS + 1):
        now = t + run / scene.animation.fps
        for name, sort in found.items():
            start, used = time.perf_counter(), time.process_time()
            prepared = prepared.updated(assignments(scene, now))
            rendered(moving(prepared, scene, now) if name == "blurred" else prepared, layers=("RGB",))
            sort.append((time.perf_counter() - start, time.process_time() - used))
    wall, used = ({name: medians(sort)[k] for name, sort in found.items()} for k in (0, 1))
    return {
        "moments": scene.camera.shutter.moments,
        "blurred_s": wall["blurred"], "sharp_s": wall["sharp"], "ratio": wall["blurred"] / wall["sharp"],
        "processor_ratio": used["blurred"] / used["sharp"],
    }  # fmt: skip


def medians(runs: list[tuple[float, float]]) -> list[float]:
    """Medians of all runs but the first one, in which kernels are compiled."""
    return [statistics.median(column) for column in zip(*runs[1:])]


def main() -> None:
    chosen = report_parser(__doc__).parse_args()
    rows = []
    for name, t in TIMES.items():
        scene = vr.load(SCENES / f"{name}.json")
        rows.append({"scene": name, "t": t, "difference": difference(scene, t), "cost": cost(scene, t)})
    sizes = {"small": SMALL, "large": LARGE, "moments": MOMENTS, "sharp_spp": SHARP_SPP, "runs": RUNS}
    write_report(machine() | sizes | {"scenes": rows}, chosen.output)


if __name__ == "__main__":
    main()
