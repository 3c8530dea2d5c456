"""An environment map in visray and in Mitsuba's `envmap`, in one run: seen directly, in a mirror ball, through a glass
ball of exact Fresnel reflection, and as the light of a matte ball.

    python reference/envmap_mitsuba.py -o reference/envmap_mitsuba.json

Both render the same view of the same file, scenes/textures/dusk.exr. Mitsuba gets the map with its rows at the poles
and turned by 180 degrees, since its pixels and its zero are elsewhere (visray/study/mitsuba/mitsuba_environment.py).

For each case: the mean over all pixels of visray's picture minus Mitsuba's, by channel, in units of Mitsuba's mean; the
noise of this number (one standard deviation), from several pictures with other seeds; and the root mean square
difference of single pixels.
"""

import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import mitsuba as mi
import numpy as np
from machine import machine
from report import report_parser, write_report

from visray.study.mitsuba.blinn_phong_bsdf import VARIANT
from visray.study.mitsuba.mitsuba_environment import envmap

MAP = Path(__file__).resolve().parents[1] / "scenes" / "textures" / "dusk.exr"
SIZE, SPP, SEEDS, SKY_RAYS, DEPTH = (96, 72), 1024, 64, 1, 32
SKY = vr.EnvironmentMap(str(MAP), rotation=25.0, intensity=1.5)
BLACK, WHITE, GREY = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.5, 0.4, 0.3)
EYE, FOV = (0.0, 1.2, 5.0), 40.0
MATERIALS = {
    "mirror": vr.Material(kd=BLACK, ka=BLACK, kr=WHITE),
    "glass": vr.Material(kd=BLACK, ka=BLACK, kr=WHITE, kt=WHITE, ior=1.5, fresnel="dielectric"),
    "matte": vr.Material(kd=BLACK, ka=GREY),
}
BSDFS = {
    "mirror": {"type": "conductor", "material": "none"},
    "glass": {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0},
    "matte": {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(GREY)}}},
}
# For each case, the material of the ball; None: there is none.
CASES = {"seen directly": None, "mirror ball": "mirror", "glass ball": "glass", "matte ball": "matte"}


def ours(material: str | None) -> vr.Scene:
    """The scene of a case. With a matte ball, sky rays bring the light of the map."""
    light = {"sky": SKY_RAYS, "light": "background"} if material == "matte" else {}
    return vr.Scene(
        camera=vr.Camera(origin=EYE, target=(0, 0, 0), fov=FOV),
        film=vr.Film(width=SIZE[0], height=SIZE[1]),
        background=SKY,
        ambient=BLACK,
        lights={},
        materials={material: MATERIALS[material]} if material else {},
        objects={"ball": vr.Sphere(center=(0, 0, 0), radius=1.2, material=material)} if material else {},
        settings=vr.Settings(spp=SPP, depth=DEPTH, occlusion=vr.Occlusion(**light)),
    )


def theirs(material: str | None) -> mi.Scene:
    """The same scene for Mitsuba. A path ends after as many surfaces as in visray; at a matte ball after one."""
    depth = {"matte": 2, None: 1}.get(material, DEPTH + 1)
    view = mi.ScalarTransform4f().look_at(origin=list(EYE), target=[0, 0, 0], up=[0, 1, 0])
    film = {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1], "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    ball = {"type": "sphere", "center": [0, 0, 0], "radius": 1.2}
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": depth, "rr_depth": 1000},
            "sensor": {"type": "perspective", "fov": FOV, "fov_axis": "y", "to_world": view, "film": film},
            "sky": envmap(SKY),
        }
        | ({"ball": ball | {"bsdf": BSDFS[material]}} if material else {})
    )


def pictures(material: str | None) -> tuple[np.ndarray, np.ndarray]:
    """Pictures with several seeds, by visray and by Mitsuba. Shapes: (SEEDS, H, W, 3) each."""
    mitsuba, scene = theirs(material), ours(material)
    seeds = range(1, SEEDS + 1)
    here = [
        vr.render(replace(scene, settings=replace(scene.settings, seed=i)), progress=False).layers["RGB"] for i in seeds
    ]
    there = [np.array(mi.render(mitsuba, spp=SPP, seed=i)) for i in seeds]
    return np.array(here, float), np.array(there, float)


def compared(material: str | None) -> dict:
    """The numbers of a case."""
    here, there = pictures(material)
    means = [x.mean((1, 2)) for x in (here, there)]
    noise = np.sqrt(sum(x.var(0, ddof=1) / SEEDS for x in means))
    mean, both = means[1].mean(0), np.array([here.mean(0), there.mean(0)])
    return {
        "mean": [round(float(x), 6) for x in mean],
        "difference": [float(f"{x:.3g}") for x in (means[0].mean(0) - mean) / mean],
        "noise": [float(f"{x:.3g}") for x in noise / mean],
        "rms of pixels": float(f"{math.sqrt(np.square(both[0] - both[1]).mean()) / mean.mean():.3g}"),
    }


def main() -> int:
    chosen = report_parser(__doc__).parse_args()
    mi.set_variant(VARIANT)
    cases = {}
    for name, material in CASES.items():
        cases[name] = compared(material)
        sys.stdout.write(f"{name}: {json.dumps(cases[name])}\n")
    facts = {"size": SIZE, "samples per pixel": SPP, "pictures": SEEDS, "map": MAP.name, "rotation": SKY.rotation}
    write_report(machine() | facts | {"cases": cases}, chosen.output)
    off = [n for n, x in cases.items() if any(abs(d) > 4 * e + 1e-5 for d, e in zip(x["difference"], x["noise"]))]
    if off:
        sys.stdout.write(f"beyond four times the noise: {', '.join(off)}\n")
    return int(bool(off))


if __name__ == "__main__":
    sys.exit(main())
