"""Test of render(error=...) on pictures of small and bright things: how often the true error lies in the interval that
visray states, and how often it is as small as was asked.

    python reference/small_bright.py -o reference/small_bright.json

Films have 16 x 16 pixels. The true picture is that of a film of 1024 x 1024 pixels with other seeds, reduced to 16 x 16
by means; the small things are large there, and no part of adaptive sampling is used. Its own error is known from two
such pictures, and its mean square is subtracted.
"""

import sys
from dataclasses import replace
from math import sqrt

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import numpy as np
from machine import machine
from report import report_parser, write_report

from visray.adaptive.evidence import Evidence
from visray.output.curves import LUMINANCE

SIZE, FINE, FINE_SPP, SEEDS = 16, 64, 64, 20
FRONT = vr.Camera(origin=(0, 0, 6), fov=40)
WALL = vr.Plane(point=(0, 0, -2), normal=(0, 0, 1), material="wall")
GREY = vr.Material(ka=(0.2, 0.2, 0.2), kd=(0, 0, 0))
MATTE = vr.Material(ka=(0.2, 0.2, 0.2), kd=(0.5, 0.5, 0.5))
MIRROR = vr.Material(ka=(0, 0, 0), kd=(0, 0, 0), kr=(0.9, 0.9, 0.9))
GLASS = vr.Material(ka=(0, 0, 0), kd=(0, 0, 0), kt=(0.95, 0.95, 0.95), ior=1.3)


def hot(brightness: float) -> vr.Material:
    """A material that shines by itself in ambient light of 1."""
    return vr.Material(ka=(brightness,) * 3, kd=(0, 0, 0))


def scene(objects: dict, materials: dict, lights: dict | None = None, camera: object = FRONT) -> vr.Scene:
    return vr.Scene(
        camera=camera, film=vr.Film(width=SIZE, height=SIZE), ambient=(1, 1, 1), lights=lights or {},
        materials={"wall": GREY} | materials, objects={"wall": WALL} | objects,
    )  # fmt: skip


def spark(x: float, y: float, radius: float, brightness: float, camera: object = FRONT) -> vr.Scene:
    """A small ball before a grey wall."""
    ball = vr.Sphere(center=(x, y, 0), radius=radius, material="hot")
    return scene({"spark": ball}, {"hot": hot(brightness)}, camera=camera)


def line(a: tuple, b: tuple, radius: float, brightness: float) -> vr.Scene:
    """A thin cylinder before a grey wall."""
    a, b = np.array(a, float), np.array(b, float)
    wire = vr.Cylinder(
        center=tuple((a + b) / 2), axis=tuple(b - a), height=float(np.linalg.norm(b - a)), radius=radius, material="hot"
    )
    return scene({"wire": wire}, {"hot": hot(brightness)})


def mirrored(mirror: object, lamp: object, brightness: float) -> vr.Scene:
    """A lamp that only a mirror shows."""
    return scene({"mirror": mirror, "lamp": lamp}, {"mirror": MIRROR, "hot": hot(brightness)})


def square(x: float, y: float, z: float, side: float, material: str) -> vr.Rectangle:
    return vr.Rectangle(center=(x, y, z), width=(side, 0, 0), height=(0, side, 0), material=material)


def pinhole(x: float, y: float, side: float, intensity: float) -> vr.Scene:
    """Light through a small hole in a board, on the wall. The camera does not see the board's own shadow on it."""
    around = {
        "left": vr.Rectangle(center=(x - 10 - side / 2, y, 8), width=(20, 0, 0), height=(0, 40, 0), material="wall"),
        "right": vr.Rectangle(center=(x + 10 + side / 2, y, 8), width=(20, 0, 0), height=(0, 40, 0), material="wall"),
        "below": vr.Rectangle(center=(x, y - 10 - side / 2, 8), width=(side, 0, 0), height=(0, 20, 0), material="wall"),
        "above": vr.Rectangle(center=(x, y + 10 + side / 2, 8), width=(side, 0, 0), height=(0, 20, 0), material="wall"),
    }
    lamp = vr.PointLight(position=(x, y, 30), intensity=intensity)
    return scene(around, {"wall": MATTE}, {"lamp": lamp})


def spot(x: float, y: float, angle: float, intensity: float) -> vr.Scene:
    """The cone of a narrow spot light on the wall."""
    lamp = vr.SpotLight(position=(x, y, 4), direction=(0, 0, -1), angle=angle, intensity=intensity)
    return scene({}, {"wall": MATTE}, {"lamp": lamp})


def highlight(shininess: float, intensity: float, radius: float, x: float = 0.1) -> vr.Scene:
    """A highlight on a ball."""
    gloss = vr.Material(ka=(0.3, 0.3, 0.3), kd=(0, 0, 0), ks=(1, 1, 1), shininess=shininess)
    ball = vr.Sphere(center=(x, 0.2, 0), radius=radius, material="gloss")
    return scene({"ball": ball}, {"gloss": gloss}, {"lamp": vr.PointLight(position=(2, 3, 5), intensity=intensity)})


def stars() -> vr.Scene:
    """Twelve sparks of different brightness."""
    rng = np.random.default_rng(3)
    places, brightness = rng.uniform(-1.8, 1.8, (12, 2)), 10 ** rng.uniform(0, 4, 12)
    balls = {
        f"star{k}": vr.Sphere(center=(*p, 0), radius=0.02, material=f"hot{k}") for k, p in enumerate(places.tolist())
    }
    return scene(balls, {f"hot{k}": hot(float(b)) for k, b in enumerate(brightness)})


def ball_area(x: float, y: float, radius: float, orthographic: bool) -> float:
    """Area of a ball about (x, y, 0) on the film, in pixels: that of an ellipse."""
    if orthographic:
        return np.pi * (radius * SIZE / FLAT.height) ** 2
    z, pixel = 6.0, 2 * np.tan(np.radians(20)) / SIZE
    squared = x * x + y * y + z * z - radius**2
    return np.pi * radius**2 * sqrt(squared) / (z * z - radius**2) ** 1.5 / pixel**2


LENS = vr.Camera(origin=(0, 0, 6), fov=40, aperture=0.3, focus=8)
FLAT = vr.OrthographicCamera(origin=(0, 0, 6), height=4)
# By name: the scene, and the error that is asked for.
CASES: dict[str, tuple[vr.Scene, float]] = {
    "lamp of 1/16 pixel": (spark(0.731, 0.417, 0.03825, 2000), 0.1),
    "lamp of 1/2500 pixel": (spark(-0.9, 0.33, 0.003, 2e5), 0.1),
    "dim lamp of 1/16 pixel": (spark(0.4, -1.2, 0.03825, 5), 0.02),
    "lamp at the corner of four pixels": (spark(0.0, 0.0, 0.02, 3000), 0.1),
    "lamp, orthographic camera": (spark(1.03, 0.61, 0.01, 5000, FLAT), 0.1),
    "lamp out of focus": (spark(0.5, -0.4, 0.02, 3000, LENS), 0.4),
    "twelve lamps": (stars(), 0.1),
    "wire across": (line((-1.2, 0.31, 0), (1.1, 0.31, 0), 0.0005, 1000), 0.1),
    "oblique wire": (line((-1.1, -0.7, 0), (1.2, 1.0, 0.5), 0.0008, 1000), 0.1),
    "short wire": (line((0.2, -0.7, 0), (0.35, -0.6, 0), 0.002, 3000), 0.1),
    "sliver of a triangle": (
        scene(
            {"sliver": vr.Triangle(a=(-1, -1, 0), b=(0.3, -0.62, 0), c=(-0.9, -0.969, 0), material="hot")},
            {"hot": hot(500)},
        ),
        0.1,
    ),
    "mirror of half a pixel": (mirrored(square(0.43, 0.5, 0, 0.19, "mirror"), square(0, 0, 9, 20, "hot"), 500), 0.1),
    "lamp in a mirror of half a pixel": (
        mirrored(
            square(0.43, 0.5, 0, 0.19, "mirror"), vr.Sphere(center=(1.29, 1.5, 12), radius=0.1, material="hot"), 500
        ),
        0.5,
    ),
    "lamp in a mirror": (
        mirrored(square(0, 0, 0, 3, "mirror"), vr.Sphere(center=(1.1, 0.7, 12), radius=0.12, material="hot"), 500),
        0.5,
    ),
    "lamp in a mirror ball": (
        mirrored(
            vr.Sphere(center=(0.2, 0, 0), radius=1, material="mirror"),
            vr.Sphere(center=(6, 4, 12), radius=0.5, material="hot"), 500,
        ),
        0.5,
    ),
    "lamp behind glass": (
        scene(
            {
                "glass": vr.Sphere(center=(0, 0, 1), radius=1.2, material="glass"),
                "lamp": vr.Sphere(center=(0.3, 0.2, -1.5), radius=0.01, material="hot"),
            },
            {"glass": GLASS, "hot": hot(500)},
        ),
        0.5,
    ),
    "light through a pinhole": (pinhole(0.33, 0.41, 0.03, 500), 0.5),
    "narrow spot light": (spot(-0.41, 0.52, 0.3, 500), 0.5),
    "highlight": (highlight(20000, 200, 1.2), 0.5),
    "highlight on a ball of half a pixel": (highlight(50, 200, 0.1), 0.5),
}  # fmt: skip

# Scenes whose true pictures are known in closed form.
CLOSED = ("lamp of 1/16 pixel", "lamp of 1/2500 pixel", "dim lamp of 1/16 pixel", "lamp, orthographic camera")


def fine(s: vr.Scene, seed: int) -> np.ndarray:
    """The picture of a scene, reduced from a film of SIZE * FINE pixels. Shape: (SIZE, SIZE, 3)."""
    big = vr.render(s, size=(SIZE * FINE,) * 2, spp=FINE_SPP, seed=seed, layers=("RGB",), progress=False)["RGB"]
    return big.astype(float).reshape(SIZE, FINE, SIZE, FINE, 3).mean((1, 3))


def reduced(s: vr.Scene) -> tuple[np.ndarray, float]:
    """The true picture, from two large ones, and its mean square error."""
    a, b = (fine(s, seed) for seed in (1001, 1002))
    return (a + b) / 2, float(np.square(a - b).mean()) / 4


def closed_form(s: vr.Scene) -> tuple[np.ndarray, float]:
    """The true picture of a ball in one pixel before the wall, in closed form, and 0."""
    ball, orthographic = s.objects["spark"], isinstance(s.camera, vr.OrthographicCamera)
    x, y, _ = ball.center
    per_unit = SIZE / s.camera.height if orthographic else SIZE / (12 * np.tan(np.radians(20)))
    picture = np.full((SIZE, SIZE, 3), 0.2)
    brightness = s.materials["hot"].ka[0]
    pixel = int(SIZE / 2 - y * per_unit), int(SIZE / 2 + x * per_unit)
    picture[pixel] += ball_area(x, y, ball.radius, orthographic) * (brightness - 0.2)
    return picture, 0.0


def pictures(s: vr.Scene, asked: float, true: np.ndarray, off: float) -> dict:
    """Figures over SEEDS pictures of a scene, as a dict.

    within: number of pictures whose true error lies in the stated interval; above, below: of those beyond its ends
    met: number of pictures whose true error is at most the one asked for
    worst, mean: the largest true error, and the mean of them
    spp, seconds: mean number of samples per pixel, and median time
    intervals: low end, high end and true error of each picture
    """
    luminance, rows, spp, seconds = float((true @ LUMINANCE).mean()), [], [], []
    for seed in range(SEEDS):
        image = vr.render(s, error=asked, seed=seed, layers=("RGB",), progress=False)
        facts, error = image.metadata, sqrt(max(float(np.square(image["RGB"] - true).mean()) - off, 0.0)) / luminance
        # Intervals are relative to the luminance of the picture, the true error to that of the true picture.
        scale = float((image["RGB"] @ LUMINANCE).mean()) / luminance
        rows.append([float(f"{x:.4g}") for x in (scale * facts["error_low"], scale * facts["error_high"], error)])
        spp.append(facts["spp"])
        seconds.append(facts["render_seconds"])
    low, high, error = np.array(rows).T
    return {
        "within": int(((low <= error) & (error <= high)).sum()),
        "above": int((error > high).sum()),
        "below": int((error < low).sum()),
        "met": int((error <= asked).sum()),
        "worst": float(error.max()),
        "mean": float(error.mean()),
        "spp": float(np.mean(spp)),
        "seconds": float(np.median(seconds)),
        "intervals": rows,
    }


def case(name: str) -> dict:
    """Figures for one scene, as a dict: with all that visray does, and without samples for small objects and without
    hidden light.

    truth_off: error of the true picture, relative to its luminance
    """
    s, asked = CASES[name]
    s = replace(s, settings=replace(s.settings, depth=4, sampler="sobol"))
    true, off = closed_form(s) if name in CLOSED else reduced(s)
    looks, report = Evidence.look_at_small_objects, {"scene": name, "asked": asked}
    report["truth_off"] = sqrt(off) / float((true @ LUMINANCE).mean())
    for way, look in (("with", looks), ("without", lambda *_: None)):
        Evidence.look_at_small_objects = look
        report[way] = pictures(s, asked, true, off)
    Evidence.look_at_small_objects = looks
    return report


def summary(rows: list[dict], way: str) -> dict:
    """Figures over all scenes, as a dict.

    deviations: by how many standard deviations of a binomial distribution more pictures are within their intervals than
        95 %; negative if fewer are
    """
    n, within = len(rows) * SEEDS, sum(r[way]["within"] for r in rows)
    deviations = (within - 0.95 * n) / sqrt(n * 0.95 * 0.05)
    sums = {key: sum(r[way][key] for r in rows) for key in ("above", "below", "met")}
    return {"pictures": n, "within": within, "share": within / n, "deviations": deviations} | sums


def main() -> None:
    parser = report_parser(__doc__)
    parser.add_argument("--only", help="only the scenes with this text in their names")
    arguments = parser.parse_args()
    rows = []
    for name in CASES:
        if arguments.only and arguments.only not in name:
            continue
        rows.append(case(name))
        sys.stderr.write(f"{name}: {rows[-1]['with']['within']} of {SEEDS} within\n")
    write_report(
        machine() | {"with": summary(rows, "with"), "without": summary(rows, "without"), "scenes": rows},
        arguments.output,
    )


if __name__ == "__main__":
    main()
