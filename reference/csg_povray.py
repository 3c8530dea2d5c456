"""CSG in visray and in POV-Ray 3.7: speed, and who is right where they differ.

    python reference/csg_povray.py -o reference/csg_povray.json --pictures /tmp/pictures

Both programs render the five solids of csg_scenes.py with the same camera, 512 x 512 pixels, one point light with
shadows, 2 threads each.

Time: the programs alternate; the median of the rounds' ratios is reported. POV-Ray's time is the trace time that it
reports, without parsing and writing. It takes 4 or 16 samples in each pixel in two ways: as antialiasing that leaves no
pixel out (+A0.0 +AM1 +R2 or +R4; this adds one ray a pixel), and as one sample in each pixel of a picture 2 or 4 times
as large. The faster of both counts in each round. visray's time is that from the prepared scene to the picture in
memory, with compiled kernels and a new seed; the compile time is reported separately. The ratio of the seconds of the
processor, summed over the threads, is reported as well: it hardly depends on other programs on the machine.

Centres: one ray through the centre of each pixel, in both programs, as a picture with light and shadow. All colours are
compared with those of a third implementation in extended precision (csg_truth.py). A pixel that differs from them by
more than the rounding of its numbers is wrong, unless the true colour changes when the ray moves by 1e-9 of a pixel:
then it is on an edge. For this test visray computes all in double.

Antialiased pictures: pixels in which the pictures of 16 samples differ by more than the true colours of the pixel and
of its neighbours do. There the true colours of 32 x 32 points in the pixel are computed, and the picture is wrong whose
colour lies outside of their range.
"""

import json
import os
import sys
import tempfile
from pathlib import Path
from statistics import median

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import drjit as dr
import numpy as np
from bench_mitsuba import with_seed
from bench_povray import SIZE, THREADS, TimedCall, View, povray, timed, versions
from csg_scenes import BACKGROUND, LAMP, SOLIDS, Solid, vector
from csg_truth import Truth
from machine import machine
from PIL import Image
from report import report_parser

from visray.integrator import camera_ray, radiance
from visray.passes import expose
from visray.setup import prepare
from visray.study.timed_picture import UncachedPicture

RUNS, SIDES, CLOCKS = 9, (2, 4), ("wall", "cpu")
EDGE, POINTS = 1e-9, 32
# POV-Ray's files: binary PPM of 16 bits for each colour, without gamma.
PPM = ("+FP16", "File_Gamma=1.0")
LARGEST = 2**16 - 1
# POV-Ray rounds its colours to the steps of its files, after a few operations in single precision.
TOLERANCE = 0.5 / LARGEST + 4 * float(np.finfo(np.float32).eps)


def for_povray(solid: Solid) -> str:
    """Text of the scene for POV-Ray; see bench_povray.for_povray."""
    view = View.of(solid)
    return f"""#version 3.7;
global_settings {{ assumed_gamma 1 max_trace_level 1 }}
background {{ rgb {vector(BACKGROUND)} }}
camera {{
  perspective location {vector(view.eye)} direction {vector(view.forward)}
  right {vector(2 * view.half * view.right)} up {vector(2 * view.half * view.up)}
}}
light_source {{ {vector(solid.radius * np.array(LAMP))} rgb 1 }}
{solid.node.povray()}
"""


def ppm(path: Path) -> np.ndarray:
    """The colours in a PPM file of 16 bits, from 0 to 1. Shapes: (height, width, 3)."""
    data, words, at = path.read_bytes(), [], 0
    while len(words) < 4:  # P6, width, height, largest value; lines that start with # are comments
        end = data.index(b"\n", at)
        if not data[at:end].startswith(b"#"):
            words += data[at:end].split()
        at = end + 1
    width, height = int(words[1]), int(words[2])
    return np.frombuffer(data, ">u2", width * height * 3, at).reshape(height, width, 3) / LARGEST


# --- time


def calls(solid: Solid, folder: Path, sides: list[int]) -> dict[str, TimedCall]:
    """Functions that render a picture and return its seconds, by program and number of samples."""
    text, made = for_povray(solid), {}
    for side in sides:
        n = side * side
        prepared, seeds = prepare(solid.ours(SIZE, n)), iter(range(1000))
        supersampled = ("+A0.0", "+AM1", f"+R{side}")
        made[f"povray {n}"] = lambda m=supersampled: povray(folder, text, THREADS, more=m)
        made[f"povray larger {n}"] = lambda s=side: povray(folder, text, THREADS, size=s * SIZE, more=("-A",))
        made[f"visray {n}"] = lambda p=prepared, s=seeds: timed(lambda: expose(with_seed(p, next(s))))
    return made


def speed(solid: Solid, folder: Path, runs: int, sides: list[int]) -> dict:
    """A dict with seconds and ratios of both programs, by clock."""
    work = calls(solid, folder, sides)
    for call in work.values():
        call()
    rounds = [{name: call() for name, call in work.items()} for _ in range(runs)]
    operations, compile_seconds = UncachedPicture.of(prepare(solid.ours(SIZE, 4))).compiled()
    report: dict = {"operations": operations, "compile_s": compile_seconds}
    for clock, name in enumerate(CLOCKS):
        seconds = [{key: s[clock] for key, s in r.items()} for r in rounds]
        report[name] = {"s": {key: median(r[key] for r in seconds) for key in work}}
        for n in (side * side for side in sides):
            ratios = sorted(min(r[f"povray {n}"], r[f"povray larger {n}"]) / r[f"visray {n}"] for r in seconds)
            quartiles = [ratios[len(ratios) // 4], ratios[-1 - len(ratios) // 4]]
            report[name] |= {f"ratio_{n}": median(ratios), f"ratio_{n}_quartiles": quartiles}
    return report


# --- who is right


def our_centres(solid: Solid) -> np.ndarray:
    """visray's colours on the rays through the pixels' centres. Shapes: (SIZE, SIZE, 3)."""
    p = prepare(solid.ours(SIZE, 1, precision="double"))
    colour, _ = radiance(p.kernel, camera_ray(p.kernel, p.a.F(p.x) + 0.5, p.a.F(p.y) + 0.5))
    picture = np.empty((SIZE * SIZE, 3))
    picture[p.order] = np.array(colour).T
    return picture.reshape(SIZE, SIZE, 3)


def their_centres(solid: Solid, folder: Path) -> np.ndarray:
    """POV-Ray's colours on the same rays. Shapes: (SIZE, SIZE, 3)."""
    povray(folder, for_povray(solid), THREADS, "centres.ppm", more=("-A", *PPM))
    return ppm(folder / "centres.ppm")


def judged(truth: Truth, true: np.ndarray, picture: np.ndarray) -> dict:
    """Counts of wrong pixels in a picture of rays through the pixels' centres. true: the true picture."""
    y, x = np.nonzero((abs(picture - true) > TOLERANCE).any(2))
    moved = [truth.colours(x + 0.5 + dx * EDGE, y + 0.5 + dy * EDGE) for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    on_edge = np.any([(abs(m - true[y, x]) > TOLERANCE).any(1) for m in moved], axis=0)
    wrong = [(int(a), int(b)) for a, b in zip(x[~on_edge], y[~on_edge])]
    return {"wrong": len(wrong), "on_an_edge": int(on_edge.sum()), "first_wrong": wrong[:5]}


def centres(truth: Truth, true: np.ndarray, pictures: dict[str, np.ndarray]) -> dict:
    """The verdict on both programs' pictures of the pixels' centres."""
    a, b = pictures.values()
    differ = int((abs(a - b) > 2 * TOLERANCE).any(2).sum())
    report = {"pixels": SIZE * SIZE, "solid": int((true != np.array(BACKGROUND)).any(2).sum()), "differ": differ}
    return report | {name: judged(truth, true, p) for name, p in pictures.items()}


def neighbourhood(true: np.ndarray) -> np.ndarray:
    """Range of the colours of each pixel and its eight neighbours. Shapes: (height, width, 3)."""
    padded = np.pad(true, ((1, 1), (1, 1), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), axis=(0, 1))
    return windows.max((-2, -1)) - windows.min((-2, -1))


def antialiased(truth: Truth, true: np.ndarray, pictures: dict[str, np.ndarray]) -> dict:
    """The verdict on both programs' pictures of 16 samples."""
    a, b = pictures.values()
    y, x = np.nonzero((abs(a - b) > neighbourhood(true) + 2 * TOLERANCE).any(2))
    report = {"differ_more_than_neighbours": len(x)} | dict.fromkeys(pictures, 0)
    offset = (np.arange(POINTS) + 0.5) / POINTS
    for column, row in zip(x, y):
        dx, dy = (v.ravel() for v in np.meshgrid(offset, offset))
        colours = truth.colours(column + dx, row + dy)
        for name, p in pictures.items():
            colour = p[row, column]
            outside = (colour < colours.min(0) - TOLERANCE) | (colour > colours.max(0) + TOLERANCE)
            report[name] += int(outside.any())
    return report


def verdict(solid: Solid, folder: Path, out: Path | None) -> dict:
    """Counts of pixels that differ, and who is right. out: path of a picture of both side by side, or None."""
    truth = Truth(solid, SIZE)
    y, x = np.divmod(np.arange(SIZE * SIZE), SIZE)
    true = truth.colours(x + 0.5, y + 0.5).astype(float).reshape(SIZE, SIZE, 3)
    pairs = {"povray": their_centres(solid, folder), "visray": our_centres(solid)}
    povray(folder, for_povray(solid), THREADS, "smooth.ppm", more=("+A0.0", "+AM1", "+R4", *PPM))
    rendered = vr.render(solid.ours(SIZE, SIDES[1] ** 2), layers=["RGB"], progress=False)
    smooth = {"povray": ppm(folder / "smooth.ppm"), "visray": np.asarray(rendered["RGB"], float)}
    if out:
        out.parent.mkdir(parents=True, exist_ok=True)
        both = np.hstack(list(smooth.values()))
        Image.fromarray((255 * np.clip(both, 0, 1) ** (1 / 2.2)).round().astype(np.uint8)).save(out)
    return {"centres": centres(truth, true, pairs), "antialiased": antialiased(truth, true, smooth)}


def main() -> None:
    parser = report_parser(__doc__)
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--sides", nargs="*", type=int, choices=SIDES, default=SIDES, help="samples: side x side")
    parser.add_argument("--solids", nargs="*", choices=SOLIDS, default=list(SOLIDS))
    parser.add_argument("--only", choices=("speed", "verdict"))
    parser.add_argument("--pictures", type=Path, help="a folder for the pictures, side by side: POV-Ray, visray")
    chosen = parser.parse_args()
    dr.set_thread_count(THREADS)
    report = machine() | versions({"povray"}) | {"size": SIZE, "runs": chosen.runs, "load": os.getloadavg()[0]}
    rows = []
    with tempfile.TemporaryDirectory() as name_of_folder:
        folder = Path(name_of_folder)
        for name in chosen.solids:
            solid = SOLIDS[name]()
            row = {"solid": name, "operands": len(solid.node.leaves())}
            if chosen.only != "verdict":
                row |= speed(solid, folder, chosen.runs, chosen.sides)
            if chosen.only != "speed":
                row |= verdict(solid, folder, chosen.pictures and chosen.pictures / f"{name}.png")
            print(json.dumps(row), file=sys.stderr, flush=True)
            rows.append(row)
    if chosen.output:
        chosen.output.write_text(json.dumps(report | {"solids": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
