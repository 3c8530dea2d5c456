"""The speed of visray and of Mitsuba for many gizmos on a globe: 100, 10,000 and 100,000 spheres, bars and cones.

    python reference/bench_data.py -o reference/bench_data.json
    python reference/bench_data.py --counts 10000 --gizmos cylinder    # only these

The pictures have 960 x 540 pixels with 16 samples each, and soft shadows of one rectangle light, of which each sample
of a pixel asks one point. Both programs read the same CSV file, run on 2 threads and take turns.

1. First picture: seconds from the start of a process to the PNG file, with an empty kernel cache, and with kernels of
   an earlier run in the cache, and the seconds of the processors that it takes. visray's command is compared with a
   Mitsuba script. Medians of 3 runs each.
2. Frame: seconds from the prepared scene to the picture in memory, in one process. Medians of 5 renders each.

Other work on the machine makes seconds longer, and seconds of the processors less so: `load` is the load before and
after.

What differs: visray gives each gizmo its own colour, and Mitsuba one of 16 materials. Mitsuba's cylinders are open; a
disk closes the upper end of each. Mitsuba has no cones; it gets one mesh, with 32 triangles for each of them.
"""

import argparse
import csv
import os
import resource
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

from visray.data.palette import palette_of
from visray.passes import expose
from visray.setup import Prepared, prepare

WIDTH, HEIGHT, SPP, THREADS = 960, 540, 16, 2
COUNTS, GIZMOS = (100, 10_000, 100_000), ("sphere", "cylinder", "cone")
RUNS, FRAMES = 3, 5
EYE, FOV, GREY = (3.0, 2.0, 2.5), 36.0, (0.35, 0.38, 0.42)
LAMP = {"position": (4.0, 4.0, 0.5), "width": (1.5, 0.0, 0.0), "height": (0.0, 0.0, 1.5)}
# Mitsuba's numbers of materials, and of corners of a cone's base.
SHADES, CORNERS = 16, 16


def write_table(path: Path, count: int) -> None:
    """Writes a CSV file with places that are evenly spread over the earth, and a value for each."""
    i = np.arange(count) + 0.5
    lat = np.degrees(np.arcsin(1 - 2 * i / count))
    lon = (i * 180 * (3 - np.sqrt(5))) % 360 - 180
    value = 1 + np.cos(np.radians(3 * lon)) * np.cos(np.radians(2 * lat)) + 0.2 * np.sin(17 * i)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["longitude", "latitude", "value"])
        writer.writerows(zip(lon.round(4).tolist(), lat.round(4).tolist(), value.clip(0.05).round(4).tolist()))


def size(count: int) -> float:
    """Radius of a gizmo: a quarter of the distance of neighbours on a globe of radius 1."""
    return float(0.25 * np.sqrt(4 * np.pi / count))


def ours(table: str, count: int, gizmo: str) -> vr.Scene:
    """The scene for visray. table: path of the CSV file"""
    sizes = {"radius": size(count)} | (
        {} if gizmo == "sphere" else {"height": vr.SizeRule(column="value", range=(0.0, 0.4))}
    )
    layer = vr.DataLayer(source=table, gizmo=gizmo, color="value", material="matte", **sizes)
    return vr.Scene(
        camera=vr.Camera(origin=EYE, target=(0, 0, 0), fov=FOV),
        film=vr.Film(width=WIDTH, height=HEIGHT),
        background=(0, 0, 0),
        materials={"grey": vr.Material(ka=(0, 0, 0), kd=GREY), "matte": vr.Material(ka=(0, 0, 0))},
        lights={"lamp": vr.RectangleLight(**LAMP, samples=1)},
        data=vr.Data(base=vr.GlobeBase(material="grey"), layers={"value": layer}),
        settings=vr.Settings(spp=SPP),
    )


def gizmos(table: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Feet of the gizmos on the globe, their heights, and the number of the material of each; read from a CSV file.

    Shapes: (N, 3), (N), (N).
    """
    lon, lat, value = np.loadtxt(table, delimiter=",", skiprows=1).T
    x, y = np.radians(lon), np.radians(lat)
    foot = np.stack([np.cos(y) * np.cos(x), np.sin(y), -np.cos(y) * np.sin(x)], 1)
    share = (value - value.min()) / np.ptp(value)
    return foot, 0.4 * value / value.max(), np.minimum((share * SHADES).astype(int), SHADES - 1)


def theirs(table: Path, gizmo: str) -> "mi.Scene":
    """The same scene for Mitsuba."""
    foot, height, shade = gizmos(table)
    radius = size(len(foot))
    to_world = mi.ScalarTransform4f
    facing_down = to_world().translate(LAMP["position"]).rotate((1, 0, 0), 90).scale((0.75, 0.75, 1))
    scene = {
        "type": "scene",
        "integrator": {"type": "direct", "hide_emitters": True, "emitter_samples": 1, "bsdf_samples": 0},
        "sensor": {
            "type": "perspective",
            "fov": FOV,
            "fov_axis": "y",
            "to_world": to_world().look_at(EYE, (0, 0, 0), (0, 1, 0)),
            "film": {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent"},
        },
        "lamp": {"type": "rectangle", "to_world": facing_down, "emitter": {"type": "area", "radiance": 25.0}},
        "globe": {"type": "sphere", "bsdf": diffuse(GREY)},
    }
    bsdfs = [diffuse(color) for color in palette_of("viridis").linear((np.arange(SHADES) + 0.5) / SHADES).tolist()]
    loaded = [mi.load_dict(bsdf) for bsdf in bsdfs]
    if gizmo == "cone":
        scene["cones"] = cones(foot, height, radius, bsdfs[SHADES // 2])
        return mi.load_dict(scene)
    for i, (p, h, k) in enumerate(zip(foot, height.tolist(), shade.tolist())):
        if gizmo == "sphere":
            middle = (p * (1 + radius)).tolist()
            scene[f"gizmo {i}"] = {"type": "sphere", "center": middle, "radius": radius, "bsdf": loaded[k]}
            continue
        top = p * (1 + h)
        scene[f"gizmo {i}"] = {"type": "cylinder", "p0": p.tolist(), "p1": top.tolist(), "radius": radius,
                               "bsdf": loaded[k]}  # fmt: skip
        scene[f"cap {i}"] = {"type": "disk", "to_world": to_world(cap(p, top, radius).tolist()), "bsdf": loaded[k]}
    return mi.load_dict(scene, optimize=False)


def diffuse(color: tuple[float, float, float]) -> dict:
    """A matte material for Mitsuba."""
    return {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(color)}}


def across(up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors at right angles to unit vectors and to each other. Shapes: (N, 3)."""
    least = np.eye(3)[np.abs(up).argmin(1)]
    x = np.cross(up, least)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return x, np.cross(up, x)


def cap(up: np.ndarray, top: np.ndarray, radius: float) -> np.ndarray:
    """Matrix of a disk with the normal `up`. Shape: (4, 4)."""
    (x,), (y,) = across(up[None])
    matrix = np.eye(4)
    matrix[:3] = np.stack([radius * x, radius * y, up, top], 1)
    return matrix


def cones(foot: np.ndarray, height: np.ndarray, radius: float, bsdf: dict) -> "mi.Mesh":
    """All cones as one mesh."""
    n = len(foot)
    x, y = across(foot)
    angle = 2 * np.pi * np.arange(CORNERS) / CORNERS
    ring = foot[:, None] + radius * (np.cos(angle)[:, None] * x[:, None] + np.sin(angle)[:, None] * y[:, None])
    vertices = np.concatenate([ring, foot[:, None], (foot * (1 + height[:, None]))[:, None]], 1)
    a, b = np.arange(CORNERS), np.roll(np.arange(CORNERS), -1)
    of_one = np.concatenate([np.stack([a, b, np.full(CORNERS, k)], 1) for k in (CORNERS + 1, CORNERS)])
    of_one[CORNERS:] = of_one[CORNERS:, [1, 0, 2]]
    faces = (of_one[None] + (CORNERS + 2) * np.arange(n)[:, None, None]).reshape(-1, 3)
    props = mi.Properties()
    props["mesh_bsdf"] = mi.load_dict(bsdf)
    mesh = mi.Mesh("cones", (CORNERS + 2) * n, len(faces), props)
    buffers = mi.traverse(mesh)
    buffers["vertex_positions"] = mi.Float(vertices.reshape(-1).astype(np.float32))
    buffers["faces"] = mi.UInt32(faces.reshape(-1).astype(np.uint32))
    buffers.update()
    return mesh


def first_picture(folder: Path, count: int, gizmo: str, runs: int) -> dict:
    """(seconds from the start of a process to the PNG file, seconds of the processors), by program, with an empty and
    with a filled kernel cache."""
    table = folder / "table.csv"
    commands = {
        "visray": [sys.executable, "-m", "visray", "render", "scene.json", "-o", "a.png", "--threads", str(THREADS),
                   "--quiet"],
        "mitsuba": [sys.executable, str(Path(__file__).resolve()), "--mitsuba-picture", str(table), "--gizmos", gizmo],
    }  # fmt: skip
    write_table(table, count)
    (folder / "scene.json").write_text(vr.dump(ours(str(table), count, gizmo), folder=folder))
    times: dict[str, dict[str, list[tuple]]] = {name: {"cold": [], "warm": []} for name in commands}
    for kind in ("cold", "warm"):
        for _ in range(runs):
            for name, command in commands.items():
                with tempfile.TemporaryDirectory() as empty:
                    # A warm cache is filled by a run that does not count.
                    cache = Path(empty) if kind == "cold" else folder / f"cache of {name}"
                    filled = kind == "cold" or cache.exists()
                    cache.mkdir(exist_ok=True)
                    environment = os.environ | {"DRJIT_CACHE_DIR": str(cache)}
                    if not filled:
                        subprocess.run(command, check=True, cwd=folder, env=environment)
                    start, used = time.perf_counter(), processor_seconds()
                    subprocess.run(command, check=True, cwd=folder, env=environment)
                    times[name][kind].append((time.perf_counter() - start, processor_seconds() - used))
    return {
        f"{name}_{kind}_{unit}": statistics.median(x)
        for name, of in times.items()
        for kind, t in of.items()
        for unit, x in zip(("s", "cpu_s"), zip(*t))
    }


def processor_seconds() -> float:
    """Seconds of the processors that ended child processes have taken."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def frames(folder: Path, gizmo: str, renders: int) -> dict:
    """Seconds of a frame, by program, and seconds from the scene's description to the prepared scene."""
    table = folder / "table.csv"
    start = time.perf_counter()
    prepared = prepare(vr.load(folder / "scene.json"))
    ready = time.perf_counter()
    scene = theirs(table, gizmo)
    loaded = time.perf_counter()
    programs = {"visray": lambda seed: expose(with_seed(prepared, seed)),
                "mitsuba": lambda seed: dr.eval(mi.render(scene, spp=SPP, seed=seed))}  # fmt: skip
    times: dict[str, list[float]] = {name: [] for name in programs}
    for seed in range(renders + 1):
        for name, work in programs.items():
            begun = time.perf_counter()
            work(seed)
            dr.sync_thread()
            times[name].append(time.perf_counter() - begun)
    found = {f"{name}_frame_s": statistics.median(t[1:]) for name, t in times.items()}
    return found | {"visray_prepare_s": ready - start, "mitsuba_load_s": loaded - ready}


def with_seed(prepared: Prepared, seed: int) -> Prepared:
    """The same prepared scene with another seed."""
    scene = prepared.scene
    return replace(prepared, scene=replace(scene, settings=replace(scene.settings, seed=seed)))


def row(count: int, gizmo: str, runs: int) -> dict:
    """What is measured for one number of gizmos of one kind."""
    with tempfile.TemporaryDirectory() as name:
        load = os.getloadavg()[0]
        first = first_picture(Path(name), count, gizmo, runs)
        found = {"gizmo": gizmo, "count": count} | first | frames(Path(name), gizmo, FRAMES if runs > 1 else 1)
        return found | {"load": [load, os.getloadavg()[0]]}


def main() -> None:
    parser = report_parser(__doc__)
    parser.add_argument("--counts", type=int, nargs="+", default=COUNTS, metavar="N", help="numbers of gizmos")
    parser.add_argument("--gizmos", nargs="+", choices=GIZMOS, default=GIZMOS, help="kinds of gizmos")
    parser.add_argument("--runs", type=int, default=RUNS, metavar="N", help="first pictures of each program")
    parser.add_argument("--mitsuba-picture", type=Path, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    mi.set_variant("llvm_ad_rgb")
    dr.set_thread_count(THREADS)
    if chosen.mitsuba_picture:
        scene = theirs(chosen.mitsuba_picture, chosen.gizmos[0])
        mi.util.write_bitmap("b.png", mi.render(scene, spp=SPP), write_async=False)
        return
    report = machine() | {"width": WIDTH, "height": HEIGHT, "spp": SPP, "runs": chosen.runs}
    rows = [row(count, gizmo, chosen.runs) for count in chosen.counts for gizmo in chosen.gizmos]
    write_report(report | {"rows": rows}, chosen.output)


if __name__ == "__main__":
    main()
