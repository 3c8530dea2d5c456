"""Polynomial surfaces in visray, POV-Ray 3.7 (`poly`) and surf: speed and wrong pixels.

    python reference/bench_povray.py -o reference/bench_povray.json

All programs render the same surface with the same camera.

POV-Ray and visray, 2 threads each: 512 x 512 pixels, one point light with shadows. The time of one sample per pixel is
compared. POV-Ray takes one sample per pixel; the trace time that POV-Ray reports is used, without parsing and writing.
visray takes 1, 4 and 16 samples per pixel; its time is that from the prepared scene to the picture in memory, with
compiled kernels.

surf and visray, one thread each: 2048 x 2048 pixels, camera rays only, no shadows, one sample per pixel. The time that
surf takes to start is subtracted; it is measured by a picture of 64 x 64 pixels.

The programs alternate, and medians are reported. CPU seconds are reported as well, because they do not contain the time
that other programs on the machine take.

Wrong pixels: exact arithmetic decides whether the ray through a pixel's centre hits the surface. The tested pixels are
random pixels, pixels at the edge of the silhouette in each program's picture, pixels at which two programs differ, and
the neighbours of wrong pixels. If the result changes when the ray moves by 1e-9 of a pixel, the pixel is on an edge and
is counted separately. For this test visray computes ray directions in double, as the other programs do. By default
visray computes directions in single, with an error of about 1e-4 of a pixel.

Programs that are not installed are left out; --peers leaves visray out.
"""

import argparse
import ast
import json
import operator
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from math import lcm
from pathlib import Path
from typing import Any

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import drjit as dr
import flint
import numpy as np
from bench_mitsuba import with_seed
from machine import machine
from PIL import Image

from visray.accel.intersect import closest
from visray.integrator import camera_ray
from visray.passes import expose
from visray.setup import prepare

SIZE, LARGE, SMALL, RUNS, THREADS, SAMPLES = 512, 2048, 64, 5, 2, (1, 4, 16)
# Positions of the eye and the lamp in units of the clip's radius. They lie on no symmetry axis of a surface.
EYE, LAMP, UP, FOV = (1.87, -2.06, 1.11), (-1.0, -2.5, 3.0), (0.0, 0.0, 1.0), 40.0
AMBIENT, DIFFUSE, BACKGROUND = 0.1, 0.7, (0.05, 0.08, 0.2)
POVRAY, SURF = "povray", "surf-alggeo-nox"
SAMPLED, EDGE = 20_000, 1e-9
# surf's view: half its side, in surf's units. surf looks along the z axis.
SURF_HALF = 10.0
# The golden ratio (phi) and the square root of two (root). All programs and the exact test use these decimal numbers.
CONSTANTS = {
    "phi": "1.618033988749894848204586834365638117720309",
    "root": "1.414213562373095048801688724209698078569672",
}

Monomial = tuple[int, int, int]
Seconds = tuple[float, float]  # of the wall clock, and of the CPU
TimedCall = Callable[[], Seconds]


@dataclass(frozen=True)
class Surface:
    """A surface f = 0 within a sphere about the origin, the clip.

    expression: f, a polynomial in x, y and z; it may contain the names of CONSTANTS
    clip: radius of the clip, a decimal number as text
    """

    expression: str
    clip: str

    @property
    def radius(self) -> float:
        return float(self.clip)

    @property
    def constants(self) -> dict[str, str]:
        """The entries of CONSTANTS whose names occur in the expression."""
        return {k: v for k, v in CONSTANTS.items() if re.search(rf"\b{k}\b", self.expression)}

    def terms(self) -> dict[Monomial, Fraction]:
        """The exact coefficients of f: a dict from (i, j, k) to the coefficient of x^i y^j z^k."""
        expression = ast.parse(self.expression.replace("^", "**"), mode="eval").body
        return {e: c for e, c in _expanded(expression).items() if c}

    @property
    def degree(self) -> int:
        return max(map(sum, self.terms()))


SURFACES = {
    "sphere": Surface("x^2+y^2+z^2-1", "1.25"),
    "heart": Surface("(x^2+9/4*y^2+z^2-1)^3-x^2*z^3-9/80*y^2*z^3", "1.6"),
    "barth-sextic": Surface(
        "4*(phi^2*x^2-y^2)*(phi^2*y^2-z^2)*(phi^2*z^2-x^2)-(1+2*phi)*(x^2+y^2+z^2-1)^2", "2.5"
    ),
    "barth-decic": Surface(
        "8*(x^2-phi^4*y^2)*(y^2-phi^4*z^2)*(z^2-phi^4*x^2)*(x^4+y^4+z^4-2*x^2*y^2-2*x^2*z^2-2*y^2*z^2)"
        "+(3+5*phi)*(x^2+y^2+z^2-1)^2*(x^2+y^2+z^2-(2-phi))^2",
        "2.6",
    ),
    "endrass-octic": Surface(
        "64*(x^2-1)*(y^2-1)*((x-y)^2-2)*((x+y)^2-2)-((8-16*root)*z^2-16*z^4-(4+4*root)*(x^2+y^2)^2"
        "+(x^2+y^2)*((16+8*root)*z^2+4+14*root)-12*root-1)^2",
        "2.6",
    ),
}  # fmt: skip
DEFAULT = [name for name in SURFACES if name != "sphere"]


def _expanded(node: ast.expr) -> dict[Monomial, Fraction]:
    """The exact coefficients of an expression, by monomial. node: the expression as a Python syntax tree."""
    match node:
        case ast.Constant(value):
            return {(0, 0, 0): Fraction(value)}
        case ast.Name(name) if name in CONSTANTS:
            return {(0, 0, 0): Fraction(CONSTANTS[name])}
        case ast.Name(name):
            return {tuple(int(name == axis) for axis in "xyz"): Fraction(1)}
        case ast.UnaryOp(ast.USub(), inner):
            return {e: -c for e, c in _expanded(inner).items()}
        case ast.BinOp(left, ast.Pow(), ast.Constant(power)):
            a = total = _expanded(left)
            for _ in range(power - 1):
                total = _product(total, a)
            return total
        case ast.BinOp(left, ast.Mult(), right):
            return _product(_expanded(left), _expanded(right))
        case ast.BinOp(left, ast.Div(), right):
            return _product(_expanded(left), {e: 1 / c for e, c in _expanded(right).items()})
        case ast.BinOp(left, ast.Add() | ast.Sub() as sign, right):
            a, b = _expanded(left), _expanded(right)
            join = operator.add if isinstance(sign, ast.Add) else operator.sub
            return {e: join(a.get(e, 0), b.get(e, 0)) for e in a | b}
    raise ValueError(f"{ast.unparse(node)}: is not part of a polynomial")


def _product(a: dict[Monomial, Fraction], b: dict[Monomial, Fraction]) -> dict[Monomial, Fraction]:
    """The coefficients of a product of two polynomials."""
    total: dict[Monomial, Fraction] = {}
    for (i, j, k), c in a.items():
        for (l, m, n), d in b.items():
            e = i + l, j + m, k + n
            total[e] = total.get(e, 0) + c * d
    return total


@dataclass(frozen=True)
class View:
    """The camera as vectors, computed as in visray.

    eye: position of the camera
    forward, right, up: unit vectors of the camera's axes
    half: tangent of half the field of view
    """

    eye: np.ndarray
    forward: np.ndarray
    right: np.ndarray
    up: np.ndarray
    half: float

    @staticmethod
    def of(surface: Any) -> "View":
        """The view of a surface, or of anything else about the origin that has a `radius`."""
        eye = surface.radius * np.array(EYE)
        forward = -eye / np.linalg.norm(eye)
        right = np.cross(forward, UP) / np.linalg.norm(np.cross(forward, UP))
        return View(eye, forward, right, np.cross(right, forward), float(np.tan(np.radians(FOV) / 2)))

    def direction(self, x: float, y: float, size: int) -> np.ndarray:
        """The direction of the ray through the point (x, y) of the picture. Its length is not 1.

        x, y: in pixels from the picture's top left corner; size: pixels on a side
        """
        across, down = (2 * x / size - 1) * self.half, (2 * y / size - 1) * self.half
        return self.forward + across * self.right - down * self.up


def timed(work: Callable[[], object], who: int = resource.RUSAGE_SELF) -> Seconds:
    """The wall-clock and CPU seconds of a call. who: the process whose CPU time is read: this one, or its children."""
    before, start = resource.getrusage(who), time.perf_counter()
    work()
    wall, after = time.perf_counter() - start, resource.getrusage(who)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


# --- visray


def ours(surface: Surface, size: int, spp: int, **settings) -> vr.Scene:
    """The scene for visray. settings: fields of vr.Settings."""
    expression = re.sub(r"\broot\b", "sqrt(2)", surface.expression)  # visray knows phi, but not root
    f = vr.Polynomial(expression=expression, clip=vr.Ball(radius=surface.radius), material="matte")
    position = {name: tuple(surface.radius * x for x in p) for name, p in {"eye": EYE, "lamp": LAMP}.items()}
    return vr.Scene(
        camera=vr.Camera(origin=position["eye"], target=(0.0, 0.0, 0.0), up=UP, fov=FOV),
        film=vr.Film(width=size, height=size),
        background=BACKGROUND,
        materials={"matte": vr.Material(ka=(AMBIENT,) * 3, kd=(DIFFUSE,) * 3)},
        objects={"f": f},
        lights={"lamp": vr.PointLight(position=position["lamp"])},
        settings=vr.Settings(spp=spp, **settings),
    )


def rendering(surface: Surface, size: int, spp: int, **settings) -> TimedCall:
    """A function that renders a picture by visray with compiled kernels, and returns the times.

    Each call has a new seed. settings: fields of vr.Settings.
    """
    prepared, seeds = prepare(ours(surface, size, spp, **settings)), iter(range(1000))
    return lambda: timed(lambda: expose(with_seed(prepared, next(seeds))))


def intersecting(surface: Surface, size: int) -> TimedCall:
    """A function that computes the first hits of rays through the pixels' centres by visray and returns the times."""
    prepared = prepare(ours(surface, size, 1, shadows=False))
    a = prepared.a

    def work() -> None:
        dr.eval(
            closest(prepared.kernel.origin, camera_ray(prepared.kernel, a.F(prepared.x) + 0.5, a.F(prepared.y) + 0.5)).t
        )
        dr.sync_thread()

    return lambda: timed(work)


def our_mask(surface: Surface) -> np.ndarray:
    """Whether visray's ray through each pixel's centre hits. Directions are in double, as in the exact test.

    Shapes: (SIZE, SIZE).
    """
    scene = ours(surface, SIZE, 1, precision="double")
    return vr.render(scene, layers=("id",), progress=False)["id"] > 0


# --- POV-Ray


def coefficients(surface: Surface) -> list[float]:
    """The coefficients of x^i y^j z^k in the order of POV-Ray's `poly`: sorted by i, then j, then k, largest first.

    For degree 2 that is x^2, xy, xz, x, y^2, yz, y, z^2, z, 1.

    Source: the table of `poly` in POV-Ray's reference.
    """
    n, terms = surface.degree, surface.terms()
    order = [(i, j, k) for i in range(n, -1, -1) for j in range(n - i, -1, -1) for k in range(n - i - j, -1, -1)]
    return [float(terms.get(e, 0)) for e in order]


def vector(v: Iterable[float]) -> str:
    """Text of a vector in POV-Ray's syntax."""
    return "<" + ", ".join(repr(float(x)) for x in v) + ">"


def for_povray(surface: Surface, lit: bool) -> str:
    """Text of the scene for POV-Ray.

    lit: whether there is a light. Without a light, a pixel is white if its ray hits, otherwise black.

    The camera's vectors are given directly, without look_at, so POV-Ray's left-handed convention does not matter. The
    lengths of right and up are the sides of the picture at distance 1. clipped_by leaves the surface open where the
    sphere cuts it, without a cap.
    """
    view = View.of(surface)
    paint = f"finish {{ ambient {AMBIENT} diffuse {DIFFUSE} }}" if lit else "finish { ambient 1 diffuse 0 }"
    return f"""#version 3.7;
global_settings {{ assumed_gamma 1 max_trace_level 1 }}
background {{ rgb {vector(BACKGROUND if lit else (0, 0, 0))} }}
camera {{
  perspective location {vector(view.eye)} direction {vector(view.forward)}
  right {vector(2 * view.half * view.right)} up {vector(2 * view.half * view.up)}
}}
{f"light_source {{ {vector(surface.radius * np.array(LAMP))} rgb 1 }}" if lit else ""}
poly {{
  {surface.degree}, {vector(coefficients(surface))} sturm
  clipped_by {{ sphere {{ 0, {surface.clip} }} }} bounded_by {{ clipped_by }}
  pigment {{ rgb 1 }} {paint}
}}
"""


def povray(
    folder: Path,
    text: str,
    threads: int,
    picture: str | None = None,
    size: int = SIZE,
    more: tuple[str, ...] = ("-A", "+FN8"),
) -> Seconds:
    """Runs POV-Ray. Returns the trace time that POV-Ray reports.

    folder: working folder; text: the scene; picture: name of the file to write, or None; size: pixels on a side
    more: options of the samples in a pixel, and of the file's format
    """
    (folder / "scene.pov").write_text(text)
    command = [POVRAY, "+Iscene.pov", f"+W{size}", f"+H{size}", f"+WT{threads}", *more, "-J", "-D", "-V", "-UA", "+Q9"]
    command += [f"+O{picture}"] if picture else ["-F"]
    process = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    seconds = re.search(r"Trace Time:.*\(([\d.]+) seconds\)\s+using .* with ([\d.]+) CPU-seconds", process.stderr)
    if process.returncode or not seconds:
        raise SystemExit(f"povray failed:\n{process.stderr[-2000:]}")
    return float(seconds[1]), float(seconds[2])


def povray_mask(folder: Path, surface: Surface) -> np.ndarray:
    """Whether POV-Ray's ray through each pixel's centre hits. Shapes: (SIZE, SIZE)."""
    povray(folder, for_povray(surface, lit=False), THREADS, "mask.png")
    return np.asarray(Image.open(folder / "mask.png").convert("L")) > 127


# --- surf


def for_surf(surface: Surface, size: int, picture: str | None = None) -> str:
    """Text of the script for surf.

    The surface is rotated into the camera's axes, and scaled so that rays run through the pixels' centres. The centres
    of surf's first and last pixel lie on the borders of surf's view, so the view is one pixel smaller than the picture.
    surf divides integers as C does, so fractions are written as decimals.

    size: pixels on a side
    picture: name of the file to write; the surface then has one bright colour, for surf_mask. None: no file.
    """
    view = View.of(surface)
    distance = float(np.linalg.norm(view.eye))
    scale = distance * view.half * (size - 1) / size / SURF_HALF
    lines = [f"width={size}; height={size};", "perspective=central; clip=sphere;"]
    lines += [f"spec_z={distance / scale!r}; radius={surface.radius / scale!r};"]
    lines += [f"double {name}={value[:20]};" for name, value in surface.constants.items()]
    for name, axis in zip("uvw", range(3)):
        row = (scale * float(v[axis]) for v in (view.right, view.up, -view.forward))
        lines.append(f"poly {name}=" + "+".join(f"({c:.17f})*{v}" for c, v in zip(row, "xyz")) + ";")
    expression = re.sub(r"(\d+)/(\d+)", lambda m: repr(int(m[1]) / int(m[2])), surface.expression)
    for name, axis in zip("uvw", "xyz"):
        expression = re.sub(rf"\b{axis}\b", name, expression)
    if picture:  # the surface is bright all over
        lines += ["illumination=ambient_light; ambient=100;"]
        lines += [f"{side}_{c}=255;" for side in ("surface", "inside") for c in ("red", "green", "blue")]
    lines += [f"surface={expression};", "clear_screen; draw_surface;"]
    if picture:
        lines += [f'filename="{picture}"; color_file_format=ppm; save_color_image;']
    return "\n".join(lines) + "\n"


def surf(folder: Path, text: str) -> Seconds:
    """Runs surf on a script. Returns the time. surf does not report errors in a script, but surf_mask detects them."""
    (folder / "scene.pic").write_text(text)
    command = [SURF, "-q", "scene.pic"]
    return timed(lambda: subprocess.run(command, cwd=folder, capture_output=True, check=True), resource.RUSAGE_CHILDREN)


def surf_mask(folder: Path, surface: Surface) -> np.ndarray:
    """Whether surf's ray through each pixel's centre hits: the pixel is not black. Shapes: (SIZE, SIZE).

    surf darkens distant points, but never to black.
    """
    (folder / "mask.ppm").unlink(missing_ok=True)
    surf(folder, for_surf(surface, SIZE, "mask.ppm"))
    if not (folder / "mask.ppm").exists():
        raise SystemExit("surf failed: it drew no picture")
    return np.asarray(Image.open(folder / "mask.ppm").convert("L")) > 0


# --- the exact test


class Truth:
    """The exact test whether rays hit a surface, by exact polynomials and certified roots."""

    def __init__(self, surface: Surface):
        self.view, self.cache = View.of(surface), {}
        terms, self.degree, self.clip = surface.terms(), surface.degree, Fraction(surface.clip)
        denominator = lcm(*(c.denominator for c in terms.values()))
        self.terms = {e: int(c * denominator) for e, c in terms.items()}

    def hit(self, x: int, y: int) -> bool | None:
        """Whether the ray through a pixel's centre hits; None if it is not certain whether a root lies in the clip.

        x, y: column and row of the pixel
        """
        if (x, y) not in self.cache:
            self.cache[x, y] = self._hit(x + 0.5, y + 0.5)
        return self.cache[x, y]

    def on_edge(self, x: int, y: int) -> bool:
        """Whether the result changes, or is None, when the ray moves by EDGE pixels."""
        results = {
            self._hit(x + 0.5 + dx * EDGE, y + 0.5 + dy * EDGE) for dx, dy in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))
        }
        return len(results) > 1 or None in results

    def _hit(self, x: float, y: float) -> bool | None:
        # The polynomials are multiplied by powers of the common denominator s, so that all coefficients are integers.
        coordinates = zip(self.view.eye.tolist(), self.view.direction(x, y, SIZE).tolist())
        rays = [(Fraction(o), Fraction(d)) for o, d in coordinates]
        s = max(v.denominator for ray in rays for v in ray)
        lines = [flint.fmpz_poly([int(o * s), int(d * s)]) for o, d in rays]
        powers = [[flint.fmpz_poly([1])] for _ in lines]
        for line, row in zip(lines, powers):
            for _ in range(self.degree):
                row.append(row[-1] * line)
        f = flint.fmpz_poly([])
        for (i, j, k), c in self.terms.items():
            f += powers[0][i] * powers[1][j] * powers[2][k] * (c * s ** (self.degree - i - j - k))
        if f == 0:
            return None
        radius, unsure = self.clip * s, False
        square = radius.denominator**2
        outside = sum((row[2] * square for row in powers), flint.fmpz_poly([-(radius.numerator**2)]))
        for root, _ in f.complex_roots():
            if root.imag == 0:
                level = flint.arb_poly(outside)(root.real)
                if level <= 0 and root.real > 0:
                    return True
                unsure |= not level > 0 and root.real > 0
        return None if unsure else False


def edges(mask: np.ndarray) -> set[tuple[int, int]]:
    """Pixels (x, y) whose value in the mask differs from that of a neighbour to the left, right, top or bottom."""
    at_edge = np.zeros_like(mask)
    for axis in (0, 1):
        differs = np.diff(mask.astype(np.int8), axis=axis) != 0
        pad = [(0, 0), (0, 0)]
        for pad[axis] in ((0, 1), (1, 0)):
            at_edge |= np.pad(differs, pad)
    return pixels(at_edge)


def pixels(mask: np.ndarray) -> set[tuple[int, int]]:
    """Coordinates (x, y) of the pixels at which the mask is true."""
    return {(int(x), int(y)) for y, x in np.argwhere(mask)}


def wrong(truth: Truth, mask: np.ndarray, suspects: set[tuple[int, int]]) -> dict:
    """Counts of wrong pixels among the suspects, random pixels, and neighbours of wrong pixels, as a dict.

    mask: whether the program's ray hits, for each pixel
    suspects: pixels that are likely to be wrong

    In the result, missed: pixels whose ray hits, but not by the program; invented: pixels whose ray hits by the program
    only.
    """
    rng = np.random.default_rng(0)
    chosen = {(int(i) % SIZE, int(i) // SIZE) for i in rng.choice(SIZE * SIZE, SAMPLED, replace=False)}
    waiting, queued = list(chosen | suspects), set(chosen | suspects)
    by_kind = {"missed": [], "invented": [], "edge": []}
    while waiting:
        x, y = waiting.pop()
        true = truth.hit(x, y)
        if true == bool(mask[y, x]):
            continue
        kind = "edge" if truth.on_edge(x, y) else "missed" if true else "invented"
        by_kind[kind].append((x, y))
        neighbours = {(x + dx, y + dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)}
        new = {(x, y) for x, y in neighbours - queued if 0 <= x < SIZE and 0 <= y < SIZE}
        queued |= new
        waiting += new
    bad = by_kind["missed"] + by_kind["invented"]
    return {
        "checked": len(queued),
        "wrong": len(bad),
        "missed": len(by_kind["missed"]),
        "invented": len(by_kind["invented"]),
        "on_an_edge": len(by_kind["edge"]),
        "of_random": len(chosen),
        "wrong_of_random": len(chosen & set(bad)),
        "first_wrong": sorted(bad)[:5],
    }


# --- the comparison


def alternating(calls: dict[str, TimedCall], runs: int) -> dict[str, np.ndarray]:
    """Wall-clock and CPU seconds of several calls, by name. Shapes: (2, runs) each.

    The calls alternate. Before them, each call runs once without being counted.
    """
    for call in calls.values():
        call()
    seconds: dict[str, list[Seconds]] = {name: [] for name in calls}
    for _ in range(runs):
        for name, call in calls.items():
            seconds[name].append(call())
    return {name: np.array(s).T for name, s in seconds.items()}


def summary(seconds: np.ndarray) -> dict:
    """Median and range of wall-clock seconds, and median of CPU seconds."""
    wall, cpu = seconds
    figures = {"median": np.median(wall), "range": [wall.min(), wall.max()], "cpu_median": np.median(cpu)}
    return {k: v if isinstance(v, list) else float(v) for k, v in figures.items()}


def shaded(surface: Surface, folder: Path, runs: int, have: set[str]) -> dict:
    """A dict with the times of pictures with shadows, on two threads (POV-Ray also on one).

    folder: working folder; runs: number of runs; have: names of the programs to run
    """
    calls: dict[str, TimedCall] = {}
    if "povray" in have:
        text = for_povray(surface, lit=True)
        calls |= {f"povray {n}": lambda n=n: povray(folder, text, n) for n in (THREADS, 1)}
    if "visray" in have:
        dr.set_thread_count(THREADS)
        calls |= {f"visray {spp}": rendering(surface, SIZE, spp) for spp in SAMPLES}
    seconds = alternating(calls, runs)
    report: dict = {"s": {name: summary(t) for name, t in seconds.items()}}
    if "visray" in have:
        report["visray_s_per_sample"] = {n: float(np.median(seconds[f"visray {n}"][0])) / n for n in SAMPLES}
    if {"povray", "visray"} <= have:
        theirs = seconds[f"povray {THREADS}"]
        pairs = {n: theirs / (seconds[f"visray {n}"] / n) for n in SAMPLES}
        both = {n: np.median(theirs, 1) / np.median(seconds[f"visray {n}"] / n, 1) for n in SAMPLES}
        report["ratio"] = {n: float(r[0]) for n, r in both.items()}
        report["ratio_range"] = {n: [float(p[0].min()), float(p[0].max())] for n, p in pairs.items()}
        report["ratio_cpu"] = {n: float(r[1]) for n, r in both.items()}
    return report


def bare(surface: Surface, folder: Path, runs: int, have: set[str]) -> dict:
    """A dict with times and rates of camera rays without shadows, on one thread. Units of rates: millions a second.

    folder: working folder; runs: number of runs; have: names of the programs to run
    """
    calls: dict[str, TimedCall] = {}
    if "surf" in have:
        calls |= {f"surf {n}": lambda n=n: surf(folder, for_surf(surface, n)) for n in (LARGE, SMALL)}
    if "visray" in have:
        dr.set_thread_count(1)
        calls["visray picture"] = rendering(surface, LARGE, 1, shadows=False)
        calls["visray intersecting"] = intersecting(surface, LARGE)
    seconds = alternating(calls, runs)
    rates = {name: LARGE**2 / 1e6 / np.median(t, 1) for name, t in seconds.items() if name.startswith("visray")}
    if "surf" in have:
        drawing = seconds[f"surf {LARGE}"] - seconds[f"surf {SMALL}"]
        rates["surf"] = (LARGE**2 - SMALL**2) / 1e6 / np.median(drawing, 1)
    report: dict = {"s": {name: summary(t) for name, t in seconds.items()}}
    report["Mrays_per_s"] = {name: float(r[0]) for name, r in rates.items()}
    report["Mrays_per_cpu_s"] = {name: float(r[1]) for name, r in rates.items()}
    if {"surf", "visray"} <= have:
        report["ratio"] = {name: float(r[0] / rates["surf"][0]) for name, r in rates.items() if name != "surf"}
        report["ratio_cpu"] = {name: float(r[1] / rates["surf"][1]) for name, r in rates.items() if name != "surf"}
    return report


def wrong_pixels(surface: Surface, folder: Path, have: set[str]) -> dict:
    """Counts of wrong pixels, by program."""
    masks = {}
    if "povray" in have:
        masks["povray"] = povray_mask(folder, surface)
    if "visray" in have:
        masks["visray"] = our_mask(surface)
    if "surf" in have:
        masks["surf"] = surf_mask(folder, surface)
    truth = Truth(surface)
    suspects = set().union(*(edges(m) for m in masks.values()))
    suspects |= set().union(*(pixels(m != n) for m in masks.values() for n in masks.values()))
    return {name: {"hit": int(mask.sum())} | wrong(truth, mask, suspects) for name, mask in masks.items()}


def side_by_side(surface: Surface, folder: Path, have: set[str], out: Path) -> None:
    """Writes one image file with the pictures of all programs side by side: POV-Ray, visray, surf."""
    pictures = []
    if "povray" in have:
        povray(folder, for_povray(surface, lit=True), THREADS, "picture.png")
        pictures.append(Image.open(folder / "picture.png").convert("RGB"))
    if "visray" in have:
        vr.render(ours(surface, SIZE, 4), progress=False).write(folder / "ours.png")
        pictures.append(Image.open(folder / "ours.png").convert("RGB"))
    if "surf" in have:
        pictures.append(Image.fromarray(surf_mask(folder, surface)).convert("RGB"))
    if pictures:
        out.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(np.hstack([np.asarray(s) for s in pictures])).save(out)


def versions(have: set[str]) -> dict[str, str]:
    """The versions of POV-Ray and surf, by name."""
    texts = {}
    if "povray" in have:
        process = subprocess.run([POVRAY, "--version"], capture_output=True, text=True)
        texts["povray"] = next(iter(re.findall(r"POV-Ray (\S+)", process.stdout + process.stderr)), "")
    if "surf" in have:
        process = subprocess.run([SURF, "--version"], capture_output=True, text=True)
        texts["surf"] = (process.stdout + process.stderr).strip()
    return texts


def table(rows: list[dict], have: set[str]) -> str:
    """The report as a text table: seconds of a sample with shadows, millions of camera rays a second, wrong pixels."""
    head = ["surface", "deg"]
    if "povray" in have:
        head += ["POV 2t s", "POV 1t s"]
    if "visray" in have:
        head += [f"ours {n} s" for n in SAMPLES]
    if {"povray", "visray"} <= have:
        head += [f"ratio {n}" for n in SAMPLES] + [f"cpu ratio {SAMPLES[-1]}"]
    if "surf" in have:
        head += ["surf M/s"]
    if "visray" in have:
        head += ["ours M/s", "isect M/s"]
    tested = [n for n in ("povray", "visray", "surf") if n in have]
    head += [f"wrong {n}" for n in tested]
    lines = [head]
    for row in rows:
        line = [row["surface"], str(row["degree"])]
        if "povray" in have:
            line += [f"{row['shaded']['s'][f'povray {n}']['median']:.3f}" for n in (THREADS, 1)]
        if "visray" in have:
            line += [f"{row['shaded']['visray_s_per_sample'][n]:.4f}" for n in SAMPLES]
        if {"povray", "visray"} <= have:
            line += [f"{row['shaded']['ratio'][n]:.1f}" for n in SAMPLES]
            line += [f"{row['shaded']['ratio_cpu'][SAMPLES[-1]]:.1f}"]
        if "surf" in have:
            line += [f"{row['camera_rays']['Mrays_per_s']['surf']:.2f}"]
        if "visray" in have:
            line += [f"{row['camera_rays']['Mrays_per_s'][f'visray {n}']:.2f}" for n in ("picture", "intersecting")]
        line += [f"{row['wrong'][n]['wrong']} of {row['wrong'][n]['checked']}" for n in tested]
        lines.append(line)
    widths = [max(map(len, column)) for column in zip(*lines)]
    return "\n".join("  ".join(cell.rjust(w) for cell, w in zip(line, widths)) for line in lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, help="a JSON file")
    parser.add_argument("--surfaces", default=",".join(DEFAULT), help=f"of {', '.join(SURFACES)}")
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--peers", action="store_true", help="without visray")
    parser.add_argument("--pictures", type=Path, help="a folder for the pictures, side by side")
    chosen = parser.parse_args()
    names = chosen.surfaces.split(",")
    if unknown := set(names) - set(SURFACES):
        parser.error(f"--surfaces: {', '.join(sorted(unknown))}: choose from {', '.join(SURFACES)}")
    have = {name for name, program in {"povray": POVRAY, "surf": SURF}.items() if shutil.which(program)}
    for name in sorted({"povray", "surf"} - have):
        print(f"{name} is not installed: left out")
    if not chosen.peers:
        have.add("visray")
    dr.set_thread_count(THREADS)
    report = machine() | versions(have) | {"size": SIZE, "size_of_camera_rays": LARGE, "runs": chosen.runs}
    rows = []
    with tempfile.TemporaryDirectory() as name_of_folder:
        folder = Path(name_of_folder)
        for name in names:
            surface = SURFACES[name]
            rows.append({
                "surface": name,
                "degree": surface.degree,
                "shaded": shaded(surface, folder, chosen.runs, have),
                "camera_rays": bare(surface, folder, chosen.runs, have),
                "wrong": wrong_pixels(surface, folder, have),
            })  # fmt: skip
            print(f"{name} is done", file=sys.stderr)
            if chosen.pictures:
                side_by_side(surface, folder, have, chosen.pictures / f"{name}.png")
    print(table(rows, have))
    if chosen.output:
        chosen.output.write_text(json.dumps(report | {"surfaces": rows}, indent=2) + "\n")


if __name__ == "__main__":
    main()
