"""The speed of visray and of Mitsuba's `direct` integrator: a plane, eight spheres, a point light with shadows.

    python reference/bench_mitsuba.py -o reference/bench_mitsuba.json

1. The time from prepared scene to picture in memory: medians of 7 renders each, 512 x 512 pixels, 2 threads, 16 and 64
   samples per pixel. Both programs run in one process and alternate; kernels are compiled before.
2. The same with a rectangle light that is sampled 16 times at each point (Mitsuba: 16 emitter samples).
3. The time from the start of a process to the picture on disk, with an empty kernel cache and with compiled kernels in
   the cache. visray's command is compared with a Mitsuba script for the same scene.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import drjit as dr
import mitsuba as mi
import numpy as np
from machine import machine
from report import report_parser, write_report

from visray.passes import expose
from visray.setup import prepare

SIZE, RUNS, THREADS = 512, 7, 2
EYE, TARGET, LAMP, FOV = (0.0, 5.0, 9.0), (0.0, 0.5, 0.0), (4.0, 8.0, 5.0), 40.0


PANEL = vr.RectangleLight(position=LAMP, width=(2.0, 0.0, 0.0), height=(0.0, 0.0, 2.0), samples=16)
# A list of spheres: (centre, radius, colour) of each.
Balls = list[tuple[tuple[float, float, float], float, tuple[float, float, float]]]


def ring() -> Balls:
    """Eight spheres in a ring."""
    balls = []
    for i in range(8):
        angle = 2 * np.pi * i / 8
        centre = (float(2.2 * np.cos(angle)), 0.6 + 0.1 * i, float(2.2 * np.sin(angle)))
        balls.append((centre, 0.6 + 0.05 * i, (0.2 + 0.1 * i, 0.8 - 0.08 * i, 0.5)))
    return balls


def cloud(n: int) -> Balls:
    """n random spheres. Their total volume and the space that contains them are about the same for every n."""
    rng = np.random.default_rng(n)
    centres = rng.uniform((-4, 0.1, -4), (4, 3, 4), (n, 3)).tolist()
    radii = (rng.uniform(0.3, 0.9, n) * 2.2 / n ** (1 / 3)).tolist()
    return [(tuple(c), r, (0.6, 0.5, 0.4)) for c, r in zip(centres, radii)]


def ours(balls: Balls, spp: int, panel: bool = False) -> vr.Scene:
    """The scene for visray; all materials are matte. panel: whether the light is PANEL instead of a point light."""
    objects = {"floor": vr.Plane(material="grey")}
    materials = {"grey": vr.Material(kd=(0.5, 0.5, 0.5))}
    for i, (centre, radius, colour) in enumerate(balls):
        objects[f"ball {i}"] = vr.Sphere(center=centre, radius=radius, material=f"paint {i}")
        materials[f"paint {i}"] = vr.Material(kd=colour)
    return vr.Scene(
        camera=vr.Camera(origin=EYE, target=TARGET, fov=FOV),
        film=vr.Film(width=SIZE, height=SIZE),
        materials=materials,
        objects=objects,
        lights={"key": PANEL if panel else vr.PointLight(position=LAMP)},
        settings=vr.Settings(spp=spp),
    )


def theirs(balls: Balls, panel: bool = False) -> "mi.Scene":
    """The same scene for Mitsuba."""
    return mi.load_dict(mitsuba_content(balls, panel))


def mitsuba_content(balls: Balls, panel: bool = False) -> dict:
    """The same scene as a dict for Mitsuba. Its floor is a large rectangle, because Mitsuba has no infinite plane."""
    to_world = mi.ScalarTransform4f
    film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}}
    scene = {
        "type": "scene",
        "integrator": {"type": "direct", "hide_emitters": True},
        "sensor": {
            "type": "perspective",
            "fov": FOV,
            "fov_axis": "y",
            "to_world": to_world().look_at(EYE, TARGET, (0, 1, 0)),
            "film": film,
            "sampler": {"type": "independent"},
        },
        "floor": {"type": "rectangle", "to_world": to_world().rotate((1, 0, 0), -90).scale(100)},
        "lamp": {"type": "point", "position": LAMP, "intensity": 100.0},
    }
    if panel:
        scene["integrator"] |= {"emitter_samples": PANEL.samples, "bsdf_samples": 0}
        facing_down = to_world().translate(LAMP).rotate((1, 0, 0), 90)
        emitter = {"type": "area", "radiance": {"type": "rgb", "value": 25.0}}
        scene["lamp"] = {"type": "rectangle", "to_world": facing_down, "emitter": emitter}
    for i, (centre, radius, colour) in enumerate(balls):
        bsdf = {"type": "diffuse", "reflectance": {"type": "rgb", "value": colour}}
        scene[f"ball{i}"] = {"type": "sphere", "center": centre, "radius": radius, "bsdf": bsdf}
    return scene


def seconds(work) -> float:
    """The wall-clock time of a call."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def warm(balls: Balls, spp: int, runs: int = RUNS, panel: bool = False) -> dict:
    """A dict with median seconds and rates of both programs, with kernels that are compiled before.

    The programs alternate, and each render has a new seed. runs: renders of each program.
    """
    prepared, scene, seed = prepare(ours(balls, spp, panel)), theirs(balls, panel), iter(range(1000))

    def visray() -> None:
        expose(with_seed(prepared, next(seed)))

    def mitsuba() -> None:
        dr.eval(mi.render(scene, spp=spp, seed=next(seed)))
        dr.sync_thread()

    for work in (visray, mitsuba, visray, mitsuba):
        work()
    times = [(seconds(visray), seconds(mitsuba)) for _ in range(runs)]
    a, b = (statistics.median(t) for t in zip(*times))
    rate = SIZE * SIZE * spp / 1e6
    return {
        "spheres": len(balls),
        "spp": spp,
        "visray_s": a,
        "mitsuba_s": b,
        "visray_Msamples_per_s": rate / a,
        "mitsuba_Msamples_per_s": rate / b,
        "ratio": b / a,
        "ratio_range": [min(y / x for x, y in times), max(y / x for x, y in times)],
    }


def with_seed(prepared, seed: int):
    """The same prepared scene with another seed."""
    scene = prepared.scene
    return replace(prepared, scene=replace(scene, settings=replace(scene.settings, seed=seed)))


def from_start(out: Path) -> dict:
    """Seconds from the start of a process to an EXR file, at 16 samples per pixel, by program and by kind of run.

    cold: median of three runs with an empty kernel cache; warm: median of five runs with compiled kernels in the cache.
    The programs alternate. out: a folder for files.
    """
    (out / "scene.json").write_text(vr.dump(ours(ring(), 16)))
    commands = {
        "visray": [sys.executable, "-m", "visray", "render", str(out / "scene.json"), "-o", str(out / "a.exr"),
                   "--threads", str(THREADS), "--layers", "RGB,A", "--quiet"],
        "mitsuba": [sys.executable, str(Path(__file__).resolve()), "--mitsuba-picture", str(out / "b.exr")],
    }  # fmt: skip
    times: dict[str, dict[str, list[float]]] = {k: {"cold": [], "warm": []} for k in commands}
    for kind, turns in (("cold", 3), ("warm", 5)):
        for _ in range(turns):
            for name, command in commands.items():
                with tempfile.TemporaryDirectory() as empty:
                    cache = empty if kind == "cold" else str(out / "cache")
                    Path(cache).mkdir(exist_ok=True)
                    environment = os.environ | {"DRJIT_CACHE_DIR": cache}
                    if kind == "warm" and not times[name]["warm"]:
                        subprocess.run(command, check=True, env=environment)
                    times[name][kind].append(
                        seconds(lambda c=command, e=environment: subprocess.run(c, check=True, env=e))
                    )
    return {n: {k: statistics.median(v) for k, v in t.items()} for n, t in times.items()}


def main() -> None:
    parser = report_parser(__doc__)
    parser.add_argument("--mitsuba-picture", type=Path, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    mi.set_variant("llvm_ad_rgb")
    dr.set_thread_count(THREADS)
    if chosen.mitsuba_picture:
        mi.util.write_bitmap(str(chosen.mitsuba_picture), mi.render(theirs(ring()), spp=16), write_async=False)
        return
    with tempfile.TemporaryDirectory() as folder:
        report = machine() | {"size": SIZE, "warm": [warm(ring(), spp) for spp in (16, 64)]}
        report |= {"area_light": [warm(ring(), spp, RUNS, True) for spp in (16, 64)]}
        report |= {"from_start_s": from_start(Path(folder))}
    write_report(report, chosen.output)


if __name__ == "__main__":
    main()
