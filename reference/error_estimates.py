"""Tests of render(error=...) and render(time=...): whether pictures have the errors that they report, and whether
renders end in time.

    python reference/error_estimates.py -o reference/error_estimates.json

Errors: each scene is rendered to two errors with three seeds each. The reference picture is the mean of two pictures by
render(spp=...), which uses no dual buffer, no pilot and no allocation of samples. These two pictures have other seeds
than the tested pictures, Sobol points, and so large a path depth that a larger one would not matter. Together they have
at least 100 times as many samples as a tested picture. The error of the reference is known from the difference of its
two pictures; its mean square is subtracted. Films are small, to save time.

Times: four scenes are rendered with two time limits each, from the call to the file on disk, with all layers and with
compiled kernels. Reported are the time beyond the limit, and the time of the longest pass. The longest pass bounds the
time beyond the limit.
"""

import json
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import numpy as np
from machine import machine
from report import report_parser
from rich.console import Console
from rich.table import Table

from visray.adaptive.dual_buffer import DualBuffer
from visray.adaptive.error_floor import Files
from visray.output.curves import LUMINANCE
from visray.output.layers import NAMES
from visray.scene.adjusted import adjusted

SCENES = Path(__file__).resolve().parents[1] / "scenes"
SEEDS, REFERENCE_SEEDS = (0, 1, 2), (1001, 1002)
# Samples per pixel of the reference picture, as a multiple of the most that a tested picture has on average.
TIMES = 100
# By scene: width of the film, and the requested errors.
CASES = {
    "penumbra": (240, (0.01, 0.005)),
    "area-lights": (240, (0.03, 0.01)),
    "sphere-light": (240, (0.04, 0.02)),
    "defocus-blur": (240, (0.04, 0.02)),
    "ambient-occlusion": (240, (0.03, 0.01)),
    "textures-on-everything": (240, (0.05, 0.02)),
    "transparencies": (240, (0.02, 0.005)),
    "total-internal-reflection": (160, (0.05, 0.02)),
    "nested-glass": (240, (0.04, 0.02)),
    "mirror-hall": (240, (0.04, 0.02)),
    "glass-heart": (80, (0.05, 0.02)),
    "heart": (80, (0.05, 0.02)),
    "scatter": (120, (0.15, 0.08)),
    "everything": (96, (0.15, 0.08)),
}
TIMED = {"penumbra": (2.0, 6.0), "everything": (3.0, 9.0), "heart": (3.0, 9.0), "mirror-hall": (2.0, 6.0)}
TIMED_WIDTH = 480


def loaded(name: str, width: int) -> vr.Scene:
    """A scene of scenes/, with a film of this width and of the same proportions."""
    scene = vr.load(SCENES / f"{name}.json")
    return adjusted(scene, size=(width, round(width * scene.film.height / scene.film.width)))


def rendered(scene: vr.Scene, **more: object) -> vr.Image:
    return vr.render(scene, progress=False, **{"layers": ("RGB", "samples")} | more)


@dataclass(frozen=True)
class Reference:
    """A reference picture.

    rgb: colours of the pixels, (H, W, 3)
    square: mean square error of the reference picture itself
    spp: samples per pixel
    luminance: mean luminance
    """

    rgb: np.ndarray
    square: float
    spp: int
    luminance: float

    @staticmethod
    def of(scene: vr.Scene, spp: float) -> "Reference":
        """A reference picture with at least `spp` samples per pixel.

        Its path depth is that of visray's estimate of depth bias.
        """
        depth = min(8 * scene.settings.depth + 8, 1000)
        half_spp = 2 ** int(np.ceil(np.log2(spp / 2)))
        scene = adjusted(scene, sampler="sobol", spp=half_spp, depth=depth)
        a, b = (rendered(scene, seed=s, layers=("RGB",))["RGB"].astype(float) for s in REFERENCE_SEEDS)
        rgb = (a + b) / 2
        return Reference(rgb, float(np.square(a - b).mean() / 4), 2 * half_spp, float((rgb @ LUMINANCE).mean()))

    def error(self, rgb: np.ndarray) -> float:
        """The relative error of a picture. The mean square error of the reference is subtracted."""
        square = float(np.square(rgb - self.rgb).mean()) - self.square
        return float(np.sqrt(max(square, 0.0))) / self.luminance


def estimates(name: str) -> list[dict]:
    """The reported and true errors of a scene's pictures: a list with a dict for each picture."""
    width, errors = CASES[name]
    scene = loaded(name, width)
    images = [(e, s, rendered(scene, error=e, seed=s)) for e in errors for s in SEEDS]
    start = time.perf_counter()
    reference = Reference.of(scene, TIMES * max(image.metadata["spp"] for *_, image in images))
    sys.stderr.write(f"{name}: reference of {reference.spp} samples in {time.perf_counter() - start:.0f} s\n")
    rows = []
    for asked, seed, image in images:
        metadata, true = image.metadata, reference.error(image["RGB"])
        estimate = {k: metadata[k] for k in ("error", "error_low", "error_high", "depth_error")}
        rows.append(
            {"scene": name, "width": width, "seed": seed, "asked": asked, **estimate, "true": true}
            | {"within": bool(metadata["error_low"] <= true <= metadata["error_high"])}
            | {"ratio": true / metadata["error"]}
            | {k: metadata[k] for k in ("spp", "spp_least", "spp_most", "forecast_error", "forecast_spp")}
            | {"true_spp": reference.spp, "true_off": float(np.sqrt(reference.square)) / reference.luminance}
        )
    return rows


def summary(rows: list[dict]) -> dict:
    """Figures over all pictures, as a dict.

    within: fraction of the pictures whose true error lies in the reported interval
    below, above: number of pictures whose true error lies below or above that interval
    met: fraction of the pictures whose true error is at most the requested error
    ratio_...: of the quotients true error / reported error: the worst, least and largest; and their root mean square,
        which is 1 if mean squares are estimated without bias
    truth_off_most: largest quotient of the reference's own error and a picture's true error
    """
    ratios = np.array([r["ratio"] for r in rows])
    return {
        "pictures": len(rows),
        "within": float(np.mean([r["within"] for r in rows])),
        "below": sum(bool(r["true"] < r["error_low"]) for r in rows),
        "above": sum(bool(r["true"] > r["error_high"]) for r in rows),
        "ratio_worst": float(np.exp(np.abs(np.log(ratios)).max())),
        "ratio_least": float(ratios.min()),
        "ratio_most": float(ratios.max()),
        "ratio_rms": float(np.sqrt(np.square(ratios).mean())),
        "met": float(np.mean([r["true"] <= r["asked"] for r in rows])),
        "truth_off_most": max(r["true_off"] / r["true"] for r in rows),
    }


class Stopwatch:
    """A context manager that returns a list and adds to it the seconds of each pass of an adaptive render."""

    def __enter__(self) -> list[float]:
        self.run_pass, seconds = DualBuffer.run_pass, []

        def timed(buffers: DualBuffer, lanes: np.ndarray, targets: np.ndarray) -> None:
            start = time.perf_counter()
            self.run_pass(buffers, lanes, targets)
            seconds.append(time.perf_counter() - start)

        DualBuffer.run_pass = timed
        return seconds

    def __exit__(self, *_: object) -> None:
        DualBuffer.run_pass = self.run_pass


def times(name: str) -> list[dict]:
    """Times of a scene that is rendered with time limits: a list with a dict for each limit."""
    scene, rows = loaded(name, TIMED_WIDTH), []
    rendered(scene, error=1.0, layers=NAMES)
    for asked in TIMED[name]:
        with tempfile.TemporaryDirectory() as folder, Stopwatch() as passes:
            path, start = Path(folder, "a.exr"), time.perf_counter()
            image = rendered(scene, time=asked, files=Files([path]), layers=NAMES)
            image.write(path)
            seconds = time.perf_counter() - start
        metadata = image.metadata
        rows.append(
            {"scene": name, "width": TIMED_WIDTH, "asked": asked, "seconds": seconds, "over": seconds - asked}
            | {"share": (seconds - asked) / asked, "longest_pass": max(passes), "passes": len(passes)}
            | {k: metadata[k] for k in ("error", "spp", "forecast_error", "forecast_spp", "forecast_seconds")}
        )
    return rows


def print_tables(report: dict) -> None:
    """Prints the report as two tables: errors and times."""
    console = Console(width=120)
    table = Table("scene", "seed", "asked", "estimate", "interval", "true", "true/est.", "", "spp", "of reference")
    for r in report["estimates"]:
        interval = f"{r['error_low']:.5f} to {r['error_high']:.5f}"
        mark = "" if r["within"] else "outside"
        numbers = (f"{r['error']:.5f}", interval, f"{r['true']:.5f}", f"{r['ratio']:.3f}", mark, f"{r['spp']:.1f}")
        table.add_row(r["scene"], str(r["seed"]), f"{r['asked']:g}", *numbers, str(r["true_spp"]))
    console.print(table)
    table = Table(
        "scene", "asked s", "took s", "over s", "over %", "longest pass", "passes", "error", "forecast", "spp"
    )
    for r in report["times"]:
        seconds = (f"{r['asked']:g}", *(f"{r[k]:.3f}" for k in ("seconds", "over")), f"{100 * r['share']:.1f}")
        errors = (f"{r[k]:.2g}" for k in ("error", "forecast_error"))
        table.add_row(r["scene"], *seconds, f"{r['longest_pass']:.3f}", str(r["passes"]), *errors, f"{r['spp']:.0f}")
    console.print(table)


def main() -> None:
    parser = report_parser(__doc__)
    parser.add_argument("--only", default="", help="scenes, separated by commas")
    chosen = parser.parse_args()
    names = [n for n in chosen.only.split(",") if n]
    rows = [row for name in CASES if not names or name in names for row in estimates(name)]
    timed = [row for name in TIMED if not names or name in names for row in times(name)]
    report = machine() | {"load": os.getloadavg()[0]} | ({"summary": summary(rows)} if rows else {})
    report |= {"estimates": rows, "times": timed}
    print_tables(report)
    print(json.dumps(report.get("summary"), indent=2))
    if chosen.output:
        chosen.output.write_text(json.dumps(report, indent=2) + "\n")


if __name__ == "__main__":
    main()
