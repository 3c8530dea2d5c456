"""Which of several transparent solids counts where they overlap: by priority, by volume, by order in the scene."""

from dataclasses import replace
from itertools import permutations
from typing import Any

import drjit as dr
import numpy as np
import pytest
from samples import NAMES, SAMPLES, instances
from solids import SOLIDS
from test_media import CROWN, FLINT, MEDIA, WATER, check, media, ratios
from test_paths import PRECISIONS, WHITE, plain, rays_at, seen
from test_updated import compiled

import visray as vr
from visray import polynomials
from visray.camera import Camera
from visray.geometry import gamma
from visray.nesting import solids_of
from visray.polynomials.volume import SHARE, enclosed_volume
from visray.primitives import Box, Cylinder, Polynomial, Sphere
from visray.primitives.clips import Ball
from visray.primitives.primitive import bounding_box
from visray.pytree import rows
from visray.scene.scene import Scene
from visray.setup import prepare
from visray.transforms import Rotate, Scale, Translate

CLOSED = [name for name in NAMES if SAMPLES[name].posed.closed]
GLASS = {"glass": plain(kt=WHITE)}
# A share that random points measure is off by more than five of its standard errors once in two million times.
SIGMAS, POINTS = 5, 20_000


def volumes(objects: dict) -> tuple[Any, dict[str, tuple[float, float]]]:
    """The prepared scene of objects of glass; and for each solid, its volume and the bound on its error."""
    scene = Scene(
        objects={n: replace(x, material="glass") for n, x in objects.items()},
        materials=GLASS,
        camera=Camera(),
        lights={},
    )
    made, found = prepare(scene), {}
    for columns in made.packed.batches:
        solids = solids_of(scene, columns)
        found |= {columns.names[i]: (solids.volume[i], solids.error[i]) for i in range(len(columns))}
    return made, found


def assert_measured(objects: dict) -> None:
    """Volumes agree with the share of random points of a box that are inside."""
    rng = np.random.default_rng(7)
    made, found = volumes(objects)
    for batch in made.kernel.batches:
        for i in range(len(batch)):
            low, high = bounding_box(objects[batch.names[i]])
            p = rng.uniform(low, high, (POINTS, 3))
            placed = rows(batch.placed, dr.full(made.a.U, i, POINTS))
            share = np.array(batch.kind.inside(placed, made.a.put(made.a.W, p.T))).mean()
            box, (volume, error) = np.prod(high - low), found[batch.names[i]]
            noise = SIGMAS * np.sqrt(share * (1 - share) / POINTS) * box
            # The sides of the bounding box are differences of its corners' coordinates.
            rounding = gamma(64) * box * (np.abs([low, high]).max() / (high - low)).max()
            assert share > 0 and abs(share * box - volume) <= error + noise + rounding, batch.names[i]


@pytest.mark.parametrize("moved", [False, True])
@pytest.mark.parametrize("name", CLOSED)
def test_volumes_are_those_of_random_points(name: str, moved: bool) -> None:
    assert_measured({f"o{i}": x for i, x in enumerate(instances(name, 31, 4, moved, 1))})


def test_volumes_of_closed_meshes_and_their_instances_are_those_of_random_points() -> None:
    steps = (Scale(scale=(1.0, 2.0, -0.5)), Rotate(rotate=50.0, axis=(1, 2, 3)), Translate(translate=(1, 0, 2)))
    meshes = {name: vr.Mesh(vertices=v, faces=f, transform=steps) for name, (v, f) in SOLIDS.items()}
    assert_measured(meshes | {"fitted": replace(meshes["ring"], fit=3.0)})


def test_an_instance_has_the_volume_of_its_own_transform() -> None:
    scene = Scene(
        geometries={"ball": Sphere(radius=2.0, transform=(Scale(scale=(1.0, 2.0, 1.0)),))},
        objects={"half": vr.Instance(geometry="ball", material="glass", transform=(Scale(scale=0.5),))},
        materials=GLASS,
        camera=Camera(),
        lights={},
    )
    (columns,) = prepare(scene).packed.batches
    assert abs(solids_of(scene, columns).volume[0] / (4 / 3 * np.pi * 2) - 1) < 1e-14


BALL = 4 / 3 * np.pi
SHAPES = {
    "a small ball": ("x^2 + y^2 + z^2 - 0.0001", 5.0, True, {}, 1e-6 * BALL),
    "all but a ball": ("1 - x^2 - y^2 - z^2", 5.0, True, {}, 124 * BALL),
    "half a ball": ("x - y", 2.0, True, {}, 4 * BALL),
    "two quarters of a ball": ("x*y", 2.0, True, {}, 4 * BALL),
    "half a box": ("x + 2*z", 3.0, False, {}, 108),
    "a torus": ("(x^2+y^2+z^2+R^2-r^2)^2-4*R^2*(x^2+y^2)", 3.0, True, {"R": 1.5, "r": 0.5}, 0.75 * np.pi**2),
    "two balls": ("((x-1)^2+y^2+z^2-1)*((x+1)^2+y^2+z^2-1)", 4.0, False, {}, 2 * BALL),
    "a factor twice": ("(x^2+y^2+z^2-1)*(x-0.1)^2", 4.0, False, {}, BALL),
    "nothing": ("x^2 + y^2 + z^2 + 1", 2.0, True, {}, 0),
    "all of the clip": ("-1 - x^2", 2.0, True, {}, 8 * BALL),
}


@pytest.mark.parametrize("name", SHAPES)
def test_volumes_of_polynomials_are_within_their_bounds(name: str) -> None:
    expression, half, ball, parameters, truth = SHAPES[name]
    compiled_one = polynomials.build(expression, parameters)
    volume, error = enclosed_volume(compiled_one.program, compiled_one.values, (half,) * 3, ball)
    assert abs(volume - truth) <= error <= 0.03 * truth
    # The bound is no guess: of most of these the volume itself is much nearer.
    assert name == "two quarters of a ball" or error <= 2 * SHARE * volume or abs(volume - truth) <= SHARE * truth


def rod(height: float) -> dict:
    return {"water": Sphere(material="water"), "rod": Cylinder(radius=0.15, height=height, material="crown")}


@pytest.mark.parametrize("order", list(permutations(("water", "rod"))))
@pytest.mark.parametrize("height", [1.9, 2.1, 9.0])
def test_a_thin_rod_in_a_ball_of_water_is_seen_however_long(height: float, order: tuple) -> None:
    expected = ("water", 1 / WATER), ("rod", WATER / CROWN), ("rod", CROWN / WATER), ("water", WATER)
    check(ratios(media({name: rod(height)[name] for name in order}), (0, 0, 6), (0, 0, -1), 4), *expected)


@pytest.mark.parametrize("clip", [0.6, 2.0, 50.0])
def test_a_capped_polynomial_counts_by_its_own_size_not_by_its_clip(clip: float) -> None:
    fish = Polynomial(expression="x^2+y^2+z^2-0.25", ends="capped", clip=Ball(radius=clip), material="flint")
    expected = ("water", 1 / WATER), ("fish", WATER / FLINT), ("fish", FLINT / WATER), ("water", WATER)
    check(ratios(media({"water": Sphere(material="water"), "fish": fish}), (0.1, 0, 6), (0, 0, -1), 4), *expected)


def with_priorities(**priorities: float) -> dict:
    return {name: replace(MEDIA[name], priority=x) for name, x in priorities.items()}


def test_the_higher_priority_counts_whatever_the_volumes() -> None:
    """The rod is smaller; with a lower priority, it is hidden where it is in the water."""
    for lower in (with_priorities(crown=-1.0), with_priorities(water=0.5), with_priorities(crown=2.0, water=3.0)):
        check(
            ratios(media(rod(2.1), materials=lower), (0, 0, 6), (0, 0, -1), 4),
            ("water", 1 / WATER), ("rod", None, "hidden"), ("rod", None, "hidden"), ("water", WATER),
        )  # fmt: skip
    equal = ratios(media(rod(2.1), materials=with_priorities(crown=2.0, water=2.0)), (0, 0, 6), (0, 0, -1), 4)
    assert not any(hidden for _, _, hidden in equal)


@PRECISIONS
@pytest.mark.slow
def test_another_priority_compiles_nothing(precision: str) -> None:
    scene = media(rod(2.1), precision, film=vr.Film(width=16, height=16))
    prepared = vr.prepare(scene)

    def picture(made: Any) -> np.ndarray:
        return vr.render(made, progress=False, spp=2)["RGB"]

    first, change = picture(prepared), {"materials.crown.priority": -1.0}
    picture(prepared.updated(change))
    assert compiled(lambda: picture(prepared.updated({"materials.crown.priority": -2.5}))) == 0
    other = picture(prepared.updated(change))
    assert not np.array_equal(first, other)
    assert np.array_equal(other, picture(vr.replaced(scene, "materials.crown.priority", -1.0)))
    assert np.array_equal(first, picture(prepared.updated(change).updated({"materials.crown.priority": 0.0})))
    # A solid that grows beyond another one loses its place.
    grown = prepared.updated({"objects.rod.radius": 2.0})
    assert np.array_equal(picture(grown), picture(grown.scene))


@pytest.mark.parametrize("order", list(permutations(("box", "turned", "rod"))))
def test_of_equal_volumes_the_first_in_the_scene_counts(order: tuple) -> None:
    """Of different kinds, and whatever a rotation does to the last digit of a volume."""
    things = {
        "box": Box(min=(-1, -1, -1), max=(1, 1, 1), material="crown"),
        "turned": Box(min=(-2, -1, -0.5), max=(2, 1, 0.5), material="water", transform=(Rotate(rotate=33.0),)),
        "rod": Cylinder(radius=1.0, height=8 / np.pi, axis=(0, 0, 1), material="flint"),
    }
    made, found = volumes({name: things[name] for name in order})
    assert all(abs(volume / 8 - 1) < 1e-14 for volume, _ in found.values())
    ranks = {}
    for batch in made.kernel.batches:
        ranks |= {batch.names[i]: rank for i, rank in enumerate(np.array(batch.rank))}
    assert tuple(sorted(ranks, key=ranks.get)) == order


@pytest.mark.filterwarnings("ignore:the picture has moving edges")
def test_the_order_of_solids_adds_nothing_to_a_derivative() -> None:
    """Derivatives by what decides the order, and by an index, are those of differences: rays through rod and water."""
    eye = vr.Camera(origin=(0.2, 0.5, 6), target=(0.05, 0.1, 0), fov=0.5)
    scene = media(rod(2.1), film=vr.Film(width=3, height=2), camera=eye, depth=5, spp=1)
    wrt = ["materials.crown.ior", "objects.water.radius", "objects.rod.radius"]
    for address, slope in vr.gradient(scene, wrt).items():
        difference = vr.difference(scene, address, 1e-5).mean()
        assert slope != 0 and abs(slope - difference) <= 1e-5 * abs(difference), address


def test_a_scene_with_one_transparent_solid_has_no_ranks() -> None:
    made = prepare(media({"ball": Sphere(material="crown"), "box": Box(min=(2, 2, 2), max=(3, 3, 3))}))
    assert all(batch.rank is None for batch in made.kernel.batches)


def test_many_solids_keep_all_light_with_any_priorities() -> None:
    """Balls, boxes and capped polynomials in each other: under a sky of 1 each ray sees 1, or is caught for ever."""
    rng, objects = np.random.default_rng(5), {}
    names = list(MEDIA)
    glass = {name: replace(MEDIA[name], priority=float(rng.integers(-1, 2))) for name in names}
    for i in range(9):
        at = tuple((0.8 * rng.normal(size=3)).tolist())
        kinds = (
            Sphere(radius=0.7, center=at, material=names[i % 4]),
            Box(transform=(Scale(scale=1.3), Translate(translate=at)), material=names[i % 4]),
            Polynomial(expression="x^4+y^4+z^4-0.3", ends="capped", transform=(Translate(translate=at),),
                       material=names[i % 4]),
        )  # fmt: skip
        objects[f"o{i}"] = kinds[i % 3]
    o, d = rays_at(rng, 1000, 2.0)
    found = seen(media(objects, materials=glass, background=WHITE), o, d)
    assert np.isin(found, (0, 1)).all() and found.mean() > 0.9


# What `visray explain` says


def pairs_of(scene: Scene) -> list[tuple[str, str, str]]:
    return [(x.counts, x.hidden, x.reason) for x in vr.explain(scene).overlaps]


def test_explain_says_which_solid_counts_and_why() -> None:
    things = rod(2.1) | {
        "bead": Sphere(radius=0.3, material="flint"),
        "twin": Sphere(center=(0.1, 0, 0), radius=0.3, material="flint"),
        "fish": Polynomial(expression="x^2+y^2+z^2-0.09", ends="capped", clip=Ball(radius=0.9), material="air"),
        "far": Sphere(center=(9, 0, 0), material="air"),
        "touching": Box(min=(-1, -1, 1), max=(1, 1, 2), material="air"),
        "opaque": Sphere(radius=0.2),
    }
    found = pairs_of(media(things, materials=with_priorities(flint=2.5)))
    reasons = {(counts.removeprefix("objects."), hidden.removeprefix("objects.")): why for counts, hidden, why in found}
    assert reasons[("rod", "water")] == "volume 0.1484 is smaller than 4.189"
    assert reasons[("bead", "water")] == reasons[("twin", "rod")] == "priority 2.5 is higher than 0"
    assert reasons[("bead", "twin")] == "both have the volume 0.1131, and it comes first in the scene"
    assert reasons[("fish", "rod")].startswith("volume 0.1131 +- 0.0001 is smaller than 0.1484")
    assert not any({"far", "touching", "opaque"} & set(pair) for pair in reasons)
    assert vr.explain(media(things)).overlap_count == len(reasons) == 10


def test_explain_says_where_a_volume_is_only_a_bound() -> None:
    things = {
        "ball": Sphere(material="crown"),
        "polynomial": Polynomial(expression="x^2+y^2+z^2-1", ends="capped", clip=Ball(radius=5.0), material="water"),
    }
    ((_, _, reason),) = pairs_of(media(things))
    assert "+-" in reason and reason.endswith("the volumes are bounds that overlap, so write a priority to be sure")
    assert pairs_of(media(things, materials=with_priorities(crown=1.0))) == [
        ("objects.ball", "objects.polynomial", "priority 1 is higher than 0")
    ]


def test_who_counts_in_explain_counts_in_the_picture() -> None:
    """Balls and boxes that overlap in pairs: the kernel's ranks are in the order that `explain` states."""
    rng = np.random.default_rng(4)
    objects = {
        f"o{i}": replace(kind, material=list(MEDIA)[i % 4], transform=(Translate(translate=tuple(rng.normal(size=3))),))
        for i, kind in enumerate((Sphere(radius=0.8), Box(), Box(max=(0.9, 0.5, 0.5))) * 8)
    }
    scene = media(objects, materials=with_priorities(flint=1.0, air=-1.0))
    ranks = {}
    for batch in prepare(scene).kernel.batches:
        ranks |= {f"objects.{batch.names[i]}": rank for i, rank in enumerate(np.array(batch.rank))}
    found = vr.explain(scene)
    assert found.overlap_count == len(found.overlaps) > 20
    assert all(ranks[pair.counts] < ranks[pair.hidden] for pair in found.overlaps)
