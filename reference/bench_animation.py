"""The speed of animations: frames per minute of four scenes, and updates against Mitsuba's.

    python reference/bench_animation.py -o reference/bench_animation.json

1. Frames per minute from the second frame on, 480 x 270 pixels, 16 samples per pixel, 2 threads: by vr.animate, to
   pictures in memory, without motion blur. The share of this time in which kernels run, and the number of kernels that
   are compiled after the first frame. Frames in which nothing moves are not counted.
2. A plane and eight spheres that move, under a point light with hard shadows: vr.animate, and Mitsuba's `direct`
   integrator with updates by mi.traverse. Both programs run in one process and alternate, frame by frame. Median
   seconds of a frame after the first two.
"""

import math
import statistics
import time
from dataclasses import replace
from pathlib import Path

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import drjit as dr
import mitsuba as mi
import numpy as np
from bench_mitsuba import THREADS, mitsuba_content, ours, ring
from machine import machine
from report import report_parser, write_report

from visray.pass_timer import Compilations

SCENES = Path(__file__).resolve().parents[1] / "scenes"
SIZE, SPP, FRAMES = (480, 270), 16, 13
# Height of the jump of a sphere, and how far behind the one before it is.
JUMP, SHIFT = 0.5, 0.7


def scenes() -> dict[str, vr.Scene]:
    """The scenes by name, each with an animation."""
    teapot = vr.load(SCENES / "teapot.json")
    turn = {name: vr.SpinTrack(of=f"objects.{name}", center=(0, 0, 0), turns=0.5) for name in ("body", "lid")}
    loaded = {
        "bouncing balls": vr.load(SCENES / "bouncing-balls.json"),
        "heart that beats by a parameter": vr.load(SCENES / "heart-beat.json"),
        "globe with a year of data": vr.load(SCENES / "data-year.json"),
        "teapot, meshes that turn": replace(teapot, animation=vr.Animation(duration=1.0, fps=FRAMES, tracks=turn)),
    }
    return {name: replace(x, camera=replace(x.camera, shutter=None)) for name, x in loaded.items()}


def pace(scene: vr.Scene) -> dict:
    """Frames per minute, the share in which kernels run, and compilations after the first frame."""
    ends, compiled, running = [], [], []
    with Compilations() as kernels:
        fps = FRAMES / scene.animation.duration
        for _ in vr.animate(scene, fps=fps, spp=SPP, size=SIZE, layers=("RGB", "A"), progress=False, threads=THREADS):
            kernels.read()
            ends.append(time.perf_counter())
            compiled.append(kernels.count)
            running.append(kernels.seconds)
    kernel_seconds = np.diff(running)
    moves = kernel_seconds > 0
    seconds = float(np.median(np.diff(ends)[moves]))
    return {
        "frames_per_minute": 60 / seconds,
        "seconds_per_frame": seconds,
        "share_of_kernels": float(kernel_seconds.sum() / np.diff(ends)[moves].sum()),
        "compiled_after_first_frame": compiled[-1] - compiled[0],
    }


def height(number: int, ball: int) -> float:
    """How far a sphere is above its place in a frame."""
    return JUMP * abs(math.sin(2 * math.pi * number / FRAMES + SHIFT * ball))


def moving() -> vr.Scene:
    """The scene for visray: the ring of spheres, each of which jumps."""
    tracks = {}
    for i, (centre, _, _) in enumerate(ring()):
        values = tuple(centre[1] + height(k, i) for k in range(FRAMES))
        times = tuple(k / FRAMES for k in range(FRAMES))
        tracks[f"jump {i}"] = vr.KeysTrack(address=f"objects.ball {i}.center.1", times=times, values=values)
    return replace(ours(ring(), SPP), animation=vr.Animation(duration=1.0, fps=FRAMES, tracks=tracks))


def against_mitsuba() -> dict:
    """Seconds of a frame by both programs, by turns."""
    scene = mi.load_dict(mitsuba_content(ring()))
    parameters = mi.traverse(scene)
    # Mitsuba moves a sphere by its transform, which it composes with the sphere's own centre and radius.
    first = {i: mi.Transform4f(parameters[f"ball{i}.to_world"]) for i in range(len(ring()))}
    images = vr.animate(moving(), layers=("RGB", "A"), progress=False)
    times: list[tuple[float, float, float]] = []
    for k in range(FRAMES):
        begun = time.perf_counter()
        image = next(images)
        between = time.perf_counter()
        for i, matrix in first.items():
            parameters[f"ball{i}.to_world"] = mi.Transform4f().translate([0, height(k, i), 0]) @ matrix
        parameters.update()
        theirs = np.array(mi.render(scene, spp=SPP, seed=0))
        times.append((between - begun, time.perf_counter() - between, _likeness(image, theirs)))
    rest = times[2:]
    a, b = (statistics.median(t[i] for t in rest) for i in (0, 1))
    ratios = [y / x for x, y, _ in rest]
    return {
        "visray_s": a,
        "mitsuba_s": b,
        "ratio": b / a,
        "ratio_range": [min(ratios), max(ratios)],
        "least_correlation_of_pictures": min(t[2] for t in times),
    }


def _likeness(image: vr.Image, theirs: np.ndarray) -> float:
    """The correlation of the brightness of the two pictures: 1 if they differ by a factor alone."""
    return float(np.corrcoef(image["RGB"].mean(2).ravel(), theirs[..., :3].mean(2).ravel())[0, 1])


def main() -> None:
    chosen = report_parser(__doc__).parse_args()
    mi.set_variant("llvm_ad_rgb")
    dr.set_thread_count(THREADS)
    report = machine() | {"size": SIZE, "spp": SPP, "scenes": {name: pace(x) for name, x in scenes().items()}}
    write_report(report | {"moving_spheres": against_mitsuba()}, chosen.output)


if __name__ == "__main__":
    main()
