"""Glass by visray and by Mitsuba, under the same camera and the same light: `fresnel` and `absorption` against
Mitsuba's `dielectric`, `thindielectric`, and a homogeneous absorbing medium.

    python reference/fresnel_mitsuba.py -o reference/fresnel_mitsuba.json

The light is a board of unlit squares (area emitters in Mitsuba) in constant light. In front of it is a ball, a slab or
a pane of glass, a ball of diamond, a ball that absorbs, or a bubble of air in glass. Both programs render each scene
RUNS times with different seeds. From the spread of the runs come the standard error of each pixel, and that of the mean
of the picture.

Reported are, for each channel, the difference of the means, visray minus Mitsuba, and its standard error; and the mean
square of the differences of the pixels in their standard errors, which is about (RUNS - 1) / (RUNS - 3) if nothing but
noise differs. The exit code is 1 if a difference of means is above 4 standard errors or the mean square above LIMIT.
"""

import sys
from itertools import product

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import mitsuba as mi
import numpy as np
from machine import machine
from report import report_parser, write_report

RUNS, SPP, WIDTH, HEIGHT, DEPTH = 16, 256, 64, 48, 64
# For some thousand pixels, the mean square of differences in standard errors has a standard deviation of about 0.03.
LIMIT = (RUNS - 1) / (RUNS - 3) + 0.2
SKY = (0.5, 0.6, 0.8)
ORIGIN, TARGET, FOV = (1.2, 1.6, 5.0), (0.0, 0.1, 0.0), 34.0
COLOURS = ((1.6, 0.5, 0.2), (0.1, 0.3, 0.9))
GLASS = vr.Material(
    ka=(0.0, 0.0, 0.0), kd=(0.0, 0.0, 0.0), kr=(1.0, 1.0, 1.0), kt=(1.0, 1.0, 1.0), ior=1.5, fresnel="dielectric"
)
INK = (0.3, 1.0, 2.0)


def squares() -> list[tuple[float, float, tuple]]:
    """Centres (x, z) of the squares of the board, and their colours. Each has sides of 1 and lies at y = -1.5."""
    return [(i - 2.5, k - 4.5, COLOURS[(i + k) % 2]) for i, k in product(range(6), range(8))]


def of_visray(objects: dict, materials: dict, seed: int) -> np.ndarray:
    """The picture by visray. Shapes: (H, W, 3)."""
    board = {}
    for number, (x, z, colour) in enumerate(squares()):
        name = f"square {number}"
        materials = materials | {name: vr.Material(kd=colour, shading="unlit")}
        board[name] = vr.Rectangle(center=(x, -1.5, z), width=(1.0, 0.0, 0.0), height=(0.0, 0.0, -1.0), material=name)
    scene = vr.Scene(
        camera=vr.Camera(origin=ORIGIN, target=TARGET, fov=FOV),
        film=vr.Film(width=WIDTH, height=HEIGHT),
        background=SKY,
        ambient=(0.0, 0.0, 0.0),
        materials=materials,
        objects=objects | board,
        lights={},
        settings=vr.Settings(spp=SPP, seed=seed, depth=DEPTH, sampler="independent"),
    )
    return np.asarray(vr.render(scene, progress=False).layers["RGB"], float)


def of_mitsuba(shapes: dict, seed: int, integrator: str = "path") -> np.ndarray:
    """The picture by Mitsuba. Shapes: (H, W, 3)."""
    board, up = {}, mi.ScalarTransform4f().rotate([1, 0, 0], -90)
    for number, (x, z, colour) in enumerate(squares()):
        board[f"square{number}"] = {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().translate([x, -1.5, z]) @ up @ mi.ScalarTransform4f().scale(0.5),
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}},
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": list(colour)}},
        }
    camera = {
        "type": "perspective", "fov": FOV, "fov_axis": "y",
        "to_world": mi.ScalarTransform4f().look_at(origin=ORIGIN, target=TARGET, up=[0, 1, 0]),
        "film": {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"},
                 "component_format": "float32"},
        "sampler": {"type": "independent"},
    }  # fmt: skip
    scene = mi.load_dict({
        "type": "scene", "sensor": camera, "sky": {"type": "constant", "radiance": {"type": "rgb", "value": list(SKY)}},
        "integrator": {"type": integrator, "max_depth": DEPTH + 2, "rr_depth": 1000}, **shapes, **board,
    })  # fmt: skip
    return np.array(mi.render(scene, spp=SPP, seed=seed), float)[..., :3]


def dielectric(ior: float, outside: float = 1.0) -> dict:
    """Mitsuba's glass."""
    return {"type": "dielectric", "int_ior": ior, "ext_ior": outside}


def cases() -> dict[str, tuple[dict, dict, dict, str]]:
    """For each scene: objects and materials of visray, shapes and integrator of Mitsuba."""
    ball, glass = {"ball": vr.Sphere(material="glass")}, {"glass": GLASS}
    sphere = {"type": "sphere", "bsdf": dielectric(1.5)}
    turn = mi.ScalarTransform4f().rotate([0, 1, 0], 25)
    half = (1.2, 1.0, 0.25)
    slab = vr.Box(min=tuple(-x for x in half), max=half, material="glass", transform=(vr.Rotate(rotate=25.0),))
    pane = vr.Rectangle(width=(2.4, 0.0, 0.0), height=(0.0, 2.0, 0.0), material="glass",
                        transform=(vr.Rotate(rotate=25.0),))  # fmt: skip
    # Mitsuba takes colours up to 1 here, times a scale.
    half_ink = {"type": "rgb", "value": [x / 2 for x in INK]}
    medium = {"type": "homogeneous", "albedo": 0.0, "sigma_t": half_ink, "scale": 2.0}
    ink = vr.Material(**{f: getattr(GLASS, f) for f in ("ka", "kd", "kr", "kt", "ior", "fresnel")}, absorption=INK)
    bubble = vr.Material(**{f: getattr(GLASS, f) for f in ("ka", "kd", "kr", "kt", "fresnel")}, ior=1.0)
    return {
        "ball of glass": (ball, glass, {"ball": sphere}, "path"),
        "ball of diamond": (
            ball, {"glass": vr.Material(ka=GLASS.ka, kd=GLASS.kd, kr=GLASS.kr, kt=GLASS.kt, ior=2.417,
                                        fresnel="dielectric")},
            {"ball": sphere | {"bsdf": dielectric(2.417)}}, "path",
        ),
        "slab of glass": (
            {"slab": slab}, glass,
            {"slab": {"type": "cube", "bsdf": dielectric(1.5),
                      "to_world": turn @ mi.ScalarTransform4f().scale(list(half))}}, "path",
        ),
        "thin pane": (
            {"pane": pane}, glass,
            {"pane": {"type": "rectangle", "bsdf": {"type": "thindielectric", "int_ior": 1.5, "ext_ior": 1.0},
                      "to_world": turn @ mi.ScalarTransform4f().scale([1.2, 1.0, 1.0])}}, "path",
        ),
        "bubble in a ball of glass": (
            ball | {"bubble": vr.Sphere(center=(0.1, 0.2, 0.0), radius=0.6, material="air")}, glass | {"air": bubble},
            {"ball": sphere, "bubble": {"type": "sphere", "center": [0.1, 0.2, 0.0], "radius": 0.6,
                                        "bsdf": dielectric(1.0, 1.5)}}, "path",
        ),
        "ball that absorbs": (ball, {"glass": ink}, {"ball": sphere | {"interior": medium}}, "volpath"),
    }  # fmt: skip


def compared(ours: np.ndarray, theirs: np.ndarray) -> dict:
    """The differences of one scene. Shapes of both: (RUNS, H, W, 3)."""
    means = ours.mean((1, 2)), theirs.mean((1, 2))
    difference = means[0].mean(0) - means[1].mean(0)
    error = np.sqrt(sum(m.var(0, ddof=1) / len(m) for m in means))
    apart = ours.mean(0) - theirs.mean(0)
    of_pixel = np.sqrt(sum(x.var(0, ddof=1) / len(x) for x in (ours, theirs)))
    noisy = of_pixel > 1e-6
    scaled = apart / np.where(noisy, of_pixel, np.inf)
    square = [float(np.mean(scaled[..., k][noisy[..., k]] ** 2)) for k in range(3)]
    return {
        "mean": means[0].mean(0).tolist(),
        "difference": difference.tolist(),
        "standard_error": error.tolist(),
        "in_standard_errors": (difference / error).tolist(),
        "mean_square_of_pixels": square,
        "largest_without_noise": float(np.abs(apart[~noisy]).max(initial=0)),
        "noisy_pixels": int(noisy.all(-1).sum()),
    }


def main() -> int:
    parser = report_parser(__doc__)
    chosen = parser.parse_args()
    mi.set_variant("llvm_ad_rgb")
    scenes, passed = {}, True
    for name, (objects, materials, shapes, integrator) in cases().items():
        ours = np.stack([of_visray(objects, materials, seed) for seed in range(RUNS)])
        theirs = np.stack([of_mitsuba(shapes, 1000 + seed, integrator) for seed in range(RUNS)])
        scenes[name] = found = compared(ours, theirs)
        sys.stderr.write(f"{name}: {np.round(found['in_standard_errors'], 2)}, {found['mean_square_of_pixels']}\n")
        passed &= max(np.abs(found["in_standard_errors"])) < 4 and max(found["mean_square_of_pixels"]) < LIMIT
    setup = {"runs": RUNS, "spp": SPP, "width": WIDTH, "height": HEIGHT, "depth": DEPTH}
    write_report(machine() | setup | {"scenes": scenes, "passed": bool(passed)}, chosen.output)
    return 0 if passed else 1


if __name__ == "__main__":
    raise SystemExit(main())
