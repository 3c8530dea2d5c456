"""Faces that coincide to within rounding: they leave no film, no crack and no speckle, wherever the objects are."""

from dataclasses import replace

import numpy as np
import pytest
from csg_traced import Found, Traced
from csg_trees import OPERANDS, rays
from csg_truth import Solid
from samples import direction, unit

import visray as vr
from visray.transforms import Rotate, Scale, Transform, Translate, compose

pytestmark = pytest.mark.filterwarnings("ignore::visray.csg_report.CsgWarning")
PLACES = ("here", "turned", "far", "tiny and far")
EACH_PLACE = pytest.mark.parametrize("place", PLACES)
EACH_KIND = pytest.mark.parametrize("name", OPERANDS)


def steps_of(rng: np.random.Generator, place: str) -> tuple[Transform, ...]:
    """A transform to a place: nowhere, any rotation, a million sizes away, or at a size of a millionth."""
    turn = Rotate(rotate=float(rng.uniform(0, 360)), axis=direction(rng))
    away = Translate(translate=tuple((1e6 * unit(rng.normal(size=3))).astype(float).tolist()))
    small = Scale(scale=tuple((1e-6 * rng.uniform(1, 2, 3)).tolist()))
    return {"here": (), "turned": (turn,), "far": (turn, away),
            "tiny and far": (small, turn, replace(away, translate=(1.0, 2.0, 0.5)))}[place]  # fmt: skip


def each_moved(obj: vr.Csg, steps: tuple[Transform, ...]) -> vr.Csg:
    """The object with the transform of each operand moved instead of the whole, so that each is rounded by itself."""
    return replace(obj, of=tuple(replace(x, transform=(*x.transform, *steps)) for x in obj.of))


def placed_rays(o: np.ndarray, d: np.ndarray, steps: tuple[Transform, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Rays moved as the objects are."""
    if not steps:
        return o, d
    matrix = compose(steps)
    return o @ matrix[:, :3].T + matrix[:, 3], unit(d @ matrix[:, :3].T).astype(float)


def aimed(rng: np.random.Generator, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rays at points from all sides, 3 to 30 units away."""
    away = unit(rng.normal(size=targets.shape)).astype(float)
    o = targets + rng.uniform(3, 30, (len(targets), 1)) * away
    return o, -away


def slack(o: np.ndarray, found: Found, size: float = 1.0) -> np.ndarray:
    """Bound on the error of distances: the roundings of the walk (csg_leaves.FLUSH), over grazing angles of 0.01."""
    from_origin = np.abs(o).sum(1) + np.where(found.hit, found.t, 0) + size
    return 100 * 64 * 2.0**-53 * from_origin


def same(one: Found, other: Found, o: np.ndarray) -> None:
    """Both hit or miss, at the same distance. Rays at less than 0.6 degrees to a surface are not compared."""
    assert np.array_equal(one.hit, other.hit)
    assert (np.abs(one.t[one.hit] - other.t[one.hit]) <= slack(o, one)[one.hit]).all()


BOX = vr.Box(min=(-1.0, -1.0, -1.0), max=(1.0, 1.0, 1.0))


@EACH_PLACE
def test_a_hole_with_flush_caps_is_open(place: str) -> None:
    """A cylinder as high as the box that it is taken from is as good as a longer one: no film closes the hole."""
    rng = np.random.default_rng(11)
    steps = steps_of(rng, place)
    caps = rng.uniform(-0.9, 0.9, (20_000, 3))
    caps[:, 1] = rng.choice([-1.0, 1.0], len(caps))
    o, d = aimed(rng, caps)
    steep = np.abs(d[:, 1]) > 0.05
    o, d = placed_rays(o[steep], d[steep], steps)
    hits = []
    for height in (2.0, 3.0):
        drill = vr.Cylinder(axis=(0.0, 1.0, 0.0), radius=0.6, height=height)
        traced = Traced(each_moved(vr.Csg(op="difference", of=(BOX, drill)), steps))
        hits.append(traced.first(o, d))
    same(*hits, o)
    assert np.array_equal(hits[0].leaf, hits[1].leaf)
    through = ~hits[0].hit
    assert 0.01 < through.mean() < 0.5 and 0.1 < (hits[0].leaf[hits[0].hit] == 1).mean() < 0.9


@EACH_PLACE
@pytest.mark.parametrize("op", ["union", "merge"])
def test_boxes_that_touch_are_one_box(op: str, place: str) -> None:
    """No crack where they meet and no face inside, for rays at the seam and through it. Rays along the seam, exactly in
    its plane, are tested where their numbers are not rounded: elsewhere, rounding says on which side of it they run."""
    rng = np.random.default_rng(12)
    steps = steps_of(rng, place)
    seam = rng.uniform(-1, 1, (20_000, 3)) * [1e-9, 1.2, 1.2]
    seam[:10_000, 0] = 0
    o, d = aimed(rng, seam)
    if place == "here":
        o[:2000, 0], d[:2000, 0] = 0, 0
        d[:2000] = unit(d[:2000])
    o, d = placed_rays(o, d, steps)
    left, right = (vr.Box(min=(x, -1.0, -1.0), max=(x + 1, 1.0, 1.0)) for x in (-1.0, 0.0))
    two = Traced(each_moved(vr.Csg(op=op, of=(left, right)), steps))
    one = Traced(each_moved(vr.Csg(op=op, of=(BOX,)), steps))
    first = two.first(o, d)
    same(first, one.first(o, d), o)
    # On through the inside: the way out is that of the whole box.
    sure = first.hit & ~first.inside & (np.abs((first.n * d).sum(1)) > 0.01)
    start, ways = first.at(sure), d[sure]
    out = two.first_from(start, ways)
    whole = one.first(start.p + 1e-3 * (out.t / 2)[:, None] * ways, ways)
    assert out.hit.all() and whole.hit.all() and sure.mean() > 0.3
    assert (np.abs(out.t * (1 - 0.5e-3) - whole.t) <= slack(start.p, out)).all()


@EACH_PLACE
@pytest.mark.parametrize("op", ["union", "merge", "intersection"])
def test_of_equal_solids_the_first_one_shows(op: str, place: str) -> None:
    rng = np.random.default_rng(13)
    steps = steps_of(rng, place)
    o, d = placed_rays(*aimed(rng, rng.uniform(-1, 1, (20_000, 3))), steps)
    # The second one is written in another way, so that its numbers are rounded in another way.
    turned = replace(BOX, transform=(Rotate(rotate=90.0, axis=(0.0, 0.0, 1.0)),))
    traced = Traced(each_moved(vr.Csg(op=op, of=(BOX, turned)), steps))
    found = traced.first(o, d)
    same(found, Traced(each_moved(vr.Csg(op=op, of=(BOX,)), steps)).first(o, d), o)
    assert (found.leaf[found.hit] == 0).all() and found.hit.mean() > 0.9
    # What leaves a face that two operands have leaves both.
    start, ways = found.at(found.hit), d[found.hit]
    mirrored = unit(ways - 2 * (ways * start.n).sum(1)[:, None] * start.n).astype(float)
    assert not traced.first_from(start, mirrored).hit.any()


@EACH_PLACE
@EACH_KIND
def test_a_solid_without_itself_is_empty(name: str, place: str) -> None:
    rng = np.random.default_rng(14)
    thing = OPERANDS[name](rng)
    steps = steps_of(rng, place)
    o, d = placed_rays(*rays(rng, Solid(thing), 5000), steps)
    moved = each_moved(vr.Csg(op="difference", of=(thing, thing)), steps)
    assert not Traced(moved).first(o, d).hit.any()


@EACH_KIND
def test_a_solid_with_itself_is_itself(name: str) -> None:
    """Also where the copy's transform is that of the whole, and so rounded in another way."""
    rng = np.random.default_rng(15)
    thing = OPERANDS[name](rng)
    steps = steps_of(rng, "turned")
    inner = vr.Csg(op="union", of=(thing,), transform=steps)
    copy = replace(thing, transform=(*thing.transform, *steps))
    o, d = placed_rays(*rays(rng, Solid(thing), 3000), steps)
    alone = Traced(copy).first(o, d)
    for op in ("union", "merge", "intersection"):
        found = Traced(vr.Csg(op=op, of=(inner, copy))).first(o, d)
        same(found, alone, o)
        assert (found.leaf[found.hit] == 0).all() and found.hit.any()


@EACH_PLACE
def test_solids_that_only_touch_have_nothing_in_common(place: str) -> None:
    rng = np.random.default_rng(16)
    steps = steps_of(rng, place)
    left, right = (vr.Box(min=(x, -1.0, -1.0), max=(x + 1, 1.0, 1.0)) for x in (-1.0, 0.0))
    seam = rng.uniform(-1, 1, (20_000, 3)) * [1e-9, 1, 1]
    o, d = placed_rays(*aimed(rng, seam), steps)
    traced = Traced(each_moved(vr.Csg(op="intersection", of=(left, right)), steps))
    assert not traced.first(o, d).hit.any()


def test_a_lens_of_equal_balls_has_two_faces() -> None:
    """The near face is that of the ball behind, whatever the order, and the rim is sharp."""
    rng = np.random.default_rng(17)
    balls = [vr.Sphere(center=(0.0, 0.0, z), radius=1.0) for z in (-0.8, 0.8)]
    target = np.concatenate([0.65 * rng.uniform(-1, 1, (20_000, 2)), np.zeros((20_000, 1))], axis=1)
    o = target + [0.0, 0.0, 5.0]
    d = np.broadcast_to([0.0, 0.0, -1.0], o.shape)
    inside = (target**2).sum(1) < 1 - 0.8**2
    for of, seen in ((balls, 0), (balls[::-1], 1)):
        found = Traced(vr.Csg(op="intersection", of=tuple(of))).first(o, d)
        assert np.array_equal(found.hit, inside) and (found.leaf[inside] == seen).all()
        assert np.abs(found.p[inside, 2] + 0.8 - np.sqrt(1 - (target[inside] ** 2).sum(1))).max() < 1e-14


@pytest.mark.slow
def test_flush_solids_make_pictures_without_speckle() -> None:
    """Every pixel of a picture of two equal cubes in other colours, one of them cut, is of the first one's colour."""
    steps = (Rotate(rotate=33.0, axis=(1.0, 2.0, 3.0)),)
    red = replace(BOX, material="red", transform=steps)
    blue = vr.Box(min=(-1.0, -1.0, -1.0), max=(1.0, 1.0, 0.5), material="blue", transform=steps)
    scene = vr.Scene(
        camera=vr.Camera(origin=(3.0, 2.5, 4.0), target=(0.0, 0.0, 0.0), fov=40.0),
        film=vr.Film(width=160, height=120),
        materials={"red": vr.Material(kd=(1.0, 0.0, 0.0)), "blue": vr.Material(kd=(0.0, 0.0, 1.0))},
        lights={"key": vr.PointLight(position=(3.0, 4.0, 2.0))},
        objects={"solid": vr.Csg(op="union", of=(red, blue))},
        settings=vr.Settings(spp=4),
    )
    ours, alone = (vr.render(x, layers=("RGB",))["RGB"] for x in (scene, replace(scene, objects={"solid": red})))
    assert ours.std() > 0.1 and np.abs(ours - alone).max() < 1e-6
