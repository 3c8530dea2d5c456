"""Open surfaces that solids cut, and solids of which only the surface is kept: first hits against the truth."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from csg_open import OpenSurface
from csg_traced import Traced
from csg_trees import OPEN, OPERANDS, POLYNOMIALS, near, operand, rays, transform, tree
from samples import SAMPLES, shifted

import visray as vr

# The sample of meshes is one triangle.
SHEETS = sorted(OPEN - {"Plane"})
pytestmark = pytest.mark.filterwarnings("ignore::visray.csg_report.CsgWarning")


def sheet(rng: np.random.Generator) -> Any:
    """A flat surface or a polynomial one, of size 1 to 3 near the origin."""
    if rng.random() < 0.3:
        expression, clip = POLYNOMIALS[rng.integers(len(POLYNOMIALS))]
        return vr.Polynomial(expression=expression, clip=clip, transform=transform(rng))
    name = str(rng.choice(SHEETS))
    while True:
        thing = SAMPLES[name].random(rng, 1.5)
        middle, reach = SAMPLES[name].hull(thing)
        if 0.8 < reach < 4:
            return replace(shifted(thing, near(rng, 0.5) - middle), transform=transform(rng))


def open_tree(rng: np.random.Generator, depth: int, names: list[str]) -> vr.Csg:
    """A sheet, or the surface of a solid, that one to three solids cut; or such a surface that others cut once more."""
    kind = rng.integers(3 if depth > 1 else 2)
    first = (lambda: sheet(rng), lambda: operand(rng, names), lambda: open_tree(rng, depth - 1, names))[kind]()
    others = [tree(rng, 1, names) if rng.random() < 0.3 else operand(rng, names) for _ in range(rng.integers(1, 4))]
    op = str(rng.choice(["difference", "intersection"]))
    others = others[:1] if op == "intersection" else others
    ends = "open" if kind == 1 else str(rng.choice(["open", "capped"]))
    return vr.Csg(op=op, of=(first, *others), ends=ends, transform=transform(rng))


@pytest.mark.parametrize("seed, trees, per", [
    pytest.param(1, 10, 1000, id="quick"),
    pytest.param(2, 100, 5000, id="half a million", marks=pytest.mark.nightly),
])  # fmt: skip
def test_first_hits_of_open_surfaces_are_those_of_the_truth(seed: int, trees: int, per: int) -> None:
    rng, names, hits, unsure = np.random.default_rng(seed), [], 0, 0
    for _ in range(trees):
        names = names or list(rng.permutation(list(OPERANDS)))
        traced = Traced(open_tree(rng, 2, names))
        surface = OpenSurface(traced.obj)
        o, d = rays(rng, surface, per)
        found, truth = traced.first(o, d), surface.hits(o, d)
        assert np.array_equal(found.hit[truth.sure], truth.hit[truth.sure])
        met = truth.sure & truth.hit
        slack = 2.0**-52 * truth.high[met]
        assert (found.t[met] >= truth.low[met] - slack).all() and (found.t[met] <= truth.high[met] + slack).all()
        one = met & (truth.leaf >= 0)
        # The second leaf of a polynomial is its clip, which has no surface here, and so no material of its own.
        material = [leaf.material[1:] if leaf.material != "default" else -1 for leaf in surface.leaves]
        assert np.array_equal(found.leaf[one], np.array(material, int)[truth.leaf[one]])
        hits, unsure = hits + int(met.sum()), unsure + int((~truth.sure).sum())
    assert unsure <= 1e-3 * trees * per and hits > trees * per / 10
