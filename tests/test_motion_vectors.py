"""Motion vectors lead from a pixel to where the same point of the surface is in the next frame."""

import json
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
import OpenEXR
import pytest
from samples import SAMPLES, shifted

import visray as vr
from visray.animation.moment import assignments
from visray.camera import Camera, OrthographicCamera
from visray.data.base import GlobeBase, MapBase
from visray.data.gizmos import GIZMOS
from visray.errors import UserError
from visray.integrator import first_hit
from visray.motion_vectors import forward, next_frame
from visray.primitives import KINDS, Box, Capsule, Csg, Cylinder, Instance, Mesh, Polynomial, Sphere, Torus
from visray.primitives.clips import Ball, Block
from visray.primitives.mesh import FitBox
from visray.projection import projected
from visray.quantities import quantities
from visray.scene.check import checked
from visray.scene.scene import Film, Scene, Settings
from visray.setup import Prepared, prepare
from visray.surface_motion import motion
from visray.textures import ImageTexture
from visray.transforms import Matrix, Rotate, Translate, compose
from visray.written_out import written_out

NAMES = [kind.__name__ for kind in KINDS]
FILM = Film(width=32, height=24)
# Its axes, and half its view over its distance, are whole numbers.
PLAIN = Camera(origin=(0.0, 0.0, 2.0), target=(0.0, 0.0, 0.0), fov=90.0)
VIEW = Camera(origin=(1.0, 1.5, 4.0), target=(0.1, 0.1, 0.0), fov=30.0)
FLAT = OrthographicCamera(origin=(1.0, 1.5, 4.0), target=(0.1, 0.1, 0.0), height=2.5)
CAMERAS = {"perspective": VIEW, "orthographic": FLAT}


def scene_of(objects: dict, camera: Any = VIEW, film: Film = FILM, **more: Any) -> Scene:
    more = {"lights": {}, "settings": Settings(spp=1, precision="double")} | more
    return Scene(camera=camera, film=film, objects=objects, **more)


@dataclass
class Look:
    """Motion vectors between two scenes. Lanes are pixels in any order.

    now, after: the prepared scenes
    x, y: centre of each pixel
    hit: layers of the first hit, in NumPy
    vectors: (2, N)
    """

    now: Prepared
    after: Prepared
    x: np.ndarray
    y: np.ndarray
    hit: dict[str, np.ndarray]
    vectors: np.ndarray

    @classmethod
    def of(cls, scene: Scene, after: Scene) -> "Look":
        now = replace(prepare(scene), after=after)
        n = len(now.order)
        layers = first_hit(now.kernel, now.x, now.y)
        row, column = np.divmod(now.order, scene.film.width)
        return cls(now, prepare(after), column + 0.5, row + 0.5, in_numpy(layers, n), pair_of(forward(now, layers), n))

    @property
    def seen(self) -> np.ndarray:
        return self.hit["id"] > 0

    def arrivals(self) -> dict[str, np.ndarray]:
        """The layers of the next frame along rays through the places to which the vectors lead."""
        a = self.after.a
        x, y = (a.put(a.D, v) for v in (self.x + self.vectors[0] - 0.5, self.y + self.vectors[1] - 0.5))
        return in_numpy(first_hit(self.after.kernel, x, y), len(self.x))

    def points_after(self) -> np.ndarray:
        """The points that are seen, at the next moment."""
        moves = motion(self.now.a, self.now.scene, self.after.scene, self.hit["P"].T.astype(float), self.hit["id"])
        of_lane = moves.matrices[moves.slot[self.hit["id"]]]
        return np.einsum("nij,nj->ni", of_lane[:, :3, :3], moves.points) + of_lane[:, :3, 3]


def pair_of(vectors: tuple, n: int) -> np.ndarray:
    return np.stack([np.broadcast_to(np.array(v, float), n) for v in vectors])


def in_numpy(layers: dict, n: int) -> dict[str, np.ndarray]:
    found = {}
    for name, value in layers.items():
        flat = np.stack([np.array(v) for v in value]) if isinstance(value, tuple) else np.array(value)
        found[name] = np.broadcast_to(flat, (*flat.shape[:-1], n))
    return found


def in_front(thing: Any) -> Any:
    """A sample of a kind, where its front is seen."""
    return SAMPLES[thing].posed


# A turn by the angle whose sine is 3/5, a squeeze and a shift: exact in doubles but for the roundings of 0.6 and 0.8.
TURN = (
    (Fraction(4, 5), Fraction(0), Fraction(3, 5), Fraction(1, 8)),
    (Fraction(0), Fraction(3, 4), Fraction(0), Fraction(-1, 16)),
    (Fraction(-3, 5), Fraction(0), Fraction(4, 5), Fraction(1, 4)),
)


def exactly_projected(p: list[Fraction]) -> tuple[Fraction, Fraction]:
    """Where the camera PLAIN sees a point."""
    depth, half = 2 - p[2], Fraction(FILM.height, 2)
    return Fraction(FILM.width, 2) + p[0] / depth * half, half - p[1] / depth * half


@pytest.mark.parametrize("name", NAMES)
def test_a_transform_moves_each_kind_as_exact_arithmetic_says(name: str) -> None:
    thing = in_front(name)
    steps = (*thing.transform, Matrix(matrix=tuple(tuple(map(float, row)) for row in TURN)))
    look = Look.of(scene_of({"it": thing}, PLAIN), scene_of({"it": replace(thing, transform=steps)}, PLAIN))
    assert look.seen.sum() > 20
    # Matrices of a kind multiply some ten numbers about as large as the picture is wide; their inverse is a little off.
    bound = 1e3 * FILM.width * np.finfo(float).eps
    for lane in np.flatnonzero(look.seen):
        p = [Fraction(float(x)) for x in look.hit["P"][:, lane]]
        moved = [sum(m * x for m, x in zip(row, p)) + row[3] for row in TURN]
        here, there = exactly_projected(p), exactly_projected(moved)
        for got, before, behind in zip(look.vectors[:, lane], here, there):
            assert abs(got - float(behind - before)) <= bound * max(1, abs(float(p[0])), abs(float(p[2])))
    assert np.abs(look.vectors[:, look.seen]).max() > 0.5


def moved_fields(thing: Any, by: np.ndarray) -> Any:
    """The object with its points moved, by its own fields."""
    if isinstance(thing, Mesh):
        corners = thing.vertices.values
        ends = [tuple(map(float, f(axis=0) + by + pad)) for f, pad in ((corners.min, -1e-9), (corners.max, 1e-9))]
        return replace(thing, fit=FitBox(low=ends[0], high=ends[1]))
    return shifted(thing, by)


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("name", NAMES)
def test_each_kind_follows_its_points(name: str, camera: str) -> None:
    by = np.array([0.06, -0.04, 0.08])
    thing = in_front(name)
    now, after = (scene_of({"it": x}, CAMERAS[camera]) for x in (thing, moved_fields(thing, by)))
    look = Look.of(now, after)
    p, moved = look.hit["P"].T[look.seen], look.points_after()[look.seen]
    assert len(p) > 20
    if thing.kind.flows:
        # A surface without a frame moves along its normal. Here it is a ball.
        centre, radius = np.array(thing.clip.center) + by, thing.parameters["r"]
        assert np.abs(np.linalg.norm(moved - centre, axis=1) - radius).max() < 1e-12
        n = look.hit["N"].T[look.seen]
        along = ((moved - p) * n).sum(axis=1)
        assert np.abs((moved - p) - along[:, None] * n).max() < np.dot(by, by)  # as it bends
        assert np.abs(along - n @ by).max() < np.dot(by, by)
        return
    assert np.abs(moved - (p + by)).max() < 1e-8
    here, there = projected(now, p), projected(after, p + by)
    shift = np.stack([there.x - here.x, there.y - here.y])
    assert np.abs(look.vectors[:, look.seen] - shift).max() < 1e-6
    assert np.abs(shift).max() > 0.3


def changed(thing: Any, rng: np.random.Generator) -> Any:
    """The object with all its numbers changed a little, and a transform."""
    own = {}
    for name, q in quantities(type(thing)).items():
        old = np.array(getattr(thing, name), float)
        new = old * rng.uniform(0.94, 1.06, q.size) + (rng.uniform(-0.04, 0.04, q.size) if q.size == 3 else 0)
        if q.unit.endswith("> 0"):
            new = old * rng.uniform(0.94, 1.06, q.size)
        own[name] = tuple(new.tolist()) if q.size == 3 else float(new[0])
    if isinstance(thing, Csg):
        own["of"] = tuple(changed(x, rng) for x in thing.of)
    turn = Rotate(rotate=8.0, axis=tuple(rng.normal(size=3).tolist()))
    return replace(thing, **own, transform=(*thing.transform, turn, Translate(translate=(0.05, 0.02, -0.03))))


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("name", NAMES)
def test_the_next_frame_shows_the_same_point_where_the_vector_leads(name: str, camera: str) -> None:
    """The ray of the next frame meets the point, unless something is before it. Where it does, u and v are the same."""
    rng = np.random.default_rng(5)
    thing = in_front(name)
    after = scene_of({"it": changed(thing, rng)}, replace(CAMERAS[camera], target=(0.15, 0.05, 0.02)))
    look = Look.of(scene_of({"it": thing}, CAMERAS[camera]), after)
    seen, there, point = look.seen, look.arrivals(), look.points_after()
    off = np.linalg.norm(there["P"].T - point, axis=1)
    met = seen & (there["id"] == 1) & (off < 1e-6)
    # Some have turned away from the camera, or are behind another part.
    assert met.sum() > 0.85 * seen.sum()
    before = seen & ~met & (there["id"] == 1)
    eye = np.array(after.camera.origin)
    if camera == "perspective":
        assert (there["distance"][before] < np.linalg.norm(point[before] - eye, axis=1) + 1e-6).all()
    # A ray to a point of the surface misses only where it touches an edge or the outline.
    assert (seen & (there["id"] == 0)).sum() <= 2
    if not thing.kind.flows:
        jump = np.abs(there["UV"] - look.hit["UV"])[:, met]
        assert np.minimum(jump, np.abs(1 - jump)).max() < 1e-6


@pytest.mark.parametrize("camera", CAMERAS)
def test_nothing_moves_in_a_still_scene(camera: str) -> None:
    things = {name: replace(SAMPLES[name].posed, transform=(Translate(translate=(0.0, 0.0, -0.3 * i)),))
              for i, name in enumerate(NAMES)}  # fmt: skip
    scene = scene_of(things, CAMERAS[camera])
    # Another scene of the same numbers.
    again = scene_of({name: replace(x) for name, x in things.items()}, replace(CAMERAS[camera]))
    look = Look.of(scene, again)
    assert look.seen.any() and not look.vectors.any()


def test_a_pan_moves_the_background_by_the_turn() -> None:
    """About the vertical axis through the camera, by the angle whose tangent is 1/8: in the middle row the pixel at
    tan(b) goes to tan(b - angle)."""
    camera = Camera(origin=(0.0, 0.0, 0.0), target=(0.0, 0.0, -8.0), fov=90.0)
    turned = replace(camera, target=(1.0, 0.0, -8.0))
    look = Look.of(scene_of({}, camera, Film(width=24, height=15)), scene_of({}, turned, Film(width=24, height=15)))
    middle = look.y == 7.5
    tangent = (look.x[middle] - 12) / 7.5
    there = 12 + 7.5 * (tangent - 1 / 8) / (1 + tangent / 8)
    assert np.abs(look.vectors[0, middle] - (there - look.x[middle])).max() < 1e-12
    assert np.abs(look.vectors[1, middle]).max() < 1e-12
    assert (look.vectors[0] < 0).all()  # the camera turns to the right, so the picture goes to the left


def test_the_background_only_moves_with_turns_and_zooms() -> None:
    by = np.array([0.3, 0.2, -0.4])
    moved = replace(VIEW, **{k: tuple((np.array(getattr(VIEW, k)) + by).tolist()) for k in ("origin", "target")})
    look = Look.of(scene_of({}), scene_of({}, moved))
    assert np.abs(look.vectors).max() < 1e-11
    zoomed = Look.of(scene_of({}), scene_of({}, replace(VIEW, fov=20.0)))
    factor = np.tan(np.radians(15)) / np.tan(np.radians(10)) - 1
    middle = FILM.width / 2, FILM.height / 2
    for got, at, m in zip(zoomed.vectors, (zoomed.x, zoomed.y), middle):
        assert np.abs(got - factor * (at - m)).max() < 1e-11
    flat = Look.of(scene_of({}, FLAT), scene_of({}, replace(FLAT, target=(0.5, 0.0, 0.0))))
    assert not flat.vectors.any()


@pytest.mark.parametrize("camera", CAMERAS)
def test_a_still_object_moves_against_the_camera(camera: str) -> None:
    after = replace(CAMERAS[camera], origin=(0.7, 1.4, 4.2), target=(0.2, 0.0, 0.1))
    look = Look.of(scene_of({"ball": Sphere()}, CAMERAS[camera]), scene_of({"ball": Sphere()}, after))
    p = look.hit["P"].T[look.seen]
    there = projected(scene_of({}, after), p)
    # P and the pixel's centre are one point of the ray but for roundings.
    shift = np.stack([there.x - look.x[look.seen], there.y - look.y[look.seen]])
    assert np.abs(look.vectors[:, look.seen] - shift).max() < 1e-10
    assert np.abs(shift).max() > 0.5


def test_what_goes_behind_the_camera_has_no_vector() -> None:
    wall = Box(min=(-50.0, -50.0, -1.0), max=(50.0, 50.0, 0.0))
    ahead = {"wall": wall, "ball": Sphere(radius=0.4, center=(0.0, 0.0, 1.0))}
    behind = ahead | {"wall": replace(wall, transform=(Translate(translate=(0.0, 0.0, 10.0)),))}
    look = Look.of(scene_of(ahead, PLAIN), scene_of(behind, PLAIN))
    of_wall = look.hit["id"] == 1
    assert of_wall.any() and not look.vectors[:, of_wall].any() and np.isfinite(look.vectors).all()
    # Exactly in the camera's plane.
    beside = ahead | {"wall": replace(wall, transform=(Translate(translate=(0.0, 0.0, 2.0)),))}
    look = Look.of(scene_of(ahead, PLAIN), scene_of(beside, PLAIN))
    assert of_wall.any() and not look.vectors[:, of_wall].any() and np.isfinite(look.vectors).all()


def test_an_object_that_is_gone_stays() -> None:
    look = Look.of(scene_of({"a": Sphere(), "b": Box()}), scene_of({"b": Box()}))
    assert look.seen.any() and not look.vectors.any()


def test_the_hole_moves_and_the_block_stays() -> None:
    """A ball that is taken away from a box, and moves in it."""
    block, ball = Box(min=(-0.8, -0.8, -0.8), max=(0.8, 0.8, 0.8)), Sphere(center=(0.1, 0.0, 0.9), radius=0.5)
    by = np.array([0.1, 0.05, 0.0])
    for dug in (
        lambda x: Csg(op="difference", of=(block, x)),
        lambda x: Csg(op="difference", of={"block": block, "hole": x}),
        lambda x: replace(block, cut=(x,)),
        lambda x: Csg(op="intersection", of=(block, Csg(op="difference", of=(Sphere(radius=5.0), x)))),
    ):
        look = Look.of(scene_of({"it": dug(ball)}), scene_of({"it": dug(shifted(ball, by))}))
        p, moved = look.hit["P"].T, look.points_after()
        hole = look.seen & (np.abs(np.linalg.norm(p - ball.center, axis=1) - ball.radius) < 1e-6)
        on_block = look.seen & (np.abs(np.abs(p).max(axis=1) - 0.8) < 1e-6)
        assert hole.sum() > 20 and on_block.sum() > 100 and (hole | on_block)[look.seen].all()
        assert np.abs(moved - p - by)[hole].max() < 1e-12 and np.abs(moved - p)[on_block & ~hole].max() == 0


def test_a_mesh_as_an_operand_moves_too() -> None:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    faces = np.array([(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6),
                      (0, 6, 4), (1, 5, 7), (1, 7, 3)])  # fmt: skip
    cube, ball = Mesh(vertices=corners, faces=faces, normals="face"), Sphere(radius=1.2)
    up = replace(cube, transform=(Translate(translate=(0.0, -0.1, 0.0)),))
    look = Look.of(*(scene_of({"it": Csg(op="intersection", of=(ball, x))}) for x in (cube, up)))
    p, moved = look.hit["P"].T, look.points_after()
    on_ball = look.seen & (np.abs(np.linalg.norm(p, axis=1) - 1.2) < 1e-6)
    flat = look.seen & ~on_ball
    assert on_ball.any() and flat.any()
    assert np.abs(moved - p)[on_ball].max() == 0 and np.abs(moved - p - [0, -0.1, 0])[flat].max() < 1e-12


def test_a_mesh_grows_with_its_fit() -> None:
    small, large = (replace(SAMPLES["Mesh"].posed, fit=size) for size in (1.5, 1.8))
    look = Look.of(scene_of({"it": small}), scene_of({"it": large}))
    p, moved = look.hit["P"].T[look.seen], look.points_after()[look.seen]
    assert len(p) > 20 and np.abs(moved - 1.2 * p).max() < 1e-12


def test_instances_and_their_geometries_move() -> None:
    pair = {"pair": Csg(op="union", of=(Sphere(radius=0.5), Sphere(center=(0.0, 0.7, 0.0), radius=0.4)))}
    turn = (Rotate(rotate=10.0, axis=(0.0, 0.0, 1.0)),)
    here, there = (scene_of({"it": Instance(geometry="pair", transform=x)}, geometries=pair) for x in ((), turn))
    look = Look.of(here, there)
    p, moved = look.hit["P"].T[look.seen], look.points_after()[look.seen]
    matrix = compose(turn)
    assert len(p) > 50 and np.abs(moved - (p @ matrix[:, :3].T + matrix[:, 3])).max() < 1e-12
    grown = {"pair": replace(pair["pair"], of=(pair["pair"].of[0], Sphere(center=(0.0, 0.8, 0.0), radius=0.4)))}
    look = Look.of(here, scene_of({"it": Instance(geometry="pair")}, geometries=grown))
    p, shift = look.hit["P"].T[look.seen], (look.points_after() - look.hit["P"].T)[look.seen]
    upper = np.abs(np.linalg.norm(p - [0, 0.7, 0], axis=1) - 0.4) < 1e-6
    assert upper.any() and np.abs(shift[upper] - [0, 0.1, 0]).max() < 1e-12 and not shift[~upper].any()


def test_the_clip_of_a_polynomial_moves_no_surface_but_its_caps() -> None:
    cone = Polynomial(expression="x^2 + z^2 - y^2", clip=Block(min=(-1.0, -1.0, -1.0), max=(1.0, 1.0, 1.0)))
    high = Block(min=(-1.0, -1.0, -1.0), max=(1.0, 1.1, 1.0))
    look = Look.of(scene_of({"it": cone}), scene_of({"it": replace(cone, clip=high)}))
    assert look.seen.any() and np.abs((look.points_after() - look.hit["P"].T)[look.seen]).max() < 1e-9
    solid = replace(cone, ends="capped")
    look = Look.of(scene_of({"it": solid}), scene_of({"it": replace(solid, clip=high)}))
    p, moved = look.hit["P"].T, look.points_after()
    cap = look.seen & (p[:, 1] > 1 - 1e-6) & (np.hypot(p[:, 0], p[:, 2]) < 0.85)
    assert cap.any() and np.abs(moved - p - [0, 0.1, 0])[cap].max() < 1e-9


def test_a_parameter_moves_a_polynomial_surface_onto_the_next_one() -> None:
    def ball(r: float) -> Polynomial:
        return Polynomial(expression="(x^2 + y^2 + z^2)^2 - r^4", parameters={"r": r}, clip=Ball(radius=2.0))

    look = Look.of(scene_of({"it": ball(1.0)}), scene_of({"it": ball(1.1)}))
    p, moved = look.hit["P"].T[look.seen], look.points_after()[look.seen]
    assert len(p) > 50 and np.abs(moved - 1.1 * p).max() < 1e-12


def test_a_surface_moves_along_its_normal_even_where_its_gradient_vanishes() -> None:
    """The heart: at y = 0 the polynomial has a triple root, and Newton's method would be lost."""

    def heart(s: float) -> Polynomial:
        text = "(x^2 + 9/4*z^2 + y^2 - s)^3 - x^2*y^3 - 9/80*z^2*y^3"
        return Polynomial(expression=text, parameters={"s": s}, clip=Ball(radius=2.0))

    look = Look.of(*(scene_of({"it": heart(s)}, replace(VIEW, origin=(0.5, 0.8, 4.5))) for s in (1.0, 1.05)))
    p, way = look.hit["P"].T[look.seen], (look.points_after() - look.hit["P"].T)[look.seen]
    x, y, z = (p + way).T
    # The cube root of what the polynomial adds to the ellipsoid is good to a third of the digits.
    off = x**2 + 9 / 4 * z**2 + y**2 - 1.05 - np.cbrt((x**2 + 9 / 80 * z**2) * y**3)
    assert len(p) > 100 and (np.abs(p[:, 1]) < 0.04).sum() > 3 and np.abs(off).max() < 1e-10
    sideways = way - (way * look.hit["N"].T[look.seen]).sum(axis=1, keepdims=True) * look.hit["N"].T[look.seen]
    assert np.abs(sideways).max() < 1e-12 and np.linalg.norm(way, axis=1).min() > 0.01


@pytest.mark.parametrize("thing", [Capsule(a=(0.0, -0.4, 0.0), b=(0.0, 0.4, 0.0), radius=0.3), Torus(), Cylinder()])
def test_other_sizes_keep_u_and_v(thing: Any) -> None:
    """Sizes that no frame expresses: the length of a capsule, the radii of a torus."""
    ends = {Capsule: {"b": (0.0, 0.7, 0.0)}, Torus: {"major": 1.2, "minor": 0.3}, Cylinder: {"height": 1.3}}
    look = Look.of(scene_of({"it": thing}), scene_of({"it": replace(thing, **ends[type(thing)])}))
    there = look.arrivals()
    met = look.seen & (np.linalg.norm(there["P"].T - look.points_after(), axis=1) < 1e-9)
    assert met.sum() > 0.9 * look.seen.sum()
    jump = np.abs(there["UV"] - look.hit["UV"])[:, met]
    assert np.minimum(jump, 1 - jump).max() < 1e-8


TURNED = (Rotate(rotate=5.0), Translate(translate=(0.1, 0.0, 0.05)))
BASES = {"globe": GlobeBase(), "map": MapBase(width=3.0)}
TABLE = {"lon": [0.0, 25.0, -20.0, 40.0, -50.0], "lat": [20.0, -10.0, 40.0, 5.0, 0.0]}


def data_of(base: Any, gizmo: str, sizes: tuple[float, ...], source: Any = TABLE) -> Scene:
    rule = vr.SizeRule(column="size", domain=(0, 1), range=(0.0, 0.5))
    own = {"radius" if GIZMOS[gizmo].sizes == ("radius",) else "height": rule}
    if gizmo == "geometry":
        own["geometry"] = "pair"
    if isinstance(source, dict):
        source = source | {"size": list(sizes)}
    layer = vr.DataLayer(**{"source": source, "gizmo": gizmo, "radius": 0.15} | own)
    pair = {"pair": Csg(op="merge", of=(Sphere(radius=0.7, center=(0.0, 0.8, 0.0)), Box()))}
    camera = replace(VIEW, origin=(3.0, 2.0, 1.5), fov=45.0)
    data = vr.Data(base=base, layers={"x": layer})
    return checked(
        scene_of({}, camera, Film(width=64, height=48), data=data, geometries=pair if gizmo == "geometry" else {})
    )


def on_rows(look: Look) -> np.ndarray:
    """Whether a lane shows a row: the objects behind the base."""
    return look.hit["id"] > 1


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("gizmo", [x for x in GIZMOS if not GIZMOS[x].on_line])
def test_rows_turn_with_their_base(gizmo: str, base: str) -> None:
    sizes = (0.4, 0.9, 0.6, 0.5, 0.7)
    look = Look.of(data_of(BASES[base], gizmo, sizes), data_of(replace(BASES[base], transform=TURNED), gizmo, sizes))
    p, moved, matrix = look.hit["P"].T, look.points_after(), compose(TURNED)
    assert on_rows(look).sum() > 20 and (look.hit["id"] == 1).sum() > 100
    assert np.abs(moved - (p @ matrix[:, :3].T + matrix[:, 3]))[look.seen].max() < 1e-12


def test_lines_turn_with_their_base(tmp_path: Path) -> None:
    line = {"type": "LineString", "coordinates": [[-30, 0], [10, 30], [60, -10]]}
    feature = {"type": "Feature", "properties": {"size": 0.3}, "geometry": line}
    path = tmp_path / "lines.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    for base in BASES.values():
        scenes = (data_of(x, "line", (), str(path)) for x in (base, replace(base, transform=TURNED)))
        look = Look.of(*scenes)
        p, moved, matrix = look.hit["P"].T, look.points_after(), compose(TURNED)
        assert on_rows(look).sum() > 30
        assert np.abs(moved - (p @ matrix[:, :3].T + matrix[:, 3]))[look.seen].max() < 1e-12


@pytest.mark.parametrize("gizmo", [x for x in GIZMOS if not GIZMOS[x].on_line])
def test_rows_grow_as_written_objects_do(gizmo: str) -> None:
    """One row has no size later, and so is gone; it stays."""
    scenes = [data_of(BASES["globe"], gizmo, x) for x in ((0.4, 0.9, 0.6, 0.5, 0.7), (0.5, 0.8, 0.0, 0.45, 0.9))]
    look, written = Look.of(*scenes), Look.of(*map(written_out, scenes))
    gone = look.hit["id"] == 4
    assert gone.any() and not look.vectors[:, gone].any()
    assert on_rows(look).sum() > 30 and (look.hit["id"] == written.hit["id"]).all()
    assert np.abs(look.vectors - written.vectors).max() < 1e-9
    assert np.abs(look.vectors[:, on_rows(look)]).max() > 0.2


def textured(t: float, waves: str) -> Scene:
    """A ball that moves and turns before a wall, and a camera that turns, at a time. waves: file of the texture"""
    steps = (Rotate(rotate=30.0 * t), Translate(translate=(t, 0.3 * t, 0.5 * t)))
    objects = {
        "ball": Sphere(radius=0.8, material="waves", transform=steps),
        "wall": Box(min=(-3.0, -2.0, -2.5), max=(3.0, 2.0, -2.0), material="waves"),
    }
    camera = replace(VIEW, target=(0.1 + 0.4 * t, 0.1, 0.0))
    texture, material = ImageTexture(file=waves, encoding="linear"), vr.Material(texture="waves")
    more = {"textures": {"waves": texture}, "materials": {"waves": material}}
    return scene_of(objects, camera, Film(width=160, height=120), **more)


def between_pixels(picture: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Values of a picture at places in pixels, blended from the four pixels around. Shape: picture (H, W, n)."""
    height, width = picture.shape[:2]
    x, y = np.clip(x - 0.5, 0, width - 1.001), np.clip(y - 0.5, 0, height - 1.001)
    i, j = x.astype(int), y.astype(int)
    p, q = (x - i)[..., None], (y - j)[..., None]
    upper, lower = ((1 - p) * picture[k, i] + p * picture[k, i + 1] for k in (j, j + 1))
    return (1 - q) * upper + q * lower


def test_a_warped_frame_is_the_next_one(tmp_path: Path) -> None:
    """The colour of the next frame at the end of each vector is that of the pixel, where no edge is near."""
    u, v = np.meshgrid(*(np.arange(256) / 128 * np.pi,) * 2)
    waves = np.stack([np.sin(4 * u), np.sin(5 * v), np.sin(3 * u + 3 * v)], axis=-1)
    file = tmp_path / "waves.exr"
    vr.Image({"RGB": (0.5 + 0.5 * waves).astype(np.float32)}).write(file)
    look = Look.of(*(textured(t, str(file)) for t in (0.0, 0.1)))
    height, width = 120, 160
    order = look.now.order

    def raster(lanes: np.ndarray) -> np.ndarray:
        picture = np.empty((height * width, len(lanes)))
        picture[order] = lanes.T
        return picture.reshape(height, width, -1)

    after = in_numpy(first_hit(look.after.kernel, look.after.x, look.after.y), len(order))
    x, y = (
        raster(look.x[None])[..., 0] + raster(look.vectors)[..., 0],
        raster(look.y[None])[..., 0] + raster(look.vectors)[..., 1],
    )
    here, there = raster(look.hit["albedo"]), raster(after["albedo"])
    same = between_pixels(raster(after["id"][None]), x, y)[..., 0] == raster(look.hit["id"][None])[..., 0]
    inside = (x > 1) & (x < width - 1) & (y > 1) & (y < height - 1)
    kept = same & inside & (raster(look.hit["id"][None])[..., 0] > 0)
    assert kept.mean() > 0.6 and np.abs(raster(look.vectors)[kept]).max() > 4
    off, still = (np.abs(picture - here)[kept].mean() for picture in (between_pixels(there, x, y), there))
    assert off < still / 20


def animated(**tracks: Any) -> Scene:
    objects = {"ball": Sphere(radius=0.7), "box": Box(min=(-2.0, -0.9, -2.0), max=(2.0, -0.8, 2.0))}
    return checked(replace(scene_of(objects), animation={"duration": 1.0, "fps": 4, "tracks": tracks}))


RISE = {"address": "objects.ball.center.1", "times": (0.0, 1.0), "values": (0.0, 1.0)}


def test_the_next_frame_is_a_frame_later_and_the_last_moment_stands_still() -> None:
    scene = animated(rise=RISE)
    assert next_frame(scene, 0.25).objects["ball"].center == (0.0, 0.5, 0.0)
    assert next_frame(scene, 0.25, fps=8).objects["ball"].center == (0.0, 0.375, 0.0)
    assert next_frame(scene, 0.9).objects["ball"].center == (0.0, 1.0, 0.0)
    end = vr.at(scene, 1.0)
    look = Look.of(end, next_frame(scene, 1.0))
    assert (look.hit["id"] == 1).any() and not look.vectors.any()


@pytest.mark.parametrize("error", [None, 0.5])
def test_the_layer_of_a_picture_and_its_channels(tmp_path: Path, error: float | None) -> None:
    scene = animated(rise=RISE)
    after = next_frame(scene, 0.0)
    prepared = replace(vr.prepare(vr.at(scene, 0.0)), after=after)
    image = vr.render(prepared, layers=("RGB", "P", "id", "forward"), progress=False, error=error)
    ball = image["id"] == 1
    there = projected(after, image["P"][ball].astype(float) + [0, 0.25, 0])
    rows, columns = np.nonzero(ball)
    shift = np.stack([there.x - (columns + 0.5), there.y - (rows + 0.5)], axis=1)
    # P has the roundings of single precision, of a picture 32 pixels wide.
    assert ball.sum() > 30 and np.abs(image["forward"][ball] - shift).max() < 1e-4
    # A rise is a negative V.
    assert (shift[:, 1] < -1).all() and not image["forward"][~ball].any()
    image.write(tmp_path / "frame.exr")
    channels = exr_of(tmp_path / "frame.exr")
    assert {channels[name].dtype for name in ("forward.U", "forward.V")} == {np.dtype("float32")}
    assert (channels["forward.U"] == image["forward"][..., 0]).all()
    assert (channels["forward.V"] == image["forward"][..., 1]).all()
    assert (vr.Image.read(tmp_path / "frame.exr")["forward"] == image["forward"]).all()
    alone = vr.render(prepared, layers="forward", progress=False)
    assert (alone["forward"] == image["forward"]).all()
    # Another size and other samples are those of the same moment.
    small = vr.render(prepared, layers="forward", size=(16, 12), precision="single", progress=False)
    assert np.abs(small["forward"]).max() > 0.5


def exr_of(path: Path) -> dict[str, np.ndarray]:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels for name, channel in file.channels().items()}


def test_a_still_scene_has_no_such_layer() -> None:
    scene = scene_of({"ball": Sphere()})
    assert "forward" not in vr.render(scene, progress=False).layers
    with pytest.raises(UserError, match=r"^layers = forward: only a moment of a scene with an animation has that; "):
        vr.render(scene, layers=("Z", "forward"), progress=False)


def test_the_second_frame_compiles_nothing() -> None:
    scene = animated(rise=RISE, turn={"type": "orbit"})
    prepared, compiled = vr.prepare(vr.at(scene, 0.0)), []
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        for t in (0.0, 0.25, 0.5):
            prepared = replace(prepared.updated(assignments(scene, t)), after=next_frame(scene, t))
            assert vr.render(prepared, progress=False)["forward"].any()
            compiled.append(sum(not k["cache_hit"] for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT))
    assert compiled[1:] == [0, 0]
