"""How fast the live picture follows: frames per second while a camera turns, seconds from a slider to the picture, and
seconds until a picture at rest has an error. Beside jsurf, the core of SURFER.

    python reference/bench_live.py -o reference/bench_live.json

All pictures have 512 x 512 pixels. The engine is that of `visray view`, without the browser: a state counts when it is
handed over to be sent.

orbit: the camera turns by small steps, each as soon as the state of the step before is there. `frames_per_second` is
the rate of these states, `grain` the median side in pixels of the squares they consist of, `seconds` the median time
from a step to its state.
slider: a value of the scene changes in the same way.
rest: seconds from a change until the error is at most 5, 2 and 1 %; null if this takes longer than 40 s.
jsurf: the same surfaces, turned by the same angles, by turns in one run: 10 pictures of each program, then 10 more, so
that both have the same machine. jsurf has one ray for each pixel, one light and no shadows. `plain` is visray with the
same, and a picture of it counts when every pixel has its sample (grain 1). `surface` is the scene of `visray surface`,
as the live picture shows it while it turns. jsurf is Debian's package jsurf-alggeo; without it this part is null.
"""

import math
import shutil
import statistics
import subprocess
import tempfile
import threading
import time
import warnings
from dataclasses import replace
from pathlib import Path

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit loads
import numpy as np
from report import report_parser, write_report

from visray.live.engine import Engine
from visray.live.viewer import Viewer
from visray.polynomials.catalogue import SURFACES
from visray.study.machine import machine

SIZE = (512, 512)
STEP, SECONDS, PATIENCE = 0.02, 6.0, 40.0
JARS = [Path("/usr/share/java") / f"{name}.jar" for name in ("jsurf-alggeo", "vecmath", "antlr3-runtime")]
ROOT = Path(__file__).resolve().parents[1]
# A value of each scene that a slider moves, and its range.
SLIDERS = {
    "heart": ("objects.near.radius", 0.1, 0.2),
    "showcase": ("objects.ball.radius", 0.8, 1.0),
    "bowl": ("lights.lamp.position.0", -3.0, -2.0),
    "ring": ("lights.lamp.position.0", 3.0, 4.0),
    "data-globe": ("camera.fov", 30.0, 32.0),
}


def ring(triangles: int) -> vr.Scene:
    """A bumpy ring of triangles on a floor, under a lamp with soft shadows."""
    n = round(math.sqrt(triangles / 2))
    u, v = np.meshgrid(*[np.linspace(0, 2 * np.pi, n, endpoint=False)] * 2, indexing="ij")
    r = 0.4 + 0.05 * np.sin(7 * u) * np.sin(5 * v)
    points = np.stack([(1 + r * np.cos(v)) * np.cos(u), r * np.sin(v), (1 + r * np.cos(v)) * np.sin(u)], -1)
    a = np.arange(n * n).reshape(n, n)
    b, d = np.roll(a, -1, 0), np.roll(a, -1, 1)
    faces = [np.stack(corners, -1).reshape(-1, 3) for corners in ((a, np.roll(b, -1, 1), b), (a, d, np.roll(b, -1, 1)))]
    mesh = vr.Mesh(vertices=points.reshape(-1, 3), faces=np.concatenate(faces), material="clay")
    return vr.Scene(
        camera=vr.Camera(origin=(0, 2.5, 4), target=(0, 0, 0)),
        lights={"lamp": vr.SphereLight(position=(4, 7, 5))},
        materials={"clay": vr.Material(kd=(0.7, 0.4, 0.2), ks=(0.4, 0.4, 0.4), shininess=60)},
        objects={"floor": vr.Plane(point=(0, -0.5, 0), material="clay"), "ring": mesh},
        ambient=(0.3, 0.3, 0.3),
    )


def turned(camera, angle: float):
    """A camera that is turned about its up direction around its target. angle: in radians."""
    target, up = np.array(camera.target), np.array(camera.up) / np.linalg.norm(camera.up)
    v, c, s = np.array(camera.origin) - target, math.cos(angle), math.sin(angle)
    return replace(camera, origin=tuple((target + v * c + np.cross(up, v) * s + up * (up @ v) * (1 - c)).tolist()))


class Watch:
    """A viewer that keeps its states, with the moments when they came."""

    def __init__(self):
        self.states, self.news = [], threading.Condition()
        self.viewer = Viewer(self.take, SIZE)

    def take(self, frame):
        with self.news:
            self.states.append((time.perf_counter(), frame))
            self.news.notify_all()

    def until(self, good, seconds: float = PATIENCE):
        """The first state for which `good` holds, with its moment, from now on; None if it does not come in time."""
        end = time.perf_counter() + seconds
        with self.news:
            looked = len(self.states)
            while True:
                for moment, frame in self.states[looked:]:
                    if good(frame):
                        return moment, frame
                looked = len(self.states)
                if (left := end - time.perf_counter()) <= 0:
                    return None
                self.news.wait(left)


def followed(watch: Watch, act, count: int | None = None, seconds: float = SECONDS) -> dict:
    """Rate and latency of states that follow one after the other. act: function of the step's number that changes
    something."""
    times, grains, begun, i = [], [], time.perf_counter(), 0
    while i < count if count else time.perf_counter() - begun < seconds:
        asked = time.perf_counter()
        act(i)
        state = watch.until(lambda frame, asked=asked: time.perf_counter() - frame.seconds >= asked - 1e-4)
        times.append(state[0] - asked)
        grains.append(state[1].grain)
        i += 1
    passed = time.perf_counter() - begun
    return {
        "frames_per_second": round(i / passed, 1),
        "grain": statistics.median(grains),
        "seconds": round(statistics.median(times), 4),
        "longest": round(max(times), 4),
    }


def settled(engine: Engine, watch: Watch) -> None:
    """Waits until both kernels are compiled, and the pace is known."""
    watch.until(lambda frame: frame.grain == 1 and frame.samples >= 4, 600)
    for i in range(6):
        watch.viewer.look(camera=turned(engine.scene.camera, -STEP * (i + 1)))
        watch.until(lambda frame: True)
    watch.until(lambda frame: frame.grain == 1 and frame.samples >= 4, 600)


def measured(name: str, scene: vr.Scene) -> dict:
    """The figures of one scene."""
    watch, camera = Watch(), scene.camera
    with Engine(scene, target=0.005) as engine:
        engine.add(watch.viewer)
        settled(engine, watch)
        orbit = followed(watch, lambda i: watch.viewer.look(camera=turned(camera, STEP * i)))
        address, low, high = SLIDERS[name]
        slider = followed(watch, lambda i: engine.assign({address: low + (high - low) * (i % 17 + 1) / 17}))
        begun = time.perf_counter()
        watch.viewer.look(camera=turned(camera, -STEP))
        rest = {}
        for percent in (5, 2, 1):
            state = watch.until(
                lambda f, p=percent: f.error is not None and f.error <= p / 100 and f.seconds < PATIENCE,
                max(PATIENCE - (time.perf_counter() - begun), 0.01),
            )
            rest[str(percent)] = state and round(state[0] - begun, 2)
    return {"orbit": orbit, "slider": {"address": address} | slider, "rest": rest}


def plain(name: str) -> vr.Scene:
    """A known surface as jsurf shows it: parallel rays, one light without shadows, nothing else."""
    radius = SURFACES[name].radius
    return vr.Scene(
        camera=vr.OrthographicCamera(origin=(0, 0, 5 * radius), target=(0, 0, 0), height=2.4 * radius),
        film=vr.Film(width=512, height=512),
        lights={"lamp": vr.PointLight(position=tuple(radius * x for x in (3, 4, 5)))},
        materials={"red": vr.Material(kd=(0.7, 0.1, 0.1), ks=(0.5, 0.5, 0.5), shininess=30)},
        objects={"surface": vr.Polynomial(surface=name, material="red")},
        background=(1, 1, 1),
    )


class Jsurf:
    """jsurf, which waits for angles. picture: the PNG file that it writes at the end."""

    def __init__(self, name: str, picture: Path):
        formula = SURFACES[name].expression.replace(" ", "").replace("phi", f"({(1 + math.sqrt(5)) / 2})")
        command = ["java", "-cp", ":".join(map(str, JARS)), str(ROOT / "reference" / "JsurfTurn.java")]
        arguments = [formula, str(SURFACES[name].radius), str(SIZE[0]), str(picture)]
        self.process = subprocess.Popen(
            command + arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )

    def draw(self, angle: float) -> float:
        """Draws a picture, and returns the seconds that this took."""
        self.process.stdin.write(f"{angle}\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline())

    def close(self) -> None:
        self.process.stdin.close()
        self.process.wait(60)


def beside_jsurf(name: str, rounds: int = 6, each: int = 10) -> dict:
    """Pictures a second of jsurf, and of visray's plain scene and its scene of `visray surface`, by turns."""
    with warnings.catch_warnings(), tempfile.TemporaryDirectory() as folder:
        warnings.simplefilter("ignore")
        scenes = {"plain": plain(name), "surface": vr.surface_scene(name, size=SIZE)}
        jsurf = Jsurf(name, Path(folder) / "jsurf.png")
        engines = {key: Engine(scene, target=0.005) for key, scene in scenes.items()}
        times, grains = {"jsurf": [], "plain": [], "surface": []}, {"plain": [], "surface": []}
        watches = {key: Watch() for key in scenes}
        try:
            for key, engine in engines.items():
                engine.start()
                engine.add(watches[key].viewer)
                settled(engine, watches[key])
                engine.remove(watches[key].viewer)
            for _ in range(3 * each):
                jsurf.draw(0.0)
            for turn in range(rounds):
                angles = [STEP * (turn * each + i) for i in range(each)]
                times["jsurf"] += [jsurf.draw(angle) for angle in angles]
                for key, engine in engines.items():
                    watch, camera = watches[key], scenes[key].camera
                    engine.add(watch.viewer)
                    for angle in angles:
                        asked = time.perf_counter()
                        watch.viewer.look(camera=turned(camera, angle))
                        coarsest = 1 if key == "plain" else 64
                        moment, frame = watch.until(
                            lambda f, t=asked, g=coarsest: (
                                time.perf_counter() - f.seconds >= t - 1e-4 and f.grain <= g and f.share == 1
                            )
                        )
                        times[key].append(moment - asked)
                        grains[key].append(frame.grain)
                    engine.remove(watch.viewer)
        finally:
            jsurf.close()
            for engine in engines.values():
                engine.stop()
    report = {key: {"frames_per_second": round(1 / statistics.median(x), 1)} for key, x in times.items()}
    for key, found in grains.items():
        report[key]["grain"] = statistics.median(found)
    return report


def main() -> None:
    parser = report_parser(__doc__)
    parser.add_argument("--only", nargs="*", help="names of scenes, and jsurf")
    arguments = parser.parse_args()
    report = {"machine": machine(), "size": SIZE, "scenes": {}, "jsurf": None}
    for name in SLIDERS:
        if arguments.only is None or name in arguments.only:
            scene = ring(100_000) if name == "ring" else vr.load(ROOT / "scenes" / f"{name}.json")
            report["scenes"][name] = measured(name, scene)
    has_jsurf = shutil.which("java") and all(jar.exists() for jar in JARS)
    if has_jsurf and (arguments.only is None or "jsurf" in arguments.only):
        report["jsurf"] = {name: beside_jsurf(name) for name in ("heart", "barth-sextic")}
    write_report(report, arguments.output)


if __name__ == "__main__":
    main()
