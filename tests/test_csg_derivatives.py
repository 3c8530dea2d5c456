"""Derivatives of pictures of CSG by the numbers of operands, against differences, inside the faces that are seen."""

import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from csg_sets import IN
from csg_trees import OPERANDS
from csg_truth import Solid
from samples import SAMPLES, unit
from test_every_derivative import addresses_below, check, scene_of

import visray as vr

TURN = (vr.Rotate(rotate=25.0, axis=(1.0, 2.0, 0.5)), vr.Scale(scale=(1.1, 0.9, 1.2)))


@pytest.fixture(autouse=True)
def unwarned() -> Iterator[None]:
    """No edge moves in these views; that differences agree shows it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vr.EdgeWarning)
        yield


def operand_of(name: str) -> Any:
    """A solid of size about 1 near the origin."""
    posed = SAMPLES[name].posed
    return posed if posed.closed or name == "Plane" else OPERANDS[name](np.random.default_rng(3))


def view_of(obj: Any, solid: Any, seen: int) -> tuple[vr.Camera, vr.PointLight]:
    """A camera in a solid that sees a small patch of one leaf of an object, far from its edges, and a light beside it.

    seen: number of the leaf in the truth of the object.
    """
    rng, whole, within = np.random.default_rng(7), Solid(obj), Solid(solid)
    for _ in range(2000):
        o = rng.uniform(-1.5, 1.5, 3)
        d = unit(rng.normal(size=3) + 0.02 * np.array([[0, 0, 0], *rng.normal(size=(6, 3))])).astype(float)
        if within.at(o[None])[0] != IN:
            continue
        crossed = whole.on(np.tile(o, (7, 1)), d)
        if not (crossed.leaf == seen).all():
            continue
        n, leaf = crossed.normal_at(crossed.first.low), whole.leaves[seen]
        p = crossed.o + crossed.first.low[:, None] * crossed.d
        crease = leaf.crease(leaf.local_point(p))
        if (np.abs((n * d).sum(1)) > 0.3).all() and (n @ n[0] > 0.9).all() and (crease > 0.03).all():
            light = vr.PointLight(position=tuple((o + 0.05 * rng.normal(size=3)).tolist()))
            return vr.Camera(origin=tuple(o.tolist()), target=tuple(p[0].astype(float).tolist()), fov=1.0), light
    raise AssertionError(f"no view of {obj}")


# Each kind takes seconds, so the quick suite has one.
QUICK = next(iter(OPERANDS))


@pytest.mark.parametrize("name", [n if n == QUICK else pytest.param(n, marks=pytest.mark.slow) for n in OPERANDS])
def test_by_the_numbers_of_an_operand_that_cuts(name: str) -> None:
    """From within the hole."""
    hole = replace(operand_of(name), transform=TURN)
    body = vr.Box(min=(-9.0, -9.0, -9.0), max=(9.0, 9.0, 9.0))
    moved = (vr.Rotate(rotate=10.0, axis=(0.0, 1.0, 0.3)),)
    whole = vr.Csg(op="difference", of={"body": body, "hole": hole}, material="paint", transform=moved)
    camera, light = view_of(whole, replace(hole, transform=(*TURN, *moved)), 1)
    scene = scene_of(camera=camera, lights={"key": light}, objects={"thing": whole})
    check(scene, addresses_below(scene, "objects.thing.of.hole."), forward=True)


@pytest.mark.slow
def test_by_the_numbers_of_operands_of_a_list_and_at_all_depths() -> None:
    """The body, its hole, and what cuts the hole; only the face that is seen has derivatives."""
    ball = vr.Sphere(center=(0.1, 0.2, 0.0), radius=1.0)
    pin = vr.Cylinder(axis=(0.1, 1.0, 0.2), radius=0.3, height=3.0)
    inner = vr.Csg(op="difference", of=[ball, pin], transform=TURN)
    whole = vr.Csg(op="difference", of=[vr.Box(min=(-9.0, -9.0, -9.0), max=(9.0, 9.0, 9.0)), inner], material="paint")
    for seen, cut in ((1, "0"), (2, "1")):
        camera, light = view_of(whole, inner, seen)
        scene = scene_of(camera=camera, lights={"key": light}, objects={"thing": whole})
        check(scene, [a for k in "01" for a in addresses_below(scene, f"objects.thing.of.1.of.{k}.")])
        other = {"0": "objects.thing.of.1.of.1.radius", "1": "objects.thing.of.1.of.0.radius"}[cut]
        slopes = vr.gradient(scene, [other, f"objects.thing.of.1.of.{cut}.radius"])
        assert not np.any(slopes[other]) and np.any(slopes[f"objects.thing.of.1.of.{cut}.radius"])
