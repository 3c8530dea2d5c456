"""The speed of visray and of Mitsuba on rays without a shared origin: a plane and a mesh, a plane and spheres.

    python reference/bench_incoherent.py -o reference/bench_incoherent.json

Pictures, 512 x 512 pixels, 2 threads, medians of 7 by turns in one process with compiled kernels:

    occlusion  16 occlusion rays over the hemisphere above each point that the camera sees; no lights
    mirror     the mesh or the spheres are mirrors; at most 3 reflections; a point light with hard shadows
    lens       a camera with a lens; a point light with hard shadows
    panel      a rectangle light that is sampled 16 times at each point

Mitsuba takes `direct` for the lens and the panel. For the occlusion rays and the mirror it has no integrator that does
the same as visray's, such as to end paths at matte surfaces, so two are written here. It finds triangles with Embree.
In all other ways the scenes are those of bench_mitsuba.py.

Spheres are put in the kernel's tables as arrays, because 100,000 Python objects would take long to check.
"""

import statistics
import sys
import time
from dataclasses import replace

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import drjit as dr
import mitsuba as mi
import numpy as np
from machine import machine
from report import report_parser, write_report

from visray.columns import NO_TEXTURE, Columns, Names
from visray.features import features
from visray.kernel_scene import kernel_scene
from visray.pack import pack
from visray.passes import expose
from visray.quantities import Arrays, record
from visray.setup import Prepared, lanes

SIZE, RUNS, THREADS, DEPTH, RAYS, APERTURE = 512, 7, 2, 3, 16, 0.4
EYE, TARGET, LAMP, FOV = (0.0, 5.0, 9.0), (0.0, 0.5, 0.0), (4.0, 8.0, 5.0), 40.0
PICTURES = ("occlusion", "mirror", "lens", "panel")
BODIES = {"mesh": (10_000, 160_000, 1_000_000), "spheres": (100, 1000, 10_000, 100_000)}
PANEL = vr.RectangleLight(position=LAMP, width=(2.0, 0.0, 0.0), height=(0.0, 0.0, 2.0), samples=RAYS)
# Samples per pixel: fewer where a sample has 16 rays, so that all pictures take about as long.
SPP = {"occlusion": 4, "mirror": 16, "lens": 16, "panel": 4}


def ball(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A bumpy ball of about n triangles: (vertices, faces). Shapes: (vertices, 3), (faces, 3)."""
    rows = round((n / 4) ** 0.5)
    columns = 2 * rows
    polar, turn = np.meshgrid(
        np.linspace(0, np.pi, rows + 1), np.linspace(0, 2 * np.pi, columns, endpoint=False), indexing="ij"
    )
    radius = 2.2 * (1 + 0.06 * np.sin(9 * polar) * np.cos(11 * turn) + 0.02 * np.sin(31 * polar) * np.sin(29 * turn))
    d = np.stack([np.sin(polar) * np.cos(turn), np.cos(polar), np.sin(polar) * np.sin(turn)], -1)
    vertices = ((0, 2.4, 0) + radius[..., None] * d).reshape(-1, 3)
    row, column = np.arange(rows)[:, None] * columns, np.arange(columns)[None]
    after = (column + 1) % columns
    a, b, c, e = ((row + x).ravel() for x in (column, after, columns + column, columns + after))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([b, e, c], 1)])
    p = vertices[faces]
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    return vertices, faces[area > 1e-14 * radius.max()]  # without the flat triangles at the poles


def cloud(n: int) -> tuple[np.ndarray, np.ndarray]:
    """n random spheres as in bench_mitsuba.py: (centres, radii). Shapes: (n, 3), (n)."""
    rng = np.random.default_rng(n)
    return rng.uniform((-4, 0.1, -4), (4, 3, 4), (n, 3)), rng.uniform(0.3, 0.9, n) * 2.2 / n ** (1 / 3)


def scene(body: str, n: int, picture: str) -> vr.Scene:
    """The scene for visray. It has a single sphere in the place of all spheres. body: one of BODIES."""
    thing = vr.Sphere(material="paint")
    if body == "mesh":
        vertices, faces = ball(n)
        thing = vr.Mesh(vertices=vertices, faces=faces, normals="face", solid=False, material="paint")
    material = {"kd": (0.0, 0.0, 0.0), "ka": (0.0, 0.0, 0.0), "kr": (0.9, 0.9, 0.9)} if picture == "mirror" else {}
    light = {"panel": {"key": PANEL}, "occlusion": {}}.get(picture, {"key": vr.PointLight(position=LAMP)})
    return vr.Scene(
        camera=vr.Camera(origin=EYE, target=TARGET, fov=FOV, aperture=APERTURE if picture == "lens" else 0.0),
        film=vr.Film(width=SIZE, height=SIZE),
        materials={"grey": vr.Material(kd=(0.5, 0.5, 0.5)), "paint": vr.Material(**material)},
        objects={"floor": vr.Plane(material="grey"), "body": thing},
        lights=light,
        settings=vr.Settings(
            spp=SPP[picture], depth=DEPTH, occlusion=vr.Occlusion(sky=RAYS if picture == "occlusion" else 0)
        ),
    )


def many_spheres(a: Arrays, n: int, columns: Columns) -> Columns:
    """The columns of n spheres. columns: those of the sphere in their place."""
    centres, radii = cloud(n)
    numbers = record(columns.kind, {"center": a.put(a.W, centres.T), "radius": a.put(a.D, radii)})
    material, thing = (int(np.array(x)[0]) for x in (columns.material, columns.object))
    material, texture, thing = (a.put(a.U, np.full(n, x, np.uint32)) for x in (material, NO_TEXTURE, thing))
    names = Names(prefix="sphere ", numbers=np.arange(n))
    return replace(columns, names=names, numbers=numbers, material=material, texture=texture, object=thing)


def prepared(body: str, n: int, picture: str) -> Prepared:
    """visray's scene with all spheres."""
    simple, a = scene(body, n, picture), Arrays.of("llvm", "single")
    effects, packed = features(simple), pack(simple, a)
    if body == "spheres":
        packed = replace(packed, batches=(packed.batches[0], many_spheres(a, n, packed.batches[1])))
    kernel = kernel_scene(packed, simple, effects, a, None)
    return Prepared(simple, a, effects, packed, kernel, *lanes(a, simple.film), ())


def register_integrators() -> None:
    """Registers two integrators of Mitsuba. Their classes can only be defined once Mitsuba has a variant.

    `occlusion rays`: the share of RAYS rays from each point that hit nothing; 1 where the camera's ray hits nothing.
    `mirrors`: light of point lights, with shadows, on the first surface that is no mirror, after DEPTH mirrors at most.
    """

    class OcclusionRays(mi.SamplingIntegrator):
        def __init__(self, properties):
            super().__init__(properties)
            self.rays = dr.opaque(mi.UInt32, RAYS)

        def sample(self, scene, sampler, ray, medium=None, active=True):
            si = scene.ray_intersect(ray, active)
            hit = active & si.is_valid()
            frame = mi.Frame3f(dr.select(dr.dot(si.n, ray.d) > 0, -si.n, si.n))

            def step(j, free, sampler):
                d = frame.to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d(hit)))
                return j + 1, free + dr.select(scene.ray_test(si.spawn_ray(d), hit), 0.0, 1.0), sampler

            n = dr.width(ray)
            start = dr.zeros(mi.UInt32, n), dr.zeros(mi.Float, n), sampler
            _, free, _ = dr.while_loop(start, lambda j, *_: (j < self.rays) & hit, step, label="occlusion rays")
            return mi.Color3f(dr.select(hit, free / RAYS, 1.0)), hit, []

        def to_string(self):
            return "OcclusionRays[]"

    class Mirrors(mi.SamplingIntegrator):
        def __init__(self, properties):
            super().__init__(properties)
            self.depth = dr.opaque(mi.UInt32, DEPTH)

        def sample(self, scene, sampler, ray, medium=None, active=True):
            context, n = mi.BSDFContext(), dr.width(ray)

            def step(ray, depth, weight, colour, active):
                si = scene.ray_intersect(ray, active)
                active &= si.is_valid()
                bsdf = si.bsdf(ray)
                mirror = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.DeltaReflection)
                matte = active & ~mirror
                light, emitted = scene.sample_emitter_direction(si, mi.Point2f(0.5), True, matte)
                value = bsdf.eval(context, si, si.to_local(light.d), matte)
                colour = dr.select(matte, weight * value * emitted, colour)
                reflected = si.spawn_ray(si.to_world(mi.reflect(si.wi)))
                return (
                    reflected,
                    depth + 1,
                    dr.select(mirror, 0.9 * weight, weight),
                    colour,
                    mirror & (depth < self.depth),
                )

            start = mi.Ray3f(ray), dr.zeros(mi.UInt32, n), dr.full(mi.Color3f, 1, n), dr.zeros(mi.Color3f, n)
            state = *start, mi.Bool(active) & dr.full(mi.Bool, True, n)
            return dr.while_loop(state, lambda *s: s[-1], step, label="mirrors")[3], mi.Bool(active), []

        def to_string(self):
            return "Mirrors[]"

    mi.register_integrator("occlusion rays", OcclusionRays)
    mi.register_integrator("mirrors", Mirrors)


def theirs(body: str, n: int, picture: str) -> "mi.Scene":
    """The same scene for Mitsuba. Its floor is a large rectangle, because Mitsuba has no infinite plane."""
    to_world = mi.ScalarTransform4f
    grey, paint = ({"type": "diffuse", "reflectance": {"type": "rgb", "value": x}} for x in (0.5, 0.7))
    if picture == "mirror":
        paint = {"type": "conductor", "specular_reflectance": {"type": "rgb", "value": 0.9}}
    integrator = {
        "occlusion": {"type": "occlusion rays"},
        "mirror": {"type": "mirrors"},
        "lens": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0, "hide_emitters": True},
        "panel": {"type": "direct", "emitter_samples": RAYS, "bsdf_samples": 0, "hide_emitters": True},
    }
    lamp = {"type": "point", "position": LAMP, "intensity": 100.0}
    if picture == "panel":
        facing_down = to_world().translate(LAMP).rotate((1, 0, 0), 90)
        emitter = {"type": "area", "radiance": {"type": "rgb", "value": 25.0}}
        lamp = {"type": "rectangle", "to_world": facing_down, "emitter": emitter}
    lens = {"type": "perspective"}
    if picture == "lens":
        lens = {"type": "thinlens", "aperture_radius": APERTURE / 2}
        lens["focus_distance"] = float(np.linalg.norm(np.subtract(TARGET, EYE)))
    result = {
        "type": "scene",
        "integrator": integrator[picture],
        "sensor": lens
        | {
            "fov": FOV,
            "fov_axis": "y",
            "to_world": to_world().look_at(EYE, TARGET, (0, 1, 0)),
            "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent"},
        },
        "floor": {"type": "rectangle", "to_world": to_world().rotate((1, 0, 0), -90).scale(100), "bsdf": grey},
    }
    if picture != "occlusion":
        result["lamp"] = lamp
    if body == "spheres":
        for i, (centre, radius) in enumerate(zip(*cloud(n))):
            result[f"ball{i}"] = {"type": "sphere", "center": centre.tolist(), "radius": radius, "bsdf": paint}
    else:
        vertices, faces = ball(n)
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict(paint)
        mesh = mi.Mesh("body", len(vertices), len(faces), props=properties)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = mi.Float(vertices.astype(np.float32).ravel())
        parameters["faces"] = mi.UInt32(faces.astype(np.uint32).ravel())
        parameters.update()
        result["body"] = mesh
    return mi.load_dict(result)


def seconds(work) -> float:
    """The wall-clock time of a call."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def compared(body: str, n: int, picture: str, runs: int = RUNS) -> dict:
    """A dict with median seconds of both programs, which alternate; each render has a new seed.

    ratio: Mitsuba's time divided by visray's. runs: renders of each program.
    """
    before = time.perf_counter()
    ours = prepared(body, n, picture)
    dr.sync_thread()
    build, mitsuba_scene, seed = time.perf_counter() - before, theirs(body, n, picture), iter(range(1000))

    def visray() -> None:
        settings = replace(ours.scene.settings, seed=next(seed))
        expose(replace(ours, scene=replace(ours.scene, settings=settings)))

    def mitsuba() -> None:
        dr.eval(mi.render(mitsuba_scene, spp=SPP[picture], seed=next(seed)))
        dr.sync_thread()

    for work in (visray, mitsuba, visray, mitsuba):
        work()
    times = [(seconds(visray), seconds(mitsuba)) for _ in range(runs)]
    a, b = (statistics.median(t) for t in zip(*times))
    return {
        "body": body,
        "rows": n,
        "picture": picture,
        "visray_s": a,
        "mitsuba_s": b,
        "ratio": b / a,
        "ratio_range": [min(y / x for x, y in times), max(y / x for x, y in times)],
        "prepare_s": build,
    }


def main() -> None:
    parser = report_parser(__doc__)
    parser.add_argument("--bodies", nargs="+", default=list(BODIES), choices=list(BODIES))
    parser.add_argument("--counts", nargs="+", type=int, help="numbers of rows; all of BODIES without it")
    parser.add_argument("--pictures", nargs="+", default=PICTURES, choices=PICTURES)
    parser.add_argument("--runs", type=int, default=RUNS)
    chosen = parser.parse_args()
    mi.set_variant("llvm_ad_rgb")
    dr.set_thread_count(THREADS)
    register_integrators()
    report = machine() | {"size": SIZE, "spp": SPP, "pictures": []}
    for body in chosen.bodies:
        for n in BODIES[body]:
            for picture in chosen.pictures if not chosen.counts or n in chosen.counts else ():
                report["pictures"].append(result := compared(body, n, picture, chosen.runs))
                print(f"{body} {n} {picture}: ratio {result['ratio']:.2f}", file=sys.stderr, flush=True)
    write_report(report, chosen.output)


if __name__ == "__main__":
    main()
