"""The laws of sets: two ways to write one solid make one picture, to the last bit."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import solids

import visray as vr
from visray.primitives.clips import Ball

MATERIALS = {k: vr.Material(kd=kd) for k, kd in zip("abc", ((0.8, 0.2, 0.1), (0.1, 0.7, 0.2), (0.2, 0.3, 0.9)))}
TILTED = (vr.Rotate(rotate=25.0, axis=(1.0, 2.0, -0.5)),)
# Three solids that overlap, by the kinds of search that find their crossings.
OPERANDS = {
    "intervals": (
        vr.Box(min=(-0.9, -0.8, -0.7), max=(0.7, 0.8, 0.9), transform=TILTED),
        vr.Sphere(center=(0.4, 0.3, 0.5), radius=0.8),
        vr.Cylinder(center=(-0.2, 0.1, 0.3), axis=(0.3, 1.0, 0.6), radius=0.4, height=2.5),
    ),
    "searches": (
        vr.Mesh(vertices=solids.ball(2)[0], faces=solids.ball(2)[1], normals="face", transform=TILTED),
        vr.Torus(center=(0.3, 0.2, 0.4), axis=(0.3, 0.2, 1.0), major=0.7, minor=0.3),
        vr.Polynomial(expression="x^2 + y^2 - z^2 - 1/10", clip=Ball(radius=1.3), ends="capped"),
    ),
}


@dataclass(frozen=True)
class Set:
    """A solid with the operators of Python's sets."""

    solid: Any

    def __or__(self, other: "Set") -> "Set":
        return Set(vr.Csg(op="union", of=(self.solid, other.solid)))

    def __and__(self, other: "Set") -> "Set":
        return Set(vr.Csg(op="intersection", of=(self.solid, other.solid)))

    def __sub__(self, other: "Set") -> "Set":
        return Set(vr.Csg(op="difference", of=(self.solid, other.solid)))


# All of space: two half-spaces that overlap.
SPACE = Set(vr.Plane(point=(0, 9, 0), normal=(0, 1, 0))) | Set(vr.Plane(point=(0, -9, 0), normal=(0, -1, 0)))
LAWS = (
    "a - (b | c) = (a - b) & (a - c)",
    "a - (b & c) = (a - b) | (a - c)",
    "(a - b) - c = (a - c) - b",
    "a & b = b & a",
    "a | b = b | a",
    "a & (b & c) = (c & a) & b",
    "a | (b | c) = (c | a) | b",
    "a & (b | c) = (a & b) | (a & c)",
    "a | (b & c) = (a | b) & (a | c)",
    "a - b = a & (space - b)",
    "a - (a - b) = a & b",
    "a | (a & b) = a & (a | b)",
    "a & a = a | a",
    "b - (space - a) = space - ((space - a) | (space - b))",
)


def picture(obj: Any, **settings: Any) -> np.ndarray:
    scene = vr.Scene(
        camera=vr.Camera(origin=(2.0, 1.7, 4.0), target=(0.0, 0.0, 0.0), fov=40.0),
        film=vr.Film(width=80, height=60),
        materials=MATERIALS,
        lights={"key": vr.PointLight(position=(3.0, 4.0, 2.0))},
        objects={"floor": vr.Plane(point=(0.0, -1.2, 0.0)), "solid": obj},
        settings=vr.Settings(**{"spp": 4} | settings),
    )
    return vr.render(scene, layers=("RGB",), progress=False)["RGB"]


def operands(kinds: str) -> list:
    return [replace(x, material=name) for x, name in zip(OPERANDS[kinds], "abc")]


KINDS = pytest.mark.parametrize("kinds", ["intervals", pytest.param("searches", marks=pytest.mark.slow)])


@pytest.mark.parametrize("law", LAWS)
@KINDS
def test_both_sides_of_a_law_are_one_picture(kinds: str, law: str) -> None:
    sets = {name: Set(x) for name, x in zip("abc", operands(kinds))} | {"space": SPACE}
    left, right = (picture(eval(side, sets).solid) for side in law.split("="))
    assert left.std() > 0.02 and np.array_equal(left, right)


@KINDS
def test_opaque_union_is_merge_and_cut_is_difference(kinds: str) -> None:
    a, b, c = operands(kinds)
    joined = vr.Csg(op="union", of=(a, b, c))
    assert np.array_equal(picture(joined), picture(replace(joined, op="merge")))
    # What is cut away moves with the object.
    cut = replace(a, cut=(b, c), transform=TILTED)
    difference = vr.Csg(op="difference", of=(replace(a, transform=()), b, c), transform=TILTED)
    assert np.array_equal(picture(cut), picture(difference))
