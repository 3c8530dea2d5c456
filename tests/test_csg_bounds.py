"""Boxes and balls of CSG: all points of an object are in them, many objects at once have those of each alone, and they
are tight where they can be."""

from typing import Any

import numpy as np
import pytest

import visray as vr
from visray.primitives import csg_body
from visray.primitives.primitive import Primitive, bounding_box
from visray.setup import arrays
from visray.study.mitsuba.membership import inside

RNG = np.random.default_rng(11)
SIZE = 2.5
POINTS = RNG.uniform(-SIZE, SIZE, (20_000, 3))


def solid() -> Primitive:
    """A small solid, or a half-space."""
    center = tuple(RNG.uniform(-1, 1, 3).tolist())
    kind = RNG.integers(4)
    if kind == 0:
        return vr.Sphere(center=center, radius=float(RNG.uniform(0.2, 0.8)))
    if kind == 1:
        turned = (vr.Rotate(rotate=float(RNG.uniform(0, 90)), axis=(1, 2, 0)), vr.Translate(translate=center))
        return vr.Box(min=(-0.4, -0.5, -0.3), max=(0.4, 0.5, 0.3), transform=turned)
    if kind == 2:
        return vr.Cylinder(center=center, radius=0.4, height=0.9)
    return vr.Plane(point=center, normal=tuple(RNG.normal(size=3).tolist()))


def tree(depth: int) -> Primitive:
    """A random tree."""
    if depth == 0:
        return solid()
    op = ("union", "intersection", "difference", "merge")[RNG.integers(4)]
    return vr.Csg(op=op, of=tuple(tree(depth - 1) for _ in range(RNG.integers(2, 4))))


TREES = [tree(depth) for depth in (1, 1, 1, 2, 2, 2, 3) for _ in range(8)]


def boxes(trees: list) -> np.ndarray:
    """Corners of the boxes. Shape: (trees, 2, 3)."""
    every = np.array([[-np.inf] * 3, [np.inf] * 3])
    return np.array([every if (box := bounding_box(x)) is None else np.reshape(box, (2, 3)) for x in trees])


def test_all_points_of_an_object_are_in_its_box_and_in_its_ball() -> None:
    """Against a test of points that knows no kernel."""
    bounded = 0
    for x, (low, high) in zip(TREES, boxes(TREES)):
        p = POINTS[inside(x, POINTS)]
        assert ((p >= low) & (p <= high)).all()
        if x.bounded:
            bounded += 1
            assert (np.linalg.norm(p - x.hull.centre, axis=1) <= x.hull.radius).all()
    assert 0.3 * len(TREES) < bounded < len(TREES)


def test_many_objects_have_the_bounds_of_each_alone() -> None:
    """In a table of one kind, whose objects differ in the numbers of operands of their groups."""
    many = [
        vr.Csg(
            op="difference",
            of=(
                vr.Csg(
                    op="merge", of=tuple(vr.Sphere(center=tuple(c), radius=0.3) for c in RNG.uniform(-1, 1, (n, 3)))
                ),
                *(vr.Box(min=tuple(c - 0.2), max=tuple(c + 0.2)) for c in RNG.uniform(-1, 1, (n + 1, 3))),
            ),
        )
        for n in (5, 7, 5, 9, 7)
    ]
    kind = many[0].kind
    assert {x.kind for x in many} == {kind}
    found: Any = csg_body.CsgBody.table(arrays("llvm", "single"), many).bounds(None)
    for i, (low, high) in enumerate(boxes(many)):
        assert np.array(found.low)[:, i] == pytest.approx(low, rel=1e-14)
        assert np.array(found.high)[:, i] == pytest.approx(high, rel=1e-14)
        assert found.radius[i] == pytest.approx(float(many[i].hull.radius), rel=1e-14)


BALL, BLOCK = vr.Sphere(radius=1), vr.Box(min=(0, 0, 0), max=(2, 2, 2))
AWAY = vr.Sphere(center=(5, 0, 0), radius=1)


@pytest.mark.parametrize(
    ("op", "of", "low", "high"),
    [
        ("intersection", (BALL, BLOCK), (0, 0, 0), (1, 1, 1)),
        ("difference", (BLOCK, BALL), (0, 0, 0), (2, 2, 2)),
        ("merge", (BALL, BLOCK), (-1, -1, -1), (2, 2, 2)),
        ("merge", (BALL, vr.Csg(op="intersection", of=(BALL, AWAY))), (-1, -1, -1), (1, 1, 1)),
        # The complement of a complement: a - (b - a) is a; (everything - a) is taken away from b.
        ("difference", (BLOCK, vr.Csg(op="difference", of=(vr.Plane(), BALL))), (0, 0, 0), (2, 2, 2)),
        ("intersection", (BALL, vr.Plane(point=(0, 0, 0), normal=(0, 1, 0))), (-1, -1, -1), (1, 1, 1)),
    ],
)
def test_boxes_are_those_of_what_is_left(op: str, of: tuple, low: tuple, high: tuple) -> None:
    assert boxes([vr.Csg(op=op, of=of)])[0] == pytest.approx(np.array([low, high], float), abs=1e-15)


def test_an_empty_object_has_an_empty_box_and_an_endless_one_has_none() -> None:
    low, high = map(np.ravel, bounding_box(vr.Csg(op="intersection", of=(BALL, AWAY))))
    assert (low > high).any()
    for endless in (vr.Csg(op="merge", of=(BALL, vr.Plane())), vr.Csg(op="difference", of=(vr.Plane(), BALL))):
        assert bounding_box(endless) is None
