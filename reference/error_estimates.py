"""Whether pictures have the errors that they say, and end when they should: render(error=...) and render(time=...).

    python reference/error_estimates.py -o reference/error_estimates.json

Each scene is rendered to two errors with three seeds each. The truth is the mean of two pictures by render(spp=...),
which knows no halves, no pilot and no allocation, of other seeds, Sobol points and the deepest reflections that matter;
together at least 100 times the mean samples of the pictures that are judged. What the truth itself is off, known from
the difference of its two pictures, is taken out of the mean square. Films are small, so that this can be paid.

Then four scenes in two times each, from the call to the file on disk, layers and all, with kernels that are compiled:
how far beyond the time, and the longest pass, which is what an end may be late by.
"""

import argparse
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
from rich.console import Console
from rich.table import Table

from visray.adaptive.dual_buffer import DualBuffer
from visray.adaptive.error_floor import Files
from visray.output.curves import LUMINANCE
from visray.output.layers import NAMES
from visray.render import adjusted

SCENES = Path(__file__).resolve().parents[1] / "scenes"
SEEDS, TRUE_SEEDS = (0, 1, 2), (1001, 1002)
# Samples of the truth over those of what is judged.
TIMES = 100
# Width of the film, and the errors that are asked for.
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


def opened(name: str, width: int) -> vr.Scene:
    """A scene of that width."""
    scene = vr.load(SCENES / f"{name}.json")
    return adjusted(scene, size=(width, round(width * scene.film.height / scene.film.width)))


def rendered(scene: vr.Scene, **more: object) -> vr.Image:
    return vr.render(scene, progress=False, **{"layers": ("RGB", "samples")} | more)


@dataclass(frozen=True)
class Truth:
    """Pixels, the mean square that they are off by, samples, and the mean luminance."""

    rgb: np.ndarray
    square: float
    spp: int
    luminance: float

    @staticmethod
    def of(scene: vr.Scene, spp: float) -> "Truth":
        """From at least so many samples, with reflections as deep as visray looks for what depth leaves out."""
        deep = min(8 * scene.settings.depth + 8, 1000)
        each = 2 ** int(np.ceil(np.log2(spp / 2)))
        scene = adjusted(scene, sampler="sobol", spp=each, depth=deep)
        a, b = (rendered(scene, seed=s, layers=("RGB",))["RGB"].astype(float) for s in TRUE_SEEDS)
        rgb = (a + b) / 2
        return Truth(rgb, float(np.square(a - b).mean() / 4), 2 * each, float((rgb @ LUMINANCE).mean()))

    def error(self, rgb: np.ndarray) -> float:
        """The error of a picture, without that of the truth."""
        square = float(np.square(rgb - self.rgb).mean()) - self.square
        return float(np.sqrt(max(square, 0.0))) / self.luminance


def estimates(name: str) -> list[dict]:
    """A scene's pictures beside the truth."""
    width, errors = CASES[name]
    scene = opened(name, width)
    made = [(e, s, rendered(scene, error=e, seed=s)) for e in errors for s in SEEDS]
    begun = time.perf_counter()
    truth = Truth.of(scene, TIMES * max(image.metadata["spp"] for *_, image in made))
    sys.stderr.write(f"{name}: truth of {truth.spp} samples in {time.perf_counter() - begun:.0f} s\n")
    rows = []
    for asked, seed, image in made:
        facts, true = image.metadata, truth.error(image["RGB"])
        kept = {k: facts[k] for k in ("error", "error_low", "error_high", "depth_error")}
        rows.append(
            {"scene": name, "width": width, "seed": seed, "asked": asked, **kept, "true": true}
            | {"within": bool(facts["error_low"] <= true <= facts["error_high"]), "ratio": true / facts["error"]}
            | {k: facts[k] for k in ("spp", "spp_least", "spp_most", "forecast_error", "forecast_spp")}
            | {"true_spp": truth.spp, "true_off": float(np.sqrt(truth.square)) / truth.luminance}
        )
    return rows


def summary(rows: list[dict]) -> dict:
    """All pictures together. ratio_rms: of the mean square of all ratios, 1 where estimates of squares have no bias."""
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
    """Seconds of the passes of a picture while it is entered."""

    def __enter__(self) -> list[float]:
        self.kept, found = DualBuffer.run_pass, []

        def timed(halves: DualBuffer, lanes: np.ndarray, targets: np.ndarray) -> None:
            begun = time.perf_counter()
            self.kept(halves, lanes, targets)
            found.append(time.perf_counter() - begun)

        DualBuffer.run_pass = timed
        return found

    def __exit__(self, *_: object) -> None:
        DualBuffer.run_pass = self.kept


def times(name: str) -> list[dict]:
    """A scene in so many seconds."""
    scene, rows = opened(name, TIMED_WIDTH), []
    rendered(scene, error=1.0, layers=NAMES)
    for asked in TIMED[name]:
        with tempfile.TemporaryDirectory() as folder, Stopwatch() as passes:
            path, begun = Path(folder, "a.exr"), time.perf_counter()
            image = rendered(scene, time=asked, files=Files([path]), layers=NAMES)
            image.write(path)
            took = time.perf_counter() - begun
        facts = image.metadata
        rows.append(
            {"scene": name, "width": TIMED_WIDTH, "asked": asked, "seconds": took, "over": took - asked}
            | {"share": (took - asked) / asked, "longest_pass": max(passes), "passes": len(passes)}
            | {k: facts[k] for k in ("error", "spp", "forecast_error", "forecast_spp", "forecast_seconds")}
        )
    return rows


def tables(found: dict) -> None:
    """Prints what was found."""
    console = Console(width=120)
    table = Table("scene", "seed", "asked", "estimate", "interval", "true", "true/est.", "", "spp", "of truth")
    for r in found["estimates"]:
        interval = f"{r['error_low']:.5f} to {r['error_high']:.5f}"
        mark = "" if r["within"] else "out"
        numbers = (f"{r['error']:.5f}", interval, f"{r['true']:.5f}", f"{r['ratio']:.3f}", mark, f"{r['spp']:.1f}")
        table.add_row(r["scene"], str(r["seed"]), f"{r['asked']:g}", *numbers, str(r["true_spp"]))
    console.print(table)
    table = Table(
        "scene", "asked s", "took s", "over s", "over %", "longest pass", "passes", "error", "forecast", "spp"
    )
    for r in found["times"]:
        seconds = (f"{r['asked']:g}", *(f"{r[k]:.3f}" for k in ("seconds", "over")), f"{100 * r['share']:.1f}")
        errors = (f"{r[k]:.2g}" for k in ("error", "forecast_error"))
        table.add_row(r["scene"], *seconds, f"{r['longest_pass']:.3f}", str(r["passes"]), *errors, f"{r['spp']:.0f}")
    console.print(table)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--only", default="", help="scenes, separated by commas")
    chosen = parser.parse_args()
    names = [n for n in chosen.only.split(",") if n]
    rows = [row for name in CASES if not names or name in names for row in estimates(name)]
    timed = [row for name in TIMED if not names or name in names for row in times(name)]
    found = machine() | {"load": os.getloadavg()[0]} | ({"summary": summary(rows)} if rows else {})
    found |= {"estimates": rows, "times": timed}
    tables(found)
    print(json.dumps(found.get("summary"), indent=2))
    if chosen.output:
        chosen.output.write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
