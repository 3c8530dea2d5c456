"""A product of polynomials is zero on the surfaces of all factors: from outside it is the union of their solids."""

import numpy as np
import pytest
import solids
from csg_traced import Traced

import visray as vr
from visray.primitives.clips import Ball

CLIP = Ball(radius=2.5)
BALL = "(x - 1/2)^2 + (y - 1/4)^2 + z^2 - 1"
EGG = "x^2 + 2*y^2 + 3*(z - 1/3)^2 - 1"
RING = "(x^2 + y^2 + z^2 + 3/4)^2 - 4*(x^2 + y^2)"
HEART = "(x^2 + 9/4*y^2 + z^2 - 1)^3 - x^2*z^3 - 9/80*y^2*z^3"
TANGLE = "16*(x^4 + y^4 + z^4) - 20*(x^2 + y^2 + z^2) + 59/5"
PRODUCTS = {
    "ball, egg": (BALL, EGG),
    "ring, ball": (RING, BALL),
    "heart, ring": (HEART, RING),
    "tangle, egg": (TANGLE, EGG),
    "ball, egg, ring": (BALL, EGG, RING),
}


@pytest.mark.parametrize("factors", PRODUCTS.values(), ids=PRODUCTS)
@pytest.mark.parametrize("count", [5_000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_a_product_from_outside_is_the_union(factors: tuple[str, ...], count: int) -> None:
    rng = np.random.default_rng(1)
    target = rng.uniform(-1.2, 1.2, (count, 3))
    o = target + rng.uniform(5, 20, (count, 1)) * solids.directions(rng, count)
    d = (target - o) / np.linalg.norm(target - o, axis=1, keepdims=True)
    product = Traced(vr.Polynomial(expression="*".join(f"({f})" for f in factors), clip=CLIP))
    solid = tuple(vr.Polynomial(expression=f, clip=CLIP, ends="capped") for f in factors)
    union = Traced(vr.Csg(op="union", of=solid))
    one, other = product.first(o, d), union.first(o, d)
    both = one.hit & other.hit
    # Rays that touch a surface within rounding are met by chance once in a million.
    assert (one.hit != other.hit).sum() <= 1e-5 * count and 0.2 < both.mean() < 0.95
    cosine = np.abs((one.n * d).sum(1))
    apart = np.abs(one.t[both] - other.t[both]) > 1e-13 * one.t[both] / np.maximum(cosine[both], 1e-4)
    assert apart.sum() <= 1e-4 * count
    assert np.abs(np.abs((one.n * other.n).sum(1)[both]) - 1)[~apart].max() < 1e-6
    assert set(other.leaf[both]) == set(range(len(factors)))
